// Small images in files.
#include "formats/image/coded_image.h"
#include "tests/fuzz/harness.h"
#include "tests/fuzz/seeds.h"

namespace voxkit::fuzz {
namespace {

/// The first two bytes are width and height, less 1, of which 6 bits count.
Verdict read(ImageFormat format, Input input) {
  if (input.size() < 2) return {};
  const auto side = [&](size_t at) { return 1 + (std::to_integer<uint32_t>(input[at]) & 63); };
  const ImageSize size{side(0), side(1)};
  const auto image = decode_image(format, input.subspan(2), size);
  if (image) {
    if (image->size != size || image->rgb.size() != size_t{3} * size.width * size.height)
      return {false, "an image of another size"};
    return {true, {}};
  }
  if (image.error().code != ErrorCode::input)
    return {false, "an error of another class: " + image.error().what};
  if (image.error().what.empty() || image.error().what.find('\n') != std::string::npos)
    return {false, "a message that is not one line: " + image.error().what};
  return {};
}

std::vector<std::string> seeds(ImageFormat format) {
  std::vector<std::string> all;
  for (const ImageSize size : {ImageSize{1, 1}, ImageSize{16, 16}, ImageSize{64, 37}})
    for (const int quality : {100, 60}) {
      ImageCoding coding;
      coding.quality = format == ImageFormat::png ? 100 : quality;
      coding.pixels = uint64_t{size.width} * size.height;
      RgbImage image = make_rgb_image(size);
      // Of png: many colours, and few.
      for (size_t i = 0; i < image.rgb.size(); ++i)
        image.rgb[i] = static_cast<std::byte>(quality == 100 ? i * i / 7 : i / 3 % 3 * 80);
      const auto file = encode_image(format, image, coding);
      if (!file) return {};
      std::string seed = {static_cast<char>(size.width - 1), static_cast<char>(size.height - 1)};
      for (const std::byte byte : *file) seed += static_cast<char>(byte);
      all.push_back(std::move(seed));
    }
  return all;
}

}  // namespace

Verdict read_jpeg(Input input) {
  return read(ImageFormat::jpeg, input);
}
Verdict read_jp2(Input input) {
  return read(ImageFormat::jp2, input);
}
Verdict read_png(Input input) {
  return read(ImageFormat::png, input);
}
std::vector<std::string> jpeg_seeds() {
  return seeds(ImageFormat::jpeg);
}
std::vector<std::string> jp2_seeds() {
  return seeds(ImageFormat::jp2);
}
std::vector<std::string> png_seeds() {
  return seeds(ImageFormat::png);
}

}  // namespace voxkit::fuzz
