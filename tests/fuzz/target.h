// The body of a libFuzzer target.
#pragma once

#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/harness.h"

namespace voxkit::fuzz {

/// Stops the fuzzer at an answer that is not acceptable.
inline void expect_sound(Verdict (*read)(Input), const uint8_t* data, size_t size) {
  const Verdict verdict = read(std::as_bytes(std::span(data, size)));
  if (verdict.fault.empty()) return;
  std::fprintf(stderr, "%s\n", verdict.fault.c_str());
  std::abort();
}

}  // namespace voxkit::fuzz

#define VOXKIT_FUZZ_TARGET(reader)                                          \
  extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) { \
    voxkit::fuzz::expect_sound(voxkit::fuzz::reader, data, size);           \
    return 0;                                                               \
  }
