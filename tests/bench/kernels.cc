// bench_kernels: the inner loops of the libraries, one by one, with one thread, by Google Benchmark.
#include "tests/bench/kernels.h"

#include <fmt/core.h>

#include <cstdlib>
#include <cstring>
#include <ostream>
#include <utility>
#include <vector>

#include "tests/bench/ceilings.h"

namespace voxkit::bench {
namespace {
bool given_up = false;
double clock_rate = 0, read_rate = 0, copy_rate = 0;  ///< cycles, bytes, bytes a second
}  // namespace

void give_up(benchmark::State& state, const Error& error) {
  given_up = true;
  state.SkipWithError((error.file + ": " + error.what).c_str());
}
bool any_given_up() {
  return given_up;
}

double reading_ns(double bytes) {
  return bytes / read_rate * 1e9;
}
double copying_ns(double bytes) {
  return 2 * bytes / copy_rate * 1e9;
}

void report(benchmark::State& state, double items_per_iteration, const Limit& limit) {
  using benchmark::Counter;
  const double items = items_per_iteration * static_cast<double>(state.iterations());
  state.counters["items"] = Counter(items, Counter::kIsRate);
  state.counters["ns"] = Counter(items * 1e-9, Counter::kIsRate | Counter::kInvert);
  state.counters["cycles"] = Counter(items / clock_rate, Counter::kIsRate | Counter::kInvert);
  state.counters["limit_ns"] = limit.ns;
  state.counters["of_limit"] = Counter(items * limit.ns * 1e-9, Counter::kIsRate);
  state.SetLabel(limit.what);
}

Context& context() {
  static MemoryBudget memory;
  static Context ctx = [] {
    Context one;
    one.memory = &memory;
    return one;
  }();
  return ctx;
}

Result<std::shared_ptr<const Container>> contain(const std::string& name,
                                                 const std::function<Status(const ByteSink&)>& encode) {
  const auto file = std::make_shared<std::vector<std::byte>>();
  VOX_CHECK(encode([&](std::span<const std::byte> bytes) {
    file->insert(file->end(), bytes.begin(), bytes.end());
    return Status{};
  }));
  return Container::open(*file, name, file);
}

Result<std::shared_ptr<const svmm::Volume>> lossless_svmm(std::unique_ptr<VolumeSource> source,
                                                          const std::string& name) {
  svmm::Params params;
  params.quality = 100;
  params.delta = 0;
  VOX_TRY(const auto container, contain(name, [&](const ByteSink& sink) -> Status {
            VOX_TRY(const auto levels, svmm::encode(*source, params, sink, context()));
            (void)levels;
            return {};
          }));
  return svmm::Volume::open(container);
}

namespace {

/// A table in Markdown: what is reported of every kernel, and what else it counted.
class TableReporter : public benchmark::BenchmarkReporter {
 public:
  bool ReportContext(const Context&) override {
    GetOutputStream() << machine_ << "\n\n"
                      << "| kernel | items/s | ns an item | cycles | GB/s | no less than, ns | of that | "
                         "which is | counted |\n"
                      << "| --- | ---: | ---: | ---: | ---: | ---: | ---: | --- | --- |" << std::endl;
    return true;
  }
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) row(run);
  }
  /// A line above the table.
  void describe(const std::string& machine) { machine_ = machine; }

 private:
  void row(const Run& run) {
    std::ostream& out = GetOutputStream();
    if (run.error_occurred) {
      out << fmt::format("| {} | {} |", run.benchmark_name(), run.error_message) << std::endl;
      return;
    }
    std::string others;
    for (const auto& [name, counter] : run.counters) {
      const bool column = name == "items" || name == "ns" || name == "cycles" || name == "bytes_per_second" ||
                          name == "limit_ns" || name == "of_limit";
      if (!column) others += fmt::format("{}{} {:.4g}", others.empty() ? "" : ", ", name, counter.value);
    }
    const auto value = [&](const char* name) -> double { return run.counters.at(name).value; };
    const bool bytes = run.counters.find("bytes_per_second") != run.counters.end();
    out << fmt::format("| {} | {:.4g} | {:.4g} | {:.4g} | {} | {:.3g} | {:.1f} % | {} | {} |",
                       run.benchmark_name(), value("items"), value("ns"), value("cycles"),
                       bytes ? fmt::format("{:.3g}", value("bytes_per_second") / 1e9) : "", value("limit_ns"),
                       100 * value("of_limit"), run.report_label, others)
        << std::endl;
  }
  std::string machine_;
};

void add_all(bool quick) {
  add_locate_kernels(quick);
  add_march_kernels(quick);
  add_brick_kernels(quick);
  add_nearest_kernels(quick);
  add_color_kernels(quick);
  add_image_kernels(quick);
  add_sample_kernels(quick);
}

/// What all limits are made of.
std::string measure_machine(bool quick) {
  const size_t bytes = quick ? size_t{1} << 20 : beyond_caches;
  clock_rate = clock_hz();
  read_rate = read_bytes_per_s(1, bytes);
  copy_rate = copy_bytes_per_s(1, bytes);
  const std::vector<std::pair<std::string, std::string>> found{
      {"clock", fmt::format("{:.3g} GHz", clock_rate / 1e9)},
      {"memory read", fmt::format("{:.3g} GB/s", read_rate / 1e9)},
      {"memory copied", fmt::format("{:.3g} GB/s, read and written", copy_rate / 1e9)},
      {fmt::format("a load from {} MiB", bytes >> 20), fmt::format("{:.3g} ns", scattered_load_ns(bytes))},
      {"doubles added and multiplied", fmt::format("{:.3g} G/s", double_operations_per_s() / 1e9)}};
  std::string text = "One thread";
  for (const auto& [what, value] : found) {
    benchmark::AddCustomContext(what, value);
    text += fmt::format("; {}: {}", what, value);
  }
  double load = 0;
  if (getloadavg(&load, 1) == 1) text += fmt::format("; load of the machine: {:.2f}", load);
  return text;
}

}  // namespace
}  // namespace voxkit::bench

int main(int argc, char** argv) {
  using namespace voxkit;
  bool quick = false;
  int kept = 1;
  for (int i = 1; i < argc; ++i)
    if (std::strcmp(argv[i], "--quick") == 0)
      quick = true;
    else
      argv[kept++] = argv[i];
  argc = kept;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  bench::TableReporter table;
  table.describe(bench::measure_machine(quick));
  bench::add_all(quick);
  benchmark::RunSpecifiedBenchmarks(&table);
  benchmark::Shutdown();
  return bench::any_given_up() ? 1 : 0;
}
