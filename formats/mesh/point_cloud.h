// Coloured points that are read front to back, any number of times, in bounded memory.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/result.h"
#include "formats/volume.h"

namespace voxkit {

/// A point in the unit of its file, and its colour as R, G, B in sRGB.
struct CloudPoint {
  glm::dvec3 at{0};
  std::array<uint8_t, 3> color{};
  uint8_t alpha = 255;
  // What is wanted beside that, where the file has it:
  glm::vec3 normal{0};                     ///< of any length; 0: it has none
  uint8_t roughness = 255, metalness = 0;  ///< 0..255 for 0..1
  std::array<uint8_t, 3> emission{};       ///< the part of its colour that is light of its own, in sRGB
  uint32_t label = 0;                      ///< a class, or another number
};

/// What points may have beside places and colours.
struct PointExtras {
  bool alpha = false, normals = false, rm = false, labels = false, emission = false;
};

class PointCloud {
 public:
  virtual ~PointCloud() = default;
  /// As many as there are in the file, without those that it marks as withheld.
  uint64_t size() const { return size_; }
  /// What of the file is left out, a sentence each.
  const std::vector<std::string>& notes() const { return notes_; }

  /// What the file has, wanted or not.
  const PointExtras& has() const { return has_; }
  /// The grid whose voxels' centres these are, where the file says one (voxel_grid.h).
  const std::optional<VolumeInfo>& grid() const { return grid_; }

  using Sink = std::function<Status(std::span<const CloudPoint>)>;
  /// Calls `sink` with the points, in runs, in their order: all but those with a coordinate that is not
  /// finite, or an alpha below a half; or of 0, where alpha is wanted. ErrorCode::input where the file is
  /// damaged; `sink`'s errors.
  virtual Status read(const Sink& sink) const = 0;

 protected:
  uint64_t size_ = 0;
  PointExtras has_;
  std::optional<VolumeInfo> grid_;
  std::vector<std::string> notes_;
};

/// Whether a name ends like points: .ply (which may be a mesh, too), .pcd, .las or .laz.
bool is_points_name(const std::string& name);

/// Opens the points of a file by its ending. What is not wanted, or not there, is as in a CloudPoint that
/// nothing was said of, and named as dropped. Null of a .ply file with faces, which is a mesh. Errors: those
/// of the functions below.
Result<std::unique_ptr<const PointCloud>> open_points(const std::string& path,
                                                      const PointExtras& wanted = {});

/// The points of a .ply file: its vertices, which have x, y and z, and red, green and blue; without
/// them intensity is grey, from 0, or the least where that is below, to the greatest; else they are white.
/// Normals are nx, ny and nz; emission is emissive_red, emissive_green and emissive_blue; labels are label,
/// class or classification, or a scalar_ of those, where what is below 0 counts back from 2^32. A comment may
/// say the grid that they are of (voxel_grid.h). Null of a file with faces, which is a mesh.
/// ErrorCode::input: no such file, or it is damaged as far as its header says.
Result<std::unique_ptr<const PointCloud>> open_ply_points(const std::string& path,
                                                          const PointExtras& wanted = {});

/// The points of a .pcd file of the Point Cloud Library, version 0.7 or older ("The PCD file format"): ASCII,
/// binary and binary_compressed, which is unpacked into a file in $TMPDIR (default /tmp). Places are x, y and
/// z as they are stored: the viewpoint is not applied, as in PCL. Colours are those of rgb, or of rgba with
/// its alpha, unless that is 0 everywhere; without either, intensity is grey, from 0, or the least where that
/// is below, to the greatest; else points are white. ErrorCode::input: no such file, or it is damaged as far
/// as its header says; ErrorCode::output: no room to unpack it.
Result<std::unique_ptr<const PointCloud>> open_pcd_points(const std::string& path,
                                                          const PointExtras& wanted = {});

/// The points of a .las file, version 1.0 to 1.4 (ASPRS, "LAS specification 1.4-R15"), of any format, not
/// compressed. Places are scaled and shifted in doubles, in the file's coordinate reference system. Of
/// colours of 16 bits the upper 8 count; where none is above 255 they are of 8. Where there are none, or all
/// are 0, intensity is grey, from 0 to the greatest. Labels are classes. Points that are withheld are left
/// out. ErrorCode::input: no such file, it is compressed (LAZ), or it is damaged.
Result<std::unique_ptr<const PointCloud>> open_las_points(const std::string& path,
                                                          const PointExtras& wanted = {});

}  // namespace voxkit
