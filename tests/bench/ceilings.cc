#include "tests/bench/ceilings.h"

#include <algorithm>
#include <array>
#include <barrier>
#include <bit>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <thread>
#include <vector>

#include "formats/clock.h"
#include "formats/cpu.h"
#include "formats/hash.h"
#include "tests/bench/thread_time.h"

namespace voxkit::bench {
namespace {

constexpr int rounds = 5;
constexpr size_t line_bytes = 64;

/// Keeps the compiler from leaving out what made a value.
template <class T>
void keep(const T& value) {
  asm volatile("" : : "m"(value) : "memory");
}

double wall_seconds() {
  return seconds_since({});
}

/// Seconds of the fastest round in which each of some threads does its work; they begin together.
double fastest_together(int threads, const std::function<void(int thread)>& work) {
  if (threads == 1) {
    double best = 1e300;
    for (int i = 0; i < rounds; ++i) {
      const double start = thread_seconds();
      work(0);
      best = std::min(best, thread_seconds() - start);
    }
    return best;
  }
  std::vector<double> ends(static_cast<size_t>(threads));
  double start = 0, best = 1e300;
  std::barrier begin(threads, [&]() noexcept { start = wall_seconds(); });
  std::barrier end(threads, [&]() noexcept {
    best = std::min(best, *std::max_element(ends.begin(), ends.end()) - start);
  });
  std::vector<std::thread> others;
  for (int t = 0; t < threads; ++t)
    others.emplace_back([&, t] {
      for (int i = 0; i < rounds; ++i) {
        begin.arrive_and_wait();
        work(t);
        ends[static_cast<size_t>(t)] = wall_seconds();
        end.arrive_and_wait();
      }
    });
  for (std::thread& thread : others) thread.join();
  return best;
}

using Words = std::vector<uint64_t>;

/// Some arrays, each written once, so that every page is there.
std::vector<Words> arrays(int count, size_t bytes) {
  std::vector<Words> all(static_cast<size_t>(count));
  for (Words& words : all) words.assign(std::max<size_t>(bytes, 1024) / sizeof(uint64_t), 1);
  return all;
}
/// How often to go through one, so that a round takes some milliseconds.
int passes_of(size_t bytes) {
  return static_cast<int>(std::max<size_t>(1, (size_t{64} << 20) / std::max<size_t>(bytes, 1024)));
}

// Inner loops, for machines with AVX2 and for any other.
#define VOXKIT_INLINE [[gnu::always_inline]] inline

/// In several streams, which keep more of memory busy than one.
VOXKIT_INLINE uint64_t sum_streams(const Words& words) {
  typedef uint64_t Vector __attribute__((vector_size(32)));
  constexpr size_t streams = 4, lanes = 4;
  Vector sums[streams] = {};
  const size_t length = words.size() / streams;
  for (size_t i = 0; i + 2 * lanes <= length; i += 2 * lanes)
#pragma GCC unroll 4
    for (size_t k = 0; k < streams; ++k) {
      Vector a, b;
      std::memcpy(&a, &words[k * length + i], sizeof a);
      std::memcpy(&b, &words[k * length + i + lanes], sizeof b);
      sums[k] += a + b;
    }
  const Vector sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
  return sum[0] + sum[1] + sum[2] + sum[3];
}

constexpr int chains = 12, chain_length = 100000;

/// As many chains as it takes to keep all units busy; a multiplication and an addition a step.
typedef double Narrow __attribute__((vector_size(16)));
typedef double Wide __attribute__((vector_size(32)));
template <class Vector>
VOXKIT_INLINE double multiply_and_add(double factor, double summand) {
  Vector x[chains];
  for (int i = 0; i < chains; ++i) x[i] = Vector{} + i;
  for (int step = 0; step < chain_length; ++step)
#pragma GCC unroll 12
    for (int i = 0; i < chains; ++i) x[i] = x[i] * factor + summand;
  double sum = 0;
  for (int i = 0; i < chains; ++i) sum += x[i][0] + x[i][1];
  return sum;
}

#ifdef VOXKIT_AVX2
VOXKIT_AVX2_CODE uint64_t sum_avx2(const Words& words) {
  return sum_streams(words);
}
VOXKIT_AVX2_CODE double multiply_and_add_avx2(double factor, double summand) {
  return multiply_and_add<Wide>(factor, summand);
}
#else
uint64_t sum_avx2(const Words& words) {
  return sum_streams(words);
}
double multiply_and_add_avx2(double factor, double summand) {
  return multiply_and_add<Wide>(factor, summand);
}
#endif

}  // namespace

double clock_hz() {
  constexpr int steps = 4000000;
  double best = 1e300;
  for (int i = 0; i < rounds; ++i) {
    const double start = thread_seconds();
    uint64_t x = 1;
    for (int step = 0; step < steps; ++step) {
      asm volatile("" : "+r"(x));  // so that no two additions become one
      x += 3;
    }
    keep(x);
    best = std::min(best, thread_seconds() - start);
  }
  return steps / best;
}

double read_bytes_per_s(int threads, size_t bytes) {
  const std::vector<Words> from = arrays(threads, bytes);
  const int passes = passes_of(bytes);
  const double seconds = fastest_together(threads, [&](int t) {
    for (int i = 0; i < passes; ++i) {
      const Words& words = from[static_cast<size_t>(t)];
      keep(has_avx2() ? sum_avx2(words) : sum_streams(words));
    }
  });
  return static_cast<double>(from[0].size() * sizeof(uint64_t)) * passes * threads / seconds;
}

double copy_bytes_per_s(int threads, size_t bytes) {
  const std::vector<Words> from = arrays(threads, bytes);
  std::vector<Words> to = arrays(threads, bytes);
  const int passes = passes_of(bytes);
  const double seconds = fastest_together(threads, [&](int t) {
    const Words& source = from[static_cast<size_t>(t)];
    for (int i = 0; i < passes; ++i) {
      std::memcpy(to[static_cast<size_t>(t)].data(), source.data(), source.size() * sizeof(uint64_t));
      keep(to[static_cast<size_t>(t)][0]);
    }
  });
  return 2.0 * static_cast<double>(from[0].size() * sizeof(uint64_t)) * passes * threads / seconds;
}

namespace {

/// What `measure(lines)` says of so many cache lines, once for each size of four to an octave.
class OncePerSize {
 public:
  explicit OncePerSize(double (*measure)(size_t lines)) : measure_(measure) {}
  double of(size_t bytes) {
    size_t lines = std::max<size_t>(bytes, 4096) / line_bytes;
    const int unit = static_cast<int>(std::bit_width(lines)) - 3;
    lines = (lines >> unit) << unit;
    const auto [at, is_new] = known_.try_emplace(lines, 0.0);
    if (is_new) at->second = measure_(lines);
    return at->second;
  }

 private:
  double (*measure_)(size_t lines);
  std::map<size_t, double> known_;
};
constexpr size_t loads = 1000000;

double measure_scattered(size_t lines) {
  const Words words = std::move(arrays(1, lines * line_bytes)[0]);
  double best = 1e300;
  for (int round = 0; round < rounds; ++round) {
    const double start = thread_seconds();
    // Several random numbers at a time, as one has to wait for the one before it.
    std::array<uint64_t, 4> at{1, 2, 3, 4}, sum{};
    for (size_t i = 0; i < loads; i += at.size())
      for (size_t k = 0; k < at.size(); ++k) {
        at[k] = at[k] * 6364136223846793005u + 1442695040888963407u;
        sum[k] += words[(at[k] >> 32) * lines >> 32 << 3];
      }
    keep(sum);
    best = std::min(best, thread_seconds() - start);
  }
  return best / static_cast<double>(loads) * 1e9;
}

double measure_chained(size_t lines) {
  // One ring through all lines, in an order that cannot be foreseen (S. Sattolo 1986).
  std::vector<uint32_t> order(lines);
  for (size_t i = 0; i < lines; ++i) order[i] = static_cast<uint32_t>(i);
  for (size_t i = lines - 1; i > 0; --i) std::swap(order[i], order[random64(1, i) % i]);
  Words words(lines * line_bytes / sizeof(uint64_t));
  for (size_t i = 0; i < lines; ++i) words[i << 3] = uint64_t{order[i]} << 3;
  double best = 1e300;
  uint64_t at = 0;
  for (int round = 0; round < rounds; ++round) {
    const double start = thread_seconds();
    for (size_t i = 0; i < loads; ++i) at = words[at];
    keep(at);
    best = std::min(best, thread_seconds() - start);
  }
  return best / static_cast<double>(loads) * 1e9;
}

}  // namespace

double scattered_load_ns(size_t bytes) {
  static OncePerSize measured(measure_scattered);
  return measured.of(bytes);
}
double chained_load_ns(size_t bytes) {
  static OncePerSize measured(measure_chained);
  return measured.of(bytes);
}

double double_operations_per_s() {
  const bool wide = has_avx2();
  double best = 1e300;
  for (int i = 0; i < rounds; ++i) {
    const double start = thread_seconds();
    keep(wide ? multiply_and_add_avx2(0.5, 1.0) : multiply_and_add<Narrow>(0.5, 1.0));
    best = std::min(best, thread_seconds() - start);
  }
  const double lanes = static_cast<double>(wide ? sizeof(Wide) : sizeof(Narrow)) / sizeof(double);
  return 2 * lanes * chains * chain_length / best;
}

}  // namespace voxkit::bench
