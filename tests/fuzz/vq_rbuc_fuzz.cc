// Any bytes as a codeword: all decoders give the answer of the plain one.
#include "libvq/rbuc.h"

#include "libvq/rbuc_avx2.h"
#include "tests/fuzz/vq_target.h"
#include "tests/libvq/reference.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxkit::vq;
  constexpr size_t options = 4;
  if (size <= options || size > 256) return 0;
  const int bits = 1 + data[0] % 16;
  const uint32_t all = (1u << bits) - 1;
  BrickRange range;
  range.min = static_cast<uint16_t>((data[1] | data[2] << 8) & static_cast<int>(all));
  // Ranges up to 256, as the plain decoder lists all values of a voxel.
  range.max = static_cast<uint16_t>(std::min<uint32_t>(all, range.min + 1u + data[3]));
  if (range.min == range.max) return 0;
  const std::vector<uint8_t> code(data + options, data + size);
  const auto expected = reference::decode(code, range.min, range.max, bits);
  std::vector<std::byte> bytes(code.size() + read_slack, std::byte{0xa5});
  std::memcpy(bytes.data(), code.data(), code.size());
  const auto available = static_cast<uint32_t>(code.size());
  const auto expect = [&](const char* name, auto decode) {
    Brick brick;
    const bool valid = decode(bytes.data(), available, bits, range, brick.data());
    if (valid != expected.has_value() || (valid && brick != *expected))
      fuzz::stop(fmt::format("{} differs from the plain decoder", name));
  };
  expect("the portable decoder", [](auto... a) { return decode_codeword_portable(a...); });
  expect("the decoder", decode_codeword);
#ifdef VOXKIT_AVX2
  if (voxkit::has_avx2()) expect("the AVX2 decoder", decode_codeword_avx2);
#endif
  if (expected && codeword_length(bytes.data(), available, bits) == 0)
    fuzz::stop("a valid codeword has no length");
  // What is valid can be encoded, and comes back.
  if (expected && range_of(*expected).min < range_of(*expected).max) {
    std::array<std::byte, longest_codeword + 8 + read_slack> again{};
    const BrickRange narrow = range_of(*expected);
    const int length = encode_codeword(*expected, narrow, again.data());
    Brick brick;
    if (!decode_codeword(again.data(), static_cast<uint32_t>(length), bits, narrow, brick.data()) ||
        brick != *expected)
      fuzz::stop("a brick does not come back");
  }
  return 0;
}
