#include "librender/layers.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "formats/parallel.h"

namespace voxkit::render {
namespace {

/// The samples of a layer at a pixel of the frame.
void sample(Layer layer, const Frame& frame, const RayGenerator& rays, const std::optional<Image>& normals,
            int x, int y, float* out) {
  const size_t index = static_cast<size_t>(y) * static_cast<size_t>(frame.width) + static_cast<size_t>(x);
  const Pixel& pixel = frame.pixels[index];
  switch (layer) {
    case Layer::depth:
      out[0] = pixel.distance;
      break;
    case Layer::normal:
      std::copy_n(normals->row(y) + 3 * x, 3, out);
      break;
    case Layer::position: {
      const glm::dvec3 at =
          std::isfinite(pixel.distance)
              ? rays.eye() + rays.direction(x + 0.5, y + 0.5) * static_cast<double>(pixel.distance)
              : glm::dvec3(0);
      for (int k = 0; k < 3; ++k) out[k] = static_cast<float>(at[k]);
      break;
    }
    case Layer::steps:
      out[0] = static_cast<float>(frame.details[index].cells);
      break;
    case Layer::emissive:
      std::copy_n(frame.traits[index].emissive, 3, out);
      break;
    case Layer::opacity:
      out[0] = frame.traits[index].opacity;
      break;
    case Layer::rm:
      std::copy_n(frame.traits[index].rm, 2, out);
      break;
    case Layer::id:
      out[0] = static_cast<float>(frame.traits[index].id);
      break;
  }
}

}  // namespace

std::optional<color::Attribute> attribute_of(Layer layer) {
  switch (layer) {
    case Layer::normal:
      return color::Attribute::normal;
    case Layer::emissive:
      return color::Attribute::emissive;
    case Layer::opacity:
      return color::Attribute::opacity;
    case Layer::rm:
      return color::Attribute::rm;
    case Layer::id:
      return color::Attribute::id;
    default:
      return std::nullopt;
  }
}

Result<ImageLayer> make_layer(Layer layer, const Frame& frame, const Camera& camera,
                              const std::optional<Image>& normals, int n, Context& ctx) {
  const auto [name, channels] = layer == Layer::depth      ? std::pair{"depth", "Z"}
                                : layer == Layer::normal   ? std::pair{"normal", "XYZ"}
                                : layer == Layer::position ? std::pair{"position", "XYZ"}
                                : layer == Layer::emissive ? std::pair{"emissive", "RGB"}
                                : layer == Layer::opacity  ? std::pair{"opacity", "A"}
                                : layer == Layer::rm       ? std::pair{"rm", "RM"}
                                : layer == Layer::id       ? std::pair{"id", "I"}
                                                           : std::pair{"steps", "S"};
  const int count = static_cast<int>(std::string_view(channels).size());
  VOX_TRY(Image image, Image::create(frame.width / n, frame.height / n, count, SampleType::f32, ctx));
  const RayGenerator rays(camera, frame.width, frame.height);
  VOX_CHECK(parallel_for(ctx, image.height(), [&](int64_t y) -> Status {
    for (int64_t x = 0; x < image.width(); ++x)
      sample(layer, frame, rays, normals, static_cast<int>(x) * n + n / 2, static_cast<int>(y) * n + n / 2,
             image.row(y) + x * image.channels());
    return {};
  }));
  return ImageLayer{name, channels, std::move(image)};
}

}  // namespace voxkit::render
