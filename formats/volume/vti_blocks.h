// Blocks of bytes that were packed one by one, in a mapped file: any of them is unpacked alone.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/reservation.h"
#include "formats/source.h"
#include "formats/volume/dense_source.h"

namespace voxkit::vti {

/// What packed the blocks.
enum class Packing { none, zlib, lz4 };

/// All blocks but the last have as many bytes; those unpacked most recently are kept.
class BlockFile {
 public:
  /// `offsets`: of each block in the file and, at last, of their end, ascending and within it. `memory` holds
  /// what they take, and `kept` blocks.
  BlockFile(std::shared_ptr<const MappedFile> file, Packing packing, std::vector<uint64_t> offsets,
            uint64_t block, uint64_t bytes, size_t kept, Reservation memory)
      : file_(std::move(file)),
        packing_(packing),
        offsets_(std::move(offsets)),
        block_(block),
        bytes_(bytes),
        kept_(kept),
        memory_(std::move(memory)) {}
  /// Copies the bytes from `at` on, which are there. From any number of threads. Errors: ErrorCode::input.
  Status read(uint64_t at, std::span<std::byte> out);

 private:
  struct Block {
    uint64_t index;
    std::shared_ptr<const std::vector<std::byte>> bytes;
  };
  Result<std::shared_ptr<const std::vector<std::byte>>> get(uint64_t index);

  std::shared_ptr<const MappedFile> file_;
  Packing packing_;
  std::vector<uint64_t> offsets_;
  uint64_t block_, bytes_;
  size_t kept_;
  Reservation memory_;
  std::mutex mutex_;
  std::list<Block> recent_;  ///< the most recent first
};

/// `bytes` of blocks front to back; `name`: for messages.
std::unique_ptr<InputStream> stream_of(std::shared_ptr<BlockFile> blocks, const std::string& name,
                                       uint64_t bytes);

/// Random access to samples in blocks, x fastest. Not of wide integers, nor of 64-bit floats.
std::unique_ptr<VolumeSource> block_source(std::shared_ptr<BlockFile> blocks, const VolumeInfo& info,
                                           const SampleLayout& layout);

}  // namespace voxkit::vti
