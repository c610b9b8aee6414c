// Where an MRC map is, which of several, and what of it is dropped.
#include <fmt/format.h>

#include <cmath>

#include "tests/formats/mrc_files.h"
#include "tests/formats/packing_test.h"

namespace voxkit {
namespace {

class MrcPlaceTest : public FileFormatTest {
 protected:
  std::string voxels_of(const std::string& file, const OpenOptions& options = {}) {
    notes_.clear();
    auto source = open_volume(file, options, ctx_);
    if (!source) return "error: " + source.error().what;
    info_ = (*source)->info();
    const auto voxels = read(**source);
    if (!voxels) return "error: " + voxels.error().what;
    return {reinterpret_cast<const char*>(voxels->data()), voxels->size()};
  }
  VolumeInfo written(const std::string& name, const VolumeInfo& info) {
    notes_.clear();
    auto sink = create_volume(path(name), info, true, ctx_);
    EXPECT_TRUE(sink) << sink.error().what;
    EXPECT_TRUE(write(**sink, info, random_voxels(info)));
    const std::vector<std::string> notes = notes_;
    voxels_of(path(name));
    EXPECT_TRUE(notes_.empty()) << all_notes();
    notes_ = notes;
    return info_;
  }
  VolumeInfo info_;
};

TEST_F(MrcPlaceTest, AxesInAnyOrderBecomeXYZ) {
  // A byte for each of 2 x 3 x 2 columns, rows and sections.
  const std::string data = "abcdefghijkl";
  for (const bool packed : {false, true}) {
    MrcHeader h(0, {2, 3, 2});
    h.set(152, int32_t{1146047817});
    const auto file = [&] {
      return put(packed ? "v.map.gz" : "v.map", packed ? gzip_text(h.bytes + data) : h.bytes + data);
    };
    for (size_t i = 0; i < 3; ++i)
      h.set(28 + 4 * i, int32_t{5}), h.set(16 + 4 * i, static_cast<int32_t>(i + 1));
    EXPECT_EQ(voxels_of(file()), data);
    EXPECT_EQ(info_.affine, Affine::plain({1, 2, 3}, {1, 4, 9}));
    EXPECT_EQ(info_.unit, Unit::angstrom);
    h.set(64, int32_t{3}), h.set(68, int32_t{2}), h.set(72, int32_t{1});  // columns are z, sections x
    EXPECT_EQ(voxels_of(file()), "agciekbhdjfl");
    EXPECT_EQ(info_.dims, Index3(2, 3, 2));
    EXPECT_EQ(info_.affine, Affine::plain({1, 2, 3}, {3, 4, 3}));
    h.set(64, int32_t{2}), h.set(68, int32_t{3}), h.set(72, int32_t{1});
    EXPECT_EQ(voxels_of(file()), "agbhcidjekfl");
    EXPECT_EQ(info_.dims, Index3(2, 2, 3));
    h.set(64, int32_t{0}), h.set(68, int32_t{0}), h.set(72, int32_t{0});  // not said
    EXPECT_EQ(voxels_of(file()), data);
  }
}

TEST_F(MrcPlaceTest, AnObliqueCellIsASheareddAffine) {
  MrcHeader h(0, {1, 1, 1});
  const float angles[3] = {90, 110.5f, 120};
  for (size_t i = 0; i < 3; ++i) h.set(52 + 4 * i, angles[i]);
  voxels_of(put("v.mrc", h.bytes + "x"));
  const auto& [a, b, c] = info_.affine.axes;
  EXPECT_EQ(a, (Affine::Vector{0.5, 0, 0}));
  EXPECT_NEAR(b[0], -0.5, 1e-12);
  EXPECT_NEAR(b[1], std::sqrt(0.75), 1e-12);
  EXPECT_EQ(b[2], 0);
  EXPECT_NEAR(info_.affine.spacing()[2], 1.5, 1e-12);
  EXPECT_NEAR(a[0] * c[0] / 0.75, std::cos(110.5 * M_PI / 180), 1e-12);
  EXPECT_NEAR(b[0] * c[0] + b[1] * c[1], 0, 1e-12);
  EXPECT_GT(c[2], 0);
  // It comes back as the cell that it was.
  VolumeInfo info = info_;
  info.affine.origin = {-30 * a[0] + 7 * b[0], 7 * b[1], 0};
  EXPECT_EQ(written("w.mrc", info).affine.axes, info.affine.axes);
  EXPECT_TRUE(notes_.empty()) << all_notes();
  EXPECT_EQ(get(path("w.mrc")).substr(52, 12), sample_text<float>({90, 110.5f, 120}, false));
  EXPECT_EQ(info_.affine.origin, info.affine.origin);  // by the number of its first voxel
  h.set(52, 10.0f), h.set(56, 20.0f);
  voxels_of(put("v.mrc", h.bytes + "x"));
  EXPECT_TRUE(noted("which no cell has: 90 are assumed")) << all_notes();
}

TEST_F(MrcPlaceTest, TheOriginIsTakenBeforeTheStart) {
  MrcHeader h(0, {1, 1, 1});
  h.set(16, int32_t{4});
  h.set(196, 2.0f);
  voxels_of(put("v.mrc", h.bytes + "x"));
  EXPECT_EQ(info_.affine.origin, (Affine::Vector{2, 0, 0}));
  EXPECT_TRUE(notes_.empty()) << all_notes();
  h.set(16, int32_t{5});
  voxels_of(put("v.mrc", h.bytes + "x"));
  EXPECT_EQ(info_.affine.origin, (Affine::Vector{2, 0, 0}));
  EXPECT_TRUE(
      noted("says twice where the volume begins, at 2,0,0 and with voxel 5,0,0: the latter is dropped"))
      << all_notes();
  // IMOD's own files have the sign turned, unless they say that they have not.
  h.set(16, int32_t{0});
  h.set(152, int32_t{1146047817});
  voxels_of(put("v.mrc", h.bytes + "x"));
  EXPECT_EQ(info_.affine.origin, (Affine::Vector{-2, 0, 0}));
  h.set(156, int32_t{5});
  voxels_of(put("v.mrc", h.bytes + "x"));
  EXPECT_EQ(info_.affine.origin, (Affine::Vector{2, 0, 0}));
  h.set(156, int32_t{0}), h.set(108, int32_t{20140});
  voxels_of(put("v.mrc", h.bytes + "x"));
  EXPECT_EQ(info_.affine.origin, (Affine::Vector{2, 0, 0}));
}

TEST_F(MrcPlaceTest, WhatContradictsIsNamed) {
  MrcHeader h(0, {2, 1, 1});
  h.set(76, 0.0f), h.set(80, 255.0f);
  EXPECT_EQ(voxels_of(put("v.mrc", h.bytes + "\x05\xff")), "\x85\x7f");
  EXPECT_TRUE(noted("values are from 0 to 255, which those of mode 0 cannot be: they are read as i8"))
      << all_notes();
  h.set(80, 127.0f);
  voxels_of(put("v.mrc", h.bytes + "\x05\xff"));
  EXPECT_TRUE(notes_.empty()) << all_notes();
  h.set(12, int32_t{6}), h.set(76, -3.0f);
  voxels_of(put("v.mrc", h.bytes + "abcd"));
  EXPECT_TRUE(noted("from -3 to 127, which those of mode 6")) << all_notes();
}

TEST_F(MrcPlaceTest, LengthsThatCannotBeAreNamed) {
  for (const float cell : {-5.0f, NAN, INFINITY}) {
    MrcHeader h(0, {2, 1, 1});
    h.set(40, cell);
    voxels_of(put("v.mrc", h.bytes + "ab"));
    EXPECT_EQ(info_.affine.axes[0][0], 1);
    EXPECT_TRUE(noted(fmt::format(
        "the cell has sides of {} in 10 parts, which are no lengths: steps of 1 are assumed", cell)))
        << all_notes();
  }
  MrcHeader h(0, {2, 1, 1});
  h.set(196, 3.0f);
  h.set(200, NAN);
  voxels_of(put("v.mrc", h.bytes + "ab"));
  EXPECT_EQ(info_.affine.origin, (Affine::Vector{3, 0, 0}));
  EXPECT_TRUE(noted("the origin has numbers that are not finite: they are dropped")) << all_notes();
}

TEST_F(MrcPlaceTest, OldFilesWithoutMapAreRead) {
  for (const bool big : {false, true}) {
    MrcHeader h(1, {2, 1, 1}, big);
    h.bytes.replace(208, 8, std::string(8, '\0'));
    EXPECT_EQ(voxels_of(put("v.mrc", h.bytes + sample_text<int16_t>({-3, 1000}, big))),
              sample_text<uint16_t>({32765, 33768}, false));
    EXPECT_EQ(info_.affine.spacing(), (Affine::Vector{0.5, 1, 1.5}));
    EXPECT_TRUE(noted("there is no MAP at byte 208: read as an MRC file all the same")) << all_notes();
    h.set(0, int32_t{0});
    expect_error(put("v.mrc", h.bytes + "abcd"), "not an MRC file");
  }
}

TEST_F(MrcPlaceTest, PackedFilesByEveryName) {
  const std::string content = MrcHeader(6, {2, 1, 2}).bytes + sample_text<uint16_t>({1, 2, 3, 4}, false);
  for (const char* name : {"v.mrc.gz", "v.map.gz", "v.ccp4.gz", "V.REC.GZ"})
    EXPECT_EQ(voxels_of(put(name, gzip_text(content))), content.substr(1024));
  for (const char* name : {"v.mrc.bz2", "v.map.bz2", "v.ccp4.bz2", "v.rec.bz2"}) {
    EXPECT_EQ(voxels_of(put(name, bzip2_text(content))), content.substr(1024));
    const VolumeInfo info = make_info({1, 1, 1}, VoxelFormat::density8);
    EXPECT_EQ(create_volume(path(name), info, true, ctx_).error().code, ErrorCode::usage);
  }
  expect_error(put("v.mrc.gz", gzip_text(content.substr(0, content.size() - 1))),
               "end after 7 bytes: expected 8");
  expect_error(put("v.mrc.gz", gzip_text(content.substr(0, 1000))), "MRC header: ends after 1000 bytes");
}

TEST_F(MrcPlaceTest, StacksOfVolumesAreChosenFrom) {
  for (const bool packed : {false, true}) {
    MrcHeader h(0, {2, 1, 6});
    h.set(152, int32_t{1146047817});
    h.set(88, int32_t{401});
    h.set(36, int32_t{2});
    const std::string all = h.bytes + "abcdefghijkl",
                      file = put(packed ? "v.mrc.gz" : "v.mrc", packed ? gzip_text(all) : all);
    EXPECT_EQ(voxels_of(file), "error: has 3 volumes: expected --time N, from 0 to 2");
    OpenOptions options;
    options.time = 1;
    EXPECT_EQ(voxels_of(file, options), "efgh");
    EXPECT_EQ(info_.dims, Index3(2, 1, 2));
    options.time = 3;
    EXPECT_EQ(voxels_of(file, options).substr(0, 16), "error: --time 3:");
  }
  MrcHeader h(0, {2, 1, 2});
  h.set(88, int32_t{0}), h.set(36, int32_t{1});
  voxels_of(put("v.mrc", h.bytes + "abcd"));
  EXPECT_TRUE(noted("a stack of 2 pictures: they are taken for the slices")) << all_notes();
}

TEST_F(MrcPlaceTest, FourBitsAreBytes) {
  for (const bool packed : {false, true}) {
    const std::string all = MrcHeader(101, {3, 2, 1}).bytes + "\x21\xf3\x54\xf6";
    EXPECT_EQ(voxels_of(put(packed ? "v.mrc.gz" : "v.mrc", packed ? gzip_text(all) : all)),
              "\x01\x02\x03\x04\x05\x06");
    EXPECT_EQ(info_.sample_type, SampleType::u8);
  }
  hostile("n.mrc", MrcHeader(101, {3, 2, 1}).bytes + "\x21\xf3\x54\xf6", 500);
}

TEST_F(MrcPlaceTest, LabelsAndExtendedHeaders) {
  MrcHeader h(0, {1, 1, 1});
  h.set(220, int32_t{3});
  h.bytes.replace(224, 6, "a map ");
  h.bytes.replace(304, 5, "two  ");
  h.bytes.replace(384, 5, "three");
  h.set(92, int32_t{160});
  h.bytes.replace(104, 4, "SERI");
  EXPECT_EQ(voxels_of(put("v.mrc", h.bytes + std::string(160, 's') + "x")).size(), 1u);
  EXPECT_EQ(info_.description, "a map");
  EXPECT_TRUE(noted("the file has 2 more labels and 160 bytes of extended header (SERI): dropped"))
      << all_notes();
  const VolumeInfo info = written("w.mrc", info_);
  EXPECT_EQ(info.description, "a map");
  EXPECT_TRUE(notes_.empty()) << all_notes();
}

TEST_F(MrcPlaceTest, WhatIsWritten) {
  VolumeInfo info = make_info({3, 2, 2}, VoxelFormat::density8);
  EXPECT_EQ(written("v.mrc", info).affine, info.affine);
  EXPECT_TRUE(notes_.empty()) << all_notes();
  info.affine = Affine::plain({0.25, 0.5, 2}, {-1, 0, 3});
  info.unit = Unit::nanometre;
  VolumeInfo back = written("v.mrc", info);
  EXPECT_EQ(back.affine, Affine::plain({2.5, 5, 20}, {-10, 0, 30}));
  EXPECT_EQ(back.unit, Unit::angstrom);
  EXPECT_TRUE(notes_.empty()) << all_notes();
  info.unit = Unit::unknown;
  EXPECT_EQ(written("v.mrc", info).affine, info.affine);
  EXPECT_TRUE(noted("the unit of the volume is not known")) << all_notes();
  info.unit = Unit::angstrom;
  info.affine.axes[0] = {-0.25, 0, 0};
  info.world = World::ras;
  info.slope = 2;
  info.is_labels = true;
  info.fill = 7;
  back = written("v.mrc", info);
  EXPECT_EQ(back.affine, Affine::plain({0.25, 0.5, 2}, {-1, 0, 3}));
  EXPECT_TRUE(
      noted("MRC cannot hold the directions of axes, the world RAS, the slope 2 and the intercept 0, that "
            "values are labels and that 7 is the fill value: dropped"))
      << all_notes();
}

TEST_F(MrcPlaceTest, HalvesStayHalves) {
  VolumeInfo info = make_info({4, 2, 1}, VoxelFormat::float32, SampleType::f16);
  const float voxels[8] = {1, -0.0f, 65504, 1e6f, 0x1p-24f, 0x1.ffcp-1f, 1 + 0x1p-11f, 1 + 0x1.8p-10f};
  auto sink = create_volume(path("v.mrc"), info, true, ctx_);
  ASSERT_TRUE(sink);
  ASSERT_TRUE(
      (*sink)->write(0, 1, packed(reinterpret_cast<const std::byte*>(voxels), info.dims, info.format)));
  ASSERT_TRUE((*sink)->finish());
  EXPECT_EQ(get(path("v.mrc")).substr(1024),
            sample_text<uint16_t>({0x3c00, 0x8000, 0x7bff, 0x7c00, 1, 0x3bff, 0x3c00, 0x3c02}, false));
  EXPECT_EQ(get(path("v.mrc")).substr(12, 4), sample_text<int32_t>({12}, false));
  // Every half comes back.
  std::vector<uint16_t> halves(65536);
  for (size_t i = 0; i < halves.size(); ++i) halves[i] = static_cast<uint16_t>(i);
  const std::string file = MrcHeader(12, {256, 128, 2}).bytes + sample_text(halves, false);
  auto source = open_volume(put("h.mrc", file), {}, ctx_);
  ASSERT_TRUE(source);
  const Bytes all = *read(**source);
  sink = create_volume(path("w.mrc"), (*source)->info(), true, ctx_);
  ASSERT_TRUE(sink && write(**sink, (*source)->info(), all));
  const std::string back = get(path("w.mrc")).substr(1024);
  for (size_t i = 0; i < halves.size(); ++i) {
    uint16_t half;
    std::memcpy(&half, back.data() + 2 * i, 2);
    if ((i & 0x7c00) == 0x7c00 && (i & 0x3ff) != 0) {
      EXPECT_TRUE((half & 0x7c00) == 0x7c00 && (half & 0x3ff) != 0) << i;  // NaN, if quiet now
    } else {
      EXPECT_EQ(half, i);
    }
  }
}

TEST_F(MrcPlaceTest, WideIntegersAreFloatsOrRefused) {
  VolumeInfo info = make_info({2, 1, 1}, VoxelFormat::density8, SampleType::i32);
  info.wide_base = -100000;
  auto sink = create_volume(path("v.mrc"), info, true, ctx_);
  ASSERT_TRUE(sink) << sink.error().what;
  EXPECT_TRUE(noted("i32 are written as floats, exactly")) << all_notes();
  ASSERT_TRUE(write(**sink, info, {std::byte{0}, std::byte{200}}));
  EXPECT_EQ(get(path("v.mrc")).substr(1024), sample_text<float>({-100000, -99800}, false));
  info.wide_base = 1 << 24;
  EXPECT_EQ(create_volume(path("w.mrc"), info, true, ctx_).error().code, ErrorCode::usage);
  EXPECT_FALSE(std::filesystem::exists(path("w.mrc")));
}

}  // namespace
}  // namespace voxkit
