// What a file of ours says about its volume: the chunks VOLI and VOLX (FORMAT.md, sections 1.4 and 1.5).
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/container.h"
#include "formats/volume.h"

namespace voxkit {

inline constexpr uint32_t volume_info_kind = chunk_kind("VOLI");
inline constexpr uint32_t volume_facts_kind = chunk_kind("VOLX");

/// The least version of a container that can say all that is known of a volume.
uint16_t container_version_for(const VolumeInfo& info);

/// Writes both chunks, the second where there is something to say in it: then the writer's version must be 3.
/// Errors: those of the writer.
Status add_volume_info(ContainerWriter& container, const VolumeInfo& info);
/// Reads them. VolumeInfo::parts is not kept. Safe on any bytes. Errors: ErrorCode::input.
Result<VolumeInfo> read_volume_info(const Container& container);

// Their bytes, for tests and for readers of these.
std::vector<std::byte> pack_volume_info(const VolumeInfo& info);
std::vector<std::byte> pack_volume_facts(const VolumeInfo& info);
/// `facts`: of VOLX; empty where there is none.
Result<VolumeInfo> unpack_volume_info(std::span<const std::byte> info, std::span<const std::byte> facts,
                                      const std::string& file);

}  // namespace voxkit
