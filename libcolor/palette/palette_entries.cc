#include <algorithm>
#include <utility>

#include "libcolor/palette/palette_plan.h"

namespace voxkit::color {

uint32_t PaletteEntries::add(std::span<const uint16_t> colors, uint32_t width) {
  for (const uint16_t c : colors) wanted_[c] = 1;
  const uint32_t size = uint32_t{1} << width;
  const std::optional<uint32_t> found = find_settled(colors, size);
  const uint32_t first = found ? *found : append(colors, size);
  for (const uint16_t c : colors) wanted_[c] = 0;
  return first;
}

/// `size` settled entries that have all colours, near the last places of the rarest one.
std::optional<uint32_t> PaletteEntries::find_settled(std::span<const uint16_t> colors, uint32_t size) {
  constexpr size_t tries = 16;
  const uint16_t rarest = *std::min_element(colors.begin(), colors.end(), [&](uint16_t a, uint16_t b) {
    return places_[a].size() < places_[b].size();
  });
  const std::vector<uint32_t>& places = places_[rarest];
  std::optional<uint32_t> first;
  for (size_t t = 0; t < std::min(tries, places.size()) && !first; ++t) {
    const uint32_t place = places[places.size() - 1 - t];
    const uint32_t lo = place + 1 < size ? 0 : place + 1 - size, hi = std::min(place + size, settled_);
    size_t found = 0;
    for (uint32_t i = lo; i < hi && !first; ++i) {
      if (wanted_[entries_[i]] && seen_[entries_[i]]++ == 0) ++found;
      if (i >= lo + size && wanted_[entries_[i - size]] && --seen_[entries_[i - size]] == 0) --found;
      if (found == colors.size()) first = i + 1 < lo + size ? lo : i + 1 - size;
    }
    for (const uint16_t c : colors) seen_[c] = 0;
  }
  return first;
}

/// The end of the list, with what is missing there added to it.
uint32_t PaletteEntries::append(std::span<const uint16_t> colors, uint32_t size) {
  // The last palette's own entries may still change places: those that are wanted come last.
  std::stable_partition(entries_.begin() + settled_, entries_.end(), [&](uint16_t c) { return !wanted_[c]; });
  const auto end = static_cast<uint32_t>(entries_.size());
  // Back as far as there is room for the colours that are still missing.
  uint32_t first = end, missing = static_cast<uint32_t>(colors.size());
  for (uint32_t i = end; i-- > 0;) {
    const uint16_t c = entries_[i];
    const bool one = wanted_[c] && seen_[c] == 0;
    if (end - i + missing - (one ? 1 : 0) > size) break;
    if (!one) continue;
    seen_[c] = 1;
    --missing;
    first = i;
  }
  for (const uint16_t c : colors)
    if (std::exchange(seen_[c], 0) == 0) entries_.push_back(c);
  const auto settled = missing == 0 ? static_cast<uint32_t>(entries_.size()) : end;
  for (; settled_ < settled; ++settled_) places_[entries_[settled_]].push_back(settled_);
  return first;
}

}  // namespace voxkit::color
