// The Menger sponge, row by row from tables of one axis.
#include <cstdint>
#include <cstring>
#include <vector>

#include "formats/volume/builtin.h"

namespace voxkit {
namespace {

/// `count` voxels of a row: the pixel `red[i] | rest`, or void where `digits[i]` meets `hit`. One AND and two
/// selects a voxel, which the compiler turns into vector code.
void write_row(const uint32_t* __restrict digits, const uint32_t* __restrict red, int64_t count, uint32_t hit,
               uint32_t rest, std::byte* __restrict out) {
  for (int64_t i = 0; i < count; ++i) {
    const uint32_t pixel = (digits[i] & hit) == 0 ? red[i] | rest : 0;
    std::memcpy(out + 4 * i, &pixel, 4);
  }
}

/// The pixel with one of its four bytes set; combined by OR in the byte order of the machine.
uint32_t pixel_byte(int channel, int64_t value) {
  Voxel pixel;
  pixel.bytes[static_cast<size_t>(channel)] = static_cast<std::byte>(value);
  return pixel.as<uint32_t>();
}

class MengerSource final : public VolumeSource {
 public:
  explicit MengerSource(int level) {
    int64_t side = 1;
    for (int i = 0; i < level; ++i) side *= 3;
    info_.dims = Index3(side);
    info_.format = VoxelFormat::rgba32;
    digits_.resize(static_cast<size_t>(side));
    red_.resize(static_cast<size_t>(side));
    for (int64_t i = 0; i < side; ++i) {
      uint32_t ones = 0;
      int64_t rest = i;
      for (int place = 0; place < level; ++place, rest /= 3) {
        if (rest % 3 == 1) ones |= uint32_t{1} << place;
      }
      digits_[static_cast<size_t>(i)] = ones;
      red_[static_cast<size_t>(i)] = pixel_byte(0, color(i));
    }
  }

  Status read(const Box& box, VoxelSpan out) override {
    const int64_t width = box.size().x;
    for (int64_t z = box.lo.z; z < box.hi.z; ++z) {
      const uint32_t blue = pixel_byte(2, color(z)) | pixel_byte(3, 255);
      for (int64_t y = box.lo.y; y < box.hi.y; ++y) {
        std::byte* row = out.row(y - box.lo.y, z - box.lo.z);
        if ((digits(y) & digits(z)) != 0) {
          std::memset(row, 0, static_cast<size_t>(4 * width));
        } else {
          write_row(digits_.data() + box.lo.x, red_.data() + box.lo.x, width, digits(y) | digits(z),
                    pixel_byte(1, color(y)) | blue, row);
        }
      }
    }
    return {};
  }

  std::optional<Voxel> uniform(const Box& box) const override {
    if (box.empty()) return std::nullopt;
    const uint32_t x = shared_digits(box.lo.x, box.hi.x);
    const uint32_t y = shared_digits(box.lo.y, box.hi.y);
    const uint32_t z = shared_digits(box.lo.z, box.hi.z);
    if (((x & y) | (x & z) | (y & z)) != 0) return Voxel{};
    if (box.voxels() != 1) return std::nullopt;
    return Voxel::of(pixel_byte(0, color(box.lo.x)) | pixel_byte(1, color(box.lo.y)) |
                     pixel_byte(2, color(box.lo.z)) | pixel_byte(3, 255));
  }

 private:
  int64_t color(int64_t i) const { return 255 * i / info_.dims.x; }
  uint32_t digits(int64_t i) const { return digits_[static_cast<size_t>(i)]; }
  /// The places in which every coordinate of lo .. hi has the digit 1: the ends of the range agree from some
  /// place on.
  uint32_t shared_digits(int64_t lo, int64_t hi) const {
    auto first = static_cast<uint32_t>(lo), last = static_cast<uint32_t>(hi - 1);
    uint32_t places = ~uint32_t{0};
    for (; first != last; first /= 3, last /= 3) places <<= 1;
    return digits(lo) & places;
  }

  std::vector<uint32_t> digits_;  ///< bit p: the coordinate's ternary digit of weight 3^p is 1
  std::vector<uint32_t> red_;     ///< the coordinate's colour as the red of a pixel
};

}  // namespace

std::unique_ptr<VolumeSource> menger_source(int level) {
  return std::make_unique<MengerSource>(level);
}

}  // namespace voxkit
