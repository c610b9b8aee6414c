// The surface inputs of the tools: meshes, models and everything that has coloured voxels.
#pragma once

#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "libcolor/surface/surface.h"
#include "libcolor/surface/triangle_cells.h"
#include "tools/common/input.h"

namespace voxkit::cli {

struct SurfaceOptions {
  OpenOptions open;
  std::optional<int64_t> resolution;  ///< of meshes and .dagc files: voxels along the longest side
  color::SurfaceKind kind = color::SurfaceKind::thin;
  bool emission = true;           ///< of meshes: is added to the colours; of points: is read
  std::optional<uint32_t> frame;  ///< of an animated .vox model
  /// What voxels have beside colours; nothing: emissive and opacity where the input has them.
  std::optional<color::AttributeSet> attributes = color::AttributeSet();
};

/// An input, and by how much it is moved, in its own unit.
struct PlacedInput {
  std::string name;
  std::optional<glm::dvec3> at;
};

/// The inputs as one surface: as open_surface does where it is one that is not moved; else meshes, points, or
/// both, in one grid around all of them. What shares a voxel is as if it came from one file. Notes name their
/// files then. ErrorCode::usage for inputs that have voxels before.
Result<std::unique_ptr<color::SurfaceSource>> open_surfaces(std::span<const PlacedInput> inputs,
                                                            const SurfaceOptions& options, Context& ctx);

/// Whether a file is a mesh, points or a model by its ending.
bool is_surface_file(const std::string& name);

/// Opens a surface; it can be read once. ErrorCode::usage where the options do not go with it.
Result<std::unique_ptr<color::SurfaceSource>> open_surface(const std::string& name,
                                                           const SurfaceOptions& options, Context& ctx);

}  // namespace voxkit::cli
