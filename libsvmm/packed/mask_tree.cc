#include "libsvmm/packed/mask_tree.h"

#include <algorithm>
#include <mutex>
#include <tuple>

#include "libpage/mask.h"

namespace voxkit::svmm {
namespace {

/// 16^3 voxels: which of its 4^3 words are not 0, and these.
struct Brick {
  Index3 at{0};  ///< in bricks
  uint64_t mask = 0;
  std::array<uint64_t, 64> words{};
};

/// A brick of these voxels.
Brick brick_of(Index3 at, const page::Mask& mask) {
  Brick brick{at};
  for (size_t z = 0; z < page::max_side; ++z)
    for (size_t y = 0; y < page::max_side; ++y) {
      const uint64_t row = mask.rows[z * page::max_side + y];
      for (size_t x = 0; row != 0 && x < 4; ++x)
        brick.words[x + y / 4 * 4 + z / 4 * 16] |= (row >> 4 * x & 15) << (y % 4 * 4 + z % 4 * 16);
    }
  for (size_t i = 0; i < brick.words.size(); ++i)
    if (brick.words[i] != 0) brick.mask |= uint64_t{1} << i;
  return brick;
}

/// A node and where it is among those of its height.
struct Placed {
  Index3 at{0};
  MaskNode node;
};

/// The parents of nodes; these, in the order of their parents, become `children`.
std::vector<Placed> parents_of(std::vector<Placed> nodes, std::vector<MaskNode>& children) {
  const auto key = [](const Placed& placed) {
    const Index3 p = placed.at / int64_t{4}, c = placed.at % int64_t{4};
    return std::tuple(p.z, p.y, p.x, c.z, c.y, c.x);
  };
  std::sort(nodes.begin(), nodes.end(), [&](const Placed& a, const Placed& b) { return key(a) < key(b); });
  std::vector<Placed> parents;
  children.clear();
  for (const Placed& placed : nodes) {
    const Index3 parent = placed.at / int64_t{4};
    if (parents.empty() || parents.back().at != parent)
      parents.push_back({parent, {0, static_cast<uint32_t>(children.size())}});
    const Index3 c = placed.at % int64_t{4};
    parents.back().node.mask |= uint64_t{1} << (c.x + 4 * c.y + 16 * c.z);
    children.push_back(placed.node);
  }
  return parents;
}

}  // namespace

Result<std::shared_ptr<const MaskTree>> MaskTree::build(const PackedVolume& volume, Context& ctx) {
  const auto tree = std::make_shared<MaskTree>();
  tree->memory_.emplace(*ctx.memory);
  std::vector<Placed> nodes;
  std::mutex mutex;
  VOX_CHECK(volume.visit_masks(
      [&](Index3 lo, const page::Mask& mask) -> Status {
        const Brick brick = brick_of(lo / int64_t{page::max_side}, mask);
        const auto count = static_cast<uint64_t>(std::popcount(brick.mask));
        const std::lock_guard lock(mutex);
        if (tree->words_.size() + count > UINT32_MAX)
          return fail(ErrorCode::limit, volume.container().name(),
                      "too many solid voxels for rays: expected at most 2^32 cubes of 4^3");
        VOX_CHECK(
            tree->memory_->add(8 * count + sizeof(Placed) + sizeof(MaskNode), "masks of what is solid"));
        nodes.push_back({brick.at, {brick.mask, static_cast<uint32_t>(tree->words_.size())}});
        for (uint64_t left = brick.mask; left != 0; left &= left - 1)
          tree->words_.push_back(brick.words[static_cast<size_t>(std::countr_zero(left))]);
        return {};
      },
      ctx));
  int height = 2;
  const int64_t longest = std::max({volume.info().dims.x, volume.info().dims.y, volume.info().dims.z});
  while ((int64_t{1} << 2 * height) < longest) {
    nodes = parents_of(std::move(nodes), tree->nodes_[static_cast<size_t>(height)]);
    ++height;
  }
  tree->height_ = height;
  tree->nodes_[static_cast<size_t>(height)] = {nodes.empty() ? MaskNode{} : nodes[0].node};
  return tree;
}

MaskView MaskTree::view() const {
  MaskView view{words_.data(), {}, height_};
  for (size_t h = 0; h < nodes_.size(); ++h) view.nodes[h] = nodes_[h].data();
  return view;
}

}  // namespace voxkit::svmm
