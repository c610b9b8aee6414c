// The second passes over a picture: rows of pixels, on all threads.
#pragma once

#include <algorithm>
#include <cstddef>

#include "formats/parallel.h"
#include "librender/frame.h"

namespace voxkit::render {

/// Calls `visit(worker, i)` for each pixel i of `frame`, row by row, since neighbours mostly lie in one
/// block; `make` makes a worker for each task of sixteen rows. Errors: those of parallel_for.
template <class Make, class Visit>
Status for_each_pixel(const Frame& frame, Context& ctx, const Make& make, const Visit& visit) {
  constexpr int rows = 16;
  return parallel_for(ctx, (frame.height + rows - 1) / rows, [&](int64_t task) -> Status {
    auto worker = make();
    const int64_t first = task * rows, last = std::min<int64_t>(first + rows, frame.height);
    for (int64_t i = first * frame.width; i < last * frame.width; ++i) visit(worker, static_cast<size_t>(i));
    return {};
  });
}

}  // namespace voxkit::render
