// The decoder by the book: slow and plain, written from the format, with nothing of the library's but its
// sizes. It expects valid bytes.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "libpage/extent.h"

namespace voxkit::page::test {

class ReferenceBits {
 public:
  explicit ReferenceBits(std::span<const std::byte> bytes) : bytes_(bytes) {}
  uint64_t get(int count) {
    uint64_t value = 0;
    for (int i = 0; i < count; ++i, ++at_)
      value |= uint64_t{std::to_integer<unsigned>(bytes_[at_ / 8]) >> at_ % 8 & 1} << i;
    return value;
  }
  /// z zeros, a one, then k + z bits: 2^(k + z) + bits - 2^k.
  uint64_t golomb(int k) {
    int zeros = 0;
    while (get(1) == 0) ++zeros;
    return (uint64_t{1} << (k + zeros)) + get(k + zeros) - (uint64_t{1} << k);
  }
  int64_t signed_golomb(int k) {
    const auto folded = static_cast<int64_t>(golomb(k));
    return folded % 2 == 0 ? folded / 2 : -(folded + 1) / 2;
  }

 private:
  std::span<const std::byte> bytes_;
  size_t at_ = 0;
};

struct Neighbour {
  int dx, dy, dz;
};
inline constexpr std::array<Neighbour, 16> neighbours = {{{-1, -1, -1},
                                                          {0, -1, -1},
                                                          {1, -1, -1},
                                                          {-1, 0, -1},
                                                          {0, 0, -1},
                                                          {1, 0, -1},
                                                          {-1, 1, -1},
                                                          {0, 1, -1},
                                                          {1, 1, -1},
                                                          {-1, -1, 0},
                                                          {0, -1, 0},
                                                          {1, -1, 0},
                                                          {-1, 0, 0},
                                                          {-2, 0, 0},
                                                          {0, -2, 0},
                                                          {0, 0, -2}}};

/// A page of parents, and where in it those of the page lie.
struct ReferenceParent {
  std::vector<uint32_t> samples;
  Extent extent;
  int x = 0, y = 0, z = 0;
};

class ReferenceDecoder {
 public:
  explicit ReferenceDecoder(std::span<const std::byte> model) {
    ReferenceBits in(model);
    parents_ = in.get(8) == 2;
    const bool has_palette = in.get(1) != 0;
    max_value_ = static_cast<int64_t>(in.get(32));
    error_ = static_cast<int64_t>(in.golomb(0));
    background_ = static_cast<int64_t>(in.golomb(8));
    if (has_palette) {
      uint64_t next = 0;
      for (int64_t i = 0; i <= max_value_; ++i) {
        palette_.push_back(static_cast<uint32_t>(next + in.golomb(2)));
        next = uint64_t{palette_.back()} + 1;
      }
    }
    for (int c = 0; c < (parents_ ? 48 : 18); ++c) {
      const int rest = rest_of(c);
      int64_t left = 4096;
      for (int t = 0; t < (parents_ ? 30 : 16); ++t)
        if (has(c, t) && t != rest) left -= weights_[c][t] = in.signed_golomb(7);
      if (rest >= 0) weights_[c][rest] = left;
    }
    for (size_t c = 0; c < (parents_ ? 192 : 72); ++c) {
      if (in.get(1) != 0) {
        parts_[c] = parts_[c - 1];
        continue;
      }
      const uint64_t used = in.get(7);
      uint64_t before = 512, sum = 0;
      for (size_t s = 0; s < used; ++s) {
        int k = 0;  // two less than the bits of the part before
        while (before >> (k + 2) != 0) ++k;
        before = in.golomb(k);
        parts_[c][s] = before;
        sum += before;
      }
      parts_[c][72] = 2048 - sum;
    }
  }

  /// `solid`, if it is not empty, says of each voxel whether it is coded.
  std::vector<uint32_t> decode(std::span<const std::byte> page, Extent e, const ReferenceParent& parent = {},
                               const std::vector<bool>& solid = {}) {
    extent_ = e;
    solid_ = solid;
    parent_ = parent;
    for (uint32_t& sample : parent_.samples) sample = number_next_to(sample);
    const auto count = static_cast<size_t>(e.voxels());
    values_.assign(count, 0);
    magnitudes_.assign(count, 0);
    const size_t constant_bytes = max_value_ > 0xffff ? 4 : max_value_ > 0xff ? 2 : 1;
    if (page.size() <= constant_bytes) {
      int64_t value = page.empty() ? background_ : 0;
      for (size_t i = page.size(); i-- > 0;) value = value << 8 | std::to_integer<int64_t>(page[i]);
      values_.assign(count, value);
    } else {
      const size_t state_bytes = page.size() <= 8 ? page.size() : 5 + (page.size() - 5) % 4;
      state_ = 0;
      for (size_t i = state_bytes; i-- > 0;) state_ = state_ << 8 | std::to_integer<uint64_t>(page[i]);
      words_ = page.subspan(state_bytes);
      for (int z = 0; z < e.nz; ++z)
        for (int y = 0; y < e.ny; ++y)
          for (int x = 0; x < e.nx; ++x) decode_voxel(x, y, z);
    }
    std::vector<uint32_t> samples;
    for (const int64_t value : values_)
      samples.push_back(palette_.empty() ? static_cast<uint32_t>(value)
                                         : palette_[static_cast<size_t>(value)]);
    return samples;
  }
  bool finished() const { return state_ == 1 && words_.empty(); }

 private:
  /// The entry of the palette next to a sample, the lower one of two.
  uint32_t number_next_to(uint32_t sample) const {
    if (palette_.empty()) return static_cast<uint32_t>(std::min<int64_t>(sample, max_value_));
    size_t best = 0;
    const auto distance = [&](size_t i) { return std::abs(int64_t{palette_[i]} - int64_t{sample}); };
    for (size_t i = 1; i < palette_.size(); ++i)
      if (distance(i) < distance(best)) best = i;
    return static_cast<uint32_t>(best);
  }
  /// With parents there are two classes between the first and the last along x and y, and two of planes that
  /// have one behind, by whether the number there is odd.
  int along(int at, int n) const {
    if (at == 0) return 0;
    if (at == n - 1) return parents_ ? 3 : 2;
    return parents_ ? 1 + at % 2 : 1;
  }
  int class_of(int x, int y, int z) const {
    const int sides = parents_ ? 4 : 3, plane = z == 0 ? 0 : parents_ ? 1 + z % 2 : 1;
    return (plane * sides + along(y, extent_.ny)) * sides + along(x, extent_.nx);
  }
  bool has(int c, int t) const {
    if (t >= 16) return true;
    const int sides = parents_ ? 4 : 3, px = c % sides, py = c / sides % sides;
    const Neighbour n = neighbours[static_cast<size_t>(t)];
    return !(n.dx < 0 && px == 0) && !(n.dx > 0 && px == sides - 1) && !(n.dy < 0 && py == 0) &&
           !(n.dy > 0 && py == sides - 1) && !(n.dz < 0 && c < sides * sides);
  }
  int rest_of(int c) const {
    if (parents_) return 17;
    for (const int t : {4, 10, 12})
      if (has(c, t)) return t;
    return -1;
  }
  /// The parent of a voxel, or a neighbour of that.
  int64_t parent_at(int x, int y, int z, int dx, int dy, int dz) const {
    const Extent e = parent_.extent;
    const int px = std::clamp(parent_.x + x / 2 + dx, 0, e.nx - 1),
              py = std::clamp(parent_.y + y / 2 + dy, 0, e.ny - 1),
              pz = std::clamp(parent_.z + z / 2 + dz, 0, e.nz - 1);
    return parent_.samples[static_cast<size_t>((pz * e.ny + py) * e.nx + px)];
  }
  /// Taps 16 to 29.
  int64_t parent_tap(int x, int y, int z, int t) const {
    const int toward_y = y % 2 != 0 ? 1 : -1, toward_z = z % 2 != 0 ? 1 : -1;
    if (t == 28) return parent_at(x, y, z, 0, -toward_y, 0);
    if (t == 29) return parent_at(x, y, z, 0, 0, -toward_z);
    const int row = (t - 16) / 3;
    return parent_at(x, y, z, (t - 16) % 3 - 1, row % 2 != 0 ? toward_y : 0, row / 2 != 0 ? toward_z : 0);
  }
  size_t index(int x, int y, int z) const {
    const int cx = std::clamp(x, 0, extent_.nx - 1), cy = std::clamp(y, 0, extent_.ny - 1),
              cz = std::max(z, 0);
    return static_cast<size_t>((cz * extent_.ny + cy) * extent_.nx + cx);
  }

  void decode_voxel(int x, int y, int z) {
    const int c = class_of(x, y, z);
    // In units of 1/4096, with what rounds to the nearest, or the lower of two.
    int64_t mean = background_ * 4096 + 2047;
    if (rest_of(c) >= 0) {
      mean = 2047;
      for (int t = 0; t < 16; ++t)
        if (has(c, t)) {
          const Neighbour n = neighbours[static_cast<size_t>(t)];
          mean += weights_[c][t] * values_[index(x + n.dx, y + n.dy, z + n.dz)];
        }
      for (int t = 16; parents_ && t < 30; ++t) mean += weights_[c][t] * parent_tap(x, y, z, t);
    }
    const int64_t predicted = std::clamp<int64_t>(mean >> 12, 0, max_value_);
    const bool mirrored = (mean >> 11 & 1) != 0;

    if (!solid_.empty() && !solid_[index(x, y, z)]) {
      values_[index(x, y, z)] = predicted;
      return;
    }
    const uint64_t folded = decode_symbol(context(x, y, z));
    int64_t residual = static_cast<int64_t>(folded + 1) / 2;
    magnitudes_[index(x, y, z)] = std::min<int64_t>(residual, 255);
    if ((folded % 2 != 0) != mirrored) residual = -residual;
    int64_t value = predicted + residual * (2 * error_ + 1);
    if (max_value_ > 0xffff && error_ == 0) value &= 0xffffffff;
    values_[index(x, y, z)] = std::clamp<int64_t>(value, 0, max_value_);
  }

  int64_t range_share(int64_t least, int64_t greatest) const {
    return std::min<int64_t>((greatest - least) * (32768 / (2 * error_ + 1)) >> 16, 1023);
  }
  size_t context(int x, int y, int z) const {
    if (y == 0 && z == 0 && x == 0 && !parents_) return 23;
    const auto m = [&](int dx, int dy, int dz) { return magnitudes_[index(x + dx, y + dy, z + dz)]; };
    int64_t activity = 0, share = 0;
    int64_t least = INT64_MAX, greatest = 0;
    const auto widen = [&](int64_t value) {
      least = std::min(least, value);
      greatest = std::max(greatest, value);
    };
    for (size_t t = 0; t < 12; ++t) {
      const Neighbour n = neighbours[t];
      if (z + n.dz < 0 || (n.dz == 0 && y == 0)) continue;
      widen(values_[index(x + n.dx, y + n.dy, z + n.dz)]);
    }
    if (parents_) {
      widen(parent_at(x, y, z, 0, 0, 0));
      share = range_share(least, greatest);
      least = INT64_MAX, greatest = 0;
      for (int d = -1; d <= 1; ++d) {
        widen(parent_at(x, y, z, d, 0, 0));
        widen(parent_at(x, y, z, 0, d, 0));
        widen(parent_at(x, y, z, 0, 0, d));
      }
      share = (share + range_share(least, greatest)) / 2;
    } else if (y > 0 || z > 0) {
      share = range_share(least, greatest);
    }
    activity = std::min<int64_t>(share, 737);
    if (y > 0 || z > 0) {
      const int uy = y > 0 ? -1 : 0, uz = y > 0 ? 0 : -1;  // above, or behind where there is no row above
      const int by = z > 0 ? 0 : -1, bz = z > 0 ? -1 : 0;  // behind, or above where there is no plane behind
      activity = share + 2 * (m(0, uy, uz) + m(0, by, bz)) + m(-1, uy, uz) + m(1, uy, uz) + m(-1, by, bz) +
                 m(1, by, bz);
      activity = std::min<int64_t>(activity, 737);
      if (x == 0) activity = std::min<int64_t>(activity + 2 * m(0, uy, uz), 737);
    }
    if (x > 0) activity += 2 * m(-1, 0, 0);
    constexpr int steps[] = {1,  2,  3,  4,  5,   6,   7,   8,   11,  15,  20, 27,
                             37, 49, 67, 90, 122, 164, 222, 299, 404, 546, 737};
    const auto step = std::ranges::count_if(steps, [&](int from) { return activity >= from; });
    if (parents_) return static_cast<size_t>((z % 2 * 4 + y % 2 * 2 + x % 2) * 24 + step);
    return static_cast<size_t>((z == 0 ? 0 : y == 0 ? 24 : 48) + step);
  }

  uint64_t decode_symbol(size_t c) {
    const uint64_t slot = state_ % 2048;
    size_t symbol = 0;
    uint64_t start = 0;
    while (start + parts_[c][symbol] <= slot) start += parts_[c][symbol++];
    state_ = state_ / 2048 * parts_[c][symbol] + slot - start;
    uint64_t base = symbol;
    int bits = 0;
    if (symbol == 72) {
      base = 0;
      bits = max_value_ > 0xffff ? 32 : 17;
    } else if (symbol >= 16) {
      bits = 3 + static_cast<int>(symbol - 16) / 2;
      base = (2 + symbol % 2) << bits;
    }
    if (max_value_ <= 0xffff) {
      base += raw(bits);
      renew();
      return base;
    }
    renew();
    const int low = std::min(bits, 16);
    base += raw(low);
    renew();
    base += raw(bits - low) << low;
    renew();
    return base;
  }
  uint64_t raw(int bits) {
    const uint64_t value = state_ % (uint64_t{1} << bits);
    state_ >>= bits;
    return value;
  }
  void renew() {
    if (state_ >> 32 != 0 || words_.empty()) return;
    for (size_t i = 4; i-- > 0;)
      state_ = state_ << 8 | std::to_integer<uint64_t>(words_[words_.size() - 4 + i]);
    words_ = words_.first(words_.size() - 4);
  }

  int64_t max_value_ = 0, error_ = 0, background_ = 0;
  std::vector<uint32_t> palette_;
  bool parents_ = false;
  int64_t weights_[48][30] = {};
  std::array<std::array<uint64_t, 73>, 192> parts_{};
  ReferenceParent parent_;
  Extent extent_;
  std::vector<bool> solid_;
  std::vector<int64_t> values_, magnitudes_;
  uint64_t state_ = 1;
  std::span<const std::byte> words_;
};

}  // namespace voxkit::page::test
