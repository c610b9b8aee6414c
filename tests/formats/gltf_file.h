// glTF files, put together part by part.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string>
#include <vector>

#include "tests/formats/mesh_files.h"

namespace voxkit {

/// A glTF file, put together part by part.
class GltfFile {
 public:
  /// The number of a view of these bytes.
  int view(const std::string& bytes, const std::string& more = "") {
    buffer_.resize((buffer_.size() + 3) / 4 * 4);
    views_.push_back(fmt::format(R"({{"buffer":0,"byteOffset":{},"byteLength":{}{}}})", buffer_.size(),
                                 bytes.size(), more));
    buffer_ += bytes;
    return static_cast<int>(views_.size() - 1);
  }
  int accessor(const std::string& bytes, int component, int count, const std::string& type,
               const std::string& more = "", const std::string& of_view = "") {
    return raw_accessor(fmt::format(R"("bufferView":{},"componentType":{},"count":{},"type":"{}"{})",
                                    view(bytes, of_view), component, count, type, more));
  }
  int raw_accessor(const std::string& members) {
    accessors_.push_back("{" + members + "}");
    return static_cast<int>(accessors_.size() - 1);
  }
  template <class T>
  int numbers(const std::vector<T>& values, int component, const std::string& type,
              const std::string& more = "") {
    const size_t each = type == "SCALAR" ? 1
                        : type == "VEC2" ? 2
                        : type == "VEC3" ? 3
                        : type == "VEC4" ? 4
                                         : 16;
    return accessor(bytes_of(values), component, static_cast<int>(values.size() / each), type, more);
  }
  int square() { return numbers<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, 5126, "VEC3"); }
  int square_corners() { return numbers<uint16_t>({0, 1, 2, 0, 2, 3}, 5123, "SCALAR"); }

  std::string nodes = R"([{"mesh":0}])", scenes = R"([{"nodes":[0]}])", primitives, meshes, materials, rest;

  std::string json() const {
    const std::string all_meshes =
        meshes.empty() ? fmt::format(R"([{{"primitives":[{}]}}])", primitives) : meshes;
    return fmt::format(
        R"({{"asset":{{"version":"2.0"}},"scenes":{},"nodes":{},"meshes":{},"materials":[{}],"bufferViews":[{}],)"
        R"("accessors":[{}]{},"buffers":[{{"byteLength":{},"uri":"data:application/octet-stream;base64,{}"}}]}})",
        scenes, nodes, all_meshes, materials, fmt::join(views_, ","), fmt::join(accessors_, ","), rest,
        buffer_.size(), base64(buffer_));
  }

 private:
  std::string buffer_;
  std::vector<std::string> views_, accessors_;
};

/// Bytes from digits of base 16.
inline std::string unhex(const std::string& digits) {
  std::string bytes;
  for (size_t i = 0; i + 1 < digits.size(); i += 2)
    bytes += static_cast<char>(std::stoi(digits.substr(i, 2), nullptr, 16));
  return bytes;
}

// The square of mesh_files.h, packed. The places of its corners by meshoptimizer 0.18:
inline constexpr const char* meshopt_places =
    "a000000133000000ffff01330000007e7d0000010c000000ff010c0000007e000000000000000000000000000000000000000000"
    "000000000000"
    "000000000000000000";
// All of it, with red, green, blue and white corners, by libdraco 1.5.5:
inline constexpr const char* draco_sequential =
    "445241434f0202010000000204010001020002030102000903000002020300010201000101000303013001100300348288040000"
    "0000ff00"
    "0000000101000303012001200300f08331b00100000000ff0000000000000000000000000000000000803f08";
inline constexpr const char* draco_edgebreaker =
    "445241434f02020101000000040201020000011fff0111ff011102ff000000000001000903000002010202030001010101010003"
    "030130011003"
    "002882980000000000ff0000000000000000000000000000000000803f080101010003030130011003002482912600000000ff00"
    "0000";

}  // namespace voxkit
