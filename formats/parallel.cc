#include "formats/parallel.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fstream>
#include <mutex>
#include <new>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace voxkit {

int available_threads() {
  cpu_set_t set;
  CPU_ZERO(&set);
  int threads = sched_getaffinity(0, sizeof set, &set) == 0
                    ? CPU_COUNT(&set)
                    : static_cast<int>(std::thread::hardware_concurrency());
  // cgroup v2: "QUOTA PERIOD" in microseconds, or "max PERIOD".
  std::string quota;
  double period = 0;
  if (std::ifstream file("/sys/fs/cgroup/cpu.max"); file >> quota >> period && quota != "max" && period > 0)
    threads = std::min(threads, static_cast<int>(std::ceil(std::stod(quota) / period)));
  return std::max(threads, 1);
}

Status parallel_for(const Context& ctx, int64_t count, const std::function<Status(int64_t)>& body) {
  std::atomic<int64_t> next{0};
  std::mutex mutex;
  std::optional<Error> first_error;
  int64_t first_index = count;

  auto record = [&](int64_t index, Error error) {
    std::lock_guard lock(mutex);
    if (index < first_index) first_index = index, first_error = std::move(error);
  };
  auto work = [&] {
    for (int64_t i; (i = next.fetch_add(1, std::memory_order_relaxed)) < count;) {
      Status status;
      try {
        status = check_interrupt();
        if (status) status = body(i);
      } catch (const std::bad_alloc&) {
        status = fail(ErrorCode::limit, {}, "out of memory: lower --threads or free memory");
      }
      if (!status) {
        record(i, std::move(status).error());
        // Indices are handed out in order, so every index below i has been started: the rest need not be.
        next.store(count, std::memory_order_relaxed);
      }
    }
  };

  const int workers = static_cast<int>(std::min<int64_t>(ctx.threads, count));
  std::vector<std::jthread> threads;
  for (int i = 1; i < workers; ++i) threads.emplace_back(work);
  work();
  threads.clear();  // joins
  if (first_error) return tl::unexpected<Error>(std::move(*first_error));
  return {};
}

}  // namespace voxkit
