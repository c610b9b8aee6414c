// Sets of voxels to test with, in Morton order.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "libcolor/color.h"
#include "libcolor/surface/morton.h"
#include "libcolor/surface/surface.h"
#include "libcolor/textures/image_codec.h"
#include "libcolor/textures/texture.h"

namespace voxkit::color {

using Voxels = std::vector<SurfaceVoxel>;

/// All codecs that make textures in this build; below, all codecs that it has.
inline std::vector<ColorCodec> texture_codecs() {
  std::vector<ColorCodec> codecs = {ColorCodec::bc1, ColorCodec::bc7};
  if (texture_support(ColorCodec::astc)) codecs.push_back(ColorCodec::astc);
  return codecs;
}
/// Those that make images.
inline std::vector<ColorCodec> image_codecs() {
  std::vector<ColorCodec> codecs;
  for (const ColorCodec codec : {ColorCodec::jpeg, ColorCodec::jp2, ColorCodec::png})
    if (image_codec_support(image_format(codec))) codecs.push_back(codec);
  return codecs;
}
inline std::vector<ColorCodec> codecs() {
  std::vector<ColorCodec> codecs = {ColorCodec::raw, ColorCodec::fws, ColorCodec::vws, ColorCodec::palette,
                                    ColorCodec::predicted};
  for (const ColorCodec codec : texture_codecs()) codecs.push_back(codec);
  for (const ColorCodec codec : image_codecs()) codecs.push_back(codec);
  return codecs;
}

inline Rgb color_at(uint64_t place) {
  const auto p = morton_place(place);
  return {static_cast<uint8_t>(p.x * 5), static_cast<uint8_t>(p.y * 3 + p.x / 7),
          static_cast<uint8_t>(p.z * 9)};
}

/// The voxels of a cube of 2^height a side for which `inside` says so.
inline Voxels voxels_where(int height, const std::function<bool(uint32_t, uint32_t, uint32_t)>& inside) {
  Voxels voxels;
  for (uint64_t place = 0; place < uint64_t{1} << 3 * height; ++place) {
    const auto p = morton_place(place);
    if (inside(p.x, p.y, p.z)) voxels.push_back({place, color_at(place)});
  }
  return voxels;
}

/// A shell of a sphere that touches all sides.
inline Voxels sphere_shell(int height) {
  const int64_t side = int64_t{1} << height;
  return voxels_where(height, [&](uint32_t x, uint32_t y, uint32_t z) {
    const auto square = [&](uint32_t v) { return (2 * int64_t{v} + 1 - side) * (2 * int64_t{v} + 1 - side); };
    const int64_t r = square(x) + square(y) + square(z);
    return r <= side * side && r > (side - 4) * (side - 4);
  });
}

/// Voxels anywhere in a grid, some of them next to each other.
inline Voxels scattered(int height, size_t count, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<uint64_t> places;
  const uint64_t all = height == most_levels ? ~uint64_t{0} >> 1 : (uint64_t{1} << 3 * height) - 1;
  while (places.size() < count) {
    const uint64_t first = random() & all;
    for (uint64_t i = 0; i < random() % 9; ++i) places.push_back((first + i) & all);
  }
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  Voxels voxels;
  for (const uint64_t place : places) voxels.push_back({place, color_at(place)});
  return voxels;
}

/// Voxels in memory, in runs of any length.
class ListSource final : public SurfaceSource {
 public:
  ListSource(Voxels voxels, Index3 dims, size_t run = 999) : voxels_(std::move(voxels)), run_(run) {
    info_.dims = dims;
    info_.format = VoxelFormat::rgba32;
    info_.affine = Affine::plain({0.5, 0.5, 0.5}, info_.affine.origin);
  }
  Status read(Context&, const Sink& sink) override {
    for (size_t i = 0; i < voxels_.size(); i += run_)
      VOX_CHECK(sink(std::span(voxels_).subspan(i, std::min(run_, voxels_.size() - i))));
    return {};
  }

 private:
  Voxels voxels_;
  size_t run_;
};

/// A compressed file in memory; empty where that fails.
inline std::vector<std::byte> compressed(SurfaceSource& source, const Options& options, int threads = 1) {
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  ctx.threads = threads;
  std::vector<std::byte> bytes;
  const auto report = encode(
      source, options,
      [&](std::span<const std::byte> some) -> Status {
        bytes.insert(bytes.end(), some.begin(), some.end());
        return {};
      },
      ctx);
  return report ? bytes : std::vector<std::byte>();
}

}  // namespace voxkit::color
