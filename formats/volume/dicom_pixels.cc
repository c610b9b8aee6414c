#include "formats/volume/dicom_pixels.h"

#include <fmt/format.h>
#include <gdcmDataElement.h>
#include <gdcmJPEG2000Codec.h>
#include <gdcmJPEGCodec.h>
#include <gdcmJPEGLSCodec.h>
#include <gdcmSequenceOfFragments.h>
#include <gdcmTransferSyntax.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <span>

#include "formats/volume/dicom_rle.h"

namespace voxkit {
namespace {

constexpr const char* run_length = "1.2.840.10008.1.2.5";

bool is_jpeg_2000(const DicomHeader& h) {
  return h.transfer_syntax.starts_with("1.2.840.10008.1.2.4.9");
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
           word(40) == h.samples && (byte(42) & 0x7f) < h.bits_allocated;
  }
  bool frame = false, tables = false;
  if (word(0) != 0xffd8) return false;
  for (size_t at = 2; at + 10 <= code.size();) {
    const int64_t marker = word(at), length = word(at + 2);
    if (marker < 0xffc0 || marker == 0xffff || length < 2) return false;
    if (marker == 0xffda) return frame && tables;
    if (marker == 0xffc0 || marker == 0xffc1 || marker == 0xffc3 || marker == 0xfff7) {
      if (frame || byte(at + 4) < 2 || byte(at + 4) > h.bits_allocated || word(at + 5) != h.rows ||
          word(at + 7) != h.columns || byte(at + 9) != h.samples)
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
  codec->SetPhotometricInterpretation(
      h.samples == 1 ? gdcm::PhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2)
                     : gdcm::PhotometricInterpretation(
                           gdcm::PhotometricInterpretation::GetPIType(h.photometric.c_str())));
  codec->SetPixelFormat(gdcm::PixelFormat(
      static_cast<uint16_t>(h.samples), static_cast<uint16_t>(h.bits_allocated),
      static_cast<uint16_t>(h.bits_stored), static_cast<uint16_t>(h.high_bit), h.is_signed));
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

/// The pixels of a compressed frame.
Result<std::vector<std::byte>> decode(const DicomHeader& h, const DicomFrame& frame) {
  try {
    std::ifstream file(h.path, std::ios_base::binary);
    std::vector<char> code;  // the fragments of a frame are one code
    for (int64_t i = 0; i < frame.fragments; ++i) {
      const FilePart& part = h.pixels[static_cast<size_t>(frame.first + i)];
      const size_t before = code.size();
      code.resize(before + static_cast<size_t>(part.bytes));
      file.seekg(part.offset);
      if (!file.read(code.data() + before, part.bytes))
        return bad_input(h.path, "cannot read the pixels: the file is shorter than when it was opened");
    }
    std::vector<std::byte> pixels(static_cast<size_t>(h.slice_bytes()));
    if (h.transfer_syntax != run_length) {
      VOX_CHECK(decode_jpeg(h, code, pixels));
    } else if (!decode_dicom_rle(std::as_bytes(std::span(code)), h.columns * h.rows,
                                 static_cast<int>(h.samples), h.bits_allocated / 8, pixels.data())) {
      return bad_input(h.path, "corrupt DICOM file: its run-length code ends early");
    }
    return pixels;
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, h.path, "not enough memory to decode a slice");
  } catch (const std::exception&) {
    return bad_input(h.path, "corrupt DICOM file: its pixels cannot be decoded");
  }
}

/// The pixels of a frame that is not compressed.
Result<std::vector<std::byte>> load(const DicomHeader& h, const DicomFrame& frame) {
  const FilePart& part = h.pixels.front();
  const bool bits = h.bits_allocated == 1;
  const int64_t first = bits ? frame.first / 8 : frame.first;
  const int64_t count = bits ? (frame.first % 8 + h.columns * h.rows + 7) / 8 : h.slice_bytes();
  if (first > part.bytes || count > part.bytes - first)
    return bad_input(h.path, fmt::format("corrupt DICOM file: its pixels end after {} bytes: expected {}",
                                         part.bytes, first + count));
  std::vector<std::byte> pixels(static_cast<size_t>(count));
  std::ifstream file(h.path, std::ios_base::binary);
  file.seekg(part.offset + first);
  if (!file.read(reinterpret_cast<char*>(pixels.data()), count))
    return bad_input(h.path, "cannot read the pixels: the file is shorter than when it was opened");
  const auto bytes = static_cast<size_t>(h.bits_allocated / 8);
  if (h.big_endian && bytes > 1)
    for (size_t i = 0; i + bytes <= pixels.size(); i += bytes)
      std::reverse(pixels.begin() + static_cast<ptrdiff_t>(i),
                   pixels.begin() + static_cast<ptrdiff_t>(i + bytes));
  if (!bits) return pixels;
  std::vector<std::byte> voxels(static_cast<size_t>(h.columns * h.rows));
  for (size_t i = 0; i < voxels.size(); ++i) {
    const size_t bit = static_cast<size_t>(frame.first % 8) + i;
    voxels[i] = pixels[bit / 8] >> (bit % 8) & std::byte{1};
  }
  return voxels;
}

/// Samples lie in the bits up to the high bit. Others may hold an overlay: they become copies of the sign,
/// or 0.
template <class Sample>
void take_bits(const DicomHeader& h, std::vector<std::byte>& pixels) {
  const uint64_t mask = (uint64_t{1} << h.bits_stored) - 1;
  const uint64_t sign = h.is_signed ? uint64_t{1} << (h.bits_stored - 1) : 0;
  const int shift = h.high_bit + 1 - h.bits_stored;
  for (size_t i = 0; i + sizeof(Sample) <= pixels.size(); i += sizeof(Sample)) {
    Sample sample;
    std::memcpy(&sample, &pixels[i], sizeof sample);
    sample = static_cast<Sample>(((uint64_t{sample} >> shift & mask) ^ sign) - sign);
    std::memcpy(&pixels[i], &sample, sizeof sample);
  }
}

/// Colours that are brightness and two differences (ITU-R BT.601), or one picture after the other, as RGB.
void to_rgb(const DicomHeader& h, bool planar, std::vector<std::byte>& pixels) {
  const auto count = static_cast<size_t>(h.columns * h.rows);
  if (planar) {
    const std::vector<std::byte> planes = pixels;
    for (size_t i = 0; i < count; ++i)
      for (size_t c = 0; c < 3; ++c) pixels[3 * i + c] = planes[c * count + i];
  }
  if (!h.photometric.starts_with("YBR") || is_jpeg_2000(h)) return;
  for (size_t i = 0; i < count; ++i) {
    const double y = std::to_integer<int>(pixels[3 * i]), cb = std::to_integer<int>(pixels[3 * i + 1]) - 128,
                 cr = std::to_integer<int>(pixels[3 * i + 2]) - 128;
    const double rgb[3] = {y + 1.402 * cr, y - 0.344136 * cb - 0.714136 * cr, y + 1.772 * cb};
    for (size_t c = 0; c < 3; ++c)
      pixels[3 * i + c] = static_cast<std::byte>(std::lround(std::clamp(rgb[c], 0.0, 255.0)));
  }
}

void look_up(const DicomHeader& h, std::vector<std::byte>& pixels) {
  const auto count = static_cast<size_t>(h.columns * h.rows),
             bytes = static_cast<size_t>(h.bits_allocated / 8);
  std::vector<std::byte> rgb(3 * count);
  const DicomPalette& palette = *h.palette;
  for (size_t i = 0; i < count; ++i) {
    int value = std::to_integer<int>(pixels[i * bytes]);
    if (bytes == 2) value |= std::to_integer<int>(pixels[i * 2 + 1]) << 8;
    if (h.is_signed) value = bytes == 2 ? static_cast<int16_t>(value) : static_cast<int8_t>(value);
    const int last = static_cast<int>(palette.colors.size()) - 1;
    const auto& color = palette.colors[static_cast<size_t>(std::clamp(value - palette.first, 0, last))];
    for (size_t c = 0; c < 3; ++c) rgb[3 * i + c] = static_cast<std::byte>(color[c] >> 8);
  }
  pixels = std::move(rgb);
}

}  // namespace

Result<DicomPixels> dicom_pixels(const DicomHeader& h, const OpenOptions& options, uint64_t memory_limit) {
  if (h.rows < 1 || h.columns < 1) return bad_input(h.path, "image without pixels");
  const bool grey = h.samples == 1 && h.photometric.starts_with("MONOCHROME");
  const bool indices = h.samples == 1 && h.palette != nullptr;
  const bool compressed_color = h.encapsulated && (h.photometric == "YBR_FULL_422" ||
                                                   h.photometric == "YBR_RCT" || h.photometric == "YBR_ICT");
  const bool color = h.samples == 3 && h.bits_allocated == 8 && h.bits_stored == 8 &&
                     (h.photometric == "RGB" || h.photometric == "YBR_FULL" || compressed_color);
  if (!grey && !indices && !color)
    return bad_input(h.path,
                     fmt::format("photometric interpretation {} with {} samples a pixel of {} bits: "
                                 "expected MONOCHROME1, MONOCHROME2 or PALETTE COLOR with 1, or RGB or "
                                 "YBR_FULL with 3 of 8 bits",
                                 h.photometric, h.samples, h.bits_allocated));
  const bool floats = h.is_float && (h.bits_allocated == 32 || h.bits_allocated == 64) && !h.encapsulated;
  const bool integers =
      !h.is_float &&
      (h.bits_allocated == 8 || h.bits_allocated == 16 || (h.bits_allocated == 32 && !h.encapsulated)) &&
      h.bits_stored >= 1 && h.bits_stored <= h.bits_allocated && h.high_bit >= h.bits_stored - 1 &&
      h.high_bit < h.bits_allocated;
  const bool bits = !h.is_float && h.bits_allocated == 1 && !h.encapsulated && grey;
  if (!floats && !integers && !bits)
    return bad_input(h.path,
                     fmt::format("pixels have {} bits, {} of them used up to bit {}: expected 1, 8, 16 or "
                                 "32 (compressed: 8 or 16), or floats",
                                 h.bits_allocated, h.bits_stored, h.high_bit));
  int64_t held = 0;
  for (const FilePart& part : h.pixels) held += part.bytes;
  // The best codecs reduce flat pictures some thousandfold.
  const int64_t bytes = h.slice_bytes();
  if (bytes / (h.encapsulated ? 65536 : 1) > held)
    return bad_input(h.path,
                     fmt::format("header says {} x {} pixels of {} bits: its {} bytes of pixels cannot "
                                 "hold them",
                                 h.columns, h.rows, h.bits_allocated * h.samples, held));
  const auto frames = static_cast<double>(h.frames.size());
  if (!h.encapsulated && frames * static_cast<double>(h.columns * h.rows * h.samples) * h.bits_allocated / 8 >
                             static_cast<double>(held))
    return bad_input(h.path,
                     fmt::format("file of {} frames of {} bytes: its {} bytes of pixels cannot hold them",
                                 h.frames.size(), bytes, held));
  if (static_cast<uint64_t>(bytes) > memory_limit / 2)
    return fail(ErrorCode::limit, h.path,
                fmt::format("one slice takes {} bytes: more than half of --max-memory", bytes));
  DicomPixels pixels;
  if (color || (indices && !options.labels)) {
    pixels.components = 3;
    pixels.format = VoxelFormat::rgb24;
    pixels.colors = indices;
    return pixels;
  }
  switch (h.bits_allocated) {
    case 1:
      pixels.type = SampleType::bit;
      break;
    case 8:
      pixels.type = h.is_signed ? SampleType::i8 : SampleType::u8;
      break;
    case 16:
      pixels.type = h.is_signed ? SampleType::i16 : SampleType::u16;
      break;
    case 32:
      pixels.type = floats ? SampleType::f32 : h.is_signed ? SampleType::i32 : SampleType::u32;
      break;
    default:
      pixels.type = SampleType::f64;
      break;
  }
  pixels.format = scalar_format(pixels.type);
  return pixels;
}

Status read_dicom_samples(const DicomHeader& h, const DicomFrame& frame, const DicomPixels& pixels,
                          std::vector<std::byte>& samples) {
  if (h.encapsulated) {
    VOX_TRY(samples, decode(h, frame));
  } else {
    VOX_TRY(samples, load(h, frame));
  }
  const bool whole = h.bits_stored == h.bits_allocated;
  if (!whole && h.bits_allocated == 8) take_bits<uint8_t>(h, samples);
  if (!whole && h.bits_allocated == 16) take_bits<uint16_t>(h, samples);
  if (!whole && h.bits_allocated == 32) take_bits<uint32_t>(h, samples);
  if (pixels.colors) {
    look_up(h, samples);
  } else if (pixels.components == 3) {
    // Run-length codes are unpacked pixel by pixel, and so are those of JPEG.
    to_rgb(h, h.planar && !h.encapsulated, samples);
  }
  return {};
}

}  // namespace voxkit
