#include "tests/fuzz/seeds.h"

#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

#include "formats/volume/open_volume.h"
#include "tests/formats/packing_test.h"

namespace voxkit::fuzz {
namespace {

template <class T>
std::string le(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

/// Bytes that are neither flat nor random; each below 128, so that they are also numbers of any type.
std::string pattern(size_t count) {
  std::string bytes;
  for (size_t i = 0; i < count; ++i) bytes += static_cast<char>(i * i / 7 % 64);
  return bytes;
}

/// The file `made` that create_volume makes for `name`, with a volume of `pattern`; empty if it cannot.
std::string written(const std::string& name, const std::string& made, Index3 dims, VoxelFormat format,
                    SampleType type) {
  std::string folder = std::filesystem::temp_directory_path() / "voxkit-seeds-XXXXXX";
  if (!::mkdtemp(folder.data())) std::abort();
  VolumeInfo info;
  info.dims = dims;
  info.format = format;
  info.sample_type = type;
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  std::string voxels = pattern(static_cast<size_t>(info.box().voxels() * voxel_bytes(format)));
  if (format == VoxelFormat::bitmap) {
    for (char& c : voxels) c &= 1;
  }
  std::string file;
  if (auto sink = create_volume(folder + "/" + name, info, true, ctx)) {
    const auto* bytes = reinterpret_cast<const std::byte*>(voxels.data());
    if ((*sink)->write(0, dims.z, packed(bytes, dims, format)) && (*sink)->finish()) {
      std::ifstream in(folder + "/" + made, std::ios::binary);
      file.assign(std::istreambuf_iterator<char>(in), {});
    }
  }
  std::filesystem::remove_all(folder);
  return file;
}
std::string written(const std::string& name, Index3 dims, VoxelFormat format,
                    SampleType type = SampleType::u8) {
  return written(name, name, dims, format, type);
}
std::string image(const std::string& ending, VoxelFormat format, SampleType type = SampleType::u8) {
  return written("%d" + ending, "0" + ending, {5, 4, 1}, format, type);
}

/// A little-endian TIFF of two pages, 5 x 4 pixels of 16 bits, not packed.
std::string two_pages() {
  std::string file = std::string("II*\0", 4) + le(uint32_t{8});
  for (uint32_t page = 0; page < 2; ++page) {
    const std::pair<uint16_t, uint32_t> entries[] = {{256, 5}, {257, 4}, {258, 16}, {259, 1}, {262, 1},
                                                     {273, 0}, {277, 1}, {278, 4},  {279, 40}};
    const auto count = static_cast<uint16_t>(std::size(entries));
    const auto data = static_cast<uint32_t>(file.size() + 2 + 12u * count + 4);
    file += le(count);
    for (const auto& [tag, value] : entries) {
      file += le(tag) + le(uint16_t{4}) + le(uint32_t{1}) + le(tag == 273 ? data : value);
    }
    file += le(page == 0 ? data + 40 : uint32_t{0}) + pattern(40);
  }
  return file;
}

struct Element {
  uint16_t group, element;
  const char* type;  ///< value representation
  std::string value;
};

std::string dicom_element(const Element& e) {
  std::string value = e.value;
  if (value.size() % 2) value += std::string(e.type) == "UI" ? '\0' : ' ';
  std::string bytes = le(e.group) + le(e.element) + e.type;
  const bool is_long = std::string(e.type) == "OW" || std::string(e.type) == "OB";
  bytes += is_long ? std::string(2, '\0') + le(static_cast<uint32_t>(value.size()))
                   : le(static_cast<uint16_t>(value.size()));
  return bytes + value;
}

/// A slice of 6 x 4 pixels; `pixels` is the whole element (7fe0,0010).
std::string dicom(const std::string& syntax, uint16_t bits, const std::string& pixels) {
  std::string meta = dicom_element({2, 1, "OB", std::string("\0\1", 2)}) +
                     dicom_element({2, 2, "UI", "1.2.840.10008.5.1.4.1.1.2"}) +
                     dicom_element({2, 3, "UI", "1.2.3.4"}) + dicom_element({2, 0x10, "UI", syntax});
  std::string file = std::string(128, '\0') + "DICM" +
                     dicom_element({2, 0, "UL", le(static_cast<uint32_t>(meta.size()))}) + meta;
  const Element elements[] = {{8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.2"},
                              {8, 0x18, "UI", "1.2.3.4"},
                              {8, 0x60, "CS", "CT"},
                              {0x18, 0x50, "DS", "2.5"},
                              {0x20, 0xe, "UI", "1.2.3.5"},
                              {0x20, 0x13, "IS", "7"},
                              {0x20, 0x32, "DS", "1\\2\\3"},
                              {0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0"},
                              {0x28, 2, "US", le(uint16_t{1})},
                              {0x28, 4, "CS", "MONOCHROME2"},
                              {0x28, 0x10, "US", le(uint16_t{4})},
                              {0x28, 0x11, "US", le(uint16_t{6})},
                              {0x28, 0x30, "DS", "0.5\\0.25"},
                              {0x28, 0x100, "US", le(bits)},
                              {0x28, 0x101, "US", le(bits)},
                              {0x28, 0x102, "US", le(static_cast<uint16_t>(bits - 1))},
                              {0x28, 0x103, "US", le(static_cast<uint16_t>(bits == 16))},
                              {0x28, 0x1052, "DS", "-1024"},
                              {0x28, 0x1053, "DS", "1"}};
  for (const Element& e : elements) file += dicom_element(e);
  return file + pixels;
}

/// Pixels of 8 bits as one fragment of run lengths: literals only.
std::string run_length_pixels() {
  std::string fragment = le(uint32_t{1}) + le(uint32_t{64}) + std::string(56, '\0');
  for (int row = 0; row < 4; ++row) fragment += '\5' + pattern(6);
  const std::string item("\xfe\xff\x00\xe0", 4), end("\xfe\xff\xdd\xe0\0\0\0\0", 8);
  return le(uint16_t{0x7fe0}) + le(uint16_t{0x10}) + "OB" + std::string(2, '\0') + le(~uint32_t{0}) + item +
         le(uint32_t{0}) + item + le(static_cast<uint32_t>(fragment.size())) + fragment + end;
}

}  // namespace

std::vector<std::string> nrrd_seeds() {
  const std::string sizes = "dimension: 3\nsizes: 4 3 2\n", data = pattern(24);
  return {
      written("s.nrrd", {4, 3, 2}, VoxelFormat::density8),
      written("s.nrrd", {4, 3, 2}, VoxelFormat::density16, SampleType::i16),
      written("s.nrrd", {4, 3, 2}, VoxelFormat::rgba32),
      "NRRD0004\ntype: uint8\n" + sizes + "encoding: gzip\n\n" + gzip_text(data),
      "NRRD0005\n# comment\ntype: uchar\nspace: left-posterior-superior\nspace directions: (1,0,0) "
      "(0,2,0) (0,0,3)\n"
      "space origin: (1,2,3)\nkey:=value\n" +
          sizes + "encoding: bzip2\n\n" + bzip2_text(data),
      "NRRD0001\ntype: float\ndimension: 3\nsizes: 3 1 2\nspacings: 1 NaN 0.5\nencoding: ascii\n\n1 -2.5 "
      "3e4\nnan inf 6\n",
      "NRRD0005\ntype: uchar\ndimension: 5\nsizes: 2 3 2 2 1\nkinds: space 3-color time space list\nspace: "
      "LPST\nspace units: \"mm\" \"mm\" \"mm\" \"s\"\nspace directions: (1,0,0,0) none (0,0,0,1) (0,1,1,0) "
      "none\nspace origin: (1,2,3,4)\nmeasurement frame: (1)\nvoxkit fill:=3\nencoding: hex\n\n"
      "000102030405060708090a0b0c0d0e0f1011121314151617",
      "NRRD0003\ntype: double\ndimension: 3\nsizes: 3 1 1\nendian: big\nencoding: raw\nline skip: "
      "1\nbyte skip: 2\n\nline\nxx" +
          pattern(24)};
}

std::vector<std::string> nifti_seeds() {
  // Planes of colours, an extension, both forms of a place.
  std::string planes = written("s.nii", {3, 2, 6}, VoxelFormat::density8);
  if (planes.size() > 352) {
    planes[40] = 5, planes[46] = 2, planes[50] = 3, planes[252] = planes[254] = planes[348] = 1;
    planes.replace(108, 4, le(384.0f));
    planes.insert(352, le(int32_t{32}) + le(int32_t{4}) + std::string(24, 'e'));
    for (size_t i = 0; i < 3; ++i) planes.replace(280 + 20 * i, 4, le(1.0f));
  }
  return {written("s.nii", {3, 2, 4}, VoxelFormat::density8),
          written("s.nii", {3, 2, 4}, VoxelFormat::float32, SampleType::f32),
          written("s.nii", {3, 2, 4}, VoxelFormat::rgb24),
          written("s.nii.gz", {3, 2, 4}, VoxelFormat::density16, SampleType::i16), planes};
}

std::vector<std::string> mrc_seeds() {
  std::string half = written("s.mrc", {3, 2, 4}, VoxelFormat::density16, SampleType::u16);
  if (half.size() > 12) half[12] = 12;
  std::string stack = written("s.mrc", {3, 2, 4}, VoxelFormat::density8), turned = stack;
  if (stack.size() > 224) {
    stack.replace(88, 4, le(int32_t{401}));
    stack[36] = 2;
    turned[64] = 3, turned[72] = 1, turned[12] = 101, turned[220] = 2;
    turned.replace(52, 4, le(110.0f));
  }
  return {written("s.mrc", {3, 2, 4}, VoxelFormat::density8),
          written("s.mrc", {3, 2, 4}, VoxelFormat::float32, SampleType::f32), half, stack, turned};
}

std::vector<std::string> npy_seeds() {
  const auto array = [](const std::string& type, const std::string& order, const std::string& shape,
                        size_t bytes) {
    const std::string text =
        "{\"descr\": '" + type + "', 'fortran_order': " + order + ", 'shape': (" + shape + ")}";
    return "\x93NUMPY\2" + std::string(1, '\0') + le(static_cast<uint32_t>(text.size())) + text +
           pattern(bytes);
  };
  return {written("s.npy", {4, 3, 2}, VoxelFormat::density16, SampleType::i16),
          written("s.npy", {4, 3, 2}, VoxelFormat::rgba32),
          array(">f4", "True", "2, 3, 4", 96),
          array("<i8", "False", "2, 1, 3L, 1, 2", 96),
          array("|b1", "False", "7,", 7),
          array("<f8", "True", "1, 2, 3, 4", 192)};
}

std::vector<std::string> meta_image_seeds() {
  const std::string image = "ObjectType = Image\nNDims = ", byte = "\nElementType = MET_UCHAR\n";
  return {
      written("s.mha", {4, 3, 2}, VoxelFormat::density16, SampleType::i16),
      written("s.mha", {4, 3, 2}, VoxelFormat::rgba32),
      image + "3\nDimSize = 4 3 2" + byte + "CompressedData = True\nElementDataFile = LOCAL\n" +
          zlib_text(pattern(24)),
      image +
          "4\nDimSize = 2 3 2 2\nElementType = MET_DOUBLE\nElementByteOrderMSB = True\nOffset = 1 2 3 0\n"
          "ElementSpacing = 1 2 3 1\nHeaderSize = -1\nElementDataFile = LOCAL\n" +
          pattern(192),
      image + "2\nDimSize = 3 2" + byte +
          "TransformMatrix = 0 1 -1 0\nElementNumberOfChannels = 2\nBinaryData = False\nDistanceUnits = um\n"
          "AnatomicalOrientation = ???\nElementDataFile = LOCAL\n1 2 3 4 5 6 7 8 9 10 11 12\n"};
}

std::vector<std::string> vtk_seeds() {
  const std::string head = "# vtk DataFile Version 3.0\ntitle\n", points = "\nDATASET STRUCTURED_POINTS\n";
  return {written("s.vtk", {4, 3, 2}, VoxelFormat::density16, SampleType::i16),
          written("s.vtk", {4, 3, 2}, VoxelFormat::rgb24),
          head + "ASCII" + points +
              "DIMENSIONS 4 3 2\nORIGIN 1 2 3\nSPACING 1 2 .5\nCELL_DATA 6\n"
              "SCALARS a float 1\nLOOKUP_TABLE default\n1 2 3\n4 5e3 nan\n",
          head + "BINARY" + points +
              "DIMENSIONS 3 1 2\nASPECT_RATIO 1 1 1\nMETADATA\nINFORMATION 0\n\n"
              "POINT_DATA 6\nFIELD FieldData 1\na 2 6 double\n" +
              pattern(96),
          head + "BINARY" + points + "DIMENSIONS 3 1 2\nPOINT_DATA 6\nCOLOR_SCALARS c 4\n" + pattern(24)};
}

std::vector<std::string> vti_seeds() {
  const auto image = [](const std::string& file, const std::string& data, const std::string& array,
                        const std::string& appended) {
    return "<VTKFile type=\"ImageData\" byte_order=\"LittleEndian\" " + file +
           "><!-- -->\n<ImageData WholeExtent=\"0 3 1 3 0 1\" Origin=\"1 2 3\" Spacing='1 .5 2' "
           "Direction=\"0 1 0 1 0 0 "
           "0 0 1\"><Piece Extent=\"0 3 1 3 0 1\"><" +
           data + "><DataArray type=\"UInt8\" Name=\"a\" NumberOfComponents=\"1\" " + array +
           "</DataArray></" + data + "></Piece></ImageData>" + appended + "</VTKFile>";
  };
  const std::string zlib = "compressor=\"vtkZLibDataCompressor\"", packed = zlib_text(pattern(24));
  const std::string counts =
      le(uint32_t{1}) + le(uint32_t{24}) + le(uint32_t{0}) + le(static_cast<uint32_t>(packed.size()));
  return {written("s.vti", {4, 3, 2}, VoxelFormat::density16, SampleType::i16),
          written("s.vti", {4, 3, 2}, VoxelFormat::rgba32),
          image("", "CellData", "format=\"ascii\">1 2 3 4 5 6", ""),
          // 24 zeros behind their count.
          image("", "PointData", "format=\"binary\"> GAAAA" + std::string(33, 'A') + "==", ""),
          image(zlib, "PointData", "format=\"appended\" offset=\"0\">",
                "<AppendedData encoding=\"raw\">_" + counts + packed),
          // 24 bytes as they are.
          image("compressor=\"vtkLZ4DataCompressor\"", "PointData", "format=\"appended\" offset=\"0\">",
                "<AppendedData encoding=\"raw\">_" + le(uint32_t{1}) + le(uint32_t{24}) + le(uint32_t{0}) +
                    le(uint32_t{26}) + "\xf0\x09" + pattern(24))};
}

std::vector<std::string> raw_seeds() {
  const auto options = [](int type, int order) {
    return std::string("\3\0\2\0\4\0", 6) + static_cast<char>(2 * type + order);
  };
  return {options(0, 0) + pattern(24), options(3, 1) + pattern(48), options(7, 1) + pattern(192),
          options(8, 0) + pattern(72), options(10, 0) + pattern(3)};
}

std::vector<std::string> gunzip_seeds() {
  return {gzip_text("stored and packed " + std::string(300, 'a') + pattern(100)),
          gzip_text("one") + gzip_text("two"), gzip_text(std::string(70000, 'x')) + std::string(8, '\0')};
}

std::vector<std::string> bunzip2_seeds() {
  return {bzip2_text("packed " + std::string(300, 'a') + pattern(100)),
          bzip2_text("one") + bzip2_text("two")};
}

std::vector<std::string> image_seeds() {
  return {image(".tif", VoxelFormat::density16, SampleType::u16), image(".tif", VoxelFormat::rgba32),
          image(".png", VoxelFormat::rgb24), image(".exr", VoxelFormat::float32, SampleType::f32),
          two_pages()};
}

std::vector<std::string> openvdb_seeds() {
  return {written("s.vdb", {5, 4, 3}, VoxelFormat::float32, SampleType::f32),
          written("s.vdb", {9, 3, 2}, VoxelFormat::rgba32)};
}

std::vector<std::string> dicom_seeds() {
  return {dicom("1.2.840.10008.1.2.1", 16, dicom_element({0x7fe0, 0x10, "OW", pattern(48)})),
          dicom("1.2.840.10008.1.2.5", 8, run_length_pixels())};
}

}  // namespace voxkit::fuzz
