#include "formats/context.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

namespace voxkit {
namespace {

uint64_t usable_memory() {
  uint64_t bytes =
      static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(sysconf(_SC_PAGE_SIZE));
  uint64_t group = 0;
  if (std::ifstream file("/sys/fs/cgroup/memory.max"); file >> group && group > 0)
    bytes = std::min(bytes, group);
  return bytes;
}

}  // namespace

std::atomic<int> interrupt_signal{0};

Status check_interrupt() {
  if (interrupt_signal.load(std::memory_order_relaxed) == 0) return {};
  return fail(ErrorCode::interrupted, {}, "interrupted: nothing was written");
}

MemoryBudget::MemoryBudget(uint64_t limit) : limit_(limit ? limit : usable_memory() / 4 * 3) {}

Status MemoryBudget::reserve(uint64_t bytes, const std::string& what) {
  uint64_t used = used_;
  do {
    if (bytes > limit_ || used > limit_ - bytes)
      return fail(
          ErrorCode::limit, {},
          fmt::format("{} needs {} bytes of memory: --max-memory allows {}: use --max-memory {}M or more",
                      what, bytes, limit_, (used + bytes) / (1 << 20) + 1));
  } while (!used_.compare_exchange_weak(used, used + bytes));
  return {};
}

}  // namespace voxkit
