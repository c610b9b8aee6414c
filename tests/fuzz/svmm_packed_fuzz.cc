// Any bytes as a file of layout packed whose checksums are right, so that models and pages are reached.
#include <cstdio>
#include <cstdlib>

#include "tests/damage.h"
#include "tests/libsvmm/packed_attack.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto input = std::as_bytes(std::span(data, size));
  voxkit::test::Bytes file(input.begin(), input.end());
  voxkit::test::repair(file);
  const auto answer = voxkit::svmm::test::attack_packed(file);
  if (!answer.fault.empty()) {
    std::fprintf(stderr, "%s\n", answer.fault.c_str());
    std::abort();
  }
  return 0;
}
