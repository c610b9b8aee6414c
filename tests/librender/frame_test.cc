// The memory of frames: counted in one place, for whatever is drawn.
#include "librender/frame.h"

#include <gtest/gtest.h>

#include "formats/volume/readers.h"
#include "librender/dvr/dvr.h"
#include "tests/libcolor/scenes.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::render {
namespace {

constexpr uint64_t lots = uint64_t{1} << 32;

/// How much of a budget is taken.
uint64_t taken(MemoryBudget& budget) {
  uint64_t free = 0;
  for (uint64_t step = lots; step > 0; step /= 2)
    if (budget.reserve(free + step, "a test")) {
      budget.release(free + step);
      free += step;
    }
  return budget.limit() - free;
}

TEST(Frame, CountsWhatItHoldsAsLongAsItLives) {
  MemoryBudget budget(lots);
  const Context ctx{.memory = &budget};
  {
    Frame frame;
    EXPECT_EQ(taken(budget), 0u);
    ASSERT_TRUE(frame.begin({10, 7}, ctx));
    EXPECT_EQ(taken(budget), 70 * sizeof(Pixel));
    ASSERT_TRUE(frame.begin({10, 7, true, true}, ctx));
    EXPECT_EQ(taken(budget), 70 * (sizeof(Pixel) + sizeof(PixelDetail) + sizeof(PixelCost)));
    EXPECT_EQ(frame.details.size(), 70u);
    EXPECT_EQ(frame.costs.size(), 70u);
    // Larger, not twice as large as before.
    ASSERT_TRUE(frame.begin({11, 7, true, true}, ctx));
    EXPECT_EQ(taken(budget), (FrameJob{11, 7, true, true}.bytes()));
    // What it has is kept for the next picture, and counted.
    frame.rays_hit = frame.samples = frame.bricks_decoded = 5;
    frame.lookup_seconds = 1;
    ASSERT_TRUE(frame.begin({3, 2}, ctx));
    EXPECT_EQ(taken(budget), (FrameJob{11, 7, true, true}.bytes()));
    EXPECT_EQ(frame.pixels.size(), 6u);
    EXPECT_EQ(frame.details.size() + frame.costs.size(), 0u);
    EXPECT_EQ(frame.rays, 6u);
    EXPECT_EQ(frame.rays_hit + frame.samples + frame.bricks_decoded, 0u);
    EXPECT_EQ(frame.lookup_seconds, 0);
    const Frame moved = std::move(frame);
    EXPECT_EQ(taken(budget), (FrameJob{11, 7, true, true}.bytes()));
  }
  EXPECT_EQ(taken(budget), 0u);
}

TEST(Frame, IsRefusedBeyondTheLimitAndThenHoldsNothing) {
  MemoryBudget budget(100 * sizeof(Pixel));
  const Context ctx{.memory = &budget};
  Frame frame;
  ASSERT_TRUE(frame.begin({10, 10}, ctx));
  const Status status = frame.begin({10, 10, true}, ctx);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::limit);
  EXPECT_NE(status.error().what.find("a frame of 10 x 10 rays"), std::string::npos);
  EXPECT_EQ(frame.pixels.capacity(), 0u);
  EXPECT_TRUE(budget.reserve(100 * sizeof(Pixel), "all of it"));
}

/// Whatever draws asks for its memory: with a limit that leaves room for the volume but not for the frame, it
/// is an error.
template <class Draw>
void expect_counted(const FrameJob& job, const Draw& draw) {
  MemoryBudget enough(lots), scarce(job.bytes() - 1);
  Context ctx{.threads = 2, .memory = &enough};
  {
    Frame frame;
    ASSERT_TRUE(draw(frame, ctx));
    EXPECT_GE(taken(enough), job.bytes());
  }
  ctx.memory = &scarce;
  Frame frame;
  const Status status = draw(frame, ctx);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::limit);
}

TEST(Frame, IsCountedByEverythingThatDraws) {
  Context ctx = svmm::test::context();
  const Camera camera = Camera::orbit(30, 20, 1.8, 45);
  CastOptions options;
  options.width = options.height = 300;
  FrameJob job{300, 300};
  auto source = open_builtin("sphere:20");
  const auto grid = DenseGrid::read(**source, ctx);
  ASSERT_TRUE(grid);
  expect_counted(job, [&](Frame& f, Context& c) { return cast(**grid, camera, options, f, c); });
  const SvmmGrid compressed(
      svmm::test::encode_to_memory(**source, svmm::test::make_params(VoxelFormat::density8, 100, {}, 4))
          .open());
  options.skip = false;  // no memo of void
  expect_counted(job, [&](Frame& f, Context& c) { return cast(compressed, camera, options, f, c); });

  auto volume = DvrVolume::open(*grid, ctx);
  ASSERT_TRUE(volume);
  const auto scene = DvrScene::create(std::make_shared<const DvrVolume>(std::move(*volume)),
                                      *transfer_preset("gray", {0, 255}), ctx);
  ASSERT_TRUE(scene);
  DvrOptions dvr;
  dvr.width = dvr.height = 300;
  dvr.details = true;
  job.details = true;
  expect_counted(job, [&](Frame& f, Context& c) { return scene->draw(camera, dvr, f, c); });

  // Details are where colours are looked up, asked for or not.
  color::ListSource shell(color::sphere_shell(5), Index3(32));
  const auto bytes = std::make_shared<const std::vector<std::byte>>(color::compressed(shell, {}));
  const auto surface = color::Volume::open(*Container::open(*bytes, "file", bytes));
  ASSERT_TRUE(surface);
  const DagGrid dag(*surface);
  expect_counted(job, [&](Frame& f, Context& c) { return cast(dag, camera, options, f, c); });
}

}  // namespace
}  // namespace voxkit::render
