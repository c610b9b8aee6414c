// Bricks of a VQ file, decoded by a group of lanes together and kept in its own cache (Guthe and Goesele
// 2016, section 5): by a warp on a device, or lane after lane on a host. `Lanes` as for dvr_packet.h.
#pragma once

#include "librender/dvr/dvr_packet.h"
#include "libvq/view.h"

namespace voxkit::render {

/// Where decoded bricks are: memory that the lanes of a group share.
struct WarpCache {
  static constexpr int log2_slots = 5, slots = 1 << log2_slots;
  uint64_t ids[slots];  ///< of bricks; Reader::no_brick: what is there is nobody's
  uint16_t codes[slots][vq::brick_voxels];
};

/// What codes stand for: as Volume::voxel_of.
struct CodeValues {
  double base, step, most;  ///< most: the greatest value of integers
  bool is_float;
  VOX_HD_HOT float operator()(uint16_t code) const {
    const double value = base + step * code;
    if (is_float) return static_cast<float>(value);
    return static_cast<float>(static_cast<uint32_t>(value > 0 ? (value < most ? value : most) : 0));
  }
};

/// The voxels around samples, of a volume of `Pools` that was checked as a whole. Eight voxels may lie in as
/// many bricks; all lanes that need a brick take what they need of it at once, so none is needed any more
/// when the next one takes its slot.
template <class Lanes, class Pools>
class WarpBricks {
 public:
  VOX_HD_HOT WarpBricks(const vq::View& view, const Pools& pools, const CodeValues& values,
                        const int64_t (&dims)[3], WarpCache& cache)
      : reader_(view, pools), view_(&view), values_(values), dims_(dims), cache_(&cache) {
    for (int i = 0; i < Lanes::held; ++i)
      for (int slot = Lanes::first() + i; slot < WarpCache::slots; slot += Lanes::count)
        cache.ids[slot] = reader_.no_brick;
    Lanes::sync();
  }
  VOX_HD_HOT void begin() {}
  /// Bricks decoded so far.
  VOX_HD_HOT uint32_t decoded() const { return decoded_; }

  template <class Same>
  VOX_HD_HOT void fetch(const DvrPlaces<Same>& p, const typename Same::Mask& wanted,
                        typename Same::Real (&v)[8]) {
    constexpr int n = Lanes::held;
    int32_t rest[n], at[3][n][2], next[3][n];  // bits of corners that are missing; coordinates of both ends
    float found[8][n];
    for (int i = 0; i < n; ++i) {
      rest[i] = Lanes::get(wanted, i) ? 255 : 0;
      for (int a = 0; a < 3; ++a)
        for (int end = 0; end < 2; ++end) {
          const int32_t c = Lanes::get(p.cell[a], i) + end;
          at[a][i][end] = c < dims_[a] ? c : static_cast<int32_t>(dims_[a] - 1);
        }
      for (int c = 0; c < 8; ++c) found[c][i] = 0;
    }
    for (;;) {
      const uint32_t pending = Lanes::bits(Lanes::load(rest) != 0);
      if (pending == 0) break;
      for (int i = 0; i < n; ++i) {
        const int corner = lowest_bit(static_cast<uint32_t>(rest[i] | 256));
        for (int a = 0; a < 3; ++a) next[a][i] = at[a][i][corner >> a & 1] >> dvr_brick_log2;
      }
      const int leader = lowest_bit(pending);
      const int32_t x = Lanes::broadcast(Lanes::load(next[0]), leader),
                    y = Lanes::broadcast(Lanes::load(next[1]), leader),
                    z = Lanes::broadcast(Lanes::load(next[2]), leader);
      const uint16_t* const codes = brick(x, y, z);
      for (int i = 0; i < n; ++i)
        for (int c = 0; c < 8; ++c) {
          const int32_t cx = at[0][i][c & 1], cy = at[1][i][c >> 1 & 1], cz = at[2][i][c >> 2];
          const bool here = (rest[i] >> c & 1) && cx >> dvr_brick_log2 == x && cy >> dvr_brick_log2 == y &&
                            cz >> dvr_brick_log2 == z;
          if (!here) continue;
          found[c][i] = values_(codes[(cx & 3) + 4 * (cy & 3) + 16 * (cz & 3)]);
          rest[i] &= ~(1 << c);
        }
    }
    for (int c = 0; c < 8; ++c) v[c] = Lanes::load(found[c]);
  }

 private:
  VOX_HD_HOT static int lowest_bit(uint32_t x) { return std::countr_zero(x); }

  /// The codes of a brick, until the next one is asked for. The place is the same in all lanes.
  VOX_HD_HOT const uint16_t* brick(int32_t x, int32_t y, int32_t z) {
    const uint64_t id =
        reader_.brick_id(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z));
    const auto slot = static_cast<uint32_t>(id) * 2654435761u >> (32 - WarpCache::log2_slots);
    uint16_t* const codes = cache_->codes[slot];
    // A brick that is missing is made up anew each time: the mark of an empty slot is no brick's id.
    if (id != reader_.no_brick && cache_->ids[slot] == id) return codes;
    Lanes::sync();  // all have read what was there
    decode(id, codes);
    for (int i = 0; i < Lanes::held; ++i)
      if (Lanes::first() + i == 0) cache_->ids[slot] = id;
    Lanes::sync();
    return codes;
  }

  /// Calls work(i) for i = lane, lane + 32 ... < count, and waits for all lanes.
  template <class Work>
  VOX_HD_HOT static void share(int count, const Work& work) {
    for (int i = 0; i < Lanes::held; ++i)
      for (int item = Lanes::first() + i; item < count; item += Lanes::count) work(item);
    Lanes::sync();
  }

  /// What is not valid becomes some brick; nothing outside the file is read.
  VOX_HD_HOT void decode(uint64_t id, uint16_t* codes) {
    vq::Record record;
    if (!reader_.find(id, record)) record.range = {};
    const uint32_t least = record.range.min, top = static_cast<uint32_t>(record.range.max - record.range.min);
    const auto plain = [&](const std::byte* bytes) {
      share(vq::brick_voxels, [&](int i) {
        const auto bits = static_cast<uint64_t>(view_->bits);
        codes[i] = static_cast<uint16_t>(vq::load_bits(bytes, static_cast<uint64_t>(i) * bits, view_->bits));
      });
    };
    if (top == 0) {
      share(vq::brick_voxels, [&](int i) { codes[i] = static_cast<uint16_t>(least); });
      return;
    }
    ++decoded_;
    if (view_->codebook == vq::Codebook::packed) return plain(record.code);
    const auto head = record.available > 0 ? static_cast<uint32_t>(record.code[0]) : 63u;
    const auto escape_bytes = static_cast<uint32_t>(vq::plain_bytes(view_->bits));
    if (head == vq::escape && record.available > escape_bytes) return plain(record.code + 1);
    const bool has_widths = (head & 63) <= 5 && (head & 63) < record.available;
    const uint32_t c2 = has_widths ? head & 63 : 0;
    const uint64_t widths = has_widths ? load_le<uint64_t>(record.code + 1) : 0;
    // Four lanes an octant.
    share(vq::brick_voxels / 2, [&](int pair) {
      const auto octant = static_cast<uint32_t>(pair / 4);
      uint32_t at = 1 + c2, width = 0;
      for (uint32_t o = 0; o <= octant; ++o) {
        at += width;
        width = static_cast<uint32_t>(widths >> (o * c2) & ((1u << c2) - 1));
      }
      const bool valid = has_widths && width <= 16 && at + width <= record.available;
      for (uint32_t i = static_cast<uint32_t>(pair % 4) * 2, end = i + 2; i < end; ++i) {
        const uint32_t code =
            valid ? vq::load_bits(record.code + at, uint64_t{i} * width, static_cast<int>(width)) : 0;
        codes[vq::octant_voxel(octant, i)] = static_cast<uint16_t>(code <= top ? code : top);
      }
    });
    const auto transform = static_cast<vq::Transform>(head >> 6);
    // Rows of voxels along x begin one after the other, so that each finds its neighbours done.
    if (transform != vq::Transform::none)
      for (int step = 0; step < 10; ++step)
        share(16, [&](int row) {
          const int y = row & 3, z = row >> 2, x = step - y - z;
          if (x >= 0 && x < 4) invert_voxel(transform, x, y, z, top, codes);
        });
    share(vq::brick_voxels, [&](int i) { codes[i] = static_cast<uint16_t>(codes[i] + least); });
  }

  /// One voxel of vq::invert, those before it being done.
  VOX_HD_HOT static void invert_voxel(vq::Transform transform, int x, int y, int z, uint32_t top,
                                      uint16_t* codes) {
    const auto below = [&](int i, int j, int k) -> uint32_t {
      return i < 0 || j < 0 || k < 0 ? 0 : codes[i + 4 * j + 16 * k];
    };
    const uint32_t code = codes[x + 4 * y + 16 * z], a = below(x - 1, y, z), b = below(x, y - 1, z),
                   c = below(x, y, z - 1), ab = below(x - 1, y - 1, z), ac = below(x - 1, y, z - 1),
                   bc = below(x, y - 1, z - 1);
    uint32_t voxel;
    if (transform == vq::Transform::previous) {
      voxel = vq::unfold_modulo(code, x ? a : y ? b : c, top);
    } else if (transform == vq::Transform::median_modulo) {
      voxel = vq::unfold_modulo(code, vq::predict_median(a, b, c, ab, ac, bc, top), top);
    } else {
      const uint32_t predicted = !z   ? vq::plane(a, b, ab, top)
                                 : !y ? vq::plane(a, c, ac, top)
                                 : !x ? vq::plane(b, c, bc, top)
                                      : vq::predict_median(a, b, c, ab, ac, bc, top);
      voxel = vq::unfold_bounded(code, predicted, top);
    }
    codes[x + 4 * y + 16 * z] = static_cast<uint16_t>(voxel);
  }

  vq::Reader<Pools> reader_;
  const vq::View* view_;
  const CodeValues values_;
  const int64_t (&dims_)[3];
  WarpCache* cache_;
  uint32_t decoded_ = 0;
};

}  // namespace voxkit::render
