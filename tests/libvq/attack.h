// All that can be asked of a VQ file, asked of any bytes: what hostile_test.cc and the fuzz targets share.
#pragma once

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "libvq/vq.h"

namespace voxkit::vq::test {

/// How a file was dealt with.
struct Answer {
  bool opened = false;
  bool checked = false;                          ///< check() found nothing wrong
  std::optional<std::vector<std::byte>> voxels;  ///< decoded in full, if that could be
  std::string fault;  ///< what is not acceptable on any input, in words; empty where all is well
};

namespace detail {

inline std::string judge(const Error& error) {
  if (error.code != ErrorCode::input && error.code != ErrorCode::limit)
    return fmt::format("error of class {}: {}", static_cast<int>(error.code), error.what);
  if (error.what.empty() || error.what.find('\n') != std::string::npos)
    return "a message that is not one line: " + error.what;
  return {};
}

inline Voxel voxel_at(const std::byte* bytes, VoxelFormat format) {
  Voxel v;
  std::memcpy(v.bytes.data(), bytes, static_cast<size_t>(voxel_bytes(format)));
  return v;
}

/// Bricks one by one: ids, ranges and codes must agree with each other.
inline std::string ask_brick(const Volume& volume, Index3 brick) {
  const auto id = volume.brick_id(brick);
  if (!id) return judge(id.error());
  const auto range = volume.brick_range(*id);
  Brick codes;
  const Status status = volume.decode_brick(*id, codes);
  if (!range) return status ? "a brick without a range can be decoded" : judge(range.error());
  if (range->min > range->max || range->max >> volume.params().bits != 0)
    return fmt::format("a range of {} to {}", range->min, range->max);
  if (!status) return judge(status.error());
  for (const uint16_t code : codes)
    if (code < range->min || code > range->max) return "a code outside the range of its brick";
  return {};
}

/// Decodes a box into a buffer of exactly its size and asks for some of it in the other ways: a single voxel
/// and uniform regions must agree with the box.
inline std::string ask_box(const Volume& volume, const Box& box, std::optional<std::vector<std::byte>>& out) {
  const VoxelFormat format = volume.info().format;
  const auto stride = static_cast<size_t>(voxel_bytes(format));
  const Index3 size = box.size();
  std::vector<std::byte> voxels(static_cast<size_t>(box.voxels()) * stride, std::byte{0xa5});
  const auto status = volume.decode(box, packed(voxels.data(), size, format));
  const auto decoded = [&](Index3 v) {
    return voxel_at(&voxels[static_cast<size_t>((v.z * size.y + v.y) * size.x + v.x) * stride], format);
  };
  if (format == VoxelFormat::bitmap && status)
    for (const std::byte b : voxels)
      if (b > std::byte{1}) return "a bit that is neither 0 nor 1";
  for (const Index3 v : {Index3(0), size / Index3(2), size - Index3(1), Index3(size.x - 1, size.y / 2, 0)}) {
    if (auto fault = ask_brick(volume, (box.lo + v) / Index3(brick_edge)); !fault.empty()) return fault;
    const auto sample = volume.sample(box.lo + v);
    if (!sample) {
      if (status) return "a voxel of a box that can be decoded cannot: " + sample.error().what;
      if (auto fault = judge(sample.error()); !fault.empty()) return fault;
    } else if (status && *sample != decoded(v)) {
      return fmt::format("voxel {},{},{} is not what the box has", v.x, v.y, v.z);
    }
    for (int64_t edge = 1; edge <= 16; edge *= 2) {
      const Box part = intersect({v, v + Index3(edge)}, {Index3(0), size});
      const auto value = volume.uniform({box.lo + part.lo, box.lo + part.hi});
      if (!value || !status) continue;
      for (int64_t z = part.lo.z; z < part.hi.z; ++z)
        for (int64_t y = part.lo.y; y < part.hi.y; ++y)
          for (int64_t x = part.lo.x; x < part.hi.x; ++x)
            if (decoded({x, y, z}) != *value) return "uniform() is wrong";
    }
  }
  if (!status) return judge(status.error());
  out = std::move(voxels);
  return {};
}

}  // namespace detail

/// Volumes up to this many voxels are decoded in full, of larger ones the corners.
inline constexpr uint64_t whole_voxels = uint64_t{1} << 22;

inline Answer attack(std::span<const std::byte> file) {
  // Exactly its bytes on the heap: a sanitizer sees any read past the end.
  const auto bytes = std::make_shared<const std::vector<std::byte>>(file.begin(), file.end());
  Answer answer;
  const auto container = Container::open(*bytes, "hostile", bytes);
  if (!container) {
    answer.fault = detail::judge(container.error());
    return answer;
  }
  const auto opened = Volume::open(*container);
  if (!opened) {
    answer.fault = detail::judge(opened.error());
    return answer;
  }
  answer.opened = true;
  const Volume& volume = **opened;
  MemoryBudget memory(uint64_t{256} << 20);
  Context ctx;
  ctx.memory = &memory;
  const Status checked = volume.check(ctx);
  answer.checked = checked.has_value();
  if (!checked) answer.fault = detail::judge(checked.error());
  if (answer.fault.empty() && !memory.reserve(memory.limit(), "all of it"))
    answer.fault = "reserved memory was not given back";
  if (!answer.fault.empty()) return answer;

  const Index3 dims = volume.info().dims;
  std::optional<std::vector<std::byte>> decoded;
  if (*checked_voxels(dims) <= whole_voxels) {
    answer.fault = detail::ask_box(volume, volume.info().box(), decoded);
    answer.voxels = decoded;
  } else {
    const Index3 size{std::min<int64_t>(dims.x, 33), std::min<int64_t>(dims.y, 33),
                      std::min<int64_t>(dims.z, 33)};
    answer.fault = detail::ask_box(volume, {Index3(0), size}, decoded);
    if (answer.fault.empty()) answer.fault = detail::ask_box(volume, {dims - size, dims}, decoded);
  }
  if (answer.fault.empty() && answer.checked && !decoded)
    answer.fault = "check() finds nothing wrong, but the volume cannot be decoded";
  return answer;
}

}  // namespace voxkit::vq::test
