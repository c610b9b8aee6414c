// Files of layout packed in memory, written and read: what the tests of that layout share.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <vector>

#include "libsvmm/packed/packed.h"
#include "tests/damage.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::svmm::test {

using voxkit::test::Bytes;

inline MemoryBudget& memory() {
  static MemoryBudget budget(uint64_t{1} << 30);
  return budget;
}
struct Written {
  Bytes bytes;
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
inline std::shared_ptr<const PackedVolume> open(const Bytes& file) {
  const auto bytes = std::make_shared<const Bytes>(file);
  auto container = Container::open(*bytes, "packed", bytes);
  EXPECT_TRUE(container) << container.error().what;
  auto volume = PackedVolume::open(*container, memory());
  EXPECT_TRUE(volume) << volume.error().what;
  return volume ? *volume : nullptr;
}
inline Bytes decode(const PackedVolume& volume, int level, const Box& box) {
  Bytes voxels(static_cast<size_t>(box.voxels() * voxel_bytes(volume.info().format)));
  const Status status = volume.decode(box, level, packed(voxels.data(), box.size(), volume.info().format));
  EXPECT_TRUE(status) << status.error().what;
  return voxels;
}
inline Bytes decode(const PackedVolume& volume, int level = 0) {
  return decode(volume, level, {{0, 0, 0}, volume.levels()[static_cast<size_t>(level)].dims});
}

/// The stored values of voxels.
inline std::vector<double> numbers(const Bytes& voxels, VoxelFormat format) {
  std::vector<double> out;
  for (size_t i = 0; i < voxels.size(); i += static_cast<size_t>(voxel_bytes(format))) {
    Voxel v;
    std::memcpy(v.bytes.data(), &voxels[i], static_cast<size_t>(voxel_bytes(format)));
    out.push_back(format == VoxelFormat::float32 ? static_cast<double>(v.as<float>()) : v.as<uint32_t>());
  }
  return out;
}

}  // namespace voxkit::svmm::test
