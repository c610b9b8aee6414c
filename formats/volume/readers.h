// The readers and writers behind open_volume and create_volume, one file each.
#pragma once

#include <memory>
#include <string>

#include "formats/context.h"
#include "formats/input_stream.h"
#include "formats/names.h"
#include "formats/output_file.h"
#include "formats/source.h"
#include "formats/volume/open_volume.h"
#include "formats/voxel_sink.h"

namespace voxkit {

using SourceResult = Result<std::unique_ptr<VolumeSource>>;
using VoxelSinkResult = Result<std::unique_ptr<VoxelSink>>;
using SinkResult = Result<std::unique_ptr<VolumeSink>>;

// nrrd.cc: http://teem.sourceforge.net/nrrd/format.html. Attached (.nrrd, or a stream) and detached (.nhdr)
// headers; raw, gzip, bzip2, ascii and hex data; both endians; every integer and floating type; up to 3 axes
// of space in any order with one of colours (3 or 4 u8), one of time (--time) and one of channels
// (--channel).
SourceResult open_nrrd(const std::string& path, const OpenOptions& options, Context& ctx);
SourceResult open_nrrd(std::unique_ptr<InputStream> stream, const OpenOptions& options, Context& ctx);
/// Raw little-endian data with attached header; .nhdr: header and, beside it, NAME.raw.
SinkResult create_nrrd(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);

// data_files.cc
/// The file of samples that goes with a detached header, .nhdr or .mhd; empty for other names.
std::string detached_data_file(const std::string& path);

// meta_image.cc: MetaImage, .mha and .mhd: data after the header, in a file, a list of files or a pattern;
// raw, zlib and text; both endians; up to 3 axes of space and one of time, channels, colours of 3 or 4 u8.
// Written raw: .mha in one file, .mhd with NAME.raw beside it.
SourceResult open_meta_image(const std::string& path, const OpenOptions& options, Context& ctx);
SinkResult create_meta_image(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);

// vti.cc: VTK's image data as XML, .vti.
SourceResult open_vti(const std::string& path, const OpenOptions& options, Context& ctx);
SinkResult create_vti(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);
// vtk_legacy.cc: VTK's structured points, .vtk, in text or binary.
SourceResult open_vtk(const std::string& path, const OpenOptions& options, Context& ctx);
SinkResult create_vtk(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);

// npy.cc: NumPy arrays of 1 to 5 axes, [time, channel,] z, y, x, in either order of memory, and colours (3 or
// 4 u8) along the last one of 4 or more; every type of numbers, both endians. Written with version 1.0, in C
// order.
SourceResult open_npy(const std::string& path, const OpenOptions& options, Context& ctx);
SourceResult open_npy(std::unique_ptr<InputStream> stream, const OpenOptions& options, Context& ctx);
SinkResult create_npy(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);

// raw.cc: headerless samples, x fastest.
SourceResult open_raw(const std::string& path, const OpenOptions& options, Context& ctx);
SinkResult create_raw(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);

// nifti.cc: NIfTI-1, NIfTI-2 and Analyze 7.5: single files (.nii, .nii.gz) and pairs (.hdr and .img, each
// also .gz; by either name); one volume of several by --time and --channel. Written as NIfTI-1 single files:
// sides up to 32767.
SourceResult open_nifti(const std::string& path, const OpenOptions& options, Context& ctx);
SinkResult create_nifti(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);

// mrc.cc: MRC2014 / CCP4 maps, modes 0, 1, 2, 6, 12, 16 and 101, both endians, axes in any order, oblique
// cells, gzip and bzip2, stacks of volumes (--time). Written: modes 0, 1, 2, 6 and 12.
SourceResult open_mrc(const std::string& path, const OpenOptions& options, Context& ctx);
SinkResult create_mrc(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);

// builtin.cc: names such as "menger:5"; the volumes are in builtin_*.cc, generated region by region.
SourceResult open_builtin(const std::string& name);

// volume_module.cc: readers and writers whose libraries are heavy live in modules that are loaded when a file
// needs them: image_stack.cc (OpenImageIO), openvdb.cc, dicom.cc (GDCM).
SourceResult open_image_stack(const std::string& pattern_or_folder, const OpenOptions& options, Context& ctx);
SinkResult create_image_stack(const std::string& pattern, const VolumeInfo& info, bool force, Context& ctx);
SourceResult open_vdb(const std::string& path, const OpenOptions& options, Context& ctx);
SinkResult create_vdb(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);
/// A grid of Vec3s, in [0, 1] as stored, of which the voxels that come are active. Memory: 6 KiB for each
/// cube of 8 voxels a side that has any. Errors: those of create_vdb; ErrorCode::limit.
VoxelSinkResult create_vdb_voxels(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);
SourceResult open_dicom(const std::string& folder, const OpenOptions& options, Context& ctx);

}  // namespace voxkit
