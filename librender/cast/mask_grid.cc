#include "librender/cast/mask_grid.h"

#include "librender/cast/void_memo.h"

namespace voxkit::render {
namespace {

/// For each axis, the bits of children that are at from <= place < to along it.
using Slabs = std::array<std::array<std::array<uint64_t, 5>, 5>, 3>;  ///< [axis][from][to]
constexpr Slabs make_slabs() {
  Slabs slabs{};
  for (size_t axis = 0; axis < 3; ++axis)
    for (uint32_t from = 0; from < 5; ++from)
      for (uint32_t to = from; to < 5; ++to)
        for (uint32_t bit = 0; bit < 64; ++bit) {
          const uint32_t place = bit >> 2 * axis & 3;
          if (place >= from && place < to) slabs[axis][from][to] |= uint64_t{1} << bit;
        }
  return slabs;
}
constexpr Slabs slabs = make_slabs();

}  // namespace

bool MaskVoidSearch::is_void(int h, uint32_t index, const Corner& corner) {
  if (--budget_ < 0) return false;
  const int shift = 2 * (h - 1);  // of children
  uint64_t left = h == 1 ? tree_.words[index] : tree_.nodes[h][index].mask;
  for (size_t a = 0; a < 3; ++a) {
    const uint32_t from = lo_[a] > corner[a] ? (lo_[a] - corner[a]) >> shift : 0,
                   to = std::min(((hi_[a] - 1 - corner[a]) >> shift) + 1, 4u);
    left &= slabs[a][from][to];
  }
  for (; left != 0; left &= left - 1) {
    const auto bit = static_cast<uint32_t>(std::countr_zero(left));
    const Corner at = {corner[0] + ((bit & 3) << shift), corner[1] + ((bit >> 2 & 3) << shift),
                       corner[2] + ((bit >> 4 & 3) << shift)};
    if (h == 1) {
      at_ = at;
      found_ = true;
      return false;
    }
    if (!is_void(h - 1, tree_.nodes[h][index].child(bit), at)) return false;
  }
  return true;
}

bool MaskGrid::fits(const svmm::PackedVolume& volume) {
  if (volume.finest() > 0) return false;
  return volume.info().format == VoxelFormat::rgb24 ||
         (volume.info().format == VoxelFormat::rgba32 && volume.params().opaque);
}

Result<MaskGrid> MaskGrid::open(std::shared_ptr<const svmm::PackedVolume> volume, Context& ctx) {
  MaskGrid grid;
  grid.info_ = volume->info();
  grid.info_.format = VoxelFormat::rgba32;
  VOX_TRY(grid.tree_, svmm::MaskTree::build(*volume, ctx));
  grid.volume_ = std::move(volume);
  grid.learned_ = std::make_shared<LearnedVoid>();
  return grid;
}

}  // namespace voxkit::render
