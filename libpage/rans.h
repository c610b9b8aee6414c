// The entropy coder: rANS with one 64-bit state and words of 32 bits (J. Duda, Asymmetric numeral systems,
// 2013).
//
// A page is the state that decoding begins with, in as few bytes as hold it, and behind it the words in the
// order in which they were written. They are read from the last to the first. Coding begins with the state 1,
// and decoding ends there, with all words read: anything else is damage. As the state may be as small as that
// before the first word is written, a page of few bits has few bytes.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "formats/little_endian.h"
#include "libpage/tables.h"

namespace voxkit::page {

/// Last symbol first.
class RansEncoder {
 public:
  /// A symbol of this part of 2048 that begins at this slot, and with it, above it in the state's low bits,
  /// `raw_bits` <= 21 bits as they are.
  void put(uint32_t part, uint32_t start, uint32_t raw, uint32_t raw_bits) {
    if (state_ >> (64 - table_bits - raw_bits) >= part) flush_word();
    state_ = state_ << raw_bits | raw;
    state_ = (state_ / part << table_bits) + state_ % part + start;
  }
  /// Up to 32 bits as they are.
  void put_raw(uint32_t raw, uint32_t raw_bits) {
    if (raw_bits != 0 && state_ >> (64 - raw_bits) != 0) flush_word();
    state_ = state_ << raw_bits | raw;
  }
  /// Appends the page, of more than `least` bytes; the coder is as new then.
  void finish(std::vector<std::byte>& out, size_t least) {
    const size_t begin = out.size();
    for (uint64_t rest = state_; rest != 0; rest >>= 8) out.push_back(static_cast<std::byte>(rest & 0xff));
    if (words_.empty())
      while (out.size() - begin <= least) out.push_back(std::byte{0});
    const size_t at = out.size();
    out.resize(at + words_.size() * sizeof(uint32_t));
    if (!words_.empty()) std::memcpy(out.data() + at, words_.data(), words_.size() * sizeof(uint32_t));
    state_ = 1;
    words_.clear();
  }

 private:
  void flush_word() {
    words_.push_back(static_cast<uint32_t>(state_));
    state_ >>= 32;
  }
  uint64_t state_ = 1;
  std::vector<uint32_t> words_;
};

/// Safe on any bytes. Plain data, so that a few can be kept in registers side by side.
struct RansDecoder {
  uint64_t state = 0;
  const std::byte* end = nullptr;    ///< behind the words that are not read yet
  const std::byte* begin = nullptr;  ///< of the words; there are at least 4 readable bytes before them

  /// The bytes must outlive it.
  void open(std::span<const std::byte> page) {
    const size_t state_bytes = page.size() <= 8 ? page.size() : 5 + (page.size() - 5) % 4;
    state = 0;
    std::memcpy(&state, page.data(), state_bytes);
    begin = page.data() + state_bytes;
    end = page.data() + page.size();
    // The bytes before `begin` are looked at even when there is no word left.
    if (page.size() < 4) begin = end = reinterpret_cast<const std::byte*>(no_words) + sizeof no_words;
  }
  /// Without a branch: whether it is due is as good as random.
  void renew() {
    const auto due = static_cast<uint64_t>((state >> 32 == 0) & (end != begin));
    const uint64_t word = load_le<uint32_t>(end - sizeof(uint32_t));
    state = state << (due << 5) | (word & (0 - due));
    end -= due << 2;
  }
  uint32_t raw(uint32_t raw_bits) {
    const auto value = static_cast<uint32_t>(state & ((uint64_t{1} << raw_bits) - 1));
    state >>= raw_bits;
    return value;
  }
  bool finished() const { return state == 1 && end == begin; }

  static constexpr uint32_t no_words[1] = {0};
};

}  // namespace voxkit::page
