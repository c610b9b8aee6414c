// Where a volume is: from voxels to places in a world, and which world and unit these are of.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace voxkit {

/// What the axes of a world are. Numbers are part of FORMAT.md.
enum class World : uint8_t {
  unknown = 0,
  ras = 1,           ///< to the right, anterior and superior side of a patient: NIfTI
  lps = 2,           ///< to the left, posterior and superior side: DICOM
  las = 3,           ///< to the left, anterior and superior side
  scanner = 4,       ///< x, y, z of a scanner
  right_handed = 5,  ///< some right-handed axes
  left_handed = 6,   ///< some left-handed axes
};
/// "RAS", "LPS", "LAS", "scanner", "right-handed", "left-handed" or "unknown".
std::string_view name(World world);
/// Whether axes point to sides of a patient.
constexpr bool is_anatomical(World world) {
  return world == World::ras || world == World::lps || world == World::las;
}

/// Of lengths in a world. Numbers are part of FORMAT.md.
enum class Unit : uint8_t {
  unknown = 0,
  metre,
  centimetre,
  millimetre,
  micrometre,
  nanometre,
  angstrom,
  inch
};
/// "m", "cm", "mm", "um", "nm", "angstrom", "inch" or "unknown".
std::string_view name(Unit unit);
/// By these names and others that files use, in letters of any case: "µm", "micron", "millimeter", "Å" …;
/// nothing for what is not known.
std::optional<Unit> parse_unit(std::string_view text);
/// Metres of a unit; 0 for unknown.
double metres(Unit unit);

/// From the index of a voxel to the place of its centre: origin + i axes[0] + j axes[1] + k axes[2].
struct Affine {
  using Vector = std::array<double, 3>;
  std::array<Vector, 3> axes{
      {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  ///< steps to the next voxel along x, y and z
  Vector origin{0, 0, 0};

  /// Axes along those of the world.
  static Affine plain(const Vector& spacing, const Vector& origin);
  /// Distances of neighbouring voxels along x, y and z: exact where an axis is along one of the world.
  Vector spacing() const;
  /// Whether axis i is along axis i of the world and in its direction, for all three: spacing and origin say
  /// all.
  bool is_plain() const;
  /// Whether all numbers are finite and no axis lies in the plane of the others.
  bool is_valid() const;
  /// Of the axes: above 0 where they are right-handed, as those of the world.
  double determinant() const;
  Vector place(const Vector& index) const;

  /// Of the volume that begins at this voxel, which may lie between others.
  Affine moved_to(const Vector& index) const;
  /// Of the volume whose voxels are so many times as long along each axis, and begin at the same outer
  /// corner.
  Affine coarser(const Vector& factors) const;
  /// Places times a factor.
  Affine times(double factor) const;

  friend bool operator==(const Affine&, const Affine&) = default;
};

/// The same places of a patient in another world: signs change, exactly. Both must be anatomical.
Affine in_world(const Affine& affine, World from, World to);

/// The side of the world, or of the patient, that each axis points to, mostly: "RAS", "LPI" …; of worlds that
/// are not anatomical "+x+y+z", "-y+x+z" …
std::string orientation(const Affine& affine, World world);

/// For each axis of the volume the axis of the world that it is along, mostly, each once: the permutation for
/// which the axes' lengths along their partners are the greatest.
std::array<int, 3> nearest_axes(const Affine& affine);

}  // namespace voxkit
