// Which bytes a view needs: a file in which all others are garbage decodes to the same.
#include "libsvmm/packed/needed_ranges.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/libsvmm/packed_files.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;

Bytes only(const Bytes& file, const std::vector<NeededRange>& ranges) {
  Bytes out(file.size(), Bytes::value_type{0xA5});
  for (const NeededRange& r : ranges)
    std::copy(file.begin() + static_cast<int64_t>(r.begin), file.begin() + static_cast<int64_t>(r.end),
              out.begin() + static_cast<int64_t>(r.begin));
  return out;
}

TEST(NeededRanges, AreAllThatIsRead) {
  const Index3 dims{129, 17, 129};
  const Box boxes[] = {
      {{0, 0, 0}, dims}, {{0, 0, 0}, {1, 1, 1}}, {{128, 16, 128}, dims}, {{20, 10, 50}, {90, 13, 51}}};
  for (const VoxelFormat format : {VoxelFormat::density8, VoxelFormat::rgba32}) {
    const VolumeInfo info = make_info(dims, format);
    voxkit::test::MemorySource source(info, bytes_of(make_voxels(info, Content::noise, 7), format));
    for (const bool levels : {false, true}) {
      if (!levels && is_color(format)) continue;
      const Written file = encode(source, {.levels = levels, .page_side = 16});
      const auto volume = open(file.bytes);
      ASSERT_TRUE(volume);
      for (int level = 0; level < volume->params().levels; ++level)
        for (const Box& box : boxes) {
          const auto ranges = needed_ranges(*volume, box, level);
          const int64_t f = int64_t{1} << level;
          const Box seen{box.lo / f, (box.hi + (f - 1)) / f};
          const auto part = open(only(file.bytes, ranges));
          ASSERT_TRUE(part);
          EXPECT_EQ(decode(*part, level, seen), decode(*volume, level, seen)) << name(format) << level;
          // Index first, then coarse to fine; no byte twice.
          uint64_t total = 0;
          for (size_t i = 0; i < ranges.size(); ++i) {
            EXPECT_LT(ranges[i].begin, ranges[i].end);
            total += ranges[i].end - ranges[i].begin;
            if (i == 0) continue;
            const bool same = ranges[i].level == ranges[i - 1].level;
            EXPECT_TRUE(same ? ranges[i].begin >= ranges[i - 1].end
                             : ranges[i - 1].level == NeededRange::index ||
                                   ranges[i].level < ranges[i - 1].level);
          }
          EXPECT_LE(total, file.bytes.size());
          if (level == 0 && box == boxes[1]) {
            EXPECT_LT(total, file.bytes.size());
          }
        }
    }
  }
}

}  // namespace
}  // namespace voxkit::svmm
