#include "formats/chunk_zstd.h"

#include <zstd.h>

namespace voxkit {

void ChunkPacker::Free::operator()(void* context) const {
  ZSTD_freeCCtx(static_cast<ZSTD_CCtx*>(context));
}

ChunkPacker::ChunkPacker(int level, MemoryBudget& memory)
    : level_(level), context_(ZSTD_createCCtx()), buffer_(memory), work_(memory) {}

Result<std::span<const std::byte>> ChunkPacker::pack(std::span<const std::byte> chunk) {
  if (chunk.size() < 4096) return std::span<const std::byte>();
  const size_t bound = ZSTD_compressBound(chunk.size());
  if (context_ == nullptr || ZSTD_isError(bound) != 0)
    return fail(ErrorCode::limit, {}, "--zstd: a chunk cannot be compressed: expected less memory in use");
  if (bound > packed_.size()) {
    VOX_CHECK(buffer_.add(bound - packed_.size(), "a compressed chunk"));
    packed_.resize(bound);
  }
  auto* const context = static_cast<ZSTD_CCtx*>(context_.get());
  const size_t size =
      ZSTD_compressCCtx(context, packed_.data(), packed_.size(), chunk.data(), chunk.size(), level_);
  if (ZSTD_isError(size) != 0)
    return fail(ErrorCode::limit, {},
                std::string("--zstd: a chunk cannot be compressed: ") + ZSTD_getErrorName(size));
  if (const uint64_t work = ZSTD_sizeof_CCtx(context); work > work_bytes_) {
    VOX_CHECK(work_.add(work - work_bytes_, "compressing chunks"));
    work_bytes_ = work;
  }
  return std::span<const std::byte>(packed_).first(size <= chunk.size() - chunk.size() / 16 ? size : 0);
}

uint64_t unpacked_size(std::span<const std::byte> packed) {
  const unsigned long long size = ZSTD_getFrameContentSize(packed.data(), packed.size());
  return size == ZSTD_CONTENTSIZE_UNKNOWN || size == ZSTD_CONTENTSIZE_ERROR ? 0 : size;
}

bool unpack_chunk(std::span<const std::byte> packed, std::span<std::byte> chunk) {
  return ZSTD_decompress(chunk.data(), chunk.size(), packed.data(), packed.size()) == chunk.size();
}

}  // namespace voxkit
