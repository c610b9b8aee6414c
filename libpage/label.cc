#include "libpage/label.h"

#include <algorithm>
#include <bit>

#include "libpage/parent_rows.h"

namespace voxkit::page {
namespace {

/// Stands where there is no voxel: no name.
constexpr uint32_t none = 0xffffffff;

/// The voxels of a page, and none around them.
class Surroundings {
 public:
  static constexpr int reach = 2, row = max_side + reach + 1, plane = row * row;
  Surroundings() { values_.fill(none); }
  uint32_t* at(int x, int y, int z) {
    return &values_[static_cast<size_t>(((z + reach) * row + y + reach) * row + x + reach)];
  }

 private:
  std::array<uint32_t, static_cast<size_t>((max_side + reach) * plane)> values_;
};

/// The parents of a page, and those around them as far as they are in theirs.
class Parents {
 public:
  static constexpr int row = parent_side, plane = row * row;
  Parents(const Parent<uint32_t>& parent, Extent extent, uint32_t max_value) {
    const Extent e = parent.extent;
    for (int z = -1; z <= (extent.nz + 1) / 2; ++z)
      for (int y = -1; y <= (extent.ny + 1) / 2; ++y)
        for (int x = -1; x <= (extent.nx + 1) / 2; ++x) {
          const int px = parent.x + x, py = parent.y + y, pz = parent.z + z;
          const bool inside = px >= 0 && py >= 0 && pz >= 0 && px < e.nx && py < e.ny && pz < e.nz;
          const uint32_t value =
              inside ? parent.samples[static_cast<size_t>((pz * e.ny + py) * e.nx + px)] : none;
          values_[place(x, y, z)] = value <= max_value ? value : none;
        }
  }
  const uint32_t* of(int x, int y, int z) const { return &values_[place(x / 2, y / 2, z / 2)]; }

 private:
  static size_t place(int x, int y, int z) {
    return static_cast<size_t>(((z + 1) * row + y + 1) * row + x + 1);
  }
  std::array<uint32_t, static_cast<size_t>(row* plane)> values_;
};

/// Where the voxels around one are, in the order of a context's bits, and which of them are asked for their
/// names in turn.
constexpr int row = Surroundings::row, plane = Surroundings::plane;
constexpr std::array alone_places = {-1,     -2,        -1 - row, -row,         1 - row,     -1 - plane,
                                     -plane, 1 - plane, -2 * row, -row - plane, row - plane, -2 * plane};
constexpr std::array alone_turns = {0, 3, 6, 4, 2, 9, 5, 7, 10};
/// Behind these the parent, and those on its voxel's side along x, y, z.
constexpr std::array places_with_parents = {-1, -1 - row, -row, 1 - row, -1 - plane, -plane, -row - plane};
constexpr std::array turns_with_parents = {7, 0, 2, 5, 8, 9, 10, 1, 3, 4, 6};

/// Calls coder.decide(at, context, name) for each name until it is that of voxel number `at`, else
/// coder.name(at), which returns it, for all voxels in order.
template <bool with_parents, class Coder>
void visit(Extent extent, const Parents* parents, Coder& coder) {
  constexpr size_t near = with_parents ? places_with_parents.size() : alone_places.size(),
                   all = with_parents ? near + 4 : near;
  constexpr auto turns = [] {
    if constexpr (with_parents)
      return turns_with_parents;
    else
      return alone_turns;
  }();
  Surroundings around;
  size_t at = 0;
  for (int z = 0; z < extent.nz; ++z)
    for (int y = 0; y < extent.ny; ++y)
      for (int x = 0; x < extent.nx; ++x, ++at) {
        uint32_t* const here = around.at(x, y, z);
        std::array<uint32_t, all> known;
        for (size_t i = 0; i < near; ++i) {
          if constexpr (with_parents)
            known[i] = here[places_with_parents[i]];
          else
            known[i] = here[alone_places[i]];
        }
        uint32_t child = 0;
        if constexpr (with_parents) {
          const uint32_t* const parent = parents->of(x, y, z);
          known[near] = parent[0];
          known[near + 1] = parent[toward(x)];
          known[near + 2] = parent[toward(y) * Parents::row];
          known[near + 3] = parent[toward(z) * Parents::plane];
          child = (first_child(y, z) + (static_cast<uint32_t>(x) & 1)) << all;
        }
        std::array<uint32_t, turns.size()> asked;
        size_t count = 0;
        uint32_t found = none;
        for (const int turn : turns) {
          const uint32_t name = known[static_cast<size_t>(turn)];
          if (name == none || std::find(asked.begin(), asked.begin() + count, name) != asked.begin() + count)
            continue;
          uint32_t context = with_parents ? child : count != 0 ? 1u << near : 0u;
          for (size_t i = 0; i < all; ++i) context |= (known[i] == name ? 1u : 0u) << i;
          asked[count++] = name;
          if (coder.decide(at, context, name)) {
            found = name;
            break;
          }
        }
        *here = found != none ? found : coder.name(at);
      }
}

template <class Coder>
void visit(const LabelTables& tables, Extent extent, const Parent<uint32_t>& parent, Coder& coder) {
  if (!tables.parents) return visit<false>(extent, nullptr, coder);
  const Parents parents(parent, extent, tables.max_value);
  visit<true>(extent, &parents, coder);
}

int name_bits(const LabelTables& tables) {
  return std::bit_width(tables.max_value);
}

}  // namespace

void count_labels(const LabelTables& tables, std::span<const uint32_t> values, Extent extent,
                  const Parent<uint32_t>& parent, std::span<DecisionCounts> counts) {
  struct {
    std::span<const uint32_t> values;
    std::span<DecisionCounts> counts;
    bool decide(size_t at, uint32_t context, uint32_t name) {
      const bool same = values[at] == name;
      ++counts[context][same ? 1 : 0];
      return same;
    }
    uint32_t name(size_t at) { return values[at]; }
  } counter{values, counts};
  visit(tables, extent, parent, counter);
}

void encode_labels(const LabelTables& tables, std::span<const uint32_t> values, Extent extent,
                   const Parent<uint32_t>& parent, std::vector<std::byte>& out, size_t least) {
  struct Step {
    Decision decision;  ///< of a part of 0: a name
    uint32_t name;
  };
  struct {
    const LabelTables& tables;
    std::span<const uint32_t> values;
    std::vector<Step> steps{};
    bool decide(size_t at, uint32_t context, uint32_t name) {
      const bool same = values[at] == name;
      steps.push_back({decision(tables.numbers[context], same), 0});
      return same;
    }
    uint32_t name(size_t at) {
      steps.push_back({{0, 0}, values[at]});
      return values[at];
    }
  } lister{tables, values};
  lister.steps.reserve(2 * max_voxels);
  visit(tables, extent, parent, lister);
  RansEncoder coder;
  const auto bits = static_cast<uint32_t>(name_bits(tables));
  for (size_t i = lister.steps.size(); i-- > 0;) {
    const Step& step = lister.steps[i];
    if (step.decision.part == 0)
      coder.put_raw(step.name, bits);
    else
      coder.put(step.decision.part, step.decision.start, 0, 0);
  }
  coder.finish(out, least);
}

bool decode_labels(const LabelTables& tables, std::span<const std::byte> page, Extent extent,
                   const Parent<uint32_t>& parent, std::span<uint32_t> values) {
  struct {
    const LabelTables& tables;
    std::span<uint32_t> values;
    uint32_t bits;
    RansDecoder coder{};
    bool decide(size_t at, uint32_t context, uint32_t name) {
      values[at] = name;
      return page::decide(coder, tables.numbers[context]);
    }
    uint32_t name(size_t at) {
      values[at] = std::min(coder.raw(bits), tables.max_value);
      coder.renew();
      return values[at];
    }
  } reader{tables, values, static_cast<uint32_t>(name_bits(tables))};
  reader.coder.open(page);
  visit(tables, extent, parent, reader);
  return reader.coder.finished();
}

}  // namespace voxkit::page
