// Structural similarity of images: SSIM and, over several scales, MS-SSIM.
#pragma once

#include <optional>

#include "formats/image/image.h"

namespace voxkit {

struct Ssim {
  double ssim = 0;     ///< mean over the image, -1..1
  double ms_ssim = 0;  ///< 0..1
  int scales = 0;      ///< that ms_ssim covers
};

/// SSIM (Wang, Bovik, Sheikh, Simoncelli 2004) and MS-SSIM (Wang, Simoncelli, Bovik 2003) of two images of
/// one channel, the same size and the same type; 1 exactly for equal images.
///
/// The window is a Gaussian of 11 x 11 samples with sigma 1.5 that lies inside the image (no padding); K1 =
/// 0.01, K2 = 0.03, and L is `peak` (default: of the images' type). MS-SSIM takes the mean of the
/// contrast-structure term at all scales but the last, and there the mean of SSIM, to the power of the
/// published weights 0.0448, 0.2856, 0.3001, 0.2363, 0.1333; a negative mean counts as 0. From scale to
/// scale, 2 x 2 samples are averaged; a last column or row without a partner is averaged with itself.
///
/// Small images: scale s is used where 11 * 2^s is at most the shorter side (five scales from 176 samples
/// on), and the weights used are divided by their sum. A side below 11 cuts the window to the Gaussian of
/// that many samples.
///
/// Computed in double precision with sums in a fixed order: the same bits for any number of threads. Off by
/// less than 1e-6, whatever the samples. A NaN or an infinity makes the results NaN. Errors: ErrorCode::usage
/// for other images; ErrorCode::limit.
Result<Ssim> ssim(const Image& a, const Image& b, std::optional<double> peak, Context& ctx);

/// Rec. 709 luma of the stored values: 0.2126 R + 0.7152 G + 0.0722 B. Grey is itself, alpha is ignored.
Result<Image> luma(const Image& image, Context& ctx);
/// One channel.
Result<Image> channel(const Image& image, int index, Context& ctx);

}  // namespace voxkit
