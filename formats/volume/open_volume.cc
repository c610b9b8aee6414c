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

namespace voxkit {
namespace {

namespace fs = std::filesystem;

/// Kinds of volume that a name can mean.
enum class Kind { none, nrrd, nifti, mrc, raw, vdb, image };

struct Ending {
  std::string_view text;
  Kind kind;
};
constexpr Ending endings[] = {
    {".nrrd", Kind::nrrd},   {".nhdr", Kind::nrrd},    {".nii", Kind::nifti},    {".nii.gz", Kind::nifti},
    {".hdr", Kind::nifti},   {".hdr.gz", Kind::nifti}, {".img", Kind::nifti},    {".img.gz", Kind::nifti},
    {".mrc", Kind::mrc},     {".map", Kind::mrc},      {".ccp4", Kind::mrc},     {".rec", Kind::mrc},
    {".mrc.gz", Kind::mrc},  {".map.gz", Kind::mrc},   {".ccp4.gz", Kind::mrc},  {".rec.gz", Kind::mrc},
    {".mrc.bz2", Kind::mrc}, {".map.bz2", Kind::mrc},  {".ccp4.bz2", Kind::mrc}, {".rec.bz2", Kind::mrc},
    {".raw", Kind::raw},     {".vdb", Kind::vdb},      {".tif", Kind::image},    {".tiff", Kind::image},
    {".png", Kind::image},   {".exr", Kind::image},
};

Kind kind_of(const std::string& name) {
  for (const Ending& ending : endings)
    if (has_ending(name, ending.text)) return ending.kind;
  return Kind::none;
}

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

auto unknown_output(const std::string& name) {
  return fail(ErrorCode::usage, name,
              "unknown kind of volume: expected one of .nrrd .nhdr .nii .nii.gz .vdb .raw .mrc .map .ccp4 "
              ".rec, or a pattern of images such as slice-%04d.tif");
}

}  // namespace

namespace {

SourceResult open_as_it_is(const std::string& name, const OpenOptions& options, Context& ctx) {
  if (name == "-") return open_nrrd(name, options, ctx);
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
  const Kind kind = kind_of(name);
  if (has_ending(name, ".dcm") || (kind != Kind::raw && is_dicom(name)))
    return open_dicom(name, options, ctx);
  switch (kind) {
    case Kind::nrrd:
      return open_nrrd(name, options, ctx);
    case Kind::nifti:
      return open_nifti(name, options, ctx);
    case Kind::mrc:
      return open_mrc(name, options, ctx);
    case Kind::raw:
      return open_raw(name, options, ctx);
    case Kind::vdb:
      return open_vdb(name, options, ctx);
    case Kind::image:
      return open_image_stack(name, options, ctx);
    case Kind::none:
      break;
  }
  return bad_input(
      name,
      "unknown kind of volume: expected one of .nrrd .nhdr .nii .hdr .img (these three also .gz) .vdb .raw "
      ".mrc .map .ccp4 .rec (these four also .gz or .bz2), images (.tif .png .exr, a folder or a pattern), a "
      "DICOM file or a folder of them, or a built-in such as menger:5");
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
  const Kind kind = kind_of(name);
  if (is_wide(info.sample_type) && info.format != VoxelFormat::float32 && !is_color(info.format) &&
      (kind == Kind::vdb || kind == Kind::image))
    return fail(
        ErrorCode::usage, name,
        fmt::format(
            "files with this ending hold no {}: expected .nrrd, .nii or .raw, or another type (--type, or "
            "--output-type of vox-convert)",
            voxkit::name(info.sample_type)));
  switch (kind) {
    case Kind::nrrd:
      return create_nrrd(name, info, force, ctx);
    case Kind::nifti:
      return create_nifti(name, info, force, ctx);
    case Kind::mrc:
      return create_mrc(name, info, force, ctx);
    case Kind::raw:
      return create_raw(name, info, force, ctx);
    case Kind::vdb:
      return create_vdb(name, info, force, ctx);
    case Kind::image:
      return create_image_stack(name, info, force, ctx);
    case Kind::none:
      break;
  }
  return unknown_output(name);
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
  if (name == "-" || kind_of(name) == Kind::image) return {};
  std::vector<std::string> files{name};
  if (const std::string data = nrrd_data_file(name); !data.empty()) files.push_back(data);
  return files;
}

Status check_volume_output(const std::string& name, bool force) {
  if (name == "-") return check_output(name, force);
  if (kind_of(name) == Kind::none) return unknown_output(name);
  for (const std::string& file : files_of_output(name)) VOX_CHECK(check_output(file, force));
  return {};
}

}  // namespace voxkit
