// Damaged and invented files of surfaces: whatever the bytes, an error or a well-formed answer.
#include <gtest/gtest.h>

#include <cstdlib>

#include "formats/volume_chunks.h"
#include "tests/damage.h"
#include "tests/libcolor/attack.h"
#include "tests/libcolor/attribute_scenes.h"

namespace voxkit::color {
namespace {

using voxkit::test::Bytes;

/// VOXKIT_MUTATIONS: how many damaged copies of each file are tried.
int mutations() {
  const char* text = std::getenv("VOXKIT_MUTATIONS");
  return text && std::atoi(text) > 0 ? std::atoi(text) : 2000;
}

const std::vector<Bytes>& files() {
  static const std::vector<Bytes> all = [] {
    std::vector<Bytes> made;
    for (const ColorCodec codec : codecs())
      for (const Counts counts : {Counts::node, Counts::pointer})
        for (const Colors colors : {Colors::leaf, Colors::all}) {
          Options options;
          options.codec = codec;
          options.counts = counts;
          options.colors = colors;
          if (colors == Colors::all) options.threshold = 3;
          if ((counts == Counts::pointer) == (codec == ColorCodec::raw || codec == ColorCodec::vws) &&
              codec != ColorCodec::predicted)
            options.curve = Curve::hilbert;
          if (!validate(options)) continue;
          if ((counts == Counts::pointer) == (colors == Colors::leaf))
            options.geometry = Geometry::octree;
          else if (codec == ColorCodec::vws)
            options.geometry = Geometry::dag;
          if (counts == Counts::pointer) {
            options.image_curve = ImageCurve::hilbert;
            options.quality = 40;
          }
          ListSource shell(sphere_shell(4), Index3(16)), few(scattered(6, 60, 1), Index3(64)),
              none({}, Index3(9, 2, 3));
          for (ListSource* source : {&shell, &few, &none}) made.push_back(compressed(*source, options));
        }
    for (const ColorCodec codec : {ColorCodec::raw, ColorCodec::fws, ColorCodec::vws})
      for (const Pattern pattern : {Pattern::runs, Pattern::random}) {
        Options options;
        options.codec = codec;
        if (pattern == Pattern::runs) options.colors = Colors::all;
        const Voxels voxels = sphere_shell(3);
        AttributedSource source(voxels, Index3(8), all_attributes(),
                                interleaved(all_attributes(), voxels.size(), pattern, 3));
        made.push_back(compressed(source, options));
      }
    return made;
  }();
  return all;
}

TEST(ColorHostile, TheFilesAreValid) {
  for (const Bytes& file : files()) {
    const test::Answer answer = test::attack(file);
    EXPECT_EQ(answer.fault, "");
    EXPECT_TRUE(answer.checked);
  }
}

TEST(ColorHostile, EveryPrefixAndOneByteMoreIsRefused) {
  for (const Bytes& file : files()) {
    for (size_t length = 0; length < file.size(); length += 7) {
      const test::Answer answer = test::attack(std::span(file).first(length));
      ASSERT_EQ(answer.fault, "") << "cut to " << length;
      ASSERT_FALSE(answer.opened) << "cut to " << length;
    }
    Bytes longer = file;
    longer.push_back({});
    EXPECT_FALSE(test::attack(longer).opened);
  }
}

/// With every checksum made right the decoder itself is attacked.
TEST(ColorHostile, ResealedDamageIsAnsweredSoundly) {
  std::mt19937 random(2);
  int sound = 0, refused = 0, refused_late = 0;
  for (const Bytes& original : files()) {
    const auto table = voxkit::test::table_of(original);
    for (int i = 0; i < mutations(); ++i) {
      Bytes file = original;
      if (i % 5 == 0)
        voxkit::test::damage(file, table.offset, file.size(), true, random);
      else
        voxkit::test::damage(file, 64, table.offset, true, random);
      i % 10 == 0 ? voxkit::test::repair(file, Codec::color) : voxkit::test::reseal(file);
      const test::Answer answer = test::attack(file);
      ASSERT_EQ(answer.fault, "") << "mutation " << i;
      ++(answer.checked ? sound : answer.opened ? refused_late : refused);
    }
  }
  EXPECT_GT(sound, 1000);
  EXPECT_GT(refused, 1000);
  EXPECT_GT(refused_late, 1000);
}

/// Counts that do not add up would give voxels the colors of others: whoever opens or walks such a file finds
/// out.
TEST(ColorHostile, CountsThatDoNotAddUpAreFoundWithoutACheck) {
  Context ctx;
  MemoryBudget budget;
  ctx.memory = &budget;
  Options options;
  options.codec = ColorCodec::raw;
  ListSource shell(sphere_shell(5), Index3(32));
  Bytes whole;
  int changed = 0;
  for (const bool symmetric : {true, false}) {
    options.geometry = symmetric ? Geometry::ssvdag : Geometry::dag;
    whole = compressed(shell, options);
    const auto table = voxkit::test::table_of(whole);
    for (size_t i = 0; i < table.entries; ++i) {
      const std::byte* const entry = &whole[table.offset + 64 * i];
      if (load_le<uint32_t>(entry) != chunk_kind(symmetric ? "SNOD" : "NODE")) continue;
      const auto offset = load_le<uint64_t>(entry + 16);
      if (load_le<uint64_t>(entry + 24) == 0) continue;
      Bytes file = whole;
      if (symmetric) {
        file[offset + 2] ^= std::byte{1};  // the first node's count: its lowest bits
      } else {
        const auto word = load_le<uint32_t>(&file[offset]);
        store_le(&file[offset], word - (1u << 8));  // the same, less one
      }
      voxkit::test::reseal(file);
      ++changed;
      const auto container = Container::open(file, "test", nullptr);
      ASSERT_TRUE(container);
      const auto volume = Volume::open(*container);
      ASSERT_TRUE(volume);
      EXPECT_FALSE((*volume)->check(ctx));
      const auto walked =
          (*volume)->for_each_voxel([](std::span<const SurfaceVoxel>) -> Status { return {}; }, ctx);
      ASSERT_FALSE(walked) << "chunk " << i;
      EXPECT_EQ(walked.error().code, ErrorCode::input);
    }
  }
  EXPECT_GE(changed, 4);
  const auto table = voxkit::test::table_of(whole);
  // The number of all colors that the parameters say: not that of the root, it is no volume to walk.
  for (const uint64_t more : {uint64_t{1}, ~uint64_t{0}, uint64_t{1} << 36}) {
    Bytes file = whole;
    for (size_t i = 0; i < table.entries; ++i) {
      const std::byte* const entry = &file[table.offset + 64 * i];
      if (load_le<uint32_t>(entry) != chunk_kind("DAGP")) continue;
      std::byte* const colors = &file[load_le<uint64_t>(entry + 16) + 8];
      store_le(colors, load_le<uint64_t>(colors) + more);
    }
    voxkit::test::reseal(file);
    const auto container = Container::open(file, "test", nullptr);
    ASSERT_TRUE(container);
    const auto volume = Volume::open(*container);
    const auto first = volume ? (*volume)->voxel(Index3(0)) : tl::unexpected<Error>(volume.error());
    ASSERT_FALSE(first) << more;
    EXPECT_EQ(first.error().code, ErrorCode::input);
  }
}

TEST(ColorHostile, DamagedBlocksAreFoundWithoutACheck) {
  Options options;
  options.codec = ColorCodec::vws;
  ListSource shell(sphere_shell(5), Index3(32));
  Bytes file = compressed(shell, options);
  const auto table = voxkit::test::table_of(file);
  for (size_t i = 0; i < table.entries; ++i) {
    const std::byte* const entry = &file[table.offset + 64 * i];
    if (load_le<uint32_t>(entry) == chunk_kind("COLR"))
      store_le(&file[load_le<uint64_t>(entry + 16)], ~uint32_t{0});  // the number of its blocks
  }
  voxkit::test::reseal(file);
  const auto container = Container::open(file, "test", nullptr);
  ASSERT_TRUE(container);
  const auto volume = Volume::open(*container);
  ASSERT_TRUE(volume);
  EXPECT_FALSE((*volume)->color(0));
}

}  // namespace
}  // namespace voxkit::color
