// How far one image is from another, sample by sample: RMSE, PSNR and their relatives.
#pragma once

#include <cstdint>
#include <optional>

#include "formats/image/image.h"
#include "libmetrics/error_histogram.h"

namespace voxkit {

/// The differences between A (the reference) and B, over all samples, alpha included.
struct ImageDiff {
  int64_t width = 0, height = 0;
  int channels = 0;  ///< the greater number of the two
  double peak = 0;   ///< 255, 65535 or, for floats, 1; or what the caller said
  double mse = 0, rmse = 0;
  double psnr_db = 0;  ///< 10 log10(peak^2 / mse); infinite where nothing differs
  double max_abs_error = 0;
  int64_t differing_pixels = 0;
  /// Colours: sqrt(sum of squared R, G, B errors / 3 pixels), and the same / pixels: the RMS of the Euclidean
  /// distance in sRGB. Samples are scaled to 0..255 by the image's own peak, whatever the caller said.
  std::optional<double> grmse, grmse_distance;
};

/// Whether two images can be compared: of the same size and sample type, both grey or both colours. Where one
/// of them has alpha, the other is opaque. Errors: ErrorCode::usage.
Status check_comparable(const Image& a, const Image& b);

/// Compares two images. A NaN beside a NaN is no error; beside a number it is an infinite one. Sums are taken
/// in double precision in a fixed order: the result is the same for any number of threads. `histogram`:
/// nullptr, or what is set to the histogram of the errors. Errors: those of check_comparable.
Result<ImageDiff> diff_images(const Image& a, const Image& b, std::optional<double> peak, Context& ctx,
                              ErrorHistogram* histogram = nullptr);

/// |A - B|: of the bit depth of both, unsigned. Errors: those of check_comparable.
Result<Image> error_image(const Image& a, const Image& b, Context& ctx);

}  // namespace voxkit
