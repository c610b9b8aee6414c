// bench_nanovdb_rays: first hits of rays, in our compressed volumes and in NanoVDB grids of the same voxels.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <functional>
#include <numeric>
#include <utility>

#include "formats/copy.h"
#include "libcolor/surface/volume_surface.h"
#include "librender/cast/ray_cast.h"
#include "tests/bench/nanovdb_cast.h"
#include "tests/bench/opaque_source.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"

namespace voxkit::bench {
namespace {

using namespace voxkit::render;
using cli::Json;

struct Options {
  std::string input, path = "thesis94";
  OpenOptions open;
  int width = 1920, height = 1080;
  double iso = 1;
};

void declare(cli::CommandLine& line, Options& o) {
  line.argument("INPUT", "Volume: a file, or a built-in such as menger:5", o.input);
  line.option("--size", "WxH", "Size of the picture in pixels (1920x1080)",
              [&o](const std::string& text) -> Status {
                const size_t x = text.find('x');
                if (x == std::string::npos)
                  return bad_usage("\"" + text + "\": expected WxH, such as 1920x1080");
                VOX_TRY(const int64_t width, cli::read_integer(text.substr(0, x), 1, 16384));
                VOX_TRY(const int64_t height, cli::read_integer(text.substr(x + 1), 1, 16384));
                o.width = static_cast<int>(width), o.height = static_cast<int>(height);
                return {};
              });
  line.text("--path", "PATH", "A camera path: thesis94 or orbit:N (thesis94)", o.path);
  line.option("--iso", "V", "Scalar volumes: samples from V on are solid (1)",
              cli::number(o.iso, -1e30, 1e30));
  cli::declare_input_options(line, o.open);
}

/// The volume as a surface, from its beginning.
Result<std::unique_ptr<VolumeSource>> open_surface(const Options& o, Context& ctx) {
  VOX_TRY(cli::Input input, cli::open_input(o.input, o.open, ctx));
  const VolumeInfo& info = input.source->info();
  ValueRange range{0, info.format == VoxelFormat::bitmap ? 1.0 : 255.0};
  if (info.format == VoxelFormat::density16 || info.format == VoxelFormat::float32) {
    VOX_TRY(const cli::Input again, cli::open_input(o.input, o.open, ctx));
    VOX_TRY(range, measure_range(*again.source, ctx));
  }
  const double iso = o.iso + static_cast<double>(info.bias());
  return std::make_unique<OpaqueSource>(std::move(input.source), iso, range);
}

struct Compressed {
  std::shared_ptr<const svmm::Volume> volume;
  uint64_t bytes = 0;
};

/// Compresses into memory, with block widths 2, 4, 8 … and a root of up to 32.
Result<Compressed> compress(const Options& o, double quality, Context& ctx) {
  VOX_TRY(const auto source, open_surface(o, ctx));
  svmm::Params params;
  params.quality = quality;
  params.delta = svmm::delta_of_quality(quality, source->info().format, params.layout);
  const auto bytes = std::make_shared<std::vector<std::byte>>();
  const ByteSink append = [&](std::span<const std::byte> more) -> Status {
    bytes->insert(bytes->end(), more.begin(), more.end());
    return {};
  };
  VOX_CHECK(svmm::encode(*source, params, append, ctx));
  VOX_TRY(auto container, Container::open(*bytes, o.input, bytes));
  Compressed compressed;
  VOX_TRY(compressed.volume, svmm::Volume::open(std::move(container)));
  compressed.bytes = bytes->size();
  return compressed;
}

/// In layout packed, without levels.
Result<std::pair<MaskGrid, uint64_t>> compress_packed(const Options& o, Context& ctx) {
  VOX_TRY(const auto source, open_surface(o, ctx));
  const auto bytes = std::make_shared<std::vector<std::byte>>();
  const ByteSink append = [&](std::span<const std::byte> more) -> Status {
    bytes->insert(bytes->end(), more.begin(), more.end());
    return {};
  };
  VOX_CHECK(svmm::encode_packed(*source, {.levels = false}, append, ctx));
  VOX_TRY(auto container, Container::open(*bytes, o.input, bytes));
  VOX_TRY(auto volume, svmm::PackedVolume::open(std::move(container), *ctx.memory));
  VOX_TRY(auto grid, MaskGrid::open(std::move(volume), ctx));
  return std::pair{std::move(grid), uint64_t{bytes->size()}};
}

struct CompressedSurface {
  std::shared_ptr<const color::Volume> volume;
  uint64_t bytes = 0;
};

/// As a DAG, with its colours in blocks.
Result<CompressedSurface> compress_surface(const Options& o, Context& ctx) {
  VOX_TRY(auto source, open_surface(o, ctx));
  VOX_TRY(const auto surface, color::surface_of(std::move(source)));
  const auto bytes = std::make_shared<std::vector<std::byte>>();
  const ByteSink append = [&](std::span<const std::byte> more) -> Status {
    bytes->insert(bytes->end(), more.begin(), more.end());
    return {};
  };
  VOX_CHECK(color::encode(*surface, {}, append, ctx));
  VOX_TRY(auto container, Container::open(*bytes, o.input, bytes));
  CompressedSurface compressed;
  VOX_TRY(compressed.volume, color::Volume::open(std::move(container)));
  compressed.bytes = bytes->size();
  return compressed;
}

using Voxels = std::vector<std::array<int32_t, 3>>;  // the first voxel of each ray; -1: none

/// One way to find first hits, and what it cost so far.
struct Contender {
  std::string name;
  uint64_t bytes = 0;  ///< of the volume in memory
  /// Casts a frame: its seconds, and what the rays hit.
  std::function<Result<double>(const Camera&, Voxels&)> cast;
  std::vector<double> ms;
  uint64_t hits = 0, differing = 0;  ///< rays; differing from the first contender's

  double average() const {
    return std::accumulate(ms.begin(), ms.end(), 0.0) / static_cast<double>(ms.size());
  }
};

std::vector<Contender> contenders(const Compressed& lossless, const Compressed& lossy,
                                  const CompressedSurface& surface,
                                  const std::pair<MaskGrid, uint64_t>& packed,
                                  const std::shared_ptr<const NanovdbGrid>& peer, const Options& o,
                                  Context& ctx) {
  std::vector<Contender> all;
  const auto add_ours = [&](std::string name, const auto& our_grid, uint64_t bytes) {
    const auto cast_frame = [grid = our_grid, frame = std::make_shared<Frame>(), &o, &ctx](
                                const Camera& camera, Voxels& voxels) -> Result<double> {
      CastOptions options;
      options.width = o.width;
      options.height = o.height;
      options.details = true;  // as the others do, it stores the voxel that was hit
      VOX_CHECK(cast(grid, camera, options, *frame, ctx));
      for (size_t i = 0; i < frame->details.size(); ++i) voxels[i] = std::to_array(frame->details[i].voxel);
      return frame->seconds;
    };
    all.push_back({std::move(name), bytes, cast_frame, {}, 0, 0});
  };
  add_ours("svmm, lossless", SvmmGrid(lossless.volume), lossless.bytes);
  add_ours("svmm, quality 80", SvmmGrid(lossy.volume), lossy.bytes);
  add_ours("DAG, colours looked up", DagGrid(surface.volume), surface.bytes);
  add_ours("svmm packed, lossless, colours looked up", packed.first, packed.second);
  const auto hits = std::make_shared<std::vector<Hit>>();
  const auto add_peer = [&](std::string name, CastFunction* cast_function, March march, bool doubles) {
    const auto cast_frame = [=, &o, &ctx](const Camera& camera, Voxels& voxels) -> Result<double> {
      VOX_TRY(const double seconds,
              cast_function(*peer, {camera, o.width, o.height, march, doubles}, *hits, ctx));
      for (size_t i = 0; i < hits->size(); ++i) voxels[i] = std::to_array((*hits)[i].voxel);
      return seconds;
    };
    all.push_back({std::move(name), peer->bytes(), cast_frame, {}, 0, 0});
  };
  for (const bool native : {false, true}) {
    CastFunction* function = native ? cast_native : cast_as_built;
    const char* flags = native ? ", -march=native" : "";
    add_peer(fmt::format("NanoVDB firstActive, float{}", flags), function, March::first_active, false);
    add_peer(fmt::format("NanoVDB HDDA, float{}", flags), function, March::careful, false);
    add_peer(fmt::format("NanoVDB HDDA, double{}", flags), function, March::careful, true);
  }
  return all;
}

/// Casts every frame with every contender, one after the other, each frame beginning with the next one.
Status run_all(std::vector<Contender>& all, const std::vector<Camera>& cameras, const Options& o,
               Context& ctx) {
  const size_t rays = static_cast<size_t>(o.width) * static_cast<size_t>(o.height);
  std::vector<Voxels> found(all.size(), Voxels(rays));
  // Not counted: the first frame finds cold pages, and checksums that are not verified yet.
  for (size_t k = 0; k < all.size(); ++k) {
    VOX_CHECK(all[k].cast(cameras[0], found[k]));
  }
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (size_t n = 0; n < all.size(); ++n) {
      const size_t k = (i + n) % all.size();
      VOX_TRY(const double seconds, all[k].cast(cameras[i], found[k]));
      all[k].ms.push_back(seconds * 1000);
    }
    for (size_t k = 0; k < all.size(); ++k)
      for (size_t ray = 0; ray < rays; ++ray) {
        all[k].hits += found[k][ray][0] >= 0;
        all[k].differing += found[k][ray] != found[0][ray];
      }
    ctx.progress(static_cast<double>(i + 1) / static_cast<double>(cameras.size()));
  }
  return {};
}

Result<int> work(const Options& o, cli::Run& run) {
  if (o.input == "-") return bad_usage("-: the input is read more than once: expected a file or a built-in");
  VOX_TRY(const Camera camera, parse_camera("orbit:30,20,1.8", 45));
  VOX_TRY(const auto cameras, camera_path(o.path, camera));

  run.stage("compress");
  VOX_TRY(const Compressed lossless, compress(o, 100, run.ctx));
  VOX_TRY(const Compressed lossy, compress(o, 80, run.ctx));
  VOX_TRY(const CompressedSurface surface, compress_surface(o, run.ctx));
  VOX_TRY(const auto packed, compress_packed(o, run.ctx));
  run.stage("NanoVDB");
  VOX_TRY(const auto source, open_surface(o, run.ctx));
  VOX_TRY(const auto peer, NanovdbGrid::build(*source, run.ctx));
  run.stage("cast");
  auto all = contenders(lossless, lossy, surface, packed, peer, o, run.ctx);
  VOX_CHECK(run_all(all, cameras, o, run.ctx));

  const double frame_rays = static_cast<double>(o.width) * static_cast<double>(o.height);
  Json json = Json::result(), rows = Json::array();
  std::string table = fmt::format(
      "{}, {} frames of {}x{}, {}, {} threads\n\n"
      "| | MB | ms min | ms avg | ms max | Mrays/s | rays that hit | differ |\n"
      "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
      o.input, cameras.size(), o.width, o.height, o.path, run.options.threads);
  for (const Contender& c : all) {
    const auto [least, greatest] = std::minmax_element(c.ms.begin(), c.ms.end());
    const double mrays = frame_rays / 1e3 / c.average();
    table += fmt::format("| {} | {:.1f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {} | {} |\n", c.name,
                         static_cast<double>(c.bytes) / 1e6, *least, c.average(), *greatest, mrays, c.hits,
                         c.differing);
    Json row = Json::object();
    row.set("name", c.name).set("bytes", c.bytes).set("ms_min", *least).set("ms_avg", c.average());
    row.set("ms_max", *greatest).set("mrays_per_s", mrays).set("hits", c.hits).set("differing", c.differing);
    rows.push(std::move(row));
  }
  json.set("tool", run.tool).set("version", cli::version_text()).set("input", o.input).set("path", o.path);
  json.set("size", fmt::format("{}x{}", o.width, o.height)).set("frames", cameras.size());
  json.set("threads", run.options.threads).set("rows", std::move(rows));
  json.set("peak_rss_bytes", cli::peak_rss_bytes());
  VOX_CHECK(cli::print(run.options.json ? json.text() : table));
  return 0;
}

}  // namespace
}  // namespace voxkit::bench

int main(int argc, char** argv) {
  using namespace voxkit;
  bench::Options options;
  return cli::run_tool(
      argc, argv, "bench_nanovdb_rays",
      "Times the first hits of rays in our compressed volumes and in NanoVDB grids of the same voxels.",
      "  bench_nanovdb_rays menger:5 --path thesis94\n"
      "  bench_nanovdb_rays scan.nrrd --iso 1200 --size 1280x720 --path orbit:16 --threads 2\n",
      [&](cli::CommandLine& line) { bench::declare(line, options); },
      [&](cli::Run& run) { return bench::work(options, run); });
}
