// In place of astc.cc where there was no libastcenc when this was built.
#include <cstdlib>

#include "libcolor/textures/astc.h"

namespace voxkit::color {

struct AstcEncoder::Context {};

Status astc_support() {
  return fail(ErrorCode::input, {}, "astc colors need libastcenc: install libastcenc-dev and rebuild");
}

AstcEncoder::AstcEncoder(BlockSize, int) {
  std::abort();
}
AstcEncoder::~AstcEncoder() = default;
void AstcEncoder::encode(std::span<const Rgb>, std::byte*) {
  std::abort();
}
void decode_astc(BlockSize, const std::byte*, Rgb*) {
  std::abort();
}
bool valid_astc(BlockSize, const std::byte*) {
  std::abort();
}

}  // namespace voxkit::color
