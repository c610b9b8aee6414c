// What a module (image_stack.so, openvdb.so, dicom.so, mesh.so, jpeg.so, jp2.so, png.so, imagequant.so)
// offers to plugin.cc and coded_image.cc.
//
// The libraries behind these readers take up to 0.4 s to load, so programs do not link them: plugin.cc opens
// the module when a file needs it. Modules and programs share libvoxkit-formats.so, hence one copy of every
// type below.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "formats/coded_image.h"
#include "formats/image.h"
#include "formats/mesh_parts.h"
#include "formats/readers.h"

namespace voxkit {

/// Grows with every change of ModuleTable or of a type that it mentions.
inline constexpr uint32_t module_abi = 6;

struct ModuleTable {
  uint32_t abi = module_abi;
  /// `grid` is the name of a grid (openvdb only), empty for the first.
  SourceResult (*open)(const std::string& path, const std::string& grid, Context& ctx) = nullptr;
  /// Null in modules that only read.
  SinkResult (*create)(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) = nullptr;
  /// Voxels with colours, one by one (openvdb only): `create_vdb_voxels` of readers.h.
  VoxelSinkResult (*create_voxels)(const std::string& path, const VolumeInfo& info, bool force,
                                   Context& ctx) = nullptr;
  /// Single images (image_stack only): `read_image` and `write_image` of image.h.
  Result<std::optional<Image>> (*read_image)(const std::string& path, Context& ctx) = nullptr;
  Status (*write_image)(const std::string& path, const Image& image, bool force,
                        std::span<const ImageLayer> layers) = nullptr;
  /// Meshes (mesh only), not yet checked and without textures.
  Result<MeshParts> (*read_mesh)(const std::string& path, Context& ctx) = nullptr;
  /// Images in memory (jpeg, jp2, png only): those of coded_image.h. `image` has its size, and room.
  Result<std::vector<std::byte>> (*encode_image)(const RgbImage& image, const ImageCoding& coding) = nullptr;
  Status (*decode_image)(std::span<const std::byte> file, RgbImage& image) = nullptr;
  /// Leaves up to so many colours, 2 to 256 (imagequant only).
  Status (*quantise)(RgbImage& image, int colors, int quality) = nullptr;
};

/// A module, and what to tell a user who does not have it.
struct ModuleNeed {
  std::string module;                    ///< "openvdb": FOLDER/openvdb.so
  std::string action;                    ///< "reading .vdb files"
  std::string package;                   ///< "libopenvdb-dev"
  ErrorCode missing = ErrorCode::input;  ///< code of the error when it is missing
};

/// The table of the module in `folder`, which is loaded at the first call and never unloaded. Fails with
/// need.missing, naming the package, where there is no such module, or why it cannot be loaded or used.
Result<const ModuleTable*> load_module(const std::string& folder, const ModuleNeed& need);

/// The folder that holds the modules: voxkit/ beside libvoxkit-formats.so.
std::string module_folder();

}  // namespace voxkit

/// The one symbol of a module.
extern "C" const voxkit::ModuleTable* voxkit_module();
