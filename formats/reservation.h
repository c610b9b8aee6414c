// Memory that counts against the user's limit while something holds it.
#pragma once

#include <utility>

#include "formats/context.h"

namespace voxkit {

/// Memory that counts against the budget; given back at the end.
class Reservation {
 public:
  explicit Reservation(MemoryBudget& budget) : budget_(&budget) {}
  ~Reservation() { budget_->release(bytes_); }
  Reservation(Reservation&& other) noexcept
      : budget_(other.budget_), bytes_(std::exchange(other.bytes_, 0)) {}
  Reservation& operator=(Reservation&& other) noexcept {
    std::swap(budget_, other.budget_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  Status add(uint64_t bytes, const char* what) {
    VOX_CHECK(budget_->reserve(bytes, what));
    bytes_ += bytes;
    return {};
  }
  void release(uint64_t bytes) {
    budget_->release(bytes);
    bytes_ -= bytes;
  }

 private:
  MemoryBudget* budget_;
  uint64_t bytes_ = 0;
};

}  // namespace voxkit
