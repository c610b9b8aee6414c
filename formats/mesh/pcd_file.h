// What is in a PCD file: its header, and where its numbers are (Point Cloud Library, "The PCD file format").
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/result.h"

namespace voxkit::pcd {

enum class Data : uint8_t { ascii, binary, compressed };

/// Numbers that each point has.
struct Field {
  std::string name;
  char type = 'F';     ///< F: floats, I and U: integers with and without sign
  uint32_t size = 4;   ///< bytes of a number
  uint64_t count = 1;  ///< numbers of a point
  uint64_t words = 0;  ///< numbers of a point before these
  uint64_t bytes = 0;  ///< bytes of a point before these
};

/// Which fields mean what; -1: none.
struct Roles {
  int at[3] = {-1, -1, -1};
  int color = -1, intensity = -1;  ///< one of them, or none
  bool has_alpha = false;          ///< of the colour
};

struct Header {
  std::vector<Field> fields;
  Roles roles;
  uint64_t points = 0, words = 0, bytes = 0;  ///< numbers and bytes of a point
  Data data = Data::ascii;
  size_t end = 0;                  ///< where the data begins
  std::vector<std::string> notes;  ///< what of the file is left out
};

/// The header at the beginning of a file; all of its sizes fit into 64 bits. `path` is for messages.
/// ErrorCode::input, also where there is no place.
Result<Header> read_header(std::span<const std::byte> bytes, const std::string& path);

/// A number as it lies in a binary file.
double load(const std::byte* bytes, const Field& field);

/// A number of a line of text. False where it is none.
bool parse(std::string_view word, double& value);
/// The same of a packed colour, alpha, red, green and blue from its highest byte to its lowest: the bits of a
/// float, or a whole number. Nothing where it is a NaN, whose bits the text does not have.
bool parse_color(std::string_view word, const Field& field, std::optional<uint32_t>& color);

}  // namespace voxkit::pcd
