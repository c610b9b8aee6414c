// Small mesh files to read.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace voxkit {

inline std::string base64(const std::string& bytes) {
  static const char* letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t bits = 0;
    for (size_t j = 0; j < 3; ++j)
      bits = bits << 8 | (i + j < bytes.size() ? static_cast<unsigned char>(bytes[i + j]) : 0u);
    for (size_t j = 0; j < 4; ++j) text += i + j <= bytes.size() ? letters[bits >> (18 - 6 * j) & 63] : '=';
  }
  return text;
}

template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

/// A square of two triangles from (0, 0, 0) to (1, 1, 0), with picture coordinates from the top left, as
/// glTF.
struct GltfSquare {
  std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  std::vector<float> uvs{0, 1, 1, 1, 1, 0, 0, 0};
  std::vector<uint16_t> indices{0, 1, 2, 0, 2, 3};
  std::string nodes = R"([{"mesh":0}])";
  std::string scene = "[0]";
  std::string material = "{}";
  std::string rest;        ///< further members of the file: ,"images":[…]
  std::string attributes;  ///< further attributes
  std::string accessors;   ///< further accessors, from index 3 on
  std::string extra;       ///< further bytes of the buffer, from byte 92 on
  std::string views;       ///< further views, from index 3 on

  std::string buffer() const { return bytes_of(positions) + bytes_of(uvs) + bytes_of(indices) + extra; }
  std::string json(const std::string& uri) const {
    return fmt::format(
        R"({{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":{}}}],"nodes":{},)"
        R"("meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1{}}},"indices":2,"material":0}}]}}],)"
        R"("materials":[{}],"buffers":[{{{}"byteLength":{}}}],)"
        R"("bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":32}},)"
        R"({{"buffer":0,"byteOffset":80,"byteLength":12}}{}],)"
        R"("accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},)"
        R"({{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"}},)"
        R"({{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}}{}]{}}})",
        scene, nodes, attributes, material, uri.empty() ? "" : fmt::format("\"uri\":\"{}\",", uri),
        buffer().size(), views, accessors, rest);
  }
  /// With the buffer in it.
  std::string gltf() const { return json("data:application/octet-stream;base64," + base64(buffer())); }
  std::string glb() const {
    const auto number = [](size_t value) {
      const auto v = static_cast<uint32_t>(value);
      return std::string(reinterpret_cast<const char*>(&v), 4);
    };
    std::string text = json(""), bytes = buffer();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    bytes.resize((bytes.size() + 3) / 4 * 4, '\0');
    return "glTF" + number(2) + number(28 + text.size() + bytes.size()) + number(text.size()) + "JSON" +
           text + number(bytes.size()) + std::string("BIN\0", 4) + bytes;
  }
};

/// The same square as .obj; `head` is before it.
inline std::string obj_square(const std::string& head = "") {
  return head +
         "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
         "f 1/1 2/2 3/3 4/4\n";
}

/// A triangle with colours as .ply, of the given format.
inline std::string ply_triangle(bool binary) {
  std::string text = fmt::format(
      "ply\nformat {} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n",
      binary ? "binary_little_endian" : "ascii");
  if (!binary) return text + "0 0 0 255 0 0\n1 0 0 0 188 0\n0 1 0 0 0 128\n3 0 1 2\n";
  const auto vertex = [&](float x, float y, float z, const std::string& color) {
    text += bytes_of(std::vector<float>{x, y, z}) + color;
  };
  vertex(0, 0, 0, std::string("\xff\0\0", 3));
  vertex(1, 0, 0, std::string("\0\xbc\0", 3));
  vertex(0, 1, 0, std::string("\0\0\x80", 3));
  return text + "\x03" + bytes_of(std::vector<int32_t>{0, 1, 2});
}

/// A triangle of a binary STL file: its corners, and the two bytes behind it.
struct StlTriangle {
  std::vector<float> corners{0, 0, 0, 1, 0, 0, 0, 1, 0};
  uint16_t attribute = 0;
};
inline std::string stl_binary(std::string head, const std::vector<StlTriangle>& triangles) {
  head.resize(80, ' ');
  head += bytes_of(std::vector<uint32_t>{static_cast<uint32_t>(triangles.size())});
  for (const StlTriangle& t : triangles)
    head += bytes_of(std::vector<float>{0, 0, 1}) + bytes_of(t.corners) +
            bytes_of(std::vector<uint16_t>{t.attribute});
  return head;
}
inline std::string stl_ascii() {
  return "solid a square\n"
         "  facet normal 0 0 1\n    outer loop\n      vertex 0 0 0\n      vertex 1 0 0\n"
         "      vertex 1 1e0 0\n    endloop\n  endfacet\n"
         "  FACET NORMAL 0 0 1\n    OUTER LOOP\n      VERTEX 0 0 0\n      VERTEX +1. 1 0\n"
         "      VERTEX 0 1 -0.0\n    ENDLOOP\n  ENDFACET\n"
         "endsolid a square\n";
}

}  // namespace voxkit
