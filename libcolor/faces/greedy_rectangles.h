// Greedy meshing: the faces of a layer become rectangles of one colour.
// Source: M. Lysenko, "Meshing in a Minecraft Game", 0fps.net 2012: a rectangle begins at the first face, in
// rows, that none has; it is as wide as its colour goes on, and then as high as rows have all of that width.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace voxkit::color {

/// Faces u0 <= u < u1, v0 <= v < v1 of a layer.
struct LayerRectangle {
  uint32_t u0, v0, u1, v1;
  uint32_t color;
};

/// Takes the faces of a layer one by one, v ascending, in a row u ascending. What it remembers is two rows:
/// where there are no faces costs nothing.
class GreedyRectangles {
 public:
  using Emit = std::function<void(const LayerRectangle&)>;
  /// `emit` gets each rectangle when it is complete.
  explicit GreedyRectangles(Emit emit) : emit_(std::move(emit)) {}

  void add(uint32_t u, uint32_t v, uint32_t color) {
    if (!row_.empty()) {
      LayerRectangle& last = row_.back();
      if (last.v0 == v && last.u1 == u && last.color == color) {
        ++last.u1;
        return;
      }
      if (last.v0 != v) close_row();
    }
    row_.push_back({u, v, u + 1, v + 1, color});
  }
  /// The layer is complete; another one may begin.
  void finish();

 private:
  void close_row();

  Emit emit_;
  std::vector<LayerRectangle> row_;   ///< runs of the row that is read
  std::vector<LayerRectangle> open_;  ///< rectangles that reach to the row before it, ascending
  std::vector<LayerRectangle> next_;
};

}  // namespace voxkit::color
