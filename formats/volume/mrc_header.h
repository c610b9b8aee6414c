// The header of MRC2014 and CCP4 maps: 1024 bytes.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>

#include "formats/context.h"
#include "formats/orient.h"
#include "formats/volume.h"
#include "formats/volume/dense_source.h"

namespace voxkit::mrc {

inline constexpr size_t header_bytes = 1024;
/// Byte offsets of the fields in use.
enum : size_t {
  at_dims = 0,
  at_mode = 12,
  at_start = 16,
  at_samples = 28,
  at_cell = 40,
  at_angles = 52,
  at_axes = 64,
  at_range = 76,
  at_space_group = 88,
  at_extended = 92,
  at_extended_type = 104,
  at_version = 108,
  at_imod_stamp = 152,
  at_imod_flags = 156,
  at_origin = 196,
  at_map = 208,
  at_machine = 212,
  at_rms = 216,
  at_label_count = 220,
  at_labels = 224
};
inline constexpr size_t label_bytes = 80, most_labels = 10;
inline constexpr int32_t imod_stamp = 1146047817;  // "IMOD"
inline constexpr int32_t imod_signed = 1,          // bytes are signed
    imod_standard_origin = 4,                      // the sign of the origin is that of the standard
    imod_nibbles = 16;                             // bytes are two samples each
inline constexpr int32_t version_2014 = 20140, volume_stacks = 401;

class Header {
 public:
  template <class T>
  T get(size_t offset) const {
    static_assert(sizeof(T) == 4);
    uint32_t word;
    std::memcpy(&word, bytes.data() + offset, 4);
    return std::bit_cast<T>(big_endian ? __builtin_bswap32(word) : word);
  }
  template <class T>
  void set(size_t offset, T value) {
    static_assert(sizeof(T) == 4);
    std::memcpy(bytes.data() + offset, &value, 4);
  }
  bool has_map() const { return std::memcmp(bytes.data() + at_map, "MAP", 3) == 0; }
  bool is_imod() const { return get<int32_t>(at_imod_stamp) == imod_stamp; }

  std::array<std::byte, header_bytes> bytes{};
  bool big_endian = false;
};

/// What the header says. The axes of `info` are those of the file, columns, rows and sections.
struct Map {
  VolumeInfo info;
  SampleLayout layout;
  bool nibbles = false;  ///< mode 101: two samples a byte, rows of whole bytes
  uint64_t offset = 0;   ///< of the first sample
  int64_t volumes = 1;   ///< of a stack; info is of one
  AxisOrder order;       ///< that makes the axes x, y and z
};

/// Finds the byte order, checks and reads. `name`: of the file. Notes what is dropped or doubtful. Errors:
/// ErrorCode::input.
Result<Map> read_map(Header& header, const std::string& name, Context& ctx);

}  // namespace voxkit::mrc
