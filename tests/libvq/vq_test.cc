// Volumes come back as they were, or as near as promised, whatever they hold and however they are read.
#include "libvq/vq.h"

#include <limits>

#include "libvq/layout.h"
#include "tests/libvq/attack.h"
#include "tests/libvq/reference.h"
#include "tests/libvq/volumes.h"

namespace voxkit::vq {
namespace {

using namespace voxkit::vq::test;
using voxkit::test::ForwardSource;
using voxkit::test::MemorySource;
using voxkit::test::scalar_info;

/// Sound in every respect, and with these voxels.
void expect_voxels(const Encoded& encoded, const std::vector<std::byte>& voxels) {
  const Answer answer = attack(encoded.bytes);
  EXPECT_EQ(answer.fault, "");
  EXPECT_TRUE(answer.checked);
  EXPECT_EQ(answer.voxels, voxels);
}

Options make_options(Codebook codebook, std::optional<Mapping> mapping = {}) {
  Options options;
  options.codebook = codebook;
  options.mapping = mapping;
  return options;
}
/// Every way to lay out a file.
std::vector<Options> layouts() {
  return {make_options(Codebook::rbuc), make_options(Codebook::rbuc, Mapping::direct),
          make_options(Codebook::rbuc, Mapping::indirect), make_options(Codebook::packed)};
}

TEST(Vq, LosslessInEveryLayout) {
  constexpr Index3 shapes[] = {{1, 1, 1},    {4, 4, 4},  {5, 3, 2}, {16, 16, 16},
                               {17, 33, 18}, {70, 9, 5}, {3, 2, 41}};
  uint32_t seed = 0;
  for (const Index3 dims : shapes)
    for (const Content content : all_contents)
      for (const int bits : {1, 5, 8, 9, 12, 16}) {
        const VolumeInfo info = integer_info(dims, bits);
        const auto voxels = make_voxels(info, content, bits, ++seed);
        for (const Options& options : layouts()) {
          SCOPED_TRACE(fmt::format("{} x {} x {}, content {}, {} bits, codebook {}", dims.x, dims.y, dims.z,
                                   static_cast<int>(content), bits, static_cast<int>(options.codebook)));
          const Encoded encoded = encode_to_memory(info, voxels, options);
          expect_voxels(encoded, voxels);
          EXPECT_EQ(encoded.report.params.max_error, 0);
          if (options.mapping) {
            EXPECT_EQ(encoded.report.params.mapping, *options.mapping);
          }
        }
      }
}

TEST(Vq, SignedSamplesAndBits) {
  for (const SampleType type : {SampleType::i8, SampleType::i16, SampleType::bit}) {
    const VolumeInfo info = scalar_info({19, 14, 7}, type);
    const auto voxels = make_voxels(info, Content::noise,
                                    type == SampleType::i16  ? 16
                                    : type == SampleType::i8 ? 8
                                                             : 1,
                                    3);
    expect_voxels(encode_to_memory(info, voxels), voxels);
  }
}

/// The range is found, and costs no more bits than it needs, wherever it lies.
TEST(Vq, BitsAreThoseOfTheRange) {
  const struct {
    uint16_t lo, hi;
    int bits;
  } ranges[] = {{0, 0, 1},     {7, 7, 1},          {0, 1, 1},          {100, 103, 2},  {0, 4095, 12},
                {0, 4096, 13}, {31744, 35840, 13}, {31744, 35839, 12}, {0, 65535, 16}, {65535, 65535, 1}};
  for (const auto& r : ranges) {
    const VolumeInfo info = scalar_info({9, 9, 9}, SampleType::u16);
    std::vector<uint16_t> values(729, r.lo);
    values[100] = r.hi;
    const Encoded encoded = encode_to_memory(info, voxkit::test::bytes_of(values));
    EXPECT_EQ(encoded.report.params.bits, r.bits) << r.lo << " to " << r.hi;
    EXPECT_EQ(encoded.report.params.base, r.lo);
    expect_voxels(encoded, voxkit::test::bytes_of(values));
  }
}

/// Unique bricks and their counts are those of a plain search; equal bricks have one id, others another.
TEST(Vq, EqualBricksAreStoredOnce) {
  for (const Content content : all_contents) {
    const VolumeInfo info = integer_info({66, 35, 21}, 8);
    const auto voxels = make_voxels(info, content, 8, 5);
    std::vector<uint16_t> codes;
    for (const std::byte b : voxels) codes.push_back(std::to_integer<uint16_t>(b));
    const auto expected = reference::bricks_of(codes, 66, 35, 21);
    for (const Options& options : layouts()) {
      const Encoded encoded = encode_to_memory(info, voxels, options);
      EXPECT_EQ(encoded.report.params.unique_bricks, expected.size());
      EXPECT_EQ(encoded.report.params.codewords, expected.size());
      EXPECT_EQ(encoded.report.bricks, 17u * 9 * 6);
      const auto volume = encoded.open();
      EXPECT_EQ(volume->bricks(), Index3(17, 9, 6));
      std::map<uint64_t, uint64_t> places;
      std::map<uint64_t, Brick> bricks;
      for (int64_t z = 0; z < 6; ++z)
        for (int64_t y = 0; y < 9; ++y)
          for (int64_t x = 0; x < 17; ++x) {
            const auto id = volume->brick_id({x, y, z});
            ASSERT_TRUE(id);
            ++places[*id];
            ASSERT_TRUE(volume->decode_brick(*id, bricks[*id]));
            EXPECT_EQ(*volume->brick_range(*id), range_of(bricks[*id]));
          }
      std::map<Brick, uint64_t> found;
      for (auto [id, brick] : bricks) {
        for (uint16_t& code : brick) code = static_cast<uint16_t>(code + volume->params().base);
        found[brick] += places[id];
      }
      EXPECT_EQ(bricks.size(), expected.size());
      EXPECT_EQ(found, expected);
    }
  }
}

TEST(Vq, BytesDependOnNothingButTheVolume) {
  for (const Content content : {Content::scan, Content::blobs}) {
    const VolumeInfo info = integer_info({150, 40, 35}, 12);
    const auto voxels = make_voxels(info, content, 12, 8);
    const auto expected = encode_to_memory(info, voxels, {}, 1).bytes;
    for (const int threads : {2, 3, 7})
      EXPECT_EQ(encode_to_memory(info, voxels, {}, threads).bytes, expected);
    ForwardSource forward(info, voxels);
    EXPECT_EQ(encode_to_memory(forward).bytes, expected);
  }
}

/// Tells which boxes are zero.
class SparseSource : public MemorySource {
 public:
  using MemorySource::MemorySource;
  std::optional<Voxel> uniform(const Box& box) const override {
    for (int64_t z = box.lo.z; z < box.hi.z; ++z)
      for (int64_t y = box.lo.y; y < box.hi.y; ++y)
        for (int64_t x = box.lo.x; x < box.hi.x; ++x)
          if (voxels_[static_cast<size_t>((z * info_.dims.y + y) * info_.dims.x + x)] != std::byte{0})
            return std::nullopt;
    return Voxel{};
  }
};

TEST(Vq, WhatIsUniformIsNotRead) {
  const VolumeInfo info = integer_info({300, 33, 20}, 8);
  std::vector<std::byte> voxels(300 * 33 * 20);
  for (const size_t at : {size_t{20}, size_t{150}, size_t{300 * 33 * 17 + 290}}) voxels[at] = std::byte{9};
  SparseSource sparse(info, voxels);
  const Encoded encoded = encode_to_memory(sparse);
  EXPECT_LE(sparse.voxels_read, 3 * 16 * 16 * 16);
  EXPECT_EQ(encoded.bytes, encode_to_memory(info, voxels).bytes);
  expect_voxels(encoded, voxels);

  voxkit::test::FlatSource flat(integer_info({5000, 3000, 700}, 8), Voxel::of(uint8_t{77}));
  const Encoded one = encode_to_memory(flat);
  EXPECT_EQ(one.report.params.codewords, 1u);
  EXPECT_LT(one.bytes.size(), size_t{30} << 20);  // eight bytes for 16^3 voxels
  const auto volume = one.open();
  EXPECT_EQ(volume->sample({4999, 1234, 699})->as<uint8_t>(), 77);
  EXPECT_EQ(volume->uniform({{0, 0, 0}, {500, 300, 70}}), Voxel::of(uint8_t{77}));
}

/// Files with several chunks of each kind.
TEST(Vq, ManyChunks) {
  const Index3 dims{340, 340, 300};  // 552,704 bricks, all different: two tables, many chunks of the codebook
  const VolumeInfo info = integer_info(dims, 8);
  const auto voxels = make_voxels(info, Content::noise, 8, 1);
  for (const Options& options :
       {make_options(Codebook::rbuc, Mapping::indirect), make_options(Codebook::rbuc)}) {
    const Encoded encoded = encode_to_memory(info, voxels, options);
    const auto volume = encoded.open();
    std::map<uint32_t, int> chunks;
    for (const ChunkEntry& entry : volume->container().table()) ++chunks[entry.kind];
    EXPECT_EQ(chunks[offsets_kind], 3);
    EXPECT_EQ(chunks[addresses_kind], options.mapping ? 2 : 0);
    EXPECT_GT(chunks[codebook_kind], 30);
    Context ctx = context();
    const Status checked = volume->check(ctx);
    EXPECT_TRUE(checked) << checked.error().what;
    EXPECT_EQ(decode_all(*volume), voxels);
    // Noise in plain codes: a byte for the escape, two for the range, and the offsets.
    EXPECT_LT(encoded.bytes.size(), voxels.size() * 109 / 100);
  }
}

TEST(Vq, TheSmallerMappingIsChosen) {
  int direct = 0, indirect = 0;
  for (const Content content : all_contents)
    for (const int bits : {3, 8, 14}) {
      const VolumeInfo info = integer_info({64, 64, 40}, bits);
      const auto voxels = make_voxels(info, content, bits, 4);
      const Params a = encode_to_memory(info, voxels, make_options(Codebook::rbuc)).report.params;
      const Params d =
          encode_to_memory(info, voxels, make_options(Codebook::rbuc, Mapping::direct)).report.params;
      const Params i =
          encode_to_memory(info, voxels, make_options(Codebook::rbuc, Mapping::indirect)).report.params;
      EXPECT_EQ(a.offset_bytes, std::min(d.offset_bytes, i.offset_bytes));
      EXPECT_EQ(a.mapping, d.offset_bytes <= i.offset_bytes ? Mapping::direct : Mapping::indirect);
      EXPECT_EQ(d.codebook_bytes, i.codebook_bytes);
      ++(a.mapping == Mapping::direct ? direct : indirect);
    }
  EXPECT_GT(direct, 0);
  EXPECT_GT(indirect, 0);
}

/// The sizes in the parameters are those of the chunks.
TEST(Vq, SizesAreThoseOfTheChunks) {
  for (const Options& options : layouts()) {
    const VolumeInfo info = integer_info({65, 64, 40}, 10);
    const Encoded encoded = encode_to_memory(info, make_voxels(info, Content::scan, 10, 4), options);
    const auto volume = encoded.open();
    std::map<uint32_t, uint64_t> bytes;
    for (const ChunkEntry& entry : volume->container().table()) bytes[entry.kind] += entry.length;
    const Params& p = volume->params();
    EXPECT_EQ(p.offset_bytes, bytes[offsets_kind] + bytes[addresses_kind]);
    EXPECT_EQ(p.codebook_bytes, bytes[codebook_kind]);
    EXPECT_GT(p.offset_bits, 0);
  }
}

int64_t difference(std::span<const std::byte> a, std::span<const std::byte> b, VoxelFormat format) {
  int64_t greatest = 0;
  const auto stride = static_cast<size_t>(voxel_bytes(format));
  for (size_t i = 0; i < a.size(); i += stride) {
    const auto value = [&](std::span<const std::byte> from) -> int64_t {
      return stride == 1 ? std::to_integer<int64_t>(from[i]) : load_le<uint16_t>(&from[i]);
    };
    greatest = std::max(greatest, std::abs(value(a) - value(b)));
  }
  return greatest;
}

TEST(Vq, MaxErrorIsKept) {
  for (const SampleType type : {SampleType::u8, SampleType::i8, SampleType::u16, SampleType::i16})
    for (const Content content : all_contents)
      for (const double error : {0.0, 0.9, 1.0, 2.5, 3.0, 17.0, 100.0, 255.0, 40000.0, 65535.0, 1e9}) {
        const int bits = type == SampleType::u8 || type == SampleType::i8 ? 8 : 16;
        const VolumeInfo info = scalar_info({21, 18, 9}, type);
        const auto voxels = make_voxels(info, content, bits, 6);
        for (const Codebook codebook : {Codebook::rbuc, Codebook::packed}) {
          Options options = make_options(codebook);
          options.max_error = error;
          const Encoded encoded = encode_to_memory(info, voxels, options);
          const auto volume = encoded.open();
          const auto decoded = decode_all(*volume);
          const int64_t greatest = difference(voxels, decoded, info.format);
          EXPECT_LE(static_cast<double>(greatest), error);
          EXPECT_EQ(static_cast<double>(greatest), encoded.report.quantisation_error);
          EXPECT_EQ(volume->params().max_error, std::min(std::floor(error), 65535.0));
          const Answer answer = attack(encoded.bytes);
          EXPECT_EQ(answer.fault, "");
          EXPECT_TRUE(answer.checked);
        }
      }
}

/// The error is used: codes of E = 2 take less than a half of lossless ones of noise with a range of 64.
TEST(Vq, MaxErrorMakesFilesSmaller) {
  const VolumeInfo info = integer_info({64, 64, 64}, 12);
  auto voxels = make_voxels(info, Content::noise, 6, 6);
  Options options;
  size_t last = encode_to_memory(info, voxels, options).bytes.size();
  for (const double error : {1.0, 2.0, 5.0}) {
    options.max_error = error;
    const size_t bytes = encode_to_memory(info, voxels, options).bytes.size();
    EXPECT_LT(bytes, last * 9 / 10);
    last = bytes;
  }
}

/// The sample 0, often void, is exact whatever the error.
TEST(Vq, MaxErrorKeepsZero) {
  for (const SampleType type : {SampleType::u8, SampleType::i8, SampleType::u16, SampleType::i16})
    for (int error = 1; error < 70; ++error) {
      VolumeInfo info = scalar_info({4, 4, 4}, type);
      auto voxels =
          make_voxels(info, Content::noise, type == SampleType::u8 || type == SampleType::i8 ? 8 : 16, 6);
      const Voxel zero = type == SampleType::u8 || type == SampleType::i8
                             ? Voxel::of(static_cast<uint8_t>(info.bias()))
                             : Voxel::of(static_cast<uint16_t>(info.bias()));
      std::copy_n(zero.bytes.begin(), voxel_bytes(info.format), voxels.begin());
      Options options;
      options.max_error = error;
      EXPECT_EQ(*encode_to_memory(info, voxels, options).open()->sample({0, 0, 0}), zero);
    }
}

std::vector<float> floats(std::span<const std::byte> bytes) {
  std::vector<float> out(bytes.size() / 4);
  std::memcpy(out.data(), bytes.data(), bytes.size());
  return out;
}

struct Scale {
  float lo, hi;
};
/// By which the spacing of floats goes.
double largest(Scale scale) {
  return std::max({std::abs(scale.lo), std::abs(scale.hi), std::numeric_limits<float>::min()});
}

TEST(Vq, FloatsAreQuantisedWithinTheBound) {
  std::mt19937 random(9);
  const VolumeInfo info = scalar_info({20, 13, 9}, SampleType::f32);
  for (const Scale scale : {Scale{0, 1}, Scale{-1, 1}, Scale{-3e38f, 3e38f}, Scale{1e-42f, 2e-42f},
                            Scale{1e6f, 1e6f + 1}, Scale{5, 5}, Scale{-2e-6f, 7e5f}}) {
    std::vector<float> values(20 * 13 * 9);
    for (float& v : values)
      v = static_cast<float>(scale.lo + (static_cast<double>(scale.hi) - scale.lo) *
                                            (static_cast<double>(random() % 100001) / 100000));
    values[0] = scale.lo;
    values[1] = scale.hi;
    Options options;
    options.range = {scale.lo, scale.hi};
    for (const double error : {0.0, 1.0, 20.0, 3000.0}) {
      const double range = static_cast<double>(scale.hi) - scale.lo;
      if (error > 0) {
        // Multiples of what sixteen bits allow, and of the spacing of floats.
        options.max_error = error * (range / 65534 + std::ldexp(largest(scale), -24));
        if (*options.max_error == 0) continue;
      }
      const Encoded encoded = encode_to_memory(info, voxkit::test::bytes_of(values), options);
      const auto volume = encoded.open();
      const auto decoded = floats(decode_all(*volume));
      double greatest = 0;
      for (size_t i = 0; i < values.size(); ++i)
        greatest = std::max(greatest, std::abs(static_cast<double>(values[i]) - decoded[i]));
      EXPECT_EQ(greatest, encoded.report.quantisation_error);
      EXPECT_LE(greatest, volume->params().max_error) << scale.lo << " to " << scale.hi << ", " << error;
      EXPECT_EQ(volume->params().max_error, *error_bound(options, info));
      if (error == 0) {
        EXPECT_LE(greatest, range / 131070 * 1.01 + std::ldexp(largest(scale), -23));
        if (scale.lo == scale.hi) {
          EXPECT_EQ(decoded, values);
        }
      } else {
        EXPECT_EQ(volume->params().max_error, *options.max_error);
      }
    }
  }
}

TEST(Vq, FloatsThatAreWholeNumbersAreExact) {
  const VolumeInfo info = scalar_info({20, 13, 9}, SampleType::i32);
  std::vector<float> values(20 * 13 * 9);
  for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i * 28) - 32768;
  Options options;
  options.range = {values.front(), values.back()};
  ASSERT_LE(options.range.hi - options.range.lo, 65535);
  const Encoded encoded = encode_to_memory(info, voxkit::test::bytes_of(values), options);
  EXPECT_EQ(encoded.report.params.max_error, 0);
  expect_voxels(encoded, voxkit::test::bytes_of(values));
}

/// As vq.h says: not a number and minus infinity are the least value, plus infinity is the greatest.
TEST(Vq, FloatsThatAreNotNumbers) {
  const VolumeInfo info = scalar_info({4, 4, 4}, SampleType::f32);
  std::vector<float> values(64, 0.5f);
  const float inf = std::numeric_limits<float>::infinity();
  values[0] = -1, values[1] = 2, values[2] = inf, values[3] = -inf, values[4] = std::nanf("");
  Options options;
  options.range = {-1, 2};
  const Encoded encoded = encode_to_memory(info, voxkit::test::bytes_of(values), options);
  const auto decoded = floats(decode_all(*encoded.open()));
  EXPECT_EQ(decoded[0], -1);
  EXPECT_EQ(decoded[1], 2);
  EXPECT_EQ(decoded[2], 2);
  EXPECT_EQ(decoded[3], -1);
  EXPECT_EQ(decoded[4], -1);
  EXPECT_NEAR(decoded[5], 0.5, 3.0 / 131070);
  EXPECT_LT(encoded.report.quantisation_error, 3.0 / 131070);
}

TEST(Vq, FloatsAboveTheGreatestAreRoundedFurther) {
  // Found by search (tests/stress): what the greatest voxel is decoded to lies above it, beyond a power of
  // two.
  const float least = 0x1.dc3ffep+57f, most = 0x1.ffdd48p+70f;
  std::vector<float> values(64, least);
  values[9] = most;
  Options options;
  options.range = {least, most};
  options.max_error = 0x1.ffce67ffeaa25p+70;
  const Encoded encoded =
      encode_to_memory(scalar_info({4, 4, 4}, SampleType::f32), voxkit::test::bytes_of(values), options);
  const auto decoded = floats(decode_all(*encoded.open()));
  for (size_t i = 0; i < values.size(); ++i)
    EXPECT_LE(std::abs(static_cast<double>(values[i]) - decoded[i]), *options.max_error) << i;
  EXPECT_LE(encoded.report.quantisation_error, *options.max_error);
}

TEST(Vq, FloatsUpToTheGreatestStayNumbers) {
  constexpr float most = std::numeric_limits<float>::max();
  const VolumeInfo info = scalar_info({4, 4, 4}, SampleType::f32);
  for (const float least : {0.15f, -most, 3e38f})
    for (const double steps : {1.5, 1.50000001, 1.5000001, 2.75, 1000.25, 65000.3}) {
      std::vector<float> values(64, least);
      for (size_t i = 0; i < values.size(); i += 2) values[i] = most - static_cast<float>(i) * 1e36f;
      values[5] = most;
      Options options;
      options.range = {least, most};
      for (const float v : values) options.range.lo = std::min<double>(options.range.lo, v);
      options.max_error = (options.range.hi - options.range.lo) / 2 / steps + std::ldexp(most, -23);
      const Encoded encoded = encode_to_memory(info, voxkit::test::bytes_of(values), options);
      const auto decoded = floats(decode_all(*encoded.open()));
      for (size_t i = 0; i < values.size(); ++i)
        EXPECT_LE(std::abs(static_cast<double>(values[i]) - decoded[i]), *options.max_error)
            << values[i] << ' ' << decoded[i] << ' ' << steps;
    }
}

TEST(Vq, WhatIsRefused) {
  const auto code = [](const Options& options, const VolumeInfo& info) {
    const Status status = validate(options, info);
    return status ? std::nullopt : std::optional(status.error().code);
  };
  const VolumeInfo u8 = integer_info({4, 4, 4}, 8);
  EXPECT_EQ(code({}, u8), std::nullopt);
  for (const VoxelFormat format : {VoxelFormat::rgba32, VoxelFormat::rgb24})
    EXPECT_EQ(code({}, voxkit::test::color_info({4, 4, 4}, format)), ErrorCode::input);
  EXPECT_EQ(code(make_options(Codebook::packed, Mapping::direct), u8), ErrorCode::usage);
  for (const double error : {-1.0, -0.5, std::nan(""), HUGE_VAL}) {
    Options options;
    options.max_error = error;
    EXPECT_EQ(code(options, u8), ErrorCode::usage);
  }
  Options options;
  options.max_error = 1e-9;  // of 0 to 1 in 65536 levels
  options.range = {0, 1};
  const auto bound = error_bound(options, scalar_info({4, 4, 4}, SampleType::f32));
  ASSERT_FALSE(bound);
  EXPECT_EQ(bound.error().code, ErrorCode::usage);
  // What the message asks for is enough.
  const std::string& what = bound.error().what;
  options.max_error = std::stod(what.substr(what.find("expected ") + 9));
  EXPECT_TRUE(error_bound(options, scalar_info({4, 4, 4}, SampleType::f32))) << what;
}

TEST(Vq, MemoryIsBounded) {
  const VolumeInfo info = integer_info({200, 100, 60}, 8);
  const auto voxels = make_voxels(info, Content::noise, 8, 1);
  int refused = 0;
  for (uint64_t limit = 1 << 10; limit <= uint64_t{1} << 28; limit *= 2) {
    MemorySource source(info, voxels);
    Context ctx = context(2, limit);
    const auto report = encode(
        source, {}, [](auto) { return Status{}; }, ctx);
    if (!report) {
      EXPECT_EQ(report.error().code, ErrorCode::limit);
      EXPECT_NE(report.error().what.find("--max-memory"), std::string::npos);
      ++refused;
    }
    EXPECT_TRUE(ctx.memory->reserve(limit, "all of it"));
  }
  EXPECT_GT(refused, 4);
  // A volume whose offsets alone are beyond any memory is refused before it is read.
  voxkit::test::FlatSource endless(integer_info(Index3(int64_t{1} << 20), 8), Voxel{});
  Context ctx = context(2, uint64_t{1} << 40);
  const auto report = encode(
      endless, {}, [](auto) { return Status{}; }, ctx);
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, ErrorCode::limit);
}

TEST(Vq, ErrorsOfTheSinkAndTheSourceArePassedOn) {
  const VolumeInfo info = integer_info({64, 64, 64}, 8);
  const auto voxels = make_voxels(info, Content::noise, 8, 1);
  for (int fails_at = 0; fails_at < 9; ++fails_at) {
    MemorySource source(info, voxels);
    Context ctx = context();
    int writes = 0;
    const auto report = encode(
        source, {},
        [&](auto) { return writes++ == fails_at ? Status(fail(ErrorCode::output, "x", "full")) : Status{}; },
        ctx);
    ASSERT_FALSE(report);
    EXPECT_EQ(report.error().code, ErrorCode::output);
  }
  class Broken : public MemorySource {
   public:
    using MemorySource::MemorySource;
    Status read(const Box& box, VoxelSpan out) override {
      return box.lo.z >= 32 ? Status(bad_input("y", "broken")) : MemorySource::read(box, out);
    }
  };
  Broken broken(info, voxels);
  Context ctx = context();
  const auto report = encode(
      broken, {}, [](auto) { return Status{}; }, ctx);
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, ErrorCode::input);
}

}  // namespace
}  // namespace voxkit::vq
