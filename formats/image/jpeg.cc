// JPEG by libjpeg. A module.
#include <cstdio>
// After <cstdio>, which it needs.
#include <jpeglib.h>

#include <csetjmp>
#include <cstring>

#include "formats/image/coded_image_module.h"

namespace voxkit {
namespace {

constexpr int most_scans = 64;  ///< of a progressive file; encoders make about ten

/// libjpeg leaves its functions by a jump. Nothing with a destructor may lie on the way.
struct Failure {
  jpeg_error_mgr base;  // first: libjpeg knows its address
  std::jmp_buf back;
  char text[JMSG_LENGTH_MAX];
};

[[noreturn]] void stop(j_common_ptr info) {
  auto* const failure = reinterpret_cast<Failure*>(info->err);
  info->err->format_message(info, failure->text);
  std::longjmp(failure->back, 1);
}

/// Warnings are about damaged data: it is refused.
void message(j_common_ptr info, int level) {
  if (level < 0) stop(info);
}

void count_scans(j_common_ptr info) {
  auto* const failure = reinterpret_cast<Failure*>(info->err);
  if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number <= most_scans) return;
  std::snprintf(failure->text, sizeof failure->text, "more than %d scans", most_scans);
  std::longjmp(failure->back, 1);
}

void set_up(Failure& failure) {
  jpeg_std_error(&failure.base);
  failure.base.error_exit = stop;
  failure.base.emit_message = message;
}

/// False where libjpeg has jumped out of `work`.
template <class Work>
bool completes(Failure& failure, const Work& work) {
  if (setjmp(failure.back) != 0) return false;
  work();
  return true;
}

Result<std::vector<std::byte>> encode(const RgbImage& image, const ImageCoding& coding) {
  const auto [width, height] = image.size;
  // More than any image takes, so that libjpeg asks for no memory of its own.
  std::vector<std::byte> file(65536 + size_t{12} * (width + 15) * (height + 15));
  auto* out = reinterpret_cast<unsigned char*>(file.data());
  auto bytes = static_cast<unsigned long>(file.size());
  Failure failure;
  set_up(failure);
  jpeg_compress_struct info{};
  info.err = &failure.base;
  const bool complete = completes(failure, [&] {
    jpeg_create_compress(&info);
    jpeg_mem_dest(&info, &out, &bytes);
    info.image_width = image.size.width;
    info.image_height = image.size.height;
    info.input_components = 3;
    info.in_color_space = JCS_RGB;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, coding.quality, TRUE);
    info.dct_method = JDCT_ISLOW;
    if (coding.quality >= 90) info.comp_info[0].h_samp_factor = info.comp_info[0].v_samp_factor = 1;
    jpeg_simple_progression(&info);
    jpeg_start_compress(&info, TRUE);
    while (info.next_scanline < info.image_height) {
      // It is only read.
      auto* row = reinterpret_cast<JSAMPLE*>(const_cast<std::byte*>(image.rgb.data())) +
                  size_t{3} * info.image_width * info.next_scanline;
      jpeg_write_scanlines(&info, &row, 1);
    }
    jpeg_finish_compress(&info);
  });
  jpeg_destroy_compress(&info);
  if (!complete) return fail(ErrorCode::internal, {}, failure.text);
  file.resize(bytes);
  return file;
}

Status decode(std::span<const std::byte> file, RgbImage& image) {
  Failure failure;
  set_up(failure);
  jpeg_progress_mgr progress{};
  progress.progress_monitor = count_scans;
  jpeg_decompress_struct info{};
  info.err = &failure.base;
  const ImageSize size = image.size;
  const char* wrong = nullptr;
  const bool complete = completes(failure, [&] {
    jpeg_create_decompress(&info);
    info.progress = &progress;
    jpeg_mem_src(&info, reinterpret_cast<const unsigned char*>(file.data()),
                 static_cast<unsigned long>(file.size()));
    jpeg_read_header(&info, TRUE);
    if (info.image_width != size.width || info.image_height != size.height) {
      std::snprintf(failure.text, sizeof failure.text, "%u x %u pixels: expected %u x %u", info.image_width,
                    info.image_height, size.width, size.height);
      wrong = failure.text;
      return;
    }
    if (info.num_components != 1 && info.num_components != 3) {
      std::snprintf(failure.text, sizeof failure.text, "%d components: expected 3", info.num_components);
      wrong = failure.text;
      return;
    }
    info.out_color_space = JCS_RGB;
    info.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&info);
    while (info.output_scanline < info.output_height) {
      auto* row =
          reinterpret_cast<JSAMPLE*>(image.rgb.data()) + size_t{3} * size.width * info.output_scanline;
      jpeg_read_scanlines(&info, &row, 1);
    }
    jpeg_finish_decompress(&info);
  });
  jpeg_destroy_decompress(&info);
  if (!complete || wrong != nullptr) return bad_input({}, failure.text);
  return {};
}

const ImageCodec codec{.encode = encode, .decode = decode};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.codec = &voxkit::codec)
