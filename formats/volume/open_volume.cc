#include "formats/volume/open_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <vector>

#include "formats/output_file.h"
#include "formats/volume/readers.h"
#include "formats/volume/volume_formats.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;

/// Whether a file starts as DICOM files do, whatever its name.
bool is_dicom(const fs::path& path) {
  std::error_code unreadable;
  if (!fs::is_regular_file(path, unreadable)) return false;
  std::ifstream file(path, std::ios::binary);
  std::array<char, 132> head{};
  return file.read(head.data(), head.size()) && std::string_view(head.data() + 128, 4) == "DICM";
}

/// Whether a folder holds DICOM files, or folders in it do: its first files by name tell, more than one so
/// that a note among them does no harm.
Result<bool> holds_dicom(const std::string& folder) {
  constexpr size_t looked_at = 16, most_entries = 100000;
  std::error_code error;
  std::vector<std::string> first;
  size_t entries = 0;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end && entries < most_entries;
       it.increment(error), ++entries) {
    std::error_code unreadable;
    const std::string name = it->path().string();
    if (it->path().filename().string().front() == '.' || !it->is_regular_file(unreadable)) continue;
    first.insert(std::upper_bound(first.begin(), first.end(), name), name);
    if (first.size() > looked_at) first.pop_back();
  }
  if (error) return bad_input(folder, error.message());
  return std::any_of(first.begin(), first.end(),
                     [](const std::string& name) { return has_ending(name, ".dcm") || is_dicom(name); });
}

/// The writer that a name means.
Result<const VolumeFormat*> writer_of(const std::string& name) {
  const VolumeFormat* const format = find_volume_format(name);
  if (!format)
    return fail(ErrorCode::usage, name,
                fmt::format("unknown kind of volume: expected one of {}, or a pattern of images such as "
                            "slice-%04d.tif",
                            volume_endings(true)));
  const auto writable = format->endings.first(format->written);
  if (std::none_of(writable.begin(), writable.end(),
                   [&](const std::string_view ending) { return has_ending(name, ending); }))
    return fail(ErrorCode::usage, name,
                writable.empty() ? "files of this kind are read only"
                                 : fmt::format("files with this ending are read only: expected {}",
                                               fmt::join(writable, " ")));
  const auto piped = format->endings.first(format->piped);
  if (is_standard_output(name) &&
      std::none_of(piped.begin(), piped.end(),
                   [&](const std::string_view ending) { return has_ending(name, ending); }))
    return fail(ErrorCode::usage, name,
                "files of this kind cannot be written to standard output: name a file");
  return format;
}

SourceResult open_as_it_is(const std::string& name, const OpenOptions& options, Context& ctx) {
  if (name == "-") {
    VOX_TRY(auto stream, open_stream(name));
    VOX_TRY(KnownStream known, recognise(std::move(stream)));
    return known.format->open_stream(std::move(known.stream), options, ctx);
  }
  if (is_builtin(name)) return open_builtin(name);
  std::error_code error;
  const fs::file_status status = fs::status(name, error);
  if (!fs::exists(status)) {
    if (is_numbered(name)) return open_image_stack(name, options, ctx);
    return bad_input(name, error ? error.message() : "No such file or directory");
  }
  if (fs::is_directory(status)) {
    VOX_TRY(const bool dicom, holds_dicom(name));
    return dicom ? open_dicom(name, options, ctx) : open_image_stack(name, options, ctx);
  }
  const VolumeFormat* const format = find_volume_format(name);
  if ((!format || format->name != "raw") && is_dicom(name)) return open_dicom(name, options, ctx);
  if (format) return format->open(name, options, ctx);
  return bad_input(name,
                   fmt::format("unknown kind of file: expected a volume ({}), images (.tif .png .exr, a "
                               "folder or a pattern), a folder of DICOM files, {}or a built-in such as "
                               "menger:5",
                               volume_endings(false), options.other_kinds));
}

}  // namespace

Result<std::unique_ptr<VolumeSource>> open_volume(const std::string& name, const OpenOptions& options,
                                                  Context& ctx) {
  VOX_TRY(auto source, open_as_it_is(name, options, ctx));
  VOX_CHECK(check_not_written(source->info(), options));
  if (options.labels && !is_color(source->info().format)) source->set_labels();
  return source;
}

Result<std::unique_ptr<VolumeSink>> create_volume(const std::string& name, const VolumeInfo& info, bool force,
                                                  Context& ctx) {
  if (!checked_voxels(info.dims))
    return fail(ErrorCode::internal, name, "the volume to write has no voxels, or too many");
  if (name == "-") return create_nrrd(name, info, force, ctx);
  VOX_TRY(const VolumeFormat* const format, writer_of(name));
  const bool wide =
      is_wide(info.sample_type) && info.format != VoxelFormat::float32 && !is_color(info.format);
  if (wide && !format->wide_integers)
    return fail(ErrorCode::usage, name,
                fmt::format("files with this ending hold no {}: expected .nrrd, .nii, .mha, .npy or .raw, or "
                            "another type (--type, or "
                            "--output-type of vox-convert)",
                            voxkit::name(info.sample_type)));
  return format->create(name, info, force, ctx);
}

Status check_not_written(const VolumeInfo& info, const OpenOptions& options) {
  std::error_code error;
  for (const std::string& output : options.outputs) {
    std::optional<NumberedName> pattern;
    if (is_numbered(output)) {
      VOX_TRY(pattern, numbered_name(output));
    }
    for (const std::string& input : info.files) {
      const fs::path path(input);
      const std::string folder = pattern && !pattern->folder.empty() ? pattern->folder : ".";
      const bool same =
          pattern ? pattern->number(path.filename().string()) &&
                        fs::equivalent(path.has_parent_path() ? path.parent_path() : ".", folder, error)
                  : fs::equivalent(path, output, error);
      if (same && !error)
        return fail(ErrorCode::usage, output,
                    fmt::format("is part of the input as well ({}): expected another file", input));
    }
  }
  return {};
}

std::vector<std::string> files_of_output(const std::string& name) {
  const VolumeFormat* const format = find_volume_format(name);
  if (is_standard_output(name) || (format && format->images)) return {};
  std::vector<std::string> files{name};
  if (const std::string data = detached_data_file(name); !data.empty()) files.push_back(data);
  return files;
}

Status check_volume_output(const std::string& name, bool force) {
  if (name == "-") return check_output(name, force);
  VOX_CHECK(writer_of(name));
  for (const std::string& file : files_of_output(name)) VOX_CHECK(check_output(file, force));
  return {};
}

}  // namespace voxkit
