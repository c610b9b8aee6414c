#include "tests/formats/file_format_test.h"
#include "tests/formats/packing_test.h"

namespace voxkit {
namespace {

class NrrdTest : public FileFormatTest {
 protected:
  /// A header with these fields changed or added; "" leaves one out.
  static std::string header(const std::vector<std::pair<std::string, std::string>>& changes = {}) {
    std::vector<std::pair<std::string, std::string>> fields = {
        {"type", "uint8"}, {"dimension", "3"}, {"sizes", "4 3 2"}, {"encoding", "raw"}};
    for (const auto& change : changes) {
      const auto it =
          std::find_if(fields.begin(), fields.end(), [&](const auto& f) { return f.first == change.first; });
      if (it == fields.end())
        fields.push_back(change);
      else
        it->second = change.second;
    }
    std::string text = "NRRD0004\n# a comment\n";
    for (const auto& [name, value] : fields)
      if (!value.empty()) text += name + ": " + value + "\n";
    return text;
  }
  Result<std::unique_ptr<VolumeSource>> open(const std::string& name, const std::string& content) {
    return open_volume(put(name, content), {}, ctx_);
  }
  void expect_voxels(const std::string& name, const std::string& expected) {
    auto source = open_volume(path(name), {}, ctx_);
    ASSERT_TRUE(source) << source.error().what;
    const auto voxels = read(**source);
    ASSERT_TRUE(voxels) << voxels.error().file << ": " << voxels.error().what;
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(voxels->data()), voxels->size()), expected);
  }
  const std::string data_ = "abcdefghijklmnopqrstuvwx";
};

TEST_F(NrrdTest, EveryTypeInBothOrders) {
  struct {
    const char* type;
    std::string (*bytes)(bool);
    std::string expected;
  } const cases[] = {
      {"signed char",
       [](bool b) {
         return sample_text<int8_t>({-1, 5}, b);
       },
       sample_text<uint8_t>({127, 133}, false)},
      {"uchar",
       [](bool b) {
         return sample_text<uint8_t>({1, 5}, b);
       },
       sample_text<uint8_t>({1, 5}, false)},
      {"short",
       [](bool b) {
         return sample_text<int16_t>({-1, 300}, b);
       },
       sample_text<uint16_t>({32767, 33068}, false)},
      {"Unsigned Short Int",
       [](bool b) {
         return sample_text<uint16_t>({1, 300}, b);
       },
       sample_text<uint16_t>({1, 300}, false)},
      {"int32_t",
       [](bool b) {
         return sample_text<int32_t>({-1, 70000}, b);
       },
       sample_text<uint8_t>({0, 1}, false)},
      {"uint",
       [](bool b) {
         return sample_text<uint32_t>({1, 70000}, b);
       },
       sample_text<uint8_t>({0, 1}, false)},
      {"long long",
       [](bool b) {
         return sample_text<int64_t>({-1, 70000}, b);
       },
       sample_text<uint8_t>({0, 1}, false)},
      {"uint64",
       [](bool b) {
         return sample_text<uint64_t>({1, 70000}, b);
       },
       sample_text<uint8_t>({0, 1}, false)},
      {"float",
       [](bool b) {
         return sample_text<float>({-1.5, 2}, b);
       },
       sample_text<float>({-1.5, 2}, false)},
      {"double",
       [](bool b) {
         return sample_text<double>({-1.5, 2}, b);
       },
       sample_text<float>({-1.5, 2}, false)},
  };
  for (const auto& c : cases)
    for (bool big : {false, true}) {
      SCOPED_TRACE(std::string(c.type) + (big ? " big" : " little"));
      const std::string fields =
          header({{"type", c.type}, {"sizes", "2 1 1"}, {"endian", big ? "big" : "little"}});
      put("v.nrrd", fields + "\n" + c.bytes(big));
      expect_voxels("v.nrrd", c.expected);
    }
}

TEST_F(NrrdTest, EveryEncoding) {
  for (const char* name : {"gzip", "gz"}) {
    put("v.nrrd", header({{"encoding", name}}) + "\n" + gzip_text(data_));
    expect_voxels("v.nrrd", data_);
  }
  for (const char* name : {"bzip2", "bz2"}) {
    put("v.nrrd", header({{"encoding", name}, {"line skip", "2"}, {"byteskip", "3"}}) + "\na line\n\n" +
                      bzip2_text(std::string("123").append(data_)));
    expect_voxels("v.nrrd", data_);
  }
  std::string text;
  for (char c : data_) text += std::to_string(int{c}) + (c % 5 ? " " : ",\n");
  for (const char* name : {"ascii", "text", "TXT"}) {
    put("v.nrrd", header({{"encoding", name}}) + "\n" + text);
    expect_voxels("v.nrrd", data_);
  }
  put("v.nrrd", header({{"encoding", "ascii"}, {"type", "float"}, {"sizes", "3 1 1"}}) + "\n-1.5e3 0.25 inf");
  expect_voxels("v.nrrd", sample_text<float>({-1500, 0.25, INFINITY}, false));
  std::string digits;
  for (const char c : data_) {
    digits += "0123456789abcdef"[c >> 4];
    digits += (c % 3 ? "" : c % 2 ? "\n" : " ");
    digits += "0123456789ABCDEF"[c & 15];
  }
  put("v.nrrd", header({{"encoding", "hex"}}) + "\n" + digits + "\n");
  expect_voxels("v.nrrd", data_);
  put("v.nrrd", header({{"encoding", "hex"}, {"type", "short"}, {"sizes", "2 1 1"}, {"endian", "big"}}) +
                    "\n80 01 00 02");
  expect_voxels("v.nrrd", sample_text<uint16_t>({1, 0x8002}, false));
  expect_error(put("v.nrrd", header({{"encoding", "hex"}}) + "\n00 0g"),
               "hex data, byte 1: \"g\": expected hexadecimal digits");
  expect_error(put("v.nrrd", header({{"encoding", "hex"}}) + "\n00 0"), "end after 1 bytes: expected 24");
  expect_error(put("v.nrrd", header({{"encoding", "zrl"}}) + "\n00"),
               "line 6: encoding: \"zrl\": expected raw");
  // The last bytes, of the file or of what it unpacks to.
  for (const bool packed : {false, true}) {
    const std::string junk = "junk bytes" + data_;
    put("v.nrrd", header({{"encoding", packed ? "gzip" : "raw"}, {"byte skip", "-1"}}) + "\n" +
                      (packed ? gzip_text(junk) : junk));
    expect_voxels("v.nrrd", data_);
    auto source = open_nrrd(std::move(*open_stream(path("v.nrrd"))), {}, ctx_);
    ASSERT_TRUE(source) << source.error().what;
    EXPECT_EQ((*read(**source))[0], std::byte{'a'});
  }
  expect_error(put("v.nrrd", header({{"encoding", "ascii"}}) + "\n1 2 300"), "ascii data, sample 2: \"300\"");
  expect_error(put("v.nrrd", header({{"encoding", "ascii"}}) + "\n1 2 3"), "end after 3 bytes: expected 24");
}

TEST_F(NrrdTest, ReadsFromAStream) {
  for (const bool packed : {false, true}) {
    const std::string content =
        header({{"encoding", packed ? "gzip" : "raw"}}) + "\n" + (packed ? gzip_text(data_) : data_);
    auto source = open_nrrd(
        prepend(content.substr(0, 5), std::move(*open_stream(put("x", content.substr(5))))), {}, ctx_);
    ASSERT_TRUE(source) << source.error().what;
    EXPECT_TRUE((*source)->forward_only());
    char out[8];
    ASSERT_TRUE((*source)->read({{0, 0, 1}, {4, 2, 2}}, {}).error().code == ErrorCode::internal);
    char slice[12];
    ASSERT_TRUE((*source)->read({{0, 0, 1}, {4, 3, 2}}, {reinterpret_cast<std::byte*>(slice), 4, 12}));
    EXPECT_EQ(std::string(slice, 12), data_.substr(12));
    EXPECT_FALSE((*source)->read({{0, 0, 0}, {4, 3, 1}}, {reinterpret_cast<std::byte*>(out), 4, 12}));
  }
}

TEST_F(NrrdTest, DataInOtherFiles) {
  put("d.raw", "head line\n__" + data_);
  put("v.nhdr", header({{"line skip", "1"}, {"byte skip", "2"}, {"data file", "d.raw"}}));
  expect_voxels("v.nhdr", data_);
  put("v.nhdr", header({{"byte skip", "-1"}, {"datafile", "./d.raw"}}));
  expect_voxels("v.nhdr", data_);
  put("v.nhdr", header({{"byte skip", "-1"}, {"data file", path("d.raw")}}));
  expect_voxels("v.nhdr", data_);  // an absolute path into the same folder

  put("a 1", gzip_text(data_.substr(0, 12)));
  put("b", gzip_text(data_.substr(12)));
  put("v.nhdr", header({{"encoding", "gzip"}, {"data file", "LIST"}}) + "a 1\nb\n");
  expect_voxels("v.nhdr", data_);
  put("v.nhdr", header({{"encoding", "gzip"}, {"data file", "LIST 3"}}) + "a 1\nb\n");
  expect_voxels("v.nhdr", data_);
  expect_error(put("v.nhdr", header({{"encoding", "gzip"}, {"data file", "LIST"}}) + "b\n"),
               "expected 2 files, not 1");
  expect_error(put("v.nhdr", header({{"encoding", "gzip"}, {"data file", "LIST"}})),
               "expected 2 files, not 0");

  for (int i = 0; i < 6; ++i)
    put("row_0" + std::to_string(8 - i) + ".x",
        std::string("#").append(data_, static_cast<size_t>(4 * i), 4));
  put("v.nhdr", header({{"byte skip", "1"}, {"data file", "row_%02d.x 8 3 -1 1"}}));
  expect_voxels("v.nhdr", data_);
  expect_error(put("v.nhdr", header({{"data file", "row_%02d.x 8 3 -1"}})), "expected 2 files, not 6");
  expect_error(put("v.nhdr", header({{"data file", "row_%02d.x 1 2 1"}})), "No such file");
  expect_error(put("v.nhdr", header({{"data file", "row_%02d.x 7 8 1"}})), "end after 5 bytes: expected 12");
  expect_error(put("v.nhdr", header({{"data file", "row_%02d.x -2147483648 2147483647 1"}})),
               "not 4294967296");
  expect_error(put("v.nhdr", header({{"data file", "missing.raw"}})), "No such file");
  expect_error(put("v.nhdr", header({{"byte skip", "-1"}, {"data file", "row_08.x"}})), "expected 24");
}

TEST_F(NrrdTest, PlacementAndKinds) {
  auto source =
      open("v.nrrd",
           header({{"spacings", "0.5 2 nan"}, {"axis mins", "1 -1 nan"}, {"centers", "node cell node"}}) +
               "\n" + data_);
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ((*source)->info().affine.spacing(), (std::array<double, 3>{0.5, 2, 1}));
  EXPECT_EQ((*source)->info().affine.origin, (std::array<double, 3>{1, 0, 0}));

  source = open("v.nrrd", header({{"space", "left-posterior-superior"},
                                  {"space directions", "(0,0,-0.1) ( 3, 4, 0 ) (1,0,0)"},
                                  {"space origin", "(7,8,-9.5)"},
                                  {"min", "0"},
                                  {"max", "1"}}) +
                              "\n" + data_);
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ((*source)->info().affine.spacing(), (std::array<double, 3>{0.1, 5, 1}));
  EXPECT_EQ((*source)->info().affine.origin, (std::array<double, 3>{7, 8, -9.5}));
  EXPECT_FALSE((*source)->info().range);

  source = open("v.nrrd", header({{"dimension", "4"}, {"sizes", "3 2 2 2"}}) + "\n" + data_);
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ((*source)->info().format, VoxelFormat::rgb24);
  EXPECT_EQ((*source)->info().dims, Index3(2, 2, 2));
  source = open("v.nrrd", header({{"sizes", "4 3 2"}, {"kinds", "RGBA-color domain domain"}}) + "\n" + data_);
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ((*source)->info().format, VoxelFormat::rgba32);
  EXPECT_EQ((*source)->info().dims, Index3(3, 2, 1));
  source = open("v.nrrd", header({{"dimension", "1"}, {"sizes", "24"}}) + "\n" + data_);
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ((*source)->info().dims, Index3(24, 1, 1));
}

TEST_F(NrrdTest, WhatIsWrittenReadsBack) {
  VolumeInfo info;
  for (const char* name : {"v.nrrd", "V.NHDR"})
    for (const Index3 dims : {Index3{1, 1, 1}, Index3{129, 65, 3}}) {
      for (SampleType type : {SampleType::u8, SampleType::i8, SampleType::u16, SampleType::i16,
                              SampleType::f32, SampleType::bit}) {
        info = make_info(dims, scalar_format(type), type);
        info.affine = Affine::plain({0.1, 1e-9, 12345.678}, info.affine.origin);
        info.affine.origin = {-1.0 / 3, 0, 1e30};
        info.slope = 0.7;
        info.intercept = -1024;
        round_trip(name, info);
        EXPECT_EQ(read_info_.sample_type, type);
        EXPECT_EQ(read_info_.format, info.format);
      }
      round_trip(name, make_info(dims, VoxelFormat::rgb24));
      EXPECT_EQ(read_info_.format, VoxelFormat::rgb24);
      round_trip(name, make_info(dims, VoxelFormat::rgba32));
      for (SampleType type : {SampleType::u32, SampleType::i32, SampleType::u64, SampleType::i64}) {
        info = make_info(dims, VoxelFormat::density8, type);
        info.wide_base = 1000000;
        auto sink = create_volume(path(name), info, true, ctx_);
        ASSERT_TRUE(sink && write(**sink, info, random_voxels(info)));
        auto source = open_volume(path(name), {}, ctx_);
        ASSERT_TRUE(source) << source.error().what;
        EXPECT_EQ((*source)->info().sample_type, type);
        EXPECT_GE((*source)->info().wide_base, 1000000);
      }
    }
  EXPECT_EQ(get(path("V.NHDR")).find("1."), std::string::npos);
  EXPECT_NE(get(path("V.NHDR")).find("data file: V.raw\n"), std::string::npos);
}

TEST_F(NrrdTest, TheWrittenBytesAreThese) {
  const VolumeInfo info = make_info({1, 2, 1}, VoxelFormat::density16, SampleType::i16);
  auto sink = create_volume(path("v.nrrd"), info, false, ctx_);
  ASSERT_TRUE(sink);
  const uint16_t voxels[2] = {32767, 32770};
  ASSERT_TRUE(
      (*sink)->write(0, 1, packed(reinterpret_cast<const std::byte*>(voxels), info.dims, info.format)));
  ASSERT_TRUE((*sink)->finish());
  EXPECT_EQ(get(path("v.nrrd")),
            "NRRD0005\ntype: int16\ndimension: 3\nspace dimension: 3\nsizes: 1 2 1\nspace directions: "
            "(1,0,0) (0,1,0) (0,0,1)\n"
            "endian: little\nencoding: raw\nspace origin: (0,0,0)\n\n" +
                sample_text<int16_t>({-1, 2}, false));
  EXPECT_EQ(create_volume(path("v.nrrd"), info, false, ctx_).error().code, ErrorCode::output);
}

TEST_F(NrrdTest, HeaderErrorsNameLineAndField) {
  const struct {
    std::vector<std::pair<std::string, std::string>> changes;
    const char* error;
  } cases[] = {
      {{{"type", "block"}}, "line 3: type: \"block\""},
      {{{"type", ""}}, "field type is missing"},
      {{{"dimension", "0"}}, "line 4: dimension"},
      {{{"dimension", "17"}}, "line 4: dimension"},
      {{{"dimension", "2"}}, "line 5: sizes"},
      {{{"sizes", "4 3"}}, "line 5: sizes"},
      {{{"sizes", "4 3 0"}}, "line 5: sizes"},
      {{{"sizes", "4 3 -2"}}, "line 5: sizes"},
      {{{"sizes", "4 3 2x"}}, "line 5: sizes"},
      {{{"sizes", "99999999999999999999 3 2"}}, "line 5: sizes"},
      {{{"sizes", "2147483648 2147483648 2147483648"}}, "2^59"},
      {{{"sizes", "536870912 536870912 1"}}, "end after"},
      {{{"encoding", "zip"}}, "line 6: encoding"},
      {{{"type", "short"}}, "field endian is missing"},
      {{{"type", "short"}, {"endian", "middle"}}, "line 7: endian"},
      {{{"byte skip", "-2"}}, "line 7: byteskip"},
      {{{"line skip", "-1"}}, "line 7: lineskip"},
      {{{"line skip", "9223372036854775807"}}, "ends after"},
      {{{"byte skip", "9223372036854775807"}}, "ends after"},
      {{{"encoding", "gzip"}, {"byte skip", "-2"}}, "line 7: byteskip"},
      {{{"encoding", "hex"}, {"byte skip", "-1"}}, "line 7: byteskip"},
      {{{"spacings", "1 2"}}, "line 7: spacings"},
      {{{"spacings", "1 2 0"}}, "line 7: spacings"},
      {{{"spacings", "1 2 inf"}}, "line 7: spacings"},
      {{{"space directions", "(1,0,0) (0,1,0)"}}, "line 7: spacedirections"},
      {{{"space directions", "(1,0,0) (0,1,0) (0,0,1"}}, "line 7: spacedirections"},
      {{{"space directions", "(1,0,0) (0,1,0) (0,,1)"}}, "line 7: spacedirections"},
      {{{"space directions", "(1,0,0) (0,0,0) (0,0,1)"}}, "line 7: spacedirections"},
      {{{"space origin", "1 2 3"}}, "line 7: spaceorigin"},
      {{{"kinds", "domain"}}, "line 7: kinds"},
      {{{"dimension", "4"}, {"sizes", "2 2 2 3"}}, "has 3 time steps: expected --time N"},
      {{{"dimension", "4"}, {"sizes", "3 2 2 2"}, {"type", "float"}, {"endian", "big"}},
       "has 2 time steps: expected --time N"},
      {{{"space", "right-anterior"}}, "line 7: space: \"right-anterior\""},
      {{{"space dimension", "5"}}, "line 7: spacedimension"},
      {{{"space", "RAS"}, {"space directions", "(1,0) (0,1) none"}}, "line 8: spacedirections"},
      {{{"space", "RAS"}, {"space directions", "(1,0,0) (0,1,0) (1,1,0)"}}, "in one plane"},
      {{{"space", "RAST"}, {"space directions", "(1,0,0,0) (0,1,0,1) (0,0,1,0)"}}, "not along both"},
      {{{"space", "RAS"}, {"space origin", "(1,2)"}}, "line 8: spaceorigin"},
      {{{"space", "RAS"}, {"space units", "\"mm\" \"mm\""}}, "line 8: spaceunits"},
      {{{"colour", "red"}}, "line 7: \"colour: red\": unknown field"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.error);
    expect_error(put("v.nrrd", header(c.changes) + "\n" + data_), c.error);
  }
  expect_error(put("v.nrrd", header() + "sizes: 4 3 2\n\n" + data_),
               "line 7: \"sizes: 4 3 2\": the field is there twice");
  expect_error(put("v.nrrd", header() + "nonsense\n\n" + data_), "line 7: \"nonsense\"");
  expect_error(put("v.nrrd", header() + "voxkit slope:=x\n\n" + data_), "line 7: voxkit slope");
  expect_error(put("v.nrrd", header() + "voxkit format:=BITMAP2\n\n" + data_), "line 7: voxkit format");
  expect_error(put("v.nrrd", header()), "expected a blank line");
  expect_error(put("v.nrrd", "NRRD0006\n\n"), "version 6");
  expect_error(put("v.nrrd", "P6 4 4 255\n"), "not a NRRD file");
  expect_error(put("v.nrrd", header() + "\n" + data_.substr(1)), "end after 23 bytes: expected 24");
}

TEST_F(NrrdTest, KeysAreKeptApartFromFields) {
  put("v.nrrd", header() + "a key with a colon:=: value\nsizes:=9 9 9\n\r\n" + data_);
  expect_voxels("v.nrrd", data_);
}

TEST_F(NrrdTest, HostileFiles) {
  const std::string fields =
      header({{"space directions", "(1,0,0) (0,1,0) (0,0,1)"}, {"kinds", "space space space"}}) +
      "voxkit slope:=2\n";
  hostile("raw.nrrd", fields + "\n" + data_);
  hostile("gz.nrrd", header({{"encoding", "gzip"}}) + "\n" + gzip_text(data_), 1000);
  hostile("bz.nrrd", header({{"encoding", "bzip2"}}) + "\n" + bzip2_text(data_), 500);
}

}  // namespace
}  // namespace voxkit
