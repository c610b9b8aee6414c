#include "libcolor/dag/dag_builder.h"

#include <fmt/format.h>

#include <bit>

namespace voxkit::color {

DagBuilder::DagBuilder(int height, Context& ctx)
    : pool_(height, Colors::leaf, Counts::node, Curve::morton, ctx),
      height_(height),
      open_(static_cast<size_t>(height) + 1) {}

Status DagBuilder::add(std::span<const SurfaceVoxel> voxels) {
  for (const SurfaceVoxel& voxel : voxels) {
    if (voxel.place < next_ || voxel.place >> (3 * height_) != 0)
      return fail(ErrorCode::internal, {}, fmt::format("voxel {:#x} out of order", voxel.place));
    next_ = voxel.place + 1;
    VOX_CHECK(enter_word(voxel.place >> 6));
    leaf_ |= uint64_t{1} << (voxel.place & 63);
  }
  voxels_ += voxels.size();
  return pool_.check_memory();
}

Status DagBuilder::add_word(uint64_t place, uint64_t word) {
  if (place << 6 < next_ || place >> (3 * (height_ - leaf_height)) != 0 || word == 0)
    return fail(ErrorCode::internal, {}, fmt::format("word {:#x} out of order", place));
  VOX_CHECK(enter_word(place));
  leaf_ = word;
  next_ = (place + 1) << 6;
  voxels_ += static_cast<uint64_t>(std::popcount(word));
  return {};
}

/// Closes what ends before a word.
Status DagBuilder::enter_word(uint64_t place) {
  if (place == leaf_place_) return {};
  if (leaf_ != 0) {
    VOX_CHECK(close_leaf());
    // All nodes below the lowest one that holds both are complete.
    const int differing = 63 - std::countl_zero(place ^ leaf_place_);
    VOX_CHECK(close_up_to(leaf_height + differing / 3));
  }
  leaf_place_ = place;
  return {};
}

void DagBuilder::append(int height, uint32_t octant, Subtree child) {
  if (height > height_)
    root_ = child;
  else
    open_[static_cast<size_t>(height)].add(octant, child);
}

Status DagBuilder::close_leaf() {
  VOX_TRY(const Subtree leaf, pool_.add_leaf(leaf_));
  leaf_ = 0;
  append(leaf_height + 1, static_cast<uint32_t>(leaf_place_ & 7), leaf);
  return {};
}

Status DagBuilder::close_up_to(int height) {
  for (int h = leaf_height + 1; h <= height; ++h) {
    Octants& octants = open_[static_cast<size_t>(h)];
    VOX_TRY(const Subtree node, pool_.add_node(h, octants, morton_state));
    octants = {};
    append(h + 1, static_cast<uint32_t>(leaf_place_ >> 3 * (h - leaf_height) & 7), node);
  }
  return {};
}

Result<Dag> DagBuilder::finish() {
  if (voxels_ > 0) {
    VOX_CHECK(close_leaf());
    VOX_CHECK(close_up_to(height_));
  }
  return pool_.finish(root_, voxels_);
}

}  // namespace voxkit::color
