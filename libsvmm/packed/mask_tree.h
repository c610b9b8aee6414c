// Which voxels of a volume of colours are solid, as a tree of 64-bit masks: what rays go through.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "formats/context.h"
#include "formats/hd.h"
#include "formats/reservation.h"
#include "libsvmm/packed/packed.h"

namespace voxkit::svmm {

/// Which of 4^3 children there are: bit x + 4 y + 16 z. They stand one after another in that order.
struct MaskNode {
  uint64_t mask = 0;
  uint32_t first = 0;  ///< of its children, among the nodes, or words, of the next height

  VOX_HD_HOT uint32_t child(uint32_t bit) const {
    return first + static_cast<uint32_t>(std::popcount(mask & ((uint64_t{1} << bit) - 1)));
  }
};

/// A tree in memory. A node of height h has an edge of 4^h voxels; words, of height 1, have a bit for each of
/// 4^3 voxels.
struct MaskView {
  static constexpr int most_heights = 16;
  const uint64_t* words;
  const MaskNode* nodes[most_heights];  ///< by height, 2 to `height`
  int height;                           ///< of the root, which is node 0; at least 2
};
/// Of a voxel in its node of height h.
VOX_HD_HOT uint32_t mask_bit(uint32_t x, uint32_t y, uint32_t z, int h) {
  const int shift = 2 * (h - 1);
  return (x >> shift & 3) | (y >> shift & 3) << 2 | (z >> shift & 3) << 4;
}

/// The tree of level 0 of a volume of colours. Memory: 8 bytes for each 4^3 voxels that are not all void, and
/// 16 for each 16^3, counted in ctx.memory as long as it lives.
class MaskTree {
 public:
  /// Decodes all masks, and no colours. Errors: ErrorCode::input for damaged masks; ErrorCode::limit.
  static Result<std::shared_ptr<const MaskTree>> build(const PackedVolume& volume, Context& ctx);
  MaskView view() const;

 private:
  std::vector<uint64_t> words_;
  std::array<std::vector<MaskNode>, MaskView::most_heights> nodes_;
  int height_ = 2;
  std::optional<Reservation> memory_;
};

}  // namespace voxkit::svmm
