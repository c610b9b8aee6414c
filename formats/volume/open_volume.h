// Volumes by name: which reader or writer a name means.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formats/context.h"
#include "formats/source.h"

namespace voxkit {

/// What a user says about an input that its name does not.
struct OpenOptions {
  std::optional<Index3> dims = {};       ///< .raw only, where it is required
  std::optional<std::string> type = {};  ///< .raw only: u8 i8 u16 i16 u32 i32 f32 f64 rgb8 rgba8 bit
  bool big_endian = false;               ///< .raw only
  // Which part of a file that has several. Without a choice where there is more than one: ErrorCode::input,
  // naming the option and what there is, unless `any_part` lets the reader take the first; VolumeInfo::parts
  // says what there is.
  std::string grid = {};                ///< of a .vdb file: its name
  std::optional<int64_t> time = {};     ///< number of a time step, from 0
  std::optional<int64_t> channel = {};  ///< number of a channel, from 0
  std::string series = {};  ///< of a folder of DICOM files: the end of a series' UID, or its number
  bool any_part = false;
  // How samples are understood.
  bool labels = false;              ///< values are names of things (VolumeInfo::is_labels)
  std::optional<double> fill = {};  ///< sample value that stands for nothing measured (VolumeInfo::fill)
  bool round_wide = false;          ///< integers that no voxel format holds exactly are rounded to floats
  /// What becomes of slices that are missing or unevenly far apart.
  enum class Gaps { refuse, accept, fill } gaps = Gaps::refuse;
  /// Slope and intercept will be applied: a reader applies those that differ within a volume, which else is
  /// refused.
  bool real_values = false;
  bool allow_outside = false;  ///< detached headers may name data files outside of their own folder
  /// Files and patterns that will be written: an input that consists of one of them is refused
  /// (ErrorCode::usage).
  std::vector<std::string> outputs;
  /// What else the caller reads, which the error of an unknown ending names: "compressed volumes (.svmm), ".
  std::string other_kinds = {};
};

/// Opens a file or a built-in by its name; reads headers, no voxels. "-" is standard input:
/// NRRD or a NumPy array, told apart by its first bytes.
/// Compressed volumes (.svmm …) are opened by the tools, since formats/ knows no codec.
/// Errors: ErrorCode::input with file, section and rule; ErrorCode::usage for a name that cannot be an input.
Result<std::unique_ptr<VolumeSource>> open_volume(const std::string& name, const OpenOptions& options,
                                                  Context& ctx);

/// True if `name` is a built-in such as "menger:5" (which need not be well-formed).
bool is_builtin(const std::string& name);

/// Starts a volume file of the kind that `name` ends in: .nrrd .nhdr .nii .nii.gz .mrc .mha .mhd .vtk .vti
/// .npy .raw .vdb, a printf pattern of images (a folder for slices), "-" (NRRD); "-.npy" is standard output
/// in that format. Refuses what the kind cannot hold (ErrorCode::usage) before creating anything.
Result<std::unique_ptr<VolumeSink>> create_volume(const std::string& name, const VolumeInfo& info, bool force,
                                                  Context& ctx);

/// What `outputs` says, of a volume opened by other means than open_volume.
Status check_not_written(const VolumeInfo& info, const OpenOptions& options);

/// The files that `create_volume` writes under this name: one, but for .nhdr, and none that is known for
/// pictures and "-".
std::vector<std::string> files_of_output(const std::string& name);

/// The checks of `create_volume` that need no volume, for a tool to run before any work: the kind is known,
/// and the file may be written (for images: looked at when their number is known).
Status check_volume_output(const std::string& name, bool force);

}  // namespace voxkit
