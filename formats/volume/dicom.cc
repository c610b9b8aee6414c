// Folders of DICOM slices by GDCM: one series of CT, MR or other scalar images, put in order by where they
// lie in the patient.
#include <fmt/format.h>
#include <gdcmDataElement.h>
#include <gdcmJPEG2000Codec.h>
#include <gdcmJPEGCodec.h>
#include <gdcmJPEGLSCodec.h>
#include <gdcmSequenceOfFragments.h>
#include <gdcmTrace.h>
#include <gdcmTransferSyntax.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <span>
#include <system_error>

#include "formats/natural_order.h"
#include "formats/volume/dicom_header.h"
#include "formats/volume/dicom_rle.h"
#include "formats/volume/sliced_source.h"
#include "formats/volume/volume_module.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;

/// That a slice is of a kind that we read, and that its file and our memory can hold it.
Status check_slice(const DicomHeader& h, uint64_t memory_limit) {
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
  uint64_t held = 0;
  for (const FilePart& part : h.pixels) held += static_cast<uint64_t>(part.bytes);
  // The best codecs reduce flat pictures some thousandfold.
  const uint64_t bytes = static_cast<uint64_t>(h.slice_bytes());
  if (bytes / (h.encapsulated ? 65536 : 1) > held)
    return bad_input(
        h.path, fmt::format("header says {} x {} pixels of {} bits: its {} bytes of pixels cannot hold them",
                            h.columns, h.rows, h.bits_allocated, held));
  if (bytes > memory_limit / 2)
    return fail(ErrorCode::limit, h.path,
                fmt::format("one slice takes {} bytes: more than half of --max-memory", bytes));
  return {};
}

Status check_alike(const DicomHeader& first, const DicomHeader& h) {
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

Status check_one_series(const std::string& folder, const std::vector<DicomHeader>& slices) {
  std::map<std::string, size_t> series;
  for (const DicomHeader& h : slices) ++series[h.series];
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
Result<double> sort_slices(std::vector<DicomHeader>& slices) {
  const std::vector<double> o = slices.front().orientation;
  const bool placed =
      !o.empty() && std::all_of(slices.begin(), slices.end(), [](auto& h) { return !h.position.empty(); });
  if (placed) {
    const double normal[3] = {o[1] * o[5] - o[2] * o[4], o[2] * o[3] - o[0] * o[5],
                              o[0] * o[4] - o[1] * o[3]};
    const double length = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    if (!(std::abs(length - 1) < 0.01))
      return bad_input(slices.front().path, "orientation is none: expected two unit vectors at right angles");
    const auto along = [&](const DicomHeader& h) {
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
  for (const DicomHeader& h : slices)
    if (h.instance) instances.insert(*h.instance);
  if (instances.size() == slices.size())
    std::sort(slices.begin(), slices.end(), [](auto& a, auto& b) { return *a.instance < *b.instance; });
  else
    std::sort(slices.begin(), slices.end(), [](auto& a, auto& b) { return natural_less(a.path, b.path); });
  return slices.front().thickness;
}

/// Whether a JPEG, JPEG-LS or JPEG 2000 code stream starts with a header that is whole and states the size
/// and depth of the slice. GDCM's codecs make room for what the code states, and some end the process over a
/// header that is none.
bool has_sound_header(const std::vector<char>& code, const DicomHeader& h) {
  const auto byte = [&](size_t at) { return static_cast<int64_t>(static_cast<unsigned char>(code[at])); };
  const auto word = [&](size_t at) { return byte(at) << 8 | byte(at + 1); };
  if (code.size() < 64) return false;
  if (word(0) == 0xff4f) {  // JPEG 2000: SIZ follows at once; image less its offset, as 32-bit numbers
    const auto number = [&](size_t at) { return word(at) << 16 | word(at + 2); };
    return word(2) == 0xff51 && number(8) - number(16) == h.columns && number(12) - number(20) == h.rows &&
           word(40) == 1 && (byte(42) & 0x7f) < h.bits_allocated;
  }
  bool frame = false, tables = false;
  if (word(0) != 0xffd8) return false;
  for (size_t at = 2; at + 10 <= code.size();) {
    const int64_t marker = word(at), length = word(at + 2);
    if (marker < 0xffc0 || marker == 0xffff || length < 2) return false;
    if (marker == 0xffda) return frame && tables;
    if (marker == 0xffc0 || marker == 0xffc1 || marker == 0xffc3 || marker == 0xfff7) {
      if (frame || byte(at + 4) < 2 || byte(at + 4) > h.bits_allocated || word(at + 5) != h.rows ||
          word(at + 7) != h.columns || byte(at + 9) != 1)
        return false;
      frame = true;
    } else if (marker < 0xffd0 && marker != 0xffc4) {
      return false;  // other kinds of frame, and arithmetic coding
    }
    tables = tables || marker == 0xffc4 || marker == 0xfff7;  // JPEG-LS has no tables
    at += 2 + static_cast<size_t>(length);
  }
  return false;
}

/// Decodes JPEG, JPEG-LS or JPEG 2000 into `out`, which holds a slice. The codecs are called directly and not
/// through gdcm::ImageReader, which copies as many bytes as the code stream decodes to, however many there
/// should be.
Status decode_jpeg(const DicomHeader& h, const std::vector<char>& code, std::vector<std::byte>& out) {
  const auto corrupt = [&](const char* what) {
    return bad_input(h.path, std::string("corrupt DICOM file: ") + what);
  };
  const gdcm::TransferSyntax syntax(gdcm::TransferSyntax::GetTSType(h.transfer_syntax.c_str()));
  gdcm::JPEGCodec jpeg;
  gdcm::JPEGLSCodec jpeg_ls;
  gdcm::JPEG2000Codec jpeg_2000;
  gdcm::ImageCodec* codec = nullptr;
  for (gdcm::ImageCodec* one : std::initializer_list<gdcm::ImageCodec*>{&jpeg, &jpeg_ls, &jpeg_2000})
    if (!codec && one->CanDecode(syntax)) codec = one;
  if (!codec) return bad_input(h.path, fmt::format("unsupported transfer syntax {}", h.transfer_syntax));
  if (!has_sound_header(code, h))
    return corrupt("its compressed image is not of the size and type that its header says");

  gdcm::Fragment fragment;
  fragment.SetByteValue(code.data(), static_cast<uint32_t>(code.size()));
  const auto fragments = gdcm::SequenceOfFragments::New();
  fragments->AddFragment(fragment);
  gdcm::DataElement element(gdcm::Tag(0x7fe0, 0x0010), 0, gdcm::VR::OB);
  element.SetValue(*fragments);
  const unsigned dims[3] = {static_cast<unsigned>(h.columns), static_cast<unsigned>(h.rows), 1};
  codec->SetNumberOfDimensions(2);
  codec->SetDimensions(dims);
  codec->SetPlanarConfiguration(0);
  codec->SetPhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2);
  codec->SetPixelFormat(gdcm::PixelFormat(1, static_cast<uint16_t>(h.bits_allocated),
                                          static_cast<uint16_t>(h.bits_stored),
                                          static_cast<uint16_t>(h.high_bit), h.is_signed));
  jpeg_ls.SetBufferLength(static_cast<unsigned long>(h.slice_bytes()));
  gdcm::DataElement decoded;
  if (!codec->Decode(element, decoded)) return corrupt("its pixels cannot be decoded");
  // Codecs may add a byte to make the number of bytes even.
  const gdcm::ByteValue* bytes = decoded.GetByteValue();
  const int64_t length = bytes ? static_cast<int64_t>(bytes->GetLength()) : 0;
  if (codec->GetPixelFormat().GetBitsAllocated() != h.bits_allocated || length < h.slice_bytes() ||
      length > h.slice_bytes() + 1)
    return corrupt("its pixels are not of the number and type that its header says");
  std::memcpy(out.data(), bytes->GetPointer(), out.size());
  return {};
}

/// The pixels of a compressed slice.
Result<std::vector<std::byte>> decode(const DicomHeader& h) {
  try {
    std::ifstream file(h.path, std::ios_base::binary);
    std::vector<char> code;  // a slice is one frame: its fragments are one code
    for (const FilePart& part : h.pixels) {
      const size_t before = code.size();
      code.resize(before + static_cast<size_t>(part.bytes));
      file.seekg(part.offset);
      if (!file.read(code.data() + before, part.bytes))
        return bad_input(h.path, "cannot read the pixels: the file is shorter than when it was opened");
    }
    std::vector<std::byte> pixels(static_cast<size_t>(h.slice_bytes()));
    if (h.transfer_syntax != "1.2.840.10008.1.2.5") {
      VOX_CHECK(decode_jpeg(h, code, pixels));
    } else if (!decode_dicom_rle(std::as_bytes(std::span(code)), h.columns * h.rows, h.bits_allocated / 8,
                                 pixels.data())) {
      return bad_input(h.path, "corrupt DICOM file: its run-length code ends early");
    }
    return pixels;
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, h.path, "not enough memory to decode a slice");
  } catch (const std::exception&) {
    return bad_input(h.path, "corrupt DICOM file: its pixels cannot be decoded");
  }
}

class DicomSeries : public SlicedSource {
 public:
  static SourceResult open(const std::string& folder, Context& ctx) {
    std::unique_ptr<DicomSeries> series(new DicomSeries);
    std::vector<DicomHeader>& slices = series->slices_;
    std::error_code error;
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
      VOX_CHECK(check_interrupt());
      std::error_code ignored;
      if (!it->is_regular_file(ignored)) continue;
      VOX_TRY(auto header, read_dicom_header(it->path().string()));
      if (header) slices.push_back(std::move(*header));
    }
    if (error) return bad_input(folder, "cannot read the folder: " + error.message());
    if (slices.empty()) return bad_input(folder, "no DICOM images in this folder");
    // The order of a folder's entries is chance: messages shall not depend on it.
    std::sort(slices.begin(), slices.end(), [](auto& a, auto& b) { return natural_less(a.path, b.path); });
    VOX_CHECK(check_one_series(folder, slices));
    for (const DicomHeader& h : slices) {
      VOX_CHECK(check_slice(h, ctx.memory->limit()));
      VOX_CHECK(check_alike(slices.front(), h));
    }
    VOX_TRY(const double distance, sort_slices(slices));

    const DicomHeader& first = slices.front();
    VolumeInfo& info = series->info_;
    info.dims = {first.columns, first.rows, static_cast<int64_t>(slices.size())};
    info.sample_type = first.bits_allocated == 8 ? (first.is_signed ? SampleType::i8 : SampleType::u8)
                                                 : (first.is_signed ? SampleType::i16 : SampleType::u16);
    info.format = scalar_format(info.sample_type);
    info.slope = first.slope;
    info.intercept = first.intercept;
    if (first.pixel_spacing.size() == 2 && first.pixel_spacing[0] > 0 && first.pixel_spacing[1] > 0)
      info.affine = Affine::plain({first.pixel_spacing[1], first.pixel_spacing[0], 1}, {});
    if (distance > 0) info.affine.axes[2][2] = distance;
    if (!first.position.empty())
      info.affine.origin = {first.position[0], first.position[1], first.position[2]};
    if (!checked_voxels(info.dims)) return bad_input(folder, "series has too many voxels");
    series->keep_slices(ctx);
    return series;
  }

 protected:
  Status read_rows(int64_t z, int64_t y0, int64_t y1, std::byte* rows) override {
    const DicomHeader& h = slices_[static_cast<size_t>(z)];
    const int64_t row_bytes = h.columns * (h.bits_allocated / 8);
    if (h.encapsulated) {
      VOX_TRY(const std::vector<std::byte> pixels, decode(h));
      std::memcpy(rows, pixels.data() + y0 * row_bytes, static_cast<size_t>((y1 - y0) * row_bytes));
    } else {
      std::ifstream file(h.path, std::ios_base::binary);
      file.seekg(h.pixels.front().offset + y0 * row_bytes);
      if (!file.read(reinterpret_cast<char*>(rows), (y1 - y0) * row_bytes))
        return bad_input(h.path, "cannot read the pixels: the file is shorter than when it was opened");
      if (h.big_endian && h.bits_allocated == 16)
        for (int64_t i = 0; i < (y1 - y0) * row_bytes; i += 2) std::swap(rows[i], rows[i + 1]);
    }
    const int64_t count = (y1 - y0) * h.columns;
    h.bits_allocated == 8 ? store<uint8_t>(h, rows, count) : store<uint16_t>(h, rows, count);
    return {};
  }

 private:
  DicomSeries() = default;

  /// Samples as they are stored in our formats. Bits above the stored ones may hold an overlay: they become
  /// copies of the sign, or 0. Extending the sign and adding the bias 2^(n-1) are one: flip the sign bit,
  /// then add the difference.
  template <class Sample>
  static void store(const DicomHeader& h, std::byte* rows, int64_t count) {
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

  std::vector<DicomHeader> slices_;
};

SourceResult open_series(const std::string& folder, const OpenOptions&, Context& ctx) {
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

const VolumeModule volumes{.open = open_series};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.volume = &voxkit::volumes)
