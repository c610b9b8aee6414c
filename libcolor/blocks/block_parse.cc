// The cheapest cut of a macro block into blocks, by dynamic programming over runs of one colour.
#include <algorithm>
#include <array>
#include <utility>

#include "libcolor/blocks/block_plan.h"

namespace voxkit::color {
namespace {

class Parser {
 public:
  /// The atoms are what was merged.
  Parser(const Fitter& fitter, Endpoints endpoints, int effort, PlanMemory& memory)
      : fitter_(fitter),
        endpoints_(endpoints),
        atoms_(memory.merged),
        tries_(effort),
        starts_(memory.starts),
        tails_(memory.tails),
        feasible_(memory.feasible) {
    starts_.clear();
    for (const PlannedBlock& atom : atoms_) starts_.push_back(atom.first);
    starts_.push_back(atoms_.back().last);
  }

  void parse(std::vector<PlannedBlock>& plan) {
    const auto count = static_cast<uint32_t>(atoms_.size());
    tails_.resize(count + 1);
    tails_[count] = {};
    std::array<uint32_t, most_weight_bits + 1> reach;
    reach.fill(count);
    // The least of a block's weights and what follows it, over all ends, but for the weights up to its
    // beginning.
    std::array<uint64_t, most_weight_bits + 1> least;
    least.fill(~uint64_t{0});
    for (uint32_t i = count; i-- > 0;) {
      ParseTail& best = tails_[i];
      best = {block_cost(starts_[i + 1] - starts_[i], 0, endpoints_) + tails_[i + 1].cost, i + 1, 0,
              atoms_[i].fit};
      for (int bits = 0; bits <= most_weight_bits; ++bits) {
        const auto b = static_cast<size_t>(bits);
        least[b] = std::min(least[b], b * starts_[i + 1] + tails_[i + 1].cost);
        if (block_cost(0, bits, endpoints_) + least[b] - b * starts_[i] >= best.cost) continue;
        feasible_.clear();
        reach[b] = furthest(i, std::max(reach[b], i + 1), bits);
        consider(i, reach[b], bits, best);
      }
    }
    plan.clear();
    for (uint32_t i = 0; i < count; i = tails_[i].next)
      plan.push_back({starts_[i], starts_[tails_[i].next], tails_[i].bits, tails_[i].fit});
  }

 private:
  /// The fit of a block, remembered where it is feasible for as long as the beginning and bits are the same.
  Fit fit(uint32_t i, uint32_t end, int bits) {
    const Fit found = fitter_.fit(starts_[i], starts_[end], bits);
    if (found.feasible) feasible_.emplace_back(end, found);
    return found;
  }
  /// About the last end of a feasible block that begins at atom i: searches from a guess, as if all blocks up
  /// to the last feasible one were feasible.
  uint32_t furthest(uint32_t i, uint32_t guess, int bits) {
    uint32_t good = i + 1, bad = static_cast<uint32_t>(atoms_.size()) + 1;
    const auto look_at = [&](uint32_t end) { (fit(i, end, bits).feasible ? good : bad) = end; };
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
  void consider(uint32_t i, uint32_t end, int bits, ParseTail& best) {
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
      const auto known = std::ranges::find(feasible_, cheapest, &Known::first);
      const Fit found = known != feasible_.end() ? known->second : fit(i, cheapest, bits);
      if (found.feasible) {
        best = {cost, cheapest, bits, found};
        return;
      }
      tried = cost;
    }
  }

  const Fitter& fitter_;
  Endpoints endpoints_;
  const std::vector<PlannedBlock>& atoms_;
  int tries_;
  std::vector<uint32_t>& starts_;  ///< first colours of atoms, and the end
  std::vector<ParseTail>& tails_;  ///< by atom, and the end
  using Known = std::pair<uint32_t, Fit>;
  std::vector<Known>& feasible_;  ///< ends, and fits
};

}  // namespace

const std::vector<PlannedBlock>& parse_optimally(const MacroColors& colors, const Fitter& fitter,
                                                 Endpoints endpoints, int effort, PlanMemory& memory) {
  merge_greedily(colors, fitter, endpoints, 0, 0, memory);
  Parser(fitter, endpoints, effort, memory).parse(memory.parsed);
  return memory.parsed;
}

}  // namespace voxkit::color
