#include "formats/little_endian.h"
#include "libcolor/predicted/predicted.h"

namespace voxkit::color {
namespace {

/// -log2(part / 2048) in parts of 2^16, by squaring: whole numbers alone.
constexpr std::array<uint32_t, page::table_total> costs = [] {
  std::array<uint32_t, page::table_total> of{};
  for (uint32_t part = 1; part < of.size(); ++part) {
    const int whole = static_cast<int>(std::bit_width(part)) - 1;
    uint64_t x = uint64_t{part} << (31 - whole);  // 1 to 2, in parts of 2^31
    uint32_t fraction = 0;
    for (int bit = 0; bit < 16; ++bit) {
      x = x * x >> 31;
      fraction <<= 1;
      if (x >> 32 != 0) {
        fraction |= 1;
        x >>= 1;
      }
    }
    of[part] = (static_cast<uint32_t>(page::table_bits - whole) << 16) - fraction;
  }
  return of;
}();

struct WritingCoder {
  std::vector<page::Decision> decisions;
  bool decide(MixedChance& chance, bool yes) {
    decisions.push_back(page::decision_of_part(chance.part(), yes));
    chance.learn(yes);
    return yes;
  }
  bool decide_evenly(bool yes) {
    decisions.push_back(page::decision_of_part(page::table_total / 2, yes));
    return yes;
  }
};
struct PricingCoder {
  uint64_t cost = 0;
  bool decide(const MixedChance& chance, bool yes) {
    const uint32_t part = chance.part();
    cost += costs[yes ? part : page::table_total - part];
    return yes;
  }
  bool decide_evenly(bool yes) {
    cost += uint64_t{1} << 16;
    return yes;
  }
};

uint32_t squared_distance(Rgb a, Rgb b) {
  const int32_t r = a.r - b.r, g = a.g - b.g, c = a.b - b.b;
  return static_cast<uint32_t>(r * r + g * g + c * c);
}

class Encoder {
 public:
  Encoder(uint32_t count, double threshold)
      : steps_(steps_for(threshold)), most_(most_squared(threshold)), coded_(count) {
    for (const uint8_t step : steps_.steps) part_.bytes.push_back(std::byte{step});
  }

  void add(const KnownAround& around, uint32_t bit, uint32_t number, Rgb color) {
    const Expected e = expected(around, bit, number, coded_, steps_.unit());
    Channels k{};
    const bool near = squared_distance(steps_.color(e.color, k), color) <= most_;
    model_.as_expected(coder_, e, near);
    if (!near) {
      k = cheapest(e, color);
      model_.point(coder_, e, steps_.coded(k));
    }
    coded_.set(number, steps_.color(e.color, k), k);
    part_.add_error(color, coded_.colors[number]);
  }

  void end_section() {
    page::RansEncoder rans;
    for (size_t i = coder_.decisions.size(); i-- > 0;)
      rans.put(coder_.decisions[i].part, coder_.decisions[i].start, 0, 0);
    coder_.decisions.clear();
    const size_t at = part_.bytes.size();
    part_.bytes.resize(at + 4);
    rans.finish(part_.bytes, 0);
    store_le(&part_.bytes[at], static_cast<uint32_t>(part_.bytes.size() - at - 4));
  }
  EncodedPart take() { return std::move(part_); }

 private:
  /// Of the points that are near enough, the one that takes fewest bits.
  Channels cheapest(const Expected& e, Rgb color) {
    const Channels offset{color.r - e.color[0], color.g - e.color[1], color.b - e.color[2]};
    if (steps_.lossless()) return offset;
    Channels best{};
    uint64_t least = ~uint64_t{0};
    for (int32_t parity = 0; parity < 2; ++parity) {
      // The two points on both sides along each axis.
      Channels below;
      for (size_t c = 0; c < 3; ++c) {
        const int32_t whole = floor_divide(offset[c], steps_.steps[c]);
        below[c] = whole - ((whole ^ parity) & 1);
      }
      for (uint32_t corner = 0; corner < 8; ++corner) {
        const Channels k{below[0] + static_cast<int32_t>(2 * (corner & 1)),
                         below[1] + static_cast<int32_t>(corner & 2),
                         below[2] + static_cast<int32_t>(corner >> 1 & 2)};
        if (squared_distance(steps_.color(e.color, k), color) > most_) continue;
        PricingCoder price;
        model_.point(price, e, steps_.coded(k));
        if (price.cost < least) {
          least = price.cost;
          best = k;
        }
      }
    }
    return best;
  }
  static int32_t floor_divide(int32_t a, int32_t b) { return a / b - (a % b < 0 ? 1 : 0); }

  ColorSteps steps_;
  uint32_t most_;
  ColorModel model_;
  WritingCoder coder_;
  CodedColors coded_;
  EncodedPart part_;
};

}  // namespace

EncodedPart encode_predicted(std::span<const Rgb> colors, std::span<const uint64_t> places,
                             double threshold) {
  const auto cells = cells_of(places);
  const PartCells part_cells(cells);
  const auto count = static_cast<uint32_t>(colors.size());
  Encoder encoder(count, threshold);
  uint32_t number = 0;
  for (const PartCell& cell : cells) {
    const KnownAround around(part_cells, cell);
    for (uint64_t left = cell.mask; left != 0; left &= left - 1) {
      encoder.add(around, static_cast<uint32_t>(std::countr_zero(left)), number, colors[number]);
      ++number;
      if (number % section_colors == 0 || number == count) encoder.end_section();
    }
  }
  return encoder.take();
}

}  // namespace voxkit::color
