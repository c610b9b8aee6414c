// Files of layout packed in memory, for the tests.
#pragma once

#include <gtest/gtest.h>

#include "libsvmm/packed/packed.h"
#include "tests/damage.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::svmm::test {

inline MemoryBudget& memory() {
  static MemoryBudget budget(uint64_t{1} << 30);
  return budget;
}
struct Written {
  voxkit::test::Bytes bytes;
  PackedParams params;
};
inline Written encode(VolumeSource& source, const PackedOptions& options, int threads = 2) {
  Context ctx = context(threads);
  Written out;
  const auto params = encode_packed(
      source, options,
      [&](std::span<const std::byte> bytes) -> Status {
        out.bytes.insert(out.bytes.end(), bytes.begin(), bytes.end());
        return {};
      },
      ctx);
  EXPECT_TRUE(params) << params.error().what;
  if (params) out.params = *params;
  return out;
}
inline std::shared_ptr<const PackedVolume> open(const voxkit::test::Bytes& file) {
  const auto bytes = std::make_shared<const voxkit::test::Bytes>(file);
  auto container = Container::open(*bytes, "packed", bytes);
  EXPECT_TRUE(container) << container.error().what;
  auto volume = PackedVolume::open(*container, memory());
  EXPECT_TRUE(volume) << volume.error().what;
  return volume ? *volume : nullptr;
}
inline voxkit::test::Bytes decode(const PackedVolume& volume, int level, const Box& box) {
  voxkit::test::Bytes voxels(static_cast<size_t>(box.voxels() * voxel_bytes(volume.info().format)));
  const Status status = volume.decode(box, level, packed(voxels.data(), box.size(), volume.info().format));
  EXPECT_TRUE(status) << status.error().what;
  return voxels;
}
inline voxkit::test::Bytes decode(const PackedVolume& volume, int level = 0) {
  return decode(volume, level, {{0, 0, 0}, volume.levels()[static_cast<size_t>(level)].dims});
}

}  // namespace voxkit::svmm::test
