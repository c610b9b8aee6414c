#include <fmt/core.h>

#include "build_info.h"
#include "tools/common/command_line.h"

namespace voxkit::cli {
namespace {

#if defined(VOXKIT_SCALAR)
constexpr const char* simd_target = "scalar";
#elif defined(__AVX512F__)
constexpr const char* simd_target = "avx512";
#elif defined(__AVX2__)
constexpr const char* simd_target = "avx2";
#elif defined(__SSE2__)
constexpr const char* simd_target = "sse2";
#elif defined(__ARM_NEON)
constexpr const char* simd_target = "neon";
#else
constexpr const char* simd_target = "scalar";
#endif

}  // namespace

std::string version_text() {
  return fmt::format("{} ({}, {}, {}, cuda {})", build_version, build_commit, build_compiler, simd_target,
                     build_cuda ? "yes" : "no");
}

}  // namespace voxkit::cli
