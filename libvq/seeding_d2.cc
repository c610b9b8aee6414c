#include <algorithm>
#include <bit>

#include "libvq/seeding.h"

namespace voxkit::vq {
namespace {

using Share = unsigned __int128;  // a weight of at most 2^47 times a squared distance of less than 2^39

/// SplitMix64 (G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014).
class Random {
 public:
  uint64_t next() {
    uint64_t z = state_ += 0x9e3779b97f4a7c15;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
    z = (z ^ z >> 27) * 0x94d049bb133111eb;
    return z ^ z >> 31;
  }
  /// Any number below `end` with the same probability.
  Share below(Share end) {
    const auto high = static_cast<uint64_t>(end >> 64);
    const auto bits =
        static_cast<int>(high != 0 ? 64 + std::bit_width(high) : std::bit_width(static_cast<uint64_t>(end)));
    for (;;) {
      Share r = next();
      if (bits > 64) r |= Share{next()} << 64;
      r &= (Share{1} << bits) - 1;
      if (r < end) return r;
    }
  }

 private:
  uint64_t state_ = 0;
};

}  // namespace

Status seed_d2(NearestCentres& nearest, const KeySpace& space, std::span<const uint64_t> weights,
               uint32_t count, std::vector<Brick>& centres, Context& ctx) {
  const BrickTree& tree = *nearest.tree;
  std::vector<uint32_t> position_of(tree.size());
  for (uint32_t p = 0; p < tree.size(); ++p) position_of[tree.index(p)] = p;
  std::vector<Share> shares(tree.size());  // each with those before it
  centres.reserve(count);                  // `recent` has pointers
  RecentCentres recent(*nearest.kernels);
  Random random;
  while (centres.size() < count) {
    const size_t first = centres.size();
    Share sum = 0;
    for (size_t i = 0; i < shares.size(); ++i) {
      const Share distance = first == 0 ? 1 : nearest.distance[position_of[i]];
      shares[i] = sum += weights[i] * distance;
    }
    if (sum == 0) break;
    recent.restart(centres);
    const size_t draws = std::clamp<size_t>(first / 4, 1, RecentCentres::most);
    for (size_t draw = 0; draw < draws && centres.size() < count; ++draw) {
      const Share r = random.below(sum);
      const auto i = static_cast<size_t>(std::upper_bound(shares.begin(), shares.end(), r) - shares.begin());
      const Brick& brick = tree.brick(position_of[i]);
      const Key key = tree.key(position_of[i]);
      const uint64_t was = first == 0 ? 1 : nearest.distance[position_of[i]];
      const uint64_t is = recent.nearest(brick, key, was, 0, space);
      if (r - (i == 0 ? 0 : shares[i - 1]) >= weights[i] * Share{is}) continue;
      centres.push_back(brick);
      recent.add(key);
    }
    VOX_CHECK(nearest.add(std::span(centres).subspan(first), static_cast<uint32_t>(first), space, ctx));
    ctx.progress(static_cast<double>(centres.size()) / count);
  }
  return {};
}

}  // namespace voxkit::vq
