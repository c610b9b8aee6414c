#include "libvq/seeding.h"

#include <algorithm>
#include <bit>

namespace voxkit::vq {

void RecentCentres::restart(const std::vector<Brick>& centres) {
  first_ = centres.data() + centres.size();
  size_ = 0;
}

void RecentCentres::add(const Key& key) {
  const size_t leaf = size_ / leaf_bricks, i = size_ % leaf_bricks;
  if (leaf == leaves_.size()) {
    leaves_.emplace_back();
    norms_.resize(leaves_.size() * leaf_bricks);
  }
  for (int j = 0; j < fine_pairs; ++j) leaves_[leaf][static_cast<size_t>(j)][i] = key_pair(key.fine, j);
  norms_[size_++] = key.norm;
}

uint64_t RecentCentres::nearest(const Brick& brick, const Key& key, uint64_t distance, size_t begin,
                                const KeySpace& space) const {
  const QueryKey query = query_key(key, brick, space.reach(distance));
  const uint32_t number = 0;
  std::array<uint64_t, leaf_bricks> distances;
  for (size_t leaf = begin / leaf_bricks; leaf * leaf_bricks < size_; ++leaf) {
    std::array<uint32_t, 2> masks;
    kernels_->near_bricks(leaves_[leaf], norms_.data() + leaf * leaf_bricks, &query, &number, 1,
                          masks.data());
    uint32_t mask = masks[0];
    if (size_ - leaf * leaf_bricks < leaf_bricks) mask &= (1u << (size_ - leaf * leaf_bricks)) - 1;
    if (mask == 0) continue;
    kernels_->distances(first_ + leaf * leaf_bricks, mask, brick, distances.data());
    for (; mask != 0; mask &= mask - 1)
      distance = std::min(distance, distances[static_cast<size_t>(std::countr_zero(mask))]);
  }
  return distance;
}

}  // namespace voxkit::vq
