// MagicaVoxel models (.vox): coloured voxels in a scene of several models.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/reservation.h"
#include "formats/volume.h"
#include "formats/voxel_sink.h"

namespace voxkit {

/// What the voxels of a colour are made of, 0..1 each.
struct VoxelMaterial {
  float opacity = 1;   ///< of glass
  float emission = 0;  ///< which share of its colour it gives as light
  float roughness = 1, metalness = 0;
  bool special = false;  ///< it is something else: a cloud, say
};

/// All voxels of a scene, models in the order in which they are placed: of several at one place the last one
/// counts. The axes are turned so that y points up, as renderers have it: x, z and -y of the file.
struct VoxelScene {
  std::vector<ModelVoxel> voxels;  ///< numbers are those of palette and materials, 1 to 255
  std::array<VoxelMaterial, 256> materials;
  Reservation memory;              ///< of these, in ctx.memory
  std::vector<std::string> notes;  ///< what the file says and voxels cannot, a sentence each
};

/// Reads version 150 and 200 files: sizes, voxels, palettes, and the scene's nodes with their translations
/// and rotations; what is hidden is left out. `frame`, from 0: of an animation, whose key frames count until
/// the next ones; several models without a scene are frames, too. Places are within 2^20 of the origin.
/// Errors: ErrorCode::input with the byte where a rule is broken, ErrorCode::limit, ErrorCode::usage for a
/// frame that is not there.
Result<VoxelScene> read_magicavoxel(const std::string& path, Context& ctx, uint32_t frame = 0);

/// A voxel and the number of its colour in a palette.
struct IndexedVoxel {
  std::array<int32_t, 3> place;
  uint8_t color;
};

class MagicaVoxelWriter {
 public:
  virtual ~MagicaVoxelWriter() = default;
  /// Takes voxels inside the volume, in any order, each place once.
  virtual Status add(std::span<const IndexedVoxel> voxels) = 0;
  /// Completes the file; without it, it never appears.
  virtual Status finish() = 0;
};

/// Whether a file can hold so many voxels in such a volume: ErrorCode::limit for more than 2^20 a side, or
/// for 2 GiB.
Status check_magicavoxel(const std::string& path, const Index3& dims, uint64_t voxels);

/// Writes a file of version 150: a model for each cube of 256 voxels a side that has any, in a scene that
/// puts them where they are, turned so that `read_magicavoxel` gives the same places. Of `info` dims and
/// affine count; edges of voxels other than 1, and places between those of voxels, are said to be dropped
/// (ctx.note). `palette` has up to 255 colours, R, G and B in sRGB; `voxels` will come. Memory: 8 bytes a
/// voxel. Errors: those of check_magicavoxel and of OutputFile.
Result<std::unique_ptr<MagicaVoxelWriter>> create_magicavoxel(const std::string& path, const VolumeInfo& info,
                                                              uint64_t voxels,
                                                              std::span<const std::array<uint8_t, 3>> palette,
                                                              bool force, Context& ctx);

}  // namespace voxkit
