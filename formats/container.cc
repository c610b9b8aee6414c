#include "formats/container.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <cstring>
#include <mutex>

#include "formats/little_endian.h"

namespace voxkit {
namespace {

constexpr size_t block_size = 64;  // of header, trailer and alignment
constexpr size_t entry_size = 64;
constexpr std::array<uint8_t, 8> trailer_magic = {'V', 'O', 'X', 'T', 'A', 'B', 'L', 'E'};

uint64_t checksum(std::span<const std::byte> bytes) {
  return XXH64(bytes.data(), bytes.size(), 0);
}

std::string letters(uint32_t kind) {
  std::string text;
  for (int i = 0; i < 4; ++i) {
    const char c = static_cast<char>(kind >> (8 * i) & 0xff);
    text += c >= ' ' && c <= '~' ? c : '?';
  }
  return text;
}

std::string describe(const ChunkEntry& e) {
  return fmt::format("chunk {} {}.{}", letters(e.kind), e.index, e.part);
}

/// Readers load whole words: in a file the table follows every chunk, here these bytes do.
constexpr uint64_t behind_expanded = 64;

}  // namespace

struct Container::Expanded {
  std::once_flag once;
  Status status;
  std::unique_ptr<std::byte[]> bytes;
  Reservation reservation;
};

Container::Container() = default;
Container::~Container() = default;

ContainerWriter::ContainerWriter(ByteSink sink, Codec codec, uint16_t version, int zstd, MemoryBudget& memory)
    : sink_(std::move(sink)), codec_(codec), version_(version) {
  if (zstd <= 0) return;
  packer_ = std::make_unique<ChunkPacker>(zstd, memory);
  version_ = std::max<uint16_t>(version_, 2);
}

Status ContainerWriter::write(std::span<const std::byte> bytes) {
  position_ += bytes.size();
  return sink_(bytes);
}

Status ContainerWriter::pad() {
  static constexpr std::array<std::byte, block_size> zeros{};
  return write(std::span(zeros).first((block_size - position_ % block_size) % block_size));
}

Status ContainerWriter::begin() {
  std::array<std::byte, block_size> header{};
  std::memcpy(header.data(), container_magic.data(), container_magic.size());
  store_le<uint16_t>(&header[8], version_);
  store_le(&header[10], static_cast<uint16_t>(codec_));
  store_le(&header[56], checksum(std::span(header).first(56)));
  return write(header);
}

Status ContainerWriter::add(uint32_t kind, uint32_t index, uint64_t part, std::span<const std::byte> bytes) {
  if (position_ == 0) VOX_CHECK(begin());
  std::span<const std::byte> stored = bytes;
  if (packer_) {
    VOX_TRY(const auto packed, packer_->pack(bytes));
    if (!packed.empty()) stored = packed;
  }
  table_.push_back({kind, index, part, position_, bytes.size(), stored.size(), checksum(stored)});
  VOX_CHECK(write(stored));
  return pad();
}

Status ContainerWriter::checkpoint() {
  if (position_ == 0) VOX_CHECK(begin());
  std::vector<std::byte> table(table_.size() * entry_size);
  for (size_t i = 0; i < table_.size(); ++i) {
    std::byte* p = &table[i * entry_size];
    const ChunkEntry& e = table_[i];
    store_le(p, e.kind);
    store_le(p + 4, e.index);
    store_le(p + 8, e.part);
    store_le(p + 16, e.offset);
    store_le(p + 24, e.stored);
    store_le(p + 32, e.checksum);
    if (e.compressed()) store_le(p + 40, e.length);
  }
  std::array<std::byte, block_size> trailer{};
  std::memcpy(trailer.data(), trailer_magic.data(), trailer_magic.size());
  store_le<uint64_t>(&trailer[8], position_);
  store_le<uint64_t>(&trailer[16], table_.size());
  store_le<uint64_t>(&trailer[24], position_ + table.size() + block_size);
  store_le(&trailer[32], checksum(table));
  store_le(&trailer[56], checksum(std::span(trailer).first(56)));
  VOX_CHECK(write(table));
  return write(trailer);
}

bool is_container(std::span<const std::byte> bytes) {
  return bytes.size() >= container_magic.size() &&
         std::memcmp(bytes.data(), container_magic.data(), container_magic.size()) == 0;
}

/// The length of the longest beginning that ends with a trailer of its own: behind a checkpoint, or before
/// what was appended. 0: there is none.
static uint64_t whole_prefix(std::span<const std::byte> bytes) {
  for (uint64_t at = bytes.size() / block_size * block_size; at >= 2 * block_size; at -= block_size) {
    const std::byte* const trailer = bytes.data() + at - block_size;
    if (std::memcmp(trailer, trailer_magic.data(), trailer_magic.size()) == 0 &&
        load_le<uint64_t>(trailer + 56) == checksum(std::span(trailer, 56)) &&
        load_le<uint64_t>(trailer + 24) == at)
      return at;
  }
  return 0;
}

Result<std::shared_ptr<const Container>> Container::open(std::span<const std::byte> bytes, std::string name,
                                                         std::shared_ptr<const void> keep_alive,
                                                         MemoryBudget* memory) {
  auto bad = [&](const std::string& what) { return bad_input(name, what); };
  if (!is_container(bytes))
    return bad("header, byte 0: not a voxkit container: expected 89 56 4F 58 0D 0A 1A 0A");
  if (bytes.size() < 2 * block_size)
    return bad(fmt::format("file ends after {} bytes: expected a header and a trailer of 64 bytes each",
                           bytes.size()));
  const std::byte* header = bytes.data();
  if (load_le<uint64_t>(header + 56) != checksum(bytes.first(56)))
    return bad("header, byte 56: the checksum of the header does not match");
  const auto version = load_le<uint16_t>(header + 8);
  if (version < 1 || version > container_version)
    return bad(
        fmt::format("header, byte 8: container version {}: expected 1 to {}", version, container_version));
  const auto codec = load_le<uint16_t>(header + 10);
  if (codec < static_cast<uint16_t>(Codec::svmm) || codec > static_cast<uint16_t>(Codec::color))
    return bad(fmt::format("header, byte 10: unknown codec {}", codec));

  const uint64_t trailer_offset = bytes.size() - block_size;
  const std::byte* trailer = bytes.data() + trailer_offset;
  if (std::memcmp(trailer, trailer_magic.data(), trailer_magic.size()) != 0) {
    const uint64_t whole = whole_prefix(bytes);
    return bad(fmt::format("trailer, byte {}: missing: the file is cut short or has bytes appended{}",
                           trailer_offset,
                           whole > 0 ? fmt::format("; its first {} bytes are a whole file", whole) : ""));
  }
  if (load_le<uint64_t>(trailer + 56) != checksum(std::span(trailer, 56)))
    return bad(
        fmt::format("trailer, byte {}: the checksum of the trailer does not match", trailer_offset + 56));
  const auto table_offset = load_le<uint64_t>(trailer + 8), count = load_le<uint64_t>(trailer + 16);
  if (load_le<uint64_t>(trailer + 24) != bytes.size())
    return bad(fmt::format("trailer, byte {}: file length {}: expected {}", trailer_offset + 24,
                           load_le<uint64_t>(trailer + 24), bytes.size()));
  if (table_offset % block_size != 0 || table_offset < block_size || table_offset > trailer_offset ||
      count != (trailer_offset - table_offset) / entry_size ||
      (trailer_offset - table_offset) % entry_size != 0)
    return bad(fmt::format("trailer, byte {}: a table of {} entries at byte {} does not end at the trailer",
                           trailer_offset + 8, count, table_offset));
  const auto table = bytes.subspan(table_offset, count * entry_size);
  if (load_le<uint64_t>(trailer + 32) != checksum(table))
    return bad(fmt::format("table, byte {}: the checksum of the table does not match", table_offset));

  std::shared_ptr<Container> container(new Container);
  container->table_.resize(count);
  uint64_t end =
      block_size;  // chunks ascend and do not overlap, so their sizes add up to no more than the file
  bool any_compressed = false;
  for (size_t i = 0; i < count; ++i) {
    const std::byte* p = table.data() + i * entry_size;
    ChunkEntry& e = container->table_[i];
    e.kind = load_le<uint32_t>(p);
    e.index = load_le<uint32_t>(p + 4);
    e.part = load_le<uint64_t>(p + 8);
    e.offset = load_le<uint64_t>(p + 16);
    e.stored = e.length = load_le<uint64_t>(p + 24);
    e.checksum = load_le<uint64_t>(p + 32);
    if (e.offset % block_size != 0 || e.offset < end || e.offset > table_offset ||
        e.stored > table_offset - e.offset)
      return bad(fmt::format("table, byte {}: {} of {} bytes at byte {} overlaps or leaves the file",
                             table_offset + i * entry_size, describe(e), e.stored, e.offset));
    end = e.offset + e.stored;
    if (const auto plain = load_le<uint64_t>(p + 40); version > 1 && plain != 0) {
      if (plain <= e.stored || plain / most_zstd_ratio >= e.stored)
        return bad(
            fmt::format("table, byte {}: {} of {} bytes, {} compressed: expected more than that, and less "
                        "than {} times as many",
                        table_offset + i * entry_size + 40, describe(e), plain, e.stored, most_zstd_ratio));
      e.length = plain;
      any_compressed = true;
    }
  }
  container->bytes_ = bytes;
  container->name_ = std::move(name);
  container->keep_alive_ = std::move(keep_alive);
  container->codec_ = static_cast<Codec>(codec);
  container->verified_ = std::make_unique<std::atomic<bool>[]>(count);
  container->memory_ = memory;
  if (any_compressed) container->expanded_ = std::make_unique<Expanded[]>(count);
  return container;
}

Result<std::span<const std::byte>> Container::chunk(size_t i) const {
  const ChunkEntry& e = table_[i];
  const auto bytes = bytes_.subspan(e.offset, e.stored);
  if (!verified_[i].load(std::memory_order_acquire)) {
    if (checksum(bytes) != e.checksum)
      return bad_input(name_, fmt::format("{}, byte {}: the checksum does not match: the file is damaged",
                                          describe(e), e.offset));
    if (!verified_[i].exchange(true, std::memory_order_release)) ++touched_;
  }
  if (e.compressed()) return expanded(i, bytes);
  return bytes;
}

Result<std::span<const std::byte>> Container::expanded(size_t i, std::span<const std::byte> stored) const {
  const ChunkEntry& e = table_[i];
  Expanded& own = expanded_[i];
  std::call_once(own.once, [&] {
    own.status = [&]() -> Status {
      const auto not_a_frame = [&] {
        return bad_input(
            name_, fmt::format("{}, byte {}: not a zstd frame of {} bytes", describe(e), e.offset, e.length));
      };
      if (unpacked_size(stored) != e.length) return not_a_frame();
      const uint64_t room = e.length + behind_expanded;
      if (memory_ != nullptr) {
        own.reservation = Reservation(*memory_);
        if (Status reserved = own.reservation.add(room, "a chunk that was compressed"); !reserved) {
          reserved.error().file = name_;
          return reserved;
        }
      }
      own.bytes.reset(new (std::nothrow) std::byte[room]);
      if (own.bytes == nullptr)
        return fail(ErrorCode::limit, name_, fmt::format("{}: no memory for {} bytes", describe(e), room));
      if (!unpack_chunk(stored, {own.bytes.get(), e.length})) return not_a_frame();
      std::fill_n(own.bytes.get() + e.length, behind_expanded, std::byte{0});
      return {};
    }();
    if (!own.status) own.bytes.reset();
  });
  if (!own.status) return tl::unexpected<Error>(own.status.error());
  return std::span<const std::byte>(own.bytes.get(), e.length);
}

bool Container::has_chunk(uint32_t kind) const {
  return std::any_of(table_.begin(), table_.end(), [&](const ChunkEntry& e) { return e.kind == kind; });
}

Result<std::span<const std::byte>> Container::only_chunk(uint32_t kind) const {
  const auto is_kind = [&](const ChunkEntry& e) { return e.kind == kind; };
  const auto found = std::find_if(table_.begin(), table_.end(), is_kind);
  if (found == table_.end() || std::find_if(found + 1, table_.end(), is_kind) != table_.end())
    return bad_input(name_, fmt::format("table: expected one chunk {}", letters(kind)));
  if (found->index != 0 || found->part != 0)
    return bad_input(name_, fmt::format("table: {}: expected index 0 and part 0", describe(*found)));
  return chunk(static_cast<size_t>(found - table_.begin()));
}

}  // namespace voxkit
