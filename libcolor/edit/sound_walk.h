// A walk through the cells of a file that may say anything: it ends.
#pragma once

#include "libcolor/dag/box_walk.h"
#include "libcolor/store.h"

namespace voxkit::color {

/// Calls `visit`, which returns a Status, with the cells of height `stop` that touch a box, as BoxWalk does.
/// Nodes without voxels, which are of no surface, may be there any number of times: ErrorCode::input, as for
/// more cells than there are voxels. Signals are heard.
template <class Visit>
Status sound_walk(const Volume& volume, const DagView& view, const Box& box, int stop, const Visit& visit) {
  Status status;
  uint64_t cells = 0;
  const bool complete = BoxWalk(view, box, stop).run([&](const WalkedCell& cell) {
    constexpr uint64_t between_looks = 1 << 16;
    if (++cells > volume.params().leaf_voxels) return false;
    if (cell.height == leaf_height && view.leaf(cell.pointer) == 0) return false;
    if (cells % between_looks == 0) status = check_interrupt();
    if (status) status = visit(cell);
    return status.has_value();
  });
  if (status) status = volume.store().status();
  if (status && !complete)
    return bad_input(volume.container().name(), "chunk NODE: nodes or words without voxels, or too many");
  return status;
}

}  // namespace voxkit::color
