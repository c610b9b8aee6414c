// Predicted colours: the neighbours and steps that they are coded with, and that none is further off than
// promised.
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "libcolor/predicted/predicted.h"
#include "tests/libcolor/color_runs.h"
#include "tests/libcolor/reading.h"

namespace voxkit::color {
namespace {

/// Whatever has a place: one of these around, that comes before it.
TEST(KnownAround, HasTheNeighborsBefore) {
  for (const Voxels& voxels : {sphere_shell(4), scattered(4, 600, 3), scattered(21, 3000, 4),
                               voxels_where(4, [](uint32_t, uint32_t, uint32_t) { return true; })}) {
    std::vector<uint64_t> places;
    std::map<uint64_t, uint32_t> numbers;
    for (const SurfaceVoxel& voxel : voxels) {
      numbers[voxel.place] = static_cast<uint32_t>(places.size());
      places.push_back(voxel.place);
    }
    const auto cells = cells_of(places);
    const PartCells part(cells);
    uint32_t number = 0;
    for (const PartCell& cell : cells) {
      const KnownAround around(part, cell);
      ASSERT_EQ(cell.first, number);
      for (uint64_t left = cell.mask; left != 0; left &= left - 1, ++number) {
        std::map<uint32_t, uint32_t> seen, expected;
        around.for_each(static_cast<uint32_t>(std::countr_zero(left)), [&](const KnownNeighbor& neighbor) {
          EXPECT_TRUE(seen.emplace(neighbor.number, neighbor.axes).second);
        });
        const Index3 at(morton_place(places[number]));
        for (int i = 0; i < 27; ++i) {
          const Index3 to = at + Index3(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
          if (i == 13 || to.x < 0 || to.y < 0 || to.z < 0) continue;
          const auto found = numbers.find(morton_code(
              static_cast<uint32_t>(to.x), static_cast<uint32_t>(to.y), static_cast<uint32_t>(to.z)));
          if (found == numbers.end() || found->second >= number) continue;
          expected[found->second] =
              (to.x != at.x ? 1u : 0u) | (to.y != at.y ? 2u : 0u) | (to.z != at.z ? 4u : 0u);
        }
        ASSERT_EQ(seen, expected) << "voxel " << number;
      }
    }
    EXPECT_EQ(number, voxels.size());
  }
}

/// Every colour has a point of the lattice that near, and with one step more some have not.
TEST(ColorSteps, AreTheLargestThatCover) {
  const auto furthest = [](const std::array<uint8_t, 3>& steps) {
    int most = 0;
    for (int r = 0; r < 2 * steps[0]; ++r)
      for (int g = 0; g < 2 * steps[1]; ++g)
        for (int b = 0; b < 2 * steps[2]; ++b) {
          int nearest = 1 << 30;
          for (int k = 0; k < 16; ++k) {
            const int odd = k & 1, at[3] = {r, g, b};
            int squared = 0;
            for (int c = 0; c < 3; ++c) {
              const int d = at[c] - steps[static_cast<size_t>(c)] * (odd + 2 * (k >> (c + 1) & 1));
              squared += d * d;
            }
            nearest = std::min(nearest, squared);
          }
          most = std::max(most, nearest);
        }
    return most;
  };
  for (const double threshold : {1.0, 1.5, 2.0, 3.0, 5.0, 6.38, 9.56, 14.9}) {
    const ColorSteps steps = steps_for(threshold);
    EXPECT_LE(furthest(steps.steps), threshold * threshold) << threshold;
    std::array<uint8_t, 3> more = steps.steps;
    for (uint8_t& step : more) ++step;
    EXPECT_GT(furthest(more), threshold * threshold) << threshold;
  }
  for (const double none : {0.0, 0.5, 0.99}) EXPECT_TRUE(steps_for(none).lossless());
  for (const double all : {442.0, 1e6})
    EXPECT_EQ(steps_for(all).steps, (std::array<uint8_t, 3>{255, 255, 255}));
}

/// Of places with some colours, decoded.
std::vector<Rgb> there_and_back(const std::vector<Rgb>& colors, const std::vector<uint64_t>& places,
                                double threshold, EncodedPart& part) {
  part = encode_predicted(colors, places, threshold);
  const auto decoded = decode_predicted(part.bytes, cells_of(places), static_cast<uint32_t>(colors.size()));
  EXPECT_TRUE(decoded) << decoded.error().what;
  return decoded ? *decoded : std::vector<Rgb>();
}

TEST(Predicted, NoColorIsFurtherThanTheThreshold) {
  for (const Voxels& voxels : {Voxels{{5, {7, 200, 9}}}, sphere_shell(5), scattered(21, 3000, 5),
                               voxels_where(4, [](uint32_t x, uint32_t y, uint32_t z) {
                                 return x % 2 == 0 && y % 2 == 0 && z % 2 == 0;  // no neighbours
                               })}) {
    std::vector<uint64_t> places;
    for (const SurfaceVoxel& voxel : voxels) places.push_back(voxel.place);
    for (const ColorCase& c : color_cases(places.size(), 5))
      for (const double threshold : {0.0, 1.0, 9.56, 60.0, 442.0}) {
        SCOPED_TRACE(testing::Message() << c.name << ", threshold " << threshold);
        EncodedPart part, found;
        const auto decoded = there_and_back(c.colors, places, threshold, part);
        ASSERT_EQ(decoded.size(), c.colors.size());
        for (size_t i = 0; i < decoded.size(); ++i) found.add_error(c.colors[i], decoded[i]);
        EXPECT_LE(found.most_squared, threshold * threshold);
        EXPECT_EQ(found.most_squared, part.most_squared);
        EXPECT_EQ(found.squared_error, part.squared_error);
      }
  }
}

TEST(Predicted, EqualColorsTakeNextToNothing) {
  std::vector<uint64_t> places;
  for (const SurfaceVoxel& voxel : sphere_shell(7)) places.push_back(voxel.place);
  const std::vector<Rgb> colors(places.size(), Rgb{255, 0, 77});
  for (const double threshold : {0.0, 9.56}) {
    EncodedPart part;
    EXPECT_EQ(there_and_back(colors, places, threshold, part) == colors, threshold == 0);
    EXPECT_LT(part.bytes.size() * 500, places.size());
  }
}

/// One voxel more than a part has: the second part begins in the middle of a cell, whatever its geometry.
TEST(Predicted, PartsBeginAnywhere) {
  Voxels voxels;
  for (uint64_t place = 0; voxels.size() <= part_colors; ++place)
    if (place % 64 != 40) voxels.push_back({place * 3, {static_cast<uint8_t>(place >> 12), 7, 0}});
  const Index3 dims(256);
  for (const auto& [geometry, counts] :
       {std::pair(Geometry::ssvdag, Counts::node), {Geometry::octree, Counts::pointer}}) {
    Options options;
    options.codec = ColorCodec::predicted;
    options.threshold = 0;
    options.geometry = geometry;
    options.counts = counts;
    const auto volume = volume_of(voxels, dims, options);
    ASSERT_TRUE(volume);
    for (const uint64_t number : {uint64_t{0}, uint64_t{part_colors} - 1, uint64_t{part_colors}}) {
      const auto color = volume->color(number);
      ASSERT_TRUE(color) << color.error().what;
      EXPECT_EQ(*color, voxels[number].color);
    }
  }
}

TEST(Predicted, AnyBytesAreAnswered) {
  std::vector<uint64_t> places;
  std::vector<Rgb> colors;
  for (const SurfaceVoxel& voxel : sphere_shell(4)) {
    places.push_back(voxel.place);
    colors.push_back(voxel.color);
  }
  const auto cells = cells_of(places);
  const auto count = static_cast<uint32_t>(colors.size());
  const auto whole = encode_predicted(colors, places, 4).bytes;
  for (size_t length = 0; length < whole.size(); ++length) {
    const std::vector<std::byte> cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
    EXPECT_FALSE(decode_predicted(cut, cells, count));
  }
  std::mt19937 random(8);
  int refused = 0;
  for (int i = 0; i < 400; ++i) {
    auto bytes = whole;
    bytes[random() % bytes.size()] ^= static_cast<std::byte>(1 + random() % 255);
    refused += decode_predicted(bytes, cells, count) ? 0 : 1;
  }
  EXPECT_GT(refused, 370);
  auto longer = whole;
  longer.push_back({});
  EXPECT_FALSE(decode_predicted(longer, cells, count));
}

TEST(Predicted, OtherOrdersAreRefused) {
  Options options;
  options.codec = ColorCodec::predicted;
  EXPECT_TRUE(validate(options));
  options.curve = Curve::hilbert;
  EXPECT_FALSE(validate(options));
  options.curve = Curve::morton;
  options.colors = Colors::all;
  EXPECT_FALSE(validate(options));
  options.colors = Colors::leaf;
  options.space = ErrorSpace::lab;
  EXPECT_FALSE(validate(options));
}

}  // namespace
}  // namespace voxkit::color
