// Containers whose chunks are compressed.
#include "formats/chunk_zstd.h"

#include <gtest/gtest.h>

#include <thread>

#include "formats/container.h"
#include "tests/damage.h"

namespace voxkit {
namespace {

using test::Bytes;

constexpr uint32_t kind = chunk_kind("AAAA");
constexpr size_t flat = 100000, noise = 50000, little = 4000;

/// Chunks in the order of their lengths' constants: one of few values, one of noise, one that is too small to
/// be worth it.
Bytes chunk_of(size_t size) {
  std::mt19937_64 random(size);
  Bytes bytes(size);
  for (size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::byte>(size == noise ? random() : i / 5000);
  return bytes;
}

Bytes file_of(int zstd) {
  Bytes file;
  MemoryBudget memory;
  ContainerWriter writer(
      [&](std::span<const std::byte> bytes) {
        file.insert(file.end(), bytes.begin(), bytes.end());
        return Status{};
      },
      Codec::svmm, 1, zstd, memory);
  uint64_t part = 0;
  for (const size_t size : {flat, noise, little}) EXPECT_TRUE(writer.add(kind, 0, part++, chunk_of(size)));
  EXPECT_TRUE(writer.finish());
  return file;
}

Result<std::shared_ptr<const Container>> open(const Bytes& file, MemoryBudget* memory = nullptr) {
  const auto bytes = std::make_shared<const Bytes>(file.begin(), file.end());
  return Container::open(*bytes, "test.svmm", bytes, memory);
}

/// The length that the table says of the first chunk, expanded; made right is what depends on it.
Bytes with_length(Bytes file, uint64_t length) {
  store_le(&file[test::table_of(file).offset + 40], length);
  test::reseal(file);
  return file;
}

TEST(ChunkZstd, ChunksComeBackAndOnlyThoseThatGainAreCompressed) {
  const Bytes plain = file_of(0);
  for (const int level : {1, 3, most_zstd_level}) {
    const Bytes file = file_of(level);
    EXPECT_LT(file.size() + flat / 2, plain.size());
    const auto container = open(file);
    ASSERT_TRUE(container);
    const auto& table = (*container)->table();
    ASSERT_EQ(table.size(), 3u);
    EXPECT_TRUE(table[0].compressed());
    EXPECT_FALSE(table[1].compressed());
    EXPECT_FALSE(table[2].compressed());
    size_t i = 0;
    for (const size_t size : {flat, noise, little}) {
      EXPECT_EQ(table[i].length, size);
      const auto chunk = (*container)->chunk(i++);
      ASSERT_TRUE(chunk);
      EXPECT_TRUE(std::ranges::equal(*chunk, chunk_of(size)));
    }
  }
}

TEST(ChunkZstd, FilesWithoutAreOfVersion1) {
  EXPECT_EQ(load_le<uint16_t>(&file_of(0)[8]), 1);
  EXPECT_EQ(load_le<uint16_t>(&file_of(1)[8]), 2);
  // What a reader of version 1 ignores is ignored there.
  Bytes file = with_length(file_of(0), 1);
  const auto container = open(file);
  ASSERT_TRUE(container);
  EXPECT_FALSE((*container)->table()[0].compressed());
}

TEST(ChunkZstd, ManyThreadsGetTheSameBytes) {
  const Bytes file = file_of(3);
  const auto container = open(file);
  ASSERT_TRUE(container);
  std::vector<const std::byte*> seen(8);
  std::vector<std::thread> threads;
  for (const std::byte*& place : seen)
    threads.emplace_back([&] {
      if (const auto chunk = (*container)->chunk(0)) place = chunk->data();
    });
  for (std::thread& thread : threads) thread.join();
  ASSERT_NE(seen[0], nullptr);
  for (const std::byte* place : seen) EXPECT_EQ(place, seen[0]);
  EXPECT_EQ((*container)->chunks_touched(), 1u);
}

TEST(ChunkZstd, LengthsThatAreNotThoseOfTheFrameAreRefused) {
  const Bytes file = file_of(3);
  const uint64_t stored = open(file).value()->table()[0].stored;
  // Nothing to expand; more than any frame holds.
  for (const uint64_t length : {uint64_t{1}, stored, stored << 15, ~uint64_t{0}}) {
    const auto container = open(with_length(file, length));
    ASSERT_FALSE(container) << length;
    EXPECT_EQ(container.error().code, ErrorCode::input);
  }
  for (const uint64_t length : {uint64_t{flat} - 1, uint64_t{flat} + 1, stored + 1, (stored << 15) - 1}) {
    const auto container = open(with_length(file, length));
    ASSERT_TRUE(container) << length;
    for (int again = 0; again < 2; ++again) {
      const auto chunk = (*container)->chunk(0);
      ASSERT_FALSE(chunk) << length;
      EXPECT_EQ(chunk.error().code, ErrorCode::input);
      EXPECT_EQ(chunk.error().what.find('\n'), std::string::npos);
    }
  }
}

TEST(ChunkZstd, WhatDoesNotFitIntoMemoryIsRefused) {
  const Bytes file = file_of(3);
  MemoryBudget memory(flat);
  {
    const auto container = open(file, &memory);
    ASSERT_TRUE(container);
    const auto chunk = (*container)->chunk(0);
    ASSERT_FALSE(chunk);
    EXPECT_EQ(chunk.error().code, ErrorCode::limit);
    EXPECT_TRUE((*container)->chunk(1)) << "is not expanded";
  }
  MemoryBudget enough(flat + 64);
  {
    const auto container = open(file, &enough);
    EXPECT_TRUE(container.value()->chunk(0));
    EXPECT_FALSE(enough.reserve(1, "a byte"));
  }
  EXPECT_TRUE(enough.reserve(flat, "what was given back"));
}

TEST(ChunkZstd, DamagedFramesAreRefused) {
  const Bytes file = file_of(3);
  const auto table = open(file).value()->table();
  std::mt19937 random(7);
  int refused = 0;
  for (int i = 0; i < 2000; ++i) {
    Bytes damaged = file;
    test::damage(damaged, table[0].offset, table[0].offset + table[0].stored, true, random);
    test::reseal(damaged);
    const auto container = open(damaged);
    ASSERT_TRUE(container);
    const auto chunk = (*container)->chunk(0);
    if (chunk) {
      EXPECT_EQ(chunk->size(), flat);
    } else {
      EXPECT_EQ(chunk.error().code, ErrorCode::input);
      ++refused;
    }
  }
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace voxkit
