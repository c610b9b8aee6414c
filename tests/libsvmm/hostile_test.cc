// Damaged and invented SVMM files: whatever the bytes, an error or a well-formed answer.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <functional>

#include "formats/volume_chunks.h"
#include "libsvmm/layout.h"
#include "tests/damage.h"
#include "tests/libsvmm/attack.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;
using voxkit::test::Bytes;
using voxkit::test::damage;
using voxkit::test::reseal;
using voxkit::test::table_of;

/// VOXKIT_MUTATIONS: how many damaged copies of each file are tried.
int mutations() {
  const char* text = std::getenv("VOXKIT_MUTATIONS");
  return text && std::atoi(text) > 0 ? std::atoi(text) : 2000;
}

struct Case {
  std::string name;
  Bytes file;
  Answer answer;  ///< undamaged
};

/// A small volume in every voxel format, layout and base; of several levels and of one.
const std::vector<Case>& cases() {
  static const std::vector<Case> all = [] {
    std::vector<Case> made;
    uint32_t seed = 0;
    for (VoxelFormat f : all_formats)
      for (Layout layout : {Layout::thesis, Layout::plain})
        for (Base base : {Base::raw, Base::bitmap, Base::alpha, Base::gray, Base::bc1})
          for (int shape = 0; shape < 3; ++shape) {
            const Index3 dims = shape == 0 ? Index3(7, 5, 6) : shape == 1 ? Index3(9, 4, 5) : Index3(3, 2, 1);
            VolumeInfo info = make_info(dims, f);
            info.range = ValueRange{0, 255};
            const std::vector<int> widths =
                shape == 0 && base != Base::bc1 ? std::vector<int>{2} : std::vector<int>{4, 2};
            Params params = make_params(f, shape == 0 ? 100 : 80, widths, shape == 2 ? 9 : 1, layout,
                                        shape == 1 ? Bound::local : Bound::global);
            params.base = base;
            if (!validate(params, info) || (shape == 2 && base != Base::raw)) continue;
            const Content content = shape == 1 ? Content::blobs : Content::noise;
            voxkit::test::MemorySource source(info, bytes_of(make_voxels(info, content, ++seed), f));
            Case c;
            c.name = fmt::format("{} layout {} base {} shape {}", name(f), static_cast<int>(layout),
                                 static_cast<int>(base), shape);
            c.file = encode_to_memory(source, params).bytes;
            c.answer = attack(c.file);
            made.push_back(std::move(c));
          }
    return made;
  }();
  return all;
}

TEST(SvmmHostile, TheFilesAreValid) {
  EXPECT_EQ(cases().size(), 65u);
  for (const Case& c : cases()) {
    EXPECT_EQ(c.answer.fault, "") << c.name;
    EXPECT_TRUE(c.answer.checked) << c.name;
    EXPECT_FALSE(c.answer.levels.empty()) << c.name;
  }
}

TEST(SvmmHostile, EveryPrefixAndOneByteMoreIsRefused) {
  for (const Case& c : cases()) {
    for (size_t length = 0; length < c.file.size(); ++length) {
      const Answer answer = attack(std::span(c.file).first(length));
      ASSERT_EQ(answer.fault, "") << c.name << ", cut to " << length;
      ASSERT_FALSE(answer.opened) << c.name << ", cut to " << length;
    }
    Bytes longer = c.file;
    longer.push_back({});
    const Answer answer = attack(longer);
    EXPECT_EQ(answer.fault, "");
    EXPECT_FALSE(answer.opened);
  }
}

/// With the checksums as they were, damage is found, or was where no reader looks.
TEST(SvmmHostile, DamageIsFound) {
  std::mt19937 random(1);
  int found = 0;
  for (const Case& c : cases())
    for (int i = 0; i < std::min(mutations(), 2000); ++i) {
      Bytes file = c.file;
      damage(file, 0, file.size(), random() % 2, random);
      const Answer answer = attack(file);
      ASSERT_EQ(answer.fault, "") << c.name << ", mutation " << i;
      if (answer.checked) {
        ASSERT_EQ(answer.levels, c.answer.levels) << c.name << ", mutation " << i;
      } else {
        ++found;
      }
    }
  EXPECT_GT(found, 1000);
}

/// With every checksum made right the decoder itself is attacked.
TEST(SvmmHostile, ResealedDamageIsAnsweredSoundly) {
  std::mt19937 random(2);
  int opened = 0, refused = 0, refused_late = 0;
  for (const Case& c : cases()) {
    const auto table = table_of(c.file);
    // The volume and the parameters are the last two chunks.
    const size_t volume = load_le<uint64_t>(&c.file[table.offset + 64 * (table.entries - 2) + 16]);
    for (int i = 0; i < mutations(); ++i) {
      Bytes file = c.file;
      switch (i % 4) {
        case 0:
          damage(file, volume, table.offset, true, random);
          break;
        case 1:
          damage(file, table.offset, file.size(), true, random);
          break;
        default:
          damage(file, 64, volume, true, random);
      }
      i % 8 == 1 ? voxkit::test::repair(file) : reseal(file);
      const Answer answer = attack(file);
      ASSERT_EQ(answer.fault, "") << c.name << ", mutation " << i;
      ++(answer.checked ? opened : answer.opened ? refused_late : refused);
    }
  }
  EXPECT_GT(opened, 1000);
  EXPECT_GT(refused, 1000);
  EXPECT_GT(refused_late, 1000);
}

/// A file made by hand: anything but what goes into its chunks is right.
struct Forged {
  VolumeInfo info;
  Params params;
  std::vector<Level> levels;
  struct Chunk {
    uint32_t kind, index;
    uint64_t part;
    Bytes bytes;
  };
  std::vector<Chunk> chunks;                                 // of blocks
  std::function<void(Bytes&)> change_volume, change_params;  // of their packed bytes

  Forged(const VolumeInfo& i, const Params& p) : info(i), params(p), levels(plan_levels(info, params)) {}
  Bytes file() const {
    Bytes out;
    ContainerWriter writer(
        [&](std::span<const std::byte> bytes) {
          out.insert(out.end(), bytes.begin(), bytes.end());
          return Status{};
        },
        Codec::svmm);
    for (const Chunk& c : chunks) EXPECT_TRUE(writer.add(c.kind, c.index, c.part, c.bytes));
    Bytes volume = pack_volume_info(info), packed = pack_params(params, levels);
    if (change_volume) change_volume(volume);
    if (change_params) change_params(packed);
    EXPECT_TRUE(writer.add(volume_info_kind, 0, 0, volume));
    EXPECT_TRUE(writer.add(params_kind, 0, 0, packed));
    EXPECT_TRUE(writer.finish());
    return out;
  }
};

constexpr uint64_t byte_of_params(size_t level, size_t offset) {
  return 64 + 64 * level + offset;
}

/// 4^3 voxels of DENSITY8 in blocks of 2^3 under a root of 2^3: 8 blocks of 8 bytes, and a root of 8 + 8
/// bytes.
Forged two_levels() {
  Forged forged(make_info({4, 4, 4}, VoxelFormat::density8), make_params(VoxelFormat::density8, 100, {2}, 2));
  forged.levels[0].blocks = 8;
  Bytes base, root;
  for (int i = 0; i < 64; ++i) base.push_back(static_cast<std::byte>(3 * i));
  for (int i = 0; i < 8; ++i) root.push_back(static_cast<std::byte>(24 * i + 11));
  root.resize(16);
  store_le(&root[8], pack_link({0, 0xff}));
  forged.chunks = {{blocks_kind, 0, 0, base}, {blocks_kind, 1, 0, root}};
  return forged;
}

void expect_refused_at_opening(const Forged& forged, const std::string& word) {
  const Bytes file = forged.file();
  const auto keep = std::make_shared<const Bytes>(file);
  const auto container = Container::open(*keep, "forged", keep);
  ASSERT_TRUE(container) << container.error().what;
  const auto volume = Volume::open(*container);
  ASSERT_FALSE(volume) << word;
  EXPECT_EQ(volume.error().code, ErrorCode::input);
  EXPECT_NE(volume.error().what.find(word), std::string::npos) << volume.error().what;
  EXPECT_EQ(attack(file).fault, "");
}

void expect_valid(const Forged& forged) {
  const Answer answer = attack(forged.file());
  EXPECT_EQ(answer.fault, "");
  EXPECT_TRUE(answer.opened);
  EXPECT_TRUE(answer.checked);
}

/// Opens, but neither check() nor decoding all of it succeeds.
void expect_refused_later(const Forged& forged, bool decodes = false) {
  const Answer answer = attack(forged.file());
  EXPECT_EQ(answer.fault, "");
  EXPECT_TRUE(answer.opened);
  EXPECT_FALSE(answer.checked);
  EXPECT_EQ(!answer.levels.empty(), decodes);
}

TEST(SvmmHostile, TheForgedFileIsValid) {
  expect_valid(two_levels());
}

TEST(SvmmHostile, LinksPastTheEnd) {
  const uint64_t firsts[] = {1, 7, 8, 9, uint64_t{1} << 32, (uint64_t{1} << 56) - 1, (uint64_t{1} << 56) - 8};
  for (uint64_t first : firsts) {
    Forged forged = two_levels();
    store_le(&forged.chunks[1].bytes[8], pack_link({first, 0xff}));
    expect_refused_later(forged);
  }
}

TEST(SvmmHostile, BlocksThatAreNoOnesOrTwoVoxelsChild) {
  Forged unreached = two_levels();
  store_le(&unreached.chunks[1].bytes[8], pack_link({0, 0x7f}));
  expect_refused_later(unreached, true);

  // Two subblocks of a root of 4 x 2 x 2 with the same children.
  Forged shared(make_info({8, 4, 4}, VoxelFormat::density8), make_params(VoxelFormat::density8, 100, {2}, 4));
  shared.levels[0].blocks = 16;
  Bytes root(32);
  store_le(&root[16], pack_link({0, 0xff}));
  store_le(&root[24], pack_link({0, 0xff}));
  shared.chunks = {{blocks_kind, 0, 0, Bytes(128)}, {blocks_kind, 1, 0, root}};
  expect_refused_later(shared, true);
  store_le(&shared.chunks[1].bytes[24], pack_link({8, 0xff}));
  expect_valid(shared);
}

TEST(SvmmHostile, CountsThatNothingBacks) {
  const uint64_t counts[] = {0,
                             1,
                             7,
                             9,
                             16,
                             uint64_t{1} << 17,
                             uint64_t{1} << 32,
                             uint64_t{1} << 60,
                             uint64_t{1} << 61,
                             uint64_t{1} << 63,
                             ~uint64_t{0}};
  for (uint64_t count : counts) {
    Forged forged = two_levels();
    forged.levels[0].blocks = count;
    expect_refused_at_opening(forged, "blocks");
  }
  for (uint64_t count : {uint64_t{0}, uint64_t{2}, ~uint64_t{0}}) {
    Forged forged = two_levels();
    forged.levels[1].blocks = count;
    expect_refused_at_opening(forged, "level 1 does not follow");
  }
  for (uint32_t count : {0u, 1u, 3u, 33u, 34u, 0x4000000u, 0x80000000u, ~0u}) {
    Forged forged = two_levels();
    forged.change_params = [count](Bytes& b) { store_le(&b[4], count); };
    expect_refused_at_opening(forged, "levels");
    forged.change_params = [count](Bytes& b) {
      store_le(&b[4], count);
      b.resize(64 + 64 * size_t{std::min(count, 100u)});
    };
    expect_refused_at_opening(forged, "chunk SVMP");
  }
}

TEST(SvmmHostile, ParametersThatDoNotFollow) {
  struct Change {
    size_t at;
    uint64_t value;
    int bytes;
    const char* word;
  };
  const Change changes[] = {
      {0, 0, 1, "layout"},
      {0, 3, 1, "layout"},
      {0, 1, 1, "does not follow"},  // thesis
      {1, 0, 1, "base"},
      {1, 6, 1, "base"},
      {1, 3, 1, "alpha"},
      {1, 4, 1, "gray"},
      {1, 5, 1, "bc1"},
      {1, 2, 1, "does not follow"},  // bitmap: other sizes
      {2, 0, 1, "bound"},
      {2, 3, 1, "bound"},
      {3, 2, 1, "alpha"},
      {8, 0, 8, "rootwidth"},
      {8, 4, 8, "levels"},
      {8, uint64_t{1} << 63, 8, "levels"},
      {8, ~uint64_t{0}, 8, "levels"},
      {byte_of_params(0, 0), 0, 4, "blockwidth"},
      {byte_of_params(0, 0), 1, 4, "blockwidth"},
      {byte_of_params(0, 0), 3, 4, "blockwidth"},
      {byte_of_params(0, 0), 4, 4, "does not follow"},
      {byte_of_params(0, 0), 1024, 4, "does not follow"},
      {byte_of_params(0, 0), 2048, 4, "blockwidth"},
      {byte_of_params(0, 0), 0x80000000, 4, "blockwidth"},
      {byte_of_params(0, 0), 0xffffffff, 4, "blockwidth"},
      {byte_of_params(1, 0), 2, 4, "level 1 does not follow"},
      {byte_of_params(0, 4), 0, 4, "level 0 does not follow"},
      {byte_of_params(0, 4), 16, 4, "level 0 does not follow"},
      {byte_of_params(0, 4), 63, 4, "level 0 does not follow"},
      {byte_of_params(0, 4), 64, 4, "level 0 does not follow"},
      {byte_of_params(0, 4), 0xffffffff, 4, "level 0 does not follow"},
      {byte_of_params(0, 8), 0, 8, "level 0 does not follow"},
      {byte_of_params(1, 8), 4, 8, "level 1 does not follow"},
      {byte_of_params(1, 8), ~uint64_t{0}, 8, "level 1 does not follow"},
      {byte_of_params(0, 16), 5, 8, "level 0 does not follow"},
      {byte_of_params(0, 32), 0, 8, "level 0 does not follow"},
      {byte_of_params(1, 24), uint64_t{1} << 63, 8, "level 1 does not follow"},
      {byte_of_params(0, 48), 0, 8, "level 0 does not follow"},
      {byte_of_params(0, 48), ~uint64_t{0}, 8, "level 0 does not follow"},
      {byte_of_params(1, 48), 15, 8, "level 1 does not follow"},
  };
  for (const Change& change : changes) {
    Forged forged = two_levels();
    forged.change_params = [&](Bytes& b) {
      for (int i = 0; i < change.bytes; ++i)
        b[change.at + static_cast<size_t>(i)] = static_cast<std::byte>(change.value >> (8 * i));
    };
    SCOPED_TRACE(testing::Message() << "byte " << change.at << " value " << change.value);
    expect_refused_at_opening(forged, change.word);
  }
  for (double bad : {std::nan(""), -std::nan(""), HUGE_VAL, -HUGE_VAL, -1.0}) {
    Forged forged = two_levels();
    forged.change_params = [bad](Bytes& b) { store_le(&b[24], bad); };
    expect_refused_at_opening(forged, "delta");
    forged.change_params = [bad](Bytes& b) { store_le(&b[32], bad); };
    expect_refused_at_opening(forged, "full scale");
  }
  Forged no_scale = two_levels();
  no_scale.change_params = [](Bytes& b) { store_le(&b[32], 0.0); };
  expect_refused_at_opening(no_scale, "full scale");
  for (size_t length : {0u, 1u, 63u, 64u, 65u, 128u, 191u, 193u, 256u}) {
    Forged forged = two_levels();
    forged.change_params = [length](Bytes& b) { b.resize(length); };
    expect_refused_at_opening(forged, "chunk SVMP");
  }
}

TEST(SvmmHostile, ChunksThatAreMissingTwiceOrOfAnotherLength) {
  const auto with = [](const std::function<void(std::vector<Forged::Chunk>&)>& change) {
    Forged forged = two_levels();
    change(forged.chunks);
    return forged;
  };
  using Chunks = std::vector<Forged::Chunk>;
  expect_refused_at_opening(with([](Chunks& c) { c.erase(c.begin()); }), "level 0 lacks 8");
  expect_refused_at_opening(with([](Chunks& c) { c.pop_back(); }), "level 1 lacks 1");
  expect_refused_at_opening(with([](Chunks& c) { c.push_back(c[0]); }), "BLKS 0.0");
  expect_refused_at_opening(with([](Chunks& c) { c.push_back(c[1]); }), "BLKS 1.0");
  expect_refused_at_opening(with([](Chunks& c) { c[0].part = 1; }), "BLKS 0.1");
  expect_refused_at_opening(with([](Chunks& c) { c[0].part = ~uint64_t{0}; }), "BLKS");
  expect_refused_at_opening(with([](Chunks& c) { c[0].index = 1; }), "level 0 lacks 8");
  expect_refused_at_opening(with([](Chunks& c) { c[0].index = 2; }), "BLKS 2.0");
  expect_refused_at_opening(with([](Chunks& c) { c[0].index = ~0u; }), "BLKS");
  expect_refused_at_opening(with([](Chunks& c) { c.push_back({blocks_kind, 0, 1, {}}); }), "BLKS 0.1");
  expect_refused_at_opening(with([](Chunks& c) { c.push_back({blocks_kind, 0, 1, Bytes(8)}); }), "BLKS 0.1");
  for (size_t length : {0u, 1u, 56u, 63u, 65u, 72u, 1000u})
    expect_refused_at_opening(with([&](Chunks& c) { c[0].bytes.resize(length); }), "8 blocks of 8");
  for (size_t length : {0u, 8u, 15u, 17u, 32u})
    expect_refused_at_opening(with([&](Chunks& c) { c[1].bytes.resize(length); }), "1 blocks of 16");
  // The volume and the parameters: exactly one each, index and part 0.
  for (uint32_t kind : {volume_info_kind, params_kind}) {
    expect_refused_at_opening(with([&](Chunks& c) {
                                c.push_back({kind, 0, 0, Bytes(112)});
                              }),
                              "expected one chunk");
    expect_refused_at_opening(with([&](Chunks& c) {
                                c.push_back({kind, 1, 0, Bytes(112)});
                              }),
                              "expected one chunk");
    for (size_t field : {4u, 8u}) {
      Bytes file = two_levels().file();
      const auto table = table_of(file);
      const size_t entry = table.offset + 64 * (kind == volume_info_kind ? 2 : 3);
      file[entry + field] = std::byte{1};
      reseal(file);
      const Answer answer = attack(file);
      EXPECT_EQ(answer.fault, "");
      EXPECT_FALSE(answer.opened);
    }
  }
  // Kinds that nobody knows are ignored, and chunks may come in any order.
  expect_valid(with([](Chunks& c) {
    c.insert(c.begin(), {chunk_kind("zzzz"), 0, 0, Bytes(77)});
    c.insert(c.begin() + 2, {chunk_kind("BLKT"), 0, 0, Bytes(3)});
    c.push_back({chunk_kind("zzzz"), 0, 0, Bytes(77)});
  }));
  expect_valid(with([](Chunks& c) { std::swap(c[0], c[1]); }));
}

TEST(SvmmHostile, PartsInAnyOrder) {
  // 2^18 blocks of 8 bytes, 2^17 a chunk.
  Forged forged(make_info({128, 128, 128}, VoxelFormat::density8),
                make_params(VoxelFormat::density8, 100, {2}, 64));
  ASSERT_EQ(forged.levels.size(), 2u);
  forged.levels[0].blocks = uint64_t{1} << 18;
  Bytes root(forged.levels[1].block_bytes);
  for (uint64_t s = 0; s < 1 << 15; ++s) store_le(&root[(1 << 18) + 8 * s], pack_link({8 * s, 0xff}));
  forged.chunks = {{blocks_kind, 0, 1, Bytes(1 << 20, std::byte{9})},
                   {blocks_kind, 1, 0, root},
                   {blocks_kind, 0, 0, Bytes(1 << 20, std::byte{4})}};
  const Answer answer = attack(forged.file());
  EXPECT_EQ(answer.fault, "");
  EXPECT_TRUE(answer.checked);
  ASSERT_EQ(answer.levels.size(), 2u);
  EXPECT_EQ(answer.levels[0].front(), std::byte{4});
  EXPECT_EQ(answer.levels[0].back(), std::byte{9});
  for (uint64_t part : {uint64_t{0}, uint64_t{2}, ~uint64_t{0}}) {
    forged.chunks[0].part = part;
    expect_refused_at_opening(forged, "once each");
  }
}

/// Nothing here may be allocated, or visited voxel by voxel.
TEST(SvmmHostile, VolumesOfTheGreatestSize) {
  const int64_t side = max_side;
  for (VoxelFormat f : all_formats)
    for (Layout layout : {Layout::plain, Layout::thesis})
      for (int width : {2, 64, 1024})
        for (Index3 dims : {Index3(side, side, 1), Index3(1, side, side), Index3(side, 1, 2),
                            Index3(side - 1, 3, side / 4)}) {
          const VolumeInfo info = make_info(dims, f);
          const Params params = make_params(f, 90, {width}, 2, layout);
          if (!validate(params, info)) continue;
          Forged forged(info, params);
          const Level root = forged.levels.back();
          if (root.block_bytes > 1 << 20) continue;  // layout thesis ends at the thinnest side
          Bytes bytes(root.block_bytes);
          if (layout == Layout::thesis)  // all terminal
            for (size_t i = 0; i < bytes.size(); i += static_cast<size_t>(word_bytes(f)))
              bytes[i] = std::byte{0x10};
          forged.chunks = {{blocks_kind, static_cast<uint32_t>(forged.levels.size() - 1), 0, bytes}};
          SCOPED_TRACE(testing::Message()
                       << name(f) << " width " << width << " " << dims.x << "x" << dims.y << "x" << dims.z);
          expect_valid(forged);
        }
}

TEST(SvmmHostile, RootsWhoseSizeOverflows) {
  const int64_t side = max_side;
  for (VoxelFormat f : all_formats)
    for (Layout layout : {Layout::plain, Layout::thesis})
      for (Index3 dims :
           {Index3(side, side, 1), Index3(side, 1, side), Index3(1, side, side), Index3(side, side - 1, 1),
            Index3(side, side / 2, 2), Index3(side / 2, side / 2, 4)})
        for (int64_t rootwidth : {side / 2, side, int64_t{1} << 62}) {
          const VolumeInfo info = make_info(dims, f);
          const Params params = make_params(f, 90, {2}, rootwidth, layout);
          if (!validate(params, info)) continue;
          Forged forged(info, params);
          EXPECT_GT(forged.levels.back().block_bytes, uint64_t{1} << 50);
          for (size_t bytes : {0u, 64u}) {
            forged.chunks = {{blocks_kind, static_cast<uint32_t>(forged.levels.size() - 1), 0, Bytes(bytes)}};
            expect_refused_at_opening(forged, "1 blocks of");
          }
          const size_t last = forged.levels.size() - 1;
          forged.change_params = [last](Bytes& b) { store_le(&b[byte_of_params(last, 48)], uint64_t{0}); };
          expect_refused_at_opening(forged, "does not follow");
          // Encoding such a volume is refused as well.
          voxkit::test::FlatSource source(info, {});
          Context ctx = context();
          const auto encoded = encode(
              source, params, [](auto) { return Status{}; }, ctx);
          ASSERT_FALSE(encoded);
          EXPECT_EQ(encoded.error().code, ErrorCode::limit);
        }
}

TEST(SvmmHostile, RootsOfAnyWidthThatTheFileCanSay) {
  for (uint64_t width : {uint64_t{4}, uint64_t{1} << 62, uint64_t{1} << 63, ~uint64_t{0}}) {
    Forged forged(make_info({4, 4, 4}, VoxelFormat::density8),
                  make_params(VoxelFormat::density8, 100, {2}, 4));
    ASSERT_EQ(forged.levels.size(), 1u);
    forged.chunks = {{blocks_kind, 0, 0, Bytes(64)}};
    forged.change_params = [width](Bytes& b) { store_le(&b[8], width); };
    expect_valid(forged);
  }
}

TEST(SvmmHostile, OneLevelHasBaseRaw) {
  for (VoxelFormat f : all_formats)
    for (int base = 2; base <= 5; ++base) {
      Forged forged(make_info({4, 4, 4}, f), make_params(f, 100, {}, 4));
      forged.chunks = {{blocks_kind, 0, 0, Bytes(forged.levels[0].block_bytes)}};
      forged.change_params = [base](Bytes& b) { b[1] = static_cast<std::byte>(base); };
      expect_refused_at_opening(forged, "base");
    }
}

TEST(SvmmHostile, DimensionsOfTheVolumeChunkRule) {
  for (Index3 dims :
       {Index3(0, 4, 4), Index3(4, 4, 5), Index3(2, 4, 4), Index3(-4, 4, 4), Index3(max_side, 4, 4),
        Index3(max_side + 1, 1, 1), Index3(max_side), Index3(int64_t{1} << 62, 1, 1)}) {
    Forged forged = two_levels();
    forged.change_volume = [dims](Bytes& b) {
      for (int i = 0; i < 3; ++i) store_le(&b[static_cast<size_t>(8 * i)], static_cast<uint64_t>(dims[i]));
    };
    expect_refused_at_opening(forged, "chunk");
  }
  // An odd side that rounds up to the same levels is another valid volume.
  Forged odd = two_levels();
  odd.change_volume = [](Bytes& b) { store_le(&b[0], uint64_t{3}); };
  expect_valid(odd);
}

}  // namespace
}  // namespace voxkit::svmm
