// All that can be asked of a VQ file, asked of any bytes: what hostile_test.cc and the fuzz targets share.
#pragma once

#include "libvq/vq.h"
#include "tests/attack.h"

namespace voxkit::vq::test {

struct Answer : voxkit::test::Answer {
  std::optional<std::vector<std::byte>> voxels;  ///< decoded in full, if that could be
};

/// Bricks one by one: ids, ranges and codes must agree with each other.
inline std::string ask_brick(const Volume& volume, Index3 brick) {
  const auto id = volume.brick_id(brick);
  if (!id) return voxkit::test::judge(id.error());
  const auto range = volume.brick_range(*id);
  Brick codes;
  const Status status = volume.decode_brick(*id, codes);
  if (!range) return status ? "a brick without a range can be decoded" : voxkit::test::judge(range.error());
  if (range->min > range->max || range->max >> volume.params().bits != 0)
    return fmt::format("a range of {} to {}", range->min, range->max);
  if (!status) return voxkit::test::judge(status.error());
  for (const uint16_t code : codes)
    if (code < range->min || code > range->max) return "a code outside the range of its brick";
  return {};
}

inline Answer attack(std::span<const std::byte> file) {
  const auto open = [](const std::shared_ptr<const Container>& container) { return Volume::open(container); };
  return voxkit::test::attack_with<Answer>(file, open, [](const Volume& volume, Answer& answer, Context&) {
    for (const Box& box : voxkit::test::boxes_of(volume.info().dims)) {
      for (const Index3 v : voxkit::test::some_voxels(box.size()))
        if (answer.fault.empty()) answer.fault = ask_brick(volume, (box.lo + v) / Index3(brick_edge));
      if (!answer.fault.empty()) return;
      std::optional<std::vector<std::byte>> decoded;
      answer.fault = voxkit::test::ask_box(
          volume.info().format, box, decoded,
          [&](const Box& part, VoxelSpan out) { return volume.decode(part, out); },
          [&](Index3 voxel) { return volume.sample(voxel); },
          [&](const Box& part) { return volume.uniform(part); });
      if (answer.fault.empty() && answer.checked && !decoded)
        answer.fault = "check() finds nothing wrong, but the volume cannot be decoded";
      if (!answer.fault.empty()) return;
      if (decoded && box.size() == volume.info().dims) answer.voxels = std::move(decoded);
    }
  });
}

}  // namespace voxkit::vq::test
