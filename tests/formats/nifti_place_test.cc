// Where a NIfTI volume is, which of several it is, and in which files.
#include <cmath>

#include "tests/formats/nifti_files.h"
#include "tests/formats/packing_test.h"

namespace voxkit {
namespace {

class NiftiPlaceTest : public FileFormatTest {
 protected:
  VolumeInfo info_of(const std::string& file, const OpenOptions& options = {}) {
    notes_.clear();
    auto source = open_volume(file, options, ctx_);
    EXPECT_TRUE(source) << source.error().what;
    return source ? (*source)->info() : VolumeInfo{};
  }
  std::string voxels_of(const std::string& file, const OpenOptions& options = {}) {
    auto source = open_volume(file, options, ctx_);
    if (!source) return "error: " + source.error().what;
    read_info_ = (*source)->info();
    const auto voxels = read(**source);
    if (!voxels) return "error: " + voxels.error().what;
    return {reinterpret_cast<const char*>(voxels->data()), voxels->size()};
  }
  /// Reads a file and writes what was read.
  void convert(const std::string& from, const std::string& to) {
    auto source = open_volume(from, {}, ctx_);
    ASSERT_TRUE(source) << source.error().what;
    const VolumeInfo info = (*source)->info();
    const Bytes voxels = *read(**source);
    notes_.clear();
    auto sink = create_volume(to, info, true, ctx_);
    ASSERT_TRUE(sink) << sink.error().what;
    ASSERT_TRUE(write(**sink, info, voxels));
  }
  /// The bytes of both forms: pixdim, quaternion and offset, matrix.
  static std::string place_bytes(const std::string& file) {
    return file.substr(76, 16) + file.substr(256, 72);
  }
  const Affine flipped_{{{{-2, 0, 0}, {0, 2, 0}, {0, 0, 3}}}, {90, -126, -72}};
  /// Turned by 30 degrees about z.
  const Affine oblique_{{{{0.8660253882408142, 0.5, 0}, {-0.5, 0.8660253882408142, 0}, {0, 0, 2.5}}},
                        {1, 2, 3}};
  const Affine sheared_{{{{1, 0.25, 0}, {0, 1.5, 0}, {0.5, 0, -2}}}, {-10, 0.125, 7}};
};

TEST_F(NiftiPlaceTest, TheMatrixIsTakenBeforeTheQuaternionAndThatBeforeDistances) {
  for (const int version : {1, 2})
    for (const bool big : {false, true}) {
      SCOPED_TRACE(testing::Message() << version << big);
      NiftiHeader h = nifti_header(version, big, {2, 3, 4}, 2);
      const std::string data(24, 'x');
      h.qform(0, {1, 0.5, 1.5, 2}, {0, 0, 0}, {7, 8, 9});
      VolumeInfo info = info_of(put("v.nii", h.bytes + data));
      EXPECT_EQ(info.affine, Affine::plain({0.5, 1.5, 2}, {0, 0, 0}));
      EXPECT_EQ(info.world, World::unknown);
      EXPECT_EQ(info.space_code, 0);
      EXPECT_TRUE(notes_.empty()) << all_notes();

      h.qform(3, {-1, 0.5, 1.5, 2}, {0, 1, 0},
              {7, 8, 9});  // half a turn about y, and the third axis mirrored
      info = info_of(put("v.nii", h.bytes + data));
      EXPECT_EQ(info.affine, (Affine{{{{-0.5, 0, 0}, {0, 1.5, 0}, {0, 0, 2}}}, {7, 8, 9}}));
      EXPECT_EQ(info.world, World::ras);
      EXPECT_EQ(info.space_code, 3);

      h.sform(2, sheared_);
      info = info_of(put("v.nii", h.bytes + data));
      EXPECT_EQ(info.affine, sheared_);
      EXPECT_EQ(info.space_code, 2);
      EXPECT_TRUE(noted("the qform puts the volume elsewhere: the sform is taken")) << all_notes();

      // The same place is said without a word, whatever rounding there is, but for its code.
      h.qform(2, {1, 1, 1, 2.5}, {0, 0, std::sin(3.14159265358979 / 12)}, {1, 2, 3});
      h.sform(2, oblique_);
      info_of(put("v.nii", h.bytes + data));
      EXPECT_TRUE(notes_.empty()) << all_notes();
      h.sform(4, oblique_);
      EXPECT_EQ(info_of(put("v.nii", h.bytes + data)).space_code, 4);
      EXPECT_TRUE(noted("code 2 (aligned): dropped for that of the sform, 4 (MNI 152)")) << all_notes();

      h.sform(1, Affine{{{{1, 0, 0}, {2, 0, 0}, {0, 0, 1}}}, {}});
      info = info_of(put("v.nii", h.bytes + data));
      EXPECT_EQ(info.space_code, 2);
      EXPECT_TRUE(noted("the sform has axes that are zero or in one plane")) << all_notes();

      // Forms with numbers that are none are dropped for that reason; and then distances that are none count.
      h.sform(1, Affine{{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, {NAN, 0, 0}});
      EXPECT_EQ(info_of(put("v.nii", h.bytes + data)).space_code, 2);
      EXPECT_TRUE(noted("the sform has numbers that are not finite: dropped")) << all_notes();
      EXPECT_FALSE(noted("in one plane"));
      h.qform(2, {1, NAN, 1, 2.5}, {0, 0, 0}, {0, INFINITY, 0});
      info = info_of(put("v.nii", h.bytes + data));
      EXPECT_EQ(info.affine, Affine::plain({1, 1, 2.5}, {0, 0, 0}));
      EXPECT_TRUE(noted("the qform has numbers that are not finite: dropped")) << all_notes();
      EXPECT_TRUE(noted("the distance of voxels along axis 1 is not said: 1 is assumed")) << all_notes();
    }
}

TEST_F(NiftiPlaceTest, DistancesThatAreNotSaidAreAssumed) {
  NiftiHeader h = nifti_header(1, false, {2, 3, 1}, 2);
  h.qform(0, {1, 0, 2, 0}, {0, 0, 0}, {0, 0, 0});
  EXPECT_EQ(info_of(put("v.nii", h.bytes + "abcdef")).affine, Affine::plain({1, 2, 1}, {0, 0, 0}));
  EXPECT_TRUE(noted("the distance of voxels along axis 1 is not said: 1 is assumed")) << all_notes();
}

TEST_F(NiftiPlaceTest, OfOneSliceTheThirdAxisMayBeMissing) {
  NiftiHeader h = nifti_header(1, false, {2, 3, 1}, 2);
  h.qform(0, {1, 2, 2, 5}, {0, 0, 0}, {0, 0, 0});
  h.sform(1, Affine{{{{2, 0, 0}, {0, -2, 0}, {0, 0, 0}}}, {1, 2, 3}});
  EXPECT_EQ(info_of(put("v.nii", h.bytes + "abcdef")).affine,
            (Affine{{{{2, 0, 0}, {0, -2, 0}, {0, 0, -5}}}, {1, 2, 3}}));
}

TEST_F(NiftiPlaceTest, WhatCameInComesBackToTheLastBit) {
  const std::string data(24, 'x');
  for (const Affine& affine :
       {flipped_, oblique_, sheared_, Affine::plain({0.1f, 3, 1e-3f}, {0, -7.7f, 1e5f})}) {
    NiftiHeader h = nifti_header(1, false, {2, 3, 4}, 2);
    h.sform(4, affine);
    h.units(3);
    put("in.nii", h.bytes + data);
    convert(path("in.nii"), path("out.nii.gz"));
    EXPECT_TRUE(notes_.empty()) << all_notes();
    convert(path("out.nii.gz"), path("out.nii"));
    EXPECT_EQ(get(path("out.nii")).substr(280, 48), h.bytes.substr(280, 48));
    const VolumeInfo info = info_of(path("out.nii"));
    EXPECT_EQ(info.affine, info_of(path("in.nii")).affine);
    EXPECT_EQ(info.space_code, 4);
    EXPECT_EQ(info.unit, Unit::micrometre);
    EXPECT_TRUE(notes_.empty()) << all_notes();  // both forms, where both are there, agree
  }
}

TEST_F(NiftiPlaceTest, OfAQuaternionAloneTheSameFloatsComeBack) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const std::string data(24, 'x');
  for (int i = 0; i < 300; ++i) {
    double q[4], square = 0;
    for (double& x : q) x = i % 3 == 0 && &x == &q[i % 4] ? 0 : normal(random), square += x * x;
    const double scale = (q[0] < 0 ? -1 : 1) / std::sqrt(square);
    NiftiHeader h = nifti_header(1, false, {2, 3, 4}, 2);
    h.qform(1, {i % 2 == 0 ? 1.0 : -1.0, 0.7, 0.9 + i, 2.5},
            {q[1] * scale + 0.0, q[2] * scale + 0.0, q[3] * scale + 0.0},
            {normal(random), 100 * normal(random), -30});
    put("in.nii", h.bytes + data);
    convert(path("in.nii"), path("out.nii"));
    SCOPED_TRACE(i);
    const VolumeInfo in = info_of(path("in.nii")), out = info_of(path("out.nii"));
    ASSERT_EQ(out.affine, in.affine);
    if (q[0] == 0) continue;  // half a turn: b, c, d and -b, -c, -d are the same
    ASSERT_EQ(place_bytes(get(path("out.nii"))), place_bytes(h.bytes));
  }
}

TEST_F(NiftiPlaceTest, OtherWorldsAndUnits) {
  VolumeInfo info = make_info({2, 3, 4}, VoxelFormat::density8);
  const Bytes voxels = random_voxels(info);
  const auto written = [&] {
    notes_.clear();
    auto sink = create_volume(path("v.nii"), info, true, ctx_);
    EXPECT_TRUE(sink && write(**sink, info, voxels));
    const std::string notes = all_notes();
    const VolumeInfo back = info_of(path("v.nii"));
    notes_ = {notes.substr(0, notes.find('\n'))};
    return back;
  };
  // Nothing is known, and nothing is said.
  info.affine = Affine::plain({2, 3, 4}, {0, 0, 0});
  VolumeInfo back = written();
  EXPECT_EQ(back.affine, info.affine);
  EXPECT_EQ(back.world, World::unknown);
  EXPECT_EQ(all_notes(), "\n");
  info.affine.origin = {1, 0, 0};
  back = written();
  EXPECT_EQ(back.affine, info.affine);
  EXPECT_EQ(back.world, World::ras);
  EXPECT_EQ(back.space_code, 2);
  EXPECT_TRUE(noted("the world of the volume is not known")) << all_notes();

  info.world = World::lps;
  info.affine = {{{{-0.5, 0, 0}, {0, -0.5, 0}, {0, 0, 2.5}}}, {10, 20, -30}};
  back = written();
  EXPECT_EQ(back.affine, (Affine{{{{0.5, 0, 0}, {0, 0.5, 0}, {0, 0, 2.5}}}, {-10, -20, -30}}));
  EXPECT_EQ(back.world, World::ras);
  EXPECT_EQ(back.space_code, 1);
  EXPECT_EQ(all_notes(), "\n");
  info.unit = Unit::angstrom;
  back = written();
  EXPECT_EQ(back.unit, Unit::micrometre);
  EXPECT_EQ(back.affine.origin, (Affine::Vector{-0.001f, -0.002f, -0.003f}));
  info.unit = Unit::centimetre;
  back = written();
  EXPECT_EQ(back.unit, Unit::millimetre);
  EXPECT_EQ(back.affine.spacing(), (Affine::Vector{5, 5, 25}));
  info.unit = Unit::inch;
  back = written();
  EXPECT_EQ(back.affine.spacing(), (Affine::Vector{12.7f, 12.7f, 63.5f}));
  info.world = World::scanner;
  written();
  EXPECT_TRUE(noted("the world of the volume is scanner")) << all_notes();
}

TEST_F(NiftiPlaceTest, MeaningIsCarriedOrNamed) {
  for (const int version : {1, 2}) {
    NiftiHeader h = nifti_header(version, version == 2, {2, 3, 4}, 2);
    h.intent(1002);
    h.text(148, 240, "a head");
    put("in.nii", h.bytes + std::string(24, 'x'));
    VolumeInfo info = info_of(path("in.nii"));
    EXPECT_TRUE(info.is_labels);
    EXPECT_EQ(info.description, "a head");
    EXPECT_TRUE(notes_.empty()) << all_notes();
    convert(path("in.nii"), path("out.nii"));
    info = info_of(path("out.nii"));
    EXPECT_TRUE(info.is_labels);
    EXPECT_EQ(info.description, "a head");

    h.intent(5);
    h.number(124, 192, 100);  // cal_max
    h.text(228, 320, "atlas.txt");
    h.text(328, 508, "zstat");
    info = info_of(put("in.nii", h.bytes + std::string(24, 'x')));
    EXPECT_FALSE(info.is_labels);
    EXPECT_TRUE(
        noted("the header has the intent code 5 (z score), the intent name \"zstat\", the range to "
              "display, 0 to 100 and the auxiliary file \"atlas.txt\": dropped"))
        << all_notes();
  }
  VolumeInfo info = make_info({1, 1, 1}, VoxelFormat::density8);
  info.description = std::string(78, 'a') + "\xc3\xa9\xc3\xa9";
  info.fill = 3;
  auto sink = create_volume(path("v.nii"), info, true, ctx_);
  ASSERT_TRUE(sink && write(**sink, info, Bytes(1)));
  EXPECT_TRUE(noted("the description is cut to 78 bytes")) << all_notes();
  EXPECT_TRUE(noted("NIfTI cannot hold that 3 is the fill value: dropped")) << all_notes();
  EXPECT_EQ(info_of(path("v.nii")).description, std::string(78, 'a'));
  NiftiHeader h = nifti_header(1, false, {1, 1, 1}, 2);
  h.text(148, 240, "5 \xb5m\x01");
  EXPECT_EQ(info_of(put("v.nii", h.bytes + "x")).description, "5 \xc2\xb5m");
}

TEST_F(NiftiPlaceTest, ExtensionsAreNamed) {
  for (const int version : {1, 2})
    for (const bool packed : {false, true}) {
      NiftiHeader h = nifti_header(version, packed, {2, 1, 1}, 2);
      const std::string extension = sample_text<int32_t>({32, 4}, packed) + std::string(24, 'e');
      h.bytes[h.bytes.size() - 4] = 1;
      h.offset(static_cast<int64_t>(h.bytes.size() + 48));
      const std::string file =
          h.bytes + extension + sample_text<int32_t>({16, 6}, packed) + std::string(8, 'c') + "ab";
      EXPECT_EQ(voxels_of(put(packed ? "v.nii.gz" : "v.nii", packed ? gzip_text(file) : file)), "ab");
      EXPECT_TRUE(noted("2 NIfTI extensions are skipped (of code 4 and 6)")) << all_notes();
      notes_.clear();
    }
}

TEST_F(NiftiPlaceTest, TimeAndChannelsAreChosen) {
  for (const bool packed : {false, true}) {
    NiftiHeader h = nifti_header(1, false, {2, 1, 1}, 2);
    h.dim(0, 5);
    h.dim(4, 3);
    h.dim(5, 2);
    const auto file = [&](const std::string& data) {
      return put(packed ? "v.nii.gz" : "v.nii", packed ? gzip_text(h.bytes + data) : h.bytes + data);
    };
    const std::string name = file("abcdefABCDEF");
    expect_error(name,
                 "has 3 time steps and 2 channels: expected --time N, from 0 to 2 and --channel N, from "
                 "0 to 1");
    OpenOptions options;
    options.time = 1;
    options.channel = 1;
    EXPECT_EQ(voxels_of(name, options), "CD");
    options.time = 3;
    EXPECT_EQ(voxels_of(name, options), "error: --time 3: the file has 3 time steps: expected 0 to 2");
    options = {};
    options.any_part = true;
    EXPECT_EQ(voxels_of(name, options), "ab");
    EXPECT_EQ(read_info_.parts, (std::vector<std::string>{"--time 0 of 0..2", "--channel 0 of 0..1"}));
    h.dim(5, 1);
    options = {};
    options.time = 2;
    EXPECT_EQ(voxels_of(file("abcdef"), options), "ef");
    options.channel = 1;
    EXPECT_EQ(voxels_of(file("abcdef"), options), "error: --channel 1: the file has 1 channels: expected 0");
    h.dim(4, 1);
    h.dim(5, 1);
    options = {};
    options.time = 0;
    EXPECT_EQ(voxels_of(file("ab"), options), "ab");
  }
}

TEST_F(NiftiPlaceTest, ThreeOrFourPlanesOfBytesAreColors) {
  for (const bool packed : {false, true}) {
    NiftiHeader h = nifti_header(1, false, {2, 2, 1}, 2);
    h.dim(0, 5);
    h.dim(4, 1);
    h.dim(5, 3);
    const auto file = [&](const std::string& data) {
      return put(packed ? "v.nii.gz" : "v.nii", packed ? gzip_text(h.bytes + data) : h.bytes + data);
    };
    EXPECT_EQ(voxels_of(file("abcdABCD0123")), "aA0bB1cC2dD3");
    EXPECT_EQ(read_info_.format, VoxelFormat::rgb24);
    EXPECT_TRUE(notes_.empty()) << all_notes();
    OpenOptions options;
    options.channel = 1;
    EXPECT_EQ(voxels_of(file("abcdABCD0123"), options), "ABCD");
    h.intent(2003);
    h.dim(4, 2);
    options = {};
    options.time = 1;
    EXPECT_EQ(voxels_of(file("????abcd????ABCD????0123"), options), "aA0bB1cC2dD3");
    EXPECT_EQ(voxels_of(file("????abcd????ABCD????012"), options).substr(0, 6), "error:");
    h.dim(4, 1);
    h.dim(5, 4);
    EXPECT_EQ(voxels_of(file("abcdABCD0123...,")), "aA0.bB1.cC2.dD3,");
    EXPECT_EQ(read_info_.format, VoxelFormat::rgba32);
    h.intent(1001);
    expect_error(file("abcdABCD0123...,"), "has 4 channels: expected --channel N");
  }
}

TEST_F(NiftiPlaceTest, PairsByEitherNamePackedOrNot) {
  for (const int version : {1, 2}) {
    NiftiHeader h = nifti_header(version, false, {2, 1, 3}, 4);
    h.text(344, 4, std::string(version == 1 ? "ni1\0" : "ni2\0\r\n\032\n", version == 1 ? 4 : 8));
    h.offset(2);
    h.sform(1, flipped_);
    h.bytes.resize(version == 1 ? 348 : 540);
    const std::string image = "??" + sample_text<int16_t>({1, 2, 3, 4, 5, 6}, false),
                      expected = sample_text<uint16_t>({32769, 32770, 32771, 32772, 32773, 32774}, false);
    for (const bool header_packed : {false, true})
      for (const bool image_packed : {false, true}) {
        const std::string header_name = header_packed ? "p.hdr.gz" : "p.hdr",
                          image_name = image_packed ? "p.img.gz" : "p.img";
        SCOPED_TRACE(header_name + " " + image_name);
        put(header_name, header_packed ? gzip_text(h.bytes) : h.bytes);
        put(image_name, image_packed ? gzip_text(image) : image);
        for (const std::string& name : {header_name, image_name}) {
          EXPECT_EQ(voxels_of(path(name)), expected);
          EXPECT_EQ(read_info_.affine, flipped_);
          EXPECT_EQ(read_info_.files, (std::vector<std::string>{path(header_name), path(image_name)}));
        }
        std::filesystem::remove(path(image_name));
        expect_error(path(header_name), "no image beside it");
        put(image_name, image_packed ? gzip_text(image.substr(1)) : image.substr(1));
        expect_error(path(header_name), "end");
        std::filesystem::remove(path(header_name));
        expect_error(path(image_name), "no header beside it");
        std::filesystem::remove(path(image_name));
      }
  }
  const VolumeInfo info = make_info({1, 1, 1}, VoxelFormat::density8);
  EXPECT_EQ(create_volume(path("p.hdr"), info, false, ctx_).error().code, ErrorCode::usage);
  EXPECT_EQ(create_volume(path("p.img"), info, false, ctx_).error().code, ErrorCode::usage);
}

TEST_F(NiftiPlaceTest, AnalyzeSaysThatItHasNoOrientation) {
  for (const bool big : {false, true}) {
    NiftiHeader h = nifti_header(1, big, {2, 1, 1}, 4);
    h.bytes.replace(344, 4, std::string(4, '\0'));
    h.bytes.resize(348);
    h.qform(0, {0, 2, 2, 3}, {0, 0, 0}, {0, 0, 0});
    h.offset(0);
    h.bytes.replace(56, 2, "mm");
    h.bytes[252] = 2;
    put("a.hdr", h.bytes);
    put("a.img", sample_text<int16_t>({-1, 7}, big));
    EXPECT_EQ(voxels_of(path("a.img")), sample_text<uint16_t>({32767, 32775}, false));
    EXPECT_EQ(read_info_.affine, Affine::plain({2, 2, 3}, {0, 0, 0}));
    EXPECT_EQ(read_info_.world, World::unknown);
    EXPECT_EQ(read_info_.unit, Unit::millimetre);
    EXPECT_TRUE(noted("an Analyze header has no orientation")) << all_notes();
    EXPECT_FALSE(noted("SPM"));
    h.set<int16_t>(253, 91);
    h.number(112, 0, 0.25);
    put("a.hdr", h.bytes);
    EXPECT_EQ(info_of(path("a.hdr")).slope, 0.25);
    EXPECT_TRUE(noted("the origin that SPM may have put there: dropped")) << all_notes();
    EXPECT_TRUE(noted("a slope of 0.25")) << all_notes();
    notes_.clear();
  }
}

TEST_F(NiftiPlaceTest, HostilePairsAndExtensions) {
  NiftiHeader h = nifti_header(1, false, {2, 3, 4}, 2);
  h.bytes[348] = 1;
  h.offset(384);
  hostile("e.nii", h.bytes + sample_text<int32_t>({32, 4}, false) + std::string(24 + 24, 'e'));
  h.dim(0, 5), h.dim(3, 2), h.dim(4, 1), h.dim(5, 3);
  hostile("c.nii", h.bytes + std::string(32 + 36, 'e'));
  put("p.img", std::string(24, 'x'));
  NiftiHeader pair = nifti_header(2, true, {2, 3, 4}, 2);
  pair.text(344, 4, std::string("ni2\0\r\n\032\n", 8));
  pair.offset(0);
  pair.bytes.resize(540);
  hostile("p.hdr", pair.bytes);
}

}  // namespace
}  // namespace voxkit
