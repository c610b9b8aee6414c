#include "tests/stress/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

namespace voxkit::stress {
namespace {

std::string current_name = "stress";

/// 12345678 as 12 M.
std::string count_text(int64_t n) {
  if (n >= 10000000) return fmt::format("{} M", n / 1000000);
  if (n >= 10000) return fmt::format("{} k", n / 1000);
  return fmt::format("{}", n);
}

}  // namespace

int Report::print(const std::string& title) const {
  fmt::print("## {}\n\n| what | promise | worst found | | looks |\n| --- | --- | --- | --- | --: |\n", title);
  bool broken = false;
  for (const Row& row : rows_) {
    fmt::print("| {} | {} | {} | {} | {} |\n", row.what, row.promise, row.worst,
               row.promise.empty() ? ""
               : row.held          ? "held"
                                   : "**BROKEN**",
               count_text(row.tried));
    broken |= !row.held;
  }
  fmt::print("\nThe inputs of these, for doing them again:\n\n");
  for (const Row& row : rows_)
    if (!row.input.empty()) fmt::print("- {}: `{}`\n", row.what, row.input);
  fmt::print("\n");
  return broken ? 1 : 0;
}

int stress_main(int argc, char** argv, const std::string& name, const std::string& title, int64_t tries,
                const std::function<void(const Effort&, Report&)>& fill) {
  current_name = name;
  const std::string usage = fmt::format(
      "usage: {} [--tries N] [--seed S]\n"
      "Searches for the worst case of each promise in README.md; exits 1 if one is broken.\n"
      "  --tries N  looks for each search ({}); slow ones take a fixed share of it\n"
      "  --seed S   other searches (1)\n",
      name, tries);
  Effort effort{tries, 1};
  const auto refuse = [&](const std::string& why) {
    fmt::print(stderr, "{}: {}\n{}", name, why, usage);
    std::exit(2);
  };
  for (int i = 1; i < argc; ++i) {
    const std::string option = argv[i];
    if (option == "--help") {
      fmt::print("{}", usage);
      return 0;
    }
    if (option != "--tries" && option != "--seed") refuse("unknown option " + option);
    char* end = nullptr;
    const double value = ++i < argc ? std::strtod(argv[i], &end) : -1;
    if (!end || *end || !(value >= 1 && value <= 1e12)) refuse(option + " takes a number from 1 on");
    if (option == "--tries")
      effort.tries = static_cast<int64_t>(value);
    else
      effort.seed = static_cast<uint64_t>(value);
  }
  Report report;
  fill(effort, report);
  return report.print(title);
}

void must_not_happen(const std::string& what) {
  fmt::print(stderr, "{}: {}\n", current_name, what);
  std::exit(70);
}

Context stress_context() {
  static MemoryBudget budget(uint64_t{1} << 32);
  Context ctx;
  ctx.threads = 1;
  ctx.memory = &budget;
  return ctx;
}

std::string text(double x, bool hex) {
  return hex ? fmt::format("{:.6g} ({:a})", x, x) : fmt::format("{:.6g}", x);
}

}  // namespace voxkit::stress
