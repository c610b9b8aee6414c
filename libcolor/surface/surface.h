// Coloured surfaces: voxels in space, each with one colour, from wherever they come.
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "formats/context.h"
#include "formats/volume.h"
#include "libcolor/surface/attributes.h"

namespace voxkit::color {

/// A colour as it is stored and compared: sRGB, 8 bits a channel.
struct Rgb {
  uint8_t r = 0, g = 0, b = 0;
  friend bool operator==(const Rgb&, const Rgb&) = default;
};

/// A voxel of a surface. `place` is its Morton code: bit 3i is bit i of x, bit 3i + 1 that of y, bit 3i + 2
/// that of z, so a side has at most 2^21 voxels.
struct SurfaceVoxel {
  uint64_t place = 0;
  Rgb color;
};
inline constexpr int most_levels = 21;

/// Some voxels, one after the other, and what they have beside colours: AttributeSet::bytes of each, in the
/// same order. What is made of voxels alone has none.
struct VoxelRun {
  std::span<const SurfaceVoxel> voxels;
  std::span<const std::byte> attributes;

  VoxelRun(std::span<const SurfaceVoxel> v, std::span<const std::byte> a = {}) : voxels(v), attributes(a) {}
  template <class Voxels>
  requires(!std::same_as<Voxels, VoxelRun> &&
           std::convertible_to<const Voxels&, std::span<const SurfaceVoxel>>) VoxelRun(const Voxels& v)
      : voxels(v) {}
  /// For those who look at colours only.
  operator std::span<const SurfaceVoxel>() const { return voxels; }
};

/// The alpha of voxel `i` of a run: its opacity, and at least 1, if voxels have that, else 255.
inline uint8_t alpha_of(const VoxelRun& run, size_t i, AttributeSet set) {
  if (!set.has(Attribute::opacity)) return 255;
  const auto opacity =
      std::to_integer<uint8_t>(run.attributes[i * set.bytes() + set.offset(Attribute::opacity)]);
  return opacity == 0 ? uint8_t{1} : opacity;
}

/// A coloured surface that is read once, in Morton order, in bounded memory.
class SurfaceSource {
 public:
  virtual ~SurfaceSource() = default;

  /// Extents and place in space; the format is rgba32, no side is above 2^21.
  const VolumeInfo& info() const { return info_; }
  /// What the input says and a surface cannot, a sentence each.
  const std::vector<std::string>& notes() const { return notes_; }
  /// Whether the input's emission is in the colours.
  bool emits() const { return emits_; }

  /// What its voxels have beside colours.
  AttributeSet attributes() const { return attributes_; }

  using Sink = std::function<Status(const VoxelRun&)>;
  /// Calls `sink`, from one thread at a time, with runs of voxels. Places ascend strictly, within a run and
  /// from run to run: each voxel comes once. Uses ctx.threads threads; what comes does not depend on them.
  virtual Status read(Context& ctx, const Sink& sink) = 0;

 protected:
  VolumeInfo info_;
  std::vector<std::string> notes_;
  bool emits_ = false;
  AttributeSet attributes_;
};

}  // namespace voxkit::color
