#include "libmetrics/image_diff.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <vector>

#include "formats/parallel.h"

namespace voxkit {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

double error_of(float a, float b) {
  if (a == b || (std::isnan(a) && std::isnan(b))) return 0;
  const double d = std::abs(static_cast<double>(a) - static_cast<double>(b));
  return std::isnan(d) ? infinity : d;
}

/// Calls `visit(pixel, channel, error)` for the pixels begin .. end.
template <class Visit>
void visit_errors(const Image& a, const Image& b, int64_t begin, int64_t end, const Visit& visit) {
  const int channels = std::max(a.channels(), b.channels());
  const float opaque = a.type() == SampleType::i8    ? 127
                       : a.type() == SampleType::i16 ? 32767
                                                     : static_cast<float>(a.peak());
  const float *pa = a.row(0) + begin * a.channels(), *pb = b.row(0) + begin * b.channels();
  for (int64_t i = begin; i < end; ++i, pa += a.channels(), pb += b.channels())
    for (int c = 0; c < channels; ++c)
      visit(i, c, error_of(c < a.channels() ? pa[c] : opaque, c < b.channels() ? pb[c] : opaque));
}

struct Sums {
  double squares = 0, color_squares = 0, greatest = 0;
  int64_t differing = 0;
};

constexpr int64_t pixels_at_once = 1 << 14;

/// Calls `body(block, begin, end)` for blocks of pixels, on all threads.
template <class Body>
Status for_blocks(const Image& image, const Context& ctx, const Body& body) {
  const int64_t blocks = (image.pixels() + pixels_at_once - 1) / pixels_at_once;
  return parallel_for(ctx, blocks, [&](int64_t block) -> Status {
    const int64_t begin = block * pixels_at_once;
    body(block, begin, std::min(begin + pixels_at_once, image.pixels()));
    return {};
  });
}

}  // namespace

Status check_comparable(const Image& a, const Image& b) {
  if (a.width() != b.width() || a.height() != b.height())
    return bad_usage(fmt::format("the images have {} x {} and {} x {} pixels: expected the same size",
                                 a.width(), a.height(), b.width(), b.height()));
  const auto describe = [](const Image& image) {
    const bool real = image.type() == SampleType::f32;
    const bool is_signed = image.type() == SampleType::i8 || image.type() == SampleType::i16;
    return fmt::format(
        "a {} image of {}", image.colors() == 3 ? "colour" : "grey",
        real ? "floats"
             : fmt::format("{}{} bit integers", is_signed ? "signed " : "", 8 * sample_bytes(image.type())));
  };
  if (a.type() != b.type() || a.colors() != b.colors())
    return bad_usage(
        fmt::format("{} cannot be compared with {}: convert one of them first", describe(a), describe(b)));
  return {};
}

Result<ImageDiff> diff_images(const Image& a, const Image& b, std::optional<double> peak, Context& ctx,
                              ErrorHistogram* histogram) {
  VOX_CHECK(check_comparable(a, b));
  using Kind = ErrorHistogram::Kind;
  const Kind kind = a.type() == SampleType::f32   ? Kind::real
                    : sample_bytes(a.type()) == 1 ? Kind::bytes
                                                  : Kind::whole;
  if (histogram != nullptr) *histogram = ErrorHistogram(kind);
  std::mutex histogram_mutex;
  ImageDiff diff;
  diff.width = a.width();
  diff.height = a.height();
  diff.channels = std::max(a.channels(), b.channels());
  diff.peak = peak ? *peak : a.peak();

  const int colors = a.colors();
  std::vector<Sums> blocks(static_cast<size_t>((a.pixels() + pixels_at_once - 1) / pixels_at_once));
  VOX_CHECK(for_blocks(a, ctx, [&](int64_t block, int64_t begin, int64_t end) {
    Sums sums;
    std::optional<ErrorHistogram> counts;
    if (histogram != nullptr) counts.emplace(kind);
    bool differs = false;
    visit_errors(a, b, begin, end, [&](int64_t, int c, double error) {
      sums.squares += error * error;
      if (c < colors) sums.color_squares += error * error;
      sums.greatest = std::max(sums.greatest, error);
      if (counts) counts->add(error);
      differs = (c > 0 && differs) || error != 0;
      if (c + 1 == diff.channels) sums.differing += differs;
    });
    blocks[static_cast<size_t>(block)] = sums;
    if (counts) {
      std::lock_guard lock(histogram_mutex);
      histogram->add(*counts);
    }
  }));
  Sums total;
  for (const Sums& sums : blocks) {
    total.squares += sums.squares;
    total.color_squares += sums.color_squares;
    total.greatest = std::max(total.greatest, sums.greatest);
    total.differing += sums.differing;
  }

  const double pixels = static_cast<double>(a.pixels());
  diff.mse = total.squares / (pixels * diff.channels);
  diff.rmse = std::sqrt(diff.mse);
  diff.psnr_db = diff.mse == 0 ? infinity : 10 * std::log10(diff.peak * diff.peak / diff.mse);
  diff.max_abs_error = total.greatest;
  diff.differing_pixels = total.differing;
  if (colors == 3) {
    const double distance = std::sqrt(total.color_squares / pixels) * (255 / a.peak());
    diff.grmse = distance / std::sqrt(3.0);
    diff.grmse_distance = distance;
  }
  return diff;
}

Result<Image> error_image(const Image& a, const Image& b, Context& ctx) {
  VOX_CHECK(check_comparable(a, b));
  const SampleType type = a.type() == SampleType::i8    ? SampleType::u8
                          : a.type() == SampleType::i16 ? SampleType::u16
                                                        : a.type();
  const int channels = std::max(a.channels(), b.channels());
  VOX_TRY(Image errors, Image::create(a.width(), a.height(), channels, type, ctx));
  VOX_CHECK(for_blocks(a, ctx, [&](int64_t, int64_t begin, int64_t end) {
    float* samples = errors.row(0);
    visit_errors(a, b, begin, end, [&](int64_t i, int c, double error) {
      samples[i * channels + c] = static_cast<float>(error);
    });
  }));
  return errors;
}

}  // namespace voxkit
