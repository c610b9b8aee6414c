// Headers of NIfTI, byte by byte.
#pragma once

#include <string>

#include "tests/formats/file_format_test.h"

namespace voxkit {

/// A NIfTI-1 or NIfTI-2 header, built from the byte offsets of the specification.
struct NiftiHeader {
  int version = 1;
  bool big_endian = false;
  std::string bytes = std::string(544, '\0');

  template <class T>
  void set(size_t at, T value) {
    bytes.replace(at, sizeof(T), sample_text<T>({value}, big_endian));
  }
  void dim(int i, int64_t value) {
    if (version == 1)
      set<int16_t>(40 + 2 * static_cast<size_t>(i), static_cast<int16_t>(value));
    else
      set<int64_t>(16 + 8 * static_cast<size_t>(i), value);
  }
  void number(size_t at1, size_t at2, double value) {
    if (version == 1)
      set<float>(at1, static_cast<float>(value));
    else
      set<double>(at2, value);
  }
  void sform(int code, const Affine& a) {
    if (version == 1)
      set<int16_t>(254, static_cast<int16_t>(code));
    else
      set<int32_t>(348, code);
    for (size_t i = 0; i < 3; ++i)
      for (size_t k = 0; k < 4; ++k)
        number(280 + 16 * i + 4 * k, 400 + 32 * i + 8 * k, k < 3 ? a.axes[k][i] : a.origin[i]);
  }
  /// pixdim[0] to [3], the quaternion's b, c, d, and its offset.
  void qform(int code, const std::vector<double>& pixdim, const std::vector<double>& bcd,
             const std::vector<double>& offset) {
    if (version == 1)
      set<int16_t>(252, static_cast<int16_t>(code));
    else
      set<int32_t>(344, code);
    for (size_t i = 0; i < 4; ++i) number(76 + 4 * i, 104 + 8 * i, pixdim[i]);
    for (size_t i = 0; i < 3; ++i) {
      number(256 + 4 * i, 352 + 8 * i, bcd[i]);
      number(268 + 4 * i, 376 + 8 * i, offset[i]);
    }
  }
  void intent(int code) {
    if (version == 1)
      set<int16_t>(68, static_cast<int16_t>(code));
    else
      set<int32_t>(504, code);
  }
  void units(int code) {
    if (version == 1)
      bytes[123] = static_cast<char>(code);
    else
      set<int32_t>(500, code);
  }
  void text(size_t at1, size_t at2, const std::string& value) {
    bytes.replace(version == 1 ? at1 : at2, value.size(), value);
  }
  void type(int16_t code) { set<int16_t>(version == 1 ? 70 : 12, code); }
  void offset(int64_t value) {
    if (version == 1)
      set<float>(108, static_cast<float>(value));
    else
      set<int64_t>(168, value);
  }
};

/// A valid header of a single file, without extensions, of x, y, z voxels.
inline NiftiHeader nifti_header(int version, bool big_endian, Index3 dims, int16_t code) {
  NiftiHeader h;
  h.version = version;
  h.big_endian = big_endian;
  h.set<int32_t>(0, version == 1 ? 348 : 540);
  h.dim(0, 3);
  for (int i = 0; i < 3; ++i) h.dim(i + 1, dims[i]);
  for (size_t i = 0; i < 8; ++i) h.number(76 + 4 * i, 104 + 8 * i, 1);
  h.type(code);
  h.bytes.replace(version == 1 ? 344 : 4, version == 1 ? 4 : 8,
                  version == 1 ? std::string("n+1\0", 4) : std::string("n+2\0\r\n\032\n", 8));
  h.bytes.resize(version == 1 ? 352 : 544);
  h.offset(static_cast<int64_t>(h.bytes.size()));
  return h;
}

}  // namespace voxkit
