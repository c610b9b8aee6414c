// Rays against exact arithmetic, by the million: README.md says which, and shows what came out.
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "formats/clock.h"
#include "tests/stress/follow.h"

namespace voxkit::stress {
namespace {

constexpr const char* usage =
    "usage: stress_traversal [--steps N] [--threads T] [--seed S] [--json]\n"
    "Follows rays with GridRay, and with Algorithm 1 of the thesis, beside their exact paths.\n"
    "  --steps N    of GridRay, at least (1e7)\n"
    "  --threads T  1 to 256 (1); the results do not depend on it\n"
    "  --seed S     other rays (1)\n"
    "  --json       print JSON\n"
    "Exits 1 if GridRay visits a wrong voxel, misses or repeats one, or if t() is off by more than 2^-52.\n";

struct Options {
  int64_t steps = 10000000;
  int threads = 1;
  uint64_t seed = 1;
  bool json = false;
};

Options parse(int argc, char** argv) {
  Options options;
  const auto refuse = [](const std::string& why) {
    std::fprintf(stderr, "stress_traversal: %s\n%s", why.c_str(), usage);
    std::exit(2);
  };
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--help") {
      std::fputs(usage, stdout);
      std::exit(0);
    }
    if (name == "--json") {
      options.json = true;
      continue;
    }
    if (name != "--steps" && name != "--threads" && name != "--seed") refuse("unknown option " + name);
    char* end = nullptr;
    const double value = ++i < argc ? std::strtod(argv[i], &end) : -1;
    const double most = name == "--threads" ? 256 : 1e15;
    if (!end || *end || !(value >= 1 && value <= most)) refuse(name + " takes a number from 1 on");
    if (name == "--steps") options.steps = static_cast<int64_t>(value);
    if (name == "--threads") options.threads = static_cast<int>(value);
    if (name == "--seed") options.seed = static_cast<uint64_t>(value);
  }
  return options;
}

/// Rays of one family in one grid.
Counts run_part(Family family, int grid, int64_t budget, uint64_t seed) {
  Counts counts;
  Random random(seed);
  const auto& dims = grid_dims[grid];
  worst = {};
  int64_t plain = budget / 8;
  // Rays that miss, and the making of rays, also count for something.
  while (counts.steps() + 4 * counts.rays < budget && counts.first_error.empty()) {
    const TestRay ray = make_ray(family, dims, random);
    if (plain > 0) plain -= check_reference(ray, plain, random, counts) + 4;
    // In large grids most rays are cut, for more rays of more kinds; cells and boxes go on to the end.
    const int64_t most = random.chance(32) ? INT64_MAX : 4096;
    follow(ray, std::min(most, budget), random, counts);
  }
  counts.worst = worst;
  return counts;
}

using Table = std::vector<Counts>;  // families x grids

void run_pass(const Options& options, int64_t steps, uint64_t pass, Table& table) {
  constexpr int parts = 4;
  const int64_t budget = std::max<int64_t>(steps / (families * grids * parts), 64);
  std::vector<Counts> results(static_cast<size_t>(families * grids * parts));
  std::atomic<size_t> next = 0;
  const auto work = [&] {
    for (size_t i; (i = next++) < results.size();) {
      const int cell = static_cast<int>(i) / parts;
      const uint64_t seed = (options.seed * 1000 + pass) * results.size() + i;
      results[i] = run_part(static_cast<Family>(cell / grids), cell % grids, budget, seed);
    }
  };
  std::vector<std::thread> threads;
  for (int k = 1; k < options.threads; ++k) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
  for (size_t i = 0; i < results.size(); ++i) table[i / parts].add(results[i]);
}

struct Row {
  std::string name;
  Counts counts;
};
std::vector<Row> rows(const Table& table, bool by_family) {
  std::vector<Row> all;
  for (int i = 0; i < (by_family ? families : grids); ++i) {
    Row row;
    const auto& d = grid_dims[by_family ? 0 : i];
    row.name = by_family ? family_names[i]
                         : std::to_string(d[0]) + " x " + std::to_string(d[1]) + " x " + std::to_string(d[2]);
    for (int k = 0; k < (by_family ? grids : families); ++k)
      row.counts.add(table[static_cast<size_t>(by_family ? i * grids + k : k * grids + i)]);
    all.push_back(row);
  }
  Row sum{"all", {}};
  for (const Row& row : all) sum.counts.add(row.counts);
  all.push_back(sum);
  return all;
}

Errors ours(const Counts& c) {
  Errors all = c.single;
  all.add(c.cells);
  all.add(c.boxes);
  return all;
}
long long n(int64_t value) {
  return static_cast<long long>(value);
}

void print_markdown(const std::vector<Row>& table, const char* what) {
  std::printf(
      "| %s | rays | single steps | over cells | over boxes | exact decisions | wrong, missed, repeated | "
      "error of t | Algorithm 1: voxels | wrong | of them apart | missed | repeated | error of t |\n"
      "| --- | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: |\n",
      what);
  for (const auto& [name, c] : table) {
    const Errors all = ours(c);
    const double voxels = static_cast<double>(std::max<int64_t>(all.voxels, 1));
    std::printf("| %s | %lld | %lld | %lld | %lld | %.3g %% | %lld, %lld, %lld | %.2g |", name.c_str(),
                n(c.rays), n(c.single.voxels), n(c.cells.voxels), n(c.boxes.voxels),
                100 * static_cast<double>(all.exact) / voxels, n(all.wrong), n(all.missed), n(all.repeated),
                all.time);
    const Errors& p = c.algorithm1;
    if (p.voxels + p.missed > 0)
      std::printf(" %lld | %lld | %lld | %lld | %lld | %.2g |\n", n(p.voxels), n(p.wrong), n(p.apart),
                  n(p.missed), n(p.repeated), p.time);
    else
      std::printf(" | | | | | |\n");
  }
  std::printf("\n");
}

void print_json(const std::vector<Row>& table, const char* what) {
  std::printf("  \"%s\": [", what);
  const char* comma = "\n";
  for (const auto& [name, c] : table) {
    std::printf("%s    {\"name\": \"%s\", \"rays\": %lld, \"hits\": %lld", comma, name.c_str(), n(c.rays),
                n(c.hits));
    comma = ",\n";
    const Errors* const all[] = {&c.single, &c.cells, &c.boxes, &c.algorithm1};
    const char* const names[] = {"single", "cells", "boxes", "algorithm1"};
    for (int k = 0; k < 4; ++k)
      std::printf(
          ", \"%s\": {\"voxels\": %lld, \"wrong\": %lld, \"apart\": %lld, \"missed\": %lld, \"repeated\": "
          "%lld, \"exact\": %lld, \"t_error\": %.3g}",
          names[k], n(all[k]->voxels), n(all[k]->wrong), n(all[k]->apart), n(all[k]->missed),
          n(all[k]->repeated), n(all[k]->exact), all[k]->time);
    std::printf("}");
  }
  std::printf("\n  ],\n");
}

int run(const Options& options) {
  const auto started = Clock::now();
  Table table(static_cast<size_t>(families * grids));
  Counts sum;
  for (uint64_t pass = 0; sum.steps() < options.steps && sum.first_error.empty(); ++pass) {
    run_pass(options, std::max(options.steps - sum.steps(), options.steps / 16), pass, table);
    sum = {};
    for (const Counts& counts : table) sum.add(counts);
  }
  const double seconds = seconds_since(started);
  const auto by_family = rows(table, true), by_grid = rows(table, false);
  const Errors all = ours(sum);
  if (options.json) {
    std::printf("{\n");
    print_json(by_family, "families");
    print_json(by_grid, "grids");
    std::printf(
        "  \"switch\": {\"times\": [%.6g, %.6g], \"positions\": [%.6g, %.6g]},\n"
        "  \"worst_rounding\": {\"times\": %.6g, \"positions\": %.6g},\n"
        "  \"checked\": %lld, \"steps\": %lld, \"seconds\": %.3g, \"first_error\": \"%s\"\n}\n",
        sum.times.exactly, sum.times.in_doubles, sum.positions.exactly, sum.positions.in_doubles,
        sum.worst.time, sum.worst.position, n(sum.checked), n(sum.steps()), seconds, sum.first_error.c_str());
  } else {
    print_markdown(by_family, "family");
    print_markdown(by_grid, "grid");
    std::printf(
        "Near ties: times at most %.4f margins apart were compared exactly, at least %.4f in doubles;\n"
        "positions at most %.4f margins off a plane exactly, at least %.4f in doubles. Largest rounding "
        "found:\n"
        "%.4f margins for times, %.4f for positions.\n\n",
        sum.times.exactly, sum.times.in_doubles, sum.positions.exactly, sum.positions.in_doubles,
        sum.worst.time, sum.worst.position);
    std::printf("%lld steps in %.1f s; the references agreed at %lld voxels.\n", n(sum.steps()), seconds,
                n(sum.checked));
  }
  // Two roundings: 1 / direction, and its product with an exact difference.
  const bool good = !all.any() && all.time <= 0x1p-52 * (1 + 0x1p-40);
  if (!sum.first_error.empty()) std::fprintf(stderr, "stress_traversal: %s\n", sum.first_error.c_str());
  if (!good) std::fprintf(stderr, "stress_traversal: GridRay is not exact\n");
  return good ? 0 : 1;
}

}  // namespace
}  // namespace voxkit::stress

int main(int argc, char** argv) {
  return voxkit::stress::run(voxkit::stress::parse(argc, argv));
}
