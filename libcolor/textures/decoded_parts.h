// Colours of parts that are decoded as a whole, kept for further use.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "formats/context.h"
#include "formats/reservation.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// Thread-safe. A part is decoded when it is first asked for, by one thread; as many are kept as a quarter of
/// the memory limit holds, and what is in use. Those used longest ago go first.
class DecodedParts {
 public:
  class Part {
   public:
    const Rgb* data() const { return colors_.data(); }

   private:
    friend class DecodedParts;
    Reservation reservation_;
    std::vector<Rgb> colors_;
  };
  using Decode = std::function<Result<std::vector<Rgb>>(uint64_t part)>;

  /// `memory` must outlive all parts. `work_bytes`: what one call of `decode` takes.
  DecodedParts(uint64_t parts, MemoryBudget& memory, uint64_t work_bytes, Decode decode);
  /// A part below the number of them. The same error again, where decoding it once failed.
  Result<std::shared_ptr<const Part>> get(uint64_t part);

 private:
  struct Slot {
    std::mutex mutex;
    std::shared_ptr<const Part> part;
    Status status;
    std::atomic<uint64_t> used{0};  ///< when, as a number of calls; 0: not kept
  };
  Result<std::shared_ptr<const Part>> decode(uint64_t part);
  /// Forgets the part that was used longest ago, of those that nobody asks for now. False: there is none.
  bool forget_one();

  uint64_t count_;
  MemoryBudget& memory_;
  uint64_t work_bytes_;
  Decode decode_;
  std::unique_ptr<Slot[]> slots_;
  std::atomic<uint64_t> calls_{0}, kept_{0};
};

}  // namespace voxkit::color
