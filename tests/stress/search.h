// A search for the worst case of something: climbing over whole numbers, with restarts.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <vector>

namespace voxkit::stress {

/// What a variable may be: both ends are meant.
struct Range {
  int64_t lo, hi;
};
using Point = std::vector<int64_t>;

struct Worst {
  double score = -std::numeric_limits<double>::infinity();
  Point at;
  int64_t tried = 0;
};

/// The point of the greatest score that is found within `tries` looks. Each climb changes one to four
/// variables at a time: by one, by a power of two, to an end of their range, to any place in it, or to what
/// another one is; it keeps what is not worse, and ends when nothing has helped for long. Climbs begin at
/// `starts`, the worst first, and in turn with these at points of several kinds: anywhere, all variables
/// equal, at ends, at any power of two, or at the worst point so far with a part of it made anew. The same on
/// every machine.
template <class Score>
Worst climb(std::span<const Range> ranges, const std::vector<Point>& starts, int64_t tries, uint64_t seed,
            const Score& score) {
  std::mt19937_64 bits(seed);
  const auto below = [&](uint64_t n) { return n == 0 ? 0 : bits() % n; };
  const auto width = [&](size_t i) { return static_cast<uint64_t>(ranges[i].hi - ranges[i].lo); };
  const auto anywhere = [&](size_t i) {
    return ranges[i].lo + static_cast<int64_t>(width(i) == ~uint64_t{0} ? bits() : below(width(i) + 1));
  };
  const auto spread = [&](size_t i) {  // every power of two as likely as any other
    const uint64_t most = width(i) >> below(static_cast<uint64_t>(std::bit_width(width(i))) + 1);
    return ranges[i].lo + static_cast<int64_t>(below(most + 1));
  };
  const auto end = [&](size_t i) { return bits() & 1 ? ranges[i].hi : ranges[i].lo; };

  Worst worst;
  const size_t n = ranges.size();
  std::vector<std::pair<double, size_t>> ranked;  // the worst last
  for (size_t i = 0; i < starts.size() && worst.tried < tries; ++i, ++worst.tried) {
    ranked.push_back({score(starts[i]), i});
    if (worst.at.empty() || ranked.back().first > worst.score)
      worst.score = ranked.back().first, worst.at = starts[i];
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  const auto begin = [&](size_t number) -> Point {
    if (number % 2 == 0 && !ranked.empty()) {
      const size_t start = ranked.back().second;
      ranked.pop_back();
      return starts[start];
    }
    Point at(n);
    const uint64_t kind = below(number == 0 ? 4 : 6);
    const size_t like = below(n);
    for (size_t i = 0; i < n; ++i) {
      at[i] = kind == 0 ? anywhere(i) : kind == 1 ? end(i) : kind == 2 ? spread(i) : 0;
      if (kind == 3) at[i] = i == 0 ? anywhere(like) : at[0];
      if (kind >= 4) at[i] = below(3) == 0 ? (bits() & 1 ? anywhere(i) : spread(i)) : worst.at[i];
      at[i] = std::clamp(at[i], ranges[i].lo, ranges[i].hi);
    }
    return at;
  };
  const auto change = [&](Point& at) {
    for (uint64_t more = below(2) ? 1 : 1 + below(4); more > 0; --more) {
      const size_t i = below(n);
      const auto powers = std::max<uint64_t>(1, static_cast<uint64_t>(std::bit_width(width(i) | 1)) - 1);
      const auto power = static_cast<int64_t>(uint64_t{1} << below(powers));
      const int64_t sign = bits() & 1 ? 1 : -1;
      switch (below(8)) {
        case 0:
          at[i] = end(i);
          break;
        case 1:
          at[i] = anywhere(i);
          break;
        case 2:
          at[i] = at[below(n)];
          break;
        case 3:
        case 4:
          at[i] = sign > 0 ? (at[i] > ranges[i].hi - 1 ? at[i] : at[i] + 1)
                           : (at[i] < ranges[i].lo + 1 ? at[i] : at[i] - 1);
          break;
        default:
          // Without running over: the ranges may be all that 64 bits hold.
          at[i] = static_cast<int64_t>(static_cast<uint64_t>(at[i]) + static_cast<uint64_t>(sign * power));
      }
      at[i] = std::clamp(at[i], ranges[i].lo, ranges[i].hi);
    }
  };

  const int64_t patience = 200 + 20 * static_cast<int64_t>(n);
  for (size_t number = 0; worst.tried < tries; ++number) {
    Point here = begin(number);
    double height = score(here);
    ++worst.tried;
    if (worst.at.empty() || height > worst.score) worst.score = height, worst.at = here;
    for (int64_t idle = 0; idle < patience && worst.tried < tries; ++idle) {
      Point next = here;
      change(next);
      const double there = score(next);
      ++worst.tried;
      if (!(there >= height)) continue;
      if (there > height) idle = 0;
      height = there;
      here = std::move(next);
      if (height > worst.score) worst.score = height, worst.at = here;
    }
  }
  return worst;
}

/// Floats in ascending order as whole numbers, so that a step is to the next one: 0 is 0.
inline int64_t number_of(float x) {
  const auto bits = std::bit_cast<int32_t>(x);
  return bits >= 0 ? bits : int64_t{std::numeric_limits<int32_t>::min()} - bits;
}
inline float float_of(int64_t number) {
  return std::bit_cast<float>(
      static_cast<int32_t>(number >= 0 ? number : int64_t{std::numeric_limits<int32_t>::min()} - number));
}
/// All finite floats.
inline constexpr Range finite_floats{-0x7f7fffff, 0x7f7fffff};
/// Doubles from 0 up, likewise.
inline double double_of(int64_t number) {
  return std::bit_cast<double>(number);
}
inline int64_t number_of(double x) {
  return std::bit_cast<int64_t>(x);
}

}  // namespace voxkit::stress
