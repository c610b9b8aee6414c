#include "libcolor/octree/context_fit.h"

#include <algorithm>
#include <bit>
#include <optional>

#include "formats/parallel.h"
#include "libpage/decision.h"

namespace voxkit::color {
namespace {

constexpr int fraction_bits = 24;
/// A question and the leaf that comes with it take 9 and 6 bits; what saves less than 10 bits of the samples
/// may well be chance, with so many facts to choose from.
constexpr int64_t question_bits = 15, least_bits = 10;

/// log2(1 + i / 4096) in parts of 2^24, by squaring: whole numbers alone.
constexpr int table_log2 = 12;
const auto log2_table = [] {
  std::array<int64_t, (1 << table_log2) + 1> table{};
  for (uint64_t i = 0; i < table.size() - 1; ++i) {
    uint64_t x = ((uint64_t{1} << table_log2) + i) << (31 - table_log2);  // 1 to 2, in parts of 2^31
    for (int bit = 0; bit < fraction_bits; ++bit) {
      x = x * x >> 31;
      table[i] <<= 1;
      if (x >> 32 != 0) {
        table[i] |= 1;
        x >>= 1;
      }
    }
  }
  table.back() = int64_t{1} << fraction_bits;
  return table;
}();

/// n log2(n), of n below 2^32, in parts of 2^24.
int64_t n_log_n(uint64_t n) {
  if (n < 2) return 0;
  const int whole = static_cast<int>(std::bit_width(n)) - 1;
  const uint64_t fraction = (n << (32 - whole)) & 0xffffffffu;  // above 1, in parts of 2^32
  const auto at = static_cast<size_t>(fraction >> (32 - table_log2));
  const auto rest = static_cast<int64_t>(fraction & ((uint64_t{1} << (32 - table_log2)) - 1));
  const int64_t log2 = (int64_t{whole} << fraction_bits) + log2_table[at] +
                       ((log2_table[at + 1] - log2_table[at]) * rest >> (32 - table_log2));
  return static_cast<int64_t>(n) * log2;
}
/// Bits that so many decisions take.
int64_t bits_of(uint64_t voids, uint64_t solids) {
  return n_log_n(voids + solids) - n_log_n(voids) - n_log_n(solids);
}

}  // namespace

ContextSamples::Packed ContextSamples::packed(const Facts& facts) {
  Packed bits{};
  size_t at = 0;
  const auto put = [&](uint64_t value, size_t count) {
    bits[at / 64] |= value << at % 64;
    if (at % 64 + count > 64) bits[at / 64 + 1] |= value >> (64 - at % 64);
    at += count;
  };
  for (size_t z = 0; z < 5; ++z)
    for (int y = 0; y < 5; ++y) put(facts.words[z] >> 8 * y & 31, 5);
  for (size_t z = 5; z < 8; ++z)
    for (int y = 1; y < 4; ++y) put(facts.words[z] >> (8 * y + 1) & 7, 3);
  put(facts.words[8], 4);
  return bits;
}

ContextSamples ContextSamples::joined(std::vector<ContextSamples>&& parts) {
  ContextSamples all;
  for (size_t solid = 0; solid < 2; ++solid) {
    size_t count = 0;
    for (const ContextSamples& part : parts) count += part.of_[solid].size();
    all.of_[solid].reserve(count);
    for (ContextSamples& part : parts) {
      all.of_[solid].insert(all.of_[solid].end(), part.of_[solid].begin(), part.of_[solid].end());
      part.of_[solid] = {};
    }
  }
  return all;
}

ContextSamples::Counts ContextSamples::count(const std::array<Range, 2>& ranges) const {
  // Eight counters of a byte for each byte of the samples; they are emptied before they are full.
  static constexpr auto lanes = [] {
    std::array<uint64_t, 256> of{};
    for (uint64_t byte = 0; byte < 256; ++byte)
      for (int bit = 0; bit < 8; ++bit) of[byte] |= (byte >> bit & 1) << 8 * bit;
    return of;
  }();
  constexpr size_t bytes = (fact_count + 7) / 8;
  Counts counts{};
  for (size_t solid = 0; solid < 2; ++solid)
    for (size_t at = ranges[solid].begin; at < ranges[solid].end;) {
      std::array<uint64_t, bytes> counters{};
      const size_t stop = std::min(ranges[solid].end, at + 255);
      for (; at < stop; ++at) {
        const Packed& sample = of_[solid][at];
        for (size_t b = 0; b < bytes; ++b) counters[b] += lanes[sample[b / 8] >> 8 * (b % 8) & 0xff];
      }
      for (uint32_t f = 0; f < fact_count; ++f)
        counts[solid][f] += static_cast<uint8_t>(counters[f / 8] >> 8 * (f % 8));
    }
  return counts;
}

uint32_t ContextSamples::best_fact(const Leaf& leaf, int64_t least) {
  const uint64_t voids = leaf.ranges[0].size(), solids = leaf.ranges[1].size();
  const int64_t all = bits_of(voids, solids);
  if (all < least || leaf.questions == most_questions) return fact_count;
  uint32_t best = fact_count;
  for (uint32_t f = 0; f < fact_count; ++f) {
    const uint64_t v = leaf.counts[0][f], s = leaf.counts[1][f];
    if (const int64_t saved = all - bits_of(v, s) - bits_of(voids - v, solids - s); saved >= least) {
      best = f;
      least = saved + 1;
    }
  }
  return best;
}

std::array<ContextSamples::Leaf, 2> ContextSamples::parted(const Leaf& leaf, uint32_t fact) {
  std::array<Leaf, 2> parts;
  for (Leaf& part : parts) {
    part.questions = leaf.questions + 1;
    part.ranges = leaf.ranges;
  }
  for (size_t solid = 0; solid < 2; ++solid) {
    const auto begin = of_[solid].begin();
    const auto middle =
        std::partition(begin + static_cast<ptrdiff_t>(leaf.ranges[solid].begin),
                       begin + static_cast<ptrdiff_t>(leaf.ranges[solid].end),
                       [&](const Packed& sample) { return (sample[fact / 64] >> fact % 64 & 1) == 0; });
    parts[0].ranges[solid].end = parts[1].ranges[solid].begin = static_cast<size_t>(middle - begin);
  }
  // The smaller part is counted; the other one has the rest.
  const size_t small = parts[0].size() <= parts[1].size() ? 0 : 1;
  parts[small].counts = count(parts[small].ranges);
  for (size_t solid = 0; solid < 2; ++solid)
    for (size_t f = 0; f < fact_count; ++f)
      parts[1 - small].counts[solid][f] = leaf.counts[solid][f] - parts[small].counts[solid][f];
  return parts;
}

Result<ContextTree> ContextSamples::grow(uint64_t scale, const Context& ctx) && {
  const auto times = static_cast<int64_t>(scale);
  const int64_t least = std::max(least_bits, (question_bits + times - 1) / times) << fraction_bits;
  ContextTree tree;
  std::vector<Leaf> open(1);
  open[0].ranges = {Range{0, of_[0].size()}, Range{0, of_[1].size()}};
  open[0].counts = count(open[0].ranges);
  while (!open.empty()) {
    std::vector<std::optional<std::array<Leaf, 2>>> parts(open.size());
    std::vector<uint32_t> asked(open.size());
    VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(open.size()), [&](int64_t i) -> Status {
      const auto at = static_cast<size_t>(i);
      asked[at] = best_fact(open[at], least);
      if (asked[at] != fact_count) parts[at] = parted(open[at], asked[at]);
      return {};
    }));
    std::vector<Leaf> next;
    for (size_t i = 0; i < open.size(); ++i) {
      const Leaf& leaf = open[i];
      if (!parts[i]) {
        const auto number = page::decision_number({leaf.ranges[0].size(), leaf.ranges[1].size()});
        tree.set_number(leaf.node, std::max<uint8_t>(1, number));
        continue;
      }
      const uint32_t first = tree.split(leaf.node, asked[i]);
      for (uint32_t answer = 0; answer < 2; ++answer) {
        next.push_back((*parts[i])[answer]);
        next.back().node = first + answer;
      }
    }
    open = std::move(next);
  }
  return tree;
}

}  // namespace voxkit::color
