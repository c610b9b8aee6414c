#include "libcolor/surface/voxelise.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <tuple>
#include <utility>

#include "formats/reservation.h"
#include "libcolor/surface/attribute_choice.h"
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
    attributes_ = scene_.attributes;
    const int64_t side = std::max({info.dims.x, info.dims.y, info.dims.z});
    while (int64_t{1} << all_.bits < side) ++all_.bits;
    tile_bits_ = std::min(tile_bits, all_.bits);
  }

  Status read(Context& ctx, const Sink& sink) override {
    Parts parts(scene_, all_, tile_bits_);
    return read_in_batches<Part>(
        {tile_bits_, all_.bits, TileWork::bytes(tile_bits_, !attributes_.empty()), attributes_.bytes()}, sink,
        ctx, [&](Part& part) { return parts.next(part, ctx); },
        [&](const Part& part, VoxelBatch& out) { return make(part, out); });
  }

 private:
  Status make(const Part& part, VoxelBatch& out) {
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

bool has_faint_corners(const Mesh& mesh) {
  return std::any_of(mesh.colors.begin(), mesh.colors.end(),
                     [](const glm::vec4& color) { return color.a < 1; });
}

/// The numbers of materials, and their names.
std::string legend_of(const std::map<uint32_t, std::string>& names) {
  constexpr size_t most = 32;
  std::string out = "materials:";
  size_t count = 0;
  for (const auto& [number, name] : names) {
    if (count++ == most) break;
    out += fmt::format("{} {} = {}", count > 1 ? "," : "", number, name.empty() ? "(no name)" : name);
  }
  return names.size() > most ? out + fmt::format(" and {} others", names.size() - most) : out;
}

/// What is delivered beside colours; and what is not kept of opacity and emission.
Result<AttributeSet> choose(const Mesh& mesh, const VoxeliseOptions& options, Remarks& out) {
  out.notes = mesh.notes;
  std::vector<bool> used(mesh.materials.size());
  for (const MeshTriangle& triangle : mesh.triangles) used[triangle.material] = true;
  for (const MeshPoint& point : mesh.points) used[point.material] = true;
  const bool faint_corners = has_faint_corners(mesh);
  int blended = 0, emitting = 0;
  std::map<uint32_t, std::string> names;
  for (size_t i = 0; i < used.size(); ++i) {
    const MeshMaterial& m = mesh.materials[i];
    if (!used[i]) continue;
    names.try_emplace(m.number, m.name);
    emitting += m.emits();
    if (m.alpha_mode == AlphaMode::blend)
      blended += m.color.a < 1 || faint_corners ||
                 (m.picture >= 0 && mesh.pictures[static_cast<size_t>(m.picture)].has_alpha);
  }
  out.emits = emitting && options.emission;
  AttributeSet can, by_itself;
  for (const Attribute a : {Attribute::opacity, Attribute::normal, Attribute::id}) can.add(a);
  add_if(can, Attribute::emissive, options.emission && (emitting || mesh.says_emission));
  add_if(can, Attribute::rm, mesh.says_rm);
  add_if(by_itself, Attribute::emissive, out.emits);
  add_if(by_itself, Attribute::opacity, blended > 0);
  if (options.attributes && options.attributes->has(Attribute::emissive) && !options.emission)
    return bad_usage("attributes: emissive: emission is dropped: expected it to be added");
  VOX_TRY(const AttributeSet attributes, choose_attributes(options.attributes, can, by_itself));
  if (attributes.has(Attribute::id)) out.notes.push_back(legend_of(names));
  if (blended && !attributes.has(Attribute::opacity))
    out.notes.push_back(fmt::format(
        "opacity becomes yes or no: of {} blended materials there is what is at least half opaque", blended));
  if (emitting && !options.emission)
    out.notes.push_back(fmt::format("dropped: emission of {} materials", emitting));
  return attributes;
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
  Remarks remarks;
  VOX_TRY(const AttributeSet attributes, choose(mesh, options, remarks));
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
  scene.attributes = attributes;
  scene.normal_axes = grid.normal_axes();
  scene.first_point = mesh.triangles.size();
  mesh.triangles.reserve(parts);
  for (const auto& [vertex, material] : mesh.points)
    mesh.triangles.push_back({{vertex, vertex, vertex}, material});
  scene.corners.reserve(parts);
  for (const MeshTriangle& triangle : mesh.triangles) scene.corners.push_back(grid.snap(mesh, triangle));

  // Levels of a picture, as it is used.
  using Kind = PictureLevels::Kind;
  std::map<std::tuple<int32_t, Kind, int>, int32_t> known;
  const auto levels_of = [&](int32_t number, Kind kind, int cut_off = 0) -> Result<int32_t> {
    if (number < 0) return -1;
    const Picture& picture = mesh.pictures[static_cast<size_t>(number)];
    if (kind == Kind::color && !picture.has_alpha) kind = Kind::opaque;
    const auto [at, is_new] = known.try_emplace({number, kind, cut_off}, 0);
    if (is_new) {
      VOX_TRY(PictureLevels levels, PictureLevels::make(picture, kind, ctx, cut_off));
      at->second = static_cast<int32_t>(scene.pictures.size());
      scene.pictures.push_back(std::move(levels));
    }
    return at->second;
  };
  const bool masks_cover = attributes.has(Attribute::opacity) && !has_faint_corners(mesh);
  for (MeshMaterial& material : mesh.materials) {
    if (material.alpha_mode == AlphaMode::mask && !(material.alpha_cutoff > 0))
      material.alpha_mode = AlphaMode::opaque;
    if (!options.emission) material.emission = glm::vec3(0), material.emission_picture = -1;
    Kind kind = material.alpha_mode == AlphaMode::opaque ? Kind::opaque : Kind::color;
    int cut_off = 0;
    if (masks_cover && material.alpha_mode == AlphaMode::mask && material.picture >= 0 &&
        mesh.pictures[static_cast<size_t>(material.picture)].has_alpha) {
      // Texels are there or not, and levels have how many of them are.
      kind = Kind::mask;
      while (cut_off < 256 && static_cast<float>(cut_off) * material.color.a < 255 * material.alpha_cutoff)
        ++cut_off;
      material.alpha_mode = AlphaMode::blend;
      material.color.a = 1;
    }
    VOX_TRY(const int32_t color, levels_of(material.picture, kind, cut_off));
    VOX_TRY(const int32_t emission, levels_of(material.emission_picture, Kind::opaque));
    VOX_TRY(const int32_t rm,
            levels_of(attributes.has(Attribute::rm) ? material.rm_picture : -1, Kind::numbers));
    scene.picture_of.push_back(color);
    scene.emission_picture_of.push_back(emission);
    scene.rm_picture_of.push_back(rm);
  }
  mesh.pictures.clear();
  if (!attributes.has(Attribute::normal)) mesh.positions = {}, mesh.normals = {};
  scene.mesh = std::move(mesh);
  return std::make_unique<MeshSurface>(std::move(scene), grid.info(), options.tile_bits, std::move(memory),
                                       std::move(remarks));
}

}  // namespace voxkit::color
