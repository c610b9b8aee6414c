// Triangles of KHR_draco_mesh_compression, by libdraco: draco.so.
#include <draco/compression/decode.h>
#include <fmt/format.h>

#include <cstring>
#include <optional>

#include "formats/little_endian.h"
#include "formats/mesh/mesh_module.h"
#include "formats/reservation.h"

namespace voxkit {
namespace {

tl::unexpected<Error> bad(const std::string& what) {
  return bad_input({}, "corrupt Draco data: " + what);
}

/// The head of Draco data (Draco bitstream specification, version 2.2): the library makes room for as many
/// triangles as it says, so that is compared first.
class DracoHead {
 public:
  explicit DracoHead(std::span<const std::byte> bytes) : bytes_(bytes) {}

  Status check(uint64_t triangles) {
    if (bytes_.size() < 11 || std::memcmp(bytes_.data(), "DRACO", 5) != 0)
      return bad("expected DRACO at byte 0");
    const auto major = std::to_integer<int>(bytes_[5]), minor = std::to_integer<int>(bytes_[6]);
    if (major != 2 || minor != 2) return bad(fmt::format("version {}.{}: expected 2.2", major, minor));
    if (bytes_[7] != std::byte{1}) return bad("byte 7: expected triangles");
    const bool edgebreaker = bytes_[8] == std::byte{1};
    const bool metadata = (load_le<uint16_t>(bytes_.data() + 9) & 0x8000) != 0;
    at_ = 11;
    if (metadata && !pass_metadata()) return bad("its metadata lead past the end");
    uint64_t faces = 0;
    bool sound = true;
    if (edgebreaker) {
      sound = pass(1) &&
              number();  // how it is walked, and vertices: fewer than 3 a triangle, as the library checks
    }
    const auto count = sound ? number() : std::nullopt;
    if (!count) return bad("it ends in its head");
    faces = *count;
    if (faces != triangles) return bad(fmt::format("{} triangles: its accessor has {}", faces, triangles));
    return {};
  }

 private:
  bool pass(uint64_t count) {
    if (count > bytes_.size() - at_) return false;
    at_ += count;
    return true;
  }
  /// 7 bits a byte, the lowest first.
  std::optional<uint64_t> number() {
    uint64_t value = 0;
    for (int shift = 0; shift < 35; shift += 7) {
      if (at_ == bytes_.size()) return std::nullopt;
      const auto byte = std::to_integer<uint64_t>(bytes_[at_++]);
      value |= (byte & 127) << shift;
      if (byte < 128) return value;
    }
    return std::nullopt;
  }
  bool pass_name() {
    if (at_ == bytes_.size()) return false;
    return pass(1 + std::to_integer<uint64_t>(bytes_[at_]));
  }
  bool pass_entries(int depth) {
    if (depth > 16) return false;
    const auto entries = number();
    for (uint64_t i = 0; entries && i < *entries; ++i) {
      if (!pass_name()) return false;
      const auto size = number();
      if (!size || !pass(*size)) return false;
    }
    const auto below = entries ? number() : std::nullopt;
    for (uint64_t i = 0; below && i < *below; ++i)
      if (!pass_name() || !pass_entries(depth + 1)) return false;
    return below.has_value();
  }
  bool pass_metadata() {
    const auto attributes = number();
    for (uint64_t i = 0; attributes && i < *attributes; ++i)
      if (!number() || !pass_entries(0)) return false;
    return attributes && pass_entries(0);
  }

  std::span<const std::byte> bytes_;
  size_t at_ = 0;
};

Result<DracoMesh> decode_mesh(std::span<const std::byte> bytes, std::span<const DracoAttribute> attributes,
                              uint64_t points, uint64_t triangles, Context& ctx) {
  VOX_CHECK(DracoHead(bytes).check(triangles));
  // Seen: 170 bytes a triangle with positions, normals and picture coordinates.
  VOX_TRY(const Reservation memory,
          Reservation::take(256 * (triangles + points), "unpacking Draco data", ctx));
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  auto decoded = draco::Decoder().DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) return bad(decoded.status().error_msg_string());
  draco::Mesh& mesh = *decoded.value();
  if (mesh.num_points() != points || mesh.num_faces() != triangles)
    return bad(fmt::format("{} points and {} triangles: its accessors have {} and {}", mesh.num_points(),
                           mesh.num_faces(), points, triangles));
  DracoMesh out;
  out.points = points;
  out.indices.reserve(3 * triangles);
  for (uint32_t i = 0; i < triangles; ++i)
    for (const auto& corner : mesh.face(draco::FaceIndex(i))) out.indices.push_back(corner.value());
  for (const DracoAttribute& asked : attributes) {
    const int number = mesh.GetAttributeIdByUniqueId(asked.id);
    if (number < 0) return bad(fmt::format("no attribute {}", asked.id));
    draco::PointAttribute& attribute = *mesh.attribute(number);
    attribute.set_normalized(false);  // as the accessor says
    auto& values = out.attributes.emplace_back(points * asked.components);
    for (uint32_t i = 0; i < points; ++i) {
      const auto at = attribute.mapped_index(draco::PointIndex(i));
      if (at.value() >= attribute.size() ||
          !attribute.ConvertValue<float>(at, static_cast<int8_t>(asked.components),
                                         values.data() + uint64_t{i} * asked.components))
        return bad(fmt::format("attribute {} has no value of point {}", asked.id, i));
    }
  }
  return out;
}

Result<DracoMesh> decode(std::span<const std::byte> bytes, std::span<const DracoAttribute> attributes,
                         uint64_t points, uint64_t triangles, Context& ctx) {
  try {
    return decode_mesh(bytes, attributes, points, triangles, ctx);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, {}, "not enough memory to unpack Draco data");
  } catch (const std::exception& error) {
    return bad(error.what());
  }
}

const MeshModule draco_meshes{.decode_draco = decode};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.mesh = &voxkit::draco_meshes)
