// What the ImageDescription of a TIFF file says about its pages: ImageJ, OME-XML (of the 2016-06 schema) and
// the shapes of tifffile.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/affine.h"
#include "formats/result.h"
#include "formats/volume/open_volume.h"

namespace voxkit {

/// How pages make up slices, channels and time steps, and where they are.
struct StackDescription {
  int64_t slices = 0, channels = 1, times = 1;  ///< 0 slices: nothing said, each page is one
  /// Where not empty: number of the directory of slice z, channel c, time t at (t * channels + c) * slices +
  /// z.
  std::vector<int64_t> directory;
  /// All images follow the pixels of the only directory, without gaps; `strides` are then those of z, c and
  /// t, in images.
  bool contiguous = false;
  std::array<int64_t, 3> strides{};
  std::array<std::optional<double>, 3> spacing;  ///< in `unit`; x and y before those of the resolution
  std::optional<Unit> unit;
  std::array<double, 3> origin_index{};         ///< the voxel that lies at the origin of the world
  std::optional<std::array<double, 3>> origin;  ///< in place of `origin_index`, in `unit`
  World world = World::unknown;
  double slope = 1, intercept = 0;
  bool is_labels = false;
  std::string text;                ///< for people
  std::vector<std::string> notes;  ///< of what is dropped
  std::vector<std::string> parts;  ///< chosen here: the image of an OME file
};

/// Parses a description. `directories`: the numbers of those that hold full images, in order; `samples`: of
/// one pixel, which OME counts as channels. Errors: ErrorCode::input where a description contradicts the
/// directories, or is of a file that is only a part of a volume.
Result<StackDescription> describe_stack(const std::string& file, const std::string& text,
                                        std::span<const int64_t> directories, int64_t samples,
                                        const OpenOptions& options);

/// What TIFF files of slices of a volume say: a description of ImageJ with lines of our own, which it passes
/// over and `describe_stack` reads; empty where there is nothing to say. Of axes that are not along those of
/// the world only their lengths are kept.
std::string stack_description(const VolumeInfo& info);

}  // namespace voxkit
