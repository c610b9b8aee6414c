// Bits one after the other, as parts of colours have them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace voxkit::color {

/// Bits, lowest first.
class BitWriter {
 public:
  /// The lowest `bits` of a value that has no others, 0 to 24 of them.
  void add(uint32_t value, int bits) {
    pending_ |= uint64_t{value} << count_;
    for (count_ += bits; count_ >= 8; count_ -= 8, pending_ >>= 8)
      bytes_.push_back(static_cast<std::byte>(pending_ & 0xff));
  }
  /// On to the next whole byte.
  void align() {
    if (count_ > 0) add(0, 8 - count_);
  }
  uint64_t size() const { return bytes_.size() * 8 + static_cast<uint64_t>(count_); }
  /// Whole bytes: all, after `align`.
  const std::vector<std::byte>& bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
  uint64_t pending_ = 0;
  int count_ = 0;
};

}  // namespace voxkit::color
