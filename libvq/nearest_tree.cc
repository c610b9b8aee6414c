#include "libvq/nearest_tree.h"

#include <numeric>
#include <utility>

#include "formats/parallel.h"

namespace voxkit::vq {
namespace {

constexpr KeyBox empty_box = [] {
  KeyBox box{};
  box.least.fill(key_limit);
  box.most.fill(-key_limit);
  return box;
}();

void include(KeyBox& box, const std::array<int16_t, coarse_axes>& least,
             const std::array<int16_t, coarse_axes>& most) {
  for (size_t a = 0; a < coarse_axes; ++a) {
    box.least[a] = std::min(box.least[a], least[a]);
    box.most[a] = std::max(box.most[a], most[a]);
  }
}

constexpr int64_t block = 4096;  // bricks of a task

}  // namespace

/// Halves branches across the axis along which their keys vary most, down to the leaves.
struct BrickTree::Builder {
  BrickTree& tree;
  const std::vector<Key>& keys;

  size_t begin(const Branch& branch) const { return branch.first * leaf_bricks; }
  size_t end(const Branch& branch) const { return std::min(branch.last * leaf_bricks, tree.size()); }

  size_t widest_axis(const Branch& branch) const {
    std::array<double, coarse_axes> sum{}, squares{};
    const size_t step = std::max<size_t>(1, (end(branch) - begin(branch)) / 512);
    double count = 0;
    for (size_t i = begin(branch); i < end(branch); i += step, ++count)
      for (size_t a = 0; a < coarse_axes; ++a) {
        const double x = keys[tree.order_[i]].coarse[a];
        sum[a] += x;
        squares[a] += x * x;
      }
    for (size_t a = 0; a < coarse_axes; ++a) squares[a] -= sum[a] * sum[a] / count;
    return static_cast<size_t>(std::max_element(squares.begin(), squares.end()) - squares.begin());
  }

  void halve(const Branch& branch) const {
    const size_t axis = widest_axis(branch);
    std::vector<std::pair<int16_t, uint32_t>> along;
    along.reserve(end(branch) - begin(branch));
    for (size_t i = begin(branch); i < end(branch); ++i)
      along.emplace_back(keys[tree.order_[i]].coarse[axis], tree.order_[i]);
    const size_t middle = begin(branch.right()) - begin(branch);
    std::nth_element(along.begin(), along.begin() + static_cast<ptrdiff_t>(middle), along.end());
    for (size_t i = 0; i < along.size(); ++i) tree.order_[begin(branch) + i] = along[i].second;
  }

  void build(const Branch& branch) const {
    KeyBox& box = tree.boxes_[branch.node] = empty_box;
    if (branch.is_leaf()) {
      for (size_t i = begin(branch); i < end(branch); ++i)
        include(box, keys[tree.order_[i]].coarse, keys[tree.order_[i]].coarse);
      return;
    }
    halve(branch);
    build(branch.left());
    build(branch.right());
    join(branch);
  }
  /// The box around those of the children.
  void join(const Branch& branch) const {
    KeyBox& box = tree.boxes_[branch.node] = empty_box;
    for (const Branch& child : {branch.left(), branch.right()})
      include(box, tree.boxes_[child.node].least, tree.boxes_[child.node].most);
  }
};

Result<BrickTree> BrickTree::build(std::span<const Brick> bricks, const KeySpace& space, const Context& ctx) {
  BrickTree tree;
  const auto count = static_cast<int64_t>(bricks.size()), tasks = (count + block - 1) / block;
  std::vector<Key> keys(bricks.size());
  VOX_CHECK(parallel_for(ctx, tasks, [&](int64_t task) -> Status {
    for (int64_t i = task * block; i < std::min(count, (task + 1) * block); ++i)
      keys[static_cast<size_t>(i)] = space.key(bricks[static_cast<size_t>(i)]);
    return {};
  }));

  const size_t leaves = (bricks.size() + leaf_bricks - 1) / leaf_bricks;
  size_t width = 1;
  while (width < leaves) width *= 2;
  tree.order_.resize(bricks.size());
  std::iota(tree.order_.begin(), tree.order_.end(), 0u);
  tree.bricks_.resize(bricks.size());
  tree.leaves_.resize(leaves);
  tree.norms_.resize(leaves * leaf_bricks);
  tree.rests_.resize(bricks.size());
  tree.boxes_.resize(2 * width);

  // The upper levels one node after the other, then what is below them side by side.
  const Builder builder{tree, keys};
  std::vector<Branch> level{tree.root()}, above;
  while (level.size() < 64 && !level.front().is_leaf() && !level.back().is_leaf()) {
    std::vector<Branch> next;
    for (const Branch& branch : level) {
      builder.halve(branch);
      next.push_back(branch.left());
      next.push_back(branch.right());
    }
    above.insert(above.end(), level.begin(), level.end());
    level = std::move(next);
  }
  VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(level.size()), [&](int64_t i) -> Status {
    builder.build(level[static_cast<size_t>(i)]);
    return {};
  }));
  for (; !above.empty(); above.pop_back()) builder.join(above.back());

  VOX_CHECK(parallel_for(ctx, tasks, [&](int64_t task) -> Status {
    for (auto i = static_cast<size_t>(task * block);
         i < std::min(tree.size(), static_cast<size_t>((task + 1) * block)); ++i)
      tree.place(i, bricks[tree.order_[i]], keys[tree.order_[i]]);
    return {};
  }));
  return tree;
}

void BrickTree::place(size_t position, const Brick& brick, const Key& key) {
  bricks_[position] = brick;
  norms_[position] = key.norm;
  rests_[position] = key.coarse.back();
  Leaf& leaf = leaves_[position / leaf_bricks];
  for (int j = 0; j < fine_pairs; ++j)
    leaf[static_cast<size_t>(j)][position % leaf_bricks] = key_pair(key.fine, j);
}

Key BrickTree::key(size_t position) const {
  Key key;
  const Leaf& leaf = leaves_[position / leaf_bricks];
  for (size_t j = 0; j < fine_pairs; ++j)
    std::memcpy(&key.fine[2 * j], &leaf[j][position % leaf_bricks], sizeof(int32_t));
  std::copy_n(key.fine.begin(), coarse_axes - 1, key.coarse.begin());
  key.coarse.back() = rests_[position];
  key.norm = norms_[position];
  return key;
}

void BrickTree::replace(size_t position, const Brick& brick, const Key& key) {
  place(position, brick, key);
  Branch branch = root();
  include(boxes_[branch.node], key.coarse, key.coarse);
  while (!branch.is_leaf()) {
    branch = position / leaf_bricks < branch.right().first ? branch.left() : branch.right();
    include(boxes_[branch.node], key.coarse, key.coarse);
  }
}

std::vector<Branch> BrickTree::branches(size_t count) const {
  std::vector<Branch> level{root()};
  while (2 * level.size() <= count && !level.front().is_leaf() && !level.back().is_leaf()) {
    std::vector<Branch> next;
    for (const Branch& branch : level) {
      next.push_back(branch.left());
      next.push_back(branch.right());
    }
    level = std::move(next);
  }
  return level;
}

}  // namespace voxkit::vq
