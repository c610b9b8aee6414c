// The numbers of a glTF file: its buffers, and accessors to them.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/mesh/gltf_document.h"
#include "formats/mesh/mesh_parts.h"

namespace voxkit::gltf {

/// Numbers and their memory.
template <class T>
struct Values {
  std::vector<T> values;
  uint32_t components = 1;
  Reservation memory;
};

class Buffers {
 public:
  Buffers(const Document& document, std::span<const std::byte> own_bytes, std::shared_ptr<const void> owner,
          const std::string& path, MeshFolder& folder, Context& ctx)
      : document_(document),
        own_bytes_(own_bytes),
        owner_(std::move(owner)),
        path_(path),
        folder_(folder),
        ctx_(ctx) {}

  /// Opens files and unpacks text; each when first asked for.
  Result<std::span<const std::byte>> view(uint32_t index);

  /// All numbers of an accessor, whole numbers from -1 or 0 to 1 where they are normalised.
  Result<Values<float>> floats(uint32_t accessor);
  /// The same of whole numbers that are 0 or more: ErrorCode::input for others.
  Result<Values<uint32_t>> integers(uint32_t accessor);

  /// A picture of the file; its bytes stay as long as what is returned.
  Result<PictureReference> image(uint32_t index);

 private:
  struct Loaded {
    bool known = false;
    std::span<const std::byte> bytes;
    std::shared_ptr<const void> owner;
    Reservation memory;
  };
  Result<const Loaded*> buffer(uint32_t index);
  Result<const Loaded*> load_view(uint32_t index);
  template <class T, class Convert>
  Status fill(const Accessor& accessor, std::vector<T>& to, const Convert& convert);

  const Document& document_;
  std::span<const std::byte> own_bytes_;
  std::shared_ptr<const void> owner_;
  const std::string& path_;
  MeshFolder& folder_;
  Context& ctx_;
  std::vector<Loaded> buffers_, views_;
};

/// The bytes of a data: URI; nothing where it is none. Errors: ErrorCode::input, ErrorCode::limit.
Result<std::optional<std::vector<std::byte>>> bytes_of_uri(const std::string& uri, const std::string& path,
                                                           Context& ctx);

}  // namespace voxkit::gltf
