#include "formats/volume_chunks.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "formats/little_endian.h"

namespace voxkit {
namespace {

constexpr size_t info_bytes = 112, facts_bytes = 136;
constexpr uint64_t most_description = 4096, most_labels = 65536;
constexpr uint8_t has_fill = 1, are_labels = 2, has_labels = 4, is_rounded = 8;

/// Whether an integer is one of a sample type's, as wide integers are kept: u64 by its bits.
bool is_sample(int64_t value, SampleType type) {
  return type == SampleType::u32   ? value >= 0 && value <= int64_t{UINT32_MAX}
         : type == SampleType::i32 ? value >= INT32_MIN && value <= INT32_MAX
                                   : true;
}

Status unpack_facts(std::span<const std::byte> bytes, const std::string& file, VolumeInfo& info) {
  if (bytes.size() < facts_bytes)
    return bad_input(file,
                     fmt::format("chunk VOLX: {} bytes: expected {} or more", bytes.size(), facts_bytes));
  const auto byte = [&](size_t at) { return std::to_integer<uint8_t>(bytes[at]); };
  if (byte(0) > static_cast<uint8_t>(World::left_handed))
    return bad_input(file, fmt::format("chunk VOLX, byte 0: unknown world {}", byte(0)));
  if (byte(1) > static_cast<uint8_t>(Unit::inch))
    return bad_input(file, fmt::format("chunk VOLX, byte 1: unknown unit {}", byte(1)));
  const uint8_t flags = byte(3);
  if (flags >= 16)
    return bad_input(file, fmt::format("chunk VOLX, byte 3: flags {}: expected less than 16", flags));
  info.world = static_cast<World>(byte(0));
  info.unit = static_cast<Unit>(byte(1));
  info.space_code = byte(2);
  info.is_labels = (flags & are_labels) != 0;
  info.rounded = (flags & is_rounded) != 0;
  const uint64_t description = load_le<uint32_t>(&bytes[4]), labels = load_le<uint64_t>(&bytes[8]);
  if (description > most_description || labels > most_labels || (labels > 0) != ((flags & has_labels) != 0) ||
      bytes.size() != facts_bytes + 8 * labels + description)
    return bad_input(
        file, fmt::format("chunk VOLX, byte 4: {} bytes of text and {} labels: expected at most {} and {}, "
                          "as many as the chunk's {} bytes hold",
                          description, labels, most_description, most_labels, bytes.size()));
  for (size_t a = 0; a < 3; ++a) {
    for (size_t b = 0; b < 3; ++b) info.affine.axes[a][b] = load_le<double>(&bytes[16 + 24 * a + 8 * b]);
    info.affine.origin[a] = load_le<double>(&bytes[88 + 8 * a]);
  }
  if (!info.affine.is_valid())
    return bad_input(
        file, "chunk VOLX, byte 16: expected finite axes, none of which lies in the plane of the others");
  if (flags & has_fill) info.fill = load_le<double>(&bytes[112]);
  info.wide_base = load_le<int64_t>(&bytes[120]);
  if (labels > 0) {
    auto table = std::make_shared<std::vector<int64_t>>(labels);
    for (size_t i = 0; i < labels; ++i) {
      const auto value = load_le<int64_t>(&bytes[facts_bytes + 8 * i]);
      if (!is_sample(value, info.sample_type))
        return bad_input(file, fmt::format("chunk VOLX, byte {}: label {} is no {}", facts_bytes + 8 * i,
                                           value, name(info.sample_type)));
      (*table)[i] = value;
    }
    info.labels = std::move(table);
  }
  info.description.assign(reinterpret_cast<const char*>(bytes.data() + facts_bytes + 8 * labels),
                          description);
  return {};
}

}  // namespace

uint16_t container_version_for(const VolumeInfo& info) {
  const bool plain = info.affine.is_plain() && info.world == World::unknown && info.unit == Unit::unknown &&
                     info.space_code == 0 && info.description.empty();
  const bool usual = info.wide_base == 0 && !info.labels && !info.is_labels && !info.fill && !info.rounded &&
                     info.sample_type != SampleType::f16 &&
                     (is_color(info.format) || scalar_format(info.sample_type) == info.format);
  return plain && usual ? 1 : 3;
}

std::vector<std::byte> pack_volume_info(const VolumeInfo& info) {
  std::vector<std::byte> bytes(info_bytes);
  const Affine::Vector spacing = info.affine.spacing();
  for (int i = 0; i < 3; ++i) {
    const auto a = static_cast<size_t>(i);
    store_le(&bytes[8 * a], static_cast<uint64_t>(info.dims[i]));
    store_le(&bytes[32 + 8 * a], spacing[a]);
    store_le(&bytes[56 + 8 * a], info.affine.origin[a]);
  }
  bytes[24] = static_cast<std::byte>(info.format);
  bytes[25] = static_cast<std::byte>(info.sample_type);
  bytes[26] = static_cast<std::byte>(info.range.has_value());
  store_le(&bytes[80], info.slope);
  store_le(&bytes[88], info.intercept);
  store_le(&bytes[96], info.range ? info.range->lo : 0.0);
  store_le(&bytes[104], info.range ? info.range->hi : 0.0);
  return bytes;
}

std::vector<std::byte> pack_volume_facts(const VolumeInfo& info) {
  const std::string text = info.description.substr(0, most_description);
  const size_t labels = info.labels ? info.labels->size() : 0;
  std::vector<std::byte> bytes(facts_bytes + 8 * labels + text.size());
  bytes[0] = static_cast<std::byte>(info.world);
  bytes[1] = static_cast<std::byte>(info.unit);
  bytes[2] = static_cast<std::byte>(info.space_code);
  bytes[3] = static_cast<std::byte>((info.fill ? has_fill : 0) | (info.is_labels ? are_labels : 0) |
                                    (info.labels ? has_labels : 0) | (info.rounded ? is_rounded : 0));
  store_le(&bytes[4], static_cast<uint32_t>(text.size()));
  store_le(&bytes[8], static_cast<uint64_t>(labels));
  for (size_t a = 0; a < 3; ++a) {
    for (size_t b = 0; b < 3; ++b) store_le(&bytes[16 + 24 * a + 8 * b], info.affine.axes[a][b]);
    store_le(&bytes[88 + 8 * a], info.affine.origin[a]);
  }
  store_le(&bytes[112], info.fill.value_or(0));
  store_le(&bytes[120], info.wide_base);
  for (size_t i = 0; i < labels; ++i) store_le(&bytes[facts_bytes + 8 * i], (*info.labels)[i]);
  if (!text.empty()) std::memcpy(bytes.data() + facts_bytes + 8 * labels, text.data(), text.size());
  return bytes;
}

Result<VolumeInfo> unpack_volume_info(std::span<const std::byte> bytes, std::span<const std::byte> facts,
                                      const std::string& file) {
  if (bytes.size() != info_bytes)
    return bad_input(file, fmt::format("chunk VOLI: {} bytes: expected {}", bytes.size(), info_bytes));
  VolumeInfo info;
  Affine::Vector spacing;
  for (int i = 0; i < 3; ++i) {
    const auto a = static_cast<size_t>(i);
    info.dims[i] = static_cast<int64_t>(load_le<uint64_t>(&bytes[8 * a]));
    spacing[a] = load_le<double>(&bytes[32 + 8 * a]);
    info.affine.origin[a] = load_le<double>(&bytes[56 + 8 * a]);
    if (!std::isfinite(spacing[a]) || !std::isfinite(info.affine.origin[a]))
      return bad_input(file, "chunk VOLI, byte 32: spacing and origin: expected finite numbers");
    // Files of old may have 0, or less, which said nothing.
    info.affine.axes[a][a] = spacing[a] != 0 ? std::abs(spacing[a]) : 1;
  }
  if (!checked_voxels(info.dims))
    return bad_input(
        file,
        fmt::format("chunk VOLI, byte 0: dimensions {}x{}x{}: expected 1 to 2^31 a side and 2^62 in all",
                    info.dims.x, info.dims.y, info.dims.z));
  const int format = std::to_integer<int>(bytes[24]), type = std::to_integer<int>(bytes[25]);
  if (format < 1 || format > 6)
    return bad_input(file, fmt::format("chunk VOLI, byte 24: unknown voxel format {}", format));
  info.format = static_cast<VoxelFormat>(format);
  info.sample_type = static_cast<SampleType>(type);
  const bool known = type >= 1 && type <= (facts.empty() ? 11 : 12);
  const bool is_density = info.format == VoxelFormat::density8 || info.format == VoxelFormat::density16;
  if (!known || (!is_color(info.format) && scalar_format(info.sample_type) != info.format &&
                 !(!facts.empty() && is_wide(info.sample_type) && is_density)))
    return bad_input(file, fmt::format("chunk VOLI, byte 25: sample type {} does not go with {}", type,
                                       name(info.format)));
  info.slope = load_le<double>(&bytes[80]);
  info.intercept = load_le<double>(&bytes[88]);
  if (bytes[26] != std::byte{0})
    info.range = ValueRange{load_le<double>(&bytes[96]), load_le<double>(&bytes[104])};
  if (!facts.empty()) VOX_CHECK(unpack_facts(facts, file, info));
  if (info.labels && !is_density)
    return bad_input(file, fmt::format("chunk VOLX, byte 8: labels do not go with {}", name(info.format)));
  return info;
}

Status add_volume_info(ContainerWriter& container, const VolumeInfo& info) {
  VOX_CHECK(container.add(volume_info_kind, 0, 0, pack_volume_info(info)));
  if (container_version_for(info) < 3) return {};
  return container.add(volume_facts_kind, 0, 0, pack_volume_facts(info));
}

Result<VolumeInfo> read_volume_info(const Container& container) {
  VOX_TRY(const auto info, container.only_chunk(volume_info_kind));
  if (!container.has_chunk(volume_facts_kind)) return unpack_volume_info(info, {}, container.name());
  VOX_TRY(const auto facts, container.only_chunk(volume_facts_kind));
  return unpack_volume_info(info, facts, container.name());
}

}  // namespace voxkit
