// The unique bricks of a volume while it is encoded: held compressed, told apart exactly.
#pragma once

#include <memory>
#include <vector>

#include "formats/reservation.h"
#include "libvq/rbuc.h"
#include "libvq/vq.h"

namespace voxkit::vq {

/// A brick as its range and codeword. Since codewords are a function of the brick, and can be decoded, equal
/// bricks and no others have equal codes.
struct CodedBrick {
  BrickRange range;
  uint8_t length = 0;  ///< of the codeword; 0 where min = max
  std::array<std::byte, longest_codeword + 8> codeword;

  std::span<const std::byte> code() const { return std::span(codeword).first(length); }
};
void code_brick(const Brick& brick, CodedBrick& out);
/// Equal for equal bricks.
uint64_t hash_of(BrickRange range, std::span<const std::byte> codeword);

/// Numbers bricks in the order in which they are first added.
class UniqueCodes {
 public:
  explicit UniqueCodes(Context& ctx) : reservation_(*ctx.memory) {}

  /// The number of a brick, a new one if none before was equal. ErrorCode::limit where memory or numbers run
  /// out.
  Result<uint32_t> add(BrickRange range, std::span<const std::byte> codeword, uint64_t hash);
  uint64_t size() const { return places_.size(); }

  BrickRange range(uint64_t number) const;
  /// The codeword; empty where min = max. Read_slack bytes are behind it.
  std::span<const std::byte> codeword(uint64_t number) const;
  Brick decode(uint64_t number) const;

 private:
  Status grow_table();
  Result<uint64_t> append(BrickRange range, std::span<const std::byte> codeword);
  const std::byte* at(uint64_t place) const {
    return segments_[place >> segment_log2].get() + (place & ((uint64_t{1} << segment_log2) - 1));
  }

  static constexpr int segment_log2 = 20;
  struct Slot {
    uint32_t number = 0xffffffff, hash = 0;  // the latter saves most looks at the codes
  };
  Reservation reservation_;
  std::vector<std::unique_ptr<std::byte[]>> segments_;
  uint64_t end_ = 0;  ///< of the last segment's codes
  std::vector<uint64_t> places_;
  std::vector<Slot> table_;  ///< open addressing, a power of two of slots
};

}  // namespace voxkit::vq
