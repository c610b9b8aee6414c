#include "tools/common/surface_output.h"

#include <algorithm>
#include <vector>

#include "formats/mesh/magicavoxel.h"
#include "formats/mesh/ply_points.h"
#include "formats/reservation.h"
#include "formats/volume/readers.h"
#include "libcolor/palette/palette.h"
#include "libcolor/surface/morton.h"

namespace voxkit::cli {
namespace {

using Voxels = std::span<const color::SurfaceVoxel>;

std::array<int32_t, 3> place_of(const color::SurfaceVoxel& voxel) {
  const auto at = color::morton_place(voxel.place);
  return {static_cast<int32_t>(at.x), static_cast<int32_t>(at.y), static_cast<int32_t>(at.z)};
}

/// Whether floats move the centres of voxels, somewhere in the volume, by more than they may.
bool needs_doubles(const VolumeInfo& info) {
  const auto spacing = info.affine.spacing();
  const double step = std::min({spacing[0], spacing[1], spacing[2]});
  for (size_t a = 0; a < 3; ++a) {
    double least = info.affine.origin[a], most = least;
    for (size_t i = 0; i < 3; ++i) {
      const double along = info.affine.axes[i][a] * static_cast<double>(info.dims[static_cast<int>(i)] - 1);
      (along < 0 ? least : most) += along;
    }
    if (voxkit::needs_doubles(least, most, step)) return true;
  }
  return false;
}

Status write_points(color::SurfaceSource& surface, uint64_t count, const std::string& name, bool force,
                    Context& ctx) {
  const VolumeInfo& info = surface.info();
  const bool doubles = needs_doubles(info);
  VOX_TRY(auto writer, PlyPointWriter::create(name, count, doubles, force));
  std::vector<ColoredPoint> points;
  VOX_CHECK(surface.read(ctx, [&](Voxels voxels) -> Status {
    points.clear();
    for (const color::SurfaceVoxel& voxel : voxels) {
      const auto at = place_of(voxel);
      const Affine::Vector place = info.affine.place(
          {static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])});
      ColoredPoint& point = points.emplace_back();
      point.at = {place[0], place[1], place[2]};
      point.color = {voxel.color.r, voxel.color.g, voxel.color.b};
    }
    return writer.add(points);
  }));
  return writer.finish();
}

Status write_grid(color::SurfaceSource& surface, const std::string& name, bool force, Context& ctx) {
  VOX_TRY(auto sink, create_vdb_voxels(name, surface.info(), force, ctx));
  std::vector<ModelVoxel> run;
  VOX_CHECK(surface.read(ctx, [&](Voxels voxels) -> Status {
    run.clear();
    for (const color::SurfaceVoxel& v : voxels)
      run.push_back({place_of(v), {v.color.r, v.color.g, v.color.b}});
    return sink->add(run);
  }));
  return sink->finish();
}

Status write_models(color::SurfaceSource& surface, uint64_t count, const std::string& name, bool force,
                    Context& ctx) {
  constexpr uint32_t most_colors = 255;
  constexpr int effort = 3;
  // What the file cannot hold is refused before anything is decoded.
  VOX_CHECK(check_magicavoxel(name, surface.info().dims, count));
  color::Palette palette;
  {
    VOX_TRY(const Reservation memory,
            Reservation::take(count * sizeof(color::Rgb), "the colors of a surface", ctx));
    std::vector<color::Rgb> colors;
    colors.reserve(count);
    VOX_CHECK(surface.read(ctx, [&](Voxels voxels) -> Status {
      for (const color::SurfaceVoxel& v : voxels) colors.push_back(v.color);
      return {};
    }));
    VOX_TRY(palette, color::Palette::choose(colors, most_colors, effort, ctx));
  }
  std::vector<std::array<uint8_t, 3>> chosen;
  for (const color::Rgb& c : palette.colors()) chosen.push_back({c.r, c.g, c.b});
  VOX_TRY(auto writer, create_magicavoxel(name, surface.info(), count, chosen, force, ctx));
  std::vector<IndexedVoxel> run;
  VOX_CHECK(surface.read(ctx, [&](Voxels voxels) -> Status {
    run.clear();
    for (const color::SurfaceVoxel& v : voxels)
      run.push_back({place_of(v), static_cast<uint8_t>(palette.index_of(v.color))});
    return writer->add(run);
  }));
  return writer->finish();
}

}  // namespace

bool is_only_surface_output(const std::string& name) {
  return has_ending(name, ".ply") || has_ending(name, ".vox");
}

bool is_surface_output(const std::string& name) {
  return is_only_surface_output(name) || has_ending(name, ".vdb");
}

Status write_surface(color::SurfaceSource& surface, uint64_t count, const std::string& name, bool force,
                     Context& ctx) {
  if (has_ending(name, ".ply")) return write_points(surface, count, name, force, ctx);
  if (has_ending(name, ".vdb")) return write_grid(surface, name, force, ctx);
  return write_models(surface, count, name, force, ctx);
}

}  // namespace voxkit::cli
