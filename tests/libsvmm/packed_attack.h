// All that can be asked of a file of layout packed, asked of any bytes: what packed_test.cc and the fuzz
// target share.
#pragma once

#include "libsvmm/packed/packed.h"
#include "tests/attack.h"

namespace voxkit::svmm::test {

inline voxkit::test::Answer attack_packed(std::span<const std::byte> file) {
  MemoryBudget kept(uint64_t{256} << 20);  // of pages that were decoded
  const auto open = [&](const std::shared_ptr<const Container>& container) {
    return PackedVolume::open(container, kept);
  };
  const auto ask = [](const PackedVolume& volume, voxkit::test::Answer& answer, Context&) {
    for (int level = 0; level < volume.params().levels && answer.fault.empty(); ++level)
      for (const Box& box : voxkit::test::boxes_of(volume.levels()[static_cast<size_t>(level)].dims)) {
        std::optional<std::vector<std::byte>> decoded;
        const auto fault = voxkit::test::ask_box(
            volume.info().format, box, decoded,
            [&](const Box& part, VoxelSpan out) { return volume.decode(part, level, out); },
            [&](Index3 voxel) { return volume.sample(voxel, level); },
            [&](const Box& part) { return volume.uniform(part, level); });
        if (!fault.empty()) answer.fault = fmt::format("level {}: {}", level, fault);
        if (answer.fault.empty() && answer.checked && !decoded)
          answer.fault = fmt::format("check() finds nothing wrong, but level {} cannot be decoded", level);
      }
  };
  auto answer = voxkit::test::attack_with<voxkit::test::Answer>(file, open, ask);
  if (answer.fault.empty() && !kept.reserve(kept.limit(), "all of it"))
    answer.fault = "pages that were decoded are kept after all";
  return answer;
}

}  // namespace voxkit::svmm::test
