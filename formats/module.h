// Modules: what needs a library that takes long to load (up to 0.4 s) is in a shared object of its own, which
// is opened when a file needs it. Modules and programs share libvoxkit-formats.so, hence one copy of every
// type.
#pragma once

#include <cstdint>
#include <string>

#include "formats/result.h"

namespace voxkit {

struct VolumeModule;    // volume/volume_module.h
struct ImageModule;     // image/image_module.h
struct ImageCodec;      // image/coded_image_module.h
struct ImageQuantiser;  // image/coded_image_module.h
struct MeshModule;      // mesh/mesh_module.h

/// Grows with every change of ModuleTable, of a table that it names, or of a type that these mention.
inline constexpr uint32_t module_abi = 8;

/// What a module offers: some of these, null for what it does not.
struct ModuleTable {
  uint32_t abi = module_abi;
  const VolumeModule* volume = nullptr;
  const ImageModule* image = nullptr;
  const ImageCodec* codec = nullptr;
  const ImageQuantiser* quantiser = nullptr;
  const MeshModule* mesh = nullptr;
};

/// A module, and what to tell a user who does not have it.
struct ModuleNeed {
  std::string module;                    ///< "openvdb": FOLDER/openvdb.so
  std::string action;                    ///< "reading .vdb files"
  std::string package;                   ///< "libopenvdb-dev"
  ErrorCode missing = ErrorCode::input;  ///< code of the error when it is missing
  /// Whether its libraries start a thread for each core as they are loaded, as log4cplus behind OpenImageIO
  /// and OpenVDB does, which waits for ever where one cannot be had: then it is refused (ErrorCode::limit)
  /// where there is no address space for 500 MB and 16 MB a core.
  bool starts_threads = false;
};

/// The table of the module in `folder`, which is loaded at the first call and never unloaded. Fails with
/// need.missing, naming the package, where there is no such module, or why it cannot be loaded or used.
Result<const ModuleTable*> load_module(const std::string& folder, const ModuleNeed& need);
/// The same from module_folder(); `path` is the file that errors name.
Result<const ModuleTable*> load_module(const ModuleNeed& need, const std::string& path = {});

/// The folder that holds the modules: voxkit/ beside libvoxkit-formats.so.
std::string module_folder();

}  // namespace voxkit

/// The one symbol of a module.
extern "C" const voxkit::ModuleTable* voxkit_module();
/// Defines it: VOX_MODULE(.volume = &table).
#define VOX_MODULE(...)                                   \
  extern "C" const voxkit::ModuleTable* voxkit_module() { \
    static const voxkit::ModuleTable table{__VA_ARGS__};  \
    return &table;                                        \
  }
