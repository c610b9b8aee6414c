#include "libcolor/octree/octree_dag.h"

#include "libcolor/dag/dag_builder.h"
#include "libcolor/dag/dag_recount.h"

namespace voxkit::color {

Result<Dag> dag_of(OctreeReader& octree, Colors colors, Counts counts, Curve curve, const Context& ctx) {
  Context own = ctx;
  VOX_CHECK(octree.decode_all(own));
  DagBuilder builder(octree.height(), own);
  Status status;
  const Box all{Index3(0), Index3(int64_t{1} << octree.height())};
  octree.for_each_word(all, [&](uint64_t word, Index3 corner, uint64_t) {
    const Index3 cell = corner >> int64_t{leaf_height};
    status = builder.add_word(morton_code(static_cast<uint32_t>(cell.x), static_cast<uint32_t>(cell.y),
                                          static_cast<uint32_t>(cell.z)),
                              word);
    return status.has_value();
  });
  VOX_CHECK(std::move(status));
  VOX_TRY(Dag dag, builder.finish());
  dag.curve = curve;
  if (colors == Colors::leaf && counts == Counts::node) return dag;
  return recount(dag, colors, counts, curve, own);
}

}  // namespace voxkit::color
