// What files say of the values of their pages holds, and what does not hold is found.
#include "libsvmm/packed/page_ranges.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libsvmm/packed/packed_layout.h"
#include "tests/libsvmm/packed_files.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;

constexpr Index3 dims(37, 35, 20);

Bytes made(VoxelFormat format, Content content) {
  const VolumeInfo info = make_info(dims, format);
  return bytes_of(make_voxels(info, content, 9), format);
}
Bytes file_of(VoxelFormat format, const Bytes& voxels, const PackedOptions& options = {}) {
  voxkit::test::MemorySource source(make_info(dims, format), voxels);
  return encode(source, options).bytes;
}
/// Where the chunk lies in a file; 0: there is none.
size_t place_of(const Bytes& file) {
  for (const ChunkEntry& entry : open(file)->container().table())
    if (entry.kind == ranges_kind) return entry.offset;
  return 0;
}

TEST(PageRanges, HoldAndAreNoneTooWide) {
  int there = 0;
  for (const VoxelFormat format : {VoxelFormat::density8, VoxelFormat::density16, VoxelFormat::float32})
    for (const Content content : {Content::noise, Content::smooth, Content::blobs, Content::specials})
      for (const double bound : {0.0, 2.0}) {
        if (content == Content::specials && format != VoxelFormat::float32) continue;
        const auto volume = open(file_of(format, made(format, content), {.max_error = bound}));
        Context ctx = context();
        ASSERT_TRUE(volume->check(ctx));
        const auto ranges = page_ranges(*volume);
        ASSERT_TRUE(ranges);
        // Not where they would take more than a 64th of what they are of.
        if (!*ranges) continue;
        ++there;
        const auto values = numbers(decode(*volume), format);
        const PageGrid grid(dims, 16);
        ASSERT_EQ((*ranges)->pages.size(), grid.pages());
        double least = INFINITY, greatest = -INFINITY;
        for (const double v : values)
          if (std::isfinite(v)) least = std::min(least, v), greatest = std::max(greatest, v);
        EXPECT_EQ((*ranges)->all, (ValueRange{least, greatest}));
        for (uint64_t page = 0; page < grid.pages(); ++page) {
          const Box box = grid.box(page);
          double lo = INFINITY, hi = -INFINITY;
          for (int64_t z = box.lo.z; z < box.hi.z; ++z)
            for (int64_t y = box.lo.y; y < box.hi.y; ++y)
              for (int64_t x = box.lo.x; x < box.hi.x; ++x) {
                const double v = values[static_cast<size_t>((z * dims.y + y) * dims.x + x)];
                if (std::isfinite(v)) lo = std::min(lo, v), hi = std::max(hi, v);
              }
          const auto said = (*ranges)->pages[page];
          EXPECT_LE(static_cast<double>(said.lo), lo);
          EXPECT_GE(static_cast<double>(said.hi), hi);
          // Of integers, and of floats in steps, they are off by a 16th of all.
          if (format == VoxelFormat::float32 && bound == 0) continue;
          EXPECT_GE(static_cast<double>(said.lo), lo - (greatest - least) / 15 - 1);
          EXPECT_LE(static_cast<double>(said.hi), hi + (greatest - least) / 15 + 1);
        }
      }
  EXPECT_GE(there, 12);
}

TEST(PageRanges, OfLabelsAreNotThere) {
  VolumeInfo info = make_info(dims, VoxelFormat::density8);
  info.is_labels = true;
  voxkit::test::MemorySource source(info, made(VoxelFormat::density8, Content::blobs));
  const auto volume = open(encode(source, {}).bytes);
  const auto ranges = page_ranges(*volume);
  ASSERT_TRUE(ranges);
  EXPECT_FALSE(*ranges);
}

TEST(PageRanges, ThatDoNotHoldAreFoundByTheCheck) {
  const Bytes good = file_of(VoxelFormat::density8, made(VoxelFormat::density8, Content::noise));
  const size_t at = place_of(good);
  ASSERT_NE(at, 0u);
  // The least and the greatest of all; the first page's.
  for (const size_t field : {0u, 4u, 8u}) {
    Bytes bad = good;
    bad[at + field] = bad[at + field] == std::byte{0x55} ? std::byte{0x66} : std::byte{0x55};
    voxkit::test::repair(bad);
    Context ctx = context();
    const Status status = open(bad)->check(ctx);
    ASSERT_FALSE(status) << field;
    EXPECT_EQ(status.error().code, ErrorCode::input);
    EXPECT_NE(status.error().what.find("RNGE"), std::string::npos) << status.error().what;
  }
}

TEST(PageRanges, OfMoreOrFewerPagesAreRefused) {
  const Bytes good = file_of(VoxelFormat::density8, made(VoxelFormat::density8, Content::noise));
  for (size_t i = 0; i < open(good)->container().table().size(); ++i) {
    if (open(good)->container().table()[i].kind != ranges_kind) continue;
    for (const int change : {-1, -4}) {
      Bytes bad = good;
      const size_t entry = good.size() - 64 - 64 * (open(good)->container().table().size() - i);
      uint64_t length;
      std::memcpy(&length, &bad[entry + 24], 8);
      length = static_cast<uint64_t>(static_cast<int64_t>(length) + change);
      std::memcpy(&bad[entry + 24], &length, 8);
      voxkit::test::repair(bad);
      const auto ranges = page_ranges(*open(bad));
      ASSERT_FALSE(ranges);
      EXPECT_EQ(ranges.error().code, ErrorCode::input);
    }
  }
}

}  // namespace
}  // namespace voxkit::svmm
