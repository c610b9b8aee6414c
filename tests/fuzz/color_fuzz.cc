// Any bytes as a file of a surface whose checksums are right, so that the decoder is reached.
#include <cstdio>
#include <cstdlib>

#include "tests/damage.h"
#include "tests/libcolor/attack.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto input = std::as_bytes(std::span(data, size));
  voxkit::test::Bytes file(input.begin(), input.end());
  voxkit::test::repair(file, voxkit::Codec::color);
  const auto answer = voxkit::color::test::attack(file);
  if (!answer.fault.empty()) {
    std::fprintf(stderr, "%s\n", answer.fault.c_str());
    std::abort();
  }
  return 0;
}
