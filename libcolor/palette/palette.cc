#include "libcolor/palette/palette.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/parallel.h"
#include "libcolor/palette/palette_split.h"

namespace voxkit::color {
namespace {

uint32_t squared_distance(Rgb a, Rgb b) {
  const int r = a.r - b.r, g = a.g - b.g, c = a.b - b.b;
  return static_cast<uint32_t>(r * r + g * g + c * c);
}

/// Centres by the cell of space that they are in.
class CenterGrid {
 public:
  explicit CenterGrid(std::span<const Rgb> centers) : centers_(centers) {
    while (shift_ > 2 && (uint64_t{1} << 3 * (8 - shift_)) < 8 * centers.size()) --shift_;
    const size_t cells = size_t{1} << 3 * (8 - shift_);
    begins_.assign(cells + 1, 0);
    for (const Rgb c : centers) ++begins_[cell(c) + 1];
    for (size_t i = 0; i < cells; ++i) begins_[i + 1] += begins_[i];
    std::vector<uint32_t> next(begins_.begin(), begins_.end() - 1);
    members_.resize(centers.size());
    for (uint32_t i = 0; i < centers.size(); ++i) members_[next[cell(centers[i])]++] = i;
  }

  struct Nearest {
    uint32_t index, squared;
  };
  /// The nearest centre, of equal ones the first; `guess`: any, the nearer the faster.
  Nearest nearest(Rgb color, uint32_t guess) const {
    Nearest best{guess, squared_distance(color, centers_[guess])};
    const auto reach = static_cast<int>(std::sqrt(static_cast<double>(best.squared))) + 1;
    const std::array<int, 3> at = {color.r, color.g, color.b};
    std::array<int, 3> lo, hi;
    for (size_t a = 0; a < 3; ++a) {
      lo[a] = std::max(0, at[a] - reach) >> shift_;
      hi[a] = std::min(255, at[a] + reach) >> shift_;
    }
    // Squared distance to a slab of cells.
    const auto beside = [&](size_t a, int slab) {
      const int first = slab << shift_, last = first + (1 << shift_) - 1;
      const int d = at[a] < first ? first - at[a] : at[a] > last ? at[a] - last : 0;
      return static_cast<uint32_t>(d * d);
    };
    for (int r = lo[0]; r <= hi[0]; ++r)
      for (int g = lo[1]; g <= hi[1]; ++g) {
        const uint32_t plane = beside(0, r) + beside(1, g);
        if (plane > best.squared) continue;
        for (int b = lo[2]; b <= hi[2]; ++b) {
          if (plane + beside(2, b) > best.squared) continue;
          const size_t here = place(r, g, b);
          for (uint32_t i = begins_[here]; i < begins_[here + 1]; ++i) {
            const uint32_t index = members_[i], squared = squared_distance(color, centers_[index]);
            if (squared < best.squared || (squared == best.squared && index < best.index))
              best = {index, squared};
          }
        }
      }
    return best;
  }

 private:
  size_t place(int r, int g, int b) const {
    const int bits = 8 - shift_;
    return static_cast<size_t>((r << bits | g) << bits | b);
  }
  size_t cell(Rgb c) const { return place(c.r >> shift_, c.g >> shift_, c.b >> shift_); }

  std::span<const Rgb> centers_;
  int shift_ = 7;
  std::vector<uint32_t> begins_, members_;
};

constexpr size_t batch_colors = 1 << 14;

/// The nearest centre of each color, from the one it had, and the sum of squared distances.
Result<uint64_t> assign(std::span<const WeightedColor> colors, std::span<const Rgb> centers,
                        std::span<uint32_t> nearest, Context& ctx) {
  const CenterGrid grid(centers);
  std::vector<uint64_t> errors((colors.size() + batch_colors - 1) / batch_colors);
  VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(errors.size()), [&](int64_t batch) -> Status {
    const size_t first = static_cast<size_t>(batch) * batch_colors;
    uint64_t error = 0;
    for (size_t i = first; i < std::min(colors.size(), first + batch_colors); ++i) {
      const CenterGrid::Nearest found = grid.nearest(colors[i].color, nearest[i]);
      nearest[i] = found.index;
      error += uint64_t{found.squared} * colors[i].weight;
    }
    errors[static_cast<size_t>(batch)] = error;
    return {};
  }));
  uint64_t error = 0;
  for (const uint64_t part : errors) error += part;
  return error;
}

/// Centres where squared errors are least, as far as k-means from those finds them.
Status settle(std::span<const WeightedColor> colors, std::vector<Rgb>& centers, std::span<uint32_t> nearest,
              int rounds, Context& ctx) {
  VOX_TRY(uint64_t error, assign(colors, centers, nearest, ctx));
  for (int round = 0; round < rounds; ++round) {
    std::vector<ColorSums> sums(centers.size());
    for (size_t i = 0; i < colors.size(); ++i) sums[nearest[i]].add(colors[i]);
    for (size_t i = 0; i < centers.size(); ++i)
      if (sums[i].weight > 0) centers[i] = sums[i].mean();
    VOX_TRY(const uint64_t next, assign(colors, centers, nearest, ctx));
    const bool still = next + next / 1024 >= error;
    error = next;
    if (still) break;
  }
  return {};
}

}  // namespace

Result<Palette> Palette::choose(std::span<const Rgb> colors, uint32_t most, int effort, Context& ctx) {
  constexpr size_t codes = size_t{1} << 24;
  Palette palette;
  VOX_TRY(palette.reservation_, Reservation::take(codes * sizeof(uint32_t), "a table of colors", ctx));
  palette.table_.resize(codes);
  size_t different = 0;
  for (const Rgb c : colors) {
    uint32_t& count = palette.table_[code(c)];
    different += count == 0 ? 1 : 0;
    count += count < ~uint32_t{0} ? 1 : 0;
  }
  VOX_TRY(
      const Reservation room,
      Reservation::take(different * (sizeof(WeightedColor) + 2 * sizeof(uint32_t)), "different colors", ctx));
  std::vector<WeightedColor> list;
  list.reserve(different);
  for (uint32_t i = 0; i < codes; ++i)
    if (const uint32_t count = palette.table_[i]; count > 0)
      list.push_back(
          {{static_cast<uint8_t>(i >> 16), static_cast<uint8_t>(i >> 8), static_cast<uint8_t>(i)}, count});

  std::vector<Rgb>& centers = palette.colors_;
  std::vector<uint32_t> nearest(list.size());
  if (different <= most) {
    for (uint32_t i = 0; i < different; ++i) {
      centers.push_back(list[i].color);
      nearest[i] = i;
    }
  } else {
    std::vector<uint32_t> begins = split_colors(list, most);
    begins.push_back(static_cast<uint32_t>(list.size()));
    for (uint32_t i = 0; i + 1 < begins.size(); ++i) {
      ColorSums sums;
      for (uint32_t k = begins[i]; k < begins[i + 1]; ++k) {
        sums.add(list[k]);
        nearest[k] = i;
      }
      centers.push_back(sums.mean());
    }
    VOX_CHECK(settle(list, centers, nearest, 8 * effort, ctx));
    // Those that are used, each once, in order.
    std::vector<Rgb> used;
    for (const uint32_t i : nearest) used.push_back(centers[i]);
    std::sort(used.begin(), used.end(), [](Rgb a, Rgb b) { return code(a) < code(b); });
    used.erase(std::unique(used.begin(), used.end()), used.end());
    for (uint32_t& i : nearest)
      i = static_cast<uint32_t>(std::lower_bound(used.begin(), used.end(), centers[i],
                                                 [](Rgb a, Rgb b) { return code(a) < code(b); }) -
                                used.begin());
    centers = std::move(used);
  }
  for (size_t i = 0; i < list.size(); ++i) palette.table_[code(list[i].color)] = nearest[i];
  return palette;
}

}  // namespace voxkit::color
