// The volume inputs of the tools: everything that formats/ opens, and compressed volumes.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "formats/volume/open_volume.h"
#include "formats/volume/volume_formats.h"
#include "libcolor/color.h"
#include "libsvmm/packed/packed.h"
#include "libsvmm/svmm.h"
#include "libvq/vq.h"
#include "tools/common/command_line.h"

namespace voxkit::cli {

struct Input {
  std::unique_ptr<VolumeSource> source;
  std::shared_ptr<const svmm::Volume> svmm;          ///< null for all but .svmm of layouts thesis and plain
  std::shared_ptr<const svmm::PackedVolume> packed;  ///< null for all but .svmm of layout packed
  std::shared_ptr<const vq::Volume> vq;              ///< null for all but .vqv
  std::shared_ptr<const color::Volume> color;        ///< null for all but .dagc
  const VolumeFormat* format = nullptr;              ///< of a file or stream that is not compressed
};

/// Declares --dims, --endian, --grid and what else OpenOptions has, and with `type` also --type as the type
/// of a .raw input.
void declare_input_options(CommandLine& line, OpenOptions& options, bool type = true);

/// Opens a file, a built-in, or standard input ("-": a container, NRRD or NumPy's, told apart by its
/// first bytes).
Result<Input> open_input(const std::string& name, const OpenOptions& options, Context& ctx);
/// Opens what standard input held: a container, NRRD or NumPy's. It can be opened any number of times.
Result<Input> open_spooled(std::shared_ptr<const MappedFile> file, const OpenOptions& options, Context& ctx);
/// Opens a compressed volume only. `level`: of the mip-map, as the voxels of the source; none: the finest
/// that there is, which for a packed file that was cut is not level 0. That is noted in a line.
Result<Input> open_compressed(const std::string& name, std::optional<int> level, Context& ctx);
/// The container in a file or on standard input.
Result<std::shared_ptr<const Container>> open_container(const std::string& name, Context& ctx);

/// Whether a file is a volume by its ending: not one of several slices, nor raw samples, nor the second file
/// of a pair.
bool is_volume_file(const std::string& name);
/// True for names that end like a compressed volume.
bool is_compressed(const std::string& name);
/// Bytes of the file, or of all files of a folder; nothing for built-ins, patterns and streams.
std::optional<uint64_t> file_bytes(const std::string& name);
/// Refuses an output that is, or of which a part is, the input file itself: ErrorCode::usage. Of other files
/// that an input consists of, OpenOptions::outputs takes care.
Status check_distinct(const std::string& input, const std::string& output);

}  // namespace voxkit::cli
