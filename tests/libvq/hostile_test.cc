// Damaged and invented VQ files: whatever the bytes, an error or a well-formed answer.
#include <cstdlib>

#include "formats/volume_chunks.h"
#include "libvq/layout.h"
#include "tests/damage.h"
#include "tests/libvq/attack.h"
#include "tests/libvq/volumes.h"

namespace voxkit::vq {
namespace {

using namespace voxkit::vq::test;
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

/// Small volumes of every kind in every layout.
const std::vector<Case>& cases() {
  static const std::vector<Case> all = [] {
    std::vector<Case> made;
    uint32_t seed = 0;
    const std::pair<SampleType, int> types[] = {{SampleType::u8, 8},
                                                {SampleType::i16, 16},
                                                {SampleType::u16, 11},
                                                {SampleType::f32, 12},
                                                {SampleType::bit, 1}};
    for (const auto& [type, bits] : types)
      for (int layout = 0; layout < 4; ++layout)
        for (const Content content : {Content::noise, Content::scan}) {
          Options options;
          if (layout == 1) options.mapping = Mapping::direct;
          if (layout == 2) options.mapping = Mapping::indirect;
          if (layout == 3) options.codebook = Codebook::packed;
          if (layout == 0 && type != SampleType::f32) options.max_error = 1;
          options.range = {-3, 1100};
          const Index3 dims = content == Content::noise ? Index3(9, 6, 5) : Index3(21, 5, 6);
          const VolumeInfo info = voxkit::test::scalar_info(dims, type);
          Case c;
          c.name =
              fmt::format("{} layout {} content {}", name(info.format), layout, static_cast<int>(content));
          c.file = encode_to_memory(info, make_voxels(info, content, bits, ++seed), options).bytes;
          c.answer = attack(c.file);
          made.push_back(std::move(c));
        }
    return made;
  }();
  return all;
}

TEST(VqHostile, TheFilesAreValid) {
  EXPECT_EQ(cases().size(), 40u);
  for (const Case& c : cases()) {
    EXPECT_EQ(c.answer.fault, "") << c.name;
    EXPECT_TRUE(c.answer.checked) << c.name;
    EXPECT_TRUE(c.answer.voxels) << c.name;
  }
}

TEST(VqHostile, EveryPrefixAndOneByteMoreIsRefused) {
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
TEST(VqHostile, DamageIsFound) {
  std::mt19937 random(1);
  int found = 0;
  for (const Case& c : cases())
    for (int i = 0; i < std::min(mutations(), 2000); ++i) {
      Bytes file = c.file;
      damage(file, 0, file.size(), random() % 2, random);
      const Answer answer = attack(file);
      ASSERT_EQ(answer.fault, "") << c.name << ", mutation " << i;
      if (answer.checked) {
        ASSERT_EQ(answer.voxels, c.answer.voxels) << c.name << ", mutation " << i;
      } else {
        ++found;
      }
    }
  EXPECT_GT(found, 1000);
}

/// With every checksum made right the decoder itself is attacked.
TEST(VqHostile, ResealedDamageIsAnsweredSoundly) {
  std::mt19937 random(2);
  int opened = 0, refused = 0, refused_late = 0;
  for (const Case& c : cases()) {
    const auto table = table_of(c.file);
    // The volume and the parameters are the first two chunks.
    const size_t contents = load_le<uint64_t>(&c.file[table.offset + 64 * 2 + 16]);
    for (int i = 0; i < mutations(); ++i) {
      Bytes file = c.file;
      switch (i % 4) {
        case 0:
          damage(file, 64, contents, true, random);
          break;
        case 1:
          damage(file, table.offset, file.size(), true, random);
          break;
        default:
          damage(file, contents, table.offset, true, random);
      }
      i % 8 == 1 ? voxkit::test::repair(file, Codec::vq) : reseal(file);
      const Answer answer = attack(file);
      ASSERT_EQ(answer.fault, "") << c.name << ", mutation " << i;
      ++(answer.checked ? opened : answer.opened ? refused_late : refused);
    }
  }
  EXPECT_GT(opened, 1000);
  EXPECT_GT(refused, 1000);
  EXPECT_GT(refused_late, 1000);
}

/// A file made by hand: 12 x 4 x 4 voxels of 8 bits in three bricks, constant 3, codeword, constant 9.
struct Chunks {
  VolumeInfo info = integer_info({12, 4, 4}, 8);
  Bytes params, offsets, addresses, codebook;
  bool indirect;

  explicit Chunks(bool is_indirect) : indirect(is_indirect) {
    Params p;
    p.mapping = indirect ? Mapping::indirect : Mapping::direct;
    p.bits = 8;
    p.codewords = 3;
    params = pack_params(p, 0);
    // One block. Its first entry is 0, the common brick; the others count from the second brick.
    const uint32_t base = indirect ? 1 : 2, third = indirect ? 2 : 6, width = indirect ? 2 : 3;
    offsets.resize(16 + size_t{8} * width);
    store_le(&offsets[0], base);
    store_le(&offsets[4], uint32_t{2});
    store_le(&offsets[12], 2 + width);
    store_le(&offsets[16], 1u << width | third << (2 * width));
    // In the middle 5 and 6: no transform, c2 = 1, and one bit a voxel in the last octant, whose voxels
    // are 6.
    for (const int b : {3, 3, 5, 6, 0x01, 0x80, 0xff, 9, 9}) codebook.push_back(static_cast<std::byte>(b));
    if (indirect) {
      addresses.resize(group_bytes);
      addresses[8] = std::byte{2};
      addresses[9] = std::byte{5};
      addresses[10] = std::byte{2};
    }
  }
  Bytes file() const {
    Bytes out;
    ContainerWriter writer(
        [&](std::span<const std::byte> b) {
          out.insert(out.end(), b.begin(), b.end());
          return Status{};
        },
        Codec::vq);
    EXPECT_TRUE(writer.add(volume_info_kind, 0, 0, pack_volume_info(info)));
    EXPECT_TRUE(writer.add(params_kind, 0, 0, params));
    EXPECT_TRUE(writer.add(offsets_kind, 0, 0, offsets));
    if (indirect) {
      EXPECT_TRUE(writer.add(addresses_kind, 0, 0, addresses));
    }
    EXPECT_TRUE(writer.add(codebook_kind, 0, 0, codebook));
    EXPECT_TRUE(writer.finish());
    return out;
  }
};

TEST(VqHostile, AFileMadeByHand) {
  for (const bool indirect : {false, true}) {
    const Answer answer = attack(Chunks(indirect).file());
    EXPECT_EQ(answer.fault, "");
    EXPECT_TRUE(answer.checked);
    Bytes expected;
    for (int i = 0; i < 12 * 4 * 4; ++i) {
      const int x = i % 12, y = i / 12 % 4, z = i / 48;
      expected.push_back(static_cast<std::byte>(x < 4 ? 3 : x >= 8 ? 9 : x >= 6 && y >= 2 && z >= 2 ? 6 : 5));
    }
    EXPECT_EQ(answer.voxels, expected);
  }
}

/// Values that the voxels cannot hold become the nearest that they can, in boxes as in single voxels.
TEST(VqHostile, ValuesBeyondTheFormat) {
  const auto codes = attack(Chunks(true).file()).voxels;
  ASSERT_TRUE(codes);
  for (const double base :
       {0.0, 1.0, 246.0, 250.0, 254.0, 255.0, 256.0, 65535.0, 131070.0, -1.0, -5.0, -300.0})
    for (const double step : {1.0, 2.0, 40.0, 131071.0}) {
      Chunks chunks(true);
      std::memcpy(&chunks.params[24], &base, sizeof base);
      std::memcpy(&chunks.params[32], &step, sizeof step);
      const Answer answer = attack(chunks.file());
      EXPECT_EQ(answer.fault, "");
      Bytes expected;
      for (const std::byte code : *codes) {
        const double value = base + step * std::to_integer<int>(code);
        expected.push_back(static_cast<std::byte>(std::clamp(value, 0.0, 255.0)));
      }
      EXPECT_EQ(answer.voxels, expected) << "base " << base << ", step " << step;
    }
}

/// Each field that readers check, with a value that they refuse: when opening, or when it is used.
TEST(VqHostile, FieldsThatAreRefused) {
  enum class Where { params, offsets, addresses, codebook };
  const struct {
    const char* what;
    bool indirect;
    Where where;
    size_t at;
    int bytes;
    uint64_t value;
    bool opens;
  } cases[] = {
      {"codebook 0", true, Where::params, 0, 1, 0, false},
      {"codebook 3", true, Where::params, 0, 1, 3, false},
      {"packed, but chunks as they are", true, Where::params, 0, 1, 2, false},
      {"mapping 0", true, Where::params, 1, 1, 0, false},
      {"mapping 3", true, Where::params, 1, 1, 3, false},
      {"direct, with a table", true, Where::params, 1, 1, 1, false},
      {"indirect, without a table", false, Where::params, 1, 1, 2, false},
      {"0 bits", true, Where::params, 2, 1, 0, false},
      {"17 bits", true, Where::params, 2, 1, 17, false},
      {"no codewords", true, Where::params, 8, 8, 0, false},
      {"more codewords than bricks", true, Where::params, 8, 8, 4, false},
      {"endless codewords", true, Where::params, 8, 8, ~uint64_t{0}, false},
      {"base of a half", true, Where::params, 24, 8, 0x3fe0000000000000, false},
      {"base of no number", true, Where::params, 24, 8, 0x7ff8000000000000, false},
      {"base too large", true, Where::params, 24, 8, 0x40ffffe000000000 + (1u << 30), false},
      {"step 0", true, Where::params, 32, 8, 0, false},
      {"infinite step", true, Where::params, 32, 8, 0x7ff0000000000000, false},
      {"common brick that is not there", true, Where::params, 16, 8, 3, true},
      {"common brick within another", false, Where::params, 16, 8, 1, true},
      {"entries that begin in the headers", true, Where::offsets, 4, 4, 1, true},
      {"entries that end before they begin", true, Where::offsets, 12, 4, 1, true},
      {"entries that end behind the chunk", true, Where::offsets, 12, 4, 5, true},
      {"an entry that is too large", true, Where::offsets, 16, 1, 0x34, true},
      {"a base that is too large", true, Where::offsets, 0, 4, 0xffffffff, true},
      {"a direct base that is too large", false, Where::offsets, 0, 4, 0xffffffff, true},
      {"a direct address within a brick", false, Where::offsets, 0, 4, 3, true},
      {"a group that begins elsewhere", true, Where::addresses, 0, 8, 1, true},
      {"a group that begins far away", true, Where::addresses, 0, 8, ~uint64_t{0}, true},
      {"a length that is too small", true, Where::addresses, 9, 1, 4, true},
      {"a length that is too large", true, Where::addresses, 10, 1, 3, true},
      {"a range upside down", true, Where::codebook, 2, 1, 7, true},
      {"a range that is too wide", true, Where::codebook, 3, 1, 7, true},
      {"c2 of 6", true, Where::codebook, 4, 1, 6, true},
      {"a codeword that is too long", true, Where::codebook, 4, 1, 5, true},
      {"an escape of too few bytes", true, Where::codebook, 4, 1, 255, true},
      {"a constant brick with a codeword", true, Where::codebook, 3, 1, 5, true},
  };
  for (const auto& c : cases) {
    Chunks chunks(c.indirect);
    Bytes& bytes = c.where == Where::params      ? chunks.params
                   : c.where == Where::offsets   ? chunks.offsets
                   : c.where == Where::addresses ? chunks.addresses
                                                 : chunks.codebook;
    std::memcpy(&bytes[c.at], &c.value, static_cast<size_t>(c.bytes));
    const Answer answer = attack(chunks.file());
    EXPECT_EQ(answer.fault, "") << c.what;
    EXPECT_EQ(answer.opened, c.opens) << c.what;
    EXPECT_FALSE(answer.checked) << c.what;
  }
}

TEST(VqHostile, ChunksThatAreRefused) {
  const auto refused = [](const Chunks& chunks) {
    const Answer answer = attack(chunks.file());
    EXPECT_EQ(answer.fault, "");
    return !answer.opened;
  };
  for (const bool indirect : {false, true}) {
    Chunks chunks(indirect);
    EXPECT_FALSE(refused(chunks));
    chunks.params.push_back({});
    EXPECT_TRUE(refused(chunks));
    chunks = Chunks(indirect);
    chunks.offsets.resize(15);
    EXPECT_TRUE(refused(chunks));
    chunks.offsets.resize(16 + 257);
    EXPECT_TRUE(refused(chunks));
    chunks = Chunks(indirect);
    chunks.codebook.clear();
    EXPECT_TRUE(refused(chunks));
    chunks.codebook.resize((size_t{1} << 20) + 1);
    EXPECT_TRUE(refused(chunks));
    chunks = Chunks(indirect);
    chunks.info.format = VoxelFormat::rgba32;
    EXPECT_TRUE(refused(chunks));
    chunks = Chunks(indirect);
    chunks.info.dims.x = 17 * 16 * 4096;
    EXPECT_TRUE(refused(chunks));
  }
  Chunks chunks(true);
  chunks.addresses.push_back({});
  EXPECT_TRUE(refused(chunks));
  chunks = Chunks(true);
  chunks.indirect = false;  // the table is left out
  EXPECT_TRUE(refused(chunks));
  chunks = Chunks(false);
  chunks.indirect = true;  // a table too many
  chunks.addresses.resize(group_bytes);
  EXPECT_TRUE(refused(chunks));

  // A file of the other codec.
  Bytes file = Chunks(true).file();
  voxkit::test::repair(file, Codec::svmm);
  EXPECT_FALSE(attack(file).opened);
}

}  // namespace
}  // namespace voxkit::vq
