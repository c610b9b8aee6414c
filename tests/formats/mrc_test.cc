#include <cmath>

#include "tests/formats/mrc_files.h"

namespace voxkit {
namespace {

class MrcTest : public FileFormatTest {
 protected:
  using Header = MrcHeader;
  void expect_voxels(const std::string& content, const std::string& expected) {
    auto source = open_volume(put("v.mrc", content), {}, ctx_);
    ASSERT_TRUE(source) << source.error().what;
    const auto voxels = read(**source);
    ASSERT_TRUE(voxels) << voxels.error().what;
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(voxels->data()), voxels->size()), expected);
    read_info_ = (*source)->info();
  }
};

TEST_F(MrcTest, EveryModeInBothOrders) {
  for (const bool big : {false, true}) {
    SCOPED_TRACE(big);
    const Index3 dims{2, 1, 1};
    expect_voxels(Header(0, dims, big).bytes + sample_text<int8_t>({-3, 100}, big),
                  sample_text<uint8_t>({125, 228}, false));
    expect_voxels(Header(1, dims, big).bytes + sample_text<int16_t>({-3, 1000}, big),
                  sample_text<uint16_t>({32765, 33768}, false));
    expect_voxels(Header(2, dims, big).bytes + sample_text<float>({-3.5, 1e9f}, big),
                  sample_text<float>({-3.5, 1e9f}, false));
    expect_voxels(Header(6, dims, big).bytes + sample_text<uint16_t>({3, 1000}, big),
                  sample_text<uint16_t>({3, 1000}, false));
    EXPECT_EQ(read_info_.affine.spacing(), (std::array<double, 3>{0.5, 1, 1.5}));
    expect_voxels(Header(12, dims, big).bytes + sample_text<uint16_t>({0x3c00, 0xc100}, big),
                  sample_text<float>({1, -2.5}, false));
    EXPECT_EQ(read_info_.sample_type, SampleType::f16);
  }
}

TEST_F(MrcTest, EveryHalfIsExact) {
  std::vector<uint16_t> halves(65536);
  for (size_t i = 0; i < halves.size(); ++i) halves[i] = static_cast<uint16_t>(i);
  auto source =
      open_volume(put("v.mrc", Header(12, {256, 128, 2}).bytes + sample_text(halves, false)), {}, ctx_);
  ASSERT_TRUE(source);
  const Bytes voxels = *read(**source);
  for (size_t i = 0; i < halves.size(); ++i) {
    float got;
    std::memcpy(&got, voxels.data() + 4 * i, 4);
    const int exponent = static_cast<int>(i >> 10 & 31);
    const double mantissa = static_cast<double>(i & 1023);
    double expected = exponent == 0    ? std::ldexp(mantissa, -24)
                      : exponent == 31 ? (mantissa == 0 ? INFINITY : NAN)
                                       : std::ldexp(1024 + mantissa, exponent - 25);
    if (i & 0x8000) expected = -expected;
    if (std::isnan(expected))
      ASSERT_TRUE(std::isnan(got)) << i;
    else
      ASSERT_TRUE(got == expected && std::signbit(got) == std::signbit(expected)) << i;
  }
}

TEST_F(MrcTest, BytesAreUnsignedWhereImodSaysSo) {
  Header h(0, {2, 1, 1});
  h.set(152, int32_t{1146047817});
  expect_voxels(h.bytes + "\x05\xff", "\x05\xff");
  EXPECT_EQ(read_info_.sample_type, SampleType::u8);
  h.set(156, int32_t{1});
  expect_voxels(h.bytes + "\x05\xff", "\x85\x7f");
  EXPECT_EQ(read_info_.sample_type, SampleType::i8);
}

TEST_F(MrcTest, AWrongMachineStampIsSeenThrough) {
  for (const bool big : {false, true}) {
    Header h(1, {2, 1, 1}, big);
    for (const std::string& stamp :
         {std::string(4, '\0'), std::string("\x11\x11\0\0", 4), std::string("DA\0\0", 4)}) {
      h.bytes.replace(212, 4, stamp);
      expect_voxels(h.bytes + sample_text<int16_t>({-3, 1000}, big),
                    sample_text<uint16_t>({32765, 33768}, false));
    }
  }
}

TEST_F(MrcTest, RangeOriginAndSymmetryRecords) {
  Header h(2, {1, 1, 1});
  h.set(76, -2.0f);
  h.set(80, 8.0f);
  h.set(92, int32_t{80});
  h.set(16, int32_t{4});
  expect_voxels(h.bytes + std::string(80, 's') + sample_text<float>({7}, false),
                sample_text<float>({7}, false));
  EXPECT_EQ(read_info_.range, (ValueRange{-2, 8}));
  EXPECT_EQ(read_info_.affine.origin, (std::array<double, 3>{2, 0, 0}));
  h.set(200, 3.0f);
  expect_voxels(h.bytes + std::string(80, 's') + sample_text<float>({7}, false),
                sample_text<float>({7}, false));
  EXPECT_EQ(read_info_.affine.origin, (std::array<double, 3>{0, 3, 0}));
  h.set(80, -2.0f);
  expect_voxels(h.bytes + std::string(80, 's') + sample_text<float>({7}, false),
                sample_text<float>({7}, false));
  EXPECT_FALSE(read_info_.range);
}

TEST_F(MrcTest, WhatIsWrittenReadsBack) {
  for (const char* name : {"v.mrc", "v.map", "v.ccp4", "V.REC"})
    for (const Index3 dims : {Index3{1, 1, 1}, Index3{100, 41, 3}})
      for (SampleType type :
           {SampleType::u8, SampleType::i8, SampleType::u16, SampleType::i16, SampleType::f32}) {
        VolumeInfo info = make_info(dims, scalar_format(type), type);
        info.unit = Unit::angstrom;
        info.affine = Affine::plain({0.25, 2, 0.5}, info.affine.origin);
        info.affine.origin = {-1.5, 0, 64};
        round_trip(name, info);
        EXPECT_EQ(read_info_.sample_type, type);
      }
  round_trip("v.mrc", make_info({9, 2, 1}, VoxelFormat::bitmap, SampleType::bit));
  EXPECT_EQ(create_volume(path("c.mrc"), make_info({1, 1, 1}, VoxelFormat::rgba32), false, ctx_).error().code,
            ErrorCode::usage);
  EXPECT_FALSE(std::filesystem::exists(path("c.mrc")));
}

TEST_F(MrcTest, TheWrittenHeaderStatesTheRange) {
  const VolumeInfo info = make_info({4, 1, 1}, VoxelFormat::float32, SampleType::f32);
  auto sink = create_volume(path("v.mrc"), info, false, ctx_);
  ASSERT_TRUE(sink);
  const float voxels[4] = {3, NAN, -1.5, 0};
  ASSERT_TRUE(
      (*sink)->write(0, 1, packed(reinterpret_cast<const std::byte*>(voxels), info.dims, info.format)));
  ASSERT_TRUE((*sink)->finish());
  EXPECT_EQ(get(path("v.mrc")).substr(76, 12), sample_text<float>({-1.5, 3, 0.5}, false));
  EXPECT_EQ((*open_volume(path("v.mrc"), {}, ctx_))->info().range, (ValueRange{-1.5, 3}));
}

TEST_F(MrcTest, HeaderErrorsSayWhatIsExpected) {
  const auto refuse = [&](const std::function<void(Header&)>& change, const std::string& error) {
    SCOPED_TRACE(error);
    Header h(1, {2, 3, 4});
    change(h);
    expect_error(put("v.mrc", h.bytes + std::string(48, 'x')), error);
  };
  refuse([](Header& h) { h.set(12, int32_t{3}); },
         "mode 3 at byte 12 (complex numbers of 16 bits) is unsupported");
  refuse([](Header& h) { h.set(12, int32_t{4}); }, "mode 4 at byte 12 (complex numbers of 32 bits)");
  refuse(
      [](Header& h) {
        h.set(12, int32_t{0});
        h.set(152, int32_t{1146047817});
        h.set(156, int32_t{16});
      },
      "of 4 bits as IMOD's flags say");
  refuse([](Header& h) { h.set(88, int32_t{401}); }, "4 sections of volumes of 10");
  refuse([](Header& h) { h.set(12, int32_t{77}); }, "mode 77");
  refuse([](Header& h) { h.set(0, int32_t{0}); }, "0 x 3 x 4 voxels");
  refuse([](Header& h) { h.set(8, int32_t{-4}); }, "2 x 3 x -4 voxels");
  refuse([](Header& h) { h.set(8, int32_t{5}); }, "end after 48 bytes: expected 60");
  refuse([](Header& h) { h.set(92, int32_t{4}); }, "end after 44 bytes: expected 48");
  refuse([](Header& h) { h.set(92, int32_t{-80}); }, "-80 bytes of extended header");
  refuse([](Header& h) { h.set(64, int32_t{3}); },
         "axis order 3,2,3 at byte 64: expected 1, 2 and 3 in some order");
  refuse([](Header& h) { h.set(64, INT32_MIN); }, "axis order -2147483648,2,3 at byte 64");
  refuse([](Header& h) { h.bytes[208] = 'X', h.set(40, -1.0f); },
         "not an MRC file: expected MAP at byte 208");
  refuse([](Header& h) { h.bytes[208] = 'X', h.set(12, int32_t{77}); }, "not an MRC file");
  refuse([](Header& h) { h.bytes[208] = 'X', h.set(68, int32_t{3}); }, "not an MRC file");
  refuse([](Header& h) { h.set(0, INT32_MAX), h.set(4, INT32_MAX), h.set(8, INT32_MAX); },
         "2147483647 x 2147483647 x 2147483647 voxels at byte 0: expected at most 2^62 in all");
  refuse([](Header& h) { h.set(0, INT32_MAX), h.set(4, INT32_MAX), h.set(8, 1); },
         "too many voxels: expected at most 2^62 bytes");
  refuse([](Header& h) { h.set(0, INT32_MAX); },
         "voxel data at byte 1024 end after 48 bytes: expected 51539607528");
}

TEST_F(MrcTest, HostileFiles) {
  hostile("v.mrc", Header(1, {2, 3, 4}).bytes + std::string(48, 'x'), 3000);
}

}  // namespace
}  // namespace voxkit
