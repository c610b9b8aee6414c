// A page of colours: which voxels are solid, and channels of these, each coded as a page of its own.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/volume.h"
#include "libpage/mask.h"
#include "libpage/page.h"
#include "libsvmm/packed/packed_layout.h"

namespace voxkit::svmm {

inline constexpr size_t most_channels = 4;
inline size_t channel_count(VoxelFormat format) {
  return format == VoxelFormat::rgba32 ? 4 : 3;
}

/// A page as it was decoded. Channels of void voxels are as they are predicted, for the pages whose parents
/// they are.
struct ColorPage {
  page::Mask mask;
  std::array<std::array<uint16_t, page::max_voxels>, most_channels> channels;
};

/// What the pages of a level are coded with.
struct ColorModel {
  page::MaskModel mask;
  std::vector<page::Model> models;  ///< of the channels
};

/// The page that the parents of a page lie in, and where.
struct ColorParent {
  const ColorPage* page = nullptr;
  page::Extent extent{};
  int x = 0, y = 0, z = 0;

  /// Where the parents of page `child` lie in theirs, which is one of `above`.
  void place(Index3 child, const PageGrid& above);
  page::MaskParent mask() const { return {page ? &page->mask : nullptr, extent, x, y, z}; }
  page::Parent<uint16_t> channel(size_t c) const {
    if (!page) return {};
    return {std::span(page->channels[c]).first(static_cast<size_t>(extent.voxels())), extent, x, y, z};
  }
};

/// Voxels of a page before they are coded: all but those whose bytes are 0 are solid.
struct ColorVoxels {
  page::Extent extent;
  page::Mask mask;
  std::array<std::array<uint8_t, page::max_voxels>, most_channels> rgba;

  /// From voxels of RGBA32 or RGB24.
  ColorVoxels(ConstVoxelSpan voxels, page::Extent size, VoxelFormat format);
  /// Channel c, with differences, if it has them, from `green`.
  void channel(size_t c, Channels channels, std::span<const uint16_t> green, std::span<uint16_t> out) const;
};

/// What is decoded of a page, but for what is predicted of void voxels: these are as their neighbours.
void about_as_decoded(const ColorVoxels& voxels, Channels channels, ColorPage& out);

/// Appends the bytes of a page's mask and of its channels; `decoded` receives what a decoder will have.
/// Each of R, G and B of a solid voxel is within the bound of the models, alpha within that of its own.
Status encode_color_page(const ColorModel& model, Channels channels, const ColorVoxels& voxels,
                         const ColorParent& parent, std::vector<std::byte>& mask,
                         std::span<std::vector<std::byte>> bytes, ColorPage& decoded);

/// Safe on any bytes. Errors: ErrorCode::input.
Status decode_color_page(const ColorModel& model, std::span<const std::byte> mask,
                         std::span<const std::span<const std::byte>> bytes, page::Extent extent,
                         const ColorParent& parent, ColorPage& out);

/// The part `part` of a page of `size` voxels, from its own corner on, as voxels; void ones are 0.
void place_colors(const ColorPage& page, Channels channels, Index3 size, const Box& part, VoxelSpan out);

}  // namespace voxkit::svmm
