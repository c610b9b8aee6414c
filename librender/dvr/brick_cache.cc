#include "librender/dvr/brick_cache.h"

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

template <class T>
class DenseReader final : public BrickReader<T> {
 public:
  explicit DenseReader(std::shared_ptr<const DenseGrid> grid)
      : BrickReader<T>(bricks_of(grid->info())), grid_(std::move(grid)), view_(grid_->view()) {}
  void read(uint32_t x, uint32_t y, uint32_t z, T* values) override {
    every_value(x, y, z, grid_->info().dims, [&](int i, int64_t vx, int64_t vy, int64_t vz) {
      values[i] = value_of<T>(view_.at(vx, vy, vz));
    });
    this->count(x, y, z);
  }

 private:
  std::shared_ptr<const DenseGrid> grid_;
  DenseView view_;
};

template <class T>
class SvmmReader final : public BrickReader<T> {
 public:
  explicit SvmmReader(std::shared_ptr<const svmm::Volume> volume)
      : BrickReader<T>(bricks_of(volume->info())),
        volume_(std::move(volume)),
        pools_(*volume_),
        walk_(volume_->store().view, pools_) {}
  void read(uint32_t x, uint32_t y, uint32_t z, T* values) override {
    every_value(x, y, z, volume_->info().dims, [&](int i, int64_t vx, int64_t vy, int64_t vz) {
      const auto found =
          walk_.locate(static_cast<uint32_t>(vx), static_cast<uint32_t>(vy), static_cast<uint32_t>(vz), -1);
      values[i] = value_of<T>(found.value);
    });
    this->count(x, y, z);
  }

 private:
  std::shared_ptr<const svmm::Volume> volume_;
  svmm::MappedPools pools_;
  svmm::Walk<svmm::MappedPools> walk_;
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
template std::unique_ptr<BrickReader<uint16_t>> brick_reader(std::shared_ptr<const DenseGrid>);
template std::unique_ptr<BrickReader<float>> brick_reader(std::shared_ptr<const DenseGrid>);
template std::unique_ptr<BrickReader<uint16_t>> brick_reader(std::shared_ptr<const svmm::Volume>);
template std::unique_ptr<BrickReader<float>> brick_reader(std::shared_ptr<const svmm::Volume>);

}  // namespace voxkit::render
