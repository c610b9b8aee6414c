// Where DICOM slices lie, which of them make a volume, and what their values are.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>

#include "formats/module.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

template <class Set>
OpenOptions with(const Set& set) {
  OpenOptions options;
  set(options);
  return options;
}

std::string le(uint64_t value, int bytes) {
  std::string raw;
  for (int i = 0; i < bytes; ++i) raw += static_cast<char>(value >> (8 * i));
  return raw;
}
/// An element with explicit type, little endian.
std::string element(unsigned group, unsigned number, const std::string& type, std::string value) {
  if (value.size() % 2) value += type == "UI" || type == "OB" ? '\0' : ' ';
  const bool wide = type == "OB" || type == "OW" || type == "SQ" || type == "OF";
  return le(group, 2) + le(number, 2) + type + (wide ? le(0, 2) + le(value.size(), 4) : le(value.size(), 2)) +
         value;
}
std::string item(const std::string& content) {
  return le(0xfffe, 2) + le(0xe000, 2) + le(content.size(), 4) + content;
}
std::string sequence(unsigned group, unsigned number, const std::vector<std::string>& items) {
  std::string all;
  for (const std::string& one : items) all += item(one);
  return element(group, number, "SQ", all);
}

/// A file of the attributes given, in place of the usual ones: 2 x 1 pixels of 16 bits, signed.
struct File {
  std::map<std::pair<unsigned, unsigned>, std::string> elements = {
      {{0x20, 0x0e}, element(0x20, 0x0e, "UI", "1.2.3")},
      {{0x28, 0x02}, element(0x28, 0x02, "US", le(1, 2))},
      {{0x28, 0x04}, element(0x28, 0x04, "CS", "MONOCHROME2")},
      {{0x28, 0x10}, element(0x28, 0x10, "US", le(1, 2))},
      {{0x28, 0x11}, element(0x28, 0x11, "US", le(2, 2))},
      {{0x28, 0x30}, element(0x28, 0x30, "DS", "0.7\\0.5")},
      {{0x28, 0x100}, element(0x28, 0x100, "US", le(16, 2))},
      {{0x28, 0x101}, element(0x28, 0x101, "US", le(16, 2))},
      {{0x28, 0x102}, element(0x28, 0x102, "US", le(15, 2))},
      {{0x28, 0x103}, element(0x28, 0x103, "US", le(1, 2))},
      {{0x20, 0x37}, element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0")},
  };
  std::string syntax = "1.2.840.10008.1.2.1";
  std::string pixels = element(0x7fe0, 0x10, "OW", "abcd");

  File& set(unsigned group, unsigned number, const std::string& type, const std::string& value) {
    elements[{group, number}] = element(group, number, type, value);
    return *this;
  }
  File& us(unsigned group, unsigned number, unsigned value) { return set(group, number, "US", le(value, 2)); }
  File& at(const std::string& position) { return set(0x20, 0x32, "DS", position); }
  File& data(const std::string& bytes) {
    pixels = element(0x7fe0, 0x10, "OW", bytes);
    return *this;
  }
  std::string bytes() const {
    const std::string meta = element(2, 0x10, "UI", syntax);
    std::string file = std::string(128, '\0') + "DICM" + element(2, 0, "UL", le(meta.size(), 4)) + meta;
    for (const auto& [tag, raw] : elements) file += raw;
    return file + pixels;
  }
};

class DicomVolume : public FileFormatTest {
 protected:
  void SetUp() override {
    FileFormatTest::SetUp();
    if (!std::filesystem::exists(module_folder() + "/dicom.so")) GTEST_SKIP() << "built without GDCM";
    ctx_.note = [this](const std::string& line) { notes_ += line + "\n"; };
  }
  Result<Bytes> open(const std::string& name = {}, const OpenOptions& options = {}) {
    notes_.clear();
    VOX_TRY(const auto source, open_volume(name.empty() ? folder_ : path(name), options, ctx_));
    info_ = source->info();
    return read(*source);
  }
  void expect_refused(const std::string& part, const OpenOptions& options = {},
                      const std::string& name = {}) {
    const auto voxels = open(name, options);
    ASSERT_FALSE(voxels) << "accepted; expected an error with: " << part;
    EXPECT_EQ(voxels.error().code, ErrorCode::input) << voxels.error().what;
    const std::string line = voxels.error().file + ": " + voxels.error().what;
    EXPECT_NE(line.find(part), std::string::npos) << line;
  }
  /// The first sample of each slice.
  static std::vector<int> firsts(const Bytes& bytes, int64_t stride = 4) {
    std::vector<int> values;
    for (size_t i = 0; i + 1 < bytes.size(); i += static_cast<size_t>(stride))
      values.push_back((static_cast<int>(bytes[i]) | static_cast<int>(bytes[i + 1]) << 8) - 32768);
    return values;
  }
  static std::string sample(int value) { return le(static_cast<uint64_t>(value) & 0xffff, 2) + le(0, 2); }

  VolumeInfo info_;
  std::string notes_;
};

TEST_F(DicomVolume, PlacesAreThoseOfThePatient) {
  for (int i = 0; i < 3; ++i)
    put(fmt::format("i{}.dcm", i), File{}
                                       .at(fmt::format("-10\\-20\\{}", 6 - 3 * i))
                                       .set(0x08, 0x103e, "LO", "CT HEAD")
                                       .set(0x10, 0x10, "PN", "Doe^Jane")
                                       .data(sample(i))
                                       .bytes());
  const auto voxels = open();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(firsts(*voxels), (std::vector<int>{2, 1, 0}));
  EXPECT_EQ(info_.world, World::lps);
  EXPECT_EQ(info_.unit, Unit::millimetre);
  EXPECT_EQ(info_.affine, Affine::plain({0.5, 0.7, 3}, {-10, -20, 0}));
  EXPECT_EQ(info_.description, "CT HEAD");
  EXPECT_EQ(notes_, "");
  // One file of it is a volume, whatever it is called.
  std::filesystem::copy_file(path("i1.dcm"), path("x.nrrd"));
  for (const char* name : {"i1.dcm", "x.nrrd"}) {
    const auto one = open(name);
    ASSERT_TRUE(one) << one.error().what;
    EXPECT_EQ(info_.dims, Index3(2, 1, 1));
    EXPECT_EQ(info_.affine.origin, (Affine::Vector{-10, -20, 3}));
  }
}

TEST_F(DicomVolume, TiltIsAShear) {
  for (int i = 0; i < 3; ++i)
    put(fmt::format("i{}.dcm", i), File{}
                                       .set(0x20, 0x37, "DS", "1\\0\\0\\0\\0.97237\\-0.23345")
                                       .at(fmt::format("0\\0\\{}", 3 * i))
                                       .bytes());
  ASSERT_TRUE(open());
  EXPECT_EQ(info_.affine.axes[1], (Affine::Vector{0, 0.97237 * 0.7, -0.23345 * 0.7}));
  EXPECT_EQ(info_.affine.axes[2], (Affine::Vector{0, 0, 3}));
}

TEST_F(DicomVolume, LengthsThatCannotBeAreNamed) {
  const auto noted = [&](const std::string& part) { return notes_.find(part) != std::string::npos; };
  const auto put_slices = [&](const std::string& spacing, int count) {
    for (int i = 0; i < count; ++i)
      put(fmt::format("i{}.dcm", i),
          File{}.at(fmt::format("0\\0\\{}", 2 * i)).set(0x28, 0x30, "DS", spacing).bytes());
  };
  for (const char* spacing : {"0\\0.5", "0.7\\-0.5", "nan\\0.5", "0.7", "0.7\\0.5\\1", "x\\y"}) {
    SCOPED_TRACE(spacing);
    put_slices(spacing, 2);
    ASSERT_TRUE(open());
    EXPECT_EQ(info_.affine, Affine::plain({1, 1, 2}, {0, 0, 0}));
    EXPECT_TRUE(noted("its distances of pixels are not two numbers above 0: 1 is assumed")) << notes_;
  }
  // Not said at all.
  put_slices("", 2);
  ASSERT_TRUE(open());
  EXPECT_TRUE(noted("does not say how far apart its pixels are: 1 mm is assumed")) << notes_;
  // In one slice only: which of them counts is not known.
  put("i1.dcm", File{}.at("0\\0\\2").bytes());
  expect_refused("pixel spacing differs");
  // Of one slice; of several it is their places that count, and where they have none, that is said already.
  std::filesystem::remove(path("i1.dcm"));
  for (const char* distance : {"0", "nan"}) {
    put("i0.dcm", File{}.at("0\\0\\0").set(0x18, 0x88, "DS", distance).bytes());
    ASSERT_TRUE(open());
    EXPECT_EQ(info_.affine.axes[2][2], 1);
    EXPECT_TRUE(noted("its distance of slices is no number above 0: 1 mm is assumed")) << notes_;
  }
  put("i0.dcm", File{}.at("0\\0\\0").set(0x18, 0x88, "DS", "0").set(0x18, 0x50, "DS", "3").bytes());
  ASSERT_TRUE(open());
  EXPECT_TRUE(noted("3 mm is assumed")) << notes_;
  put("i0.dcm", File{}.at("0\\0\\0").set(0x18, 0x50, "DS", "-3").bytes());
  ASSERT_TRUE(open());
  EXPECT_TRUE(noted("its distance of slices is no number above 0: 1 mm is assumed")) << notes_;
  put("i0.dcm", File{}.at("0\\0\\0").set(0x18, 0x88, "DS", "-3").bytes());
  ASSERT_TRUE(open());
  EXPECT_EQ(info_.affine.axes[2][2], 3);
  EXPECT_EQ(notes_, "");
}

TEST_F(DicomVolume, MissingSlicesAreRefusedByTheirPositions) {
  const double positions[] = {0, 3, 9, 12};
  for (int i = 0; i < 4; ++i)
    put(fmt::format("i{}.dcm", i),
        File{}.at(fmt::format("0\\0\\{}", positions[i])).data(sample(i - 2)).bytes());
  expect_refused(
      "the slice at 6 mm is missing, between i1.dcm at 3 mm and i2.dcm at 9 mm: expected equal "
      "distances, or --gaps accept or fill");
  auto voxels = open({}, with([&](OpenOptions& o) { o.gaps = OpenOptions::Gaps::accept; }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.affine.axes[2][2], 4);
  EXPECT_NE(notes_.find("taken to be 4 mm apart"), std::string::npos);
  voxels = open({}, with([&](OpenOptions& o) { o.gaps = OpenOptions::Gaps::fill; }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(firsts(*voxels), (std::vector<int>{-2, -1, -2, 0, 1}));
  EXPECT_EQ(info_.affine.axes[2][2], 3);
  EXPECT_NE(notes_.find("1 slices that are missing are filled with -2"), std::string::npos) << notes_;
  put("i3.dcm", File{}.at("0\\0\\13").bytes());
  expect_refused("between i2.dcm at 9 mm and i3.dcm at 13 mm: no whole number of slices",
                 with([&](OpenOptions& o) { o.gaps = OpenOptions::Gaps::fill; }));
  std::filesystem::remove(path("i2.dcm"));
  put("i3.dcm", File{}.at("0\\0\\6.5").bytes());
  expect_refused("slices are unevenly far apart");
  put("i3.dcm", File{}.at("0\\2\\6").bytes());
  expect_refused("off the line through the others");
  // What stands for nothing measured fills gaps, too.
  std::filesystem::remove(path("i3.dcm"));
  for (int i = 0; i < 4; ++i)
    put(fmt::format("i{}.dcm", i), File{}
                                       .at(fmt::format("0\\0\\{}", positions[i]))
                                       .set(0x28, 0x120, "SS", le(0xf830, 2))
                                       .data(sample(i))
                                       .bytes());
  voxels = open({}, with([&](OpenOptions& o) { o.gaps = OpenOptions::Gaps::fill; }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(firsts(*voxels), (std::vector<int>{0, 1, -2000, 2, 3}));
  EXPECT_EQ(info_.fill, 32768 - 2000);
}

/// Three frames of 2 x 1 pixels with sequences as enhanced CT has them.
File enhanced() {
  File file;
  file.elements.erase({0x20, 0x37});
  file.elements.erase({0x28, 0x30});
  file.set(0x28, 0x08, "IS", "3");
  file.elements[{0x5200, 0x9229}] = sequence(
      0x5200, 0x9229,
      {sequence(0x20, 0x9116, {element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0")}) +
       sequence(0x28, 0x9110, {element(0x18, 0x50, "DS", "9") + element(0x28, 0x30, "DS", "0.7\\0.5")}) +
       sequence(0x28, 0x9145, {element(0x28, 0x1052, "DS", "-5") + element(0x28, 0x1053, "DS", "2")})});
  std::vector<std::string> frames;
  for (int i = 0; i < 3; ++i)  // from the top down
    frames.push_back(sequence(0x20, 0x9113, {element(0x20, 0x32, "DS", fmt::format("1\\2\\{}", 8 - 4 * i))}));
  file.elements[{0x5200, 0x9230}] = sequence(0x5200, 0x9230, frames);
  std::string pixels;
  for (int i = 0; i < 3; ++i) pixels += le(static_cast<uint64_t>(10 + i), 2) + le(0, 2);
  return file.data(pixels);
}

TEST_F(DicomVolume, FramesAreSlicesWithTheirPositions) {
  put("mf.dcm", enhanced().bytes());
  for (const char* name : {"", "mf.dcm"}) {
    const auto voxels = open(name);
    ASSERT_TRUE(voxels) << voxels.error().what;
    EXPECT_EQ(firsts(*voxels), (std::vector<int>{12, 11, 10}));
    EXPECT_EQ(info_.affine, Affine::plain({0.5, 0.7, 4}, {1, 2, 0}));
    EXPECT_EQ(info_.slope, 2);
    EXPECT_EQ(info_.intercept, -5);
  }
  // Offsets of doses along the normal.
  File dose;
  dose.set(0x28, 0x08, "IS", "3")
      .at("1\\2\\3")
      .set(0x3004, 0x0c, "DS", "0\\2.5\\5")
      .set(0x3004, 0x0e, "DS", "0.25");
  put("mf.dcm", dose.data(std::string(12, 'x')).bytes());
  ASSERT_TRUE(open("mf.dcm"));
  EXPECT_EQ(info_.affine, Affine::plain({0.5, 0.7, 2.5}, {1, 2, 3}));
  EXPECT_EQ(info_.slope, 0.25);
  // Of frames without places the order is that of the file, and it is said.
  put("mf.dcm", File{}.set(0x28, 0x08, "IS", "3").data(std::string(12, 'x')).bytes());
  ASSERT_TRUE(open("mf.dcm"));
  EXPECT_EQ(info_.dims.z, 3);
  EXPECT_NE(notes_.find("do not say where they lie: in the order of their frames"), std::string::npos);
  // A film.
  File film;
  film.set(0x28, 0x08, "IS", "3").set(0x28, 0x09, "AT", le(0x18, 2) + le(0x1063, 2));
  put("mf.dcm", film.data(sample(1) + sample(2) + sample(3)).bytes());
  expect_refused("3 time steps: expected --time N, from 0 to 2", {}, "mf.dcm");
  const auto second = open("mf.dcm", with([&](OpenOptions& o) { o.time = 1; }));
  ASSERT_TRUE(second) << second.error().what;
  EXPECT_EQ(firsts(*second), (std::vector<int>{2}));
  put("mf.dcm", File{}.set(0x28, 0x08, "IS", "3").bytes());
  expect_refused("file of 3 frames", {}, "mf.dcm");
  put("mf.dcm", File{}.set(0x28, 0x08, "IS", "2000000000").bytes());
  expect_refused("cannot hold them", {}, "mf.dcm");
}

TEST_F(DicomVolume, ScalesThatDifferMakeRealValues) {
  for (int i = 0; i < 3; ++i)
    put(fmt::format("i{}.dcm", i), File{}
                                       .at(fmt::format("0\\0\\{}", i))
                                       .set(0x28, 0x1052, "DS", std::to_string(i))
                                       .set(0x28, 0x1053, "DS", fmt::format("{}", 0.1 * (i + 1)))
                                       .data(sample(100))
                                       .bytes());
  expect_refused("or --apply-scale, which makes real values of them");
  const auto voxels = open({}, with([&](OpenOptions& o) { o.real_values = true; }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.format, VoxelFormat::float32);
  EXPECT_EQ(info_.slope, 1);
  for (int i = 0; i < 3; ++i) {
    float value;
    std::memcpy(&value, voxels->data() + 8 * i, 4);
    EXPECT_EQ(value, static_cast<float>(std::stod(fmt::format("{}", 0.1 * (i + 1))) * 100 + i));
  }
  ASSERT_TRUE(open({}, with([&](OpenOptions& o) { o.any_part = true; })));
}

TEST_F(DicomVolume, SeriesFoldersAndTimeSteps) {
  std::filesystem::create_directories(path("a/b"));
  for (int i = 0; i < 2; ++i) {
    put(fmt::format("a/b/{}", i), File{}.at(fmt::format("0\\0\\{}", i)).data(sample(i)).bytes());
    put(fmt::format("a/s{}", i), File{}
                                     .set(0x20, 0x0e, "UI", "1.2.44")
                                     .set(0x08, 0x103e, "LO", "T2")
                                     .at(fmt::format("0\\0\\{}", i))
                                     .data(sample(10 + i))
                                     .bytes());
  }
  put("DICOMDIR", std::string(128, '\0') + "DICM" + element(2, 0x10, "UI", "1.2.840.10008.1.2.1"));
  for (const char* name : {"", "DICOMDIR"}) {
    expect_refused(
        "slices of 2 series: expected --series N or ID with one of 0: 1.2.3 (2 slices), 1: 1.2.44 (2 "
        "slices, T2)",
        {}, name);
    for (const char* id : {"1", "44", "1.2.44"}) {
      const auto voxels = open(name, with([&](OpenOptions& o) { o.series = id; }));
      ASSERT_TRUE(voxels) << voxels.error().what;
      EXPECT_EQ(firsts(*voxels), (std::vector<int>{10, 11}));
    }
  }
  expect_refused("--series 7: no such series", with([&](OpenOptions& o) { o.series = "7"; }));
  ASSERT_TRUE(open({}, with([&](OpenOptions& o) { o.any_part = true; })));
  ASSERT_EQ(info_.parts.size(), 1u);

  std::filesystem::remove_all(path("a"));
  for (int t = 0; t < 2; ++t)
    for (int z = 0; z < 3; ++z)
      put(fmt::format("{}{}", z, t), File{}
                                         .at(fmt::format("0\\0\\{}", z))
                                         .set(0x20, 0x100, "IS", std::to_string(2 - t))
                                         .set(0x20, 0x13, "IS", std::to_string(t * 3 + z))
                                         .data(sample(10 * (2 - t) + z))
                                         .bytes());
  expect_refused("2 time steps: expected --time N");
  const auto voxels = open({}, with([&](OpenOptions& o) { o.time = 1; }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(firsts(*voxels), (std::vector<int>{20, 21, 22}));
}

TEST_F(DicomVolume, ColorsAndPalettes) {
  File rgb;
  rgb.us(0x28, 2, 3).us(0x28, 0x100, 8).us(0x28, 0x101, 8).us(0x28, 0x102, 7).us(0x28, 0x103, 0);
  rgb.set(0x28, 4, "CS", "RGB");
  put("a", rgb.data("rgbRGB").bytes());
  auto voxels = open();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.format, VoxelFormat::rgb24);
  EXPECT_EQ(std::memcmp(voxels->data(), "rgbRGB", 6), 0);
  put("a", rgb.us(0x28, 6, 1).data("rRgGbB").bytes());  // in planes
  voxels = open();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(std::memcmp(voxels->data(), "rgbRGB", 6), 0);
  put("a", rgb.us(0x28, 6, 0).set(0x28, 4, "CS", "YBR_FULL").data("\x4c\x55\xff\x80\x80\x80").bytes());
  voxels = open();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(*voxels, (Bytes{std::byte{254}, std::byte{0}, std::byte{0}, std::byte{128}, std::byte{128},
                            std::byte{128}}));
  put("a", rgb.set(0x28, 4, "CS", "HSV").bytes());
  expect_refused("photometric interpretation HSV");

  File indexed;
  indexed.us(0x28, 0x100, 8).us(0x28, 0x101, 8).us(0x28, 0x102, 7).us(0x28, 0x103, 0);
  indexed.set(0x28, 4, "CS", "PALETTE COLOR");
  for (unsigned c = 0; c < 3; ++c) {
    indexed.set(0x28, 0x1101 + c, "US", le(2, 2) + le(5, 2) + le(16, 2));
    indexed.set(0x28, 0x1201 + c, "OW", le(0x1000 * (c + 1), 2) + le(0xff00, 2));
  }
  put("a", indexed.data("\5\6").bytes());
  voxels = open();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(*voxels, (Bytes{std::byte{0x10}, std::byte{0x20}, std::byte{0x30}, std::byte{255}, std::byte{255},
                            std::byte{255}}));
  voxels = open({}, with([&](OpenOptions& o) { o.labels = true; }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_TRUE(info_.is_labels);
  EXPECT_EQ(*voxels, (Bytes{std::byte{5}, std::byte{6}}));
}

TEST_F(DicomVolume, BitsAnywhereAndOtherTypes) {
  put("a", File{}.us(0x28, 0x101, 12).us(0x28, 0x102, 15).data(le(0x7ff5, 2) + le(0x800a, 2)).bytes());
  auto voxels = open();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(firsts(*voxels, 2), (std::vector<int>{0x7ff, -0x800}));
  put("a", File{}.set(0x28, 4, "CS", "MONOCHROME1").bytes());
  voxels = open();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(firsts(*voxels, 2), (std::vector<int>{'a' | 'b' << 8, 'c' | 'd' << 8}));
  EXPECT_NE(notes_.find("least value is white"), std::string::npos);
  put("a", File{}
               .us(0x28, 0x100, 32)
               .us(0x28, 0x101, 32)
               .us(0x28, 0x102, 31)
               .us(0x28, 0x103, 0)
               .data(le(3000000000, 4) + le(3000000001, 4))
               .bytes());
  voxels = open();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.sample_type, SampleType::u32);
  EXPECT_EQ(info_.sample(static_cast<double>((*voxels)[1])), 3000000001.0);
  // Segmentations: frames of single bits, which do not begin at bytes.
  File bits;
  bits.us(0x28, 0x100, 1)
      .us(0x28, 0x101, 1)
      .us(0x28, 0x102, 0)
      .us(0x28, 0x103, 0)
      .us(0x28, 0x10, 3)
      .us(0x28, 0x11, 1);
  put("a", bits.set(0x28, 8, "IS", "2").data(le(0b110101, 2)).bytes());
  voxels = open();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.format, VoxelFormat::bitmap);
  EXPECT_EQ(*voxels,
            (Bytes{std::byte{1}, std::byte{0}, std::byte{1}, std::byte{0}, std::byte{1}, std::byte{1}}));
}

TEST_F(DicomVolume, HostileFiles) {
  const std::string valid = enhanced().bytes();
  ASSERT_TRUE(try_file(put("h.dcm", valid)));
  for (size_t length = 0; length < valid.size(); ++length) {
    const Status status = try_file(put("h.dcm", valid.substr(0, length)));
    ASSERT_FALSE(status) << "accepted a file cut to " << length << " of " << valid.size() << " bytes";
  }
  for (int i = 0; i < 3000; ++i) {
    std::string changed = valid;
    for (auto n = 1 + random_() % 3; n > 0; --n)
      changed[132 + random_() % (changed.size() - 132)] = static_cast<char>(random_());
    const Status status = try_file(put("h.dcm", changed));
    EXPECT_TRUE(status || status.error().code == ErrorCode::input) << status.error().what;
  }
}

}  // namespace
}  // namespace voxkit
