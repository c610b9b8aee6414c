#include "formats/mesh/mesh_io.h"

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <utility>

#include "formats/mapped_file.h"
#include "formats/mesh/texture.h"
#include "formats/names.h"

namespace voxkit {
namespace {

/// Bytes that the importer takes for a file, with room to spare: it was seen to take 45 a corner of a face of
/// .obj files, and twice the size of binary ones.
uint64_t importer_bytes(const std::string& name, std::span<const std::byte> bytes) {
  if (!has_ending(name, ".obj")) return bytes.size() * (has_ending(name, ".gltf") ? 16 : 4);
  uint64_t vertices = 0, corners = 0;
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  const char* const end = text + bytes.size();
  while (text < end) {
    const auto* stop = static_cast<const char*>(std::memchr(text, '\n', static_cast<size_t>(end - text)));
    if (!stop) stop = end;
    if (*text == 'v') ++vertices;
    if (*text == 'f') corners += static_cast<uint64_t>(std::count(text, stop, ' '));
    text = stop + 1;
  }
  return 2 * bytes.size() + 64 * (vertices + corners);
}

class Stream : public Assimp::IOStream {
 public:
  explicit Stream(std::shared_ptr<const MappedFile> file) : file_(std::move(file)) {}
  size_t Read(void* out, size_t size, size_t count) override {
    if (size == 0) return 0;
    count = std::min(count, (file_->bytes().size() - at_) / size);
    if (count) std::memcpy(out, file_->bytes().data() + at_, size * count);
    at_ += size * count;
    return count;
  }
  size_t Write(const void*, size_t, size_t) override { return 0; }
  aiReturn Seek(size_t offset, aiOrigin origin) override {
    const size_t size = file_->bytes().size();
    const size_t base = origin == aiOrigin_SET ? 0 : origin == aiOrigin_CUR ? at_ : size;
    // Backwards from the end, as importers mean it.
    const size_t to = origin == aiOrigin_END ? base - std::min(offset, base) : base + offset;
    if (to > size || to < std::min(base, offset)) return aiReturn_FAILURE;
    at_ = to;
    return aiReturn_SUCCESS;
  }
  size_t Tell() const override { return at_; }
  size_t FileSize() const override { return file_->bytes().size(); }
  void Flush() override {}

 private:
  std::shared_ptr<const MappedFile> file_;
  size_t at_ = 0;
};

class System : public Assimp::IOSystem {
 public:
  System(const std::string& path, MeshFiles& files)
      : path_(path), folder_(std::filesystem::path(path).parent_path().string()), files_(files) {}

  bool Exists(const char* name) const override { return !find(name).empty(); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* name, const char* mode) override {
    if (std::strchr(mode, 'w') || std::strchr(mode, 'a')) return nullptr;
    const std::string found = find(name);
    if (found.empty()) {
      files_.missing.emplace_back(name);
      return nullptr;
    }
    auto file = MappedFile::open(found);
    if (!file) return note(file.error());
    auto hold = Reservation::take(importer_bytes(found, (*file)->bytes()), "reading the mesh", files_.ctx);
    if (!hold) return note(hold.error());
    files_.memory.push_back(std::move(*hold));
    files_.opened.emplace_back(name);
    return new Stream(std::move(*file));
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  Assimp::IOStream* note(const Error& error) {
    if (files_.status) files_.status = tl::unexpected<Error>(error);
    return nullptr;
  }
  /// Empty where there is no such file.
  std::string find(const std::string& name) const {
    if (name == path_) return name;
    const std::string prefix = folder_.empty() ? "" : folder_ + "/";
    const bool within = name.compare(0, prefix.size(), prefix) == 0;
    return find_texture(folder_, within ? name.substr(prefix.size()) : name);
  }

  std::string path_, folder_;
  MeshFiles& files_;
};

}  // namespace

Assimp::IOSystem* mesh_io(const std::string& path, MeshFiles& files) {
  return new System(path, files);
}

}  // namespace voxkit
