// What a ray sees of a compressed surface whose voxels cover some of what is behind them: colours and
// opacities, looked up as it comes to them.
#pragma once

#include <algorithm>

#include "libcolor/attribute_reader.h"
#include "libcolor/store.h"
#include "libcolor/surface/morton.h"
#include "librender/cast/dag_grid.h"

namespace voxkit::render {

/// Cells are empty octants and voxels, whatever level of detail is enough.
template <Search search>
struct TranslucentView {
  const color::Volume* volume;
  const color::DagView* dag;
  bool light = false;  ///< what voxels emit, and not their colours

  class Cursor {
   public:
    explicit Cursor(const TranslucentView& view)
        : cells_(DagCastView<search>{view.dag}),
          finder_(*view.dag),
          colors_(view.volume->store(), view.volume->container(), view.volume->params()),
          opacities_(view.volume->store(), view.volume->container(), view.volume->params(),
                     color::Attribute::opacity) {
      if (view.light)
        lights_.emplace(view.volume->store(), view.volume->container(), view.volume->params(),
                        color::Attribute::emissive);
    }
    Cell locate(uint32_t x, uint32_t y, uint32_t z, int) {
      Cell cell = cells_.locate(x, y, z, -1);
      if (cell.value.template as<uint32_t>() == 0) return cell;
      const uint64_t index = finder_.find(color::morton_code(x, y, z), 0).color;
      // What is there is not void.
      const uint32_t alpha = std::max(opacities_.value(index), 1u) << 24;
      if (lights_) {
        cell.value = Voxel::of(lights_->value(index) | alpha);
      } else {
        const color::Rgb c = colors_.color(index);
        cell.value = Voxel::of(static_cast<uint32_t>(c.r | c.g << 8 | c.b << 16) | alpha);
      }
      return cell;
    }
    uint32_t blocks() const { return cells_.blocks(); }
    uint32_t bytes() const { return cells_.bytes(); }

   private:
    typename DagCastView<search>::Cursor cells_;
    color::CellFinder finder_;
    color::ColorReader colors_;
    color::AttributeReader opacities_;
    std::optional<color::AttributeReader> lights_;
  };
  Cursor cursor() const { return Cursor(*this); }
};

}  // namespace voxkit::render
