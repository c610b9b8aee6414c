// What the benchmarks of kernels share: inputs that are made when they are first used, and what is reported
// of each, beside what the machine could do at best.
#pragma once

#include <benchmark/benchmark.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "formats/container.h"
#include "formats/context.h"
#include "libsvmm/svmm.h"

namespace voxkit::bench {

/// Ends a benchmark that cannot be run; the program will say so, and exit with 1.
void give_up(benchmark::State& state, const Error& error);
bool any_given_up();

/// The least time that an item can take here, and by what it is bounded.
struct Limit {
  double ns = 0;
  std::string what;
};
/// Reports items a second, the time of one in ns and in cycles of the clock, its limit, and which share of
/// the time that limit is.
void report(benchmark::State& state, double items_per_iteration, const Limit& limit);

/// ns in which a thread reads, or copies, so many bytes of memory; as it was when the program began.
double reading_ns(double bytes);
double copying_ns(double bytes);

/// An input, made when it is first asked for.
template <class T>
class Lazy {
 public:
  using Make = std::function<Result<std::shared_ptr<const T>>()>;
  explicit Lazy(Make make) : make_(std::move(make)) {}
  /// Null where it could not be made; then the benchmark has been given up.
  const T* get(benchmark::State& state) {
    if (!made_) made_ = make_();
    if (*made_) return made_->value().get();
    give_up(state, made_->error());
    return nullptr;
  }

 private:
  Make make_;
  std::optional<Result<std::shared_ptr<const T>>> made_;
};

/// Adds a benchmark of a kernel: `body(state, input)`.
template <class T, class Body>
benchmark::internal::Benchmark* add(const std::string& name, const std::shared_ptr<Lazy<T>>& input,
                                    Body body) {
  return benchmark::RegisterBenchmark(name.c_str(), [input, body](benchmark::State& state) {
    if (const T* made = input->get(state)) body(state, *made);
  });
}

/// One thread, and memory without a limit of its own.
Context& context();
/// What an encoder writes, in memory.
Result<std::shared_ptr<const Container>> contain(const std::string& name,
                                                 const std::function<Status(const ByteSink&)>& encode);

/// A volume as a lossless SVMM file, stepped block widths.
Result<std::shared_ptr<const svmm::Volume>> lossless_svmm(std::unique_ptr<VolumeSource> source,
                                                          const std::string& name);

/// A file each. quick: small inputs, to see that everything works.
void add_locate_kernels(bool quick);
void add_march_kernels(bool quick);
void add_brick_kernels(bool quick);
void add_nearest_kernels(bool quick);
void add_color_kernels(bool quick);
void add_image_kernels(bool quick);
void add_sample_kernels(bool quick);

}  // namespace voxkit::bench
