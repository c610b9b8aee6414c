// Any bytes as a VQ file whose checksums are right, so that the decoder is reached.
#include "tests/damage.h"
#include "tests/fuzz/vq_target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto input = std::as_bytes(std::span(data, size));
  voxkit::test::Bytes file(input.begin(), input.end());
  voxkit::test::repair(file, voxkit::Codec::vq);
  voxkit::vq::fuzz::expect_sound(file);
  return 0;
}
