#include "formats/mesh/face_palette.h"

#include <bit>

#include "formats/image/coded_image.h"
#include "formats/reservation.h"

namespace voxkit {

FacePalette::FacePalette() : bits_((size_t{1} << 24) / 64), before_(bits_.size()) {}

void FacePalette::add(const std::array<uint8_t, 3>& color) {
  const uint32_t number = number_of(color);
  bits_[number / 64] |= uint64_t{1} << (number % 64);
}

void FacePalette::arrange() {
  count_ = 0;
  for (size_t i = 0; i < bits_.size(); ++i) {
    before_[i] = count_;
    count_ += static_cast<uint32_t>(std::popcount(bits_[i]));
  }
  width_ = height_ = 1;
  while (width_ * height_ < count_) (width_ == height_ ? width_ : height_) *= 2;
}

uint32_t FacePalette::index_of(const std::array<uint8_t, 3>& color) const {
  const uint32_t number = number_of(color);
  const uint64_t below = bits_[number / 64] & ((uint64_t{1} << (number % 64)) - 1);
  return before_[number / 64] + static_cast<uint32_t>(std::popcount(below));
}

Result<std::vector<std::byte>> FacePalette::png(Context& ctx) const {
  const ImageSize size{width_, height_};
  VOX_TRY(const Reservation memory,
          Reservation::take(6 * uint64_t{width_} * height_ + image_work_bytes(ImageFormat::png, size),
                            "the texture of a mesh", ctx));
  RgbImage image = make_rgb_image(size);
  auto to = image.rgb.begin();
  for (uint32_t word = 0; word < bits_.size(); ++word)
    for (uint64_t left = bits_[word]; left != 0; left &= left - 1) {
      const uint32_t number = 64 * word + static_cast<uint32_t>(std::countr_zero(left));
      for (const int shift : {16, 8, 0}) *to++ = static_cast<std::byte>(number >> shift & 255);
    }
  return encode_image(ImageFormat::png, image, {});
}

}  // namespace voxkit
