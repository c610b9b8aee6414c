// Chunks of a container compressed with Zstandard (RFC 8878). Specified in FORMAT.md, section 1.3.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "formats/reservation.h"
#include "formats/result.h"

namespace voxkit {

inline constexpr int most_zstd_level = 19;
/// No frame has so many bytes for each of its own: a block has 2^17 at most, and takes 4 at least.
inline constexpr uint64_t most_zstd_ratio = uint64_t{1} << 15;

/// Compresses chunks one after the other.
class ChunkPacker {
 public:
  /// `level`: 1 (fast) to most_zstd_level (small). Its memory is counted.
  ChunkPacker(int level, MemoryBudget& memory);
  /// Compresses a chunk to one frame, valid until the next call; empty if there is little to win from having
  /// to expand it: if it has less than 4096 bytes, or the frame is not smaller by a sixteenth. Errors:
  /// ErrorCode::limit if there is no memory for it.
  Result<std::span<const std::byte>> pack(std::span<const std::byte> chunk);

 private:
  struct Free {
    void operator()(void* context) const;
  };
  int level_;
  std::unique_ptr<void, Free> context_;
  std::vector<std::byte> packed_;
  Reservation buffer_, work_;
  uint64_t work_bytes_ = 0;
};

/// The length that a frame gives its content; 0 if it is none, or gives none.
uint64_t unpacked_size(std::span<const std::byte> packed);
/// Expands a frame that `pack` made; false unless it is one, of exactly as many bytes as there is room for.
bool unpack_chunk(std::span<const std::byte> packed, std::span<std::byte> chunk);

}  // namespace voxkit
