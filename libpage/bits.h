// The bits of a model: fields one after another, the lowest bit of each first.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxkit::page {

class BitWriter {
 public:
  /// The `count` low bits of a value, 0..32.
  void put(uint32_t value, int count) {
    for (int i = 0; i < count; ++i) {
      if (used_ == 0) bytes_.push_back(std::byte{0});
      bytes_.back() |= static_cast<std::byte>((value >> i & 1) << used_);
      used_ = (used_ + 1) % 8;
    }
  }
  /// An exponential Golomb code: short where value < 2^k. Values to 2^32 - 2^k - 1.
  void golomb(uint32_t value, int k) {
    const uint64_t shifted = uint64_t{value} + (uint64_t{1} << k);
    const int more = static_cast<int>(std::bit_width(shifted)) - 1 - k;
    put(0, more);
    put(1, 1);
    put(static_cast<uint32_t>(shifted & ((uint64_t{1} << (k + more)) - 1)), k + more);
  }
  void signed_golomb(int32_t value, int k) {
    golomb(value < 0 ? ~(static_cast<uint32_t>(value) << 1) : static_cast<uint32_t>(value) << 1, k);
  }
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
  int used_ = 0;
};

/// Safe on any bytes: behind the end it reads zeros, and says so.
class BitReader {
 public:
  explicit BitReader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  uint32_t get(int count) {
    uint32_t value = 0;
    for (int i = 0; i < count; ++i, ++at_)
      if (at_ / 8 < bytes_.size())
        value |= (std::to_integer<uint32_t>(bytes_[at_ / 8]) >> at_ % 8 & 1) << i;
      else
        overrun_ = true;
    return value;
  }
  uint32_t golomb(int k) {
    int more = 0;
    while (get(1) == 0 && !overrun_) ++more;
    if (k + more > 32) {
      overrun_ = true;
      return 0;
    }
    const uint64_t value = (uint64_t{1} << (k + more)) + get(k + more) - (uint64_t{1} << k);
    if (value > UINT32_MAX) overrun_ = true;
    return static_cast<uint32_t>(value);
  }
  int32_t signed_golomb(int k) {
    const uint32_t folded = golomb(k);
    return static_cast<int32_t>(folded >> 1 ^ (0u - (folded & 1)));
  }
  /// Whether a field was cut off or too long for its kind.
  bool overrun() const { return overrun_; }
  /// Whether all bytes were read, and the bits that fill the last one are 0.
  bool at_end() {
    while (at_ % 8 != 0)
      if (get(1) != 0) return false;
    return !overrun_ && at_ / 8 == bytes_.size();
  }

 private:
  std::span<const std::byte> bytes_;
  size_t at_ = 0;
  bool overrun_ = false;
};

}  // namespace voxkit::page
