// The headers of NIfTI-1, NIfTI-2 and Analyze 7.5, as one: what nifti.cc reads before the samples.
#pragma once

#include <nifti1.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/context.h"
#include "formats/input_stream.h"
#include "formats/volume.h"
#include "formats/volume/dense_source.h"

namespace voxkit::nifti {

enum class Kind { analyze, nifti1, nifti2 };

struct Header {
  std::string name;  ///< of the file, for messages
  Kind kind = Kind::nifti1;
  bool big_endian = false;
  bool pair = false;  ///< samples are in another file
  std::array<int64_t, 8> dim{};
  std::array<double, 8> pixdim{};
  int datatype = 0;
  uint64_t offset = 0;  ///< of the first sample, in the file that they are in
  double slope = 0, intercept = 0;
  double cal_min = 0, cal_max = 0;
  int units = 0;
  int intent = 0;
  std::string intent_name, description, aux_file;
  bool timing = false;  ///< something is said of the order or the times of slices
  int qform_code = 0, sform_code = 0;
  std::array<double, 3> quaternion{}, offset_q{};
  std::array<std::array<double, 4>, 3> rows{};  ///< of the sform
  std::string analyze_unit;
  bool analyze_origin = false;  ///< SPM has put a voxel there

  tl::unexpected<Error> wrong(const std::string& what) const;
};

/// Of a file that may be each of them. A header without magic is one of Analyze. Errors: ErrorCode::input.
Result<Header> read_header(InputStream& stream);
/// Skips extensions, in a single file up to the first sample; notes which there are.
Status skip_extensions(const Header& header, InputStream& stream, Context& ctx);
/// Type of the samples. Errors: ErrorCode::input, by the type's name.
Result<SampleLayout> sample_layout(const Header& header);
int16_t datatype_of(const SampleLayout& layout);

/// Where the volume is, whose dims are known: sform, else qform, else the distances of voxels; notes what
/// they disagree in.
void read_placement(const Header& header, VolumeInfo& info, Context& ctx);
/// Meaning of the voxels, and its scale and description; notes what is dropped.
void read_meaning(const Header& header, VolumeInfo& info, Context& ctx);

/// The fields of a placement, in the forms that say it; notes what they cannot say. See nifti_placement.cc.
void write_placement(const std::string& name, const VolumeInfo& info, nifti_1_header& header, Context& ctx);

}  // namespace voxkit::nifti
