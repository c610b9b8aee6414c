// All that can be asked of a file of layout packed, asked of any bytes: what packed_test.cc and the fuzz
// target share.
#pragma once

#include "formats/source.h"
#include "libsvmm/packed/packed.h"
#include "libsvmm/packed/salvage.h"
#include "tests/libsvmm/attack.h"

namespace voxkit::svmm::test {

/// What is left of a level: all of it, and nothing is said to be lost, where it can be decoded, and only
/// there. `whole`: it was, and is the last that `answer` has.
inline void ask_salvaged(const std::shared_ptr<const PackedVolume>& volume, int level, bool whole,
                         Answer& answer) {
  const Box box{Index3(0), volume->levels()[static_cast<size_t>(level)].dims};
  if (*checked_voxels(box.hi) > voxkit::test::whole_voxels) return;
  const VoxelFormat format = volume->info().format;
  std::vector<std::byte> voxels(static_cast<size_t>(box.voxels() * voxel_bytes(format)));
  const auto losses = std::make_shared<Losses>();
  const auto source = open_salvaged(volume, level, losses);
  if (!source || !(*source)->read(box, packed(voxels.data(), box.size(), format)))
    answer.fault = fmt::format("level {}: nothing can be salvaged", level);
  else if (whole != losses->pages().empty())
    answer.fault = fmt::format("level {}: {} pages are lost or doubtful", level, losses->pages().size());
  else if (whole && voxels != answer.levels.back())
    answer.fault = fmt::format("level {}: what is salvaged is not what is decoded", level);
}

inline Answer attack_packed(std::span<const std::byte> file) {
  MemoryBudget kept(uint64_t{256} << 20);  // of pages that were decoded
  std::shared_ptr<const PackedVolume> opened;
  const auto open = [&](const std::shared_ptr<const Container>& container) {
    auto volume = PackedVolume::open(container, kept);
    if (volume) opened = *volume;
    return volume;
  };
  const auto ask = [&](const PackedVolume& volume, Answer& answer, Context&) {
    for (int level = volume.finest(); level < volume.params().levels && answer.fault.empty(); ++level) {
      const bool whole = ask_level(volume, volume.levels()[static_cast<size_t>(level)].dims, level, answer);
      if (answer.fault.empty()) ask_salvaged(opened, level, whole, answer);
    }
  };
  auto answer = voxkit::test::attack_with<Answer>(file, open, ask);
  opened.reset();
  if (answer.fault.empty() && !kept.reserve(kept.limit(), "all of it"))
    answer.fault = "pages that were decoded are kept after all";
  return answer;
}

}  // namespace voxkit::svmm::test
