// What the fuzz targets and tests/formats/hostile_test.cc share: each reader on any bytes, and what it may
// answer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "formats/volume/readers.h"

namespace voxkit::fuzz {

using Input = std::span<const std::byte>;

/// How a reader dealt with an input.
struct Verdict {
  bool accepted = false;  ///< the volume was opened and all that was asked of it could be read
  /// What is not acceptable on any input, in words; empty where all is well. Errors of the input and limits
  /// are well.
  std::string fault;
};

Verdict read_nrrd(Input input);
Verdict read_nifti(Input input);
Verdict read_mrc(Input input);
Verdict read_npy(Input input);
Verdict read_meta_image(Input input);
Verdict read_vtk(Input input);
Verdict read_vti(Input input);
/// The first 7 bytes are the options: x, y, z (two bytes each, little endian), type and byte order.
Verdict read_raw(Input input);
Verdict read_gunzip(Input input);
Verdict read_bunzip2(Input input);
/// TIFF, PNG or EXR by the first byte, as one slice.
Verdict read_image(Input input);
Verdict read_openvdb(Input input);
/// A folder of one slice.
Verdict read_dicom(Input input);
/// A mesh, or points.
Verdict read_mesh_ply(Input input);
/// GLB where it starts so.
Verdict read_mesh_gltf(Input input);
Verdict read_mesh_obj(Input input);
Verdict read_mesh_stl(Input input);
Verdict read_mesh_3ds(Input input);
Verdict read_points_pcd(Input input);
Verdict read_points_las(Input input);
/// Images in memory: the first two bytes are their width and height.
Verdict read_jpeg(Input input);
Verdict read_jp2(Input input);
Verdict read_png(Input input);

struct Reader {
  const char* name;    ///< also of the fuzz target
  const char* module;  ///< without which there is no such reader; null for none
  Verdict (*read)(Input);
  std::vector<std::string> (*seeds)();  ///< small valid inputs, which use what the format can do
};
const std::vector<Reader>& readers();

}  // namespace voxkit::fuzz
