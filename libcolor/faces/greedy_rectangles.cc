#include "libcolor/faces/greedy_rectangles.h"

#include <utility>

namespace voxkit::color {

/// Each open rectangle takes its width out of a run that has all of it and its colour; what is left of runs
/// begins new ones. Runs and rectangles ascend, so both are gone through once.
void GreedyRectangles::close_row() {
  next_.clear();
  const uint32_t v = row_.front().v0;
  size_t run = 0;
  uint32_t from = row_.front().u0;  // what is left of the run
  const auto begin_new = [&](uint32_t to) {
    if (from < to) next_.push_back({from, v, to, v + 1, row_[run].color});
  };
  for (const LayerRectangle& open : open_) {
    while (run < row_.size() && row_[run].u1 <= open.u0) {
      begin_new(row_[run].u1);
      if (++run < row_.size()) from = row_[run].u0;
    }
    const bool goes_on = open.v1 == v && run < row_.size() && row_[run].u0 <= open.u0 &&
                         open.u1 <= row_[run].u1 && row_[run].color == open.color;
    if (!goes_on) {
      emit_(open);
      continue;
    }
    begin_new(open.u0);
    next_.push_back({open.u0, open.v0, open.u1, v + 1, open.color});
    from = open.u1;
  }
  while (run < row_.size()) {
    begin_new(row_[run].u1);
    if (++run < row_.size()) from = row_[run].u0;
  }
  std::swap(open_, next_);
  row_.clear();
}

void GreedyRectangles::finish() {
  if (!row_.empty()) close_row();
  for (const LayerRectangle& open : open_) emit_(open);
  open_.clear();
}

}  // namespace voxkit::color
