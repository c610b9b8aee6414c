// Bricks of packed volumes of scalars, from pages that are decoded when a ray first comes there.
#include <array>
#include <glm/common.hpp>

#include "librender/dvr/brick_cache.h"
#include "librender/dvr/brick_ranges.h"
#include "libsvmm/packed/packed.h"

namespace voxkit::render {
namespace {

template <class T>
class PackedReader final : public BrickReader<T> {
 public:
  explicit PackedReader(std::shared_ptr<const svmm::PackedVolume> volume)
      : BrickReader<T>(bricks_of(volume->info_of(volume->finest()))),
        volume_(std::move(volume)),
        box_(volume_->info_of(volume_->finest()).box()),
        reader_(*volume_, volume_->finest()) {}

  void read(uint32_t x, uint32_t y, uint32_t z, T* values) override {
    const Index3 lo = Index3(x, y, z) * int64_t{dvr_brick};
    const Box box{lo, glm::min(lo + int64_t{slot_edge}, box_.hi)};
    const VoxelFormat format = volume_->info().format;
    alignas(float) std::array<std::byte, slot_values * sizeof(float)> bytes;
    if (auto read = reader_.read(box, packed(bytes.data(), box.size(), format)); !read) {
      this->fail(std::move(read).error());
      std::fill_n(values, slot_values, T{});
      return;
    }
    this->count(x, y, z);
    const Index3 size = box.size();
    const auto copy = [&]<class Stored>(Stored) {
      const auto* const from = reinterpret_cast<const Stored*>(bytes.data());
      for (int64_t k = 0; k < slot_edge; ++k)
        for (int64_t j = 0; j < slot_edge; ++j) {
          const Stored* const row =
              from + (std::min(k, size.z - 1) * size.y + std::min(j, size.y - 1)) * size.x;
          for (int64_t i = 0; i < slot_edge; ++i) *values++ = static_cast<T>(row[std::min(i, size.x - 1)]);
        }
    };
    if constexpr (std::is_floating_point_v<T>)
      copy(float());
    else if (voxel_bytes(format) == 1)
      copy(uint8_t());
    else
      copy(uint16_t());
  }

 private:
  std::shared_ptr<const svmm::PackedVolume> volume_;
  Box box_;
  svmm::PackedVolume::Reader reader_;
};

}  // namespace

template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const svmm::PackedVolume> volume) {
  return std::make_unique<PackedReader<T>>(std::move(volume));
}
template std::unique_ptr<BrickReader<uint16_t>> brick_reader(std::shared_ptr<const svmm::PackedVolume>);
template std::unique_ptr<BrickReader<float>> brick_reader(std::shared_ptr<const svmm::PackedVolume>);

}  // namespace voxkit::render
