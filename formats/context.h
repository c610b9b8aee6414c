// What every long-running library call is given: threads, a memory budget, progress and a way to stop.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "formats/result.h"

namespace voxkit {

/// Counts the large buffers of a run against the user's --max-memory. Thread-safe.
class MemoryBudget {
 public:
  /// limit 0: three quarters of the memory this process may use (physical, or its cgroup's limit).
  explicit MemoryBudget(uint64_t limit = 0);
  uint64_t limit() const { return limit_; }
  /// Reserves bytes for `what` until `release`, or fails with ErrorCode::limit, naming --max-memory and the
  /// size needed.
  Status reserve(uint64_t bytes, const std::string& what);
  void release(uint64_t bytes) { used_ -= bytes; }

 private:
  uint64_t limit_;
  std::atomic<uint64_t> used_{0};
};

struct Context {
  int threads = 1;                 ///< workers of parallel_for; results never depend on it
  MemoryBudget* memory = nullptr;  ///< never null in a call
  std::function<void(double)> progress = [](double) {};  ///< fraction done, 0..1, from one thread at a time
  /// A line for people: what of an input is dropped, assumed or found. The same line may come again.
  std::function<void(const std::string&)> note = [](const std::string&) {};
};

/// Set by the signal handlers of the tools; long loops return ErrorCode::interrupted when it is non-zero.
extern std::atomic<int> interrupt_signal;
/// Tells whether to go on. Errors: ErrorCode::interrupted once a signal asked us to stop.
Status check_interrupt();

}  // namespace voxkit
