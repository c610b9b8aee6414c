// bench_bandwidth: bytes a second that threads read and copy in memory beyond all caches.
#include <fmt/core.h>

#include "tests/bench/ceilings.h"
#include "tools/common/json.h"
#include "tools/common/main.h"
#include "tools/common/parse.h"

namespace voxkit::bench {
namespace {

using cli::Json;

struct Options {
  int64_t megabytes = beyond_caches >> 20;
};

Result<int> work(const Options& o, cli::Run& run) {
  const size_t bytes = static_cast<size_t>(o.megabytes) << 20;
  Json rows = Json::array();
  if (!run.options.json) VOX_CHECK(cli::print("threads  read GB/s  copied GB/s\n"));
  for (int threads = 1; threads <= run.ctx.threads; ++threads) {
    const double read = read_bytes_per_s(threads, bytes) / 1e9,
                 copied = copy_bytes_per_s(threads, bytes) / 1e9;
    Json row = Json::object();
    row.set("threads", threads).set("read_gb_per_s", read).set("copy_gb_per_s", copied);
    rows.push(std::move(row));
    if (!run.options.json)
      VOX_CHECK(cli::print(fmt::format("{:7}  {:9.2f}  {:11.2f}\n", threads, read, copied)));
  }
  if (run.options.json) {
    Json json = Json::result();
    json.set("tool", run.tool).set("megabytes", o.megabytes).set("rows", std::move(rows));
    VOX_CHECK(cli::print(json.text()));
  }
  return 0;
}

}  // namespace
}  // namespace voxkit::bench

int main(int argc, char** argv) {
  using namespace voxkit;
  bench::Options options;
  return cli::run_tool(
      argc, argv, "bench_bandwidth",
      "Measures the bandwidth of memory, with 1 thread and up to --threads: of reading, and of copying, of "
      "which bytes read and bytes written are counted.",
      "  bench_bandwidth --threads 2\n",
      [&](cli::CommandLine& line) {
        line.option("--megabytes", "N", "Memory of each thread, twice when copying (256)",
                    cli::integer(options.megabytes, 1, 1 << 20));
      },
      [&](cli::Run& run) { return bench::work(options, run); });
}
