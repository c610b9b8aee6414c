// Codewords are those of the plain coder, on every machine.
#include "libvq/rbuc.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <random>

#include "libvq/rbuc_avx2.h"
#include "tests/libvq/reference.h"

namespace voxkit::vq {
namespace {

/// Bricks of up to `bits` bits: noise, ramps, edges, few levels, one odd voxel.
Brick make_brick(int bits, std::mt19937& random) {
  Brick brick;
  const uint32_t top = (1u << bits) - 1, base = static_cast<uint32_t>(random()) & top;
  const auto slope = [&] { return static_cast<int64_t>(random() % 41) - 20; };
  const int64_t dx = slope(), dy = slope(), dz = slope();
  const auto kind = random() % 6, noise = 1 + random() % 9;
  for (size_t i = 0; i < brick.size(); ++i) {
    const auto x = static_cast<int64_t>(i % 4), y = static_cast<int64_t>(i / 4 % 4),
               z = static_cast<int64_t>(i / 16);
    int64_t value = base;
    switch (kind) {
      case 0:
        value = static_cast<int64_t>(random() & top);
        break;
      case 1:
        value += x * dx + y * dy + z * dz + static_cast<int64_t>(random() % noise);
        break;
      case 2:
        value = x * dx + y * dy + z * dz < 7 ? 0 : top;
        break;
      case 3:
        value = static_cast<int64_t>(random() % 2) * base;
        break;
      case 4:
        value += i == base % 64 ? dx * 50 : 0;
        break;
      default:
        value += (x * y * dx + z * z * dz) / 2;
    }
    brick[i] = static_cast<uint16_t>(std::clamp<int64_t>(value, 0, top));
  }
  return brick;
}

struct Decoded {
  bool valid;
  Brick brick;
  friend bool operator==(const Decoded&, const Decoded&) = default;
};

/// All decoders on a codeword of exactly these bytes; what lies behind must not matter.
std::vector<Decoded> decode_all(std::span<const uint8_t> code, int bits, BrickRange range) {
  std::vector<Decoded> out;
  for (const int behind : {0, 0xa5, 0xff}) {
    std::vector<std::byte> bytes(code.size() + read_slack, static_cast<std::byte>(behind));
    std::memcpy(bytes.data(), code.data(), code.size());
    const auto available = static_cast<uint32_t>(code.size());
    const auto add = [&](auto decode) {
      Decoded& d = out.emplace_back();
      d.valid = decode(bytes.data(), available, bits, range, d.brick.data());
      if (!d.valid) d.brick.fill(0);
    };
    add(decode_codeword);
    add([](auto... arguments) { return decode_codeword_portable(arguments...); });
#ifdef VOXKIT_AVX2
    if (has_avx2()) add(decode_codeword_avx2);
#endif
  }
  return out;
}

TEST(Rbuc, CodewordsAreThoseOfThePlainCoder) {
  std::mt19937 random(1);
  std::array<int, transforms> chosen{};
  for (int i = 0; i < 12000; ++i) {
    const int bits = 1 + i % 12;  // the plain coder lists all values of a voxel: more bits in the next test
    const Brick brick = make_brick(bits, random);
    const BrickRange range = range_of(brick);
    if (range.min == range.max) continue;
    std::array<std::byte, longest_codeword + 8> bytes;
    const int length = encode_codeword(brick, range, bytes.data());
    const auto expected = reference::codeword(brick);
    ASSERT_EQ(length, static_cast<int>(expected.size())) << i;
    ASSERT_EQ(std::memcmp(bytes.data(), expected.data(), expected.size()), 0) << i;
    ASSERT_EQ(codeword_length(bytes.data(), static_cast<uint32_t>(length), bits), length);
    ASSERT_EQ(codeword_length(bytes.data(), static_cast<uint32_t>(length - 1), bits), 0);
    for (const Decoded& decoded : decode_all(expected, bits, range))
      ASSERT_EQ(decoded, (Decoded{true, brick})) << i;
    ++chosen[static_cast<size_t>(transform_of(bytes.data()))];
  }
  for (const int count : chosen) EXPECT_GT(count, 100);
}

TEST(Rbuc, SixteenBits) {
  std::mt19937 random(2);
  for (int i = 0; i < 60; ++i) {
    const Brick brick = make_brick(13 + i % 4, random);
    const BrickRange range = range_of(brick);
    if (range.min == range.max) continue;
    std::array<std::byte, longest_codeword + 8> bytes;
    const int length = encode_codeword(brick, range, bytes.data());
    const auto expected = reference::codeword(brick);
    ASSERT_EQ(length, static_cast<int>(expected.size())) << i;
    ASSERT_EQ(std::memcmp(bytes.data(), expected.data(), expected.size()), 0) << i;
  }
}

/// Every transform, also where it is not the shortest, on extremes and noise of every depth.
TEST(Rbuc, EveryTransformIsInverted) {
  std::mt19937 random(3);
  for (int i = 0; i < 400; ++i) {
    const int bits = 1 + i % 11;
    Brick brick = make_brick(bits, random);
    const BrickRange range = range_of(brick);
    if (range.min == range.max) continue;
    for (int transform = 0; transform < transforms; ++transform)
      for (const Decoded& decoded : decode_all(reference::codeword(brick, transform), bits, range))
        ASSERT_EQ(decoded, (Decoded{true, brick})) << i << ", transform " << transform;
  }
}

/// The folds are bijections of 0 .. top, for every prediction.
TEST(Rbuc, FoldsAreBijections) {
  for (const uint32_t top : {1u, 2u, 3u, 6u, 7u, 255u}) {
    for (uint32_t predicted = 0; predicted <= top; ++predicted) {
      const auto bounded = reference::candidates(3, static_cast<int>(predicted), static_cast<int>(top)),
                 modulo = reference::candidates(2, static_cast<int>(predicted), static_cast<int>(top));
      for (uint32_t code = 0; code <= top; ++code) {
        const auto b = static_cast<uint32_t>(bounded[code]), m = static_cast<uint32_t>(modulo[code]);
        ASSERT_EQ(unfold_bounded(code, predicted, top), b) << top << " " << predicted << " " << code;
        ASSERT_EQ(fold_bounded(b, predicted, top), code);
        ASSERT_EQ(unfold_modulo(code, predicted, top), m) << top << " " << predicted << " " << code;
        ASSERT_EQ(fold_modulo(m, predicted, top), code);
      }
    }
  }
  for (const uint32_t predicted : {0u, 1u, 32767u, 32768u, 65534u, 65535u})
    for (uint32_t code = 0; code <= 65535; ++code) {
      ASSERT_EQ(fold_bounded(unfold_bounded(code, predicted, 65535), predicted, 65535), code);
      ASSERT_EQ(fold_modulo(unfold_modulo(code, predicted, 65535), predicted, 65535), code);
    }
}

TEST(Rbuc, ExtremesOfSixteenBitsComeBack) {
  std::mt19937 random(4);
  for (int i = 0; i < 2000; ++i) {
    Brick brick;
    for (size_t k = 0; k < brick.size(); ++k)
      brick[k] = static_cast<uint16_t>(i % 3 == 0   ? (k + k / 4 + k / 16) % 2 * 65535
                                       : i % 3 == 1 ? random() % 2 * 65535
                                                    : random());
    const BrickRange range = range_of(brick);
    std::array<uint8_t, longest_codeword + 8> bytes;
    const int length = encode_codeword(brick, range, reinterpret_cast<std::byte*>(bytes.data()));
    ASSERT_LE(length, longest_codeword);
    for (const Decoded& decoded : decode_all(std::span(bytes).first(static_cast<size_t>(length)), 16, range))
      ASSERT_EQ(decoded, (Decoded{true, brick})) << i;
  }
}

TEST(Rbuc, PlainCodes) {
  std::mt19937 random(5);
  for (int bits = 1; bits <= 16; ++bits) {
    const uint32_t base = bits < 16 ? 1000 : 0;
    Brick brick;
    for (uint16_t& v : brick) v = static_cast<uint16_t>(base + (random() & ((1u << bits) - 1)));
    std::vector<uint8_t> bytes(1 + static_cast<size_t>(plain_bytes(bits)) + 8);
    bytes[0] = escape;
    encode_plain(brick, base, bits, reinterpret_cast<std::byte*>(bytes.data() + 1));
    bytes.resize(bytes.size() - 8);
    for (uint16_t& v : brick) v = static_cast<uint16_t>(v - base);
    const BrickRange range = range_of(brick);
    for (const Decoded& decoded : decode_all(bytes, bits, range))
      EXPECT_EQ(decoded, (Decoded{true, brick})) << bits;
    EXPECT_EQ(reference::decode(bytes, range.min, range.max, bits), brick);
    // Codes outside the range are refused.
    if (range.min < range.max) {
      const BrickRange narrow{static_cast<uint16_t>(range.min + 1), range.max},
          low{range.min, static_cast<uint16_t>(range.max - 1)};
      for (const BrickRange wrong : {narrow, low})
        for (const Decoded& decoded : decode_all(bytes, bits, wrong)) EXPECT_FALSE(decoded.valid) << bits;
    }
  }
}

/// All decoders agree on any residuals, whatever the greatest one: vector code has shorter ways for small
/// ones.
TEST(Rbuc, DecodersAgreeOnEveryExtent) {
  std::mt19937 random(7);
  for (int i = 0; i < 20000; ++i) {
    constexpr uint32_t edges[] = {1, 2, 255, 16383, 32767, 65535};
    auto top = static_cast<uint32_t>(edges[random() % 6] + random() % 5 - 2);
    if (i % 2) top = static_cast<uint32_t>(random() >> (16 + random() % 16));
    top = std::clamp(top, 1u, 65535u);
    const int c1 = std::bit_width(top), c2 = std::bit_width(static_cast<unsigned>(c1));
    std::vector<std::byte> bytes(1 + static_cast<size_t>(c2 + 8 * c1) + 8);
    bytes[0] = static_cast<std::byte>(static_cast<unsigned>(c2) | random() % 4 << 6);
    for (size_t octant = 0; octant < 8; ++octant)
      store_bits(&bytes[1], octant * static_cast<size_t>(c2), static_cast<uint32_t>(c1));
    const bool extreme = random() % 2;
    for (size_t k = 0; k < 64; ++k) {
      const auto residual = static_cast<uint32_t>(random()) % (top + 1);
      store_bits(&bytes[1 + static_cast<size_t>(c2)], k * static_cast<size_t>(c1),
                 !extreme       ? residual
                 : residual % 3 ? top - std::min(top, residual % 7)
                                : residual % 5);
    }
    bytes.resize(bytes.size() - 8);
    const auto min = static_cast<uint16_t>(random() % (65536 - top));
    const BrickRange range{min, static_cast<uint16_t>(min + top)};
    const auto* const data = reinterpret_cast<const uint8_t*>(bytes.data());
    const auto all = decode_all({data, bytes.size()}, 16, range);
    EXPECT_TRUE(all[0].valid);
    for (const Decoded& decoded : all) ASSERT_EQ(decoded, all[0]) << i << ", top " << top;
  }
}

/// Whatever the bytes, all decoders give the same answer as the plain one, and read nothing behind them.
TEST(Rbuc, AnyBytesAreAnsweredAlike) {
  std::mt19937 random(6);
  int valid = 0, invalid = 0;
  for (int i = 0; i < 20000; ++i) {
    const int bits = 1 + static_cast<int>(random() % 10);
    BrickRange range{static_cast<uint16_t>(random() % (1u << bits)), 0};
    range.max = static_cast<uint16_t>(range.min + 1 + random() % 40);
    std::vector<uint8_t> bytes;
    if (i % 2) {  // damage to a codeword
      const Brick brick = make_brick(bits, random);
      if (range_of(brick).min == range_of(brick).max) continue;
      range = range_of(brick);
      bytes = reference::codeword(brick, static_cast<int>(random() % 4));
      bytes[random() % bytes.size()] ^= static_cast<uint8_t>(1u << random() % 8);
      bytes.resize(1 + random() % (bytes.size() + 2));
    } else {  // invented: a head that may be valid
      bytes.resize(1 + random() % 80);
      for (uint8_t& b : bytes) b = static_cast<uint8_t>(random() & random());
      bytes[0] = static_cast<uint8_t>(random() % 9 == 0 ? random() : (random() % 7) | (random() % 4) << 6);
    }
    const auto expected = reference::decode(bytes, range.min, range.max, bits);
    ++(expected ? valid : invalid);
    for (const Decoded& decoded : decode_all(bytes, bits, range))
      ASSERT_EQ(decoded, (Decoded{expected.has_value(), expected.value_or(Brick{})})) << i;
  }
  EXPECT_GT(valid, 1000);
  EXPECT_GT(invalid, 1000);
}

}  // namespace
}  // namespace voxkit::vq
