// 3DS files to read, chunk by chunk.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/formats/mesh_files.h"

namespace voxkit::studio_file {

inline std::string u16(uint16_t value) {
  return bytes_of(std::vector<uint16_t>{value});
}
inline std::string floats(const std::vector<float>& values) {
  return bytes_of(values);
}
inline std::string text(const std::string& value) {
  return value + std::string(1, '\0');
}
inline std::string chunk(uint16_t id, const std::string& body) {
  return u16(id) + bytes_of(std::vector<uint32_t>{static_cast<uint32_t>(body.size() + 6)}) + body;
}

/// An object with a square of two triangles from (0, 0, 0) to (1, 1, 0), and picture coordinates as places.
struct Object {
  std::string name = "square";
  std::vector<float> places{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  std::vector<uint16_t> faces{0, 1, 2, 0, 0, 2, 3, 0};  ///< three numbers and flags each
  std::vector<float> uvs{0, 0, 1, 0, 1, 1, 0, 1};
  std::vector<float> axes;  ///< x, y, z and origin, or none
  std::string groups;       ///< chunks behind the faces
  std::string more;         ///< chunks of the object
  std::string chunks() const {
    std::string mesh = chunk(0x4110, u16(static_cast<uint16_t>(places.size() / 3)) + floats(places));
    if (!uvs.empty()) mesh += chunk(0x4140, u16(static_cast<uint16_t>(uvs.size() / 2)) + floats(uvs));
    if (!axes.empty()) mesh += chunk(0x4160, floats(axes));
    mesh += chunk(0x4120, u16(static_cast<uint16_t>(faces.size() / 4)) + bytes_of(faces) + groups);
    return chunk(0x4000, text(name) + more + chunk(0x4100, mesh));
  }
};
inline std::string group(const std::string& material, const std::vector<uint16_t>& faces) {
  return chunk(0x4130, text(material) + u16(static_cast<uint16_t>(faces.size())) + bytes_of(faces));
}
/// A material with further chunks.
inline std::string material(const std::string& name, const std::string& chunks) {
  return chunk(0xafff, chunk(0xa000, text(name)) + chunks);
}
inline std::string color_24(uint8_t r, uint8_t g, uint8_t b) {
  return chunk(0x0011, {static_cast<char>(r), static_cast<char>(g), static_cast<char>(b)});
}

/// A node of the key framer: the first keys of its tracks.
struct Node {
  std::string object = "square";
  uint16_t id = 0, parent = 0xffff;
  std::vector<float> pivot{0, 0, 0}, place{0, 0, 0}, scale{1, 1, 1};
  std::vector<float> turn{0, 0, 0, 1};  ///< an angle, and an axis
  uint32_t keys = 1;
  std::string track(uint16_t id_of_track, const std::vector<float>& key) const {
    std::string body(10, '\0');
    body += bytes_of(std::vector<uint32_t>{keys});
    // The second key has a tension, the first a bias and an ease: numbers to pass over.
    for (uint32_t i = 0; i < keys; ++i)
      body += bytes_of(std::vector<uint32_t>{10 * i}) +
              (i == 0 ? u16(0x14) + floats({7, 8}) : u16(1) + floats({9})) + floats(key);
    return chunk(id_of_track, body);
  }
  std::string chunks() const {
    return chunk(0xb002, chunk(0xb030, u16(id)) +
                             chunk(0xb010, text(object) + std::string(4, '\0') + u16(parent)) +
                             chunk(0xb013, floats(pivot)) + track(0xb020, place) + track(0xb021, turn) +
                             track(0xb022, scale));
  }
};

inline std::string file(const std::string& scene, const std::string& nodes = "") {
  return chunk(0x4d4d, chunk(0x0002, std::string("\3\0\0\0", 4)) + chunk(0x3d3d, scene) +
                           (nodes.empty() ? "" : chunk(0xb000, nodes)));
}

}  // namespace voxkit::studio_file
