// What is in a 3DS file, besides the vertices and faces of its objects: materials, and nodes.
#pragma once

#include <glm/vec2.hpp>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "formats/mesh/mesh_3ds_chunks.h"
#include "formats/mesh/mesh_builder.h"
#include "formats/mesh/placement.h"

namespace voxkit::studio {

struct Material {
  MeshMaterial material;
  MeshParts::Maps maps;
  glm::vec4 plain{1};  ///< the colour where it has no texture
  /// Of its texture: uv, which count from the bottom, become scale * uv + offset.
  glm::dvec2 scale{1, 1}, offset{0, 0};
  bool moves() const { return scale != glm::dvec2(1) || offset != glm::dvec2(0); }
};

/// Reads a mat_entry. What of it a mesh cannot say is added to `dropped`.
Result<Material> read_material(Body body, std::set<std::string>& dropped);

/// A node of the key framer: an object, or one that only others are linked to, as its first keys have it.
struct Node {
  std::string object;
  uint32_t id = 0, parent = none;
  glm::dvec3 pivot{0};
  Placement local;
  static constexpr uint32_t none = 0xffff;
};

/// Reads an object_node_tag that is number `index` in its file. `has_keys` becomes true where it moves.
Result<Node> read_node(Body body, uint32_t index, bool& has_keys);

/// Where all nodes are, parents and theirs counted; a parent that is not among them counts as none, and is
/// said in `dropped`. ErrorCode::input where a node is its own parent.
Result<std::vector<Placement>> place_nodes(std::span<const Node> nodes, const std::string& path,
                                           std::set<std::string>& dropped);

}  // namespace voxkit::studio
