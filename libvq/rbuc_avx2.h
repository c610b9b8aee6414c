// Codewords decoded with AVX2: the same results as the portable functions of rbuc.h.
#pragma once

#include "formats/cpu.h"
#include "libvq/brick.h"

#ifdef VOXKIT_AVX2

#include <cstddef>
#include <cstdint>

namespace voxkit::vq {

bool decode_plain_avx2(const std::byte* bytes, int bits, BrickRange range, uint16_t* voxels);
bool decode_codeword_avx2(const std::byte* codeword, uint32_t available, int bits, BrickRange range,
                          uint16_t* voxels);

}  // namespace voxkit::vq

#endif
