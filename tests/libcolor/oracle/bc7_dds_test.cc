// BC7 against another decoder: OpenImageIO's reader of DDS files.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <vector>

#include "formats/little_endian.h"
#include "libcolor/textures/bc7.h"
#include "tests/libcolor/color_runs.h"

namespace voxkit::color {
namespace {

using Blocks = std::vector<std::byte>;

constexpr uint32_t across = 16;  ///< blocks in a row of the image

/// A DDS file of BC7, DXGI format 98; blocks row by row.
std::string written(const Blocks& blocks) {
  const auto count = static_cast<uint32_t>(blocks.size() / bc7_block_bytes);
  std::vector<std::byte> file(148);
  const auto put = [&](size_t at, uint32_t value) { store_le(&file[at], value); };
  put(0, 0x20534444);  // "DDS "
  put(4, 124);         // bytes of the header
  put(8, 0x81007);     // caps, height, width, pixel format, linear size
  put(12, count / across * 4);
  put(16, across * 4);
  put(20, static_cast<uint32_t>(blocks.size()));
  put(28, 1);           // levels
  put(76, 32);          // bytes of the pixel format
  put(80, 4);           // named by
  put(84, 0x30315844);  // "DX10"
  put(108, 0x1000);     // a texture
  put(128, 98);         // BC7_UNORM
  put(132, 3);          // 2D
  put(140, 1);          // one of them
  file.insert(file.end(), blocks.begin(), blocks.end());
  const std::string path =
      (std::filesystem::temp_directory_path() / ("voxkit-bc7-" + std::to_string(getpid()) + ".dds")).string();
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  return path;
}

void expect_same(const Blocks& blocks) {
  const std::string path = written(blocks);
  OIIO::ImageSpec config;
  config["oiio:UnassociatedAlpha"] = 1;
  const auto input = OIIO::ImageInput::open(path, &config);
  ASSERT_TRUE(input) << OIIO::geterror();
  const auto width = static_cast<uint32_t>(input->spec().width);
  ASSERT_EQ(width, 4 * across);
  ASSERT_EQ(input->spec().nchannels, 4);
  std::vector<uint8_t> rgba(size_t{width} * static_cast<size_t>(input->spec().height) * 4);
  ASSERT_TRUE(input->read_image(0, 0, 0, 4, OIIO::TypeDesc::UINT8, rgba.data())) << input->geterror();
  input->close();
  std::filesystem::remove(path);
  for (uint32_t b = 0; b < blocks.size() / bc7_block_bytes; ++b) {
    Pixels16 pixels;
    decode_bc7(&blocks[size_t{b} * bc7_block_bytes], pixels);
    for (uint32_t i = 0; i < 16; ++i) {
      const uint8_t* const p = &rgba[((b / across * 4 + i / 4) * width + b % across * 4 + i % 4) * size_t{4}];
      ASSERT_EQ(pixels[i], (Rgb{p[0], p[1], p[2]}))
          << "block " << b << ", mode of byte " << static_cast<int>(blocks[size_t{b} * bc7_block_bytes])
          << ", pixel " << i;
    }
  }
}

/// Noise in each mode: with so many blocks every partition is there.
TEST(Bc7Oracle, BlocksOfAllModesAreReadAlike) {
  std::mt19937 random(12);
  for (uint32_t mode = 0; mode < 8; ++mode) {
    Blocks blocks(size_t{bc7_block_bytes} * 1024);
    for (std::byte& byte : blocks) byte = static_cast<std::byte>(random());
    for (size_t at = 0; at < blocks.size(); at += bc7_block_bytes)
      blocks[at] = (blocks[at] & static_cast<std::byte>(0xff << (mode + 1) & 0xff)) |
                   static_cast<std::byte>(1 << mode);
    expect_same(blocks);
  }
}

TEST(Bc7Oracle, WhatIsEncodedIsReadAlike) {
  Blocks blocks;
  for (const ColorCase& c : color_cases(16 * 256, 3))
    for (size_t first = 0; first < c.colors.size(); first += 16) {
      Pixels16 pixels;
      std::copy_n(c.colors.begin() + static_cast<ptrdiff_t>(first), 16, pixels.begin());
      blocks.resize(blocks.size() + bc7_block_bytes);
      encode_bc7(pixels, 3, &blocks[blocks.size() - bc7_block_bytes]);
    }
  expect_same(blocks);
}

}  // namespace
}  // namespace voxkit::color
