// Memory that is not a Buffer's, counted against the limit while something lives.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "formats/context.h"

namespace voxkit {

/// Bytes of ctx.memory, which must outlive it; given back at the end. Moves, does not copy.
class MemoryHold {
 public:
  MemoryHold() = default;
  /// Fails with ErrorCode::limit, naming `what`.
  static Result<MemoryHold> take(uint64_t bytes, const std::string& what, const Context& ctx) {
    VOX_CHECK(ctx.memory->reserve(bytes, what));
    MemoryHold hold;
    hold.budget_ = ctx.memory;
    hold.bytes_ = bytes;
    return hold;
  }
  MemoryHold(MemoryHold&& other) noexcept { *this = std::move(other); }
  MemoryHold& operator=(MemoryHold&& other) noexcept {
    std::swap(budget_, other.budget_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~MemoryHold() {
    if (budget_) budget_->release(bytes_);
  }

 private:
  MemoryBudget* budget_ = nullptr;
  uint64_t bytes_ = 0;
};

}  // namespace voxkit
