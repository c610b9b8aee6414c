// All that can be asked of an SVMM file, asked of any bytes: what hostile_test.cc and the fuzz targets share.
#pragma once

#include "libsvmm/svmm.h"
#include "tests/attack.h"

namespace voxkit::svmm::test {

struct Answer : voxkit::test::Answer {
  std::vector<std::vector<std::byte>> levels;  ///< decoded in full, if all could be
};

/// A level of these dims, of either kind of volume, or corners of it; whether it was decoded in full.
template <class AnyVolume>
bool ask_level(const AnyVolume& volume, Index3 dims, int level, Answer& answer) {
  bool whole = true;
  for (const Box& box : voxkit::test::boxes_of(dims)) {
    std::optional<std::vector<std::byte>> decoded;
    const auto fault = voxkit::test::ask_box(
        volume.info().format, box, decoded,
        [&](const Box& part, VoxelSpan out) { return volume.decode(part, level, out); },
        [&](Index3 voxel) { return volume.sample(voxel, level); },
        [&](const Box& part) { return volume.uniform(part, level); });
    if (!fault.empty()) answer.fault = fmt::format("level {}: {}", level, fault);
    if (answer.fault.empty() && answer.checked && !decoded)
      answer.fault = fmt::format("check() finds nothing wrong, but level {} cannot be decoded", level);
    if (!answer.fault.empty()) return false;
    whole = decoded && box.size() == dims;
    if (whole) answer.levels.push_back(std::move(*decoded));
  }
  return whole;
}

inline Answer attack(std::span<const std::byte> file) {
  const auto open = [](const std::shared_ptr<const Container>& container) { return Volume::open(container); };
  return voxkit::test::attack_with<Answer>(file, open, [](const Volume& volume, Answer& answer, Context&) {
    bool whole = true;
    for (int level = 0; level < static_cast<int>(volume.levels().size()) && answer.fault.empty(); ++level) {
      const Index3 dims = volume.dims_at(level);
      if (checked_voxels(dims))
        whole &= ask_level(volume, dims, level, answer);
      else
        answer.fault = fmt::format("level {} of {} x {} x {}", level, dims.x, dims.y, dims.z);
    }
    if (!whole) answer.levels.clear();
  });
}

}  // namespace voxkit::svmm::test
