// Memory that is not a Buffer's, counted against the user's limit while something lives.
#pragma once

#include <string>
#include <utility>

#include "formats/context.h"

namespace voxkit {

/// Holds bytes of a budget, which must outlive it, and gives them back at its end. Moves, does not copy.
class Reservation {
 public:
  Reservation() = default;
  explicit Reservation(MemoryBudget& budget) : budget_(&budget) {}
  /// Reserves `bytes` of ctx.memory for `what`, which the message names. Errors: ErrorCode::limit.
  static Result<Reservation> take(uint64_t bytes, const std::string& what, const Context& ctx) {
    Reservation reservation(*ctx.memory);
    VOX_CHECK(reservation.add(bytes, what));
    return reservation;
  }
  ~Reservation() {
    if (budget_ != nullptr) budget_->release(bytes_);
  }
  Reservation(Reservation&& other) noexcept
      : budget_(other.budget_), bytes_(std::exchange(other.bytes_, 0)) {}
  Reservation& operator=(Reservation&& other) noexcept {
    std::swap(budget_, other.budget_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  /// Reserves `bytes` more, of the same budget, which it must have. Errors: ErrorCode::limit, and then it
  /// holds what it held.
  Status add(uint64_t bytes, const std::string& what) {
    VOX_CHECK(budget_->reserve(bytes, what));
    bytes_ += bytes;
    return {};
  }
  /// Gives back some of the bytes that it holds.
  void release(uint64_t bytes) {
    budget_->release(bytes);
    bytes_ -= bytes;
  }

 private:
  MemoryBudget* budget_ = nullptr;
  uint64_t bytes_ = 0;
};

}  // namespace voxkit
