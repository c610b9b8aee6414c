// Tiles of blocks of textures against another reader: that of OpenImageIO.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "libcolor/textures/part_image.h"
#include "libcolor/tiles.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

/// A picture of R, G and B.
RgbImage read(const std::vector<std::byte>& file) {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("voxkit-tile-" + std::to_string(getpid()) + ".dds"))
          .string();
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  const auto input = OIIO::ImageInput::open(path);
  EXPECT_TRUE(input) << OIIO::geterror();
  if (!input) return {};
  RgbImage image = make_rgb_image(
      {static_cast<uint32_t>(input->spec().width), static_cast<uint32_t>(input->spec().height)});
  EXPECT_TRUE(input->read_image(0, 0, 0, 3, OIIO::TypeDesc::UINT8, image.rgb.data())) << input->geterror();
  input->close();
  std::filesystem::remove(path);
  return image;
}

TEST(TilesOracle, DdsHasTheColorsInTheirPlaces) {
  for (const ColorCodec codec : {ColorCodec::bc1, ColorCodec::bc7})
    for (const ImageCurve curve : {ImageCurve::morton, ImageCurve::hilbert}) {
      ListSource source(sphere_shell(6), Index3(64));
      Options options;
      options.codec = codec;
      options.image_curve = curve;
      auto bytes = std::make_shared<const std::vector<std::byte>>(compressed(source, options));
      const auto volume = Volume::open(Container::open(*bytes, "file", bytes).value()).value();
      const auto tile = tile_of(*volume, 0, TileFormat::dds);
      ASSERT_TRUE(tile) << tile.error().what;
      const RgbImage image = read(*tile);
      const auto count = static_cast<uint32_t>(volume->params().color_count);
      const ImageSize least = part_image_size(curve, count);
      ASSERT_GE(image.size.width, least.width);
      ASSERT_LT(image.size.width, least.width + 4);
      ASSERT_GE(image.size.height, least.height);
      ASSERT_LT(image.size.height, least.height + 4);
      const std::vector<Rgb> colors = part_colors_of(image, curve, count);
      // Of BC1, readers round the colours between the ends in their own ways.
      const int most = codec == ColorCodec::bc1 ? 2 : 0;
      for (uint32_t i = 0; i < count; ++i) {
        const Rgb ours = volume->color(i).value(), theirs = colors[i];
        ASSERT_LE(std::abs(ours.r - theirs.r), most) << i;
        ASSERT_LE(std::abs(ours.g - theirs.g), most) << i;
        ASSERT_LE(std::abs(ours.b - theirs.b), most) << i;
      }
    }
}

}  // namespace
}  // namespace voxkit::color
