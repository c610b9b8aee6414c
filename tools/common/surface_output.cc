#include "tools/common/surface_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "formats/mesh/magicavoxel.h"
#include "formats/mesh/ply_points.h"
#include "formats/mesh/voxel_faces.h"
#include "formats/reservation.h"
#include "formats/volume/readers.h"
#include "libcolor/faces/surface_faces.h"
#include "libcolor/palette/palette.h"
#include "libcolor/surface/morton.h"
#include "libcolor/surface/octahedral.h"
#include "tools/common/attributes.h"

namespace voxkit::cli {
namespace {

using Voxels = std::span<const color::SurfaceVoxel>;

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

/// The voxels of a level in a box, in their order there. What they are written as begins at the box's corner.
class Part {
 public:
  Part(const color::Level& level, const Box& box) : level_(level), box_(box), info_(level.info()) {
    if (box == info_.box()) return;
    info_.affine = info_.affine.moved_to(
        {static_cast<double>(box.lo.x), static_cast<double>(box.lo.y), static_cast<double>(box.lo.z)});
    info_.dims = box.size();
  }
  const VolumeInfo& info() const { return info_; }
  color::AttributeSet attributes() const { return level_.attributes(); }
  const Box& box() const { return box_; }
  Status each(const color::SurfaceSource::Sink& sink, Context& ctx) const { return each(box_, sink, ctx); }
  /// Those in a box of the level.
  Status each(const Box& box, const color::SurfaceSource::Sink& sink, Context& ctx) const {
    return box == level_.info().box() ? level_.for_each_voxel(sink, ctx) : level_.for_each_voxel(box, sink);
  }
  std::array<int32_t, 3> place(const color::SurfaceVoxel& voxel) const {
    const Index3 at = Index3(color::morton_place(voxel.place)) - box_.lo;
    return {static_cast<int32_t>(at.x), static_cast<int32_t>(at.y), static_cast<int32_t>(at.z)};
  }

 private:
  const color::Level& level_;
  Box box_;
  VolumeInfo info_;
};

/// What points have beside colours, as properties of a file and as its bytes.
class Properties {
 public:
  explicit Properties(color::AttributeSet set) : set_(set) {
    const auto bytes = [&](std::initializer_list<const char*> names) {
      for (const char* const name : names) list_.push_back({name, "uchar", 1});
    };
    if (set.has(color::Attribute::emissive)) bytes({"emissive_red", "emissive_green", "emissive_blue"});
    if (set.has(color::Attribute::opacity)) bytes({"alpha"});
    if (set.has(color::Attribute::normal))
      for (const char* const name : {"nx", "ny", "nz"}) list_.push_back({name, "float", 4});
    if (set.has(color::Attribute::rm)) bytes({"roughness", "metallic"});
    if (set.has(color::Attribute::id)) list_.push_back({"label", "uint", 4});
  }
  const std::vector<PlyProperty>& list() const { return list_; }

  /// Appends those of a voxel of a run. Only normals are not as they are stored.
  void append(const color::VoxelRun& run, size_t i, std::vector<std::byte>& out) const {
    const auto own = run.attributes.subspan(i * set_.bytes(), set_.bytes());
    if (!set_.has(color::Attribute::normal)) {
      out.insert(out.end(), own.begin(), own.end());
      return;
    }
    const size_t at = set_.offset(color::Attribute::normal);
    const auto direction =
        color::direction_of({std::to_integer<uint8_t>(own[at]), std::to_integer<uint8_t>(own[at + 1])});
    const auto floats = std::as_bytes(std::span(direction));
    out.insert(out.end(), own.begin(), own.begin() + static_cast<std::ptrdiff_t>(at));
    out.insert(out.end(), floats.begin(), floats.end());
    out.insert(out.end(), own.begin() + static_cast<std::ptrdiff_t>(at) + 2, own.end());
  }

 private:
  color::AttributeSet set_;
  std::vector<PlyProperty> list_;
};

Status write_points(const Part& part, uint64_t count, const std::string& name, bool force, Context& ctx) {
  const VolumeInfo& info = part.info();
  const bool doubles = needs_doubles(info);
  const Properties properties(part.attributes());
  VOX_TRY(auto writer, PlyPointWriter::create(name, info, count, doubles, force, properties.list()));
  std::vector<ColoredPoint> points;
  std::vector<std::byte> more;
  VOX_CHECK(part.each(
      [&](const color::VoxelRun& run) -> Status {
        points.clear();
        more.clear();
        for (size_t i = 0; i < run.voxels.size(); ++i) {
          const color::SurfaceVoxel& voxel = run.voxels[i];
          properties.append(run, i, more);
          const auto at = part.place(voxel);
          const Affine::Vector place = info.affine.place(
              {static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])});
          ColoredPoint& point = points.emplace_back();
          point.at = {place[0], place[1], place[2]};
          point.color = {voxel.color.r, voxel.color.g, voxel.color.b};
        }
        return writer.add(points, more);
      },
      ctx));
  return writer.finish();
}

Status write_grid(const Part& part, const std::string& name, bool force, Context& ctx) {
  VOX_TRY(auto sink, create_vdb_voxels(name, part.info(), force, ctx));
  std::vector<ModelVoxel> run;
  VOX_CHECK(part.each(
      [&](Voxels voxels) -> Status {
        run.clear();
        for (const color::SurfaceVoxel& v : voxels)
          run.push_back({part.place(v), {v.color.r, v.color.g, v.color.b}});
        return sink->add(run);
      },
      ctx));
  return sink->finish();
}

Status write_models(const Part& part, uint64_t count, const std::string& name, bool force, Context& ctx) {
  constexpr uint32_t most_colors = 255;
  constexpr int effort = 3;
  // What the file cannot hold is refused before anything is decoded.
  VOX_CHECK(check_magicavoxel(name, part.info().dims, count));
  color::Palette palette;
  {
    VOX_TRY(const Reservation memory,
            Reservation::take(count * sizeof(color::Rgb), "the colors of a surface", ctx));
    std::vector<color::Rgb> colors;
    colors.reserve(count);
    VOX_CHECK(part.each(
        [&](Voxels voxels) -> Status {
          for (const color::SurfaceVoxel& v : voxels) colors.push_back(v.color);
          return {};
        },
        ctx));
    VOX_TRY(palette, color::Palette::choose(colors, most_colors, effort, ctx));
  }
  std::vector<std::array<uint8_t, 3>> chosen;
  for (const color::Rgb& c : palette.colors()) chosen.push_back({c.r, c.g, c.b});
  VOX_TRY(auto writer, create_magicavoxel(name, part.info(), count, chosen, force, ctx));
  std::vector<IndexedVoxel> run;
  uint64_t changed = 0;
  VOX_CHECK(part.each(
      [&](Voxels voxels) -> Status {
        run.clear();
        for (const color::SurfaceVoxel& v : voxels) {
          const uint32_t index = palette.index_of(v.color);
          changed += palette.colors()[index] == v.color ? 0 : 1;
          run.push_back({part.place(v), static_cast<uint8_t>(index)});
        }
        return writer->add(run);
      },
      ctx));
  VOX_CHECK(writer->finish());
  if (changed > 0)
    ctx.note(fmt::format("{}: a .vox file has 255 colors: {} of {} voxels have the nearest of these", name,
                         changed, count));
  return {};
}

Status write_mesh(const Part& part, bool enclosed, SurfaceCount& count, const std::string& name, bool force,
                  Context& ctx) {
  VOX_TRY(const auto writer, create_faces(name, part.info(), force, ctx));
  Context reading = ctx;
  reading.progress = [](double) {};  // of the faces it is told
  VOX_CHECK(color::surface_faces(
      part.box(),
      [&](const Box& box, const color::SurfaceSource::Sink& sink) { return part.each(box, sink, reading); },
      {[&](std::span<const FaceRectangle> faces) {
         count.faces += faces.size();
         return writer->add(faces);
       },
       [&](std::span<const ModelVoxel> voxels) {
         count.enclosed += voxels.size();
         return enclosed ? writer->add_enclosed(voxels) : Status{};
       }},
      ctx));
  return writer->finish();
}

}  // namespace

bool is_only_surface_output(const std::string& name) {
  return has_ending(name, ".ply") || has_ending(name, ".vox") || is_face_output(name);
}

bool is_surface_output(const std::string& name) {
  return is_only_surface_output(name) || has_ending(name, ".vdb");
}

std::vector<std::string> files_of_surface(const std::string& name) {
  return files_of_faces(name);
}

Result<SurfaceCount> write_surface(const color::Level& level, const SurfaceOutput& what,
                                   const std::string& name, bool force, Context& ctx) {
  const Part part(level, what.box);
  SurfaceCount count;
  VOX_TRY(count.voxels, level.count(what.box));
  const bool points = has_ending(name, ".ply");
  if (const color::AttributeSet set = level.attributes(); !points && !set.empty())
    ctx.note(fmt::format("{}: dropped: {}: points (.ply) have all attributes", name, names_of(set)));
  if (is_face_output(name)) {
    VOX_CHECK(write_mesh(part, what.enclosed, count, name, force, ctx));
  } else if (points) {
    VOX_CHECK(write_points(part, count.voxels, name, force, ctx));
  } else if (has_ending(name, ".vdb")) {
    VOX_CHECK(write_grid(part, name, force, ctx));
  } else {
    VOX_CHECK(write_models(part, count.voxels, name, force, ctx));
  }
  return count;
}

}  // namespace voxkit::cli
