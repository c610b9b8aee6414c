#include "tools/common/tiles.h"

#include "formats/mapped_file.h"
#include "formats/names.h"
#include "formats/output_file.h"
#include "formats/parallel.h"
#include "formats/reservation.h"
#include "libcolor/edit/levels.h"
#include "libcolor/layout.h"
#include "tools/common/input.h"

namespace voxkit::cli {
namespace {

Result<color::TileFormat> format_of(const std::string& option, const std::string& pattern) {
  if (const auto format = color::tile_format(pattern)) return *format;
  return bad_usage(option + " " + pattern + ": expected .png, .jpg, .jp2, .dds or .astc");
}

/// The tiles of a surface that are there already.
struct Tiles {
  std::vector<std::string> names;
  color::TileFormat format;
  color::Params params;

  /// What `use` makes of a tile; its errors name the file.
  template <class Use>
  auto with(uint64_t part, const Use& use) const -> decltype(use(std::span<const std::byte>(), uint32_t())) {
    VOX_TRY(const auto file, MappedFile::open(names[part]));
    auto result = use(file->bytes(), color::colors_of_part(params.color_count, part));
    if (!result) return fail(result.error().code, names[part], result.error().what);
    return result;
  }
};

/// Whether colours keep their numbers, so that a tile is a part.
bool same_order(const color::Params& params, const color::Options& options) {
  return params.colors == color::Colors::leaf && options.colors == color::Colors::leaf &&
         params.curve == options.curve && params.image_curve == options.image_curve;
}

}  // namespace

Result<std::vector<std::string>> tile_names(const std::string& option, const std::string& pattern,
                                            const color::Params& params) {
  std::vector<std::string> names(color::part_count(params.color_count));
  if (!is_numbered(pattern))
    return bad_usage(option + " " + pattern + ": expected one %d or %04d in the name");
  VOX_TRY(const NumberedName numbered, numbered_name(pattern));
  for (size_t i = 0; i < names.size(); ++i) names[i] = numbered.path(i);
  return names;
}

Result<uint64_t> write_tiles(const color::Volume& volume, const std::string& pattern, Run& run) {
  VOX_TRY(const color::TileFormat format, format_of("-o", pattern));
  VOX_CHECK(check_tile_format(format, volume.params()));
  VOX_TRY(const auto names, tile_names("-o", pattern, volume.params()));
  for (const std::string& name : names) VOX_CHECK(check_output(name, run.options.force));
  Reservation reservation(*run.ctx.memory);
  VOX_CHECK(reservation.add(static_cast<uint64_t>(run.ctx.threads) * color::tile_work_bytes(format),
                            "encoding tiles"));
  run.stage("decode");
  VOX_CHECK(parallel_for(run.ctx, static_cast<int64_t>(names.size()), [&](int64_t i) -> Status {
    const auto part = static_cast<uint64_t>(i);
    VOX_TRY(const auto bytes, tile_of(volume, part, format));
    VOX_TRY(const auto out, OutputFile::create(names[part], run.options.force));
    VOX_CHECK(out->write(bytes));
    return out->commit();
  }));
  return names.size();
}

Result<TiledSurface> open_tiled(const std::string& name, const std::string& pattern,
                                const color::Options& options, Context& ctx) {
  VOX_TRY(const color::TileFormat format, format_of("--tiles", pattern));
  VOX_TRY(const Input input, open_input(name, {}, ctx));
  if (!input.color) return fail(ErrorCode::usage, name, "--tiles: expected the .dagc file that they are of");
  Tiles tiles{{}, format, input.color->params()};
  VOX_TRY(tiles.names, tile_names("--tiles", pattern, tiles.params));
  VOX_TRY(const auto recolored,
          input.color->recolored(
              [tiles](uint64_t part) {
                return tiles.with(part, [&](std::span<const std::byte> file, uint32_t colors) {
                  return colors_of_tile(file, tiles.format, tiles.params.image_curve, colors);
                });
              },
              color::tile_work_bytes(format), *ctx.memory));
  TiledSurface surface;
  surface.source = color::surface_of(recolored);
  if (same_order(tiles.params, options))
    surface.stored = [tiles, options](uint64_t part, uint32_t) {
      return tiles.with(part, [&](std::span<const std::byte> file, uint32_t colors) {
        return part_of_tile(file, tiles.format, options, colors);
      });
    };
  return surface;
}

}  // namespace voxkit::cli
