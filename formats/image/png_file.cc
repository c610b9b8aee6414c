#include "formats/image/png_file.h"

#include <fmt/format.h>
#include <png.h>

#include <cstring>
#include <memory>

#include "formats/image/image_check.h"
#include "formats/mapped_file.h"

namespace voxkit {
namespace {

/// What libpng reads from, and the last thing that it found wrong.
struct Input {
  std::span<const std::byte> rest;
  std::string wrong = "corrupt PNG file";
};

void read_bytes(png_structp png, png_bytep out, size_t count) {
  auto* const input = static_cast<Input*>(png_get_io_ptr(png));
  if (count > input->rest.size()) png_error(png, "it ends early");
  std::memcpy(out, input->rest.data(), count);
  input->rest = input->rest.subspan(count);
}
[[noreturn]] void stop(png_structp png, png_const_charp text) {
  static_cast<Input*>(png_get_error_ptr(png))->wrong = std::string("corrupt PNG file: ") + text;
  png_longjmp(png, 1);
}
void ignore(png_structp, png_const_charp) {}

/// libpng's state, taken down whatever happens.
struct State {
  png_structp png = nullptr;
  png_infop info = nullptr;
  explicit State(Input& input) {
    png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &input, stop, ignore);
    if (png) info = png_create_info_struct(png);
    if (info) png_set_read_fn(png, &input, read_bytes);
  }
  ~State() { png_destroy_read_struct(&png, &info, nullptr); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
};

/// The chunks before the pixels; false where libpng stopped. No objects live here that a jump would skip.
bool read_head(State& state, PngHead& head) {
  if (setjmp(png_jmpbuf(state.png)) != 0) return false;
  png_set_user_limits(state.png, 0x7fffffff, 0x7fffffff);
  png_read_info(state.png, state.info);
  head.width = png_get_image_width(state.png, state.info);
  head.height = png_get_image_height(state.png, state.info);
  head.bits = png_get_bit_depth(state.png, state.info);
  head.samples = png_get_channels(state.png, state.info);
  return true;
}

void read_facts(State& state, PngHead& head) {
  png_colorp colors = nullptr;
  png_bytep alphas = nullptr;
  int color_count = 0, alpha_count = 0;
  png_color_16p value = nullptr;
  const bool transparent = png_get_tRNS(state.png, state.info, &alphas, &alpha_count, &value) != 0;
  if (png_get_color_type(state.png, state.info) == PNG_COLOR_TYPE_PALETTE &&
      png_get_PLTE(state.png, state.info, &colors, &color_count) != 0) {
    head.palette.assign(256, {0, 0, 0, 255});  // indices may lead past a short one
    for (int i = 0; i < color_count && i < 256; ++i) {
      const uint8_t alpha = transparent && i < alpha_count ? alphas[i] : 255;
      head.palette[static_cast<size_t>(i)] = {colors[i].red, colors[i].green, colors[i].blue, alpha};
      head.translucent |= alpha != 255;
    }
  } else {
    head.transparent_value = transparent && value;
    if (transparent && value && head.bits == 8)
      head.void_color = {static_cast<uint8_t>(value->red), static_cast<uint8_t>(value->green),
                         static_cast<uint8_t>(value->blue)};
  }
  png_uint_32 x = 0, y = 0;
  int unit = 0;
  if (png_get_pHYs(state.png, state.info, &x, &y, &unit) != 0 && x > 0 && y > 0)
    (unit == PNG_RESOLUTION_METER ? head.per_metre : head.per_unit) = std::array<uint32_t, 2>{x, y};
}

/// The pixels; false where libpng stopped.
bool read_pixels(State& state, png_bytep* rows) {
  if (setjmp(png_jmpbuf(state.png)) != 0) return false;
  png_set_packing(state.png);
  png_set_swap(state.png);
  png_set_interlace_handling(state.png);
  png_read_update_info(state.png, state.info);
  png_read_image(state.png, rows);
  return true;
}

}  // namespace

Result<PngHead> read_png_head(const std::string& path) {
  VOX_CHECK(check_png(path));
  VOX_TRY(const auto file, MappedFile::open(path));
  Input input{.rest = file->bytes()};
  State state(input);
  PngHead head;
  if (!state.info) return fail(ErrorCode::limit, path, "not enough memory for an image");
  if (!read_head(state, head)) return bad_input(path, input.wrong);
  read_facts(state, head);
  return head;
}

Status read_png_samples(const std::string& path, const PngHead& head, std::byte* samples) {
  VOX_TRY(const auto file, MappedFile::open(path));
  Input input{.rest = file->bytes()};
  State state(input);
  PngHead found;
  if (!state.info) return fail(ErrorCode::limit, path, "not enough memory for an image");
  if (!read_head(state, found)) return bad_input(path, input.wrong);
  if (found.width != head.width || found.height != head.height || found.bits != head.bits ||
      found.samples != head.samples)
    return bad_input(path, "has changed since it was opened");
  const int64_t row_bytes = head.width * head.samples * (head.bits == 16 ? 2 : 1);
  std::vector<png_bytep> rows;
  for (int64_t y = 0; y < head.height; ++y)
    rows.push_back(reinterpret_cast<png_bytep>(samples) + y * row_bytes);
  if (!read_pixels(state, rows.data())) return bad_input(path, input.wrong);
  return {};
}

}  // namespace voxkit
