// All that can be asked of a compressed surface, asked of any bytes: what hostile_test.cc and the fuzz target
// share.
#pragma once

#include <glm/common.hpp>

#include "libcolor/color.h"
#include "libcolor/edit/arrangement.h"
#include "libcolor/edit/levels.h"
#include "libcolor/surface/morton.h"
#include "tests/attack.h"

namespace voxkit::color::test {

using voxkit::test::Answer;

/// A box, in one go and voxel by voxel.
inline std::string ask_box(const Volume& volume, const Box& box) {
  const Index3 size = box.size();
  std::vector<std::byte> voxels(static_cast<size_t>(box.voxels()) * 4, std::byte{0xa5});
  const VoxelSpan span = packed(voxels.data(), size, VoxelFormat::rgba32);
  const Status status = volume.decode(box, span);
  if (!status) return voxkit::test::judge(status.error());
  for (int64_t z = 0; z < size.z; z += 1 + size.z / 5)
    for (int64_t y = 0; y < size.y; y += 1 + size.y / 5)
      for (int64_t x = 0; x < size.x; x += 1 + size.x / 5) {
        const std::byte* const p = span.row(y, z) + 4 * x;
        if (p[3] != std::byte{0} && p[3] != std::byte{255} &&
            !volume.params().attributes.has(Attribute::opacity))
          return "an alpha that is neither 0 nor 255, without opacity";
        const Index3 at = box.lo + Index3(x, y, z);
        const auto voxel = volume.voxel(at);
        if (!voxel) {
          if (auto fault = voxkit::test::judge(voxel.error()); !fault.empty()) return fault;
          continue;
        }
        if (voxel->has_value() != (p[3] != std::byte{0})) return "a voxel that the box has not, or has alone";
        if (voxel->has_value() && volume.uniform({at, at + Index3(1)})) return "uniform() is wrong";
      }
  return {};
}

/// Some boxes, some colours, and all voxels in their order.
inline void ask(const Volume& volume, Answer& answer, Context& ctx) {
  const Index3 dims = volume.info().dims, size = glm::min(dims, Index3(48));
  for (const Index3 corner : {Index3(0), dims - size, (dims - size) / Index3(2)}) {
    answer.fault = ask_box(volume, {corner, corner + size});
    if (!answer.fault.empty()) return;
  }
  for (const uint64_t index : {uint64_t{0}, volume.params().color_count / 2, volume.params().color_count - 1})
    if (index < volume.params().color_count)
      if (const auto color = volume.color(index); !color && answer.fault.empty())
        answer.fault = voxkit::test::judge(color.error());
  // All voxels, as long as there are not too many.
  uint64_t count = 0, next = 0;
  bool ordered = true, complete = true;
  const Status walked = volume.for_each_voxel(
      [&](const VoxelRun& run) -> Status {
        for (const SurfaceVoxel& v : run.voxels) {
          ordered &= v.place >= next;
          next = v.place + 1;
        }
        complete &= run.attributes.size() == run.voxels.size() * volume.params().attributes.bytes();
        count += run.voxels.size();
        return count > 1000000 ? fail(ErrorCode::limit, {}, "enough") : Status();
      },
      ctx);
  if (!ordered) answer.fault = "voxels out of order";
  if (!complete) answer.fault = "voxels without their attributes";
  if (!walked && answer.fault.empty()) answer.fault = voxkit::test::judge(walked.error());
  if (!walked && answer.checked && walked.error().code != ErrorCode::limit)
    answer.fault = "check() finds nothing wrong, but voxels cannot be read: " + walked.error().what;
}

/// What is made of it: a box of a level, and a part that is moved, beside the whole.
inline void ask_edits(const Volume& volume, Answer& answer, Context& ctx) {
  const std::shared_ptr<const Volume> shared(std::shared_ptr<const Volume>(), &volume);
  const int level = std::min(1, level_count(volume.info()) - 1);
  const Index3 size = glm::min(level_info(volume.info(), level).dims, Index3(16));
  std::vector<std::byte> voxels(static_cast<size_t>(Box{Index3(0), size}.voxels()) * 4);
  const VoxelSpan span = packed(voxels.data(), size, VoxelFormat::rgba32);
  const Status decoded = open_level(shared, level, CellColors::stored)->read({Index3(0), size}, span);
  VolumeInfo info = volume.info();
  info.dims = glm::min(info.dims + Index3(1), Index3(24));
  Arrangement arrangement({{shared, Index3(1, -2, 0)}, {shared, Index3(0)}}, info);
  uint64_t next = 0;
  bool sound = true;
  const Status arranged = arrangement.read(ctx, [&](std::span<const SurfaceVoxel> run) -> Status {
    for (const SurfaceVoxel& v : run) {
      sound &= v.place >= next && Box{Index3(0), info.dims}.contains(Index3(morton_place(v.place)));
      next = v.place + 1;
    }
    return {};
  });
  if (!sound) answer.fault = "voxels of an arrangement out of order, or outside";
  for (const Status& status : {decoded, arranged}) {
    if (status || !answer.fault.empty()) continue;
    answer.fault = voxkit::test::judge(status.error());
    if (answer.checked) answer.fault = "check() finds nothing wrong, but edits do: " + status.error().what;
  }
}

inline Answer attack(std::span<const std::byte> file) {
  MemoryBudget decoded(uint64_t{256} << 20);
  const auto open = [&](const std::shared_ptr<const Container>& container) {
    return Volume::open(container, &decoded);
  };
  return voxkit::test::attack_with<Answer>(file, open,
                                           [](const Volume& volume, Answer& answer, Context& ctx) {
                                             ask(volume, answer, ctx);
                                             if (answer.fault.empty()) ask_edits(volume, answer, ctx);
                                           });
}

}  // namespace voxkit::color::test
