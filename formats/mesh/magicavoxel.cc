#include "formats/mesh/magicavoxel.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <map>
#include <optional>
#include <span>
#include <string_view>

#include "formats/little_endian.h"
#include "formats/mapped_file.h"

namespace voxkit {
namespace {

using Bytes = std::span<const std::byte>;
using Place = std::array<int32_t, 3>;
using Color = std::array<uint8_t, 3>;

constexpr int32_t furthest = 1 << 20;
constexpr int deepest = 64;                // nodes below each other
constexpr uint64_t most_visits = 1 << 20;  // of nodes, each as often as it is placed

uint32_t tag(const char (&letters)[5]) {
  uint32_t value;
  std::memcpy(&value, letters, 4);
  return value;
}

/// A piece of the file, read front to back.
class Reader {
 public:
  Reader(Bytes bytes, size_t at, const std::string& file) : bytes_(bytes), at_(at), file_(file) {}
  size_t left() const { return bytes_.size(); }
  size_t at() const { return at_; }
  tl::unexpected<Error> bad(const std::string& what) const {
    return bad_input(file_, fmt::format("byte {}: {}", at_, what));
  }
  Result<Bytes> take(size_t count) {
    if (count > bytes_.size())
      return bad(fmt::format("{} bytes are there: expected {}", bytes_.size(), count));
    const Bytes taken = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    at_ += count;
    return taken;
  }
  Result<uint32_t> number() {
    VOX_TRY(const Bytes bytes, take(4));
    return load_le<uint32_t>(bytes.data());
  }
  Result<Reader> part(size_t count) {
    const size_t begin = at_;
    VOX_TRY(const Bytes bytes, take(count));
    return Reader(bytes, begin, file_);
  }
  Result<std::string_view> text() {
    VOX_TRY(const uint32_t length, number());
    VOX_TRY(const Bytes bytes, take(length));
    return std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  Result<std::map<std::string_view, std::string_view>> dictionary() {
    VOX_TRY(const uint32_t count, number());
    std::map<std::string_view, std::string_view> words;
    for (uint32_t i = 0; i < count; ++i) {
      VOX_TRY(const std::string_view key, text());
      VOX_TRY(words[key], text());
    }
    return words;
  }

 private:
  Bytes bytes_;
  size_t at_;
  const std::string& file_;
};

/// Rows of a rotation: which axis goes there, and its sign; then what is added.
struct Transform {
  std::array<int, 3> axis = {0, 1, 2};
  std::array<int, 3> sign = {1, 1, 1};
  std::array<int64_t, 3> shift = {0, 0, 0};

  /// First `inner`, then this one.
  Transform after(const Transform& inner) const {
    Transform both;
    for (size_t i = 0; i < 3; ++i) {
      const auto from = static_cast<size_t>(axis[i]);
      both.axis[i] = inner.axis[from];
      both.sign[i] = sign[i] * inner.sign[from];
      both.shift[i] = sign[i] * inner.shift[from] + shift[i];
    }
    return both;
  }
  /// Of a voxel, whose centre is half an edge further.
  std::array<int64_t, 3> operator()(const std::array<int64_t, 3>& voxel) const {
    std::array<int64_t, 3> to;
    for (size_t i = 0; i < 3; ++i) {
      const int64_t v = voxel[static_cast<size_t>(axis[i])];
      to[i] = (sign[i] > 0 ? v : -v - 1) + shift[i];
    }
    return to;
  }
};

struct Model {
  Place size{};
  Bytes voxels;  ///< x, y, z and colour of each, a byte each
};

enum class Kind { transform, group, shape };
struct Node {
  Kind kind = Kind::group;
  std::vector<Transform> transforms;  ///< of key frames
  uint32_t layer = 0;
  bool hidden = false;
  std::vector<uint32_t> children;  ///< nodes; of a shape, models, one a key frame
  std::vector<uint32_t> frames;    ///< the numbers of key frames

  /// The key frame that counts at a frame: the last one up to there, else the first.
  size_t key_at(uint32_t frame) const {
    size_t best = 0;
    for (size_t i = 1; i < frames.size(); ++i)
      if (frames[i] <= frame && (frames[best] > frame || frames[i] >= frames[best])) best = i;
    return best;
  }
};

/// The palette of files without one: a cube of six steps a channel, then ramps of red, green, blue and grey.
std::array<Color, 256> default_palette() {
  std::array<Color, 256> palette{};
  size_t next = 1;
  constexpr std::array<uint8_t, 6> steps = {0xff, 0xcc, 0x99, 0x66, 0x33, 0x00};
  for (const uint8_t r : steps)
    for (const uint8_t g : steps)
      for (const uint8_t b : steps)
        if ((r | g | b) != 0) palette[next++] = {r, g, b};
  constexpr std::array<uint8_t, 10> ramp = {0xee, 0xdd, 0xbb, 0xaa, 0x88, 0x77, 0x55, 0x44, 0x22, 0x11};
  for (int channel = 0; channel < 4; ++channel)
    for (const uint8_t v : ramp) {
      Color& color = palette[next++];
      for (size_t c = 0; c < 3; ++c) color[c] = channel == 3 || static_cast<size_t>(channel) == c ? v : 0;
    }
  return palette;
}

/// A material of a colour, as version 0.98 and later ones write it, and older ones with one weight for all.
VoxelMaterial material_of(const std::map<std::string_view, std::string_view>& words) {
  // What is no number, or beyond its range, is as if it were not said.
  const auto value = [&](const char* name) -> std::optional<float> {
    const auto at = words.find(name);
    if (at == words.end()) return std::nullopt;
    float number = 0;
    const std::string_view text = at->second;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end != text.data() + text.size() || !(number >= 0 && number <= 1e6f))
      return std::nullopt;
    return number;
  };
  const auto type = words.find("_type");
  const std::string_view kind = type == words.end() ? "_diffuse" : type->second;
  const float weight = value("_weight").value_or(1);
  VoxelMaterial out;
  if (kind == "_metal") {
    out.metalness = std::min(value("_metal").value_or(weight), 1.0f);
  } else if (kind == "_glass") {
    const auto clear = value("_trans");
    out.opacity = 1 - std::min(clear ? *clear : value("_alpha").value_or(weight), 1.0f);
  } else if (kind == "_emit") {
    out.emission = std::min(value("_emit").value_or(weight) * (1 + value("_flux").value_or(0)), 1.0f);
  } else if (kind != "_diffuse" && kind != "_plastic") {
    out.special = true;
  }
  if (kind != "_diffuse")
    out.roughness = std::min(value("_rough").value_or(kind == "_emit" ? 1.0f : 0.1f), 1.0f);
  return out;
}

class File {
 public:
  File(Bytes bytes, const std::string& name, Context& ctx, uint32_t frame)
      : reader_(bytes, 0, name), name_(name), ctx_(ctx), frame_(frame) {}

  Result<VoxelScene> read() {
    VOX_TRY(const uint32_t magic, reader_.number());
    if (magic != tag("VOX ")) return bad_input(name_, "byte 0: not a MagicaVoxel file: expected VOX");
    VOX_TRY(const uint32_t version, reader_.number());
    if (version != 150 && version != 200)
      return bad_input(name_, fmt::format("byte 4: version {}: expected 150 or 200", version));
    VOX_TRY(const uint32_t main, reader_.number());
    if (main != tag("MAIN")) return bad_input(name_, "byte 8: expected the chunk MAIN");
    VOX_TRY(const uint32_t own, reader_.number());
    VOX_TRY(const uint32_t children, reader_.number());
    VOX_CHECK(reader_.take(own));
    VOX_TRY(Reader chunks, reader_.part(children));
    while (chunks.left() > 0) VOX_CHECK(read_chunk(chunks));
    if (models_.empty()) return bad_input(name_, "no model: expected chunks SIZE and XYZI");
    const uint64_t frames = count_frames();
    if (frame_ >= frames)
      return fail(ErrorCode::usage, name_,
                  fmt::format("--frame {}: there are {}: expected 0 to {}", frame_, frames, frames - 1));
    if (nodes_.empty()) {
      VOX_CHECK(place_model(frame_, {}));
    } else {
      VOX_CHECK(place_node(0, {}, 0));
    }
    if (frames > 1)
      scene_.notes.push_back(fmt::format("frame {} of {} is read: --frame N takes another", frame_, frames));
    if (hidden_)
      scene_.notes.push_back(fmt::format("dropped: {} parts of the scene that are hidden", hidden_));
    return std::move(scene_);
  }

 private:
  uint64_t count_frames() const {
    if (nodes_.empty()) return models_.size();
    uint64_t frames = 1;
    for (const auto& [id, node] : nodes_)
      for (const uint32_t frame : node.frames) frames = std::max<uint64_t>(frames, uint64_t{frame} + 1);
    return frames;
  }

  Status read_chunk(Reader& chunks) {
    VOX_TRY(const uint32_t kind, chunks.number());
    VOX_TRY(const uint32_t own, chunks.number());
    VOX_TRY(const uint32_t children, chunks.number());
    VOX_TRY(Reader chunk, chunks.part(own));
    VOX_CHECK(chunks.take(children));
    if (kind == tag("SIZE")) {
      for (int32_t& side : size_) {
        VOX_TRY(const uint32_t value, chunk.number());
        if (value < 1 || value > 256)
          return chunk.bad(fmt::format("a side of {} voxels: expected 1 to 256", value));
        side = static_cast<int32_t>(value);
      }
    } else if (kind == tag("XYZI")) {
      if (size_[0] == 0) return chunk.bad("chunk XYZI: expected a chunk SIZE before");
      VOX_TRY(const uint32_t count, chunk.number());
      VOX_TRY(const Bytes voxels, chunk.take(uint64_t{count} * 4));
      models_.push_back({size_, voxels});
      size_ = {};
    } else if (kind == tag("RGBA")) {
      VOX_TRY(const Bytes colors, chunk.take(256 * 4));
      for (size_t i = 0; i < 255; ++i)
        for (size_t c = 0; c < 3; ++c) palette_[i + 1][c] = std::to_integer<uint8_t>(colors[4 * i + c]);
    } else if (kind == tag("LAYR")) {
      VOX_TRY(const uint32_t id, chunk.number());
      VOX_TRY(const auto words, chunk.dictionary());
      if (const auto hidden = words.find("_hidden"); hidden != words.end())
        hidden_layers_[id] = hidden->second == "1";
    } else if (kind == tag("MATL")) {
      VOX_TRY(const uint32_t id, chunk.number());
      VOX_TRY(const auto words, chunk.dictionary());
      if (id < scene_.materials.size()) scene_.materials[id] = material_of(words);
    } else if (kind == tag("nTRN")) {
      return read_transform(chunk);
    } else if (kind == tag("nGRP") || kind == tag("nSHP")) {
      VOX_TRY(const uint32_t id, chunk.number());
      VOX_CHECK(chunk.dictionary());
      Node node;
      node.kind = kind == tag("nGRP") ? Kind::group : Kind::shape;
      VOX_TRY(const uint32_t count, chunk.number());
      for (uint32_t i = 0; i < count; ++i) {
        VOX_TRY(const uint32_t child, chunk.number());
        node.children.push_back(child);
        if (node.kind != Kind::shape) continue;
        VOX_TRY(const auto words, chunk.dictionary());
        VOX_CHECK(read_frame(words, i, node, chunk));
      }
      nodes_[id] = std::move(node);
    }
    return {};
  }

  Status read_transform(Reader& chunk) {
    VOX_TRY(const uint32_t id, chunk.number());
    VOX_TRY(const auto words, chunk.dictionary());
    Node node;
    node.kind = Kind::transform;
    if (const auto hidden = words.find("_hidden"); hidden != words.end()) node.hidden = hidden->second == "1";
    VOX_TRY(const uint32_t child, chunk.number());
    node.children.push_back(child);
    VOX_CHECK(chunk.number());  // reserved
    VOX_TRY(node.layer, chunk.number());
    VOX_TRY(const uint32_t frames, chunk.number());
    for (uint32_t i = 0; i < frames; ++i) {
      VOX_TRY(const auto frame, chunk.dictionary());
      Transform& transform = node.transforms.emplace_back();
      if (const auto rotation = frame.find("_r"); rotation != frame.end())
        VOX_CHECK(parse_rotation(rotation->second, transform, chunk));
      if (const auto shift = frame.find("_t"); shift != frame.end())
        VOX_CHECK(parse_shift(shift->second, transform, chunk));
      VOX_CHECK(read_frame(frame, i, node, chunk));
    }
    nodes_[id] = std::move(node);
    return {};
  }
  /// The number of a key frame; without one, how many there are before.
  static Status read_frame(const std::map<std::string_view, std::string_view>& words, uint32_t before,
                           Node& node, const Reader& chunk) {
    uint32_t number = before;
    if (const auto said = words.find("_f"); said != words.end()) {
      const std::string_view text = said->second;
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
      if (error != std::errc() || end != text.data() + text.size())
        return chunk.bad(fmt::format("frame \"{}\": expected a number", text));
    }
    node.frames.push_back(number);
    return {};
  }
  /// Bits 0 and 1: the column of the first row's entry, 2 and 3: that of the second's, 4 to 6: signs.
  static Status parse_rotation(std::string_view text, Transform& transform, const Reader& chunk) {
    int bits = -1;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), bits);
    const int first = bits & 3, second = bits >> 2 & 3;
    if (error != std::errc() || bits < 0 || first == 3 || second == 3 || first == second)
      return chunk.bad(fmt::format("rotation \"{}\": expected one of 48", text));
    transform.axis = {first, second, 3 - first - second};
    for (size_t i = 0; i < 3; ++i) transform.sign[i] = (bits >> (4 + i) & 1) != 0 ? -1 : 1;
    return {};
  }
  static Status parse_shift(std::string_view text, Transform& transform, const Reader& chunk) {
    const char* at = text.data();
    const char* const end = at + text.size();
    for (int64_t& value : transform.shift) {
      while (at != end && *at == ' ') ++at;
      const auto [next, error] = std::from_chars(at, end, value);
      if (error != std::errc() || std::abs(value) > furthest)
        return chunk.bad(
            fmt::format("translation \"{}\": expected three whole numbers up to {}", text, furthest));
      at = next;
    }
    return {};
  }

  Status place_node(uint32_t id, const Transform& outer, int depth) {
    const auto found = nodes_.find(id);
    if (found == nodes_.end()) return bad_input(name_, fmt::format("node {}: not there", id));
    if (depth > deepest)
      return bad_input(name_, fmt::format("node {}: more than {} nodes deep", id, deepest));
    if (++visited_ > most_visits)
      return bad_input(name_, fmt::format("more than {} nodes to place", most_visits));
    const Node& node = found->second;
    if (const auto layer = hidden_layers_.find(node.layer);
        node.hidden || (node.kind == Kind::transform && layer != hidden_layers_.end() && layer->second)) {
      ++hidden_;
      return {};
    }
    if (node.kind == Kind::shape) {
      for (const uint32_t model : node.children)
        if (model >= models_.size())
          return bad_input(name_, fmt::format("node {}: model {}: there are {}", id, model, models_.size()));
      return node.children.empty() ? Status() : place_model(node.children[node.key_at(frame_)], outer);
    }
    const Transform inner =
        node.transforms.empty() ? outer : outer.after(node.transforms[node.key_at(frame_)]);
    for (const uint32_t child : node.children) VOX_CHECK(place_node(child, inner, depth + 1));
    return {};
  }

  Status place_model(uint32_t number, const Transform& transform) {
    const Model& model = models_[number];
    const size_t count = model.voxels.size() / 4;
    // A scene may have a model any number of times: what it comes to is counted before it is made.
    placed_ += count + 1;
    VOX_TRY(scene_.memory,
            Reservation::take(placed_ * 2 * sizeof(ModelVoxel), "the voxels of a scene", ctx_));
    // Models in a scene turn about their middle; a file without a scene has its own corner at the origin.
    const std::array<int64_t, 3> middle =
        nodes_.empty() ? std::array<int64_t, 3>{}
                       : std::array<int64_t, 3>{model.size[0] / 2, model.size[1] / 2, model.size[2] / 2};
    for (size_t i = 0; i < count; ++i) {
      std::array<int64_t, 3> at;
      for (size_t a = 0; a < 3; ++a) {
        at[a] = std::to_integer<int64_t>(model.voxels[4 * i + a]);
        if (at[a] >= model.size[a])
          return bad_input(name_, fmt::format("model {}, voxel {}: coordinate {}: expected below {}", number,
                                              i, at[a], model.size[a]));
        at[a] -= middle[a];
      }
      at = transform(at);
      for (const int64_t v : at)
        if (std::abs(v) >= furthest)
          return bad_input(name_,
                           fmt::format("model {}: a voxel at {}: expected within {}", number, v, furthest));
      const auto color = std::to_integer<size_t>(model.voxels[4 * i + 3]);
      scene_.voxels.push_back(
          {{static_cast<int32_t>(at[0]), static_cast<int32_t>(at[2]), static_cast<int32_t>(-1 - at[1])},
           palette_[color],
           static_cast<uint8_t>(color)});
    }
    return {};
  }

  Reader reader_;
  const std::string& name_;
  Context& ctx_;
  uint32_t frame_;
  Place size_{};  ///< of the model whose voxels come next
  std::vector<Model> models_;
  std::array<Color, 256> palette_ = default_palette();
  std::map<uint32_t, Node> nodes_;
  std::map<uint32_t, bool> hidden_layers_;
  uint64_t placed_ = 0, visited_ = 0, hidden_ = 0;
  VoxelScene scene_;
};

}  // namespace

Result<VoxelScene> read_magicavoxel(const std::string& path, Context& ctx, uint32_t frame) {
  VOX_TRY(const auto file, MappedFile::open(path));
  return File(file->bytes(), file->name(), ctx, frame).read();
}

}  // namespace voxkit
