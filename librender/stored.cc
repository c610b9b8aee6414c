#include "librender/stored.h"

#include <algorithm>
#include <array>

#include "formats/lab.h"
#include "formats/parallel.h"

namespace voxkit::render {
namespace {

/// The curve from what a display shows to light, and back, straight between 1024 places.
class DisplayCurve {
 public:
  DisplayCurve() {
    for (size_t i = 0; i <= steps; ++i)
      light_[i] = static_cast<float>(srgb_to_linear(static_cast<double>(i) / steps));
  }
  float light(float shown) const {
    const float at = std::clamp(shown, 0.0f, 1.0f) * steps;
    const size_t i = std::min(static_cast<size_t>(at), steps - 1);
    return light_[i] + (light_[i + 1] - light_[i]) * (at - static_cast<float>(i));
  }
  float shown(float light) const {
    light = std::clamp(light, 0.0f, 1.0f);
    const auto above = std::upper_bound(light_.begin() + 1, light_.end() - 1, light);
    const float lo = *(above - 1), hi = *above;
    return (static_cast<float>(above - 1 - light_.begin()) + (light - lo) / (hi - lo)) / steps;
  }

 private:
  static constexpr size_t steps = 1024;
  std::array<float, steps + 1> light_;
};
const DisplayCurve& curve() {
  static const DisplayCurve curve;
  return curve;
}

}  // namespace

Result<Image> stored_normals(const Frame& frame, const Surface& surface, Context& ctx) {
  VOX_TRY(Image normals, Image::create(surface.width(), surface.height(), 3, SampleType::f32, ctx));
  VOX_CHECK(parallel_for(ctx, surface.height(), [&](int64_t row) -> Status {
    const int y = static_cast<int>(row);
    for (int x = 0; x < surface.width(); ++x) {
      const float(&n)[3] = frame.traits[surface.index(x, y)].normal;
      const Surface::Point& point = surface(x, y);
      const float away = n[0] * point.at.x + n[1] * point.at.y + n[2] * point.at.z;
      for (int k = 0; k < 3; ++k) normals.row(y)[3 * x + k] = away > 0 ? -n[k] : n[k];
    }
    return {};
  }));
  return normals;
}

float without_light(float color, float light) {
  return curve().shown(curve().light(color) - curve().light(light));
}
float with_light(float color, float light) {
  return curve().shown(curve().light(color) + curve().light(light));
}

}  // namespace voxkit::render
