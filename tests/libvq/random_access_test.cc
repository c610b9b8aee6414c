// Regions, single voxels and bricks agree with decoding everything; only what is needed is touched.
#include "libvq/store.h"
#include "tests/libvq/volumes.h"

namespace voxkit::vq {
namespace {

using namespace voxkit::vq::test;

std::vector<Options> layouts() {
  std::vector<Options> all(4);
  all[1].mapping = Mapping::direct;
  all[2].mapping = Mapping::indirect;
  all[3].codebook = Codebook::packed;
  return all;
}

TEST(VqAccess, RegionsSamplesAndUniformAgreeWithTheWhole) {
  std::mt19937 random(3);
  const SampleType types[] = {SampleType::u8, SampleType::u16, SampleType::f32, SampleType::bit};
  for (const SampleType type : types)
    for (const Content content : all_contents)
      for (Options options : layouts()) {
        // Noise in long rows, so that boxes are decoded in several runs.
        const Index3 dims = content == Content::noise ? Index3(663, 10, 9) : Index3(50, 43, 31);
        const VolumeInfo info = voxkit::test::scalar_info(dims, type);
        const int bits = type == SampleType::bit ? 1 : type == SampleType::u8 ? 8 : 12;
        options.range = {-3, 4095 * 0.25 - 3};
        const auto volume = encode_to_memory(info, make_voxels(info, content, bits, 11), options).open();
        const auto all = decode_all(*volume);
        const auto bytes = static_cast<size_t>(voxel_bytes(info.format));
        for (int trial = 0; trial < 30; ++trial) {
          Box box;
          for (int i = 0; i < 3; ++i) {
            const auto side = static_cast<uint64_t>(dims[i]);
            box.lo[i] = static_cast<int64_t>(random() % side);
            box.hi[i] = box.lo[i] + 1 + static_cast<int64_t>(random() % (trial % 2 ? 5 : side));
            box.hi[i] = std::min(box.hi[i], dims[i]);
          }
          const auto part = decode_box(*volume, box);
          const auto uniform = volume->uniform(box);
          const std::byte* p = part.data();
          bool same = true;
          for (int64_t z = box.lo.z; z < box.hi.z; ++z)
            for (int64_t y = box.lo.y; y < box.hi.y; ++y)
              for (int64_t x = box.lo.x; x < box.hi.x; ++x, p += bytes) {
                const std::byte* const whole =
                    &all[static_cast<size_t>((z * dims.y + y) * dims.x + x) * bytes];
                ASSERT_EQ(0, std::memcmp(p, whole, bytes));
                same = same && std::memcmp(p, part.data(), bytes) == 0;
                if (uniform) {
                  ASSERT_EQ(0, std::memcmp(p, uniform->bytes.data(), bytes));
                }
                if (trial < 3) {
                  ASSERT_EQ(0, std::memcmp(volume->sample({x, y, z})->bytes.data(), whole, bytes));
                }
              }
          if (content == Content::constant) {
            EXPECT_TRUE(uniform);
          }
          EXPECT_TRUE(same || !uniform);
        }
      }
}

TEST(VqAccess, ARegionReadsItsBricksAndNoOthers) {
  const VolumeInfo info = integer_info({64, 48, 40}, 8);
  const auto volume = encode_to_memory(info, make_voxels(info, Content::noise, 8, 2)).open();
  const struct {
    Box box;
    uint64_t bricks;
  } cases[] = {{{{0, 0, 0}, {1, 1, 1}}, 1},
               {{{0, 0, 0}, {4, 4, 4}}, 1},
               {{{3, 3, 3}, {5, 5, 5}}, 8},
               {{{4, 8, 12}, {8, 12, 20}}, 2},
               {{{0, 0, 0}, {64, 48, 40}}, 16 * 12 * 10},
               {{{1, 2, 3}, {63, 5, 4}}, 16 * 2},
               {{{60, 44, 36}, {64, 48, 40}}, 1}};
  for (const auto& c : cases) {
    std::vector<std::byte> out(static_cast<size_t>(c.box.voxels()));
    const auto bricks = volume->decode(c.box, packed(out.data(), c.box.size(), info.format));
    ASSERT_TRUE(bricks);
    EXPECT_EQ(*bricks, c.bricks);
  }
}

/// A voxel touches one chunk of each kind that leads to it.
TEST(VqAccess, ChunksAreTouchedWhenNeeded) {
  const Index3 dims{256, 256, 256};
  const VolumeInfo info = integer_info(dims, 8);
  const auto voxels = make_voxels(info, Content::noise, 8, 2);
  for (const Options& options : layouts()) {
    const Encoded encoded = encode_to_memory(info, voxels, options);
    const auto volume = encoded.open();
    const bool indirect = options.codebook == Codebook::rbuc && volume->params().mapping == Mapping::indirect;
    EXPECT_EQ(volume->container().chunks_touched(), 2u);  // the volume and the parameters
    ASSERT_TRUE(volume->sample({200, 100, 50}));
    const uint64_t once = 2u + (indirect ? 3 : 2);
    EXPECT_EQ(volume->container().chunks_touched(), once);
    ASSERT_TRUE(volume->sample({203, 101, 49}));
    EXPECT_EQ(volume->container().chunks_touched(), once);
    ASSERT_TRUE(volume->uniform({{200, 100, 48}, {204, 104, 52}}) == std::nullopt);
    EXPECT_EQ(volume->container().chunks_touched(), once);
    EXPECT_GT(volume->container().table().size(), 15u);
  }
}

/// The ranges of all bricks can be had without a single codeword.
TEST(VqAccess, RangesNeedNoCodewords) {
  const VolumeInfo info = integer_info({40, 40, 40}, 12);
  const auto voxels = make_voxels(info, Content::scan, 12, 2);
  for (const Options& options : layouts()) {
    const auto volume = encode_to_memory(info, voxels, options).open();
    for (int64_t z = 0; z < 10; ++z)
      for (int64_t y = 0; y < 10; ++y)
        for (int64_t x = 0; x < 10; ++x) {
          const auto id = volume->brick_id({x, y, z});
          ASSERT_TRUE(id);
          Brick brick;
          ASSERT_TRUE(volume->decode_brick(*id, brick));
          EXPECT_EQ(*volume->brick_range(*id), range_of(brick));
          for (size_t i = 0; i < brick.size(); i += 9) {
            const auto v = static_cast<int64_t>(i);
            EXPECT_EQ(volume->voxel_of(brick[i]),
                      *volume->sample(Index3(4 * x + v % 4, 4 * y + v / 4 % 4, 4 * z + v / 16)));
          }
        }
  }
}

TEST(VqAccess, OutsideIsAnError) {
  const VolumeInfo info = integer_info({5, 5, 5}, 8);
  const auto volume = encode_to_memory(info, make_voxels(info, Content::noise, 8, 2)).open();
  EXPECT_FALSE(volume->sample({5, 0, 0}));
  EXPECT_FALSE(volume->sample({0, -1, 0}));
  EXPECT_FALSE(volume->brick_id({2, 0, 0}));
  EXPECT_FALSE(volume->brick_range(uint64_t{1} << 40));
  Brick brick;
  EXPECT_FALSE(volume->decode_brick(~uint64_t{0}, brick));
  std::byte out[8];
  EXPECT_FALSE(volume->decode({{4, 4, 4}, {6, 6, 6}}, packed(out, Index3(2), info.format)));
  EXPECT_EQ(*volume->decode({{4, 4, 4}, {4, 6, 6}}, packed(out, Index3(2), info.format)), 0u);
}

TEST(VqAccess, AsASource) {
  const VolumeInfo info = integer_info({37, 20, 10}, 12);
  const auto voxels = make_voxels(info, Content::scan, 12, 5);
  const auto source = open_source(encode_to_memory(info, voxels).open());
  EXPECT_EQ(source->info().dims, info.dims);
  EXPECT_FALSE(source->forward_only());
  EXPECT_EQ(voxkit::test::bytes_of(voxkit::test::read_all<uint16_t>(*source, Index3(11))), voxels);
  EXPECT_EQ(encode_to_memory(*source).bytes, encode_to_memory(info, voxels).bytes);
}

}  // namespace
}  // namespace voxkit::vq
