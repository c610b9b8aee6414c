#include "libsvmm/packed/indexed_colors.h"

#include <algorithm>
#include <cstring>
#include <set>
#include <unordered_map>

#include "formats/copy.h"

namespace voxkit::svmm {
namespace {

uint32_t bits_of(const std::byte* voxel, size_t bytes) {
  uint32_t bits = 0;
  std::memcpy(&bits, voxel, bytes);
  return bits;
}

class Numbers final : public VolumeSource {
 public:
  Numbers(VolumeSource& source, const std::vector<Voxel>& colors)
      : source_(source), bytes_(static_cast<size_t>(voxel_bytes(source.info().format))) {
    info_ = source.info();
    info_.format = VoxelFormat::density8;
    info_.sample_type = SampleType::u8;
    info_.is_labels = true;
    info_.fill = 0;
    numbers_.emplace(0, uint8_t{0});
    for (size_t i = 0; i < colors.size(); ++i)
      numbers_.emplace(bits_of(colors[i].bytes.data(), bytes_), static_cast<uint8_t>(i + 1));
  }
  Status read(const Box& box, VoxelSpan out) override {
    const Index3 size = box.size();
    std::vector<std::byte> colors(static_cast<size_t>(box.voxels()) * bytes_);
    const VoxelSpan span = packed(colors.data(), size, source_.info().format);
    VOX_CHECK(source_.read(box, span));
    uint32_t before = 0;
    std::byte number{0};
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y) {
        const std::byte* voxel = span.row(y, z);
        std::byte* to = out.row(y, z);
        for (int64_t x = 0; x < size.x; ++x, voxel += bytes_) {
          const uint32_t bits = bits_of(voxel, bytes_);
          if (bits != before) {
            before = bits;
            VOX_TRY(number, number_of(bits));
          }
          *to++ = number;
        }
      }
    return {};
  }
  std::optional<Voxel> uniform(const Box& box) const override {
    const auto value = source_.uniform(box);
    if (!value) return std::nullopt;
    const auto number = number_of(bits_of(value->bytes.data(), bytes_));
    return number ? std::optional(Voxel::of(std::to_integer<uint8_t>(*number))) : std::nullopt;
  }
  void expect(int64_t z0, int64_t z1) const override { source_.expect(z0, z1); }
  void release(int64_t z0, int64_t z1) const override { source_.release(z0, z1); }

 private:
  Result<std::byte> number_of(uint32_t bits) const {
    const auto found = numbers_.find(bits);
    if (found == numbers_.end())
      return fail(ErrorCode::input, {},
                  "a color that was not there before: the input changed while it was read");
    return std::byte{found->second};
  }

  VolumeSource& source_;
  size_t bytes_;
  std::unordered_map<uint32_t, uint8_t> numbers_;
};

}  // namespace

Result<std::optional<std::vector<Voxel>>> few_colors(VolumeSource& source, Context& ctx) {
  const VolumeInfo& info = source.info();
  const auto bytes = static_cast<size_t>(voxel_bytes(info.format));
  const Slabs slabs(info.box(), voxel_bytes(info.format), slab_target(ctx));
  VOX_TRY(const auto buffer, Buffer::allocate(slabs.bytes(), "a slab of voxels", ctx));
  std::set<uint32_t> found;
  uint32_t before = 0;
  for (int64_t i = 0; i < slabs.count(); ++i) {
    VOX_CHECK(check_interrupt());
    const Box slab = slabs.slab(i);
    VOX_CHECK(read_slab(source, slab, packed(buffer->data(), slab.size(), info.format), ctx));
    source.release(slab.lo.z, slab.hi.z);
    const std::byte* voxel = buffer->data();
    for (int64_t left = slab.voxels(); left > 0; --left, voxel += bytes) {
      const uint32_t bits = bits_of(voxel, bytes);
      if (bits == before || bits == 0) continue;
      before = bits;
      if (found.insert(bits).second && found.size() > most_indexed_colors) return std::nullopt;
    }
  }
  std::vector<Voxel> colors;
  for (const uint32_t bits : found) {
    Voxel& color = colors.emplace_back();
    std::memcpy(color.bytes.data(), &bits, bytes);
  }
  return colors;
}

std::unique_ptr<VolumeSource> numbers_of(VolumeSource& source, const std::vector<Voxel>& colors) {
  return std::make_unique<Numbers>(source, colors);
}

}  // namespace voxkit::svmm
