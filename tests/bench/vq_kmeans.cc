// bench_vq_kmeans: codebooks of fewer bricks, by our k-means and by that of faiss.
#include <fmt/core.h>

#include <bit>
#include <cmath>
#include <numeric>
#include <vector>

#include "libvq/collect.h"
#include "libvq/kmeans.h"
#include "tests/bench/faiss_kmeans.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"
#include "tools/common/parse.h"

namespace voxkit::bench {
namespace {

using cli::Json;

struct Options {
  std::string input;
  OpenOptions open;
  int64_t reduce = 16, iterations = int64_t{~uint32_t{0}}, faiss_iterations = 10;
  std::string seeding = "furthest";
};

void declare(cli::CommandLine& line, Options& o) {
  line.argument("INPUT", "Scalar volume: a file, or a built-in such as sphere:200", o.input);
  line.option("--reduce", "N", "Codewords: unique bricks / N (16)",
              cli::integer(o.reduce, 1, int64_t{1} << 31));
  line.option("--seeding", "furthest|d2", "Of ours (furthest)", cli::one_of(o.seeding, {"furthest", "d2"}));
  line.option("--iterations", "N", "Of ours, at most (until nothing changes)",
              cli::integer(o.iterations, 0, int64_t{~uint32_t{0}}));
  line.option("--faiss-iterations", "N", "Of faiss; 0: leave it out (10)",
              cli::integer(o.faiss_iterations, 0, 1000));
  cli::declare_input_options(line, o.open);
}

/// The unique bricks of a volume, as vq-encode finds them.
struct Bricks {
  std::vector<vq::Brick> bricks;
  std::vector<uint64_t> weights;
  int bits = 1;
};

Result<Bricks> collect(const Options& o, Context& ctx) {
  VOX_TRY(const cli::Input input, cli::open_input(o.input, o.open, ctx));
  VOX_TRY(const vq::Quantiser quantiser, vq::Quantiser::make({}, input.source->info()));
  vq::Collected collected(ctx);
  VOX_CHECK(vq::collect(*input.source, quantiser, collected, ctx));
  Bricks found;
  uint16_t greatest = 0;
  for (uint64_t i = 0; i < collected.codes.size(); ++i) {
    found.bricks.push_back(collected.codes.decode(i));
    greatest = std::max(greatest, collected.codes.range(i).max);
  }
  found.bits = std::max(1, static_cast<int>(std::bit_width(greatest)));
  found.weights.resize(found.bricks.size());
  for (const uint32_t number : collected.numbers)
    if (number != vq::no_number) ++found.weights[number];
  return found;
}

double psnr(const Bricks& b, double squared_error) {
  const auto weight = static_cast<double>(std::accumulate(b.weights.begin(), b.weights.end(), uint64_t{0}));
  const double peak = std::ldexp(1, b.bits) - 1;
  return 10 * std::log10(peak * peak * weight * vq::brick_voxels / squared_error);
}

Result<int> work(const Options& o, cli::Run& run) {
  VOX_TRY(const Bricks b, collect(o, run.ctx));
  const auto codewords =
      static_cast<uint32_t>(std::max<size_t>(1, b.bricks.size() / static_cast<size_t>(o.reduce)));
  vq::KMeansOptions options;
  options.codewords = codewords;
  options.seeding = o.seeding == "d2" ? vq::Seeding::d2 : vq::Seeding::furthest;
  options.max_iterations = static_cast<uint32_t>(o.iterations);
  VOX_TRY(const vq::Clustering ours, vq::kmeans(b.bricks, b.weights, options, run.ctx));

  Json json = Json::result();
  json.set("tool", run.tool).set("version", cli::version_text()).set("input", o.input);
  json.set("bits", b.bits).set("unique_bricks", b.bricks.size()).set("codewords", codewords);
  json.set("threads", run.ctx.threads);
  const double seconds = ours.seeding_seconds + ours.kmeans_seconds;
  Json own = Json::object();
  own.set("seeding_seconds", ours.seeding_seconds).set("kmeans_seconds", ours.kmeans_seconds);
  own.set("seconds", seconds).set("iterations", ours.iterations);
  own.set("psnr_db", psnr(b, static_cast<double>(ours.error)));
  json.set("ours", std::move(own));

  if (const auto theirs = o.faiss_iterations == 0
                              ? std::nullopt
                              : faiss_kmeans(b.bricks, b.weights, codewords,
                                             static_cast<int>(o.faiss_iterations), run.ctx.threads)) {
    Json peer = Json::object();
    peer.set("seconds", theirs->seconds).set("iterations", o.faiss_iterations);
    peer.set("psnr_db", psnr(b, theirs->squared_error)).set("times_ours", theirs->seconds / seconds);
    json.set("faiss", std::move(peer));
  }
  json.set("peak_rss_bytes", cli::peak_rss_bytes());
  VOX_CHECK(cli::print(json.text()));
  return 0;
}

}  // namespace
}  // namespace voxkit::bench

int main(int argc, char** argv) {
  using namespace voxkit;
  bench::Options options;
  return cli::run_tool(
      argc, argv, "bench_vq_kmeans",
      "Chooses the codebook of a volume by our k-means and by that of faiss, and says how good it is.",
      "  bench_vq_kmeans scan.nii.gz --reduce 16\n",
      [&](cli::CommandLine& line) { bench::declare(line, options); },
      [&](cli::Run& run) { return bench::work(options, run); });
}
