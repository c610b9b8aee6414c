// The chunks of a 3DS file: each has a number, a length, and fields, behind which others may lie in it.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "formats/little_endian.h"
#include "formats/result.h"

namespace voxkit::studio {

/// Numbers of chunks, by the names of the toolkit.
enum : uint16_t {
  color_f = 0x0010,
  color_24 = 0x0011,
  lin_color_24 = 0x0012,
  lin_color_f = 0x0013,
  int_percentage = 0x0030,
  float_percentage = 0x0031,
  mdata = 0x3d3d,
  named_object = 0x4000,
  obj_hidden = 0x4010,
  n_tri_object = 0x4100,
  point_array = 0x4110,
  face_array = 0x4120,
  msh_mat_group = 0x4130,
  tex_verts = 0x4140,
  mesh_matrix = 0x4160,
  n_direct_light = 0x4600,
  n_camera = 0x4700,
  m3dmagic = 0x4d4d,
  mat_name = 0xa000,
  mat_diffuse = 0xa020,
  mat_specular = 0xa030,
  mat_transparency = 0xa050,
  mat_self_illum = 0xa080,
  mat_self_ilpct = 0xa084,
  mat_texmap = 0xa200,
  mat_opacmap = 0xa210,
  mat_mapname = 0xa300,
  mat_map_tiling = 0xa351,
  mat_map_uscale = 0xa354,
  mat_map_vscale = 0xa356,
  mat_map_uoffset = 0xa358,
  mat_map_voffset = 0xa35a,
  mat_map_ang = 0xa35c,
  mat_entry = 0xafff,
  kfdata = 0xb000,
  object_node_tag = 0xb002,
  node_hdr = 0xb010,
  pivot = 0xb013,
  pos_track_tag = 0xb020,
  rot_track_tag = 0xb021,
  scl_track_tag = 0xb022,
  node_id = 0xb030,
};

/// A part of a file that is read front to back; each number is checked against the bytes that are there.
class Body {
 public:
  Body(std::span<const std::byte> file, size_t begin, size_t end, const std::string& path)
      : file_(file), path_(&path), at_(begin), end_(end) {}

  size_t at() const { return at_; }
  size_t left() const { return end_ - at_; }
  tl::unexpected<Error> bad(size_t byte, const std::string& why) const {
    return bad_input(*path_, fmt::format("corrupt 3DS file: byte {}: {}", byte, why));
  }

  template <class T>
  Result<T> number() {
    VOX_TRY(const auto bytes, take(sizeof(T)));
    return load_le<T>(bytes.data());
  }
  /// The next bytes.
  Result<std::span<const std::byte>> take(uint64_t count) {
    if (count > left()) return bad(at_, fmt::format("{} bytes: the chunk has {}", count, left()));
    const auto bytes = file_.subspan(at_, static_cast<size_t>(count));
    at_ += bytes.size();
    return bytes;
  }
  /// Up to a zero.
  Result<std::string> text() {
    const std::string_view all(reinterpret_cast<const char*>(file_.data()) + at_, left());
    const size_t length = all.find('\0');
    if (length == all.npos) return bad(at_, "a name that does not end: expected a zero behind it");
    at_ += length + 1;
    return std::string(all.substr(0, length));
  }

  struct Chunk;
  /// Whether there is a further chunk; fewer bytes than one begins with are none.
  bool has_chunk() const { return left() >= 6; }
  Result<Chunk> chunk();

 private:
  std::span<const std::byte> file_;
  const std::string* path_;
  size_t at_, end_;
};

struct Body::Chunk {
  uint16_t id;
  Body body;
};

inline Result<Body::Chunk> Body::chunk() {
  const size_t begin = at_, most = left();
  VOX_TRY(const auto id, number<uint16_t>());
  VOX_TRY(const auto length, number<uint32_t>());
  if (length < 6 || length > most)
    return bad(begin, fmt::format("chunk {:04X} of {} bytes: expected 6 to {}", id, length, most));
  at_ = begin + length;
  return Chunk{id, Body(file_, begin + 6, at_, *path_)};
}

}  // namespace voxkit::studio
