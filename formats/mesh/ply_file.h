// What is in a PLY file: its header, and the numbers behind it (Greg Turk, "The PLY polygon file format",
// 1994).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/result.h"
#include "formats/volume.h"

namespace voxkit::ply {

enum class Type : uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };
size_t bytes_of(Type type);
/// A number as it lies in a binary file.
double load(const std::byte* bytes, Type type, bool big_endian);
/// Of colours: what makes them 0 to 1. Whole numbers of more than 16 bits have those of 8.
double scale_of(Type type);

/// What of a mesh or of points a property is.
enum class Role : uint8_t {
  none,
  x,
  y,
  z,
  red,
  green,
  blue,
  alpha,
  u,
  v,
  corners,
  texcoords,
  picture,
  // Those below may be left out by Header::drop.
  nx,
  ny,
  nz,
  roughness,
  metalness,
  emissive_red,
  emissive_green,
  emissive_blue,
  label,
  intensity
};

struct Property {
  std::string name;
  Type type = Type::f32, count_type = Type::u8;
  bool list = false;
  Role role = Role::none;
};
struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
  bool has(Role role) const {
    for (const Property& p : properties)
      if (p.role == role) return true;
    return false;
  }
};
struct Header {
  bool ascii = false, big_endian = false;
  std::vector<Element> elements;
  std::vector<std::string> pictures;
  std::optional<VolumeInfo> grid;  ///< as a comment says (voxel_grid.h)
  size_t end = 0;                  ///< where the data begins
  /// Leaves out properties of these roles.
  void drop(Role first, Role last);
  /// What is dropped, properties that have no role, in a sentence; nothing where nothing is.
  std::vector<std::string> notes() const;
};

/// The header at the beginning of a file. `path` is for messages.
Result<Header> read_header(std::span<const std::byte> bytes, const std::string& path);

/// The numbers of a file, one after the other, each checked against the bytes that are there.
class Numbers {
 public:
  /// Begins behind the header. `path` is for messages, and stays.
  Numbers(std::span<const std::byte> bytes, const Header& header, const std::string& path)
      : bytes_(bytes), at_(header.end), ascii_(header.ascii), swap_(header.big_endian), path_(path) {}

  size_t left() const { return bytes_.size() - at_; }
  /// Least bytes of a number of a type.
  size_t least(Type type) const { return ascii_ ? 1 : bytes_of(type); }
  size_t at() const { return at_; }

  Result<double> next(Type type) { return ascii_ ? next_word() : next_binary(type); }
  /// Passes over a property, a list as a whole.
  Status pass(const Property& property);
  /// How many numbers follow in a list.
  Result<uint64_t> list_size(const Property& property);
  /// That so many elements fit into what is left of the file.
  Status check_count(const Element& element) const;

 private:
  Result<double> next_word();
  Result<double> next_binary(Type type);
  tl::unexpected<Error> at_end_or(const char* why) const;

  std::span<const std::byte> bytes_;
  size_t at_;
  bool ascii_, swap_;
  const std::string& path_;
};

}  // namespace voxkit::ply
