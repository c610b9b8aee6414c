// All that can be asked of a file of layout packed, asked of any bytes: what packed_test.cc and the fuzz
// target share.
#pragma once

#include "libsvmm/packed/packed.h"
#include "tests/libsvmm/attack.h"

namespace voxkit::svmm::test {

inline Answer attack_packed(std::span<const std::byte> file) {
  MemoryBudget kept(uint64_t{256} << 20);  // of pages that were decoded
  const auto open = [&](const std::shared_ptr<const Container>& container) {
    return PackedVolume::open(container, kept);
  };
  const auto ask = [](const PackedVolume& volume, Answer& answer, Context&) {
    for (int level = 0; level < volume.params().levels && answer.fault.empty(); ++level)
      ask_level(volume, volume.levels()[static_cast<size_t>(level)].dims, level, answer);
  };
  auto answer = voxkit::test::attack_with<Answer>(file, open, ask);
  if (answer.fault.empty() && !kept.reserve(kept.limit(), "all of it"))
    answer.fault = "pages that were decoded are kept after all";
  return answer;
}

}  // namespace voxkit::svmm::test
