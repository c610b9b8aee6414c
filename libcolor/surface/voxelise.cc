#include "libcolor/surface/voxelise.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include "formats/reservation.h"
#include "libcolor/surface/mesh_grid.h"
#include "libcolor/surface/surface_batches.h"
#include "libcolor/surface/voxelise_tile.h"

namespace voxkit::color {
namespace {

/// A cube, and the triangles that touch it, ascending.
struct Part {
  Cube cube;
  std::vector<uint32_t> triangles;
};

/// The cubes of tile size that triangles touch, in Morton order.
class Parts {
 public:
  Parts(const VoxelScene& scene, const Cube& all, int tile_bits) : scene_(scene), tile_bits_(tile_bits) {
    Part part{all, {}};
    part.triangles.resize(scene.corners.size());
    for (size_t i = 0; i < part.triangles.size(); ++i) part.triangles[i] = static_cast<uint32_t>(i);
    stack_.push_back(std::move(part));
  }

  /// Takes the next cube; false at the end.
  Result<bool> next(Part& out, Context& ctx) {
    while (!stack_.empty()) {
      Part part = std::move(stack_.back());
      stack_.pop_back();
      if (part.cube.bits == tile_bits_) {
        out = std::move(part);
        return true;
      }
      std::array<std::vector<uint32_t>, 8> lists;
      divide(scene_, part.cube, part.triangles, lists);
      for (int child = 8; child-- > 0;)
        if (auto& list = lists[static_cast<size_t>(child)]; !list.empty())
          stack_.push_back({child_of(part.cube, child), std::move(list)});
      VOX_CHECK(count_memory(ctx));
    }
    return false;
  }

 private:
  /// The lists that wait: grows in steps, so that it is rarely asked for.
  Status count_memory(Context& ctx) {
    uint64_t bytes = 0;
    for (const Part& part : stack_) bytes += part.triangles.capacity() * sizeof(uint32_t);
    if (bytes <= counted_) return {};
    const uint64_t more = bytes - counted_ + (uint64_t{1} << 20);
    VOX_TRY(Reservation hold, Reservation::take(more, "voxelising", ctx));
    holds_.push_back(std::move(hold));
    counted_ += more;
    return {};
  }

  const VoxelScene& scene_;
  int tile_bits_;
  std::vector<Part> stack_;
  std::vector<Reservation> holds_;
  uint64_t counted_ = 0;
};

/// What is to be said of a mesh.
struct Remarks {
  std::vector<std::string> notes;
  bool emits = false;
};

class MeshSurface : public SurfaceSource {
 public:
  MeshSurface(VoxelScene scene, const VolumeInfo& info, int tile_bits, Reservation memory, Remarks remarks)
      : scene_(std::move(scene)), memory_(std::move(memory)) {
    info_ = info;
    notes_ = std::move(remarks.notes);
    emits_ = remarks.emits;
    const int64_t side = std::max({info.dims.x, info.dims.y, info.dims.z});
    while (int64_t{1} << all_.bits < side) ++all_.bits;
    tile_bits_ = std::min(tile_bits, all_.bits);
  }

  Status read(Context& ctx, const Sink& sink) override {
    Parts parts(scene_, all_, tile_bits_);
    return read_in_batches<Part>(
        {tile_bits_, all_.bits, TileWork::bytes(tile_bits_)}, sink, ctx,
        [&](Part& part) { return parts.next(part, ctx); },
        [&](const Part& part, auto& out) { return make(part, out); });
  }

 private:
  Status make(const Part& part, std::vector<SurfaceVoxel>& out) {
    std::unique_ptr<TileWork> work;
    {
      std::lock_guard lock(mutex_);
      if (!idle_.empty()) work = std::move(idle_.back()), idle_.pop_back();
    }
    if (!work) work = std::make_unique<TileWork>();
    VOX_CHECK(work->run(scene_, part.cube, part.triangles, out));
    std::lock_guard lock(mutex_);
    idle_.push_back(std::move(work));
    return {};
  }

  VoxelScene scene_;
  Reservation memory_;
  Cube all_;
  int tile_bits_ = 0;
  std::mutex mutex_;
  std::vector<std::unique_ptr<TileWork>> idle_;
};

/// What is not kept of opacity and emission.
Remarks remarks_of(const Mesh& mesh, bool emission) {
  Remarks out;
  out.notes = mesh.notes;
  std::vector<bool> used(mesh.materials.size());
  for (const MeshTriangle& triangle : mesh.triangles) used[triangle.material] = true;
  for (const MeshPoint& point : mesh.points) used[point.material] = true;
  const bool faint_corners =
      std::any_of(mesh.colors.begin(), mesh.colors.end(), [](const glm::vec4& color) { return color.a < 1; });
  int blended = 0, emitting = 0;
  for (size_t i = 0; i < used.size(); ++i) {
    const MeshMaterial& m = mesh.materials[i];
    if (!used[i]) continue;
    emitting += m.emits();
    if (m.alpha_mode == AlphaMode::blend)
      blended += m.color.a < 1 || faint_corners ||
                 (m.picture >= 0 && mesh.pictures[static_cast<size_t>(m.picture)].has_alpha);
  }
  if (blended)
    out.notes.push_back(fmt::format(
        "opacity becomes yes or no: of {} blended materials there is what is at least half opaque", blended));
  if (emitting && !emission) out.notes.push_back(fmt::format("dropped: emission of {} materials", emitting));
  out.emits = emitting && emission;
  return out;
}

/// The mesh's own grid, where it has one and no other is asked for.
MeshGrid grid_of(const Mesh& mesh, const VoxeliseOptions& options, Remarks& remarks) {
  if (mesh.grid) {
    const Index3 dims = mesh.grid->dims;
    const auto own = MeshGrid::own(mesh);
    if (!own) {
      remarks.notes.push_back(fmt::format("its grid of {} x {} x {} voxels is not around all of it: dropped",
                                          dims.x, dims.y, dims.z));
    } else if (!options.resolution || *options.resolution == std::max({dims.x, dims.y, dims.z})) {
      remarks.notes.push_back(
          fmt::format("faces of voxels: their own grid of {} x {} x {} is taken", dims.x, dims.y, dims.z));
      return *own;
    }
  }
  return MeshGrid::around(mesh, options.resolution.value_or(default_resolution));
}

}  // namespace

Result<std::unique_ptr<SurfaceSource>> make_surface(Mesh mesh, const VoxeliseOptions& options, Context& ctx) {
  if (options.resolution && (*options.resolution < 1 || *options.resolution > int64_t{1} << most_levels))
    return bad_usage(
        fmt::format("a resolution of {}: expected 1 to {}", *options.resolution, int64_t{1} << most_levels));
  const uint64_t parts = uint64_t{mesh.triangles.size()} + mesh.points.size();
  if (parts == 0 || parts > UINT32_MAX) return bad_input({}, "a mesh without triangles, or of 2^32 or more");
  Remarks remarks = remarks_of(mesh, options.emission);
  const MeshGrid grid = grid_of(mesh, options, remarks);
  const Index3 dims = grid.info().dims;
  if (!checked_voxels(dims))
    return bad_usage(
        fmt::format("a grid of {} x {} x {} voxels: expected at most 2^62: use a lower resolution", dims.x,
                    dims.y, dims.z));
  // Corners, and the numbers of triangles in the lists of the largest cubes; points as triangles.
  const uint64_t as_triangles = mesh.points.empty() ? 0 : parts * sizeof(MeshTriangle);
  VOX_TRY(Reservation memory,
          Reservation::take(parts * (sizeof(SnappedTriangle) + 3 * sizeof(uint32_t)) + as_triangles,
                            "voxelising", ctx));
  VoxelScene scene;
  scene.kind = options.kind;
  scene.first_point = mesh.triangles.size();
  mesh.triangles.reserve(parts);
  for (const auto& [vertex, material] : mesh.points)
    mesh.triangles.push_back({{vertex, vertex, vertex}, material});
  scene.corners.reserve(parts);
  for (const MeshTriangle& triangle : mesh.triangles) scene.corners.push_back(grid.snap(mesh, triangle));

  // One set of levels for a picture that is opaque and one where it is not.
  std::vector<std::array<int32_t, 2>> known(mesh.pictures.size(), {-1, -1});
  const auto levels_of = [&](int32_t number, bool opaque) -> Result<int32_t> {
    if (number < 0) return -1;
    const Picture& picture = mesh.pictures[static_cast<size_t>(number)];
    opaque |= !picture.has_alpha;
    int32_t& index = known[static_cast<size_t>(number)][opaque];
    if (index < 0) {
      VOX_TRY(PictureLevels levels, PictureLevels::make(picture, opaque, ctx));
      index = static_cast<int32_t>(scene.pictures.size());
      scene.pictures.push_back(std::move(levels));
    }
    return index;
  };
  for (MeshMaterial& material : mesh.materials) {
    if (material.alpha_mode == AlphaMode::mask && !(material.alpha_cutoff > 0))
      material.alpha_mode = AlphaMode::opaque;
    if (!options.emission) material.emission = glm::vec3(0), material.emission_picture = -1;
    VOX_TRY(const int32_t color, levels_of(material.picture, material.alpha_mode == AlphaMode::opaque));
    VOX_TRY(const int32_t emission, levels_of(material.emission_picture, true));
    scene.picture_of.push_back(color);
    scene.emission_picture_of.push_back(emission);
  }
  mesh.pictures.clear();
  mesh.positions = {};
  scene.mesh = std::move(mesh);
  return std::make_unique<MeshSurface>(std::move(scene), grid.info(), options.tile_bits, std::move(memory),
                                       std::move(remarks));
}

}  // namespace voxkit::color
