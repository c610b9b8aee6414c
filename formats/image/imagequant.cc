// Palettes of images by libimagequant. A module of its own: that library is under the GPL, version 3, or a
// commercial licence.
#include <libimagequant.h>
#include <omp.h>

#include <array>
#include <memory>

#include "formats/image/coded_image_module.h"

namespace voxkit {
namespace {

template <class T, void (*destroy)(T*)>
struct Destroy {
  void operator()(T* object) const { destroy(object); }
};
template <class T, void (*destroy)(T*)>
using Owned = std::unique_ptr<T, Destroy<T, destroy>>;

Status quantise(RgbImage& image, int colors, int quality) {
  // What it finds depends on the number of its threads.
  omp_set_num_threads(1);
  const auto fails = [](const char* what) {
    return fail(ErrorCode::internal, {}, std::string("a palette: ") + what);
  };
  const size_t pixels = image.rgb.size() / 3;
  std::vector<std::array<uint8_t, 4>> rgba(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    for (size_t k = 0; k < 3; ++k) rgba[i][k] = std::to_integer<uint8_t>(image.rgb[3 * i + k]);
    rgba[i][3] = 255;
  }
  const Owned<liq_attr, liq_attr_destroy> attributes(liq_attr_create());
  if (!attributes) return fails("no memory");
  if (liq_set_max_colors(attributes.get(), colors) != LIQ_OK ||
      liq_set_quality(attributes.get(), 0, quality) != LIQ_OK)
    return fails("not a palette or a quality");
  const Owned<liq_image, liq_image_destroy> input(
      liq_image_create_rgba(attributes.get(), rgba.data(), static_cast<int>(image.size.width),
                            static_cast<int>(image.size.height), 0));
  if (!input) return fails("no memory");
  // Each pixel is as important as any other: those beside it are not beside it in space.
  std::vector<unsigned char> even(pixels, 255);
  if (liq_image_set_importance_map(input.get(), even.data(), even.size(), LIQ_COPY_PIXELS) != LIQ_OK)
    return fails("no memory");
  liq_result* found = nullptr;
  if (liq_image_quantize(input.get(), attributes.get(), &found) != LIQ_OK) return fails("none found");
  const Owned<liq_result, liq_result_destroy> result(found);
  // Nor are errors spread to them.
  liq_set_dithering_level(result.get(), 0);
  std::vector<uint8_t> indices(pixels);
  if (liq_write_remapped_image(result.get(), input.get(), indices.data(), indices.size()) != LIQ_OK)
    return fails("no memory");
  const liq_palette* const palette = liq_get_palette(result.get());
  for (size_t i = 0; i < pixels; ++i) {
    const liq_color c = palette->entries[indices[i]];
    image.rgb[3 * i] = std::byte{c.r};
    image.rgb[3 * i + 1] = std::byte{c.g};
    image.rgb[3 * i + 2] = std::byte{c.b};
  }
  return {};
}

const ImageQuantiser quantiser{.quantise = quantise};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.quantiser = &voxkit::quantiser)
