#include "formats/volume/volume_formats.h"

#include "formats/names.h"

namespace voxkit {
namespace {

using Endings = std::string_view[];

constexpr Endings nrrd = {".nrrd", ".nhdr"};
constexpr Endings nifti = {".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"};
constexpr Endings mrc = {".mrc",     ".map",    ".ccp4",    ".rec",     ".mrc.gz",   ".map.gz",
                         ".ccp4.gz", ".rec.gz", ".mrc.bz2", ".map.bz2", ".ccp4.bz2", ".rec.bz2"};
constexpr Endings raw = {".raw"};
constexpr Endings vdb = {".vdb"};
constexpr Endings images = {".tif", ".tiff", ".png", ".exr"};
constexpr Endings dicom = {".dcm"};

constexpr VolumeFormat formats[] = {
    {"nrrd", nrrd, 2, open_nrrd, create_nrrd, true, false},
    {"nifti", nifti, 2, open_nifti, create_nifti, true, false},
    {"mrc", mrc, 4, open_mrc, create_mrc, true, false},
    {"raw", raw, 1, open_raw, create_raw, true, false},
    {"vdb", vdb, 1, open_vdb, create_vdb, false, false},
    {"slices", images, 4, open_image_stack, create_image_stack, false, true},
    {"slices", dicom, 0, open_dicom, nullptr, false, false},
};

}  // namespace

const VolumeFormat* find_volume_format(std::string_view name) {
  for (const VolumeFormat& format : formats)
    for (const std::string_view ending : format.endings)
      if (has_ending(name, ending)) return &format;
  return nullptr;
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
