// Walking from voxel to voxel along the path of ancestors (thesis sections 3.1 and 3.2.2).
#include <bit>

#include "libsvmm/base_block.h"
#include "libsvmm/store.h"

namespace voxkit::svmm {

Path::Path(const Volume& volume)
    : volume_(&volume), root_(static_cast<int>(volume.levels_.size()) - 1), level_(root_) {
  for (int k = 0; k <= root_; ++k)
    shift_[static_cast<size_t>(k)] = std::countr_zero(volume.levels_[static_cast<size_t>(k)].mip_factor);
  const auto root = volume.store_->block(volume, static_cast<size_t>(root_), 0);
  if (root)
    steps_[static_cast<size_t>(root_)].block = *root;
  else
    status_ = tl::unexpected<Error>(root.error());
}

void Path::locate(Index3 v, double finest) {
  const VoxelFormat format = volume_->info_.format;
  const Params& params = volume_->params_;
  value_ = {};
  cell_ = volume_->info_.box();
  if (!status_) return;

  const auto down = [&](int k) {
    return Index3(v.x >> shift_[static_cast<size_t>(k)], v.y >> shift_[static_cast<size_t>(k)],
                  v.z >> shift_[static_cast<size_t>(k)]);
  };
  // Up to the first block that holds the voxel (the root does) and whose own equivalent voxel is not fine
  // enough already.
  while (level_ < root_) {
    const Step& step = steps_[static_cast<size_t>(level_)];
    const Index3 in_block = down(level_) - step.origin;
    const auto w = static_cast<uint64_t>(volume_->levels_[static_cast<size_t>(level_)].blockwidth);
    if (static_cast<uint64_t>(in_block.x) < w && static_cast<uint64_t>(in_block.y) < w &&
        static_cast<uint64_t>(in_block.z) < w &&
        static_cast<double>(int64_t{1} << shift_[static_cast<size_t>(level_) + 1]) > finest)
      break;
    ++level_;
  }
  for (;;) {
    const auto k = static_cast<size_t>(level_);
    const Step& step = steps_[k];
    const Index3 size = volume_->store_->levels[k].size, at = down(level_), in_block = at - step.origin;
    const auto set_cell = [&](const Voxel& value) {
      const int64_t edge = int64_t{1} << shift_[k];
      value_ = value;
      cell_ = intersect({at * edge, (at + Index3(1)) * edge}, cell_);
    };
    if (level_ == 0) {
      set_cell(
          decode_base_voxel(step.block, size, in_block, format, params.base, params.layout, step.parent));
      return;
    }
    const StructuralBlock here{step.block, size, format, params.layout};
    const int64_t index = voxel_index(in_block, size);
    const Link link = here.link(index / 8);
    const Voxel value = here.value(index);
    const int i = static_cast<int>(index % 8);
    if (!(link.mask >> i & 1u) || static_cast<double>(int64_t{1} << shift_[k]) <= finest) {
      set_cell(decoded_value(value, format));
      return;
    }
    const auto child = volume_->store_->block(*volume_, k - 1, link.child(i));
    if (!child) {
      status_ = tl::unexpected<Error>(child.error());
      return;
    }
    ++blocks_entered_;
    steps_[k - 1] = {*child, at * int64_t{volume_->levels_[k - 1].blockwidth}, value};
    --level_;
  }
}

}  // namespace voxkit::svmm
