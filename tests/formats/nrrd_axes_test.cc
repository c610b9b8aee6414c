// What the axes of a NRRD file are, where they lie, and the files that its samples are in.
#include <sys/stat.h>

#include "tests/formats/file_format_test.h"
#include "tests/formats/packing_test.h"

namespace voxkit {
namespace {

class NrrdAxesTest : public FileFormatTest {
 protected:
  /// A file of these lines after the magic, and data.
  static std::string file(const std::string& lines, const std::string& data) {
    return "NRRD0005\n" + lines + "\n\n" + data;
  }
  /// The voxels as text, or the error.
  std::string voxels_of(const std::string& name, const OpenOptions& options = {}) {
    notes_.clear();
    auto source = open_volume(name, options, ctx_);
    if (!source) return "error: " + source.error().what;
    info_ = (*source)->info();
    const auto voxels = read(**source);
    if (!voxels) return "error: " + voxels.error().what;
    return {reinterpret_cast<const char*>(voxels->data()), voxels->size()};
  }
  std::string voxels_of_text(const std::string& lines, const std::string& data,
                             const OpenOptions& options = {}) {
    return voxels_of(put("v.nrrd", file(lines, data)), options);
  }
  /// What is read of a volume of 2 x 2 x 2 bytes with these lines.
  VolumeInfo info_with(const std::string& lines) {
    EXPECT_EQ(voxels_of_text("type: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n" + lines, "abcdefgh"),
              "abcdefgh")
        << lines;
    return info_;
  }
  VolumeInfo info_;
};

TEST_F(NrrdAxesTest, EverySpaceByEitherName) {
  const std::pair<const char*, World> names[] = {
      {"right-anterior-superior", World::ras}, {"RAS", World::ras},
      {"Left-Anterior-Superior", World::las},  {"LAS", World::las},
      {"left-posterior-superior", World::lps}, {"lps", World::lps},
      {"scanner-xyz", World::scanner},         {"3D-right-handed", World::right_handed},
      {"3D-left-handed", World::left_handed}};
  for (const auto& [name, world] : names) {
    const std::string origin = "space origin: (1,2,3)\nspace directions: (-0.7,0,0) (0,-0.7,0.1) (0,0,2.5)";
    VolumeInfo info = info_with("space: " + std::string(name) + "\n" + origin);
    EXPECT_EQ(info.world, world) << name;
    EXPECT_EQ(info.affine, (Affine{{{{-0.7, 0, 0}, {0, -0.7, 0.1}, {0, 0, 2.5}}}, {1, 2, 3}})) << name;
    EXPECT_TRUE(notes_.empty()) << all_notes();
  }
  for (const auto& [name, world] : {std::pair{"RAST", World::ras},
                                    {"left-anterior-superior-time", World::las},
                                    {"LPST", World::lps},
                                    {"scanner-xyz-time", World::scanner},
                                    {"3D-left-handed-time", World::left_handed}}) {
    const VolumeInfo info =
        info_with("space: " + std::string(name) +
                  "\nspace directions: (2,0,0,0) (0,3,0,0) (0,0,4,0)\nspace origin: (1,2,3,9)");
    EXPECT_EQ(info.world, world) << name;
    EXPECT_EQ(info.affine, Affine::plain({2, 3, 4}, {1, 2, 3})) << name;
    EXPECT_TRUE(noted("time as a direction of space: dropped")) << all_notes();
  }
}

TEST_F(NrrdAxesTest, SpacingsWithoutSpace) {
  VolumeInfo info = info_with("spacings: 0.5 -2 nan\naxis mins: 1 5 nan");
  EXPECT_EQ(info.affine, (Affine{{{{0.5, 0, 0}, {0, -2, 0}, {0, 0, 1}}}, {1, 5, 0}}));
  EXPECT_EQ(info.world, World::unknown);
  info = info_with("axis mins: 0 4 0\naxis maxs: 3 0 4\ncenters: node node cell");
  EXPECT_EQ(info.affine, (Affine{{{{3, 0, 0}, {0, -4, 0}, {0, 0, 2}}}, {0, 4, 1}}));
  // Two axes in a plane: the third is at right angles to them.
  EXPECT_EQ(voxels_of_text("type: uchar\ndimension: 2\nsizes: 2 2\nencoding: raw\nspace dimension: 2\nspace "
                           "directions: (0,2) (3,0)\nspace origin: (5,6)",
                           "abcd"),
            "abcd");
  EXPECT_EQ(info_.affine, (Affine{{{{0, 2, 0}, {3, 0, 0}, {0, 0, -1}}}, {5, 6, 0}}));
}

TEST_F(NrrdAxesTest, UnitsAndContent) {
  const std::string space = "space: LPS\nspace directions: (1,0,0) (0,1,0) (0,0,2)\n";
  VolumeInfo info = info_with(space + "space units: \"mm\" \"mm\" \"mm\"\ncontent: a head, (cut)");
  EXPECT_EQ(info.unit, Unit::millimetre);
  EXPECT_EQ(info.description, "a head, (cut)");
  EXPECT_TRUE(notes_.empty()) << all_notes();
  info = info_with(space + "space units: \"um\" \"um\" \"mm\"");
  EXPECT_EQ(info.unit, Unit::micrometre);
  EXPECT_EQ(info.affine.axes[2], (Affine::Vector{0, 0, 2000}));
  EXPECT_TRUE(noted("units of axes differ: all are um now")) << all_notes();
  info = info_with("spacings: 1 1 2\nunits: \"micron\" \"micron\" \"micron\"");
  EXPECT_EQ(info.unit, Unit::micrometre);
  info = info_with(space + "space units: \"furlong\" \"furlong\" \"furlong\"");
  EXPECT_EQ(info.unit, Unit::unknown);
  EXPECT_TRUE(noted("\"furlong\" is no length")) << all_notes();
}

TEST_F(NrrdAxesTest, WhatIsDroppedIsNamed) {
  info_with(
      "thicknesses: nan 2 nan\nmeasurement frame: (1,0,0) (0,1,0) (0,0,1)\nlabels: \"x\" \"\" \"\"\nsample "
      "units: \"HU\"\nold min: 0\nold max: 5\nmodality:=CT\nother:=1\nblock:=x");
  EXPECT_TRUE(
      noted("the header has thicknesses, a measurement frame, labels of axes, units of samples, the range "
            "of values before they were quantised and 3 key/value pairs (\"block\" ...): dropped"))
      << all_notes();
  EXPECT_EQ(notes_.size(), 1u);
  info_with("thicknesses: nan nan nan\nlabels: \"\" \"\" \"\"\nnumber: 8\ncenters: cell cell cell");
  EXPECT_TRUE(notes_.empty()) << all_notes();
}

TEST_F(NrrdAxesTest, ColorsAreAnyAxis) {
  const std::string fields = "type: uchar\nencoding: raw\n";
  EXPECT_EQ(voxels_of_text(fields + "dimension: 4\nsizes: 2 2 1 3\nkinds: domain domain domain RGB-color",
                           "abcdABCD0123"),
            "aA0bB1cC2dD3");
  EXPECT_EQ(info_.format, VoxelFormat::rgb24);
  EXPECT_EQ(info_.dims, Index3(2, 2, 1));
  EXPECT_EQ(
      voxels_of_text(fields + "dimension: 3\nsizes: 2 4 2\nkinds: domain RGBA-color space\nspace dimension: "
                              "2\nspace directions: (1,0) none (0,1)",
                     "abABxyXYcdCDzwZW"),
      "aAxXbByYcCzZdDwW");
  EXPECT_EQ(info_.format, VoxelFormat::rgba32);
  EXPECT_EQ(voxels_of_text(fields + "dimension: 4\nsizes: 3 2 2 1", "aA0bB1cC2dD3"), "aA0bB1cC2dD3");
  // Colours of other numbers are channels.
  EXPECT_EQ(voxels_of_text(fields + "dimension: 4\nsizes: 3 2 2 1\nkinds: HSV-color domain domain domain",
                           "aA0bB1cC2dD3"),
            "error: has 3 channels: expected --channel N, from 0 to 2");
  OpenOptions options;
  options.channel = 1;
  EXPECT_EQ(voxels_of_text(fields + "dimension: 4\nsizes: 3 2 2 1\nkinds: vector domain domain domain",
                           "aA0bB1cC2dD3", options),
            "ABCD");
  for (const char* type : {"short", "double"}) {
    const bool is_short = std::string(type) == "short";
    EXPECT_EQ(
        voxels_of_text("type: " + std::string(type) +
                           "\nencoding: raw\nendian: little\ndimension: 4\nsizes: 2 2 1 1\nkinds: complex "
                           "domain domain domain",
                       is_short ? sample_text<int16_t>({1, -1, 2, -2}, false)
                                : sample_text<double>({1, -1, 2, -2}, false),
                       options),
        is_short ? sample_text<uint16_t>({32767, 32766}, false) : sample_text<float>({-1, -2}, false));
  }
}

TEST_F(NrrdAxesTest, TimeAndListsAreChosen) {
  const std::string fields = "type: uchar\ndimension: 4\n";
  const std::string last = fields +
                           "sizes: 2 1 1 3\nkinds: domain domain domain list\nspace dimension: 3\nspace "
                           "directions: (1,0,0) (0,1,0) (0,0,1) none\n";
  EXPECT_EQ(voxels_of_text(last + "encoding: raw", "abcdef"),
            "error: has 3 time steps: expected --time N, from 0 to 2");
  OpenOptions options;
  options.time = 1;
  EXPECT_EQ(voxels_of_text(last + "encoding: raw", "abcdef", options), "cd");
  EXPECT_EQ(voxels_of_text(last + "encoding: raw", "abcde", options),
            "error: voxel data at byte 163 end after 5 bytes: expected 6");
  EXPECT_EQ(voxels_of_text(last + "encoding: gzip", gzip_text("abcdef"), options), "cd");
  EXPECT_EQ(voxels_of_text(last + "encoding: hex", "616263 646566", options), "cd");
  const std::string first = fields + "sizes: 3 2 1 1\nkinds: time domain domain domain\n";
  EXPECT_EQ(voxels_of_text(first + "encoding: raw", "a1Ab2B", options), "12");
  EXPECT_EQ(voxels_of_text(first + "encoding: gz", gzip_text("a1Ab2B"), options), "12");
  EXPECT_EQ(voxels_of_text(
                fields + "sizes: 2 1 1 3\nencoding: raw\nspace dimension: 4\nspace directions: (1,0,0,0) "
                         "(0,1,0,0) (0,0,1,0) (0,0,0,5)",
                "abcdef", options),
            "cd");
  const std::string five = "type: uchar\ndimension: 5\nsizes: 2 1 1 3 2\nencoding: raw";
  EXPECT_EQ(voxels_of_text(five, "abcdefABCDEF", options),
            "error: has 2 channels: expected --channel N, from 0 to 1");
  options.channel = 1;
  EXPECT_EQ(voxels_of_text(five, "abcdefABCDEF", options), "CD");
  options.channel = 2;
  EXPECT_EQ(voxels_of_text(five + "\nkinds: domain domain domain list time", "abcdefABCDEF", options), "EF");
  options = {};
  options.any_part = true;
  EXPECT_EQ(voxels_of_text(five, "abcdefABCDEF", options), "ab");
  EXPECT_EQ(info_.parts, (std::vector<std::string>{"--time 0 of 0..2", "--channel 0 of 0..1"}));
  EXPECT_EQ(
      voxels_of_text("type: uchar\ndimension: 6\nsizes: 2 1 1 3 2 2\nencoding: raw\nkinds: domain domain "
                     "domain list vector normal",
                     "", options)
          .substr(0, 35),
      "error: NRRD header, line 6: kinds: ");
}

TEST_F(NrrdAxesTest, WhatCameInComesBackToTheLastBit) {
  for (const char* name : {"v.nrrd", "v.nhdr"})
    for (const World world : {World::unknown, World::ras, World::lps, World::las, World::scanner,
                              World::right_handed, World::left_handed}) {
      VolumeInfo info = make_info({2, 3, 2}, VoxelFormat::density16, SampleType::i16);
      info.affine = {{{{-0.1, 1.0 / 3, 0}, {0, -0.7, 1e-17}, {0.25, 0, 1e9}}}, {0.1 + 0.2, -1e300, 5e-324}};
      info.world = world;
      info.unit = Unit::angstrom;
      info.space_code = 4;
      info.description = "5 \xc2\xb5m: \"a\"";
      info.is_labels = true;
      info.fill = 1;
      round_trip(name, info);
      EXPECT_EQ(read_info_.affine, info.affine);
      EXPECT_EQ(read_info_.world, world);
      EXPECT_EQ(read_info_.unit, info.unit);
      EXPECT_EQ(read_info_.space_code, 4);
      EXPECT_EQ(read_info_.description, info.description);
      EXPECT_TRUE(read_info_.is_labels);
      EXPECT_EQ(read_info_.fill, 1);
      EXPECT_TRUE(notes_.empty()) << all_notes();
    }
  VolumeInfo info = make_info({2, 3, 2}, VoxelFormat::float32, SampleType::f32);
  info.description = " two\nlines:\r1\n\n";
  round_trip("v.nrrd", info);
  EXPECT_EQ(read_info_.description, "two lines: 1");
  info.fill = 1e20f;
  round_trip("v.nrrd", info);
  EXPECT_EQ(read_info_.fill, 1e20f);
  // Of wide integers it is the sample that counts, however voxels hold it.
  EXPECT_EQ(
      voxels_of_text("type: int\nendian: little\ndimension: 1\nsizes: 2\nencoding: raw\nvoxkit fill:=-9999",
                     sample_text<int32_t>({7, -9999}, false)),
      sample_text<uint16_t>({10006, 0}, false));
  EXPECT_EQ(info_.fill, 0);
}

TEST_F(NrrdAxesTest, OnlyRegularFilesInTheFolderAreData) {
  const std::string fields = "NRRD0005\ntype: uchar\ndimension: 3\nsizes: 2 1 1\nencoding: raw\n";
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  for (const char* data : {"pipe", "/dev/zero", "LIST\npipe\npipe"}) {
    OpenOptions options;
    options.allow_outside = true;
    const std::string list = std::string(data) == "LIST\npipe\npipe" ? "LIST 1\npipe" : data;
    const std::string error = voxels_of(put("v.nhdr", fields + "data file: " + list + "\n"), options);
    EXPECT_NE(error.find("is not a regular file"), std::string::npos) << error;
  }
  std::filesystem::create_directory(path("sub"));
  put("d.raw", "ab");
  for (const std::string& name : {std::string("../d.raw"), path("d.raw"), std::string("x/../../d.raw")}) {
    SCOPED_TRACE(name);
    if (name[0] == 'x') std::filesystem::create_directory(path("sub/x"));
    put("sub/v.nhdr", fields + "data file: " + name + "\n");
    EXPECT_EQ(
        voxels_of(path("sub/v.nhdr")),
        "error: data file \"" + name + "\": lies outside of the header's folder: expected --allow-outside");
    OpenOptions options;
    options.allow_outside = true;
    EXPECT_EQ(voxels_of(path("sub/v.nhdr"), options), "ab");
    EXPECT_EQ(info_.files.size(), 2u);
    put("sub/v.nhdr", fields + "data file: LIST 3\n" + name + "\n");
    EXPECT_NE(voxels_of(path("sub/v.nhdr")).find("--allow-outside"), std::string::npos);
  }
  put("v.nhdr", fields + "data file: sub/../d.raw\n");
  EXPECT_EQ(voxels_of(path("v.nhdr")), "ab");
  put("v.nhdr", fields + "data file: ./d.raw\n");
  EXPECT_EQ(voxels_of(path("v.nhdr")), "ab");
  ASSERT_EQ(info_.files.size(), 2u);
  EXPECT_EQ(info_.files[0], path("v.nhdr"));
  EXPECT_TRUE(std::filesystem::equivalent(info_.files[1], path("d.raw")));
}

TEST_F(NrrdAxesTest, HostileHeaders) {
  const std::string fields =
      "type: uchar\ndimension: 5\nsizes: 2 3 2 2 1\nkinds: space 3-color time space list\nspace: LPST\nspace "
      "units: "
      "\"mm\" \"mm\" \"mm\" \"s\"\nspace directions: (1,0,0,0) none (0,0,0,1) (0,1,1,0) none\nspace origin: "
      "(1,2,3,4)\nmeasurement frame: (1)\nvoxkit fill:=3\nencoding: hex\n";
  OpenOptions options;
  options.any_part = true;
  std::string data;
  for (int i = 0; i < 24; ++i) data += "a0";
  const std::string valid = file(fields, data);
  ASSERT_EQ(voxels_of(put("v.nrrd", valid), options).size(), 12u);
  std::mt19937 random(3);
  for (int i = 0; i < 3000; ++i) {
    std::string changed = valid;
    for (auto n = 1 + random() % 3; n > 0; --n)
      changed[random() % changed.size()] = valid[random() % valid.size()];
    auto source = open_volume(put("v.nrrd", changed), options, ctx_);
    if (!source) {
      EXPECT_EQ(source.error().code, ErrorCode::input) << source.error().what;
    } else if (const auto voxels = checked_voxels((*source)->info().dims); voxels && *voxels < 100000) {
      const auto got = read(**source);
      EXPECT_TRUE(got || got.error().code == ErrorCode::input);
    }
  }
}

}  // namespace
}  // namespace voxkit
