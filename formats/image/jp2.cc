// JPEG 2000 by libopenjp2. A module.
#include <fmt/format.h>
#include <openjpeg.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>
#include <new>

#include "formats/image/coded_image_module.h"
#include "formats/image/jp2_codestream.h"

namespace voxkit {
namespace {

template <class T, void (*destroy)(T*)>
struct Destroy {
  void operator()(T* object) const { destroy(object); }
};
using Codec = std::unique_ptr<opj_codec_t, Destroy<opj_codec_t, opj_destroy_codec>>;
using Picture = std::unique_ptr<opj_image_t, Destroy<opj_image_t, opj_image_destroy>>;
using Stream = std::unique_ptr<opj_stream_t, Destroy<opj_stream_t, opj_stream_destroy>>;

constexpr auto failed = static_cast<OPJ_SIZE_T>(-1);

/// What libopenjp2 reads and writes: bytes, and a place in them.
struct Bytes {
  std::vector<std::byte>* out = nullptr;
  std::span<const std::byte> in;
  size_t at = 0;
};

OPJ_SIZE_T read_some(void* to, OPJ_SIZE_T size, void* user) {
  auto& bytes = *static_cast<Bytes*>(user);
  const size_t some = std::min(size, bytes.in.size() - bytes.at);
  if (some == 0) return failed;
  std::memcpy(to, bytes.in.data() + bytes.at, some);
  bytes.at += some;
  return some;
}
OPJ_SIZE_T write_some(void* from, OPJ_SIZE_T size, void* user) {
  auto& bytes = *static_cast<Bytes*>(user);
  // No exception may pass through C.
  try {
    bytes.out->resize(std::max(bytes.out->size(), bytes.at + size));
  } catch (const std::bad_alloc&) {
    return failed;
  }
  std::memcpy(bytes.out->data() + bytes.at, from, size);
  bytes.at += size;
  return size;
}
/// What is skipped when writing is written later: room for lengths.
OPJ_OFF_T skip(OPJ_OFF_T by, void* user) {
  auto& bytes = *static_cast<Bytes*>(user);
  if (by < 0 || (bytes.out == nullptr && static_cast<uint64_t>(by) > bytes.in.size() - bytes.at)) return -1;
  bytes.at += static_cast<size_t>(by);
  return by;
}
OPJ_BOOL seek(OPJ_OFF_T to, void* user) {
  auto& bytes = *static_cast<Bytes*>(user);
  const size_t size = bytes.out != nullptr ? bytes.out->size() : bytes.in.size();
  if (to < 0 || static_cast<uint64_t>(to) > size) return OPJ_FALSE;
  bytes.at = static_cast<size_t>(to);
  return OPJ_TRUE;
}

Stream stream_of(Bytes& bytes) {
  const bool reads = bytes.out == nullptr;
  Stream stream(opj_stream_create(size_t{1} << 16, reads ? OPJ_TRUE : OPJ_FALSE));
  if (!stream) return nullptr;
  opj_stream_set_user_data(stream.get(), &bytes, nullptr);
  opj_stream_set_user_data_length(stream.get(), bytes.in.size());
  opj_stream_set_read_function(stream.get(), read_some);
  opj_stream_set_write_function(stream.get(), write_some);
  opj_stream_set_skip_function(stream.get(), skip);
  opj_stream_set_seek_function(stream.get(), seek);
  return stream;
}

/// The first message is the cause; the others follow from it.
void keep_message(const char* text, void* user) {
  auto& kept = *static_cast<std::string*>(user);
  if (!kept.empty()) return;
  kept = text;
  while (!kept.empty() && (kept.back() == '\n' || kept.back() == ' ')) kept.pop_back();
}

/// Bytes of an image of 24 bits a pixel for each one of the file.
float rate_of(ImageSize size, const ImageCoding& coding) {
  const auto all = double{1} * size.width * size.height, matter = static_cast<double>(coding.pixels);
  return static_cast<float>(5 * std::exp2((80 - coding.quality) / 20.0) * all / matter);
}

opj_cparameters_t parameters_for(ImageSize size, const ImageCoding& coding) {
  opj_cparameters_t p;
  opj_set_default_encoder_parameters(&p);
  p.tcp_numlayers = 1;
  p.cp_disto_alloc = 1;
  p.tcp_mct = 1;
  p.irreversible = coding.quality < 100 ? 1 : 0;
  p.tcp_rates[0] = coding.quality < 100 ? rate_of(size, coding) : 0;  // 0: all there is
  p.numresolution = std::min(6, static_cast<int>(std::bit_width(std::min(size.width, size.height))));
  return p;
}

Picture picture_of(const RgbImage& image) {
  opj_image_cmptparm_t component{};
  component.dx = component.dy = 1;
  component.w = image.size.width;
  component.h = image.size.height;
  component.prec = 8;
  opj_image_cmptparm_t components[3] = {component, component, component};
  Picture picture(opj_image_create(3, components, OPJ_CLRSPC_SRGB));
  if (!picture) return nullptr;
  picture->x1 = image.size.width;
  picture->y1 = image.size.height;
  for (size_t i = 0; i < image.rgb.size(); ++i)
    picture->comps[i % 3].data[i / 3] = std::to_integer<OPJ_INT32>(image.rgb[i]);
  return picture;
}

Result<std::vector<std::byte>> encode(const RgbImage& image, const ImageCoding& coding) {
  std::vector<std::byte> file;
  Bytes bytes;
  bytes.out = &file;
  const Picture picture = picture_of(image);
  const Codec codec(opj_create_compress(OPJ_CODEC_JP2));
  const Stream stream = stream_of(bytes);
  if (!picture || !codec || !stream) return fail(ErrorCode::internal, {}, "JPEG 2000: no memory");
  std::string message;
  opj_set_error_handler(codec.get(), keep_message, &message);
  opj_cparameters_t parameters = parameters_for(image.size, coding);
  if (opj_setup_encoder(codec.get(), &parameters, picture.get()) == 0 ||
      opj_start_compress(codec.get(), picture.get(), stream.get()) == 0 ||
      opj_encode(codec.get(), stream.get()) == 0 || opj_end_compress(codec.get(), stream.get()) == 0)
    return fail(ErrorCode::internal, {}, "JPEG 2000: " + message);
  return file;
}

Status decode(std::span<const std::byte> file, RgbImage& image) {
  Bytes bytes;
  VOX_TRY(bytes.in, jp2_codestream(file, image.size));
  const Codec codec(opj_create_decompress(OPJ_CODEC_J2K));
  const Stream stream = stream_of(bytes);
  if (!codec || !stream) return bad_input({}, "no memory");
  std::string message;
  opj_set_error_handler(codec.get(), keep_message, &message);
  opj_dparameters_t parameters;
  opj_set_default_decoder_parameters(&parameters);
  opj_image_t* read = nullptr;
  if (opj_setup_decoder(codec.get(), &parameters) == 0 ||
      opj_read_header(stream.get(), codec.get(), &read) == 0)
    return bad_input({}, message);
  const Picture picture(read);
  if (opj_decode(codec.get(), stream.get(), read) == 0 || opj_end_decompress(codec.get(), stream.get()) == 0)
    return bad_input({}, message);
  if (read->numcomps != 3) return bad_input({}, fmt::format("{} components: expected 3", read->numcomps));
  for (size_t k = 0; k < 3; ++k) {
    const opj_image_comp_t& component = read->comps[k];
    if (component.data == nullptr || ImageSize{component.w, component.h} != image.size)
      return bad_input({}, "a component without all its pixels");
    for (size_t i = 0; i < image.rgb.size() / 3; ++i)
      image.rgb[3 * i + k] = static_cast<std::byte>(std::clamp(component.data[i], 0, 255));
  }
  return {};
}

const ImageCodec codec{.encode = encode, .decode = decode};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.codec = &voxkit::codec)
