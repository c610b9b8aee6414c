#include "libcolor/attributes/attribute_means.h"

#include <algorithm>
#include <cmath>

#include "libcolor/attributes/attribute_params.h"
#include "libcolor/surface/octahedral.h"

namespace voxkit::color {
namespace {

constexpr float unit = 1 << 14;  ///< length of a normal

}  // namespace

void AttributeSums::add(const AttributeSums& octant) {
  voxels += octant.voxels;
  opacity += octant.opacity;
  for (size_t i = 0; i < 3; ++i) {
    light[i] += octant.light[i];
    normal[i] += octant.normal[i];
  }
  for (size_t i = 0; i < 2; ++i) rm[i] += octant.rm[i];
  if (octant.vote_count == 0) return;
  const Vote& vote = octant.votes[0];
  for (uint32_t i = 0; i < vote_count; ++i)
    if (votes[i].id == vote.id) {
      votes[i].voxels += vote.voxels;
      return;
    }
  votes[vote_count++] = vote;
}

void AttributeSums::elect() {
  if (vote_count == 0) return;
  const auto best = std::min_element(
      votes.begin(), votes.begin() + vote_count,
      [](const Vote& a, const Vote& b) { return a.voxels != b.voxels ? a.voxels > b.voxels : a.id < b.id; });
  votes[0] = {best->id, voxels};
  vote_count = 1;
}

AttributeSums AttributeMeans::of(std::span<const std::byte> voxel) const {
  AttributeSums sums;
  sums.voxels = 1;
  const auto value = [&](Attribute a) { return value_at(&voxel[set_.offset(a)], kind_of(a).bytes); };
  const auto byte = [](uint32_t v, size_t i) { return static_cast<uint8_t>(v >> 8 * i & 255); };
  if (set_.has(Attribute::emissive)) {
    const uint32_t v = value(Attribute::emissive);
    for (size_t i = 0; i < 3; ++i) sums.light[i] = tables_.linear[byte(v, i)];
  }
  if (set_.has(Attribute::opacity)) sums.opacity = value(Attribute::opacity);
  if (set_.has(Attribute::normal)) {
    const uint32_t v = value(Attribute::normal);
    const auto direction = direction_of({byte(v, 0), byte(v, 1)});
    for (size_t i = 0; i < 3; ++i) sums.normal[i] = std::lround(unit * direction[i]);
  }
  if (set_.has(Attribute::rm)) {
    const uint32_t v = value(Attribute::rm);
    sums.rm = {byte(v, 0), byte(v, 1)};
  }
  if (set_.has(Attribute::id)) {
    sums.votes[0] = {value(Attribute::id), 1};
    sums.vote_count = 1;
  }
  return sums;
}

void AttributeMeans::put(const AttributeSums& sums, std::span<std::byte> cell) const {
  const auto set = [&](Attribute a, uint32_t value) {
    put_value(value, kind_of(a).bytes, &cell[set_.offset(a)]);
  };
  const uint64_t n = sums.voxels;
  const auto mean = [&](uint64_t sum) { return static_cast<uint32_t>((2 * sum + n) / (2 * n)); };
  if (set_.has(Attribute::emissive)) {
    uint32_t value = 0;
    for (size_t i = 0; i < 3; ++i)
      value |= static_cast<uint32_t>(tables_.stored[mean(sums.light[i])]) << 8 * i;
    set(Attribute::emissive, value);
  }
  if (set_.has(Attribute::opacity)) set(Attribute::opacity, std::max(mean(sums.opacity), 1u));
  if (set_.has(Attribute::normal)) {
    const auto c = [&](size_t i) { return static_cast<double>(sums.normal[i]); };
    const Octahedral o = octahedral_of(c(0), c(1), c(2));
    set(Attribute::normal, o.u | static_cast<uint32_t>(o.v) << 8);
  }
  if (set_.has(Attribute::rm)) set(Attribute::rm, mean(sums.rm[0]) | mean(sums.rm[1]) << 8);
  if (set_.has(Attribute::id)) set(Attribute::id, sums.votes[0].id);
}

void AttributeCells::close(size_t height, std::vector<std::byte>& values) {
  AttributeSums& sums = sums_[height];
  sums.elect();
  if (height + 1 < sums_.size()) {
    sums_[height + 1].add(sums);
  } else {
    values.resize(values.size() + bytes_);
    means_.put(sums, std::span(values).last(bytes_));
  }
  sums = {};
}

void AttributeCells::add(uint64_t place, std::span<const std::byte> voxel, std::vector<std::byte>& values) {
  if (sums_[1].voxels > 0)
    for (size_t h = 1; h < sums_.size() && place >> 3 * h != place_ >> 3 * h; ++h) close(h, values);
  sums_[1].add(means_.of(voxel));
  place_ = place;
}

void AttributeCells::finish(std::vector<std::byte>& values) {
  if (sums_[1].voxels == 0) return;
  for (size_t h = 1; h < sums_.size(); ++h) close(h, values);
}

}  // namespace voxkit::color
