// What the fuzz targets of the VQ codec share.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/libvq/attack.h"

namespace voxkit::vq::fuzz {

[[noreturn]] inline void stop(const std::string& fault) {
  std::fprintf(stderr, "%s\n", fault.c_str());
  std::abort();
}
inline test::Answer expect_sound(std::span<const std::byte> file) {
  test::Answer answer = test::attack(file);
  if (!answer.fault.empty()) stop(answer.fault);
  return answer;
}

/// Collects a file.
inline ByteSink sink_to(std::vector<std::byte>& file) {
  return [&file](std::span<const std::byte> bytes) {
    file.insert(file.end(), bytes.begin(), bytes.end());
    return Status{};
  };
}

}  // namespace voxkit::vq::fuzz
