// Verifying a whole file: every checksum, and that everything in it is as FORMAT.md says.
#include <fmt/format.h>

#include <algorithm>

#include "formats/parallel.h"
#include "formats/reservation.h"
#include "libvq/store.h"

namespace voxkit::vq {
namespace {

class Checker {
 public:
  Checker(const Volume& volume, Context& ctx)
      : volume_(volume), view_(volume.view()), pools_(volume), reader_(view_, pools_), ctx_(ctx) {}

  Status run() {
    const Container& container = volume_.container();
    VOX_CHECK(parallel_for(ctx_, static_cast<int64_t>(container.table().size()), [&](int64_t i) -> Status {
      VOX_CHECK(container.chunk(static_cast<size_t>(i)));
      return {};
    }));
    const bool packed = view_.codebook == Codebook::packed;
    if (!packed) VOX_CHECK(walk_codebook());
    if (!packed && view_.mapping == Mapping::indirect) VOX_CHECK(check_addresses());
    VOX_CHECK(check_id(view_.common, "chunk VQPM, byte 16"));
    VOX_CHECK(check_offsets());
    constexpr int64_t batch = 4096;
    const auto count = static_cast<int64_t>(view_.codewords);
    return parallel_for(ctx_, (count + batch - 1) / batch, [&](int64_t i) -> Status {
      for (int64_t n = i * batch; n < std::min(count, (i + 1) * batch); ++n)
        VOX_CHECK(check_brick(static_cast<uint64_t>(n)));
      return {};
    });
  }

 private:
  tl::unexpected<Error> bad(const std::string& what) const {
    return bad_input(volume_.container().name(), what);
  }

  /// The addresses of all bricks, one after the other as the codebook has them: no gaps, none too many.
  Status walk_codebook() {
    VOX_CHECK(reservation_.add(view_.codewords * sizeof(uint64_t), "addresses of bricks"));
    addresses_.reserve(view_.codewords);
    for (uint64_t part = 0; part < volume_.store().codebook.chunks.size(); ++part) {
      VOX_CHECK(check_interrupt());
      const Bytes chunk = pools_.codebook(part);
      for (uint64_t at = 0; at < chunk.size;) {
        const auto broken = [&](const char* rule) {
          return bad(fmt::format("chunk CODE 0.{}, byte {}: {}", part, at, rule));
        };
        const auto available = static_cast<uint32_t>(chunk.size - at);
        const auto head = static_cast<uint32_t>(view_.range_bytes);
        if (available < head) return broken("a brick ends behind the chunk");
        const uint32_t min = load_bits(chunk.data + at, 0, view_.bits),
                       max = load_bits(chunk.data + at, static_cast<uint64_t>(view_.bits), view_.bits);
        int length = 0;
        if (min < max) {
          if (available > head)
            length = codeword_length(chunk.data + at + head, available - head, view_.bits);
          if (length == 0) return broken("not a valid codeword");
        }
        if (addresses_.size() == view_.codewords) return broken("more bricks than chunk VQPM says");
        addresses_.push_back(part << address_chunk_log2 | at);
        at += head + static_cast<uint32_t>(length);
      }
    }
    if (addresses_.size() != view_.codewords)
      return bad(fmt::format("chunks CODE: {} bricks: expected {}", addresses_.size(), view_.codewords));
    return {};
  }

  Status check_addresses() {
    const auto& sizes = volume_.store().codebook.sizes;
    for (uint64_t n = 0; n < addresses_.size(); ++n) {
      const uint64_t group = n / group_bricks, at = group & ((1u << group_chunk_log2) - 1);
      const std::byte* const bytes = pools_.addresses(group >> group_chunk_log2).data + at * group_bytes;
      const auto length = std::to_integer<uint64_t>(bytes[8 + n % group_bricks]);
      const uint64_t address = addresses_[n], part = address >> address_chunk_log2;
      const bool last = n + 1 == addresses_.size() || addresses_[n + 1] >> address_chunk_log2 != part;
      const uint64_t end = last ? (part << address_chunk_log2) + sizes[part] : addresses_[n + 1];
      if (address + length != end)
        return bad(
            fmt::format("chunk ADDR: brick {}: a length of {}: expected {}", n, length, end - address));
      if (n % group_bricks == 0) group_address_ = load_le<uint64_t>(bytes);
      if (group_address_ != address)
        return bad(fmt::format("chunk ADDR: brick {}: address {}: expected {}", n, group_address_, address));
      group_address_ += length;
    }
    return {};
  }

  Status check_id(uint64_t id, const std::string& where) const {
    const bool known = view_.mapping == Mapping::direct
                           ? std::binary_search(addresses_.begin(), addresses_.end(), id)
                           : id < view_.codewords;
    if (known) return {};
    return bad(fmt::format("{}: no brick {}", where, id));
  }

  Status check_offsets() const {
    const auto parts = static_cast<int64_t>(volume_.store().offsets.chunks.size());
    const uint64_t all = uint64_t{view_.blocks[0]} * view_.blocks[1] * view_.blocks[2];
    return parallel_for(ctx_, parts, [&](int64_t part) -> Status {
      const Bytes chunk = pools_.offsets(static_cast<uint64_t>(part));
      if (chunk.data == nullptr) return volume_.store().status();
      const uint64_t first = static_cast<uint64_t>(part) << block_chunk_log2;
      const uint64_t blocks = std::min(all - first, uint64_t{1} << block_chunk_log2);
      for (uint64_t i = 0; i < blocks; ++i) {
        const std::byte* const header = chunk.data + i * block_header;
        const auto start = load_le<uint32_t>(header + 4), end = load_le<uint32_t>(header + 12);
        if (end < start || end - start > widest_entry)
          return bad(
              fmt::format("chunk OFFS 0.{}, byte {}: entries from byte {} to {}: expected up to {} bits each",
                          part, i * block_header + 4, uint64_t{start} * 8, uint64_t{end} * 8, widest_entry));
        VOX_CHECK(check_block(first + i));
      }
      return {};
    });
  }

  Status check_block(uint64_t block) const {
    const uint64_t x = block % view_.blocks[0], y = block / view_.blocks[0] % view_.blocks[1],
                   z = block / view_.blocks[0] / view_.blocks[1];
    for (uint64_t i = 0; i < block_bricks; ++i) {
      const uint64_t bx = 4 * x + i % 4, by = 4 * y + i / 4 % 4, bz = 4 * z + i / 16;
      if (bx >= view_.bricks[0] || by >= view_.bricks[1] || bz >= view_.bricks[2]) continue;
      const uint64_t id =
          reader_.brick_id(static_cast<uint32_t>(bx), static_cast<uint32_t>(by), static_cast<uint32_t>(bz));
      VOX_CHECK(check_id(
          id, fmt::format("chunk OFFS 0.{}, brick {},{},{}", block >> block_chunk_log2, bx, by, bz)));
    }
    return {};
  }

  /// Its codeword is valid, and its range that of its codes.
  Status check_brick(uint64_t number) const {
    const uint64_t id = view_.mapping == Mapping::direct ? addresses_[number] : number;
    Record record;
    Brick brick;
    if (!reader_.find(id, record) || !reader_.decode(record, brick.data()))
      return bad(fmt::format("chunk CODE: brick {}: not valid", id));
    // A packed brick has its codes even if they are all the same.
    if (view_.codebook == Codebook::packed &&
        !decode_plain(record.code, view_.bits, record.range, brick.data()))
      return bad(fmt::format("chunk CODE: brick {}: a code outside its range", id));
    if (range_of(brick) != record.range)
      return bad(fmt::format("chunk CODE: brick {}: a range of {} to {}: expected {} to {}", id,
                             record.range.min, record.range.max, range_of(brick).min, range_of(brick).max));
    return {};
  }

  const Volume& volume_;
  const View& view_;
  const MappedPools pools_;
  const Reader<MappedPools> reader_;
  Context& ctx_;
  Reservation reservation_{*ctx_.memory};
  std::vector<uint64_t> addresses_;  ///< of a codebook with variable length, ascending
  uint64_t group_address_ = 0;
};

}  // namespace

Status Volume::check(Context& ctx) const {
  return Checker(*this, ctx).run();
}

}  // namespace voxkit::vq
