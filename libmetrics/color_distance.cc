#include "libmetrics/color_distance.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "formats/parallel.h"
#include "libmetrics/image_diff.h"

namespace voxkit {

Result<LabDiff> diff_lab(const Image& a, const Image& b, Context& ctx) {
  VOX_CHECK(check_comparable(a, b));
  if (a.type() == SampleType::i8 || a.type() == SampleType::i16)
    return bad_usage("signed integers have no colours: expected unsigned ones or floats");
  std::vector<double> linear;  // of each stored integer
  if (a.type() != SampleType::f32) {
    linear.resize(static_cast<size_t>(a.peak()) + 1);
    for (size_t i = 0; i < linear.size(); ++i) linear[i] = srgb_to_linear(static_cast<double>(i) / a.peak());
  }
  const auto light = [&](float sample) {
    return linear.empty() ? static_cast<double>(sample) : linear[static_cast<size_t>(sample)];
  };
  const auto lab = [&](const float* pixel, int colors) {
    const double first = light(pixel[0]);
    return colors == 3 ? lab_of_linear(first, light(pixel[1]), light(pixel[2]))
                       : lab_of_linear(first, first, first);
  };

  constexpr int64_t pixels_at_once = 1 << 14;
  struct Part {
    double sum = 0, greatest = 0;
  };
  const auto add = [](Part& part, double sum, double greatest) {
    part.sum += sum;
    if (!std::isnan(part.greatest) && !(greatest <= part.greatest)) part.greatest = greatest;
  };
  std::vector<Part> parts(static_cast<size_t>((a.pixels() + pixels_at_once - 1) / pixels_at_once));
  const int64_t count = static_cast<int64_t>(parts.size());
  VOX_CHECK(parallel_for(ctx, count, [&](int64_t block) -> Status {
    const int64_t begin = block * pixels_at_once, end = std::min(begin + pixels_at_once, a.pixels());
    Part part;
    for (int64_t i = begin; i < end; ++i) {
      const double e =
          delta_e(lab(a.row(0) + i * a.channels(), a.colors()), lab(b.row(0) + i * b.channels(), b.colors()));
      add(part, e, e);
    }
    parts[static_cast<size_t>(block)] = part;
    return {};
  }));
  Part total;
  for (const Part& part : parts) add(total, part.sum, part.greatest);
  return LabDiff{total.sum / static_cast<double>(a.pixels()), total.greatest};
}

}  // namespace voxkit
