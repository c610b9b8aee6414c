#include "formats/mesh/gltf_buffers.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "formats/little_endian.h"
#include "formats/mapped_file.h"

namespace voxkit::gltf {
namespace {

/// -1: no digit of base 64.
constexpr std::array<int8_t, 256> base64_digits = [] {
  std::array<int8_t, 256> digits{};
  digits.fill(-1);
  constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (size_t i = 0; i < letters.size(); ++i)
    digits[static_cast<unsigned char>(letters[i])] = static_cast<int8_t>(i);
  return digits;
}();

/// The floats of stored numbers.
float float_at(const std::byte* at, Component component, bool normalized) {
  const auto whole = [&]<class T>(T, float most) {
    const auto value = static_cast<float>(load_le<T>(at));
    return normalized ? std::max(value / most, -1.0f) : value;
  };
  switch (component) {
    case Component::i8:
      return whole(int8_t{}, 127);
    case Component::u8:
      return whole(uint8_t{}, 255);
    case Component::i16:
      return whole(int16_t{}, 32767);
    case Component::u16:
      return whole(uint16_t{}, 65535);
    case Component::u32:
      return whole(uint32_t{}, 4294967295.0f);
    case Component::f32:
      break;
  }
  return load_le<float>(at);
}

uint32_t integer_at(const std::byte* at, Component component) {
  return component == Component::u8    ? load_le<uint8_t>(at)
         : component == Component::u16 ? load_le<uint16_t>(at)
                                       : load_le<uint32_t>(at);
}

}  // namespace

Result<std::optional<std::vector<std::byte>>> bytes_of_uri(const std::string& uri, const std::string& path,
                                                           Context& ctx) {
  if (!uri.starts_with("data:")) return std::nullopt;
  const size_t comma = uri.find(',');
  if (comma == uri.npos || !std::string_view(uri).substr(0, comma).ends_with(";base64"))
    return bad_input(path, "corrupt glTF file: a data: URI: expected one of base64");
  VOX_TRY(const Reservation memory, Reservation::take(uri.size(), "a buffer of the mesh", ctx));
  std::vector<std::byte> bytes;
  bytes.reserve((uri.size() - comma) / 4 * 3 + 3);
  uint32_t bits = 0;
  int count = 0;
  for (size_t i = comma + 1; i < uri.size() && uri[i] != '='; ++i) {
    const int digit = base64_digits[static_cast<unsigned char>(uri[i])];
    if (digit < 0) return bad_input(path, "corrupt glTF file: a data: URI: expected digits of base64");
    bits = bits << 6 | static_cast<uint32_t>(digit);
    if ((count += 6) >= 8) bytes.push_back(static_cast<std::byte>(bits >> (count -= 8)));
  }
  return bytes;
}

Result<const Buffers::Loaded*> Buffers::buffer(uint32_t index) {
  buffers_.resize(document_.buffers.size());
  Loaded& loaded = buffers_[index];
  if (loaded.known) return &loaded;
  const Buffer& buffer = document_.buffers[index];
  if (!buffer.uri) {
    loaded.bytes = own_bytes_;
    loaded.owner = owner_;
  } else {
    VOX_TRY(auto bytes, bytes_of_uri(*buffer.uri, path_, ctx_));
    if (bytes) {
      VOX_TRY(loaded.memory, Reservation::take(bytes->size(), "a buffer of the mesh", ctx_));
      const auto owned = std::make_shared<const std::vector<std::byte>>(std::move(*bytes));
      loaded.bytes = *owned;
      loaded.owner = owned;
    } else {
      VOX_TRY(const std::string file, folder_.find(*buffer.uri, "buffer"));
      if (file.empty())
        return bad_input(path_, fmt::format("{} is missing, which the mesh needs",
                                            buffer.uri->substr(buffer.uri->rfind('/') + 1, 200)));
      VOX_TRY(const auto mapped, MappedFile::open(file));
      loaded.bytes = mapped->bytes();
      loaded.owner = mapped;
    }
  }
  if (loaded.bytes.size() < buffer.length)
    return bad_input(path_, fmt::format("corrupt glTF file: buffer {}: {} bytes are there: expected {}",
                                        index, loaded.bytes.size(), buffer.length));
  loaded.bytes = loaded.bytes.first(buffer.length);
  loaded.known = true;
  return &loaded;
}

Result<const Buffers::Loaded*> Buffers::load_view(uint32_t index) {
  views_.resize(document_.views.size());
  Loaded& loaded = views_[index];
  if (loaded.known) return &loaded;
  const View& view = document_.views[index];
  if (view.packed) {
    const PackedView& packed = *view.packed;
    VOX_TRY(const Loaded* const from, buffer(packed.buffer));
    VOX_TRY(const ModuleTable* const module,
            load_module({"meshopt", "reading EXT_meshopt_compression", "libmeshoptimizer-dev"}, path_));
    VOX_TRY(loaded.memory, Reservation::take(view.length, "a buffer of the mesh", ctx_));
    const auto owned = std::make_shared<std::vector<std::byte>>(view.length);
    if (!module->mesh->decode_meshopt(packed.how, from->bytes.subspan(packed.offset, packed.length), *owned))
      return bad_input(path_,
                       fmt::format("corrupt glTF file: buffer view {}: its packed bytes are damaged", index));
    loaded.bytes = *owned;
    loaded.owner = owned;
  } else {
    VOX_TRY(const Loaded* const from, buffer(view.buffer));
    loaded.bytes = from->bytes.subspan(view.offset, view.length);
    loaded.owner = from->owner;
  }
  loaded.known = true;
  return &loaded;
}

Result<std::span<const std::byte>> Buffers::view(uint32_t index) {
  VOX_TRY(const Loaded* const loaded, load_view(index));
  return loaded->bytes;
}

/// `convert` of each number of an accessor, then of those that are otherwise.
template <class T, class Convert>
Status Buffers::fill(const Accessor& accessor, std::vector<T>& to, const Convert& convert) {
  const uint64_t component = bytes_of(accessor.values.component);
  const auto element = [&](const std::byte* at, T* out) {
    for (uint32_t i = 0, column = 0; i < accessor.components; i += accessor.rows, ++column) {
      const uint64_t column_bytes =
          accessor.components == accessor.rows ? 0 : (accessor.rows * component + 3) / 4 * 4;
      for (uint32_t j = 0; j < accessor.rows; ++j)
        out[i + j] = convert(at + column * column_bytes + j * component);
    }
  };
  if (accessor.values.view != none) {
    VOX_TRY(const auto bytes, view(accessor.values.view));
    const uint64_t stride = document_.views[accessor.values.view].stride;
    const uint64_t step = stride ? stride : accessor.element_bytes();
    for (uint64_t i = 0; i < accessor.count; ++i)
      element(bytes.data() + accessor.values.offset + i * step, to.data() + i * accessor.components);
  }
  if (!accessor.sparse) return {};
  const Accessor::Sparse& sparse = *accessor.sparse;
  VOX_TRY(const auto indices, view(sparse.indices.view));
  VOX_TRY(const auto values, view(sparse.values.view));
  for (uint64_t i = 0; i < sparse.count; ++i) {
    const uint32_t index =
        integer_at(indices.data() + sparse.indices.offset + i * bytes_of(sparse.indices.component),
                   sparse.indices.component);
    if (index >= accessor.count)
      return bad_input(
          path_, fmt::format("corrupt glTF file: a sparse accessor: number {}: expected below {}", index,
                             accessor.count));
    element(values.data() + sparse.values.offset + i * accessor.element_bytes(),
            to.data() + uint64_t{index} * accessor.components);
  }
  return {};
}

Result<Values<float>> Buffers::floats(uint32_t index) {
  const Accessor& accessor = document_.accessors[index];
  Values<float> out;
  out.components = accessor.components;
  const uint64_t count = accessor.count * accessor.components;
  VOX_TRY(out.memory, Reservation::take(count * sizeof(float), "attributes of the mesh", ctx_));
  out.values.resize(count);
  const Component component = accessor.values.component;
  VOX_CHECK(fill(accessor, out.values,
                 [&](const std::byte* at) { return float_at(at, component, accessor.normalized); }));
  return out;
}

Result<Values<uint32_t>> Buffers::integers(uint32_t index) {
  const Accessor& accessor = document_.accessors[index];
  const Component component = accessor.values.component;
  if (component != Component::u8 && component != Component::u16 && component != Component::u32)
    return bad_input(path_,
                     fmt::format("corrupt glTF file: accessor {}: expected unsigned whole numbers", index));
  Values<uint32_t> out;
  out.components = accessor.components;
  const uint64_t count = accessor.count * accessor.components;
  VOX_TRY(out.memory, Reservation::take(count * sizeof(uint32_t), "indices of the mesh", ctx_));
  out.values.resize(count);
  VOX_CHECK(fill(accessor, out.values, [&](const std::byte* at) { return integer_at(at, component); }));
  return out;
}

Result<PictureReference> Buffers::image(uint32_t index) {
  const Image& image = document_.images[index];
  PictureReference out;
  if (image.view != none) {
    VOX_TRY(const Loaded* const loaded, load_view(image.view));
    out.bytes = loaded->bytes;
    out.owner = loaded->owner;
  } else {
    VOX_TRY(auto bytes, bytes_of_uri(image.uri, path_, ctx_));
    if (!bytes) {
      out.name = image.uri;
      return out;
    }
    const auto owned = std::make_shared<const std::vector<std::byte>>(std::move(*bytes));
    out.bytes = *owned;
    out.owner = owned;
  }
  out.name = fmt::format("*{}", index);
  if (out.bytes.empty()) return bad_input(path_, "an embedded texture without bytes");
  return out;
}

}  // namespace voxkit::gltf
