#include "libcolor/surface/voxelise.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <utility>

#include "formats/reservation.h"
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

class MeshSurface : public SurfaceSource {
 public:
  MeshSurface(VoxelScene scene, const VolumeInfo& info, int tile_bits, Reservation memory)
      : scene_(std::move(scene)), memory_(std::move(memory)) {
    info_ = info;
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

/// Extents and place of the grid; a corner p is at (p - lo) * scale in steps of 2^-8 voxel.
struct Grid {
  VolumeInfo info;
  glm::dvec3 lo{0};
  double scale = 0;
};

Grid fit(const Mesh& mesh, int64_t resolution) {
  Grid grid;
  glm::dvec3 hi(-INFINITY);
  grid.lo = glm::dvec3(INFINITY);
  for (const MeshTriangle& triangle : mesh.triangles)
    for (const uint32_t v : triangle.vertices)
      for (int c = 0; c < 3; ++c) {
        grid.lo[c] = std::min(grid.lo[c], mesh.positions[v][c]);
        hi[c] = std::max(hi[c], mesh.positions[v][c]);
      }
  const glm::dvec3 size = hi - grid.lo;
  const double longest = std::max({size.x, size.y, size.z}), edge = longest / static_cast<double>(resolution);
  grid.scale = static_cast<double>(resolution * 256) / longest;
  grid.info.format = VoxelFormat::rgba32;
  for (int c = 0; c < 3; ++c) {
    const auto steps = static_cast<int64_t>(std::llround(size[c] * grid.scale));
    grid.info.dims[c] = std::clamp<int64_t>((steps + 255) / 256, 1, resolution);
    grid.info.affine.axes[static_cast<size_t>(c)][static_cast<size_t>(c)] = edge;
    grid.info.affine.origin[static_cast<size_t>(c)] = grid.lo[c] + edge / 2;
  }
  return grid;
}

SnappedTriangle snap(const Mesh& mesh, const MeshTriangle& triangle, const Grid& grid) {
  SnappedTriangle out;
  for (size_t i = 0; i < 3; ++i)
    for (int c = 0; c < 3; ++c) {
      const double place = (mesh.positions[triangle.vertices[i]][c] - grid.lo[c]) * grid.scale;
      const auto last = static_cast<double>(grid.info.dims[c] * 256 - 1);
      out.corners[i][static_cast<size_t>(c)] =
          2 * static_cast<int32_t>(std::clamp(std::floor(place), 0.0, last)) + 1;
    }
  return out;
}

}  // namespace

Result<std::unique_ptr<SurfaceSource>> make_surface(Mesh mesh, const VoxeliseOptions& options, Context& ctx) {
  if (options.resolution < 1 || options.resolution > int64_t{1} << most_levels)
    return bad_usage(
        fmt::format("a resolution of {}: expected 1 to {}", options.resolution, int64_t{1} << most_levels));
  if (mesh.triangles.empty() || mesh.triangles.size() > UINT32_MAX)
    return bad_input({}, "a mesh without triangles, or of 2^32 or more");
  const Grid grid = fit(mesh, options.resolution);
  // Corners, and the numbers of triangles in the lists of the largest cubes.
  VOX_TRY(Reservation memory,
          Reservation::take(mesh.triangles.size() * (sizeof(SnappedTriangle) + 3 * sizeof(uint32_t)),
                            "voxelising", ctx));
  VoxelScene scene;
  scene.kind = options.kind;
  scene.corners.reserve(mesh.triangles.size());
  for (const MeshTriangle& triangle : mesh.triangles) scene.corners.push_back(snap(mesh, triangle, grid));

  // One set of levels for a texture that is opaque and one where it is not.
  std::vector<std::array<int32_t, 2>> known(mesh.textures.size(), {-1, -1});
  for (MeshMaterial& material : mesh.materials) {
    if (material.alpha_mode == AlphaMode::mask && !(material.alpha_cutoff > 0))
      material.alpha_mode = AlphaMode::opaque;
    scene.texture_of.push_back(-1);
    if (material.texture < 0) continue;
    const Texture& texture = mesh.textures[static_cast<size_t>(material.texture)];
    const bool opaque = material.alpha_mode == AlphaMode::opaque || !texture.has_alpha;
    int32_t& index = known[static_cast<size_t>(material.texture)][opaque];
    if (index < 0) {
      VOX_TRY(TextureLevels levels, TextureLevels::make(texture, opaque, ctx));
      index = static_cast<int32_t>(scene.textures.size());
      scene.textures.push_back(std::move(levels));
    }
    scene.texture_of.back() = index;
  }
  mesh.textures.clear();
  mesh.positions = {};
  scene.mesh = std::move(mesh);
  return std::make_unique<MeshSurface>(std::move(scene), grid.info, options.tile_bits, std::move(memory));
}

}  // namespace voxkit::color
