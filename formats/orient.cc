#include "formats/orient.h"

#include <fmt/core.h>

#include <cstring>
#include <vector>

#include "formats/spool.h"

namespace voxkit {
namespace {

constexpr int64_t most_tile_bytes = int64_t{1} << 20;

class ReorderedSource final : public VolumeSource {
 public:
  ReorderedSource(std::unique_ptr<VolumeSource> source, const AxisOrder& order)
      : source_(std::move(source)), order_(order) {
    const VolumeInfo& from = source_->info();
    info_ = from;
    Affine::Vector first{};  // of the new volume's first voxel, in the old one
    for (size_t a = 0; a < 3; ++a) {
      const auto old = static_cast<size_t>(order.from[a]);
      info_.dims[static_cast<int>(a)] = from.dims[order.from[a]];
      info_.affine.axes[a] = from.affine.axes[old];
      if (!order.reversed[a]) continue;
      first[old] = static_cast<double>(from.dims[order.from[a]] - 1);
      for (double& x : info_.affine.axes[a]) x = 0 - x;
    }
    info_.affine.origin = from.affine.place(first);
  }
  bool forward_only() const override { return source_->forward_only(); }
  std::optional<Voxel> uniform(const Box& box) const override { return source_->uniform(old_box(box)); }
  void expect(int64_t z0, int64_t z1) const override {
    if (order_.from[2] == 2) source_->expect(old_slices(z0, z1).first, old_slices(z0, z1).second);
  }
  void release(int64_t z0, int64_t z1) const override {
    if (order_.from[2] == 2) source_->release(old_slices(z0, z1).first, old_slices(z0, z1).second);
  }

  Status read(const Box& box, VoxelSpan out) override {
    const int64_t bytes = voxel_bytes(info_.format);
    const Index3 size = box.size();
    // In parts that caches hold; a forward-only source wants whole slices.
    if (box.voxels() * bytes > most_tile_bytes && (!forward_only() || size.z > 1)) {
      const int axis = forward_only() || (size.z >= size.y && size.z >= size.x) ? 2
                       : size.y >= size.x                                       ? 1
                                                                                : 0;
      if (size[axis] > 1) {
        Box low = box, high = box;
        low.hi[axis] = high.lo[axis] = box.lo[axis] + size[axis] / 2;
        VOX_CHECK(read(low, out));
        const Index3 at = high.lo - box.lo;
        return read(high, {out.row(at.y, at.z) + at.x * bytes, out.row_stride, out.slice_stride});
      }
    }
    const Box old = old_box(box);
    const Index3 old_size = old.size();
    const size_t needed = static_cast<size_t>(old.voxels() * bytes);
    std::vector<std::byte> voxels(needed);
    VOX_CHECK(source_->read(old, packed(voxels.data(), old_size, info_.format)));
    const int64_t strides[3] = {bytes, old_size.x * bytes, old_size.x * old_size.y * bytes};
    int64_t step[3], start = 0;
    for (int a = 0; a < 3; ++a) {
      const auto axis = static_cast<size_t>(a);
      step[a] = strides[order_.from[axis]];
      if (!order_.reversed[axis]) continue;
      start += step[a] * (size[a] - 1);
      step[a] = -step[a];
    }
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y) {
        const std::byte* from = voxels.data() + start + y * step[1] + z * step[2];
        std::byte* to = out.row(y, z);
        if (step[0] == bytes) {
          std::memcpy(to, from, static_cast<size_t>(size.x * bytes));
          continue;
        }
        switch (bytes) {
          case 1:
            move<1>(from, step[0], size.x, to);
            break;
          case 2:
            move<2>(from, step[0], size.x, to);
            break;
          case 3:
            move<3>(from, step[0], size.x, to);
            break;
          default:
            move<4>(from, step[0], size.x, to);
        }
      }
    return {};
  }

 private:
  template <int bytes>
  static void move(const std::byte* from, int64_t step, int64_t count, std::byte* to) {
    for (int64_t x = 0; x < count; ++x, from += step, to += bytes) std::memcpy(to, from, bytes);
  }
  Box old_box(const Box& box) const {
    Box old;
    for (size_t a = 0; a < 3; ++a) {
      const int axis = order_.from[a], now = static_cast<int>(a);
      const int64_t side = info_.dims[now];
      old.lo[axis] = order_.reversed[a] ? side - box.hi[now] : box.lo[now];
      old.hi[axis] = order_.reversed[a] ? side - box.lo[now] : box.hi[now];
    }
    return old;
  }
  std::pair<int64_t, int64_t> old_slices(int64_t z0, int64_t z1) const {
    if (!order_.reversed[2]) return {z0, z1};
    return {info_.dims.z - z1, info_.dims.z - z0};
  }

  std::unique_ptr<VolumeSource> source_;
  AxisOrder order_;
};

}  // namespace

bool AxisOrder::is_identity() const {
  return from == std::array<int, 3>{0, 1, 2} && reversed == std::array<bool, 3>{};
}

Result<std::unique_ptr<VolumeSource>> reordered(std::unique_ptr<VolumeSource> source, const AxisOrder& order,
                                                Context& ctx) {
  if (order.is_identity()) return source;
  if (source->forward_only() && (order.from[2] != 2 || order.reversed[2])) {
    VOX_TRY(source, spooled(std::move(source), ctx));
  }
  return std::make_unique<ReorderedSource>(std::move(source), order);
}

Result<AxisOrder> order_for(std::string_view wanted, const VolumeInfo& info) {
  const bool anatomical = is_anatomical(info.world);
  const bool canonical = wanted == "canonical";
  const auto wrong = [&] {
    return bad_usage(fmt::format(
        "--orient {}: expected canonical, or three letters, one of L and R, of P and A, of I and S "
        "each, such as RAS or LPI",
        wanted));
  };
  std::array<int, 3> axis{0, 1, 2};                // of the world, for each new axis
  std::array<bool, 3> positive{true, true, true};  // towards R, A and S, or +x, +y and +z
  if (!canonical) {
    if (wanted.size() != 3) return wrong();
    int seen = 0;
    for (size_t a = 0; a < 3; ++a) {
      const size_t up = std::string_view("RAS").find(wanted[a]),
                   down = std::string_view("LPI").find(wanted[a]);
      if (up == std::string_view::npos && down == std::string_view::npos) return wrong();
      positive[a] = up != std::string_view::npos;
      axis[a] = static_cast<int>(positive[a] ? up : down);
      seen |= 1 << axis[a];
    }
    if (seen != 7) return wrong();
    if (!anatomical)
      return bad_usage(
          fmt::format("--orient {}: the volume does not say where a patient's sides are (its world is {}): "
                      "expected canonical",
                      wanted, name(info.world)));
  }
  const Affine affine = anatomical ? in_world(info.affine, info.world, World::ras) : info.affine;
  const auto partners = nearest_axes(affine);
  AxisOrder order;
  for (size_t a = 0; a < 3; ++a)
    for (size_t old = 0; old < 3; ++old)
      if (partners[old] == axis[a]) {
        order.from[a] = static_cast<int>(old);
        order.reversed[a] = (affine.axes[old][static_cast<size_t>(axis[a])] >= 0) != positive[a];
      }
  return order;
}

}  // namespace voxkit
