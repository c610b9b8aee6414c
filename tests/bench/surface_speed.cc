// bench_surface_speed: coloured surfaces stage by stage, with one thread: reading voxels, building the DAG,
// coding colours; finding the number of a voxel's colour, and the colour.
#include <fmt/core.h>

#include <algorithm>
#include <vector>

#include "formats/hash.h"
#include "libcolor/blocks/block_encode.h"
#include "libcolor/dag/color_order.h"
#include "libcolor/dag/dag_builder.h"
#include "libcolor/dag/dag_recount.h"
#include "libcolor/dag/dag_view.h"
#include "libcolor/layout.h"
#include "libcolor/store.h"
#include "tests/bench/thread_time.h"
#include "tools/common/json.h"
#include "tools/common/main.h"
#include "tools/common/surface_input.h"

namespace voxkit::bench {
namespace {

using namespace color;
using cli::Json;

struct Settings {
  std::string input;
  cli::SurfaceOptions surface;
  double threshold = 9.56;
  int64_t samples = 1000000, rounds = 3;
};

void declare(cli::CommandLine& line, Settings& o) {
  line.argument("INPUT", "Coloured surface, as of dagcolor-pack", o.input);
  line.option("--resolution", "N", "Of a mesh or points: voxels along the longest side (1024)",
              cli::integer(o.surface.resolution, 1, int64_t{1} << most_levels));
  line.option("-e,--threshold", "E", "Of blocks (9.56)", cli::number(o.threshold, 0, 1e6));
  line.option("--samples", "N", "Voxels to look up (1000000)", cli::integer(o.samples, 1, int64_t{1} << 32));
  line.option("--rounds", "N", "Repetitions, of which the fastest counts (3)",
              cli::integer(o.rounds, 1, 1000));
  cli::declare_input_options(line, o.surface.open);
}

double millions(uint64_t count, double seconds) {
  return static_cast<double>(count) / 1e6 / seconds;
}

uint64_t bytes_of(const Dag& dag) {
  uint64_t bytes = dag.leaves.size() * sizeof(uint64_t);
  for (const auto& pool : dag.nodes) bytes += pool.size() * sizeof(uint32_t);
  return bytes;
}

/// Bytes of the words that hold large counts: all that counts take beyond the padding of masks to 32 bits.
uint64_t wide_bytes(const DagView& view) {
  uint64_t bytes = 0;
  for (int h = leaf_height + 1; h <= view.height; ++h)
    for (uint64_t at = 0; at < view.words[static_cast<size_t>(h)];) {
      const NodeRef node = view.node(h, static_cast<uint32_t>(at));
      const bool wide = *node.words >> 8 == wide_count;
      bytes += wide ? 8 : 0;
      at += node_words(static_cast<uint32_t>(std::popcount(node.mask)), wide, view.counts);
    }
  return bytes;
}

/// How long it takes to find the numbers of the colours of voxels.
Result<double> lookup_ns(const DagView& view, const std::vector<uint64_t>& places, int64_t rounds,
                         uint64_t& sum) {
  VOX_TRY(const double seconds, fastest(rounds, [&]() -> Status {
            for (const uint64_t place : places) sum += find_voxel(view, place).color;
            return {};
          }));
  return seconds / static_cast<double>(places.size()) * 1e9;
}

class Bench {
 public:
  Bench(const Settings& settings, cli::Run& run) : o_(settings), ctx_(run.ctx) { ctx_.threads = 1; }

  Result<Json> measure() {
    VOX_CHECK(read());
    VOX_CHECK(build());
    VOX_CHECK(look_up());
    VOX_CHECK(code());
    json_.set("sum", sum_);  // so that nothing is left out
    return std::move(json_);
  }

 private:
  Status read() {
    VOX_TRY(const auto source, cli::open_surface(o_.input, o_.surface, ctx_));
    height_ = height_of(source->info().dims);
    const double start = thread_seconds();
    VOX_CHECK(source->read(ctx_, [&](std::span<const SurfaceVoxel> run) -> Status {
      voxels_.insert(voxels_.end(), run.begin(), run.end());
      return {};
    }));
    json_.set("voxels", voxels_.size());
    json_.set("read_mvoxels_per_s", millions(voxels_.size(), thread_seconds() - start));
    if (voxels_.empty()) return bad_input(o_.input, "no voxels");
    for (const SurfaceVoxel& voxel : voxels_) colors_.push_back(voxel.color);
    return {};
  }

  Status build() {
    VOX_TRY(const double seconds, fastest(o_.rounds, [&]() -> Status {
              DagBuilder builder(height_, ctx_);
              VOX_CHECK(builder.add(voxels_));
              VOX_TRY(dag_, builder.finish());
              return {};
            }));
    json_.set("dag_mvoxels_per_s", millions(voxels_.size(), seconds));
    json_.set("dag_bytes", bytes_of(dag_));
    json_.set("wide_count_bytes", wide_bytes(view_of(dag_)));
    return {};
  }

  Status look_up() {
    std::vector<uint64_t> scattered, in_order;
    const uint64_t count = voxels_.size(), samples = static_cast<uint64_t>(o_.samples);
    for (uint64_t i = 0; i < samples; ++i) {
      scattered.push_back(voxels_[random64(0, i) % count].place);
      in_order.push_back(voxels_[i % count].place);
    }
    for (const auto& [name, counts, curve] : {std::tuple("node", Counts::node, Curve::morton),
                                              {"pointer", Counts::pointer, Curve::morton},
                                              {"node_hilbert", Counts::node, Curve::hilbert},
                                              {"pointer_hilbert", Counts::pointer, Curve::hilbert}}) {
      VOX_TRY(const Dag dag, recount(dag_, Colors::leaf, counts, curve, ctx_));
      const DagView view = view_of(dag);
      Json json = Json::object();
      json.set("bytes", bytes_of(dag));
      json.set("times_as_large", static_cast<double>(bytes_of(dag)) / static_cast<double>(bytes_of(dag_)));
      VOX_TRY(const double random_ns, lookup_ns(view, scattered, o_.rounds, sum_));
      VOX_TRY(const double order_ns, lookup_ns(view, in_order, o_.rounds, sum_));
      VOX_TRY(const double next_ns, fastest(o_.rounds, [&]() -> Status {
                CellFinder finder(view);
                for (const uint64_t place : in_order) sum_ += finder.find(place, 0).color;
                return {};
              }));
      json.set("ns_scattered", random_ns).set("ns_in_order", order_ns).set("ns_in_order_path_kept", next_ns);
      json_.set(name, std::move(json));
    }
    return {};
  }

  /// Blocks of variable size, in parts, by the paper's greedy merging and by optimal parsing.
  Status code() {
    for (const int effort : {1, 3, 9}) {
      std::vector<EncodedPart> parts(part_count(colors_.size()));
      VOX_TRY(const double seconds, fastest(1, [&]() -> Status {
                for (uint64_t i = 0; i < parts.size(); ++i)
                  parts[i] = encode_part(
                      std::span(colors_).subspan(i << part_log2, colors_of_part(colors_.size(), i)),
                      {o_.threshold, 0, effort});
                return {};
              }));
      uint64_t bytes = 0;
      for (const EncodedPart& part : parts) bytes += part.bytes.size();
      Json json = Json::object();
      json.set("mcolors_per_s", millions(colors_.size(), seconds)).set("bytes", bytes);
      json.set("percent", 100 * static_cast<double>(bytes) / (3 * static_cast<double>(colors_.size())));
      const auto decode = [&](const std::vector<uint64_t>& order) {
        return fastest(o_.rounds, [&]() -> Status {
          for (const uint64_t i : order) {
            const EncodedPart& part = parts[i >> part_log2];
            const uint64_t in_part = i >> part_log2;
            const PartView view(part.bytes.data(), part.bytes.size(), colors_of_part(colors_.size(), in_part),
                                endpoints_for(o_.threshold));
            sum_ += view.color(static_cast<uint32_t>(i & (part_colors - 1))).g;
          }
          return {};
        });
      };
      std::vector<uint64_t> scattered;
      for (uint64_t i = 0; i < static_cast<uint64_t>(o_.samples); ++i)
        scattered.push_back(random64(1, i) % colors_.size());
      VOX_TRY(const double color_seconds, decode(scattered));
      json.set("ns_a_scattered_color", color_seconds / static_cast<double>(scattered.size()) * 1e9);
      json_.set(fmt::format("effort_{}", effort), std::move(json));
    }
    return {};
  }

  const Settings& o_;
  Context& ctx_;
  Json json_ = Json::object();
  int height_ = 0;
  std::vector<SurfaceVoxel> voxels_;
  std::vector<Rgb> colors_;
  Dag dag_;
  uint64_t sum_ = 0;
};

Result<int> work(const Settings& o, cli::Run& run) {
  Json json = Json::result();
  json.set("tool", run.tool).set("version", cli::version_text()).set("input", o.input);
  VOX_TRY(Json measured, Bench(o, run).measure());
  json.set("measured", std::move(measured));
  VOX_CHECK(cli::print(json.text()));
  return 0;
}

}  // namespace
}  // namespace voxkit::bench

int main(int argc, char** argv) {
  using namespace voxkit;
  bench::Settings options;
  return cli::run_tool(
      argc, argv, "bench_surface_speed",
      "Voxelises a surface, builds its DAG, codes its colours and looks voxels up, with one thread.",
      "  bench_surface_speed house.glb --resolution 1024\n",
      [&](cli::CommandLine& line) { declare(line, options); },
      [&](cli::Run& run) { return bench::work(options, run); });
}
