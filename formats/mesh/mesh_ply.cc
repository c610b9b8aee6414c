#include "formats/mesh/mesh_ply.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "formats/mapped_file.h"
#include "formats/mesh/ply_file.h"

namespace voxkit {
namespace {

using namespace ply;

float light_of(double stored) {
  return static_cast<float>(stored <= 0.04045 ? stored / 12.92 : std::pow((stored + 0.055) / 1.055, 2.4));
}

class PlyReader {
 public:
  PlyReader(const Header& header, std::span<const std::byte> bytes, const std::string& path, Context& ctx)
      : header_(header), numbers_(bytes, header, path), path_(path), ctx_(ctx) {}

  Result<MeshParts> read() {
    for (const Element& element : header_.elements) {
      VOX_CHECK(numbers_.check_count(element));
      if (element.name == "vertex") {
        VOX_CHECK(read_vertices(element));
      } else if (element.name == "face" && element.has(Role::corners)) {
        VOX_CHECK(read_faces(element));
      } else {
        VOX_CHECK(pass_over(element));
      }
    }
    Mesh& mesh = parts_.mesh;
    mesh.materials.resize(1);
    parts_.maps.resize(1);
    parts_.maps[0].color.name = mesh.uvs.empty() ? std::string() : header_.texture;
    return std::move(parts_);
  }

 private:
  Status hold(uint64_t bytes) {
    VOX_TRY(Reservation more, Reservation::take(bytes, "the mesh", ctx_));
    parts_.mesh.memory.push_back(std::move(more));
    return {};
  }
  Status pass_over(const Element& element) {
    for (uint64_t i = 0; i < element.count && !element.properties.empty(); ++i)
      for (const Property& p : element.properties) VOX_CHECK(numbers_.pass(p));
    return {};
  }

  Status read_vertices(const Element& element) {
    Mesh& mesh = parts_.mesh;
    const bool colors = element.has(Role::red), uvs = element.has(Role::u) && element.has(Role::v);
    if (!mesh.positions.empty() || !element.has(Role::x) || !element.has(Role::y) || !element.has(Role::z))
      return bad_input(path_, "corrupt PLY file: expected one list of vertices with x, y and z");
    if (element.count > UINT32_MAX)
      return bad_input(path_, fmt::format("a mesh of {} vertices: expected less than 2^32", element.count));
    VOX_CHECK(
        hold(element.count * (sizeof(glm::dvec3) + uvs * sizeof(glm::vec2) + colors * sizeof(glm::vec4))));
    mesh.positions.resize(element.count);
    if (colors) mesh.colors.resize(element.count, glm::vec4(0, 0, 0, 1));
    if (uvs) mesh.uvs.resize(element.count);
    for (uint64_t i = 0; i < element.count; ++i)
      for (const Property& p : element.properties) {
        if (p.role == Role::none) {
          VOX_CHECK(numbers_.pass(p));
          continue;
        }
        VOX_TRY(const double value, numbers_.next(p.type));
        const int offset = static_cast<int>(p.role);
        if (p.role <= Role::z)
          mesh.positions[i][offset - static_cast<int>(Role::x)] = value;
        else if (p.role == Role::alpha && colors)
          mesh.colors[i].a = static_cast<float>(value * scale_of(p.type));
        else if (p.role < Role::alpha && colors)
          mesh.colors[i][offset - static_cast<int>(Role::red)] = light_of(value * scale_of(p.type));
        else if (p.role == Role::u && uvs)
          mesh.uvs[i].x = static_cast<float>(value);
        else if (p.role == Role::v && uvs)
          mesh.uvs[i].y = static_cast<float>(1 - value);
      }
    return {};
  }

  Status read_faces(const Element& element) {
    std::vector<uint32_t> corners;
    std::vector<glm::vec2> texcoords;
    for (uint64_t i = 0; i < element.count; ++i) {
      corners.clear();
      texcoords.clear();
      for (const Property& p : element.properties) {
        if (p.role != Role::corners && p.role != Role::texcoords) {
          VOX_CHECK(numbers_.pass(p));
          continue;
        }
        VOX_TRY(const uint64_t count, numbers_.list_size(p));
        for (uint64_t j = 0; j < count; ++j) {
          VOX_TRY(const double value, numbers_.next(p.type));
          if (p.role == Role::corners) {
            // check_mesh says what is wrong with an index that is none.
            corners.push_back(value >= 0 && value < UINT32_MAX ? static_cast<uint32_t>(value) : UINT32_MAX);
          } else if (j % 2 == 0) {
            texcoords.push_back({static_cast<float>(value), 1});
          } else {
            texcoords.back().y = static_cast<float>(1 - value);
          }
        }
      }
      VOX_CHECK(add_face(corners, texcoords));
    }
    return {};
  }

  /// A fan. A face with texture coordinates of its own has vertices of its own.
  Status add_face(std::vector<uint32_t>& corners, const std::vector<glm::vec2>& texcoords) {
    Mesh& mesh = parts_.mesh;
    if (corners.size() < 3) return {};
    const bool own = texcoords.size() == corners.size();
    VOX_CHECK(make_room(corners.size(), own));
    if (own) {
      mesh.uvs.resize(mesh.positions.size());
      for (size_t j = 0; j < corners.size(); ++j) {
        if (corners[j] >= mesh.positions.size() || mesh.positions.size() >= UINT32_MAX)
          return bad_input(path_, fmt::format("corrupt mesh: vertex {}: expected one below {}", corners[j],
                                              mesh.positions.size()));
        mesh.positions.push_back(mesh.positions[corners[j]]);
        if (!mesh.colors.empty()) mesh.colors.push_back(mesh.colors[corners[j]]);
        mesh.uvs.push_back(texcoords[j]);
        corners[j] = static_cast<uint32_t>(mesh.positions.size() - 1);
      }
    }
    for (size_t j = 2; j < corners.size(); ++j)
      mesh.triangles.push_back({{corners[0], corners[j - 1], corners[j]}, 0});
    return {};
  }
  /// Lists double in size: memory is counted before they do.
  Status make_room(size_t corners, bool own) {
    Mesh& mesh = parts_.mesh;
    if (mesh.triangles.size() + corners > mesh.triangles.capacity()) {
      const size_t room = 2 * mesh.triangles.capacity() + corners + 1024;
      VOX_CHECK(hold((room - mesh.triangles.capacity()) * sizeof(MeshTriangle)));
      mesh.triangles.reserve(room);
    }
    if (own && mesh.positions.size() + corners > std::min(mesh.positions.capacity(), mesh.uvs.capacity())) {
      const size_t room = 2 * mesh.positions.size() + corners + 1024;
      VOX_CHECK(hold((room - mesh.positions.size()) *
                     (sizeof(glm::dvec3) + sizeof(glm::vec2) + !mesh.colors.empty() * sizeof(glm::vec4))));
      mesh.positions.reserve(room);
      mesh.uvs.reserve(room);
      if (!mesh.colors.empty()) mesh.colors.reserve(room);
    }
    return {};
  }

  const Header& header_;
  Numbers numbers_;
  const std::string& path_;
  Context& ctx_;
  MeshParts parts_;
};

}  // namespace

Result<MeshParts> read_ply(const std::string& path, Context& ctx) {
  VOX_TRY(const auto file, MappedFile::open(path));
  const auto bytes = file->bytes();
  VOX_TRY(const ply::Header header, ply::read_header(bytes, path));
  return PlyReader(header, bytes, path, ctx).read();
}

}  // namespace voxkit
