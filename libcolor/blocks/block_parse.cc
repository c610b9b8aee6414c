// The cheapest cut of a macro block into blocks, by dynamic programming over runs of one colour.
#include <algorithm>
#include <array>

#include "libcolor/blocks/block_plan.h"

namespace voxkit::color {
namespace {

/// What follows the first colour of an atom: the cheapest way found to code all colours from there on.
struct Tail {
  uint64_t cost = 0;
  uint32_t next = 0;  ///< atom behind the block that begins here
  int bits = 0;
  Fit fit;
};

class Parser {
 public:
  Parser(const Fitter& fitter, Endpoints endpoints, const std::vector<PlannedBlock>& atoms, int effort)
      : fitter_(fitter), endpoints_(endpoints), atoms_(atoms), tries_(effort) {
    for (const PlannedBlock& atom : atoms) starts_.push_back(atom.first);
    starts_.push_back(atoms.back().last);
  }

  std::vector<PlannedBlock> parse() {
    const auto count = static_cast<uint32_t>(atoms_.size());
    tails_.resize(count + 1);
    std::array<uint32_t, most_weight_bits + 1> reach;
    reach.fill(count);
    // The least of a block's weights and what follows it, over all ends, but for the weights up to its
    // beginning.
    std::array<uint64_t, most_weight_bits + 1> least;
    least.fill(~uint64_t{0});
    for (uint32_t i = count; i-- > 0;) {
      Tail& best = tails_[i];
      best = {block_cost(starts_[i + 1] - starts_[i], 0, endpoints_) + tails_[i + 1].cost, i + 1, 0,
              atoms_[i].fit};
      for (int bits = 0; bits <= most_weight_bits; ++bits) {
        const auto b = static_cast<size_t>(bits);
        least[b] = std::min(least[b], b * starts_[i + 1] + tails_[i + 1].cost);
        if (block_cost(0, bits, endpoints_) + least[b] - b * starts_[i] >= best.cost) continue;
        reach[b] = furthest(i, std::max(reach[b], i + 1), bits);
        consider(i, reach[b], bits, best);
      }
    }
    std::vector<PlannedBlock> plan;
    for (uint32_t i = 0; i < count; i = tails_[i].next)
      plan.push_back({starts_[i], starts_[tails_[i].next], tails_[i].bits, tails_[i].fit});
    return plan;
  }

 private:
  bool feasible(uint32_t i, uint32_t end, int bits) const {
    return fitter_.fit(starts_[i], starts_[end], bits).feasible;
  }
  /// About the last end of a feasible block that begins at atom i: searches from a guess, as if all blocks up
  /// to the last feasible one were feasible.
  uint32_t furthest(uint32_t i, uint32_t guess, int bits) const {
    uint32_t good = i + 1, bad = static_cast<uint32_t>(atoms_.size()) + 1;
    const auto look_at = [&](uint32_t end) { (feasible(i, end, bits) ? good : bad) = end; };
    if (guess > good) look_at(guess);
    // Up or down from there, ever faster ...
    const bool up = good == std::max(guess, i + 1);
    for (uint32_t step = 1; bad > good + step; step *= 2) {
      const uint32_t before = good;
      look_at(up ? good + step : bad - step);
      if (up == (good == before)) break;
    }
    // ... then between the two, by halves.
    while (bad > good + 1) look_at(good + (bad - good) / 2);
    return good;
  }
  /// Blocks of so many bits from atom i, ending at `end` or before: the cheapest that is feasible, if it is
  /// cheaper than the best.
  void consider(uint32_t i, uint32_t end, int bits, Tail& best) const {
    const auto cost_of = [&](uint32_t at) {
      return block_cost(starts_[at] - starts_[i], bits, endpoints_) + tails_[at].cost;
    };
    uint64_t tried = 0;  // cost of the last one that turned out not to be feasible, and all below
    for (int round = 0; round < tries_; ++round) {
      uint32_t cheapest = 0;
      uint64_t cost = best.cost;
      for (uint32_t at = i + 1; at <= end; ++at) {
        const uint64_t own = cost_of(at);
        if (own < cost && own > tried) {
          cost = own;
          cheapest = at;
        }
      }
      if (cheapest == 0) return;
      const Fit fit = fitter_.fit(starts_[i], starts_[cheapest], bits);
      if (fit.feasible) {
        best = {cost, cheapest, bits, fit};
        return;
      }
      tried = cost;
    }
  }

  const Fitter& fitter_;
  Endpoints endpoints_;
  const std::vector<PlannedBlock>& atoms_;
  int tries_;
  std::vector<uint32_t> starts_;  ///< first colours of atoms, and the end
  std::vector<Tail> tails_;
};

}  // namespace

std::vector<PlannedBlock> parse_optimally(const MacroColors& colors, const Fitter& fitter,
                                          Endpoints endpoints, int effort) {
  const std::vector<PlannedBlock> atoms = merge_greedily(colors, fitter, endpoints, 0, 0);
  return Parser(fitter, endpoints, atoms, effort).parse();
}

}  // namespace voxkit::color
