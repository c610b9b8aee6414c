// The inner loops of the search with AVX2 and with AVX-512.
#pragma once

#include "formats/cpu.h"
#include "libvq/nearest_kernel.h"

#ifdef VOXKIT_AVX2

namespace voxkit::vq {

const Kernels& avx2_kernels(bool narrow);
const Kernels& avx512_kernels(bool narrow);

}  // namespace voxkit::vq

#endif
