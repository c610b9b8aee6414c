// Which grids an OpenVDB file has, and where.
#pragma once

#include <fmt/format.h>
#include <openvdb/version.h>

#include <cstdint>
#include <istream>
#include <string>
#include <vector>

#include "formats/result.h"

namespace voxkit {

/// A grid as the file announces it.
struct GridEntry {
  std::string name, type, parent, transform;
  int64_t descriptor = 0, start = 0, end = 0;  ///< byte offsets
  bool is(const char* tree) const { return type == tree || type == std::string(tree) + "_HalfFloat"; }
  bool is_float() const { return is("Tree_float_5_4_3"); }
  bool is_vec3s() const { return is("Tree_vec3s_5_4_3"); }
  bool is_bool() const { return is("Tree_bool_5_4_3"); }
  /// Of one value in memory; 0 for types that are not read.
  int value_bytes() const {
    if (is_bool()) return 1;
    if (is_float() || is("Tree_int32_5_4_3")) return 4;
    if (is("Tree_double_5_4_3") || is("Tree_int64_5_4_3")) return 8;
    return is_vec3s() || is("Tree_vec3i_5_4_3") ? 12 : 0;
  }
  /// Of one value in blocks where floats are stored as halfs.
  int half_bytes() const {
    return is_float() || is("Tree_double_5_4_3") ? 2 : is_vec3s() ? 6 : value_bytes();
  }
  /// Whether its transform is an affine map.
  bool is_linear() const {
    for (const char* known : {"AffineMap", "UnitaryMap", "ScaleMap", "UniformScaleMap", "TranslationMap",
                              "ScaleTranslateMap", "UniformScaleTranslateMap"})
      if (transform == known) return true;
    return false;
  }
};

/// OpenVDB trusts the lengths in a file. So they are walked through here first: a stream that throws at the
/// end of the file, and no length taken that exceeds the bytes that follow.
class Walker {
 public:
  Walker(std::istream& stream, int64_t size) : stream_(stream), size_(size) {}

  Result<std::vector<GridEntry>> grids(const std::string& path) {
    stream_.seekg(0);
    if (number<int64_t>() != openvdb::OPENVDB_MAGIC)
      return bad_input(path, "not an OpenVDB file: expected its magic number at byte 0");
    const uint32_t version = number<uint32_t>();
    if (version < openvdb::OPENVDB_FILE_VERSION_NODE_MASK_COMPRESSION)
      return bad_input(path, fmt::format("OpenVDB file version {}: expected 222 or later", version));
    skip(8);  // library version
    const bool offsets = number<char>() != 0;
    skip(36);  // UUID
    metadata();
    const int32_t count = number<int32_t>();
    std::vector<GridEntry> entries;
    for (int32_t i = 0; i < count; ++i) {
      GridEntry entry;
      entry.descriptor = stream_.tellg();
      entry.name = text();
      entry.name = entry.name.substr(0, entry.name.find('\x1e'));  // what follows numbers grids of one name
      entry.type = text();
      entry.parent = text();
      entry.start = number<int64_t>();
      skip(8);
      entry.end = number<int64_t>();
      const int64_t here = stream_.tellg();
      if (!offsets) entry.start = here, entry.end = size_;
      if (entry.start < here || entry.end < entry.start || entry.end > size_)
        return bad_input(
            path, fmt::format("grid {} spans bytes {} to {}: expected {} to at most {}, the file's size",
                              entry.name, entry.start, entry.end, here, size_));
      stream_.seekg(entry.start);
      skip(4);  // compression
      metadata();
      entry.transform = text();
      stream_.seekg(entry.end);
      entries.push_back(std::move(entry));
      if (!offsets) break;  // written to a stream: no way to the next grid but through this one
    }
    return entries;
  }

 private:
  template <class T>
  T number() {
    T value;
    stream_.read(reinterpret_cast<char*>(&value), sizeof value);
    return value;
  }
  void skip(int64_t bytes) {
    if (bytes > size_ - stream_.tellg()) throw std::ios_base::failure("length exceeds the file");
    stream_.seekg(bytes, std::ios_base::cur);
  }
  std::string text() {
    const uint32_t length = number<uint32_t>();
    if (length > size_ - stream_.tellg()) throw std::ios_base::failure("length exceeds the file");
    std::string value(length, '\0');
    if (length) stream_.read(value.data(), length);
    return value;
  }
  /// Names, types and values. The types that are registered take their size, whatever the file says.
  void metadata() {
    for (uint32_t count = number<uint32_t>(); count > 0; --count) {
      text();
      const std::string type = text();
      const uint32_t length = number<uint32_t>();
      if ((type == "vec3i" && length != 12) || (type == "bool" && length != 1))
        throw std::ios_base::failure("metadata of another length than its type");
      skip(length);
    }
  }

  std::istream& stream_;
  int64_t size_;
};

}  // namespace voxkit
