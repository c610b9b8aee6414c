#include "librender/brick_cache.h"

#include <array>
#include <type_traits>

#include "libvq/store.h"

namespace voxkit::render {
namespace {

/// Calls put(i, x, y, z) for the values of a slot, the coordinates clamped to the volume.
template <class Put>
void every_value(uint32_t x, uint32_t y, uint32_t z, const Index3& dims, const Put& put) {
  const auto clamped = [](uint32_t v, int64_t side) { return std::min<int64_t>(v, side - 1); };
  int i = 0;
  for (uint32_t k = 0; k < slot_edge; ++k)
    for (uint32_t j = 0; j < slot_edge; ++j)
      for (uint32_t n = 0; n < slot_edge; ++n)
        put(i++, clamped(4 * x + n, dims.x), clamped(4 * y + j, dims.y), clamped(4 * z + k, dims.z));
}

/// A stored value: integers as they are.
template <class T>
T value_of(const Voxel& voxel) {
  if constexpr (std::is_floating_point_v<T>)
    return voxel.as<float>();
  else
    return static_cast<T>(voxel.as<uint32_t>());
}

template <class T>
class DenseReader final : public BrickReader<T> {
 public:
  explicit DenseReader(std::shared_ptr<const DenseGrid> grid)
      : grid_(std::move(grid)), view_(grid_->view()) {}
  void read(uint32_t x, uint32_t y, uint32_t z, T* values) override {
    every_value(x, y, z, grid_->info().dims, [&](int i, int64_t vx, int64_t vy, int64_t vz) {
      values[i] = value_of<T>(view_.at(vx, vy, vz));
    });
    ++this->decoded_;
  }

 private:
  std::shared_ptr<const DenseGrid> grid_;
  DenseView view_;
};

template <class T>
class SvmmReader final : public BrickReader<T> {
 public:
  explicit SvmmReader(std::shared_ptr<const svmm::Volume> volume)
      : volume_(std::move(volume)), pools_(*volume_), walk_(volume_->store().view, pools_) {}
  void read(uint32_t x, uint32_t y, uint32_t z, T* values) override {
    every_value(x, y, z, volume_->info().dims, [&](int i, int64_t vx, int64_t vy, int64_t vz) {
      const auto found =
          walk_.locate(static_cast<uint32_t>(vx), static_cast<uint32_t>(vy), static_cast<uint32_t>(vz), -1);
      values[i] = value_of<T>(found.value);
    });
    ++this->decoded_;
  }

 private:
  std::shared_ptr<const svmm::Volume> volume_;
  svmm::MappedPools pools_;
  svmm::Walk<svmm::MappedPools> walk_;
};

template <class T>
class VqReader final : public BrickReader<T> {
 public:
  explicit VqReader(std::shared_ptr<const vq::Volume> volume)
      : volume_(std::move(volume)),
        pools_(*volume_),
        reader_(volume_->view(), pools_),
        bricks_(volume_->bricks()),
        decoded_bricks_(slots) {
    const vq::Params& params = volume_->params();
    const double most = volume_->info().format == VoxelFormat::density16 ? 65535 : 255;
    offset_ = static_cast<uint16_t>(params.base);
    // Codes that are values less a constant, none of them too large.
    if constexpr (!std::is_floating_point_v<T>)
      only_offset_ = params.step == 1 && params.base >= 0 &&
                     params.base + static_cast<double>((1 << params.bits) - 1) <= most;
  }

  void read(uint32_t x, uint32_t y, uint32_t z, T* values) override {
    const auto X = static_cast<uint32_t>(bricks_.x), Y = static_cast<uint32_t>(bricks_.y),
               Z = static_cast<uint32_t>(bricks_.z);
    const Index3& dims = volume_->info().dims;
    const auto place = [&](uint32_t i, uint32_t j, uint32_t k) {
      return values + (k * slot_edge + j) * slot_edge + i;
    };
    // Bricks beyond the edge are left out, and so is what a partial brick is filled up with.
    const uint32_t wx = within(x, X, dims.x), wy = within(y, Y, dims.y), wz = within(z, Z, dims.z);
    for (uint32_t k = 0; k < wz; k += vq::brick_edge)
      for (uint32_t j = 0; j < wy; j += vq::brick_edge)
        for (uint32_t i = 0; i < wx; i += vq::brick_edge) {
          const T* const brick = decode(x + i / 4, y + j / 4, z + k / 4);
          const uint32_t ni = std::min(wx - i, 4u), nj = std::min(wy - j, 4u), nk = std::min(wz - k, 4u);
          for (uint32_t c = 0; c < nk; ++c)
            for (uint32_t b = 0; b < nj; ++b) {
              const T* const from = brick + 4 * b + 16 * c;
              T* const to = place(i, j + b, k + c);
              if (ni == 4)
                std::memcpy(to, from, 4 * sizeof(T));
              else
                for (uint32_t a = 0; a < ni; ++a) to[a] = from[a];
            }
        }
    // Up to the edge, and from there on as at the edge.
    for (uint32_t k = 0; k < wz; ++k)
      for (uint32_t j = 0; j < wy; ++j)
        for (uint32_t i = wx; i < slot_edge; ++i) *place(i, j, k) = *place(wx - 1, j, k);
    for (uint32_t k = 0; k < wz; ++k)
      for (uint32_t j = wy; j < slot_edge; ++j) std::copy_n(place(0, wy - 1, k), slot_edge, place(0, j, k));
    for (uint32_t k = wz; k < slot_edge; ++k)
      std::copy_n(place(0, 0, wz - 1), slot_edge * slot_edge, place(0, 0, k));
  }
  void forget() override { std::fill(ids_.begin(), ids_.end(), reader_.no_brick); }

 private:
  static constexpr uint32_t slots = 4096;
  static uint32_t within(uint32_t brick, uint32_t bricks, int64_t side) {
    return brick + 1 < bricks ? slot_edge : static_cast<uint32_t>(side - int64_t{brick} * vq::brick_edge);
  }

  const T* decode(uint32_t x, uint32_t y, uint32_t z) {
    const uint64_t id = reader_.brick_id(x, y, z);
    const uint64_t slot = id % slots;
    auto& values = decoded_bricks_[slot];
    if (ids_[slot] == id && id != reader_.no_brick) return values.data();
    ids_[slot] = id;
    vq::Record record;
    alignas(32) uint16_t codes[vq::brick_voxels];
    const bool found = id != reader_.no_brick && reader_.find(id, record);
    if (found && record.range.min == record.range.max) {
      values.fill(value_of<T>(volume_->voxel_of(record.range.min)));
      return values.data();
    }
    ++this->decoded_;
    if (!found || !reader_.decode(record, codes)) {
      damaged_ = true;
      std::fill_n(codes, vq::brick_voxels, uint16_t{0});
    }
    if (only_offset_) {
      for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<T>(codes[i] + offset_);
    } else {
      for (size_t i = 0; i < values.size(); ++i) values[i] = value_of<T>(volume_->voxel_of(codes[i]));
    }
    return values.data();
  }

  std::shared_ptr<const vq::Volume> volume_;
  vq::MappedPools pools_;
  vq::Reader<vq::MappedPools> reader_;
  Index3 bricks_;
  bool only_offset_ = false, damaged_ = false;
  uint16_t offset_ = 0;
  std::vector<std::array<T, vq::brick_voxels>> decoded_bricks_;
  std::vector<uint64_t> ids_ = std::vector<uint64_t>(slots, vq::Reader<vq::MappedPools>::no_brick);
};

}  // namespace

template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const DenseGrid> grid) {
  return std::make_unique<DenseReader<T>>(std::move(grid));
}
template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const svmm::Volume> volume) {
  return std::make_unique<SvmmReader<T>>(std::move(volume));
}
template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const vq::Volume> volume) {
  return std::make_unique<VqReader<T>>(std::move(volume));
}

template std::unique_ptr<BrickReader<uint16_t>> brick_reader(std::shared_ptr<const DenseGrid>);
template std::unique_ptr<BrickReader<float>> brick_reader(std::shared_ptr<const DenseGrid>);
template std::unique_ptr<BrickReader<uint16_t>> brick_reader(std::shared_ptr<const svmm::Volume>);
template std::unique_ptr<BrickReader<float>> brick_reader(std::shared_ptr<const svmm::Volume>);
template std::unique_ptr<BrickReader<uint16_t>> brick_reader(std::shared_ptr<const vq::Volume>);
template std::unique_ptr<BrickReader<float>> brick_reader(std::shared_ptr<const vq::Volume>);

}  // namespace voxkit::render
