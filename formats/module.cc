#include "formats/module.h"

#include <dlfcn.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <thread>

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

/// Whether there is address space for what a module maps that starts threads.
bool room_for_threads() {
  constexpr size_t libraries = size_t{500} << 20, thread = size_t{16} << 20;
  const size_t bytes = libraries + thread * std::thread::hardware_concurrency();
  void* const probe = mmap(nullptr, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (probe == MAP_FAILED) return false;
  munmap(probe, bytes);
  return true;
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
  if (void* const loaded = dlopen(path.c_str(), RTLD_NOW | RTLD_NOLOAD); loaded)
    dlclose(loaded);
  else if (need.starts_threads && !room_for_threads())
    return fail(
        ErrorCode::limit, {},
        fmt::format("the {} module needs more address space than this process may have", need.module));
  // dlopen counts how often a module is opened; it is never closed, since sources and sinks live in it.
  void* handle = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!handle) {
    const std::string error = loader_error();
    const bool no_memory =
        error.find("annot allocate") != error.npos || error.find("failed to map segment") != error.npos;
    return fail(no_memory ? ErrorCode::limit : need.missing, {},
                fmt::format("the {} module cannot be loaded: {}", need.module, error));
  }
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

Result<const ModuleTable*> load_module(const ModuleNeed& need, const std::string& path) {
  auto table = load_module(module_folder(), need);
  if (!table) return fail(table.error().code, path, table.error().what);
  return table;
}

}  // namespace voxkit
