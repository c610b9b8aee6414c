#include "libcolor/dag/dag_recount.h"

#include "libcolor/dag/dag_pool.h"
#include "libcolor/dag/dag_view.h"

namespace voxkit::color {
namespace {

class Recounter {
 public:
  Recounter(const Dag& dag, Colors colors, Counts counts, Curve curve, Context& ctx)
      : view_(view_of(dag)),
        colors_(colors),
        states_differ_(counts == Counts::pointer),
        pool_(dag.height, colors, counts, curve, ctx),
        known_((static_cast<size_t>(dag.height) + 1) * order_states),
        reservation_(*ctx.memory) {}

  /// The new subtree for an old one.
  Result<Subtree> node(int h, uint32_t pointer, OrderState state) {
    if (h == leaf_height) return Subtree{pointer, leaf_colors(view_.leaf(pointer), colors_)};
    const OrderState own = states_differ_ ? state : morton_state;
    std::vector<Subtree>& known = known_[static_cast<size_t>(h) * order_states + own];
    if (known.empty()) {
      const uint64_t words = view_.words[static_cast<size_t>(h)];
      VOX_CHECK(reservation_.add(words * sizeof(Subtree), "a table of nodes with other counts"));
      known.resize(words);
    }
    if (known[pointer].colors != 0) return known[pointer];
    const NodeRef ref = view_.node(h, pointer);
    Octants octants;
    for (uint32_t octant = 0; octant < 8; ++octant) {
      if (!ref.has(octant)) continue;
      VOX_TRY(const Subtree child,
              node(h - 1, view_.pointer(ref, octant), octant_orders.next[state][octant]));
      octants.add(octant, child);
    }
    VOX_TRY(known[pointer], pool_.add_node(h, octants, own));
    VOX_CHECK(pool_.check_memory());
    return known[pointer];
  }
  Dag finish(Subtree root, uint64_t voxels) { return pool_.finish(root, voxels); }

 private:
  const DagView view_;
  Colors colors_;
  bool states_differ_;
  DagPool pool_;
  std::vector<std::vector<Subtree>> known_;  ///< by height and state: what old nodes have become
  Reservation reservation_;
};

}  // namespace

Result<Dag> recount(const Dag& dag, Colors colors, Counts counts, Curve curve, Context& ctx) {
  Recounter recounter(dag, colors, counts, curve, ctx);
  Subtree root;
  if (dag.voxels > 0) {
    VOX_TRY(root, recounter.node(dag.height, dag.root, first_state(curve)));
  }
  Dag recounted = recounter.finish(root, dag.voxels);
  recounted.leaves = dag.leaves;
  return recounted;
}

}  // namespace voxkit::color
