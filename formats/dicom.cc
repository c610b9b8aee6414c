// Folders of DICOM slices by GDCM: one series of CT, MR or other scalar images, put in order by where they
// lie in the patient.
#include <fmt/format.h>
#include <gdcmImageReader.h>
#include <gdcmReader.h>
#include <gdcmTrace.h>
#include <gdcmTransferSyntax.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <system_error>

#include "formats/module.h"
#include "formats/natural_order.h"
#include "formats/sliced_source.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;
using gdcm::Tag;

/// What a slice's header says.
struct SliceHeader {
  std::string path, series, photometric;
  int64_t columns = 0, rows = 0, samples = 1;
  double frames = 1;
  int bits_allocated = 0, bits_stored = 0, high_bit = 0;
  bool is_signed = false, encapsulated = false;
  double slope = 1, intercept = 0;
  std::optional<int64_t> instance;
  std::vector<double> position;       ///< 3, in mm, or none
  std::vector<double> orientation;    ///< 6: directions of a row and of a column, or none
  std::vector<double> pixel_spacing;  ///< 2: between rows, between columns, or none
  double thickness = 1;

  int64_t slice_bytes() const { return columns * rows * (bits_allocated / 8); }
};

/// The elements of a data set as numbers and text. Values are taken from their bytes: a damaged file may give
/// an element any length and type.
class Elements {
 public:
  explicit Elements(const gdcm::DataSet& set) : set_(set) {}

  std::string text(uint16_t group, uint16_t element) const {
    const gdcm::ByteValue* bytes = value(group, element);
    if (!bytes || !bytes->GetPointer()) return {};
    std::string text(bytes->GetPointer(), bytes->GetLength());
    const auto padding = [](char c) { return c == ' ' || c == '\0'; };
    while (!text.empty() && padding(text.back())) text.pop_back();
    text.erase(text.begin(), std::find_if_not(text.begin(), text.end(), padding));
    return text;
  }
  std::optional<int> number(uint16_t group, uint16_t element) const {
    const gdcm::ByteValue* bytes = value(group, element);
    if (!bytes || !bytes->GetPointer() || bytes->GetLength() < 2) return std::nullopt;
    uint16_t number;
    std::memcpy(&number, bytes->GetPointer(), sizeof number);
    return number;
  }
  /// Decimal numbers separated by backslashes: exactly `count` finite ones, or none.
  std::vector<double> decimals(uint16_t group, uint16_t element, size_t count) const {
    const std::string all = text(group, element);
    std::vector<double> numbers;
    for (const char *p = all.data(), *end = p + all.size(); p < end;) {
      while (p < end && (*p == ' ' || *p == '+')) ++p;
      double number = 0;
      const auto [stop, error] = std::from_chars(p, end, number);
      if (error != std::errc() || !std::isfinite(number)) return {};
      numbers.push_back(number);
      p = stop;
      while (p < end && *p == ' ') ++p;
      if (p < end && *p++ != '\\') return {};
    }
    return numbers.size() == count ? numbers : std::vector<double>();
  }
  double decimal(uint16_t group, uint16_t element, double otherwise) const {
    const auto one = decimals(group, element, 1);
    return one.empty() ? otherwise : one[0];
  }

 private:
  const gdcm::ByteValue* value(uint16_t group, uint16_t element) const {
    const Tag tag(group, element);
    return set_.FindDataElement(tag) ? set_.GetDataElement(tag).GetByteValue() : nullptr;
  }
  const gdcm::DataSet& set_;
};

bool has_dicom_magic(const std::string& path) {
  char head[132] = {};
  std::ifstream file(path, std::ios_base::binary);
  return file.read(head, sizeof head) && std::equal(head + 128, head + 132, "DICM");
}

/// The header of an image, or nothing where a DICOM file is none (a DICOMDIR, a report).
Result<std::optional<SliceHeader>> read_header(const std::string& path) {
  gdcm::Reader reader;
  reader.SetFileName(path.c_str());
  static const std::set<Tag> wanted = {
      Tag(0x0018, 0x0050), Tag(0x0018, 0x0088), Tag(0x0020, 0x000e), Tag(0x0020, 0x0013), Tag(0x0020, 0x0032),
      Tag(0x0020, 0x0037), Tag(0x0028, 0x0002), Tag(0x0028, 0x0004), Tag(0x0028, 0x0008), Tag(0x0028, 0x0010),
      Tag(0x0028, 0x0011), Tag(0x0028, 0x0030), Tag(0x0028, 0x0100), Tag(0x0028, 0x0101), Tag(0x0028, 0x0102),
      Tag(0x0028, 0x0103), Tag(0x0028, 0x1052), Tag(0x0028, 0x1053)};
  if (!reader.ReadSelectedTags(wanted))
    return bad_input(path, "corrupt DICOM file: its header cannot be read");
  const Elements elements(reader.GetFile().GetDataSet());
  if (!elements.number(0x0028, 0x0010) || !elements.number(0x0028, 0x0011)) return std::nullopt;
  SliceHeader header;
  header.path = path;
  header.rows = *elements.number(0x0028, 0x0010);
  header.columns = *elements.number(0x0028, 0x0011);
  header.series = elements.text(0x0020, 0x000e);
  header.photometric = elements.text(0x0028, 0x0004);
  header.samples = elements.number(0x0028, 0x0002).value_or(1);
  header.frames = elements.decimal(0x0028, 0x0008, 1);
  header.bits_allocated = elements.number(0x0028, 0x0100).value_or(0);
  header.bits_stored = elements.number(0x0028, 0x0101).value_or(header.bits_allocated);
  header.high_bit = elements.number(0x0028, 0x0102).value_or(header.bits_stored - 1);
  header.is_signed = elements.number(0x0028, 0x0103).value_or(0) == 1;
  header.slope = elements.decimal(0x0028, 0x1053, 1);
  header.intercept = elements.decimal(0x0028, 0x1052, 0);
  if (const auto number = elements.decimals(0x0020, 0x0013, 1); !number.empty() && std::abs(number[0]) < 1e15)
    header.instance = static_cast<int64_t>(number[0]);
  header.position = elements.decimals(0x0020, 0x0032, 3);
  header.orientation = elements.decimals(0x0020, 0x0037, 6);
  header.pixel_spacing = elements.decimals(0x0028, 0x0030, 2);
  header.thickness = elements.decimal(0x0018, 0x0088, elements.decimal(0x0018, 0x0050, 1));
  header.encapsulated = reader.GetFile().GetHeader().GetDataSetTransferSyntax().IsEncapsulated();
  return header;
}

/// That a slice is of a kind that we read, and that its file and our memory can hold it.
Status check_slice(const SliceHeader& h, uint64_t memory_limit) {
  if (h.rows < 1 || h.columns < 1) return bad_input(h.path, "image without pixels");
  if (h.frames != 1)
    return bad_input(h.path, fmt::format("file of {} frames: expected one slice a file", h.frames));
  if (h.samples != 1 || !h.photometric.starts_with("MONOCHROME"))
    return bad_input(
        h.path, fmt::format("photometric interpretation {} with {} samples a pixel: expected MONOCHROME1 or "
                            "MONOCHROME2 with 1",
                            h.photometric, h.samples));
  if ((h.bits_allocated != 8 && h.bits_allocated != 16) || h.bits_stored < 1 ||
      h.bits_stored > h.bits_allocated || h.high_bit != h.bits_stored - 1)
    return bad_input(
        h.path, fmt::format("pixels have {} bits, {} of them used up to bit {}: expected 8 or 16, used from "
                            "the lowest up",
                            h.bits_allocated, h.bits_stored, h.high_bit));
  std::error_code error;
  const auto file_bytes = fs::file_size(h.path, error);
  if (error) return bad_input(h.path, "cannot read the file: " + error.message());
  // The best codecs reduce flat pictures some thousandfold.
  const uint64_t bytes = static_cast<uint64_t>(h.slice_bytes());
  if (bytes / (h.encapsulated ? 65536 : 1) > file_bytes)
    return bad_input(h.path,
                     fmt::format("header says {} x {} pixels of {} bits: a file of {} bytes cannot hold them",
                                 h.columns, h.rows, h.bits_allocated, file_bytes));
  if (bytes > memory_limit / 2)
    return fail(ErrorCode::limit, h.path,
                fmt::format("one slice takes {} bytes: more than half of --max-memory", bytes));
  return {};
}

Status check_alike(const SliceHeader& first, const SliceHeader& h) {
  const auto differs = [&](const char* what) {
    return bad_input(
        h.path, fmt::format("{} differs from that of {}: expected one for all slices", what, first.path));
  };
  const auto near = [](const std::vector<double>& a, const std::vector<double>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](double x, double y) { return std::abs(x - y) < 1e-3; });
  };
  if (h.rows != first.rows || h.columns != first.columns) return differs("size of the image");
  if (h.bits_allocated != first.bits_allocated || h.bits_stored != first.bits_stored ||
      h.is_signed != first.is_signed)
    return differs("pixel type");
  if (h.photometric != first.photometric) return differs("photometric interpretation");
  if (h.slope != first.slope || h.intercept != first.intercept) return differs("rescale slope or intercept");
  if (!near(h.pixel_spacing, first.pixel_spacing)) return differs("pixel spacing");
  if (!near(h.orientation, first.orientation)) return differs("orientation");
  return {};
}

Status check_one_series(const std::string& folder, const std::vector<SliceHeader>& slices) {
  std::map<std::string, size_t> series;
  for (const SliceHeader& h : slices) ++series[h.series];
  if (series.size() == 1) return {};
  std::string list;
  for (const auto& [uid, count] : series) {
    if (list.size() > 400) {
      list += " …";
      break;
    }
    list +=
        fmt::format("{}{} ({} slices)", list.empty() ? "" : ", ", uid.empty() ? "no identifier" : uid, count);
  }
  return bad_input(
      folder, fmt::format("slices of {} series: expected one a folder: there are {}", series.size(), list));
}

/// Puts the slices in order: by position along their normal, else by instance number, else by file name.
/// Gives the distance of neighbours, the median where they are uneven.
Result<double> sort_slices(std::vector<SliceHeader>& slices) {
  const std::vector<double> o = slices.front().orientation;
  const bool placed =
      !o.empty() && std::all_of(slices.begin(), slices.end(), [](auto& h) { return !h.position.empty(); });
  if (placed) {
    const double normal[3] = {o[1] * o[5] - o[2] * o[4], o[2] * o[3] - o[0] * o[5],
                              o[0] * o[4] - o[1] * o[3]};
    const double length = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    if (!(std::abs(length - 1) < 0.01))
      return bad_input(slices.front().path, "orientation is none: expected two unit vectors at right angles");
    const auto along = [&](const SliceHeader& h) {
      return normal[0] * h.position[0] + normal[1] * h.position[1] + normal[2] * h.position[2];
    };
    std::stable_sort(slices.begin(), slices.end(), [&](auto& a, auto& b) { return along(a) < along(b); });
    std::vector<double> distances;
    for (size_t i = 1; i < slices.size(); ++i) {
      distances.push_back(along(slices[i]) - along(slices[i - 1]));
      if (distances.back() < 1e-4)
        return bad_input(
            slices[i].path,
            fmt::format("lies where {} lies: expected one slice at each position", slices[i - 1].path));
    }
    if (distances.empty()) return slices.front().thickness;
    std::nth_element(distances.begin(), distances.begin() + static_cast<int64_t>(distances.size() / 2),
                     distances.end());
    return distances[distances.size() / 2];
  }
  std::set<int64_t> instances;
  for (const SliceHeader& h : slices)
    if (h.instance) instances.insert(*h.instance);
  if (instances.size() == slices.size())
    std::sort(slices.begin(), slices.end(), [](auto& a, auto& b) { return *a.instance < *b.instance; });
  else
    std::sort(slices.begin(), slices.end(), [](auto& a, auto& b) { return natural_less(a.path, b.path); });
  return slices.front().thickness;
}

class DicomSeries : public SlicedSource {
 public:
  static SourceResult open(const std::string& folder, Context& ctx) {
    std::unique_ptr<DicomSeries> series(new DicomSeries);
    std::vector<SliceHeader>& slices = series->slices_;
    std::error_code error;
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
      VOX_CHECK(check_interrupt());
      std::error_code ignored;
      if (!it->is_regular_file(ignored) || !has_dicom_magic(it->path().string())) continue;
      VOX_TRY(auto header, read_header(it->path().string()));
      if (header) slices.push_back(std::move(*header));
    }
    if (error) return bad_input(folder, "cannot read the folder: " + error.message());
    if (slices.empty()) return bad_input(folder, "no DICOM images in this folder");
    // The order of a folder's entries is chance: messages shall not depend on it.
    std::sort(slices.begin(), slices.end(), [](auto& a, auto& b) { return natural_less(a.path, b.path); });
    VOX_CHECK(check_one_series(folder, slices));
    for (const SliceHeader& h : slices) {
      VOX_CHECK(check_slice(h, ctx.memory->limit()));
      VOX_CHECK(check_alike(slices.front(), h));
    }
    VOX_TRY(const double distance, sort_slices(slices));

    const SliceHeader& first = slices.front();
    VolumeInfo& info = series->info_;
    info.dims = {first.columns, first.rows, static_cast<int64_t>(slices.size())};
    info.sample_type = first.bits_allocated == 8 ? (first.is_signed ? SampleType::i8 : SampleType::u8)
                                                 : (first.is_signed ? SampleType::i16 : SampleType::u16);
    info.format = scalar_format(info.sample_type);
    info.slope = first.slope;
    info.intercept = first.intercept;
    if (first.pixel_spacing.size() == 2 && first.pixel_spacing[0] > 0 && first.pixel_spacing[1] > 0)
      info.spacing = {first.pixel_spacing[1], first.pixel_spacing[0], 1};
    if (distance > 0) info.spacing[2] = distance;
    if (!first.position.empty()) info.origin = {first.position[0], first.position[1], first.position[2]};
    if (!checked_voxels(info.dims)) return bad_input(folder, "series has too many voxels");
    series->keep_slices(ctx);
    return series;
  }

 protected:
  Status read_rows(int64_t z, int64_t y0, int64_t y1, std::byte* rows) override {
    const SliceHeader& h = slices_[static_cast<size_t>(z)];
    try {
      gdcm::ImageReader reader;
      reader.SetFileName(h.path.c_str());
      if (!reader.Read()) return bad_input(h.path, "corrupt DICOM file: its image cannot be read");
      const gdcm::Image& image = reader.GetImage();
      const gdcm::PixelFormat& pixels = image.GetPixelFormat();
      if (image.GetColumns() != h.columns || image.GetRows() != h.rows ||
          pixels.GetBitsAllocated() != h.bits_allocated || pixels.GetSamplesPerPixel() != 1 ||
          image.GetBufferLength() != static_cast<uint64_t>(h.slice_bytes()))
        return bad_input(h.path, "image is not of the size and type that its header says");
      const bool whole = y0 == 0 && y1 == h.rows;
      std::vector<std::byte> own(whole ? 0 : static_cast<size_t>(h.slice_bytes()));
      std::byte* decoded = whole ? rows : own.data();
      if (!image.GetBuffer(reinterpret_cast<char*>(decoded)))
        return bad_input(h.path, "corrupt DICOM file: its pixels cannot be decoded");
      const int64_t row_bytes = h.columns * (h.bits_allocated / 8);
      if (!whole) std::memcpy(rows, decoded + y0 * row_bytes, static_cast<size_t>((y1 - y0) * row_bytes));
      const int64_t count = (y1 - y0) * h.columns;
      h.bits_allocated == 8 ? store<uint8_t>(h, rows, count) : store<uint16_t>(h, rows, count);
      return {};
    } catch (const std::bad_alloc&) {
      return fail(ErrorCode::limit, h.path, "not enough memory to decode a slice");
    } catch (const std::exception&) {
      return bad_input(h.path, "corrupt DICOM file: its image cannot be read");
    }
  }

 private:
  DicomSeries() = default;

  /// Samples as they are stored in our formats. Bits above the stored ones may hold an overlay: they become
  /// copies of the sign, or 0. Extending the sign and adding the bias 2^(n-1) are one: flip the sign bit,
  /// then add the difference.
  template <class Sample>
  static void store(const SliceHeader& h, std::byte* rows, int64_t count) {
    const unsigned mask = (1u << h.bits_stored) - 1;
    const unsigned sign = h.is_signed ? 1u << (h.bits_stored - 1) : 0;
    const unsigned lift = h.is_signed ? (1u << (h.bits_allocated - 1)) - sign : 0;
    for (int64_t i = 0; i < count; ++i) {
      Sample sample;
      std::memcpy(&sample, rows + i * static_cast<int64_t>(sizeof sample), sizeof sample);
      sample = static_cast<Sample>(((sample & mask) ^ sign) + lift);
      std::memcpy(rows + i * static_cast<int64_t>(sizeof sample), &sample, sizeof sample);
    }
  }

  std::vector<SliceHeader> slices_;
};

SourceResult open_series(const std::string& folder, const std::string&, Context& ctx) {
  // The library reports on standard error, which is ours.
  gdcm::Trace::DebugOff();
  gdcm::Trace::WarningOff();
  gdcm::Trace::ErrorOff();
  try {
    return DicomSeries::open(folder, ctx);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, folder, "not enough memory to read the headers");
  } catch (const std::exception& error) {
    const std::string text = error.what();
    return bad_input(folder, "corrupt DICOM file: " + text.substr(0, text.find('\n')));
  }
}

const ModuleTable table{.open = open_series};

}  // namespace
}  // namespace voxkit

extern "C" const voxkit::ModuleTable* voxkit_module() {
  return &voxkit::table;
}
