// The one file layout of every codec: a header, chunks, a table of chunks. Specified in FORMAT.md, section 1.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/chunk_zstd.h"
#include "formats/context.h"
#include "formats/result.h"

namespace voxkit {

inline constexpr std::array<uint8_t, 8> container_magic = {0x89, 'V', 'O', 'X', '\r', '\n', 0x1A, '\n'};
/// 3: there may be a chunk VOLX, without which voxels would be misread (volume_chunks.h); 2: chunks may be
/// compressed; 1: neither. Writers take the least that does.
inline constexpr uint16_t container_version = 3;

enum class Codec : uint16_t { svmm = 1, vq = 2, color = 3 };

/// Four letters, as they stand in the file.
constexpr uint32_t chunk_kind(const char (&letters)[5]) {
  return static_cast<uint32_t>(static_cast<unsigned char>(letters[0])) |
         static_cast<uint32_t>(static_cast<unsigned char>(letters[1])) << 8 |
         static_cast<uint32_t>(static_cast<unsigned char>(letters[2])) << 16 |
         static_cast<uint32_t>(static_cast<unsigned char>(letters[3])) << 24;
}

/// A row of the chunk table. Chunks are told apart by (kind, index, part).
struct ChunkEntry {
  uint32_t kind = 0;
  uint32_t index = 0;  ///< a level, say
  uint64_t part = 0;   ///< running number within (kind, index)
  uint64_t offset = 0;
  uint64_t length = 0;    ///< of the chunk, in bytes
  uint64_t stored = 0;    ///< bytes that it takes in the file: fewer than `length` if it is compressed
  uint64_t checksum = 0;  ///< XXH64, seed 0, of the stored bytes
  bool compressed() const { return stored != length; }
};

/// Where a writer's bytes go, in order.
using ByteSink = std::function<Status(std::span<const std::byte>)>;

/// Writes a container front to back, so that it can go to a pipe: the table comes last.
class ContainerWriter {
 public:
  ContainerWriter(ByteSink sink, Codec codec) : sink_(std::move(sink)), codec_(codec) {}
  /// `version`: at least that of the container. Chunks are compressed with zstd where that is worth it;
  /// `zstd`: its level, 0: none is.
  ContainerWriter(ByteSink sink, Codec codec, uint16_t version, int zstd, MemoryBudget& memory);
  /// Appends a chunk. Errors: those of the sink; ErrorCode::limit if there is no memory to compress it.
  Status add(uint32_t kind, uint32_t index, uint64_t part, std::span<const std::byte> bytes);
  /// Writes a table and a trailer as `finish` does, and more may follow: the file up to here is a container
  /// of the chunks so far. Readers of the whole file take no notice. Errors: those of the sink.
  Status checkpoint();
  /// Writes the table and the trailer. Nothing may follow. Errors: those of the sink.
  Status finish() { return checkpoint(); }
  uint64_t bytes_written() const { return position_; }

 private:
  Status begin();
  Status write(std::span<const std::byte> bytes);
  Status pad();

  ByteSink sink_;
  Codec codec_;
  uint16_t version_ = 1;
  uint64_t position_ = 0;
  std::vector<ChunkEntry> table_;
  std::unique_ptr<ChunkPacker> packer_;
};

/// A container in memory (mapped, as a rule). Safe on any bytes: opening validates header, trailer and table
/// against the bytes that are there; a chunk's checksum is verified, and the chunk expanded if it is
/// compressed, when it is first asked for.
class Container {
 public:
  /// Opens the container that is in `bytes`, which `keep_alive` owns. `name` is for messages. Expanded chunks
  /// are counted in `memory`, which outlives the container; without one they are not. Errors:
  /// ErrorCode::input, naming the section, its offset and the rule that is broken.
  static Result<std::shared_ptr<const Container>> open(std::span<const std::byte> bytes, std::string name,
                                                       std::shared_ptr<const void> keep_alive,
                                                       MemoryBudget* memory = nullptr);
  ~Container();
  Codec codec() const { return codec_; }
  const std::string& name() const { return name_; }
  uint64_t file_bytes() const { return bytes_.size(); }
  /// In file order.
  const std::vector<ChunkEntry>& table() const { return table_; }
  /// The bytes of the i-th chunk: in the file, or expanded. ErrorCode::input if they do not match their
  /// checksum or cannot be expanded to their length, ErrorCode::limit if there is no memory for that. Some
  /// bytes behind them may be read. Thread-safe.
  Result<std::span<const std::byte>> chunk(size_t i) const;
  /// The bytes that the i-th chunk takes in the file, be they damaged or not.
  std::span<const std::byte> unchecked(size_t i) const {
    return bytes_.subspan(table_[i].offset, table_[i].stored);
  }
  bool has_chunk(uint32_t kind) const;
  /// The bytes of the only chunk of this kind; ErrorCode::input if there is none, or more than one.
  Result<std::span<const std::byte>> only_chunk(uint32_t kind) const;
  /// Number of chunks whose bytes have been looked at so far.
  uint64_t chunks_touched() const { return touched_; }

 private:
  struct Expanded;

  Container();
  Result<std::span<const std::byte>> expanded(size_t i, std::span<const std::byte> stored) const;

  std::span<const std::byte> bytes_;
  std::string name_;
  std::shared_ptr<const void> keep_alive_;
  Codec codec_{};
  std::vector<ChunkEntry> table_;
  mutable std::unique_ptr<std::atomic<bool>[]> verified_;
  MemoryBudget* memory_ = nullptr;
  std::unique_ptr<Expanded[]> expanded_;  ///< by chunk, if any is compressed
  mutable std::atomic<uint64_t> touched_{0};
};

/// True if the bytes begin like a container.
bool is_container(std::span<const std::byte> bytes);

}  // namespace voxkit
