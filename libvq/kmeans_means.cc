#include "libvq/kmeans_means.h"

#include <algorithm>

#include "formats/parallel.h"
#include "libvq/kmeans.h"

namespace voxkit::vq {

Means::Means(NearestCentres& nearest, std::span<const uint64_t> weights, std::span<const Brick> centres)
    : nearest_(nearest),
      weights_(weights),
      weight_(centres.size()),
      count_(centres.size()),
      sum_of_(centres.size(), none),
      touched_(centres.size()) {
  // Bricks that are centres come first, so that the others find them there.
  for (const bool other : {false, true})
    for (size_t p = 0; p < nearest.tree->size(); ++p)
      if ((nearest.distance[p] != 0) == other) add(p, nearest.centre[p], centres);
}

void Means::touch(uint32_t centre) {
  if (touched_[centre]) return;
  touched_[centre] = 1;
  touched_list_.push_back(centre);
}

void Means::add(size_t position, uint32_t centre, std::span<const Brick> centres) {
  const Brick& brick = nearest_.tree->brick(position);
  const uint64_t weight = weights_[nearest_.tree->index(position)];
  if (sum_of_[centre] == none && brick != centres[centre]) {
    // So far, all bricks were equal to their centre.
    sum_of_[centre] = static_cast<uint32_t>(sums_.size());
    Sum& sum = sums_.emplace_back();
    for (size_t v = 0; v < brick_voxels; ++v) sum[v] = weight_[centre] * centres[centre][v];
  }
  if (sum_of_[centre] != none) {
    Sum& sum = sums_[sum_of_[centre]];
    for (size_t v = 0; v < brick_voxels; ++v) sum[v] += weight * brick[v];
    touch(centre);
  }
  weight_[centre] += weight;
  ++count_[centre];
}

void Means::remove(size_t position, uint32_t centre) {
  const uint64_t weight = weights_[nearest_.tree->index(position)];
  if (sum_of_[centre] != none) {
    const Brick& brick = nearest_.tree->brick(position);
    Sum& sum = sums_[sum_of_[centre]];
    for (size_t v = 0; v < brick_voxels; ++v) sum[v] -= weight * brick[v];
  }
  weight_[centre] -= weight;
  --count_[centre];
  touch(centre);
}

void Means::move(size_t position, uint32_t from, uint32_t to, std::span<const Brick> centres) {
  remove(position, from);
  add(position, to, centres);
}

bool Means::any_empty() const {
  return std::any_of(touched_list_.begin(), touched_list_.end(), [&](uint32_t c) { return count_[c] == 0; });
}

Status Means::fill_empty(std::span<const Brick> centres) {
  std::vector<uint32_t> empty;
  for (const uint32_t c : touched_list_)
    if (count_[c] == 0) empty.push_back(c);
  if (empty.empty()) return {};
  std::sort(empty.begin(), empty.end());

  struct Candidate {
    SquaredError error;
    uint32_t index, position;
    bool operator<(const Candidate& other) const {
      return error < other.error || (error == other.error && index > other.index);
    }
  };
  std::vector<Candidate> worst;
  for (uint32_t p = 0; p < nearest_.tree->size(); ++p) {
    const uint32_t index = nearest_.tree->index(p);
    if (nearest_.distance[p] != 0)
      worst.push_back({SquaredError{nearest_.distance[p]} * weights_[index], index, p});
  }
  std::make_heap(worst.begin(), worst.end());
  for (const uint32_t c : empty) {
    // There is one: else no cluster would have bricks that differ, and there are no more centres than
    // different bricks.
    uint32_t position;
    do {
      if (worst.empty())
        return fail(ErrorCode::internal, {}, "k-means: nothing to fill an empty cluster with");
      std::pop_heap(worst.begin(), worst.end());
      position = worst.back().position;
      worst.pop_back();
    } while (count_[nearest_.centre[position]] < 2);
    move(position, nearest_.centre[position], c, centres);
    nearest_.centre[position] = c;
  }
  return {};
}

Brick Means::mean(uint32_t centre) const {
  const Sum& sum = sums_[sum_of_[centre]];
  const uint64_t weight = weight_[centre];
  Brick mean;
  for (size_t v = 0; v < brick_voxels; ++v) mean[v] = static_cast<uint16_t>((sum[v] + weight / 2) / weight);
  return mean;
}

Result<std::vector<uint32_t>> Means::update(std::span<Brick> centres, const Context& ctx) {
  VOX_CHECK(fill_empty(centres));
  constexpr size_t block = 256;
  std::vector<uint8_t> changed(touched_list_.size());
  VOX_CHECK(parallel_for(ctx, static_cast<int64_t>((changed.size() + block - 1) / block),
                         [&](int64_t task) -> Status {
                           const size_t begin = static_cast<size_t>(task) * block;
                           for (size_t i = begin; i < std::min(begin + block, changed.size()); ++i) {
                             const uint32_t c = touched_list_[i];
                             touched_[c] = 0;
                             if (sum_of_[c] == none) continue;  // all its bricks are equal to it
                             const Brick is = mean(c);
                             changed[i] = is != centres[c];
                             centres[c] = is;
                           }
                           return {};
                         }));
  std::vector<uint32_t> numbers;
  for (size_t i = 0; i < changed.size(); ++i)
    if (changed[i]) numbers.push_back(touched_list_[i]);
  touched_list_.clear();
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

}  // namespace voxkit::vq
