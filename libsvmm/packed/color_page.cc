#include "libsvmm/packed/color_page.h"

#include <algorithm>
#include <cstring>

namespace voxkit::svmm {

ColorVoxels::ColorVoxels(ConstVoxelSpan voxels, page::Extent size, VoxelFormat format) : extent(size) {
  const size_t channels = channel_count(format);
  size_t at = 0;
  for (int z = 0; z < size.nz; ++z)
    for (int y = 0; y < size.ny; ++y) {
      const std::byte* voxel = voxels.row(y, z);
      for (int x = 0; x < size.nx; ++x, ++at, voxel += channels) {
        bool solid = false;
        for (size_t c = 0; c < channels; ++c) {
          rgba[c][at] = std::to_integer<uint8_t>(voxel[c]);
          solid |= rgba[c][at] != 0;
        }
        if (solid) mask.set(x, y, z);
      }
    }
}

void ColorVoxels::channel(size_t c, Channels channels, std::span<const uint16_t> green,
                          std::span<uint16_t> out) const {
  const auto& from = rgba[c == 0 ? 1 : c == 1 ? 0 : c];
  const bool difference = channels.greatest(c) == most_difference;
  for (size_t i = 0; i < out.size(); ++i)
    out[i] = static_cast<uint16_t>(difference ? from[i] - green[i] + difference_offset : from[i]);
}

void about_as_decoded(const ColorVoxels& voxels, Channels channels, ColorPage& out) {
  out.mask = voxels.mask;
  const auto count = static_cast<size_t>(voxels.extent.voxels());
  for (size_t c = 0; c < channels.count; ++c) {
    const auto channel = std::span(out.channels[c]).first(count);
    voxels.channel(c, channels, out.channels[0], channel);
    page::fill_void(voxels.mask, voxels.extent, channel);
  }
}

void ColorParent::place(Index3 child, const PageGrid& above) {
  const auto at = placed<uint16_t>(child, above);
  extent = at.extent, x = at.x, y = at.y, z = at.z;
}

Status encode_color_page(const ColorModel& model, Channels channels, const ColorVoxels& voxels,
                         const ColorParent& parent, std::vector<std::byte>& mask,
                         std::span<std::vector<std::byte>> bytes, ColorPage& decoded) {
  const page::Extent extent = voxels.extent;
  const auto count = static_cast<size_t>(extent.voxels());
  model.mask.encode(voxels.mask, extent, mask, parent.mask());
  decoded.mask = voxels.mask;
  std::array<uint16_t, page::max_voxels> samples;
  for (size_t c = 0; c < channels.count; ++c) {
    const std::span<uint16_t> of_channel(samples.data(), count);
    voxels.channel(c, channels, std::span(decoded.channels[0]).first(count), of_channel);
    VOX_CHECK(page::encode_page(model.models[c], std::span<const uint16_t>(of_channel), extent, bytes[c],
                                parent.channel(c), std::span(decoded.channels[c]).first(count),
                                &voxels.mask));
  }
  return {};
}

Status decode_color_page(const ColorModel& model, std::span<const std::byte> mask,
                         std::span<const std::span<const std::byte>> bytes, page::Extent extent,
                         const ColorParent& parent, ColorPage& out) {
  VOX_TRY(out.mask, model.mask.decode(mask, extent, parent.mask()));
  for (size_t c = 0; c < bytes.size(); ++c)
    VOX_CHECK(page::decode_page(model.models[c], bytes[c], extent,
                                std::span(out.channels[c]).first(static_cast<size_t>(extent.voxels())),
                                parent.channel(c), &out.mask));
  return {};
}

void place_colors(const ColorPage& page, Channels channels, Index3 size, const Box& part, VoxelSpan out) {
  for (int64_t z = part.lo.z; z < part.hi.z; ++z)
    for (int64_t y = part.lo.y; y < part.hi.y; ++y) {
      std::byte* to = out.row(y - part.lo.y, z - part.lo.z);
      auto at = static_cast<size_t>((z * size.y + y) * size.x + part.lo.x);
      const uint32_t solid = page.mask.row(static_cast<int>(y), static_cast<int>(z));
      for (int64_t x = part.lo.x; x < part.hi.x; ++x, ++at, to += channels.count) {
        if ((solid >> x & 1) == 0) {
          std::memset(to, 0, channels.count);
          continue;
        }
        const int green = page.channels[0][at], base = channels.differences ? green - difference_offset : 0;
        const auto color = [](int value) { return static_cast<std::byte>(std::clamp(value, 0, 255)); };
        to[0] = color(page.channels[1][at] + base);
        to[1] = color(green);
        to[2] = color(page.channels[2][at] + base);
        if (channels.count == 4) to[3] = color(page.channels[3][at]);
      }
    }
}

}  // namespace voxkit::svmm
