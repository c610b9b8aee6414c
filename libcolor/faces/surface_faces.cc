#include "libcolor/faces/surface_faces.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

#include "formats/parallel.h"
#include "formats/reservation.h"
#include "libcolor/faces/greedy_rectangles.h"
#include "libcolor/surface/morton.h"

namespace voxkit::color {
namespace {

/// A voxel of a layer: its place along the two axes of that, and its colour, R lowest.
struct LayerVoxel {
  uint32_t u, v;
  uint32_t color;
  uint64_t key() const { return uint64_t{v} << 32 | u; }
};
using Layer = std::span<const LayerVoxel>;

std::array<uint8_t, 3> rgb(uint32_t color) {
  return {static_cast<uint8_t>(color), static_cast<uint8_t>(color >> 8), static_cast<uint8_t>(color >> 16)};
}

/// Goes along a layer with keys that ascend, and tells whether there is a voxel.
class Along {
 public:
  explicit Along(Layer layer) : layer_(layer) {}
  bool has(uint64_t key) {
    while (at_ < layer_.size() && layer_[at_].key() < key) ++at_;
    return at_ < layer_.size() && layer_[at_].key() == key;
  }

 private:
  Layer layer_;
  size_t at_ = 0;
};

/// Voxels of each layer, along each axis.
using Counts = std::array<std::vector<uint64_t>, 3>;

class Faces {
 public:
  Faces(const Box& box, const VoxelsOfBox& voxels, const FaceSink& sink, Context& ctx)
      : box_(box), read_(voxels), sink_(sink), ctx_(ctx) {}

  Status run() {
    const Index3 size = box_.size();
    VOX_TRY(const Reservation memory,
            Reservation::take(sizeof(uint64_t) * static_cast<uint64_t>(size.x + size.y + size.z),
                              "counting a surface's layers", ctx_));
    for (size_t axis = 0; axis < 3; ++axis) counts_[axis].resize(static_cast<size_t>(side(axis)));
    VOX_CHECK(read_(box_, [&](std::span<const SurfaceVoxel> run) -> Status {
      for (const SurfaceVoxel& voxel : run) {
        const auto at = place(voxel);
        for (size_t axis = 0; axis < 3; ++axis) ++counts_[axis][at[axis]];
      }
      return {};
    }));
    for (size_t axis = 0; axis < 3; ++axis)
      for (int64_t first = 0; first < side(axis);) {
        const int64_t end = slab_end(axis, first);
        VOX_CHECK(slab(axis, first, end));
        first = end;
        ctx_.progress(
            (static_cast<double>(axis) + static_cast<double>(end) / static_cast<double>(side(axis))) / 3);
      }
    return {};
  }

 private:
  int64_t side(size_t axis) const { return box_.size()[static_cast<Index3::length_type>(axis)]; }
  std::array<uint32_t, 3> place(const SurfaceVoxel& voxel) const {
    const auto at = morton_place(voxel.place);
    return {at.x - static_cast<uint32_t>(box_.lo.x), at.y - static_cast<uint32_t>(box_.lo.y),
            at.z - static_cast<uint32_t>(box_.lo.z)};
  }

  /// Layers up to which a slab takes as much memory as it may, and one at least.
  int64_t slab_end(size_t axis, int64_t first) const {
    const auto& counts = counts_[axis];
    const auto count = [&](int64_t layer) {
      return layer >= 0 && layer < side(axis) ? counts[static_cast<size_t>(layer)] : 0;
    };
    const uint64_t most = ctx_.memory->limit() / 4 / sizeof(LayerVoxel);
    uint64_t voxels = count(first - 1) + count(first) + count(first + 1);
    int64_t end = first + 1;
    while (end < side(axis) && voxels + count(end + 1) <= most) voxels += count(++end);
    return end;
  }

  /// The faces of layers first <= w < end.
  Status slab(size_t axis, int64_t first, int64_t end) {
    // With the layers beside them.
    const int64_t from = std::max<int64_t>(first - 1, 0), to = std::min(end + 1, side(axis));
    const auto& counts = counts_[axis];
    std::vector<uint64_t> ends(static_cast<size_t>(to - from) + 1);
    std::partial_sum(counts.begin() + from, counts.begin() + to, ends.begin() + 1);
    if (ends.back() == 0) return {};
    VOX_TRY(const Reservation memory,
            Reservation::take(sizeof(LayerVoxel) * ends.back() + 2 * sizeof(uint64_t) * ends.size(),
                              "layers of a surface", ctx_));
    std::vector<LayerVoxel> voxels(ends.back());
    std::vector<uint64_t> next(ends.begin(), ends.end() - 1);
    Box part = box_;
    const auto a = static_cast<Index3::length_type>(axis);
    part.hi[a] = part.lo[a] + to;
    part.lo[a] += from;
    const size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    VOX_CHECK(read_(part, [&](std::span<const SurfaceVoxel> run) -> Status {
      for (const SurfaceVoxel& voxel : run) {
        const auto at = place(voxel);
        const auto layer = static_cast<size_t>(at[axis] - from);
        if (next[layer] == ends[layer + 1])
          return fail(ErrorCode::internal, {}, "a surface that has other voxels than before");
        const Rgb c = voxel.color;
        voxels[next[layer]++] = {at[u], at[v], uint32_t{c.r} | uint32_t{c.g} << 8 | uint32_t{c.b} << 16};
      }
      return {};
    }));
    VOX_CHECK(parallel_for(ctx_, to - from, [&](int64_t i) -> Status {
      const auto layer = static_cast<size_t>(i);
      const auto begin = voxels.begin();
      std::sort(begin + static_cast<ptrdiff_t>(ends[layer]), begin + static_cast<ptrdiff_t>(next[layer]),
                [](const LayerVoxel& x, const LayerVoxel& y) { return x.key() < y.key(); });
      return {};
    }));
    const auto layer_at = [&](int64_t w) {
      if (w < from || w >= to) return Layer();
      const auto layer = static_cast<size_t>(w - from);
      return Layer(voxels).subspan(ends[layer], next[layer] - ends[layer]);
    };
    for (int64_t w = first; w < end; ++w) {
      VOX_CHECK(check_interrupt());
      VOX_CHECK(layer(axis, w, layer_at(w), layer_at(w - 1), layer_at(w + 1)));
    }
    return flush(true);
  }

  Status layer(size_t axis, int64_t w, Layer voxels, Layer before, Layer behind) {
    const auto put = [&](bool positive, const LayerRectangle& r) {
      FaceRectangle& face = faces_.emplace_back();
      face.color = rgb(r.color);
      face.axis = static_cast<uint8_t>(axis);
      face.positive = positive;
      face.plane = static_cast<int32_t>(w + positive);
      face.lo = {static_cast<int32_t>(r.u0), static_cast<int32_t>(r.v0)};
      face.hi = {static_cast<int32_t>(r.u1), static_cast<int32_t>(r.v1)};
    };
    GreedyRectangles backwards([&](const LayerRectangle&r) { put(false, r); }),
        forwards([&](const LayerRectangle&r) { put(true, r); });
    Along below(before), above(behind), row_before(voxels), row_behind(voxels);
    for (size_t i = 0; i < voxels.size(); ++i) {
      const LayerVoxel& voxel = voxels[i];
      const uint64_t key = voxel.key();
      const bool is_below = below.has(key), is_above = above.has(key);
      if (!is_below) backwards.add(voxel.u, voxel.v, voxel.color);
      if (!is_above) forwards.add(voxel.u, voxel.v, voxel.color);
      // Neighbours in the layer, along the first axis only: once for each voxel.
      if (axis == 0 && is_below && is_above) {
        const bool between = i > 0 && voxels[i - 1].key() + 1 == key && i + 1 < voxels.size() &&
                             voxels[i + 1].key() == key + 1;
        constexpr uint64_t row = uint64_t{1} << 32;
        if (between && voxel.v > 0 && row_before.has(key - row) && row_behind.has(key + row))
          enclosed_.push_back(
              {{static_cast<int32_t>(w), static_cast<int32_t>(voxel.u), static_cast<int32_t>(voxel.v)},
               rgb(voxel.color)});
      }
      VOX_CHECK(flush(false));
    }
    backwards.finish();
    forwards.finish();
    return flush(false);
  }

  Status flush(bool all) {
    const size_t least = all ? 1 : size_t{1} << 14;
    if (faces_.size() >= least) {
      VOX_CHECK(sink_.faces(faces_));
      faces_.clear();
    }
    if (enclosed_.size() >= least) {
      VOX_CHECK(sink_.enclosed(enclosed_));
      enclosed_.clear();
    }
    return {};
  }

  Box box_;
  const VoxelsOfBox& read_;
  const FaceSink& sink_;
  Context& ctx_;
  Counts counts_;
  std::vector<FaceRectangle> faces_;
  std::vector<ModelVoxel> enclosed_;
};

}  // namespace

Status surface_faces(const Box& box, const VoxelsOfBox& voxels, const FaceSink& sink, Context& ctx) {
  return Faces(box, voxels, sink, ctx).run();
}

}  // namespace voxkit::color
