// Files of layout packed that were cut where a level ends, and what is left of damaged ones.
#include "libsvmm/packed/salvage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "libsvmm/packed/packed_layout.h"
#include "tests/libsvmm/packed_attack.h"
#include "tests/libsvmm/packed_files.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;
using voxkit::test::Bytes;

Written encoded(const VolumeInfo& info, const PackedOptions& options = {}, Content content = Content::noise) {
  voxkit::test::MemorySource source(info, bytes_of(make_voxels(info, content, 6), info.format));
  return encode(source, options);
}
Bytes prefix(const Bytes& file, uint64_t length) {
  return {file.begin(), file.begin() + static_cast<ptrdiff_t>(length)};
}

TEST(PackedPrefix, EndsOfLevelsAreFiles) {
  for (const VoxelFormat format : {VoxelFormat::density8, VoxelFormat::float32}) {
    const Bytes file = encoded(make_info({70, 40, 130}, format), {.max_error = 0.25}).bytes;
    const auto whole = open(file);
    EXPECT_EQ(whole->finest(), 0);
    EXPECT_EQ(whole->levels()[0].end, file.size());
    for (int level = 0; level < whole->params().levels; ++level) {
      const PackedLevel& expected = whole->levels()[static_cast<size_t>(level)];
      const Bytes cut = prefix(file, expected.end);
      const auto part = open(cut);
      ASSERT_TRUE(part);
      EXPECT_EQ(part->finest(), level);
      EXPECT_EQ(part->levels()[static_cast<size_t>(level)].end, cut.size());
      Context ctx = context();
      EXPECT_TRUE(part->check(ctx));
      for (int coarser = level; coarser < whole->params().levels; ++coarser)
        EXPECT_EQ(decode(*part, coarser), decode(*whole, coarser));
      const auto source = open_source(part, level);
      ASSERT_TRUE(source);
      EXPECT_EQ((*source)->info().dims, expected.dims);
      if (level == 0) continue;
      const auto finer = open_source(part, level - 1);
      ASSERT_FALSE(finer);
      EXPECT_EQ(finer.error().code, ErrorCode::input);
      EXPECT_EQ(attack_packed(cut).fault, "");
    }
  }
}

TEST(PackedPrefix, DamagedOnesAreRefusedOrRead) {
  std::mt19937 random(5);
  const Bytes file = encoded(make_info({40, 20, 35}, VoxelFormat::density8)).bytes;
  const Bytes cut = prefix(file, open(file)->levels()[1].end);
  const int tries = std::getenv("VOXKIT_MUTATIONS") ? std::atoi(std::getenv("VOXKIT_MUTATIONS")) : 150;
  for (int i = 0; i < tries; ++i) {
    Bytes bad = cut;
    voxkit::test::damage(bad, 0, bad.size(), false, random);
    voxkit::test::repair(bad);
    ASSERT_EQ(attack_packed(bad).fault, "") << "damage " << i;
  }
}

/// Where a page lies in a file.
size_t place_of(const Bytes& file, uint32_t level, uint64_t number, Index3 dims) {
  const auto volume = open(file);
  const PageGrid grid(dims, volume->params().page_side);
  for (size_t i = 0; i < volume->container().table().size(); ++i) {
    const ChunkEntry& entry = volume->container().table()[i];
    if (entry.kind != pages_kind || entry.index != level || entry.part != number / grid.pages_a_part())
      continue;
    const auto bytes = *volume->container().chunk(i);
    const PartView part(bytes, grid.pages_of(entry.part));
    return entry.offset + static_cast<size_t>(part.page(number % grid.pages_a_part()).data() - bytes.data());
  }
  return 0;
}

struct Salvaged {
  Bytes voxels;
  std::vector<Losses::Page> lost, doubtful;
};
Salvaged salvage(const Bytes& file, int level = 0) {
  Salvaged out;
  const auto losses = std::make_shared<Losses>();
  const auto volume = open(file);
  const auto source = open_salvaged(volume, level, losses);
  EXPECT_TRUE(source);
  const VolumeInfo& info = (*source)->info();
  out.voxels.resize(raw_bytes(info));
  EXPECT_TRUE((*source)->read(info.box(), packed(out.voxels.data(), info.dims, info.format)));
  for (const auto& page : losses->pages()) (page.doubtful ? out.doubtful : out.lost).push_back(page);
  return out;
}

TEST(PackedSalvage, OnlyTheDamagedPageIsLost) {
  VolumeInfo info = make_info({160, 64, 64}, VoxelFormat::density16);  // 160 pages, 128 of them in part 0
  info.fill = 7;
  Bytes file = encoded(info).bytes;
  const Bytes sound = decode(*open(file));
  EXPECT_EQ(salvage(file).voxels, sound);
  EXPECT_TRUE(salvage(file).lost.empty());
  const uint64_t number = 13;  // at 48,16,0
  const size_t at = place_of(file, 0, number, info.dims);
  for (size_t i = 0; i < 8; ++i) file[at + i] ^= std::byte{0x5a};
  Context ctx = context();
  EXPECT_FALSE(open(file)->check(ctx));
  const Salvaged rest = salvage(file);
  ASSERT_EQ(rest.lost.size(), 1u);
  EXPECT_EQ(rest.lost[0].level, 0);
  EXPECT_EQ(rest.lost[0].at, Index3(48, 16, 0));
  EXPECT_EQ(rest.doubtful.size(), 127u);
  const Box page{{48, 16, 0}, {64, 32, 16}};
  for (int64_t i = 0; i < 160 * 64 * 64; ++i) {
    uint16_t value, expected = 7;
    std::memcpy(&value, &rest.voxels[static_cast<size_t>(2 * i)], 2);
    if (!page.contains(Index3(i % 160, i / 160 % 64, i / 160 / 64)))
      std::memcpy(&expected, &sound[static_cast<size_t>(2 * i)], 2);
    ASSERT_EQ(value, expected);
  }
}

TEST(PackedSalvage, PagesOfALostOneAreLost) {
  const VolumeInfo info = make_info({70, 64, 40}, VoxelFormat::float32);
  Bytes file = encoded(info).bytes;
  const Bytes sound = decode(*open(file));
  const auto whole = open(file);
  const size_t at = place_of(file, 1, 1, whole->levels()[1].dims);  // of 3 x 2 x 2 pages that at 16,0,0
  for (size_t i = 0; i < 8; ++i) file[at + i] ^= std::byte{0x5a};
  const Salvaged rest = salvage(file);
  ASSERT_EQ(rest.lost.size(), 9u);  // it and its eight
  EXPECT_EQ(rest.lost[0].level, 1);
  EXPECT_EQ(rest.lost[0].at, Index3(16, 0, 0));
  for (size_t i = 1; i < 9; ++i) EXPECT_EQ(rest.lost[i].level, 0);
  EXPECT_EQ(rest.lost[1].at, Index3(32, 0, 0));
  EXPECT_EQ(rest.lost[8].at, Index3(48, 16, 16));
  const Box lost{{32, 0, 0}, {64, 32, 32}};
  for (int64_t i = 0; i < 70 * 64 * 40; ++i) {
    float value, expected = 0;
    std::memcpy(&value, &rest.voxels[static_cast<size_t>(4 * i)], 4);
    if (!lost.contains(Index3(i % 70, i / 70 % 64, i / 70 / 64)))
      std::memcpy(&expected, &sound[static_cast<size_t>(4 * i)], 4);
    ASSERT_EQ(value, expected);
  }
  // Coarser levels, and boxes that the damage is not in, are as ever.
  EXPECT_TRUE(salvage(file, 2).lost.empty());
}

TEST(PackedSalvage, LengthsThatDoNotAddUpLoseThePart) {
  const VolumeInfo info = make_info({160, 64, 64}, VoxelFormat::density8);
  Bytes file = encoded(info).bytes;
  const auto volume = open(file);
  for (const ChunkEntry& entry : volume->container().table())
    if (entry.kind == pages_kind && entry.index == 0 && entry.part == 1)
      file[entry.offset + 1] ^= std::byte{1};
  const Salvaged rest = salvage(file);
  EXPECT_EQ(rest.lost.size(), 32u);
  EXPECT_TRUE(rest.doubtful.empty());
}

/// As it comes back from a file whose fill value is one of floats: what stands for it while it is worked on.
TEST(PackedSalvage, VoidsOfFloatsAreTheFillValue) {
  VolumeInfo info = make_info({40, 20, 20}, VoxelFormat::float32);
  info.fill = -9999;
  // Of noise, whose values are all as likely, damaged pages end as they should.
  Bytes file = encoded(info, {}, Content::smooth).bytes;
  const size_t at = place_of(file, 0, 0, info.dims);
  for (size_t i = 0; i < 8; ++i) file[at + i] ^= std::byte{0x5a};
  const Salvaged rest = salvage(file);
  ASSERT_EQ(rest.lost.size(), 1u);
  float value;
  std::memcpy(&value, rest.voxels.data(), 4);
  EXPECT_TRUE(std::isnan(value));
}

}  // namespace
}  // namespace voxkit::svmm
