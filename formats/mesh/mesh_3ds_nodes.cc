// Where objects of 3DS files are: what the first keys of the key framer say.
#include <array>
#include <cmath>

#include "formats/mesh/mesh_3ds_parts.h"

namespace voxkit::studio {
namespace {

/// The first key of a track, `n` numbers, into `to`, which stays where there is none.
template <size_t n>
Status read_first_key(Body body, std::array<double, n>& to, bool& has_keys) {
  VOX_CHECK(body.take(10));
  VOX_TRY(const auto keys, body.number<uint32_t>());
  has_keys |= keys > 1;
  if (keys == 0) return {};
  VOX_CHECK(body.number<uint32_t>());  // its frame
  VOX_TRY(const auto splines, body.number<uint16_t>());
  for (int bit = 0; bit < 5; ++bit)
    if (splines >> bit & 1) VOX_CHECK(body.number<float>());
  for (double& value : to) {
    VOX_TRY(const auto stored, body.number<float>());
    if (!(std::abs(stored) < 1e30f)) return body.bad(body.at() - 4, "a key: expected finite numbers");
    value = stored;
  }
  return {};
}

/// Clockwise, seen from where the axis points to; of any length, but 0: nothing is turned.
glm::dmat3 rotation(double angle, const glm::dvec3& axis) {
  const double length = std::sqrt(axis.x * axis.x + axis.y * axis.y + axis.z * axis.z);
  if (!(length > 1e-12)) return glm::dmat3(1);
  const glm::dvec3 u = axis / length;
  const double c = std::cos(angle), s = -std::sin(angle), t = 1 - c;
  glm::dmat3 out(1);
  out[0] = {c + t * u.x * u.x, t * u.x * u.y + s * u.z, t * u.x * u.z - s * u.y};
  out[1] = {t * u.x * u.y - s * u.z, c + t * u.y * u.y, t * u.y * u.z + s * u.x};
  out[2] = {t * u.x * u.z + s * u.y, t * u.y * u.z - s * u.x, c + t * u.z * u.z};
  return out;
}

}  // namespace

Result<Node> read_node(Body body, uint32_t index, bool& has_keys) {
  Node node;
  node.id = index;
  std::array<double, 3> place{0, 0, 0}, scale{1, 1, 1};
  std::array<double, 4> turn{0, 0, 0, 0};
  while (body.has_chunk()) {
    VOX_TRY(Body::Chunk chunk, body.chunk());
    switch (chunk.id) {
      case node_id: {
        VOX_TRY(node.id, chunk.body.number<uint16_t>());
        break;
      }
      case node_hdr: {
        VOX_TRY(node.object, chunk.body.text());
        VOX_CHECK(chunk.body.take(4));
        VOX_TRY(node.parent, chunk.body.number<uint16_t>());
        break;
      }
      case pivot:
        for (int a = 0; a < 3; ++a) {
          VOX_TRY(const auto value, chunk.body.number<float>());
          if (!(std::abs(value) < 1e30f))
            return body.bad(chunk.body.at() - 4, "a pivot: expected finite numbers");
          node.pivot[a] = value;
        }
        break;
      case pos_track_tag:
        VOX_CHECK(read_first_key(chunk.body, place, has_keys));
        break;
      case rot_track_tag:
        VOX_CHECK(read_first_key(chunk.body, turn, has_keys));
        break;
      case scl_track_tag:
        VOX_CHECK(read_first_key(chunk.body, scale, has_keys));
        break;
      default:
        break;
    }
  }
  node.local.linear = rotation(turn[0], {turn[1], turn[2], turn[3]});
  for (int a = 0; a < 3; ++a) node.local.linear[a] *= scale[static_cast<size_t>(a)];
  node.local.shift = {place[0], place[1], place[2]};
  return node;
}

Result<std::vector<Placement>> place_nodes(std::span<const Node> nodes, const std::string& path,
                                           std::set<std::string>& dropped) {
  std::map<uint32_t, size_t> by_id;
  for (size_t i = 0; i < nodes.size(); ++i) by_id.emplace(nodes[i].id, i);
  std::vector<Placement> out(nodes.size());
  std::vector<bool> known(nodes.size());
  std::vector<size_t> chain;
  for (size_t i = 0; i < nodes.size(); ++i) {
    // From a node up to one that is known, or has no parent; then down again.
    chain.clear();
    const Placement* above = nullptr;
    for (size_t at = i;; at = by_id[nodes[at].parent]) {
      if (known[at]) {
        above = &out[at];
        break;
      }
      if (chain.size() == nodes.size())
        return bad_input(path, fmt::format("corrupt 3DS file: node {}: it is its own parent", nodes[i].id));
      chain.push_back(at);
      if (nodes[at].parent == Node::none) break;
      if (!by_id.contains(nodes[at].parent)) {
        dropped.insert("links to lights, cameras and what is not there");
        break;
      }
    }
    for (; !chain.empty(); chain.pop_back()) {
      const size_t at = chain.back();
      out[at] = above ? *above * nodes[at].local : nodes[at].local;
      known[at] = true;
      above = &out[at];
    }
  }
  return out;
}

}  // namespace voxkit::studio
