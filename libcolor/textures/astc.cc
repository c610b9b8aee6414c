#include "libcolor/textures/astc.h"

#include <astcenc.h>

#include <algorithm>
#include <array>
#include <new>
#include <vector>

namespace voxkit::color {
namespace {

constexpr astcenc_swizzle opaque{ASTCENC_SWZ_R, ASTCENC_SWZ_G, ASTCENC_SWZ_B, ASTCENC_SWZ_1};

struct FreeContext {
  void operator()(astcenc_context* context) const { astcenc_context_free(context); }
};
using ContextPointer = std::unique_ptr<astcenc_context, FreeContext>;

/// What fails here is memory: the arguments are ours.
void require(astcenc_error error) {
  if (error != ASTCENC_SUCCESS) throw std::bad_alloc();
}

ContextPointer make_context(BlockSize size, float quality, unsigned flags) {
  // Colours are sRGB; so they decode to 8 bits, exactly, on any machine.
  astcenc_config config{};
  require(astcenc_config_init(ASTCENC_PRF_LDR_SRGB, size.width, size.height, 1, quality, flags, &config));
  astcenc_context* context = nullptr;
  require(astcenc_context_alloc(&config, 1, &context));
  return ContextPointer(context);
}

/// The decoder of this thread: making one takes longer than decoding thousands of blocks.
astcenc_context* decoder(BlockSize size) {
  thread_local ContextPointer context;
  thread_local BlockSize made;
  if (!context || made != size) {
    context = make_context(size, ASTCENC_PRE_FASTEST, ASTCENC_FLG_DECOMPRESS_ONLY);
    made = size;
  }
  return context.get();
}

using Rgba = std::array<uint8_t, 4>;

astcenc_image image_of(void** slice, uint32_t width, uint32_t height) {
  return {width, height, 1, ASTCENC_TYPE_U8, slice};
}

float preset(int effort) {
  constexpr std::array<float, 9> of = {0, 5, 10, 35, 60, 85, 98, 99, 100};
  return of[static_cast<size_t>(std::clamp(effort, 1, 9) - 1)];
}

}  // namespace

struct AstcEncoder::Context {
  BlockSize size;
  ContextPointer encoder;
  std::vector<Rgba> image;
};

Status astc_support() {
  return {};
}

AstcEncoder::AstcEncoder(BlockSize size, int effort)
    : context_(new Context{size, make_context(size, preset(effort), 0), {}}) {}
AstcEncoder::~AstcEncoder() = default;

void AstcEncoder::encode(std::span<const Rgb> pixels, std::byte* out) {
  const uint32_t w = context_->size.width, h = context_->size.height;
  const auto blocks = static_cast<uint32_t>(pixels.size()) / (w * h);
  // Beside each other, as an image of one row of blocks.
  context_->image.resize(pixels.size());
  for (uint32_t b = 0; b < blocks; ++b)
    for (uint32_t y = 0; y < h; ++y)
      for (uint32_t x = 0; x < w; ++x) {
        const Rgb c = pixels[(size_t{b} * h + y) * w + x];
        context_->image[(size_t{y} * blocks + b) * w + x] = {c.r, c.g, c.b, 255};
      }
  void* slice = context_->image.data();
  astcenc_image image = image_of(&slice, blocks * w, h);
  require(astcenc_compress_image(context_->encoder.get(), &image, &opaque, reinterpret_cast<uint8_t*>(out),
                                 size_t{blocks} * astc_block_bytes, 0));
}

void decode_astc(BlockSize size, const std::byte* block, Rgb* out) {
  std::array<Rgba, 144> pixels;
  void* slice = pixels.data();
  astcenc_image image = image_of(&slice, size.width, size.height);
  require(astcenc_decompress_image(decoder(size), reinterpret_cast<const uint8_t*>(block), astc_block_bytes,
                                   &image, &opaque, 0));
  for (size_t i = 0; i < size_t{size.width} * size.height; ++i)
    out[i] = {pixels[i][0], pixels[i][1], pixels[i][2]};
}

bool valid_astc(BlockSize size, const std::byte* block) {
  std::array<uint8_t, astc_block_bytes> bytes;
  std::transform(block, block + bytes.size(), bytes.begin(),
                 [](std::byte b) { return std::to_integer<uint8_t>(b); });
  astcenc_block_info info;
  require(astcenc_get_block_info(decoder(size), bytes.data(), &info));
  return !info.is_error_block && !info.is_hdr_block;
}

}  // namespace voxkit::color
