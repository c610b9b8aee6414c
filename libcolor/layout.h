// The chunks of a file of coloured surfaces (FORMAT.md, section 4): kinds, parameters, sizes.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "libcolor/color.h"

namespace voxkit::color {

inline constexpr uint32_t params_kind = chunk_kind("DAGP");
inline constexpr uint32_t leaves_kind = chunk_kind("LEAF");
inline constexpr uint32_t nodes_kind = chunk_kind("NODE");      ///< index: the height
inline constexpr uint32_t symmetric_kind = chunk_kind("SNOD");  ///< the same of an ssvdag
inline constexpr uint32_t octree_kind = chunk_kind("OCTD");     ///< an octree's directory
inline constexpr uint32_t masks_kind = chunk_kind("MASK");      ///< and its pages, by part
inline constexpr uint32_t colors_kind = chunk_kind("COLR");
inline constexpr uint32_t palette_kind = chunk_kind("PALT");

/// Height of the smallest grid that holds a volume.
int height_of(Index3 dims);

/// The chunk 'DAGP'.
std::vector<std::byte> pack_params(const Params& params);
/// Its contents, each field as FORMAT.md allows it for this volume.
Result<Params> unpack_params(std::span<const std::byte> bytes, const VolumeInfo& info,
                             const std::string& file);

}  // namespace voxkit::color
