// bench_vq_speed: how fast VQ files are decoded and looked into, with one thread.
#include <fmt/core.h>

#include <algorithm>
#include <vector>

#include "formats/copy.h"
#include "formats/hash.h"
#include "libvq/store.h"
#include "tests/bench/thread_time.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"

namespace voxkit::bench {
namespace {

using cli::Json;

struct Options {
  std::string input;
  OpenOptions open;
  int64_t samples = 1000000, rounds = 3;
};

void declare(cli::CommandLine& line, Options& o) {
  line.argument("INPUT", "Scalar volume: a file, or a built-in such as sphere:200", o.input);
  line.option("--samples", "N", "Random positions to look at (1000000)",
              cli::integer(o.samples, 1, int64_t{1} << 32));
  line.option("--rounds", "N", "Repetitions, of which the fastest counts (3)",
              cli::integer(o.rounds, 1, 1000));
  cli::declare_input_options(line, o.open);
}

Result<std::shared_ptr<const vq::Volume>> encode(const Options& o, const vq::Options& options, Context& ctx) {
  VOX_TRY(const cli::Input input, cli::open_input(o.input, o.open, ctx));
  const auto file = std::make_shared<std::vector<std::byte>>();
  VOX_CHECK(vq::encode(
      *input.source, options,
      [&](std::span<const std::byte> bytes) {
        file->insert(file->end(), bytes.begin(), bytes.end());
        return Status{};
      },
      ctx));
  VOX_TRY(auto container, Container::open(*file, o.input, file));
  return vq::Volume::open(std::move(container));
}

/// Decodes every place of the offset volume in turn, whatever it holds; places with constant bricks count as
/// well.
Status decode_places(const vq::Volume& volume, bool constant, uint64_t& bricks, uint64_t& sum) {
  const vq::MappedPools pools(volume);
  const vq::Reader<vq::MappedPools> reader(volume.view(), pools);
  bricks = 0;
  for (uint32_t z = 0; z < volume.view().bricks[2]; ++z)
    for (uint32_t y = 0; y < volume.view().bricks[1]; ++y)
      for (uint32_t x = 0; x < volume.view().bricks[0]; ++x) {
        vq::Record record;
        vq::Brick codes;
        if (!reader.find(reader.brick_id(x, y, z), record))
          return bad_input(volume.container().name(), "no brick");
        if (!constant && record.range.min == record.range.max) continue;
        if (!reader.decode(record, codes.data())) return bad_input(volume.container().name(), "no codes");
        sum += codes[63];
        ++bricks;
      }
  return {};
}

Result<Json> measure(const Options& o, const vq::Volume& volume, uint64_t& sum) {
  const VolumeInfo& info = volume.info();
  const int voxel = voxel_bytes(info.format);
  Json json = Json::object();
  json.set("file_bytes", volume.container().file_bytes());
  json.set("bits_per_voxel", 8 * static_cast<double>(volume.container().file_bytes()) /
                                 static_cast<double>(*checked_voxels(info.dims)));
  uint64_t bricks = 0;
  VOX_TRY(const double brick_seconds,
          fastest(o.rounds, [&] { return decode_places(volume, false, bricks, sum); }));
  json.set("bricks_not_constant", bricks);
  json.set("ns_a_brick", brick_seconds / static_cast<double>(std::max<uint64_t>(1, bricks)) * 1e9);
  json.set("brick_mb_per_s", static_cast<double>(bricks) * vq::brick_voxels * voxel / 1e6 / brick_seconds);

  // The whole volume, in slabs of voxels.
  const Slabs slabs(info.box(), voxel, uint64_t{8} << 20);
  std::vector<std::byte> slab(slabs.bytes());
  VOX_TRY(const double seconds, fastest(o.rounds, [&]() -> Status {
            for (int64_t i = 0; i < slabs.count(); ++i) {
              const Box box = slabs.slab(i);
              VOX_CHECK(volume.decode(box, packed(slab.data(), box.size(), info.format)));
            }
            return {};
          }));
  json.set("volume_mb_per_s", static_cast<double>(raw_bytes(info)) / 1e6 / seconds);

  std::vector<Index3> places;
  for (uint64_t i = 0; i < static_cast<uint64_t>(o.samples); ++i) {
    const auto at = [&](int axis) {
      return static_cast<int64_t>(random64(static_cast<uint64_t>(axis), i) %
                                  static_cast<uint64_t>(info.dims[axis]));
    };
    places.push_back({at(0), at(1), at(2)});
  }
  VOX_TRY(const double sample_seconds, fastest(o.rounds, [&]() -> Status {
            for (const Index3 place : places) {
              VOX_TRY(const Voxel v, volume.sample(place));
              sum += std::to_integer<uint64_t>(v.bytes[0]);
            }
            return {};
          }));
  json.set("ns_a_sample", sample_seconds / static_cast<double>(places.size()) * 1e9);

  // A cube in the middle.
  Box region;
  for (int a = 0; a < 3; ++a) {
    region.lo[a] = std::max<int64_t>(0, info.dims[a] / 2 - 32);
    region.hi[a] = std::min(info.dims[a], region.lo[a] + 64);
  }
  std::vector<std::byte> cube(static_cast<size_t>(region.voxels() * voxel));
  uint64_t region_bricks = 0;
  VOX_TRY(const double region_seconds, fastest(o.rounds, [&]() -> Status {
            VOX_TRY(region_bricks, volume.decode(region, packed(cube.data(), region.size(), info.format)));
            return {};
          }));
  json.set("region", region.size())
      .set("region_bricks", region_bricks)
      .set("region_ms", region_seconds * 1e3);
  return json;
}

Result<int> work(const Options& o, cli::Run& run) {
  run.ctx.threads = 1;
  Json json = Json::result();
  json.set("tool", run.tool).set("version", cli::version_text()).set("input", o.input);
  uint64_t sum = 0;
  for (const auto& [name, codebook] :
       {std::pair("rbuc", vq::Codebook::rbuc), std::pair("packed", vq::Codebook::packed)}) {
    vq::Options options;
    options.codebook = codebook;
    VOX_TRY(const cli::Input input, cli::open_input(o.input, o.open, run.ctx));
    if (input.source->info().format == VoxelFormat::float32) {
      VOX_TRY(options.range, measure_range(*input.source, run.ctx));
    }
    VOX_TRY(const auto volume, encode(o, options, run.ctx));
    VOX_TRY(Json measured, measure(o, *volume, sum));
    json.set(name, std::move(measured));
  }
  json.set("sum", sum);  // so that nothing is left out
  VOX_CHECK(cli::print(json.text()));
  return 0;
}

}  // namespace
}  // namespace voxkit::bench

int main(int argc, char** argv) {
  using namespace voxkit;
  bench::Options options;
  return cli::run_tool(
      argc, argv, "bench_vq_speed",
      "Decodes a volume, compressed in memory, brick by brick, as a whole and at random places.",
      "  bench_vq_speed scan.nii.gz\n", [&](cli::CommandLine& line) { declare(line, options); },
      [&](cli::Run& run) { return bench::work(options, run); });
}
