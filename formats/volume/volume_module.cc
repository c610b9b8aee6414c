// Readers and writers of volumes that live in modules.
#include "formats/volume/volume_module.h"

namespace voxkit {
namespace {

const ModuleNeed read_images{"image_stack", "reading image stacks", "libopenimageio-dev", ErrorCode::input,
                             true},
    write_images{"image_stack", "writing image stacks", "libopenimageio-dev", ErrorCode::usage, true},
    read_vdb{"openvdb", "reading .vdb files", "libopenvdb-dev", ErrorCode::input, true},
    write_vdb{"openvdb", "writing .vdb files", "libopenvdb-dev", ErrorCode::usage, true},
    read_dicom{"dicom", "reading DICOM slices", "libgdcm-dev"};

}  // namespace

SourceResult open_image_stack(const std::string& pattern_or_folder, const OpenOptions& options,
                              Context& ctx) {
  VOX_TRY(const ModuleTable* const module, load_module(read_images, pattern_or_folder));
  return module->volume->open(pattern_or_folder, options, ctx);
}

SinkResult create_image_stack(const std::string& pattern, const VolumeInfo& info, bool force, Context& ctx) {
  VOX_TRY(const ModuleTable* const module, load_module(write_images, pattern));
  return module->volume->create(pattern, info, force, ctx);
}

SourceResult open_vdb(const std::string& path, const OpenOptions& options, Context& ctx) {
  VOX_TRY(const ModuleTable* const module, load_module(read_vdb, path));
  return module->volume->open(path, options, ctx);
}

SinkResult create_vdb(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  VOX_TRY(const ModuleTable* const module, load_module(write_vdb, path));
  return module->volume->create(path, info, force, ctx);
}

VoxelSinkResult create_vdb_voxels(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  VOX_TRY(const ModuleTable* const module, load_module(write_vdb, path));
  return module->volume->create_voxels(path, info, force, ctx);
}

SourceResult open_dicom(const std::string& folder, const OpenOptions& options, Context& ctx) {
  VOX_TRY(const ModuleTable* const module, load_module(read_dicom, folder));
  return module->volume->open(folder, options, ctx);
}

}  // namespace voxkit
