#include "formats/volume/volume_formats.h"

#include <algorithm>
#include <array>

#include "formats/names.h"

namespace voxkit {
namespace {

using Endings = std::string_view[];

constexpr Endings nrrd = {".nrrd", ".nhdr"};
constexpr Endings nifti = {".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"};
constexpr Endings mrc = {".mrc",     ".map",    ".ccp4",    ".rec",     ".mrc.gz",   ".map.gz",
                         ".ccp4.gz", ".rec.gz", ".mrc.bz2", ".map.bz2", ".ccp4.bz2", ".rec.bz2"};
constexpr Endings meta = {".mha", ".mhd"};
constexpr Endings vtk = {".vtk"};
constexpr Endings vti = {".vti"};
constexpr Endings npy = {".npy"};
constexpr Endings raw = {".raw"};
constexpr Endings vdb = {".vdb"};
constexpr Endings images = {".tif", ".tiff", ".png", ".exr"};
constexpr Endings dicom = {".dcm"};

constexpr VolumeFormat formats[] = {
    {.name = "nrrd",
     .endings = nrrd,
     .written = 2,
     .piped = 1,
     .types = "u8 i8 u16 i16 u32 i32 u64 i64 f32 rgb8 rgba8 bit",
     .random_access = "raw data",
     .open = open_nrrd,
     .create = create_nrrd,
     .open_stream = open_nrrd,
     .magic = "NRRD000",
     .wide_integers = true,
     .images = false},
    {.name = "nifti",
     .endings = nifti,
     .written = 2,
     .piped = 2,
     .types = "u8 i8 u16 i16 u32 i32 u64 i64 f32 rgb8 rgba8",
     .random_access = "but .gz",
     .open = open_nifti,
     .create = create_nifti,
     .open_stream = nullptr,
     .magic = "",
     .wide_integers = true,
     .images = false},
    {.name = "mrc",
     .endings = mrc,
     .written = 4,
     .piped = 4,
     .types = "u8 i8 u16 i16 f16 f32",
     .random_access = "but .gz .bz2",
     .open = open_mrc,
     .create = create_mrc,
     .open_stream = nullptr,
     .magic = "",
     .wide_integers = true,
     .images = false},
    {.name = "metaimage",
     .endings = meta,
     .written = 2,
     .piped = 1,
     .types = "u8 i8 u16 i16 u32 i32 u64 i64 f32 rgb8 rgba8",
     .random_access = "raw data in one file",
     .open = open_meta_image,
     .create = create_meta_image,
     .open_stream = nullptr,
     .magic = "",
     .wide_integers = true,
     .images = false},
    {.name = "vtk",
     .endings = vtk,
     .written = 1,
     .piped = 1,
     .types = "u8 i8 u16 i16 u32 i32 u64 i64 f32 rgb8 rgba8",
     .random_access = "but text",
     .open = open_vtk,
     .create = create_vtk,
     .open_stream = nullptr,
     .magic = "",
     .wide_integers = true,
     .images = false},
    {.name = "vti",
     .endings = vti,
     .written = 1,
     .piped = 1,
     .types = "u8 i8 u16 i16 u32 i32 u64 i64 f32 rgb8 rgba8",
     .random_access = "but text and base64",
     .open = open_vti,
     .create = create_vti,
     .open_stream = nullptr,
     .magic = "",
     .wide_integers = true,
     .images = false},
    {.name = "npy",
     .endings = npy,
     .written = 1,
     .piped = 1,
     .types = "u8 i8 u16 i16 u32 i32 u64 i64 f16 f32 rgb8 rgba8 bit",
     .random_access = "yes",
     .open = open_npy,
     .create = create_npy,
     .open_stream = open_npy,
     .magic = "\x93NUMPY",
     .wide_integers = true,
     .images = false},
    {.name = "raw",
     .endings = raw,
     .written = 1,
     .piped = 1,
     .types = "u8 i8 u16 i16 u32 i32 u64 i64 f16 f32 rgb8 rgba8 bit",
     .random_access = "yes",
     .open = open_raw,
     .create = create_raw,
     .open_stream = nullptr,
     .magic = "",
     .wide_integers = true,
     .images = false},
    {.name = "vdb",
     .endings = vdb,
     .written = 1,
     .piped = 0,
     .types = "f16 f32",  // others come back as these, or in wider integers
     .random_access = "yes",
     .open = open_vdb,
     .create = create_vdb,
     .open_stream = nullptr,
     .magic = "",
     .wide_integers = false,
     .images = false},
    {.name = "slices",
     .endings = images,
     .written = 4,
     .piped = 0,
     .types = "u8 i8 u16 i16 f32 rgb8 rgba8",  // of TIFF
     .random_access = "by slice",
     .open = open_image_stack,
     .create = create_image_stack,
     .open_stream = nullptr,
     .magic = "",
     .wide_integers = false,
     .images = true},
    {.name = "slices",
     .endings = dicom,
     .written = 0,
     .piped = 0,
     .types = "u8 i8 u16 i16 rgb8",
     .random_access = "by slice",
     .open = open_dicom,
     .create = nullptr,
     .open_stream = nullptr,
     .magic = "",
     .wide_integers = false,
     .images = false},
};

}  // namespace

std::span<const VolumeFormat> volume_formats() {
  return formats;
}

const VolumeFormat* find_volume_format(std::string_view name) {
  for (const VolumeFormat& format : formats)
    for (const std::string_view ending : format.endings)
      if (has_ending(name, ending)) return &format;
  return nullptr;
}

Result<KnownStream> recognise(std::unique_ptr<InputStream> stream) {
  std::array<char, 8> bytes{};
  size_t have = 0;
  while (have < bytes.size()) {
    VOX_TRY(const size_t got, stream->read(std::as_writable_bytes(std::span(bytes)).subspan(have)));
    if (got == 0) break;
    have += got;
  }
  const std::string_view head(bytes.data(), have);
  const auto* const found = std::find_if(std::begin(formats), std::end(formats), [&](const VolumeFormat& f) {
    return f.open_stream && head.starts_with(f.magic);
  });
  const VolumeFormat* const format = found == std::end(formats) ? std::begin(formats) : found;
  return KnownStream{prepend(std::string(head), std::move(stream)), format};
}

std::string volume_endings(bool written) {
  std::string text;
  for (const VolumeFormat& format : formats) {
    if (format.images) continue;
    for (const std::string_view ending :
         format.endings.first(written ? format.written : format.endings.size()))
      text.append(text.empty() ? "" : " ").append(ending);
  }
  return text;
}

}  // namespace voxkit
