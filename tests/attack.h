// What is asked of every compressed volume, of any bytes: what the hostile tests of the codecs and their fuzz
// targets share. Each codec's attack.h asks the rest.
#pragma once

#include <fmt/format.h>

#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/container.h"
#include "formats/context.h"
#include "formats/volume.h"

namespace voxkit::test {

/// How a file was dealt with.
struct Answer {
  bool opened = false;
  bool checked = false;  ///< check() found nothing wrong
  std::string fault;     ///< what is not acceptable on any input, in words; empty where all is well
};

/// What is wrong with an error about a file: a class that no file can cause, or a message that is not one
/// line.
inline std::string judge(const Error& error) {
  if (error.code != ErrorCode::input && error.code != ErrorCode::limit)
    return fmt::format("error of class {}: {}", static_cast<int>(error.code), error.what);
  if (error.what.empty() || error.what.find('\n') != std::string::npos)
    return "a message that is not one line: " + error.what;
  return {};
}

/// Opens a container of these bytes, and with `open` the volume in it, and checks that; unless there is a
/// fault already, calls `ask(volume, answer, ctx)` for the rest, whether or not the check has found
/// something. `Own` is an Answer.
template <class Own, class Open, class Ask>
Own attack_with(std::span<const std::byte> file, const Open& open, const Ask& ask) {
  // Exactly its bytes on the heap: a sanitizer sees any read past the end.
  const auto bytes = std::make_shared<const std::vector<std::byte>>(file.begin(), file.end());
  Own answer;
  const auto container = Container::open(*bytes, "hostile", bytes);
  if (!container) {
    answer.fault = judge(container.error());
    return answer;
  }
  const auto opened = open(*container);
  if (!opened) {
    answer.fault = judge(opened.error());
    return answer;
  }
  answer.opened = true;
  MemoryBudget memory(uint64_t{256} << 20);
  Context ctx;
  ctx.memory = &memory;
  const Status checked = (*opened)->check(ctx);
  answer.checked = checked.has_value();
  if (!checked) answer.fault = judge(checked.error());
  if (answer.fault.empty() && !memory.reserve(memory.limit(), "all of it"))
    answer.fault = "reserved memory was not given back";
  memory.release(memory.limit());
  if (answer.fault.empty()) ask(**opened, answer, ctx);
  return answer;
}

inline Voxel voxel_at(const std::byte* bytes, VoxelFormat format) {
  Voxel voxel;
  std::memcpy(voxel.bytes.data(), bytes, static_cast<size_t>(voxel_bytes(format)));
  return voxel;
}

/// Volumes up to this many voxels are decoded in full, of larger ones the corners.
inline constexpr uint64_t whole_voxels = uint64_t{1} << 22;

/// All of a volume, or two corners of it.
inline std::vector<Box> boxes_of(Index3 dims) {
  if (*checked_voxels(dims) <= whole_voxels) return {{Index3(0), dims}};
  const Index3 size = intersect({Index3(0), dims}, {Index3(0), Index3(33)}).size();
  return {{Index3(0), size}, {dims - size, dims}};
}

/// Voxels of a box of this size that are asked for one by one.
inline std::vector<Index3> some_voxels(Index3 size) {
  return {Index3(0), size / Index3(2), size - Index3(1), Index3(size.x - 1, size.y / 2, 0)};
}

/// Decodes a box into a buffer of exactly its size with `decode(box, span)` and asks for some of it in the
/// other ways: a single voxel, with `sample(voxel)`, and what `uniform(box)` says of a region must agree with
/// it.
template <class Decode, class Sample, class Uniform>
std::string ask_box(VoxelFormat format, const Box& box, std::optional<std::vector<std::byte>>& out,
                    const Decode& decode, const Sample& sample, const Uniform& uniform) {
  const auto stride = static_cast<size_t>(voxel_bytes(format));
  const Index3 size = box.size();
  std::vector<std::byte> voxels(static_cast<size_t>(box.voxels()) * stride, std::byte{0xa5});
  const auto status = decode(box, packed(voxels.data(), size, format));
  const auto decoded = [&](Index3 v) {
    return voxel_at(&voxels[static_cast<size_t>((v.z * size.y + v.y) * size.x + v.x) * stride], format);
  };
  if (format == VoxelFormat::bitmap && status)
    for (const std::byte b : voxels)
      if (b > std::byte{1}) return "a bit that is neither 0 nor 1";
  for (const Index3 v : some_voxels(size)) {
    const auto voxel = sample(box.lo + v);
    if (!voxel) {
      if (status) return "a voxel of a box that can be decoded cannot: " + voxel.error().what;
      if (auto fault = judge(voxel.error()); !fault.empty()) return fault;
    } else if (status && *voxel != decoded(v)) {
      return fmt::format("voxel {},{},{} is not what the box has", v.x, v.y, v.z);
    }
    // The largest regions from this voxel on that the file says are uniform.
    for (int64_t edge = 1; edge <= 16; edge *= 2) {
      const Box part = intersect({v, v + Index3(edge)}, {Index3(0), size});
      const auto value = uniform(Box{box.lo + part.lo, box.lo + part.hi});
      if (!value || !status) continue;
      for (int64_t z = part.lo.z; z < part.hi.z; ++z)
        for (int64_t y = part.lo.y; y < part.hi.y; ++y)
          for (int64_t x = part.lo.x; x < part.hi.x; ++x)
            if (decoded({x, y, z}) != *value) return "uniform() is wrong";
    }
  }
  (void)uniform(box);
  if (!status) return judge(status.error());
  out = std::move(voxels);
  return {};
}

}  // namespace voxkit::test
