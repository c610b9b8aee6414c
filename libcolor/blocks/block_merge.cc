#include <algorithm>

#include "libcolor/blocks/block_plan.h"

namespace voxkit::color {
namespace {

/// A block of the list that is merged.
struct Item {
  uint32_t first, last;
  uint32_t left, right;  ///< neighbours in the list
  bool merged = false;   ///< in this round of bits
  bool tried = false;    ///< whether `joined` is known
  Fit fit;               ///< of a merged block
  Fit joined;            ///< with the right neighbour
};

/// The list of Algorithm 1.
class List {
 public:
  static constexpr uint32_t end = ~uint32_t{0};

  List(std::vector<Item> items, const Fitter& fitter, int bits)
      : items_(std::move(items)), fitter_(fitter), bits_(bits) {}

  std::vector<Item> merge() {
    while (pass()) {
    }
    std::vector<Item> left;
    for (uint32_t i = 0; i != end; i = items_[i].right) left.push_back(items_[i]);
    return left;
  }

 private:
  /// The fit of an item and its right neighbour, which it has.
  const Fit& joined(uint32_t i) {
    Item& item = items_[i];
    if (!item.tried) {
      item.joined = fitter_.fit(item.first, items_[item.right].last, bits_);
      item.tried = true;
    }
    return item.joined;
  }
  /// An item takes in its right neighbour.
  void take_right(uint32_t i) {
    Item& item = items_[i];
    const Item& right = items_[item.right];
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
      const Item& item = items_[i];
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

  std::vector<Item> items_;
  const Fitter& fitter_;
  int bits_;
};

/// A run of colours with the cheapest blocks known for it.
struct Unit {
  uint32_t first, last;
  uint64_t cost;
  std::vector<PlannedBlock> blocks;
};

}  // namespace

std::vector<PlannedBlock> merge_greedily(const MacroColors& colors, const Fitter& fitter, Endpoints endpoints,
                                         int least_bits, int most_bits) {
  std::vector<Unit> units(colors.size());
  for (uint32_t i = 0; i < colors.size(); ++i) {
    units[i] = {i, i + 1, block_cost(1, least_bits, endpoints), {}};
    units[i].blocks.push_back({i, i + 1, least_bits, fitter.fit(i, i + 1, least_bits)});
  }
  for (int bits = least_bits; bits <= most_bits; ++bits) {
    const auto count = static_cast<uint32_t>(units.size());
    std::vector<Item> items(count);
    for (uint32_t i = 0; i < count; ++i) {
      items[i].first = units[i].first;
      items[i].last = units[i].last;
      items[i].left = i == 0 ? List::end : i - 1;
      items[i].right = i + 1 == count ? List::end : i + 1;
    }
    std::vector<Unit> merged;
    size_t next = 0;
    for (const Item& item : List(std::move(items), fitter, bits).merge()) {
      Unit unit = std::move(units[next++]);
      for (; next < units.size() && units[next].first < item.last; ++next) {
        unit.cost += units[next].cost;
        unit.blocks.insert(unit.blocks.end(), units[next].blocks.begin(), units[next].blocks.end());
      }
      unit.last = item.last;
      // A tie goes to the parent: fewer blocks.
      if (const uint64_t own = block_cost(item.last - item.first, bits, endpoints);
          item.merged && own <= unit.cost) {
        unit.cost = own;
        unit.blocks.assign(1, {item.first, item.last, bits, item.fit});
      }
      merged.push_back(std::move(unit));
    }
    units = std::move(merged);
  }
  std::vector<PlannedBlock> plan;
  for (const Unit& unit : units) plan.insert(plan.end(), unit.blocks.begin(), unit.blocks.end());
  return plan;
}

}  // namespace voxkit::color
