// Which DICOM frames are the slices of a volume, in which order, and where they lie.
#pragma once

#include <string>
#include <vector>

#include "formats/context.h"
#include "formats/volume.h"
#include "formats/volume/dicom_header.h"
#include "formats/volume/open_volume.h"

namespace voxkit {

/// A slice: a frame of a file. Of those that fill a gap: no file.
struct DicomSlice {
  static constexpr size_t none = SIZE_MAX;
  size_t file = none, frame = 0;
};

struct DicomPlan {
  std::vector<DicomHeader> files;  ///< of one series
  std::vector<DicomSlice> slices;
  Affine affine;  ///< in LPS where `world` says so
  World world = World::unknown;
  Unit unit = Unit::unknown;
  std::vector<std::string> parts;  ///< as VolumeInfo::parts

  const DicomHeader& header(const DicomSlice& slice) const { return files[slice.file]; }
  const DicomFrame& frame(const DicomSlice& slice) const { return files[slice.file].frames[slice.frame]; }
};

/// The headers of a file, or of all files in a folder and the folders in it; of a DICOMDIR those of its
/// folder. Errors: ErrorCode::input, where there are no images, too.
Result<std::vector<DicomHeader>> find_dicom(const std::string& name);

/// Chooses the series and the time step, puts slices in order by where they lie along their normal (without
/// places: by their instance number, else by name), and finds the affine: a step that is not along the normal
/// is a shear. Errors: ErrorCode::input, naming the option that decides, where there are several series or
/// time steps, or slices are missing or unevenly far apart.
Result<DicomPlan> plan_dicom(const std::string& name, std::vector<DicomHeader> headers,
                             const OpenOptions& options, Context& ctx);

}  // namespace voxkit
