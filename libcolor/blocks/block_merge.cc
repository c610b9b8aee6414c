#include <algorithm>

#include "libcolor/blocks/block_plan.h"

namespace voxkit::color {
namespace {

/// The list of Algorithm 1.
class List {
 public:
  static constexpr uint32_t end = ~uint32_t{0};

  /// Of units, one after the other.
  List(const std::vector<MergeUnit>& units, const Fitter& fitter, int bits, std::vector<MergeItem>& memory)
      : items_(memory), fitter_(fitter), bits_(bits) {
    items_.clear();
    items_.reserve(units.size());
    const auto count = static_cast<uint32_t>(units.size());
    for (uint32_t i = 0; i < count; ++i)
      items_.push_back({units[i].first, units[i].last, i - 1, i + 1 == count ? end : i + 1});
  }

  /// Calls visit(item) for what is left, in order.
  template <class Visit>
  void merge(const Visit& visit) {
    while (pass()) {
    }
    for (uint32_t i = 0; i != end; i = items_[i].right) visit(items_[i]);
  }

 private:
  /// The fit of an item and its right neighbour, which it has.
  const Fit& joined(uint32_t i) {
    MergeItem& item = items_[i];
    if (!item.tried) {
      fitter_.fit(item.first, items_[item.right].last, bits_, item.joined);
      item.tried = true;
    }
    return item.joined;
  }
  /// An item takes in its right neighbour.
  void take_right(uint32_t i) {
    MergeItem& item = items_[i];
    const MergeItem& right = items_[item.right];
    item.fit = item.joined;
    item.last = right.last;
    item.right = right.right;
    item.merged = true;
    item.tried = false;
    if (item.right != end) items_[item.right].left = i;
    if (item.left != end) items_[item.left].tried = false;
  }
  /// One pass over every second block; whether anything was merged.
  bool pass() {
    bool any = false;
    uint32_t i = items_[0].right;
    while (i != end) {
      const MergeItem& item = items_[i];
      const Fit& left = joined(item.left);
      const Fit* const right = item.right != end ? &joined(i) : nullptr;
      const bool right_feasible = right != nullptr && right->feasible;
      if (left.feasible || right_feasible) {
        any = true;
        // The smaller mean error wins; a tie goes right.
        const auto error = [&](const Fit& fit, uint32_t first, uint32_t last) {
          return static_cast<double>(fit.squared_error) / (last - first);
        };
        const bool go_right =
            right_feasible && (!left.feasible || error(*right, item.first, items_[item.right].last) <=
                                                     error(left, items_[item.left].first, item.last));
        if (!go_right) i = item.left;
        take_right(i);
      }
      i = items_[i].right;
      if (i != end) i = items_[i].right;
    }
    return any;
  }

  std::vector<MergeItem>& items_;
  const Fitter& fitter_;
  int bits_;
};

}  // namespace

const std::vector<PlannedBlock>& merge_greedily(const MacroColors& colors, const Fitter& fitter,
                                                Endpoints endpoints, int least_bits, int most_bits,
                                                PlanMemory& memory) {
  std::vector<MergeUnit>&units = memory.units, &merged = memory.merged_units;
  std::vector<PlannedBlock>&plan = memory.merged, &cheaper = memory.cheaper;
  units.clear();
  plan.clear();
  for (uint32_t i = 0; i < colors.size(); ++i) {
    units.push_back({i, i + 1, 1, block_cost(1, least_bits, endpoints)});
    plan.push_back({i, i + 1, least_bits, fitter.fit(i, i + 1, least_bits)});
  }
  for (int bits = least_bits; bits <= most_bits; ++bits) {
    merged.clear();
    cheaper.clear();
    auto unit = units.cbegin();
    auto block = plan.cbegin();
    List(units, fitter, bits, memory.items).merge([&](const MergeItem& item) {
      MergeUnit own{item.first, item.last, 0, 0};
      for (; unit != units.cend() && unit->first < item.last; ++unit) {
        own.cost += unit->cost;
        own.blocks += unit->blocks;
      }
      const auto next = block + own.blocks;
      // A tie goes to the parent: fewer blocks.
      if (const uint64_t cost = block_cost(item.last - item.first, bits, endpoints);
          item.merged && cost <= own.cost) {
        own.cost = cost;
        own.blocks = 1;
        cheaper.push_back({item.first, item.last, bits, item.fit});
      } else {
        cheaper.insert(cheaper.end(), block, next);
      }
      block = next;
      merged.push_back(own);
    });
    std::swap(units, merged);
    std::swap(plan, cheaper);
  }
  return plan;
}

}  // namespace voxkit::color
