#include "libcolor/attribute_reader.h"

#include <fmt/format.h>

#include <algorithm>

#include "libcolor/store.h"

namespace voxkit::color {
namespace {

constexpr size_t none = ~size_t{0};

}  // namespace

Status AttributeStore::find(const Container& container, const Params& params) {
  const auto& table = container.table();
  const uint64_t parts = part_count(params.color_count);
  std::array<size_t, attribute_kinds.size()> heads;
  heads.fill(none);
  std::array<std::vector<size_t>, attribute_kinds.size()> values;
  for (size_t i = 0; i < attribute_kinds.size(); ++i)
    if (params.attributes.has(static_cast<Attribute>(i))) values[i].assign(parts, none);
  const auto bad = [&](const std::string& what) { return bad_input(container.name(), "table: " + what); };
  for (size_t i = 0; i < table.size(); ++i) {
    const ChunkEntry& entry = table[i];
    const bool head = entry.kind == attribute_params_kind;
    // What is not known yet may be there.
    if ((!head && entry.kind != attribute_values_kind) || entry.index >= attribute_kinds.size()) continue;
    const bool known = params.attributes.has(static_cast<Attribute>(entry.index)) &&
                       (head ? entry.part == 0 : entry.part < parts);
    size_t* const slot = !known ? nullptr : head ? &heads[entry.index] : &values[entry.index][entry.part];
    if (slot == nullptr || *slot != none)
      return bad(fmt::format("chunk {} {}.{}: not expected, or twice", head ? "ATTP" : "ATTR", entry.index,
                             entry.part));
    *slot = i;
  }
  for (size_t a = 0; a < attribute_kinds.size(); ++a) {
    if (!params.attributes.has(static_cast<Attribute>(a))) continue;
    if (heads[a] == none) return bad(fmt::format("no chunk ATTP {}.0", a));
    if (const auto missing = std::ranges::find(values[a], none); missing != values[a].end())
      return bad(fmt::format("no chunk ATTR {}.{}", a, missing - values[a].begin()));
    VOX_TRY(const auto bytes, container.chunk(heads[a]));
    VOX_TRY(const AttributeParams own, unpack_attribute(static_cast<Attribute>(a), bytes, container.name()));
    params_.push_back(own);
    parts_.push_back(std::move(values[a]));
  }
  return {};
}

AttributeReader::AttributeReader(const Store& store, const Container& container, const Params& params,
                                 Attribute attribute)
    : store_(&store), container_(&container), params_(&params), attribute_(attribute) {
  const auto& all = store.attributes().params();
  while (which_ + 1 < all.size() && all[which_].attribute != attribute) ++which_;
}

uint32_t AttributeReader::outside(uint64_t index) const {
  if (index >= params_->color_count)
    store_->report(*container_, "chunk NODE: counts of colors that do not add up");
  return 0;
}

bool AttributeReader::open(uint64_t index) {
  const uint64_t part = index >> part_log2;
  part_ = ~uint64_t{0};
  const AttributeStore& attributes = store_->attributes();
  const auto bytes = attributes.part(which_, part, *container_);
  if (!bytes) {
    store_->report(bytes.error());
    return false;
  }
  reader_.open(AttributePart(bytes->data(), bytes->size(), colors_of_part(params_->color_count, part),
                             AttributeStorage(attributes.params()[which_])));
  part_ = part;
  return true;
}

void AttributeReader::damaged(const std::string& what) const {
  store_->report(*container_, fmt::format("chunk ATTR {}.{}: {}", static_cast<int>(attribute_), part_, what));
}

AttributesReader::AttributesReader(const Store& store, const Container& container, const Params& params,
                                   AttributeSet set) {
  for (const AttributeParams& own : store.attributes().params())
    if (set.has(own.attribute))
      columns_.push_back(
          {kind_of(own.attribute).bytes, AttributeReader(store, container, params, own.attribute)});
}

}  // namespace voxkit::color
