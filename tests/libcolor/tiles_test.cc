// Colours as files of images, there and back.
#include "libcolor/tiles.h"

#include <gtest/gtest.h>

#include <random>

#include "libcolor/textures/block_image.h"
#include "libcolor/textures/part_image.h"
#include "libcolor/textures/texture.h"
#include "tests/libcolor/color_runs.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

constexpr TileFormat formats[] = {TileFormat::png, TileFormat::jpeg, TileFormat::jp2, TileFormat::dds,
                                  TileFormat::astc};

std::shared_ptr<const Volume> volume_of(SurfaceSource& source, const Options& options) {
  auto bytes = std::make_shared<const std::vector<std::byte>>(compressed(source, options));
  auto container = Container::open(*bytes, "file", bytes);
  if (!container) return nullptr;
  auto volume = Volume::open(*container);
  return volume ? *volume : nullptr;
}

std::vector<Rgb> colors_of(const Volume& volume) {
  std::vector<Rgb> colors;
  for (uint64_t i = 0; i < volume.params().color_count; ++i) colors.push_back(volume.color(i).value());
  return colors;
}

/// The file of a surface, with a tile as its part.
std::vector<std::byte> with_tile(SurfaceSource& source, const Options& options, TileFormat format,
                                 const std::vector<std::byte>& tile) {
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  std::vector<std::byte> bytes;
  const auto report = encode(
      source, options, [&](uint64_t, uint32_t colors) { return part_of_tile(tile, format, options, colors); },
      [&](std::span<const std::byte> some) -> Status {
        bytes.insert(bytes.end(), some.begin(), some.end());
        return {};
      },
      ctx);
  return report ? bytes : std::vector<std::byte>();
}

TEST(Tiles, FormatsAreKnownByEnding) {
  EXPECT_EQ(tile_format("a/tile-%d.png"), TileFormat::png);
  EXPECT_EQ(tile_format("x.jpg"), TileFormat::jpeg);
  EXPECT_EQ(tile_format("x.jpeg"), TileFormat::jpeg);
  EXPECT_EQ(tile_format("x.jp2"), TileFormat::jp2);
  EXPECT_EQ(tile_format("x.dds"), TileFormat::dds);
  EXPECT_EQ(tile_format("x.astc"), TileFormat::astc);
  EXPECT_FALSE(tile_format("png"));
  EXPECT_FALSE(tile_format("x.tif"));
}

/// Every codec in every format: the colours of the tile are those of the file, and where the format is the
/// codec's, so are the bytes.
TEST(Tiles, ThereAndBack) {
  for (const ColorCodec codec : codecs())
    for (const ImageCurve curve : {ImageCurve::morton, ImageCurve::hilbert})
      for (const size_t size : {size_t{1}, size_t{18}, size_t{1500}}) {
        Voxels voxels = scattered(6, size, 2);
        const auto walk = color_cases(voxels.size(), 3)[4].colors;
        for (size_t i = 0; i < voxels.size(); ++i) voxels[i].color = walk[i];
        ListSource source(voxels, Index3(64));
        Options options;
        options.codec = codec;
        options.image_curve = curve;
        options.quality = codec == ColorCodec::astc ? 60 : 100;
        const auto volume = volume_of(source, options);
        ASSERT_TRUE(volume);
        const std::vector<Rgb> colors = colors_of(*volume);
        for (const TileFormat format : formats) {
          SCOPED_TRACE(testing::Message() << "codec " << static_cast<int>(codec) << ", format "
                                          << static_cast<int>(format) << ", " << voxels.size());
          if (const Status allowed = check_tile_format(format, volume->params()); !allowed) {
            EXPECT_TRUE(format == TileFormat::dds    ? codec != ColorCodec::bc1 && codec != ColorCodec::bc7
                        : format == TileFormat::astc ? codec != ColorCodec::astc
                                                     : allowed.error().code == ErrorCode::input);
            continue;
          }
          const auto tile = tile_of(*volume, 0, format);
          ASSERT_TRUE(tile) << tile.error().what;
          const auto count = static_cast<uint32_t>(colors.size());
          const auto read = colors_of_tile(*tile, format, volume->params().image_curve, count);
          ASSERT_TRUE(read) << read.error().what;
          if (format != TileFormat::jpeg || codec == ColorCodec::jpeg) {
            EXPECT_EQ(*read, colors);
          } else {
            EncodedPart seen;
            for (size_t i = 0; i < colors.size(); ++i) seen.add_error(colors[i], (*read)[i]);
            EXPECT_LT(static_cast<double>(seen.squared_error), 3.0 * 9 * static_cast<double>(count));
          }
          const auto part = part_of_tile(*tile, format, options, count);
          ASSERT_TRUE(part) << part.error().what;
          const bool same = format == TileFormat::png    ? codec == ColorCodec::png
                            : format == TileFormat::jpeg ? codec == ColorCodec::jpeg
                            : format == TileFormat::jp2  ? codec == ColorCodec::jp2
                                                         : true;
          EXPECT_EQ(part->has_value(), same);
          // The same file again, if what encodes has nothing left to lose.
          if (same) {
            const auto again = with_tile(source, options, format, *tile);
            const auto opened = Container::open(again, "again", nullptr);
            ASSERT_TRUE(opened);
            const auto other = Volume::open(*opened);
            ASSERT_TRUE(other);
            EXPECT_EQ(colors_of(**other), colors);
            EXPECT_EQ((*other)->params().grmse, 0);
            EXPECT_EQ((*other)->params().color_bytes, volume->params().color_bytes);
            EXPECT_EQ((*other)->params().blocks, volume->params().blocks);
          }
        }
      }
}

/// Blocks of other codecs, and of other sizes, are not stored as they are.
TEST(Tiles, OtherBlocksAreEncodedAnew) {
  ListSource source(sphere_shell(4), Index3(16));
  Options bc1, bc7;
  bc1.codec = ColorCodec::bc1;
  bc7.codec = ColorCodec::bc7;
  const auto volume = volume_of(source, bc1);
  const auto count = static_cast<uint32_t>(volume->params().color_count);
  const auto tile = tile_of(*volume, 0, TileFormat::dds);
  ASSERT_TRUE(tile);
  EXPECT_FALSE(part_of_tile(*tile, TileFormat::dds, bc7, count).value());
  EXPECT_TRUE(part_of_tile(*tile, TileFormat::dds, bc1, count).value());
  if (!texture_support(ColorCodec::astc)) return;
  Options large, small;
  large.codec = small.codec = ColorCodec::astc;
  large.quality = 0;
  const auto blocks = tile_of(*volume_of(source, large), 0, TileFormat::astc);
  EXPECT_FALSE(part_of_tile(*blocks, TileFormat::astc, small, count).value());
  EXPECT_TRUE(part_of_tile(*blocks, TileFormat::astc, large, count).value());
}

TEST(Tiles, OtherFilesAreRefused) {
  ListSource source(sphere_shell(4), Index3(16));
  for (const ColorCodec codec : {ColorCodec::bc1, ColorCodec::bc7, ColorCodec::astc}) {
    if (!texture_support(codec)) continue;
    Options options;
    options.codec = codec;
    const auto volume = volume_of(source, options);
    const auto count = static_cast<uint32_t>(volume->params().color_count);
    const TileFormat format = codec == ColorCodec::astc ? TileFormat::astc : TileFormat::dds;
    const auto tile = tile_of(*volume, 0, format);
    ASSERT_TRUE(tile);
    const auto read = [&](std::span<const std::byte> file, uint32_t colors) {
      // A buffer of exactly this size: a sanitizer sees any byte read past the end.
      const std::vector<std::byte> exact(file.begin(), file.end());
      return colors_of_tile(exact, format, ImageCurve::morton, colors);
    };
    EXPECT_TRUE(read(*tile, count));
    for (size_t length = 0; length < tile->size(); ++length) {
      const auto cut = read(std::span(*tile).first(length), count);
      ASSERT_FALSE(cut) << length;
      EXPECT_EQ(cut.error().code, ErrorCode::input);
    }
    // Levels of detail behind the first one do not matter, but its size does.
    auto longer = *tile;
    longer.resize(longer.size() + 100);
    EXPECT_TRUE(read(longer, count));
    const auto other = read(*tile, 4 * count);
    ASSERT_FALSE(other);
    EXPECT_NE(other.error().what.find(" pixels: expected "), std::string::npos) << other.error().what;
    std::mt19937 random(4);
    for (int i = 0; i < 3000; ++i) {
      auto changed = *tile;
      for (auto changes = 1 + random() % 3; changes > 0; --changes)
        changed[random() % std::min<size_t>(changed.size(), 300)] = static_cast<std::byte>(random());
      if (const auto answer = read(changed, count)) {
        EXPECT_EQ(answer->size(), count);
      } else {
        EXPECT_EQ(answer.error().code, ErrorCode::input);
      }
    }
  }
}

/// Whole blocks, as other programs write them, are as good as the pixels that count.
TEST(Tiles, DdsOfWholeBlocksIsRead) {
  BlockImage image{ColorCodec::bc1, {}, {5, 3}, std::vector<std::byte>(16)};
  auto file = pack_dds(image);
  EXPECT_EQ(file[12], std::byte{4});
  EXPECT_EQ(file[16], std::byte{8});
  EXPECT_TRUE(unpack_dds(file, {5, 3}));
  file[12] = std::byte{3};
  file[16] = std::byte{5};
  EXPECT_TRUE(unpack_dds(file, {5, 3}));
  EXPECT_FALSE(unpack_dds(file, {8, 4}));
  file[16] = std::byte{6};
  EXPECT_FALSE(unpack_dds(file, {5, 3}));
}

/// The same voxels, with colours of elsewhere.
TEST(Tiles, ARecoloredVolumeHasTheNewColors) {
  const Voxels voxels = sphere_shell(5);
  ListSource source(voxels, Index3(32));
  for (const Colors which : {Colors::leaf, Colors::all}) {
    Options options;
    options.colors = which;
    const auto volume = volume_of(source, options);
    MemoryBudget memory;
    const auto other = volume->recolored(
        [&](uint64_t) -> Result<std::vector<Rgb>> {
          std::vector<Rgb> colors(volume->params().color_count);
          for (size_t i = 0; i < colors.size(); ++i) colors[i] = {static_cast<uint8_t>(i % 251), 7, 9};
          return colors;
        },
        0, memory);
    ASSERT_TRUE(other);
    for (uint64_t i = 0; i < volume->params().color_count; i += 97)
      EXPECT_EQ((*other)->color(i).value(), (Rgb{static_cast<uint8_t>(i % 251), 7, 9}));
    size_t next = 0;
    Context ctx;
    ctx.memory = &memory;
    ASSERT_TRUE((*other)->for_each_voxel(
        [&](std::span<const SurfaceVoxel> run) -> Status {
          for (const SurfaceVoxel& v : run) {
            EXPECT_EQ(v.place, voxels[next++].place);
            EXPECT_EQ(v.color.g, 7);
          }
          return {};
        },
        ctx));
    EXPECT_EQ(next, voxels.size());
  }
}

}  // namespace
}  // namespace voxkit::color
