#include "libcolor/palette/palette_split.h"

#include <algorithm>
#include <array>
#include <queue>

namespace voxkit::color {
namespace {

uint8_t channel(Rgb c, size_t axis) {
  return axis == 0 ? c.r : axis == 1 ? c.g : c.b;
}

/// The weight times the squared length of the mean: the more of it, the less squared error.
double moment(const ColorSums& s) {
  const auto square = [](uint64_t v) { return static_cast<double>(v) * static_cast<double>(v); };
  return (square(s.r) + square(s.g) + square(s.b)) / static_cast<double>(s.weight);
}

ColorSums operator+(const ColorSums& p, const ColorSums& q) {
  return {p.weight + q.weight, p.r + q.r, p.g + q.g, p.b + q.b};
}
ColorSums operator-(const ColorSums& p, const ColorSums& q) {
  return {p.weight - q.weight, p.r - q.r, p.g - q.g, p.b - q.b};
}

/// A part, and how it is best cut.
struct Part {
  uint32_t first, last;
  double gain = 0;  ///< by how much the squared error falls; 0: cannot be cut
  size_t axis = 0;
  uint8_t least = 0;  ///< value of the axis from which on the second half is

  bool operator<(const Part& other) const {
    return gain < other.gain || (gain == other.gain && first > other.first);
  }
};

class Splitter {
 public:
  explicit Splitter(std::span<WeightedColor> colors) : colors_(colors) {}

  std::vector<uint32_t> split(uint32_t parts) {
    std::priority_queue<Part> queue;
    std::vector<uint32_t> begins = {0};
    queue.push(best_cut(0, static_cast<uint32_t>(colors_.size())));
    while (begins.size() < parts && queue.top().gain > 0) {
      const Part part = queue.top();
      queue.pop();
      const auto middle =
          std::partition(colors_.begin() + part.first, colors_.begin() + part.last,
                         [&](const WeightedColor& c) { return channel(c.color, part.axis) < part.least; });
      const auto cut = static_cast<uint32_t>(middle - colors_.begin());
      begins.push_back(cut);
      queue.push(best_cut(part.first, cut));
      queue.push(best_cut(cut, part.last));
    }
    std::sort(begins.begin(), begins.end());
    return begins;
  }

 private:
  Part best_cut(uint32_t first, uint32_t last) {
    Part part{first, last};
    if (last - first < 2) return part;
    const auto own = colors_.subspan(first, last - first);
    std::array<uint8_t, 3> lo{255, 255, 255}, hi{};
    for (const WeightedColor& c : own)
      for (size_t axis = 0; axis < 3; ++axis) {
        lo[axis] = std::min(lo[axis], channel(c.color, axis));
        hi[axis] = std::max(hi[axis], channel(c.color, axis));
      }
    for (size_t axis = 0; axis < 3; ++axis)
      std::fill(&sums_[axis][lo[axis]], &sums_[axis][hi[axis]] + 1, ColorSums());
    ColorSums all;
    for (const WeightedColor& c : own) {
      all.add(c);
      for (size_t axis = 0; axis < 3; ++axis) sums_[axis][channel(c.color, axis)].add(c);
    }
    const double whole = moment(all);
    for (size_t axis = 0; axis < 3; ++axis) {
      ColorSums below;
      for (size_t value = lo[axis]; value < hi[axis]; ++value) {
        const ColorSums& here = sums_[axis][value];
        if (here.weight == 0) continue;
        below = below + here;
        const double gain = moment(below) + moment(all - below) - whole;
        if (gain > part.gain) {
          part.gain = gain;
          part.axis = axis;
          part.least = static_cast<uint8_t>(value + 1);
        }
      }
    }
    return part;
  }

  std::span<WeightedColor> colors_;
  std::array<std::array<ColorSums, 256>, 3> sums_;  ///< of the part that is looked at, by axis and value
};

}  // namespace

std::vector<uint32_t> split_colors(std::span<WeightedColor> colors, uint32_t parts) {
  return Splitter(colors).split(parts);
}

}  // namespace voxkit::color
