#include "tests/formats/nifti_files.h"
#include "tests/formats/packing_test.h"

namespace voxkit {
namespace {

class NiftiTest : public FileFormatTest {
 protected:
  /// As .nii, read in any order, and as .nii.gz, read front to back.
  void expect_voxels(const std::string& content, const std::string& expected) {
    for (const bool packed : {false, true}) {
      auto source =
          open_volume(put(packed ? "v.nii.gz" : "v.nii", packed ? gzip_text(content) : content), {}, ctx_);
      ASSERT_TRUE(source) << source.error().what;
      EXPECT_EQ((*source)->forward_only(), packed && !is_wide((*source)->info().sample_type));
      const auto voxels = read(**source);
      ASSERT_TRUE(voxels) << voxels.error().what;
      EXPECT_EQ(std::string(reinterpret_cast<const char*>(voxels->data()), voxels->size()), expected);
      read_info_ = (*source)->info();
    }
  }
};

TEST_F(NiftiTest, EveryTypeInBothOrdersAndVersions) {
  for (const int version : {1, 2})
    for (const bool big : {false, true}) {
      SCOPED_TRACE(testing::Message() << "NIfTI-" << version << (big ? " big" : " little"));
      const auto check = [&](int16_t code, const std::string& samples, const std::string& expected) {
        SCOPED_TRACE(code);
        expect_voxels(nifti_header(version, big, {2, 1, 1}, code).bytes + samples, expected);
      };
      check(2, sample_text<uint8_t>({3, 200}, big), sample_text<uint8_t>({3, 200}, false));
      check(256, sample_text<int8_t>({-3, 100}, big), sample_text<uint8_t>({125, 228}, false));
      check(4, sample_text<int16_t>({-3, 1000}, big), sample_text<uint16_t>({32765, 33768}, false));
      check(512, sample_text<uint16_t>({3, 1000}, big), sample_text<uint16_t>({3, 1000}, false));
      check(8, sample_text<int32_t>({-3, 100000}, big), sample_text<uint8_t>({0, 1}, false));
      check(768, sample_text<uint32_t>({3, 4000000000}, big), sample_text<uint8_t>({0, 1}, false));
      check(1024, sample_text<int64_t>({-3, 1000}, big), sample_text<uint16_t>({0, 1003}, false));
      check(1280, sample_text<uint64_t>({3, UINT64_MAX}, big), sample_text<uint8_t>({0, 1}, false));
      check(16, sample_text<float>({-3.5, 1}, big), sample_text<float>({-3.5, 1}, false));
      check(64, sample_text<double>({-3.5, 1}, big), sample_text<float>({-3.5, 1}, false));
      check(128, "abcdef", "abcdef");
      EXPECT_EQ(read_info_.format, VoxelFormat::rgb24);
      check(2304, "abcdefgh", "abcdefgh");
      EXPECT_EQ(read_info_.format, VoxelFormat::rgba32);
    }
}

TEST_F(NiftiTest, ScaleAndPlacement) {
  for (const int version : {1, 2})
    for (const bool big : {false, true}) {
      SCOPED_TRACE(testing::Message() << "NIfTI-" << version << (big ? " big" : " little"));
      NiftiHeader h = nifti_header(version, big, {1, 1, 1}, 2);
      for (size_t i = 1; i <= 3; ++i) h.number(76 + 4 * i, 104 + 8 * i, 0.5 * static_cast<double>(i));
      h.number(112, 176, 2);      // scl_slope
      h.number(116, 184, -1024);  // scl_inter
      for (size_t i = 0; i < 3; ++i) {
        h.number(268 + 4 * i, 376 + 8 * i, 10 + static_cast<double>(i));     // qoffset
        h.number(292 + 16 * i, 424 + 32 * i, -20 - static_cast<double>(i));  // srow_*[3]
      }
      expect_voxels(h.bytes + "x", "x");
      EXPECT_EQ(read_info_.affine.spacing(), (std::array<double, 3>{0.5, 1, 1.5}));
      EXPECT_EQ(read_info_.affine.origin, (std::array<double, 3>{0, 0, 0}));
      EXPECT_EQ(read_info_.slope, 2);
      EXPECT_EQ(read_info_.intercept, -1024);
      if (version == 1)
        h.set<int16_t>(252, 1);  // qform_code
      else
        h.set<int32_t>(344, 1);
      expect_voxels(h.bytes + "x", "x");
      EXPECT_EQ(read_info_.affine.origin, (std::array<double, 3>{10, 11, 12}));
      if (version == 1)
        h.set<int16_t>(254, 1);  // sform_code
      else
        h.set<int32_t>(348, 1);
      expect_voxels(h.bytes + "x", "x");
      EXPECT_EQ(read_info_.affine.origin, (std::array<double, 3>{-20, -21, -22}));
      h.number(112, 176, 0);
      expect_voxels(h.bytes + "x", "x");
      EXPECT_EQ(read_info_.slope, 1);
      EXPECT_EQ(read_info_.intercept, 0);
    }
}

TEST_F(NiftiTest, ExtensionsAreSkippedAndOneTimeStepIsAVolume) {
  for (const int version : {1, 2}) {
    NiftiHeader h = nifti_header(version, false, {3, 2, 1}, 2);
    h.dim(0, 4);
    h.dim(4, 1);
    h.offset(static_cast<int64_t>(h.bytes.size() + 32));
    expect_voxels(h.bytes + std::string(32, 'e') + "abcdef", "abcdef");
  }
}

TEST_F(NiftiTest, WhatIsWrittenReadsBack) {
  for (const char* name : {"v.nii", "v.nii.gz", "V.NII.GZ"})
    for (const Index3 dims : {Index3{1, 1, 1}, Index3{200, 101, 3}}) {
      for (SampleType type :
           {SampleType::u8, SampleType::i8, SampleType::u16, SampleType::i16, SampleType::f32}) {
        VolumeInfo info = make_info(dims, scalar_format(type), type);
        info.affine = Affine::plain({0.25, 2, 3}, info.affine.origin);
        info.affine.origin = {-1.5, 0, 64};
        info.slope = 0.5;
        info.intercept = -1024;
        round_trip(name, info);
        EXPECT_EQ(read_info_.sample_type, type);
      }
      round_trip(name, make_info(dims, VoxelFormat::rgb24));
      round_trip(name, make_info(dims, VoxelFormat::rgba32));
      round_trip(name, make_info(dims, VoxelFormat::bitmap, SampleType::bit));
    }
  const VolumeInfo wide = make_info({32768, 1, 1}, VoxelFormat::density8);
  EXPECT_EQ(create_volume(path("w.nii"), wide, false, ctx_).error().code, ErrorCode::usage);
  EXPECT_FALSE(std::filesystem::exists(path("w.nii")));
}

TEST_F(NiftiTest, PackedBytesHaveNoTimeAndNoName) {
  round_trip("v.nii.gz", make_info({3, 3, 3}, VoxelFormat::density8));
  const std::string file = get(path("v.nii.gz"));
  EXPECT_EQ(file.substr(0, 8), std::string("\x1f\x8b\x08\0\0\0\0\0", 8));
}

TEST_F(NiftiTest, HeaderErrorsSayWhatIsExpected) {
  const auto refuse = [&](const std::function<void(NiftiHeader&)>& change, const std::string& error) {
    SCOPED_TRACE(error);
    for (const int version : {1, 2}) {
      NiftiHeader h = nifti_header(version, false, {2, 3, 4}, 2);
      change(h);
      expect_error(put("v.nii", h.bytes + std::string(24, 'x')), error);
      expect_error(put("v.nii.gz", gzip_text(h.bytes + std::string(24, 'x'))), error);
    }
  };
  refuse([](NiftiHeader& h) { h.dim(0, 0); }, "dim[0] is 0");
  refuse([](NiftiHeader& h) { h.dim(0, 8); }, "dim[0] is 8");
  refuse([](NiftiHeader& h) { h.dim(2, 0); }, "dim[2] is 0");
  refuse([](NiftiHeader& h) { h.dim(3, -1); }, "dim[3] is -1");
  refuse([](NiftiHeader& h) { h.dim(3, 5); }, "end after 24 bytes: expected 30");
  refuse([](NiftiHeader& h) { h.type(1); }, "datatype 1 (1 bit) is unsupported");
  refuse([](NiftiHeader& h) { h.type(32); }, "datatype 32 (complex64) is unsupported");
  refuse([](NiftiHeader& h) { h.type(1536); }, "datatype 1536 (float128) is unsupported");
  refuse([](NiftiHeader& h) { h.type(1792); }, "datatype 1792 (complex128) is unsupported");
  refuse([](NiftiHeader& h) { h.type(2048); }, "datatype 2048 (complex256) is unsupported");
  refuse([](NiftiHeader& h) { h.dim(0, 6), h.dim(4, 1), h.dim(5, 1), h.dim(6, 2); },
         "dim[6] is 2: unsupported");
  refuse([](NiftiHeader& h) { h.offset(10); }, "vox_offset is 10");
  refuse([](NiftiHeader& h) { h.offset(-1); }, "vox_offset is -1");
  refuse([](NiftiHeader& h) { h.offset(100000000); }, "end");
  refuse([](NiftiHeader& h) { h.set<int32_t>(0, 349); }, "not a NIfTI file");
  refuse([](NiftiHeader& h) { h.bytes.replace(h.version == 1 ? 344 : 4, 2, "ni"); }, "pair of files");
  refuse([](NiftiHeader& h) { h.bytes[h.version == 1 ? 344 : 4] = 'x'; }, "no magic");
  NiftiHeader fraction = nifti_header(1, false, {1, 1, 1}, 2);
  fraction.set<float>(108, 352.5f);
  expect_error(put("v.nii", fraction.bytes + "x"), "vox_offset is 352.5");
  fraction.set<float>(108, std::numeric_limits<float>::quiet_NaN());
  expect_error(put("v.nii", fraction.bytes + "x"), "vox_offset is nan");
  NiftiHeader huge = nifti_header(2, false, {max_side, max_side, max_side}, 2);
  expect_error(put("v.nii", huge.bytes), "2^62");
  expect_error(put("v.nii.gz", gzip_text(huge.bytes)), "2^62");
}

TEST_F(NiftiTest, HostileFiles) {
  hostile("one.nii", nifti_header(1, false, {2, 3, 4}, 2).bytes + std::string(24, 'x'));
  hostile("two.nii", nifti_header(2, true, {2, 3, 4}, 4).bytes + std::string(48, 'x'));
  hostile("packed.nii.gz", gzip_text(nifti_header(1, false, {2, 3, 4}, 2).bytes + std::string(24, 'x')));
}

}  // namespace
}  // namespace voxkit
