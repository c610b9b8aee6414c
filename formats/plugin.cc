#include <dlfcn.h>
#include <fmt/format.h>
#include <unistd.h>

#include "formats/module.h"

namespace voxkit {
namespace {

/// dlerror() may span lines; errors are one line.
std::string loader_error() {
  const char* text = dlerror();
  std::string line = text ? text : "unknown error";
  for (char& c : line)
    if (c == '\n') c = ' ';
  return line;
}

SourceResult open_by(const ModuleNeed& need, const std::string& path, const std::string& grid, Context& ctx) {
  auto table = load_module(module_folder(), need);
  if (!table) return fail(table.error().code, path, table.error().what);
  return (*table)->open(path, grid, ctx);
}

SinkResult create_by(const ModuleNeed& need, const std::string& path, const VolumeInfo& info, bool force,
                     Context& ctx) {
  auto table = load_module(module_folder(), need);
  if (!table) return fail(table.error().code, path, table.error().what);
  return (*table)->create(path, info, force, ctx);
}

}  // namespace

std::string module_folder() {
  Dl_info self{};
  if (dladdr(reinterpret_cast<void*>(&module_folder), &self) == 0 || !self.dli_fname) return "voxkit";
  const std::string library = self.dli_fname;
  const size_t slash = library.rfind('/');
  return (slash == std::string::npos ? std::string(".") : library.substr(0, slash)) + "/voxkit";
}

Result<const ModuleTable*> load_module(const std::string& folder, const ModuleNeed& need) {
  const std::string path = fmt::format("{}/{}.so", folder, need.module);
  if (access(path.c_str(), F_OK) != 0)
    return fail(need.missing, {},
                fmt::format("{} needs the {} module: install {} and rebuild", need.action, need.module,
                            need.package));
  // dlopen counts how often a module is opened; it is never closed, since sources and sinks live in it.
  void* handle = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!handle)
    return fail(need.missing, {},
                fmt::format("the {} module cannot be loaded: {}", need.module, loader_error()));
  const auto entry = reinterpret_cast<const ModuleTable* (*)()>(dlsym(handle, "voxkit_module"));
  if (!entry)
    return fail(need.missing, {},
                fmt::format("the {} module has no entry point: {}", need.module, loader_error()));
  const ModuleTable* table = entry();
  if (table->abi != module_abi)
    return fail(need.missing, {},
                fmt::format("the {} module is of another version: interface {}: expected {}", need.module,
                            table->abi, module_abi));
  return table;
}

SourceResult open_image_stack(const std::string& pattern_or_folder, Context& ctx) {
  return open_by({"image_stack", "reading image stacks", "libopenimageio-dev"}, pattern_or_folder, {}, ctx);
}

SinkResult create_image_stack(const std::string& pattern, const VolumeInfo& info, bool force, Context& ctx) {
  return create_by({"image_stack", "writing image stacks", "libopenimageio-dev", ErrorCode::usage}, pattern,
                   info, force, ctx);
}

Result<std::optional<Image>> read_image(const std::string& path, Context& ctx) {
  auto table = load_module(module_folder(), {"image_stack", "reading images", "libopenimageio-dev"});
  if (!table) return fail(table.error().code, path, table.error().what);
  return (*table)->read_image(path, ctx);
}

Status write_image(const std::string& path, const Image& image, bool force,
                   std::span<const ImageLayer> layers) {
  auto table =
      load_module(module_folder(), {"image_stack", "writing images", "libopenimageio-dev", ErrorCode::usage});
  if (!table) return fail(table.error().code, path, table.error().what);
  return (*table)->write_image(path, image, force, layers);
}

SourceResult open_vdb(const std::string& path, const std::string& grid, Context& ctx) {
  return open_by({"openvdb", "reading .vdb files", "libopenvdb-dev"}, path, grid, ctx);
}

SinkResult create_vdb(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  return create_by({"openvdb", "writing .vdb files", "libopenvdb-dev", ErrorCode::usage}, path, info, force,
                   ctx);
}

VoxelSinkResult create_vdb_voxels(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  auto table =
      load_module(module_folder(), {"openvdb", "writing .vdb files", "libopenvdb-dev", ErrorCode::usage});
  if (!table) return fail(table.error().code, path, table.error().what);
  return (*table)->create_voxels(path, info, force, ctx);
}

SourceResult open_dicom(const std::string& folder, Context& ctx) {
  return open_by({"dicom", "reading DICOM slices", "libgdcm-dev"}, folder, {}, ctx);
}

}  // namespace voxkit
