#include "formats/container.h"
#include "formats/volume_chunks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "tests/damage.h"

namespace voxkit {
namespace {

using test::Bytes;

constexpr uint32_t kind_a = chunk_kind("AAAA"), kind_b = chunk_kind("BBBB"), kind_c = chunk_kind("CCCC");

Bytes pattern(size_t count, int seed) {
  Bytes bytes;
  for (size_t i = 0; i < count; ++i)
    bytes.push_back(static_cast<std::byte>(i * i / 3 + static_cast<size_t>(seed)));
  return bytes;
}

/// The container of small things: header 0, AAAA 64 (100 bytes), BBBB 192 (none), CCCC 192 (64), AAAA 256
/// (1), table 320.
constexpr size_t table_at = 320, file_size = 320 + 4 * 64 + 64;
Bytes small_file() {
  Bytes file;
  ContainerWriter writer(
      [&](std::span<const std::byte> bytes) {
        file.insert(file.end(), bytes.begin(), bytes.end());
        return Status{};
      },
      Codec::svmm);
  EXPECT_TRUE(writer.add(kind_a, 0, 0, pattern(100, 1)));
  EXPECT_TRUE(writer.add(kind_b, 7, 0, {}));
  EXPECT_TRUE(writer.add(kind_c, 0, 0, pattern(64, 2)));
  EXPECT_TRUE(writer.add(kind_a, 0, uint64_t{1} << 40, pattern(1, 3)));
  EXPECT_TRUE(writer.finish());
  EXPECT_EQ(writer.bytes_written(), file.size());
  return file;
}

/// The file in a buffer of exactly its size, so that a sanitizer sees a read past the end.
Result<std::shared_ptr<const Container>> open(const Bytes& file) {
  const auto bytes = std::make_shared<const Bytes>(file.begin(), file.end());
  return Container::open(*bytes, "test.svmm", bytes);
}

void expect_refused(const Bytes& file, const std::string& word = {}) {
  const auto container = open(file);
  ASSERT_FALSE(container);
  EXPECT_EQ(container.error().code, ErrorCode::input);
  EXPECT_EQ(container.error().file, "test.svmm");
  EXPECT_NE(container.error().what.find(word), std::string::npos) << container.error().what;
  EXPECT_EQ(container.error().what.find('\n'), std::string::npos);
}

TEST(Container, RoundTrip) {
  const Bytes file = small_file();
  ASSERT_EQ(file.size(), file_size);
  const auto container = open(file);
  ASSERT_TRUE(container) << container.error().what;
  const Container& c = **container;
  EXPECT_EQ(c.codec(), Codec::svmm);
  EXPECT_EQ(c.file_bytes(), file.size());
  ASSERT_EQ(c.table().size(), 4u);
  EXPECT_EQ(c.table()[1].index, 7u);
  EXPECT_EQ(c.table()[3].part, uint64_t{1} << 40);
  EXPECT_EQ(c.chunks_touched(), 0u);
  const Bytes expected[] = {pattern(100, 1), {}, pattern(64, 2), pattern(1, 3)};
  for (size_t i = 0; i < 4; ++i) {
    const auto chunk = c.chunk(i);
    ASSERT_TRUE(chunk);
    EXPECT_EQ(Bytes(chunk->begin(), chunk->end()), expected[i]);
    EXPECT_EQ(c.table()[i].offset % 64, 0u);
    EXPECT_EQ(c.table()[i].checksum, test::checksum(expected[i]));
  }
  ASSERT_TRUE(c.chunk(0));
  EXPECT_EQ(c.chunks_touched(), 4u);
}

TEST(Container, OfNoChunks) {
  Bytes file;
  ContainerWriter writer(
      [&](std::span<const std::byte> bytes) {
        file.insert(file.end(), bytes.begin(), bytes.end());
        return Status{};
      },
      Codec::svmm);
  ASSERT_TRUE(writer.finish());
  EXPECT_EQ(file.size(), 128u);
  const auto container = open(file);
  ASSERT_TRUE(container);
  EXPECT_TRUE((*container)->table().empty());
  EXPECT_FALSE((*container)->only_chunk(kind_a));
}

TEST(Container, AFailingSinkEndsTheWriting) {
  for (size_t room : {0u, 64u, 100u, 192u, 300u, 400u, 447u}) {
    size_t taken = 0;
    ContainerWriter writer(
        [&](std::span<const std::byte> bytes) -> Status {
          if ((taken += bytes.size()) > room) return fail(ErrorCode::output, "out", "full");
          return {};
        },
        Codec::svmm);
    Status status = writer.add(kind_a, 0, 0, pattern(100, 1));
    if (status) status = writer.add(kind_c, 0, 0, pattern(64, 2));
    if (status) status = writer.finish();
    ASSERT_FALSE(status) << room;
    EXPECT_EQ(status.error().code, ErrorCode::output);
  }
}

TEST(Container, EveryPrefixAndEveryExtraByteIsRefused) {
  const Bytes file = small_file();
  for (size_t length = 0; length < file.size(); ++length) {
    SCOPED_TRACE(length);
    expect_refused(Bytes(file.begin(), file.begin() + static_cast<ptrdiff_t>(length)));
  }
  for (int extra = 1; extra <= 192; ++extra) {
    Bytes longer = file;
    longer.resize(file.size() + static_cast<size_t>(extra));
    expect_refused(longer);
    // As if the trailer had come twice.
    if (extra == 64) std::copy(file.end() - 64, file.end(), longer.end() - 64);
    expect_refused(longer);
  }
}

TEST(Container, EveryChangedByteOfHeaderTableAndTrailerIsRefused) {
  const Bytes file = small_file();
  for (size_t at = 0; at < file.size(); at = at == 63 ? table_at : at + 1)
    for (int bits : {0x01, 0x80, 0xff}) {
      Bytes changed = file;
      changed[at] ^= static_cast<std::byte>(bits);
      SCOPED_TRACE(at);
      expect_refused(changed);
    }
}

TEST(Container, AChangedChunkIsRefusedWhenItIsTouched) {
  const Bytes file = small_file();
  for (size_t at = 64; at < table_at; ++at) {
    Bytes changed = file;
    changed[at] ^= std::byte{0x10};
    const auto container = open(changed);
    ASSERT_TRUE(container) << at;
    const Container& c = **container;
    for (size_t i = 0; i < c.table().size(); ++i) {
      const ChunkEntry& e = c.table()[i];
      const bool damaged = at >= e.offset && at < e.offset + e.length;
      for (int time = 0; time < 2; ++time) {  // and again the second time
        const auto chunk = c.chunk(i);
        EXPECT_EQ(chunk.has_value(), !damaged) << "byte " << at << " chunk " << i;
        if (!chunk) {
          EXPECT_EQ(chunk.error().code, ErrorCode::input);
          EXPECT_NE(chunk.error().what.find("checksum"), std::string::npos);
        }
      }
    }
  }
}

TEST(Container, UnknownVersionsAndCodecsAreRefused) {
  for (size_t at : {8u, 10u})
    for (uint16_t number : {uint16_t{0}, uint16_t{4}, uint16_t{0x100}, uint16_t{0xffff}}) {
      Bytes file = small_file();
      store_le(&file[at], number);
      test::reseal(file);
      expect_refused(file, at == 8 ? "version" : "codec");
    }
}

/// Changes a field of the table or trailer and makes the checksums right again.
Bytes with_field(size_t at, uint64_t value) {
  Bytes file = small_file();
  store_le(&file[at], value);
  test::reseal(file);
  return file;
}

TEST(Container, ChunksThatOverlapOrLeaveTheFileAreRefused) {
  const std::string rule = "overlaps or leaves the file";
  const auto offset = [](size_t i) { return table_at + 64 * i + 16; };
  const auto length = [](size_t i) { return table_at + 64 * i + 24; };
  const uint64_t huge[] = {uint64_t{1} << 31, uint64_t{1} << 32, uint64_t{1} << 62, uint64_t{1} << 63,
                           ~uint64_t{63}};
  expect_refused(with_field(length(0), 129), rule);            // into the next chunk that has bytes
  expect_refused(with_field(length(3), 65), rule);             // into the table
  expect_refused(with_field(offset(0), 0), rule);              // into the header
  expect_refused(with_field(offset(0), 65), rule);             // not aligned
  expect_refused(with_field(offset(3), 192), rule);            // back
  expect_refused(with_field(offset(3), table_at), rule);       // the table itself
  expect_refused(with_field(offset(3), table_at + 64), rule);  // behind it
  for (uint64_t value : huge)
    for (size_t i = 0; i < 4; ++i) {
      expect_refused(with_field(offset(i), value), rule);
      expect_refused(with_field(length(i), value), rule);
      expect_refused(with_field(length(i), value - 64), rule);
      expect_refused(with_field(length(i), 0 - load_le<uint64_t>(&small_file()[offset(i)])), rule);
    }
  // What is allowed: the whole room up to the next chunk, and bytes that no chunk has.
  EXPECT_TRUE(open(with_field(length(0), 128)));
  EXPECT_TRUE(open(with_field(length(0), 0)));
  EXPECT_FALSE(open(with_field(offset(1), 128)));  // two of them overlap that way
}

TEST(Container, TablesThatDoNotEndAtTheTrailerAreRefused) {
  const size_t trailer = file_size - 64;
  const auto seal_trailer = [&](Bytes file) {  // reseal() would look for the table where it is not
    const uint64_t at = load_le<uint64_t>(&file[trailer + 8]), count = load_le<uint64_t>(&file[trailer + 16]);
    if (at <= trailer && count <= (trailer - at) / 64)
      store_le(&file[trailer + 32], test::checksum(std::span(file).subspan(at, 64 * count)));
    store_le(&file[trailer + 56], test::checksum(std::span(file).subspan(trailer, 56)));
    return file;
  };
  const auto with = [&](uint64_t offset, uint64_t count, uint64_t length) {
    Bytes file = small_file();
    store_le(&file[trailer + 8], offset);
    store_le(&file[trailer + 16], count);
    store_le(&file[trailer + 24], length);
    return seal_trailer(file);
  };
  EXPECT_TRUE(open(with(table_at, 4, file_size)));
  for (uint64_t length : {uint64_t{0}, file_size - 64, file_size + 1, ~uint64_t{0}})
    expect_refused(with(table_at, 4, length), "file length");
  const uint64_t counts[] = {
      0, 3, 5, 1 << 20, uint64_t{1} << 58, (uint64_t{1} << 58) + 4, uint64_t{1} << 63, ~uint64_t{0}};
  for (uint64_t count : counts) expect_refused(with(table_at, count, file_size), "table");
  const uint64_t offsets[] = {0,
                              1,
                              63,
                              65,
                              table_at - 64,
                              table_at + 64,
                              table_at + 1,
                              trailer,
                              file_size,
                              uint64_t{1} << 63,
                              ~uint64_t{63},
                              ~uint64_t{0}};
  for (uint64_t offset : offsets)
    for (uint64_t count : {uint64_t{4}, (trailer - offset) / 64 + 64, uint64_t{1} << 58})
      expect_refused(with(offset, count, file_size), "table");
  // Fewer entries that do end at the trailer, the first chunk being no chunk then: that is another valid
  // file.
  EXPECT_TRUE(open(with(table_at + 64, 3, file_size)));
}

TEST(Container, TheOnlyChunkIsTheOnlyOne) {
  const auto container = open(small_file());
  ASSERT_TRUE(container);
  EXPECT_TRUE((*container)->only_chunk(kind_c));
  EXPECT_FALSE((*container)->only_chunk(kind_a)) << "there are two";
  EXPECT_FALSE((*container)->only_chunk(kind_b)) << "its index is not 0";
  EXPECT_FALSE((*container)->only_chunk(chunk_kind("DDDD"))) << "there is none";
  Bytes damaged = small_file();
  damaged[200] ^= std::byte{1};
  EXPECT_FALSE((*open(damaged))->only_chunk(kind_c));
}

TEST(Container, MessagesShowLettersOnly) {
  Bytes file = small_file();
  store_le(&file[table_at], uint32_t{0x0a1b00ff});
  store_le(&file[table_at + 24], ~uint64_t{0});
  test::reseal(file);
  expect_refused(file, "chunk ???? 0.0");
}

VolumeInfo some_info() {
  VolumeInfo info;
  info.dims = {7, 5, 3};
  info.format = VoxelFormat::density16;
  info.sample_type = SampleType::i16;
  info.affine = Affine::plain({0.5, 1, 2.25}, info.affine.origin);
  info.affine.origin = {-1, 2, 1e6};
  info.slope = 0.25;
  info.intercept = -1024;
  info.range = ValueRange{-3, 70000};
  return info;
}

TEST(VolumeInfoChunk, RoundTrip) {
  for (const bool with_range : {false, true}) {
    VolumeInfo info = some_info();
    if (!with_range) info.range.reset();
    const Bytes bytes = pack_volume_info(info);
    ASSERT_EQ(bytes.size(), 112u);
    const auto back = unpack_volume_info(bytes, {}, "test");
    ASSERT_TRUE(back);
    EXPECT_EQ(back->dims, info.dims);
    EXPECT_EQ(back->format, info.format);
    EXPECT_EQ(back->sample_type, info.sample_type);
    EXPECT_EQ(back->affine.spacing(), info.affine.spacing());
    EXPECT_EQ(back->affine.origin, info.affine.origin);
    EXPECT_EQ(back->slope, info.slope);
    EXPECT_EQ(back->intercept, info.intercept);
    EXPECT_EQ(back->range, info.range);
  }
}

TEST(VolumeInfoChunk, BadValuesAreRefused) {
  const Bytes good = pack_volume_info(some_info());
  const auto refused = [&](const std::string& word, const std::function<void(Bytes&)>& change) {
    Bytes bytes = good;
    change(bytes);
    const auto info = unpack_volume_info(bytes, {}, "test.svmm");
    ASSERT_FALSE(info) << word;
    EXPECT_EQ(info.error().code, ErrorCode::input);
    EXPECT_EQ(info.error().file, "test.svmm");
    EXPECT_NE(info.error().what.find(word), std::string::npos) << info.error().what;
  };
  for (size_t length = 0; length < 112; ++length) refused("112", [&](Bytes& b) { b.resize(length); });
  refused("112", [](Bytes& b) { b.push_back({}); });
  for (size_t axis = 0; axis < 3; ++axis) {
    for (uint64_t side :
         {uint64_t{0}, (uint64_t{1} << 31) + 1, uint64_t{1} << 32, uint64_t{1} << 63, ~uint64_t{0}})
      refused("dimensions", [&](Bytes& b) { store_le(&b[8 * axis], side); });
    for (double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), -HUGE_VAL}) {
      refused("finite", [&](Bytes& b) { store_le(&b[32 + 8 * axis], bad); });
      refused("finite", [&](Bytes& b) { store_le(&b[56 + 8 * axis], bad); });
    }
  }
  refused("dimensions", [](Bytes& b) {  // 2^93 voxels
    for (size_t axis = 0; axis < 3; ++axis) store_le(&b[8 * axis], uint64_t{1} << 31);
  });
  refused("dimensions", [](Bytes& b) {  // 2^63 voxels
    store_le(&b[0], uint64_t{1} << 31);
    store_le(&b[8], uint64_t{1} << 31);
    store_le(&b[16], uint64_t{2});
  });
  // Every pair of voxel format and sample type: just those that go together.
  const std::vector<int> types[] = {{3, 4}, {1, 2}, {5, 6, 7, 8, 9, 10}, {11}};
  const auto goes = [&](int format, int type) {
    const auto has = [&](size_t i) {
      return std::find(types[i].begin(), types[i].end(), type) != types[i].end();
    };
    switch (format) {
      case 1:
      case 2:
        return type >= 1 && type <= 11;
      case 3:
        return has(1);
      case 4:
        return has(0);
      case 5:
        return has(2);
      case 6:
        return has(3);
      default:
        return false;
    }
  };
  for (int format = 0; format < 256; ++format)
    for (int type = 0; type < 256; ++type) {
      Bytes bytes = good;
      bytes[24] = static_cast<std::byte>(format);
      bytes[25] = static_cast<std::byte>(type);
      ASSERT_EQ(unpack_volume_info(bytes, {}, "test").has_value(), goes(format, type))
          << format << " " << type;
    }
}

VolumeInfo more_info() {
  VolumeInfo info = some_info();
  info.range.reset();
  info.sample_type = SampleType::u32;
  info.affine.axes = {{{0, 2, 0}, {-3, 0, 0.5}, {0.25, 0, -4}}};
  info.world = World::lps;
  info.unit = Unit::micrometre;
  info.space_code = 4;
  info.description = "a head, of \xc2\xb5m";
  info.labels = std::make_shared<std::vector<int64_t>>(std::vector<int64_t>{0, 7, 4000000000});
  info.is_labels = true;
  info.fill = 1;
  info.rounded = true;
  return info;
}

TEST(VolumeFactsChunk, RoundTripInAFileOfVersion3) {
  const VolumeInfo info = more_info();
  EXPECT_EQ(container_version_for(info), 3);
  MemoryBudget budget;
  Bytes file;
  ContainerWriter writer(
      [&](std::span<const std::byte> bytes) -> Status {
        file.insert(file.end(), bytes.begin(), bytes.end());
        return {};
      },
      Codec::vq, container_version_for(info), 0, budget);
  ASSERT_TRUE(add_volume_info(writer, info));
  ASSERT_TRUE(writer.finish());
  EXPECT_EQ(file[8], std::byte{3});
  const auto container = Container::open(file, "test", nullptr);
  ASSERT_TRUE(container);
  const auto back = read_volume_info(**container);
  ASSERT_TRUE(back) << back.error().what;
  EXPECT_EQ(back->affine, info.affine);
  EXPECT_EQ(back->world, info.world);
  EXPECT_EQ(back->unit, info.unit);
  EXPECT_EQ(back->space_code, info.space_code);
  EXPECT_EQ(back->description, info.description);
  EXPECT_EQ(*back->labels, *info.labels);
  EXPECT_EQ(back->is_labels, info.is_labels);
  EXPECT_EQ(back->fill, info.fill);
  EXPECT_EQ(back->rounded, info.rounded);
  EXPECT_EQ(back->sample_type, info.sample_type);
  EXPECT_EQ(back->sample(2), 4000000000.0);
}

TEST(VolumeFactsChunk, WhatOldReadersUnderstandIsOfVersion1) {
  EXPECT_EQ(container_version_for(some_info()), 1);
  VolumeInfo flipped = some_info();
  flipped.affine.axes[0][0] = -1;
  EXPECT_EQ(container_version_for(flipped), 3);
  VolumeInfo wide = some_info();
  wide.sample_type = SampleType::i32;
  EXPECT_EQ(container_version_for(wide), 3);
}

TEST(VolumeFactsChunk, BadValuesAreRefused) {
  const Bytes info = pack_volume_info(more_info()), good = pack_volume_facts(more_info());
  ASSERT_TRUE(unpack_volume_info(info, good, "test"));
  const auto refused = [&](const std::string& word, const std::function<void(Bytes&)>& change) {
    Bytes bytes = good;
    change(bytes);
    const auto read = unpack_volume_info(info, bytes, "test");
    ASSERT_FALSE(read) << word;
    EXPECT_EQ(read.error().code, ErrorCode::input);
    EXPECT_NE(read.error().what.find(word), std::string::npos) << read.error().what;
  };
  for (size_t length = 1; length < good.size(); ++length)
    refused("VOLX", [&](Bytes& b) { b.resize(length); });
  refused("hold", [](Bytes& b) { b.push_back({}); });
  refused("world", [](Bytes& b) { b[0] = std::byte{7}; });
  refused("unit", [](Bytes& b) { b[1] = std::byte{8}; });
  refused("flags", [](Bytes& b) { b[3] = std::byte{16}; });
  refused("labels", [](Bytes& b) { store_le(&b[8], uint64_t{1} << 61); });
  refused("labels", [](Bytes& b) { store_le(&b[8], uint64_t{65537}); });
  refused("axes", [](Bytes& b) { store_le(&b[16], std::nan("")); });
  refused("axes", [](Bytes& b) { std::fill(b.begin() + 16, b.begin() + 40, std::byte{0}); });
  refused("label", [](Bytes& b) { store_le(&b[136], int64_t{-1}); });
}

}  // namespace
}  // namespace voxkit
