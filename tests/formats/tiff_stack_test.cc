#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>
#include <zstd.h>

#include <bit>
#include <cmath>
#include <filesystem>

#include "formats/module.h"
#include "tests/formats/file_format_test.h"
#include "tests/formats/tiff_builder.h"

namespace voxkit {
namespace {

template <class Set>
OpenOptions with(const Set& set) {
  OpenOptions options;
  set(options);
  return options;
}

std::string text_of(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}
template <class T>
std::vector<T> values_of(const Bytes& bytes) {
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}
std::string deflated(const std::string& raw) {
  uLongf bytes = compressBound(raw.size());
  std::string out(bytes, '\0');
  compress(reinterpret_cast<Bytef*>(out.data()), &bytes, reinterpret_cast<const Bytef*>(raw.data()),
           raw.size());
  out.resize(bytes);
  return out;
}

class TiffStack : public FileFormatTest {
 protected:
  void SetUp() override {
    FileFormatTest::SetUp();
    if (!std::filesystem::exists(module_folder() + "/image_stack.so"))
      GTEST_SKIP() << "built without OpenImageIO";
    ctx_.note = [this](const std::string& line) { notes_ += line + "\n"; };
  }
  Result<Bytes> read_file(const std::string& content, const OpenOptions& options = {}) {
    notes_.clear();
    VOX_TRY(const auto source, open_image_stack(put("a.tif", content), options, ctx_));
    info_ = source->info();
    return read(*source);
  }
  void expect_refused(const std::string& content, const std::string& part, const OpenOptions& options = {}) {
    const auto voxels = read_file(content, options);
    ASSERT_FALSE(voxels) << "accepted; expected an error with: " << part;
    EXPECT_EQ(voxels.error().code, ErrorCode::input) << voxels.error().what;
    EXPECT_NE(voxels.error().what.find(part), std::string::npos) << voxels.error().what;
    EXPECT_EQ(voxels.error().what.find('\n'), std::string::npos) << voxels.error().what;
  }
  static TiffBuilder pages(int count, const std::string& description = {}) {
    TiffBuilder tiff;
    for (int i = 0; i < count; ++i)
      tiff.pages.push_back(grey_page(2, 1, 8, {static_cast<char>('a' + i), '.'}));
    if (!description.empty()) tiff.pages[0].texts[270] = description;
    return tiff;
  }

  VolumeInfo info_;
  std::string notes_;
};

TEST_F(TiffStack, ImageJSaysSpacingAndUnit) {
  TiffBuilder tiff =
      pages(3, "ImageJ=1.53t\nimages=3\nslices=3\nspacing=3.947\nunit=\\u00B5m\nloop=false\nmin=0\nmax=9\n");
  tiff.pages[0].ratios = {{282, {1605295195, 4294967295}}, {283, {4, 1}}};
  tiff.pages[0].tags[296] = {1};
  const auto voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.affine.spacing(), (std::array<double, 3>{2.6755, 0.25, 3.947}));
  EXPECT_EQ(info_.unit, Unit::micrometre);
  EXPECT_EQ(notes_, "");
  for (const char* word : {"micron", "um", "\xc2\xb5m", "\xb5m"}) {
    tiff.pages[0].texts[270] = fmt::format("ImageJ=1\nimages=3\nslices=3\nspacing=2\nunit={}\n", word);
    ASSERT_TRUE(read_file(tiff.bytes()));
    EXPECT_EQ(info_.unit, Unit::micrometre) << word;
  }
  tiff.pages[0].texts[270] =
      "ImageJ=1\nimages=3\nslices=3\nspacing=2\nunit=furlong\nxorigin=4\nzorigin=-1\ncf=0\nc0=-32768\nc1=0."
      "5\n";
  ASSERT_TRUE(read_file(tiff.bytes()));
  EXPECT_NE(notes_.find("unit furlong"), std::string::npos);
  EXPECT_EQ(info_.affine.origin, (std::array<double, 3>{-4 * 2.6755, 0, 2}));
  EXPECT_EQ(info_.slope, 0.5);
  EXPECT_EQ(info_.intercept, -32768);
}

TEST_F(TiffStack, ResolutionIsSpacing) {
  TiffBuilder tiff = pages(2);
  tiff.pages[0].ratios = {{282, {100, 1}}, {283, {50, 1}}};
  tiff.pages[0].tags[296] = {3};
  ASSERT_TRUE(read_file(tiff.bytes()));
  EXPECT_EQ(info_.affine.spacing(), (std::array<double, 3>{0.01, 0.02, 0.01}));
  EXPECT_EQ(info_.unit, Unit::centimetre);
  EXPECT_NE(notes_.find("how far apart slices are is not said"), std::string::npos);
  tiff.pages[0].tags.erase(296);  // inches, then
  ASSERT_TRUE(read_file(tiff.bytes()));
  EXPECT_EQ(info_.unit, Unit::inch);
  tiff.pages[0].ratios = {{282, {1, 1}}, {283, {1, 1}}};
  tiff.pages[0].tags[296] = {1};
  ASSERT_TRUE(read_file(tiff.bytes()));
  EXPECT_EQ(info_.affine, Affine{});
  EXPECT_EQ(info_.unit, Unit::unknown);
  EXPECT_EQ(notes_, "");
}

TEST_F(TiffStack, ImagesAfterOneDirectoryAreAllRead) {
  TiffBuilder tiff;
  tiff.pages.push_back(grey_page(2, 2, 16, tiff.samples({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, 2)));
  tiff.pages[0].tags[279] = {8};
  tiff.pages[0].texts[270] = "ImageJ=1.53t\nimages=3\nslices=3\n";
  const auto voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.dims, Index3(2, 2, 3));
  EXPECT_EQ(values_of<uint16_t>(*voxels), (std::vector<uint16_t>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));
  tiff.pages[0].texts[270] = "ImageJ=1.53t\nimages=3\nchannels=3\n";
  ASSERT_TRUE(read_file(tiff.bytes(), with([&](OpenOptions& o) { o.channel = 1; })));
  EXPECT_EQ(info_.dims, Index3(2, 2, 1));
  tiff.pages[0].texts[270] = "{\"shape\": [3, 2, 2], \"truncated\": true}";
  ASSERT_TRUE(read_file(tiff.bytes()));
  EXPECT_EQ(info_.dims, Index3(2, 2, 3));
  tiff.pages[0].texts[270] = "ImageJ=1.53t\nimages=2000000000\nslices=2000000000\n";
  expect_refused(tiff.bytes(), "says 2000000000 images");
  tiff.pages.push_back(grey_page(2, 2, 16, std::string(8, 'x')));
  expect_refused(tiff.bytes(), "2000000000 images: the file has 2 pages");
}

TEST_F(TiffStack, HyperstacksAskWhichPart) {
  // Channels change fastest, then slices, then time.
  TiffBuilder tiff = pages(12, "ImageJ=1\nimages=12\nchannels=2\nslices=3\nframes=2\nhyperstack=true\n");
  expect_refused(tiff.bytes(), "2 time steps and 2 channels: expected --time N, from 0 to 1 and --channel N");
  expect_refused(tiff.bytes(), "2 channels: expected --channel N, from 0 to 1",
                 with([&](OpenOptions& o) { o.time = 0; }));
  expect_refused(tiff.bytes(), "--channel 2: the file has 2 channels: expected 0 to 1",
                 with([&](OpenOptions& o) {
                   o.time = 0;
                   o.channel = 2;
                 }));
  auto voxels = read_file(tiff.bytes(), with([&](OpenOptions& o) {
                            o.time = 1;
                            o.channel = 1;
                          }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(text_of(*voxels), "h.j.l.");
  voxels = read_file(tiff.bytes(), with([&](OpenOptions& o) { o.any_part = true; }));
  ASSERT_TRUE(voxels);
  EXPECT_EQ(text_of(*voxels), "a.c.e.");
  EXPECT_EQ(info_.parts, (std::vector<std::string>{"--time 0 of 0..1", "--channel 0 of 0..1"}));
  tiff.pages[0].texts[270] = "ImageJ=1\nimages=12\nchannels=5\nslices=3\n";
  expect_refused(tiff.bytes(), "are not 12 images");
  tiff.pages[0].texts[270] = "{\"shape\": [3, 4, 1, 2], \"axes\": \"TZYX\"}";
  expect_refused(tiff.bytes(), "3 time steps");
  voxels = read_file(tiff.bytes(), with([&](OpenOptions& o) { o.time = 2; }));
  ASSERT_TRUE(voxels);
  EXPECT_EQ(text_of(*voxels), "i.j.k.l.");
}

std::string ome(const std::string& pixels, const std::string& inside) {
  return "<?xml version=\"1.0\"?><OME xmlns=\"http://www.openmicroscopy.org/Schemas/OME/2016-06\"><Image "
         "ID=\"Image:0\"><Pixels ID=\"Pixels:0\" Type=\"uint8\" SizeX=\"2\" SizeY=\"1\" " +
         pixels + ">" + inside + "</Pixels></Image></OME>";
}

TEST_F(TiffStack, OmeSaysOrderAndSize) {
  TiffBuilder tiff =
      pages(6, ome("DimensionOrder=\"XYZCT\" SizeZ=\"3\" SizeC=\"2\" SizeT=\"1\" PhysicalSizeX=\"0.5\" "
                   "PhysicalSizeY=\"0.25\" PhysicalSizeZ=\"2\"",
                   "<Channel ID=\"0\"/><Channel ID=\"1\"/><TiffData/>"));
  expect_refused(tiff.bytes(), "2 channels: expected --channel N");
  auto voxels = read_file(tiff.bytes(), with([&](OpenOptions& o) { o.channel = 1; }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(text_of(*voxels), "d.e.f.");
  EXPECT_EQ(info_.affine.spacing(), (std::array<double, 3>{0.5, 0.25, 2}));
  EXPECT_EQ(info_.unit, Unit::micrometre);
  tiff.pages[0].texts[270] =
      ome("DimensionOrder=\"XYCZT\" SizeZ=\"3\" SizeC=\"2\" SizeT=\"1\" PhysicalSizeX=\"1\" "
          "PhysicalSizeXUnit=\"mm\" PhysicalSizeY=\"500\" PhysicalSizeYUnit=\"&#181;m\"",
          "<TiffData IFD=\"0\" PlaneCount=\"6\"/>");
  voxels = read_file(tiff.bytes(), with([&](OpenOptions& o) { o.channel = 1; }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(text_of(*voxels), "b.d.f.");
  EXPECT_DOUBLE_EQ(info_.affine.spacing()[1], 0.5);
  EXPECT_EQ(info_.unit, Unit::millimetre);
  // Pages in an order of their own.
  tiff = pages(2, ome("DimensionOrder=\"XYZCT\" SizeZ=\"2\" SizeC=\"1\" SizeT=\"1\"",
                      "<TiffData IFD=\"1\" FirstZ=\"0\"/><TiffData IFD=\"0\" FirstZ=\"1\"/>"));
  voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(text_of(*voxels), "b.a.");
  const auto with = [&](const std::string& sizes, const std::string& inside) {
    tiff.pages[0].texts[270] = ome("DimensionOrder=\"XYZCT\" " + sizes, inside);
    return tiff.bytes();
  };
  expect_refused(
      with("SizeZ=\"2\" SizeC=\"1\" SizeT=\"1\"",
           "<TiffData IFD=\"0\"><UUID FileName=\"a.tif\">urn:1</UUID></TiffData><TiffData IFD=\"0\" "
           "FirstZ=\"1\"><UUID FileName=\"b.tif\">urn:2</UUID></TiffData>"),
      "spread over 2 files, as a.tif");
  expect_refused(with("SizeZ=\"5\" SizeC=\"1\" SizeT=\"1\"", ""), "the file has 2 pages");
  expect_refused(with("SizeZ=\"2\" SizeC=\"1\" SizeT=\"1\"", "<TiffData IFD=\"0\" PlaneCount=\"1\"/>"),
                 "no page for slice 1");
  expect_refused(with("SizeZ=\"2\" SizeC=\"1\" SizeT=\"1\"", "<TiffData IFD=\"7\"/>"), "no such page");
}

TEST_F(TiffStack, SmallerCopiesAreNoSlices) {
  TiffBuilder tiff = pages(3);
  TiffBuilderPage thumb = grey_page(1, 1, 8, "t");
  thumb.tags[254] = {1};
  tiff.pages.insert(tiff.pages.begin() + 1, thumb);
  tiff.pages.insert(tiff.pages.begin(), thumb);
  const auto voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(text_of(*voxels), "a.b.c.");
}

TEST_F(TiffStack, FewBitsKeepTheirValues) {
  TiffBuilder tiff;
  tiff.pages.push_back(grey_page(10, 2, 1, std::string("\xa5\x40\x0f\x80", 4)));
  tiff.pages[0].tags.erase(258);  // 1 is what the specification takes
  auto voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.format, VoxelFormat::bitmap);
  EXPECT_EQ(info_.sample_type, SampleType::bit);
  EXPECT_EQ(text_of(*voxels), std::string("\1\0\1\0\0\1\0\1\0\1\0\0\0\0\1\1\1\1\1\0", 20));
  for (const int bits : {2, 4, 6, 10, 12, 14, 20, 24}) {
    std::vector<uint64_t> values;
    uint64_t held = 0;
    int have = 0;
    std::string packed;
    for (int i = 0; i < 3; ++i) {
      values.push_back((uint64_t{0x2a5c96} * static_cast<uint64_t>(i + 1)) & ((1u << bits) - 1));
      if (bits == 24) {
        packed += tiff.samples({values.back()}, 3);
        continue;
      }
      held = held << bits | values.back();
      for (have += bits; have >= 8; have -= 8) packed += static_cast<char>(held >> (have - 8));
    }
    if (have) packed += static_cast<char>(held << (8 - have));
    tiff.pages[0] = grey_page(3, 1, static_cast<uint64_t>(bits), packed);
    voxels = read_file(tiff.bytes());
    ASSERT_TRUE(voxels) << bits << " " << voxels.error().what;
    for (size_t i = 0; i < 3; ++i) {
      const double stored = info_.format == VoxelFormat::density8    ? static_cast<double>((*voxels)[i])
                            : info_.format == VoxelFormat::density16 ? values_of<uint16_t>(*voxels)[i]
                                                                     : values_of<float>(*voxels)[i];
      const double sample = info_.format == VoxelFormat::float32 ? stored : info_.sample(stored);
      EXPECT_EQ(sample, static_cast<double>(values[i])) << bits << " bits";
    }
  }
}

TEST_F(TiffStack, WholeTypesOfBothByteOrders) {
  for (const bool big_endian : {false, true})
    for (const bool big : {false, true}) {
      TiffBuilder tiff{.big_endian = big_endian, .big = big};
      const auto page = [&](uint64_t bits, uint64_t format, const std::vector<uint64_t>& values) {
        tiff.pages = {grey_page(values.size(), 1, bits, tiff.samples(values, static_cast<int>(bits / 8)))};
        tiff.pages[0].tags[339] = {format};
        return read_file(tiff.bytes());
      };
      auto voxels = page(16, 2, {0x8000, 0x7fff, 0});
      ASSERT_TRUE(voxels) << voxels.error().what;
      EXPECT_EQ(info_.sample_type, SampleType::i16);
      EXPECT_EQ(values_of<uint16_t>(*voxels), (std::vector<uint16_t>{0, 65535, 32768}));
      voxels = page(32, 1, {4000000000, 7, 4000000000});
      ASSERT_TRUE(voxels) << voxels.error().what;
      EXPECT_EQ(info_.sample_type, SampleType::u32);
      EXPECT_EQ(info_.sample(static_cast<double>((*voxels)[0])), 4000000000.0);
      EXPECT_EQ(info_.sample(static_cast<double>((*voxels)[1])), 7.0);
      voxels = page(64, 2, {~uint64_t{0}, 5});
      ASSERT_TRUE(voxels) << voxels.error().what;
      EXPECT_EQ(info_.sample_type, SampleType::i64);
      EXPECT_EQ(info_.sample(static_cast<double>((*voxels)[0])), -1.0);
      voxels = page(16, 3, {0x3c00, 0x0001, 0xc500});
      ASSERT_TRUE(voxels) << voxels.error().what;
      EXPECT_EQ(info_.sample_type, SampleType::f16);
      EXPECT_EQ(values_of<float>(*voxels), (std::vector<float>{1, 0x1p-24f, -5}));
      voxels = page(64, 3, {std::bit_cast<uint64_t>(0.1)});
      ASSERT_TRUE(voxels) << voxels.error().what;
      EXPECT_EQ(values_of<float>(*voxels), (std::vector<float>{0.1f}));
      EXPECT_NE(notes_.find("rounded"), std::string::npos);
      voxels = page(64, 3, {std::bit_cast<uint64_t>(0.5)});
      EXPECT_EQ(notes_, "");
    }
}

/// LZW with a clear code before every 200 literals: it never needs codes of more than 9 bits.
std::string lzw(const std::string& raw) {
  std::string out;
  uint32_t held = 0;
  int have = 0;
  const auto code = [&](uint32_t value) {
    held = held << 9 | value;
    for (have += 9; have >= 8; have -= 8) out += static_cast<char>(held >> (have - 8));
  };
  for (size_t i = 0; i < raw.size(); ++i) {
    if (i % 200 == 0) code(256);
    code(static_cast<unsigned char>(raw[i]));
  }
  code(257);
  if (have) out += static_cast<char>(held << (8 - have));
  return out;
}

TEST_F(TiffStack, CompressionsAndPredictors) {
  std::string raw;
  for (int i = 0; i < 600; ++i) raw += static_cast<char>(random_() % 7);
  const std::string zstd = [&] {
    std::string out(ZSTD_compressBound(raw.size()), '\0');
    out.resize(ZSTD_compress(out.data(), out.size(), raw.data(), raw.size(), 3));
    return out;
  }();
  std::string runs;
  for (const char c : raw) runs += std::string("\0", 1) + c;
  for (const auto& [compression, packed] :
       std::vector<std::pair<uint64_t, std::string>>{{1, raw},
                                                     {5, lzw(raw)},
                                                     {8, deflated(raw)},
                                                     {32946, deflated(raw)},
                                                     {32773, runs},
                                                     {50000, zstd}}) {
    TiffBuilder tiff;
    tiff.pages = {grey_page(30, 20, 8, packed)};
    tiff.pages[0].tags[259] = {compression};
    const auto voxels = read_file(tiff.bytes());
    ASSERT_TRUE(voxels) << compression << ": " << voxels.error().what;
    EXPECT_EQ(text_of(*voxels), raw) << compression;
    tiff.pages[0].chunks[0].resize(packed.size() / 2);
    expect_refused(tiff.bytes(), "does not hold 600 bytes");
  }
  // A run in LZW: clear, 7, then strings that are being entered.
  TiffBuilder tiff;
  tiff.pages = {grey_page(6, 1, 8, std::string("\x80\x01\xe0\x40\x78\x08", 6) + std::string(4, '\0'))};
  tiff.pages[0].tags[259] = {5};
  auto voxels = read_file(tiff.bytes());
  if (voxels) {
    EXPECT_EQ(text_of(*voxels).substr(0, 3), "\7\7\7");
  }
  // Differences of 16 bits in both byte orders.
  for (const bool big_endian : {false, true}) {
    tiff.big_endian = big_endian;
    tiff.pages = {grey_page(3, 2, 16, deflated(tiff.samples({1000, 1, 0xffff, 5, 5, 5}, 2)))};
    tiff.pages[0].tags[259] = {8};
    tiff.pages[0].tags[317] = {2};
    voxels = read_file(tiff.bytes());
    ASSERT_TRUE(voxels) << voxels.error().what;
    EXPECT_EQ(values_of<uint16_t>(*voxels), (std::vector<uint16_t>{1000, 1001, 1000, 5, 10, 15}));
  }
  tiff.big_endian = false;
  tiff.pages = {grey_page(3, 2, 8, "abcdef")};
  tiff.pages[0].tags[259] = {34712};
  expect_refused(tiff.bytes(), "the compression JPEG 2000: expected none, LZW");
  tiff.pages[0].tags[259] = {4711};
  expect_refused(tiff.bytes(), "the compression number 4711");
}

TEST_F(TiffStack, StripsTilesAndPlanes) {
  std::string all;
  for (int i = 0; i < 20 * 10; ++i) all += static_cast<char>(i);
  TiffBuilder tiff;
  tiff.pages = {grey_page(20, 10, 8, "")};
  tiff.pages[0].tags[278] = {4};
  tiff.pages[0].chunks = {all.substr(0, 80), all.substr(80, 80), all.substr(160)};
  auto voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(text_of(*voxels), all);
  // Tiles of 16 x 16, over two slices of one directory.
  const auto tile = [&](int z, int x0) {
    std::string chunk;
    for (int y = 0; y < 16; ++y)
      for (int x = x0; x < x0 + 16; ++x)
        chunk += x < 20 && y < 10 ? static_cast<char>(all[static_cast<size_t>(y * 20 + x)] + z) : '!';
    return chunk;
  };
  tiff.pages = {grey_page(20, 10, 8, "")};
  tiff.pages[0].tags.erase(278);
  tiff.pages[0].tags[322] = {16}, tiff.pages[0].tags[323] = {16};
  tiff.pages[0].tags[32997] = {3}, tiff.pages[0].tags[32998] = {2};
  tiff.pages[0].chunks = {tile(0, 0) + tile(1, 0), tile(0, 16) + tile(1, 16), tile(2, 0) + tile(3, 0),
                          tile(2, 16) + tile(3, 16)};
  voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.dims, Index3(20, 10, 3));
  for (size_t i = 0; i < 600; ++i)
    ASSERT_EQ(static_cast<char>((*voxels)[i]), static_cast<char>(all[i % 200] + static_cast<char>(i / 200)))
        << i;
  // Colours in planes.
  tiff.pages = {grey_page(2, 1, 8, "")};
  tiff.pages[0].tags[277] = {3}, tiff.pages[0].tags[258] = {8, 8, 8}, tiff.pages[0].tags[262] = {2};
  tiff.pages[0].tags[284] = {2};
  tiff.pages[0].chunks = {"rR", "gG", "bB"};
  voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.format, VoxelFormat::rgb24);
  EXPECT_EQ(text_of(*voxels), "rgbRGB");
  voxels = read_file(tiff.bytes(), with([&](OpenOptions& o) { o.channel = 1; }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(text_of(*voxels), "gG");
  // Grey and alpha are channels.
  tiff.pages[0].tags[277] = {2}, tiff.pages[0].tags[258] = {8, 8}, tiff.pages[0].tags[262] = {1};
  tiff.pages[0].chunks = {"rR", "gG"};
  expect_refused(tiff.bytes(), "--channel N with a number from 0 to 1");
  // Alpha that colours are multiplied by.
  tiff.pages = {grey_page(1, 1, 8, std::string("\x40\x20\x00\x80", 4))};
  tiff.pages[0].tags[277] = {4}, tiff.pages[0].tags[258] = {8, 8, 8, 8}, tiff.pages[0].tags[262] = {2};
  tiff.pages[0].tags[338] = {1};
  voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(text_of(*voxels), "\x80\x40" + std::string("\0\x80", 2));
  EXPECT_NE(notes_.find("multiplied by alpha"), std::string::npos);
}

TEST_F(TiffStack, PalettesAreGreyOrColorsOrLabels) {
  TiffBuilder tiff;
  tiff.pages = {grey_page(3, 1, 8, std::string("\0\1\xff", 3))};
  tiff.pages[0].tags[262] = {3};
  std::vector<uint64_t> ramp;
  for (int c = 0; c < 3; ++c)
    for (uint64_t i = 0; i < 256; ++i) ramp.push_back((255 - i) * 257);
  tiff.pages[0].tags[320] = ramp;
  auto voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.format, VoxelFormat::density8);
  EXPECT_EQ(text_of(*voxels), std::string("\xff\xfe\0", 3));
  tiff.pages[0].tags[320][1] = 0x1200;  // red of 1
  voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info_.format, VoxelFormat::rgb24);
  EXPECT_EQ(text_of(*voxels), std::string("\xff\xff\xff\x12\xfe\xfe\0\0\0", 9));
  voxels = read_file(tiff.bytes(), with([&](OpenOptions& o) { o.labels = true; }));
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_TRUE(info_.is_labels);
  EXPECT_EQ(text_of(*voxels), std::string("\0\1\xff", 3));
}

TEST_F(TiffStack, ValuesThatMeanWhiteAreKeptAndTurnedPicturesTurned) {
  TiffBuilder tiff;
  tiff.pages = {grey_page(2, 2, 8, "abcd")};
  tiff.pages[0].tags[262] = {0};
  auto voxels = read_file(tiff.bytes());
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(text_of(*voxels), "abcd");
  EXPECT_NE(notes_.find("least value is white"), std::string::npos);
  tiff.pages[0].tags[262] = {1};
  for (const auto& [orientation, expected] : std::vector<std::pair<uint64_t, std::string>>{
           {1, "abcd"}, {2, "badc"}, {3, "dcba"}, {4, "cdab"}, {6, "abcd"}}) {
    tiff.pages[0].tags[274] = {orientation};
    voxels = read_file(tiff.bytes());
    ASSERT_TRUE(voxels) << voxels.error().what;
    EXPECT_EQ(text_of(*voxels), expected) << orientation;
    EXPECT_EQ(notes_.find("rows are columns") != std::string::npos, orientation > 4);
  }
}

TEST_F(TiffStack, OtherPixelsAreRefusedByName) {
  TiffBuilder tiff;
  const auto with = [&](std::map<int, std::vector<uint64_t>> tags) {
    tiff.pages = {grey_page(2, 1, 8, std::string(64, 'x'))};
    for (const auto& [tag, values] : tags) tiff.pages[0].tags[tag] = values;
    return tiff.bytes();
  };
  expect_refused(with({{262, {5}}, {277, {4}}, {258, {8, 8, 8, 8}}}), "pixels that are inks (CMYK)");
  expect_refused(with({{262, {8}}, {277, {3}}, {258, {8, 8, 8}}}), "pixels that are L*a*b*");
  expect_refused(with({{262, {32803}}}), "a mosaic of colours");
  expect_refused(with({{258, {24}}, {339, {3}}}), "samples of 24 bits, float");
  expect_refused(with({{258, {64}}, {339, {6}}}), "64 bits, complex float");
  expect_refused(with({{277, {3}}, {258, {5, 6, 5}}, {262, {2}}}), "samples of several sizes");
  expect_refused(with({{256, {0}}}), "without pixels");
  expect_refused(with({{256, {100000}}, {257, {100000}}, {278, {100000}}}), "cannot hold that");
}

TEST_F(TiffStack, SpacingIsWrittenAndComesBackToTheLastBit) {
  VolumeInfo info = make_info({3, 2, 4}, VoxelFormat::density16, SampleType::i16);
  info.affine = Affine::plain({0.1, 1.0 / 3, 2.6755}, {10.7, -0.3, 1e-5});
  info.unit = Unit::micrometre;
  info.world = World::lps;
  info.slope = 0.7, info.intercept = -1024;
  info.description = "a scan";
  const Bytes voxels = random_voxels(info);
  auto sink = create_image_stack(path("s%d.tif"), info, false, ctx_);
  ASSERT_TRUE(sink) << sink.error().what;
  ASSERT_TRUE(write(**sink, info, voxels));
  EXPECT_EQ(notes_, "");
  const auto source = open_image_stack(path("s%d.tif"), {}, ctx_);
  ASSERT_TRUE(source) << source.error().what;
  const VolumeInfo& got = (*source)->info();
  EXPECT_EQ(got.affine, info.affine);
  EXPECT_EQ(got.unit, info.unit);
  EXPECT_EQ(got.world, info.world);
  EXPECT_EQ(got.slope, info.slope);
  EXPECT_EQ(got.intercept, info.intercept);
  EXPECT_EQ(got.description, info.description);
  EXPECT_EQ(*read(**source), voxels);
  // A mirrored axis is more than a file of slices says, and PNG says nothing.
  info.affine.axes[0][0] = -1;
  ASSERT_TRUE(create_image_stack(path("t%d.tif"), info, false, ctx_));
  EXPECT_NE(notes_.find("do not hold the directions of its axes and its origin: dropped"), std::string::npos);
  notes_.clear();
  info.sample_type = SampleType::u16;
  ASSERT_TRUE(create_image_stack(path("t%d.png"), info, false, ctx_));
  EXPECT_NE(notes_.find("do not hold where its voxels are, slope and intercept"), std::string::npos)
      << notes_;
}

TEST_F(TiffStack, WideLabelsAndHalfFloatsStayWhatTheyAre) {
  VolumeInfo info = make_info({3, 1, 1}, VoxelFormat::density8, SampleType::u64);
  info.labels = std::make_shared<std::vector<int64_t>>(std::vector<int64_t>{7, 4000000000});
  const Bytes voxels{std::byte{1}, std::byte{0}, std::byte{1}};
  auto sink = create_image_stack(path("l%d.tif"), info, false, ctx_);
  ASSERT_TRUE(sink) << sink.error().what;
  ASSERT_TRUE(write(**sink, info, voxels));
  auto source = open_image_stack(path("l%d.tif"), {}, ctx_);
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ((*source)->info().sample_type, SampleType::u32);
  EXPECT_EQ(*(*source)->info().labels, *info.labels);
  EXPECT_EQ(*read(**source), voxels);
  info.labels = std::make_shared<std::vector<int64_t>>(std::vector<int64_t>{7, int64_t{1} << 40});
  const auto refused = create_image_stack(path("m%d.tif"), info, false, ctx_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::usage);

  info = make_info({2, 1, 1}, VoxelFormat::float32, SampleType::f16);
  for (const float second : {-5.0f, 0.1f}) {
    const float values[] = {1.5f, second};
    Bytes halves(8);
    std::memcpy(halves.data(), values, 8);
    notes_.clear();
    sink = create_image_stack(path("h%d.exr"), info, true, ctx_);
    ASSERT_TRUE(sink) << sink.error().what;
    ASSERT_TRUE(write(**sink, info, halves));
    EXPECT_EQ(notes_.find("rounded to half floats") != std::string::npos, second == 0.1f);
    source = open_image_stack(path("h%d.exr"), {}, ctx_);
    ASSERT_TRUE(source) << source.error().what;
    EXPECT_EQ((*source)->info().sample_type, SampleType::f16);
    if (second != 0.1f) {
      EXPECT_EQ(*read(**source), halves);
    }
  }
}

TEST_F(TiffStack, HostileFiles) {
  TiffBuilder tiff = pages(3, "ImageJ=1.53t\nimages=3\nslices=3\nspacing=3.947\nunit=um\n");
  tiff.pages[0].ratios = {{282, {4, 1}}, {283, {4, 1}}};
  TiffBuilder tiles;
  tiles.pages = {grey_page(20, 10, 12, "")};
  tiles.pages[0].tags[322] = {16}, tiles.pages[0].tags[323] = {16}, tiles.pages[0].tags[259] = {5};
  tiles.pages[0].chunks = {lzw(std::string(384, 'a')), lzw(std::string(384, 'b'))};
  TiffBuilder xml = pages(2, ome("DimensionOrder=\"XYZCT\" SizeZ=\"2\" SizeC=\"1\" SizeT=\"1\"",
                                 "<TiffData IFD=\"1\" FirstZ=\"0\"/><TiffData IFD=\"0\" FirstZ=\"1\"/>"));
  for (const TiffBuilder& builder : {tiff, tiles, xml}) {
    const std::string valid = builder.bytes();
    ASSERT_TRUE(try_file(put("h.tif", valid)));
    for (int i = 0; i < 3000; ++i) {
      std::string changed = valid;
      for (auto n = 1 + random_() % 3; n > 0; --n)
        changed[random_() % changed.size()] = static_cast<char>(random_());
      const Status status = try_file(put("h.tif", changed));
      EXPECT_TRUE(status || status.error().code == ErrorCode::input) << status.error().what;
    }
  }
}

}  // namespace
}  // namespace voxkit
