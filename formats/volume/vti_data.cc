// The bytes of arrays in VTK's XML files: as they are, base64, blocks, text.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "formats/reservation.h"
#include "formats/volume/text_samples.h"
#include "formats/volume/vti.h"

namespace voxkit::vti {
namespace {

constexpr uint64_t most_blocks = uint64_t{1} << 24, most_block_bytes = uint64_t{1} << 30,
                   kept_bytes = uint64_t{8} << 20;

/// Base64 to bytes, up to a character that is none of it. Padding ends a part, not the data: the counts and
/// what they count may be encoded one by one.
class Base64Stream final : public InputStream {
 public:
  explicit Base64Stream(std::unique_ptr<InputStream> text)
      : text_(std::move(text)), buffer_(size_t{1} << 16) {
    name_ = text_->name();
  }
  Result<size_t> read(std::span<std::byte> out) override {
    size_t done = 0;
    while (done < out.size()) {
      if (begin_ == end_) {
        VOX_CHECK(next_group());
        if (begin_ == end_) break;
      }
      out[done++] = group_[begin_++];
      ++position_;
    }
    return done;
  }

 private:
  static int digit(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
  }
  Status next_group() {
    uint32_t bits = 0;
    size_t count = 0, padding = 0;
    begin_ = end_ = 0;
    while (count < 4 && !ended_) {
      if (next_ == filled_) {
        VOX_TRY(filled_, text_->read(std::as_writable_bytes(std::span(buffer_))));
        next_ = 0;
        if (filled_ == 0) ended_ = true;
        continue;
      }
      const char c = buffer_[next_++];
      if (c == ' ' || c == '\n' || c == '\r' || c == '\t') continue;
      const int value = digit(c);
      if (value < 0 && c != '=') {
        ended_ = true;
        break;
      }
      if (value >= 0 && padding > 0) break;  // below: a group that is none
      padding += value < 0;
      bits = bits << 6 | static_cast<uint32_t>(std::max(value, 0));
      ++count;
    }
    if (count == 0) return {};
    if (count < 4 || padding > 2)
      return bad_input(name_,
                       fmt::format("base64 data, byte {}: expected groups of four characters", position_));
    for (size_t i = 0; i < 3; ++i) group_[i] = static_cast<std::byte>(bits >> (16 - 8 * i) & 255);
    end_ = 3 - padding;
    return {};
  }

  std::unique_ptr<InputStream> text_;
  std::vector<char> buffer_;
  size_t next_ = 0, filled_ = 0;
  bool ended_ = false;
  std::array<std::byte, 3> group_{};
  size_t begin_ = 0, end_ = 0;
};

/// What an element holds, up to the next one.
class ContentStream final : public InputStream {
 public:
  ContentStream(std::shared_ptr<const MappedFile> file, uint64_t start) : file_(std::move(file)) {
    name_ = file_->name();
    left_ = file_->bytes().subspan(static_cast<size_t>(start));
    left_ = left_.first(
        static_cast<size_t>(std::find(left_.begin(), left_.end(), std::byte{'<'}) - left_.begin()));
  }
  Result<size_t> read(std::span<std::byte> out) override {
    const size_t take = std::min(out.size(), left_.size());
    std::copy_n(left_.begin(), take, out.begin());
    left_ = left_.subspan(take);
    position_ += take;
    return take;
  }

 private:
  std::shared_ptr<const MappedFile> file_;
  std::span<const std::byte> left_;
};

/// A count before data, of four or eight bytes.
Result<uint64_t> read_count(InputStream& stream, const Document& document) {
  std::array<std::byte, 8> bytes{};
  const auto used = std::span(bytes).first(static_cast<size_t>(document.length_bytes));
  VOX_CHECK(stream.read_exactly(used, "the counts before voxel data"));
  if (document.big_endian) std::reverse(used.begin(), used.end());
  uint64_t count = 0;
  std::memcpy(&count, bytes.data(), bytes.size());
  return count;
}

/// The counts and sizes of blocks; `packed` stands behind them then. Offsets are from the first block on.
struct Blocks {
  std::vector<uint64_t> offsets;
  uint64_t block = 0;
  size_t kept = 0;
  Reservation memory;
};

Result<Blocks> read_blocks(InputStream& stream, const Document& document, uint64_t bytes, uint64_t file_bytes,
                           Context& ctx) {
  VOX_TRY(const uint64_t count, read_count(stream, document));
  VOX_TRY(const uint64_t block, read_count(stream, document));
  VOX_TRY(const uint64_t last, read_count(stream, document));
  const auto wrong = [&](const std::string& expected) {
    return bad_input(document.name, fmt::format("{} blocks of {} bytes, the last of {}: expected {}", count,
                                                block, last, expected));
  };
  if (count == 0 || count > most_blocks || count * static_cast<uint64_t>(document.length_bytes) > file_bytes)
    return wrong(fmt::format("1 to {}, of which the file has the sizes", most_blocks));
  if (block == 0 || block > most_block_bytes || last > block)
    return wrong(fmt::format("blocks of 1 to {} bytes", most_block_bytes));
  if ((last == 0 ? count * block : (count - 1) * block + last) != bytes)
    return wrong(fmt::format("{} bytes in all", bytes));
  Blocks blocks;
  blocks.block = block;
  blocks.kept = static_cast<size_t>(std::clamp<uint64_t>(kept_bytes / block, 2, count + 1));
  VOX_TRY(blocks.memory, Reservation::take((count + 1) * sizeof(uint64_t), "the sizes of blocks", ctx));
  blocks.offsets.reserve(static_cast<size_t>(count) + 1);
  blocks.offsets.push_back(0);
  for (uint64_t i = 0; i < count; ++i) {
    VOX_TRY(const uint64_t size, read_count(stream, document));
    const uint64_t end = blocks.offsets.back() + size;
    if (size > file_bytes || end > file_bytes)
      return wrong(fmt::format("blocks packed in at most {} bytes, not {} and more", file_bytes, size));
    // zlib packs to a 1032nd at best, LZ4 to a 255th.
    if ((i + 1 < count || last == 0 ? block : last) / 1100 > size)
      return wrong(fmt::format("no block that is packed to {} bytes", size));
    blocks.offsets.push_back(end);
  }
  VOX_CHECK(blocks.memory.add(std::min(block, bytes) * (blocks.kept + 1), "blocks of voxels"));
  return blocks;
}

}  // namespace

Result<Data> open_data(std::shared_ptr<const MappedFile> file, const Document& document, const Array& array,
                       uint64_t bytes, Context& ctx) {
  const uint64_t size = file->bytes().size(), before = array.appended ? *document.appended : 0;
  if (array.at > size - before)
    return bad_input(document.name,
                     fmt::format("appended data at byte {}: expected at most {}, where the file ends",
                                 array.at, size - before));
  const uint64_t start = before + array.at;
  if (array.coding == Coding::text && !array.appended)
    return Data{
        text_samples(std::make_unique<ContentStream>(std::move(file), start), *array.type), nullptr, {}};
  auto stream = stream_of(file);
  VOX_CHECK(stream->skip(start));
  const bool base64 = array.appended ? document.appended_base64 : true;
  if (base64) stream = std::make_unique<Base64Stream>(std::move(stream));
  if (document.packing != Packing::none) {
    VOX_TRY(Blocks blocks, read_blocks(*stream, document, bytes, size, ctx));
    uint64_t first = stream->position();
    if (base64) {  // blocks are looked up in the bytes that it stands for
      VOX_TRY(file, MappedFile::spool(*stream));
      first = 0;
    }
    const uint64_t there = file->bytes().size() - std::min<uint64_t>(file->bytes().size(), first);
    if (blocks.offsets.back() > there)
      return bad_input(document.name, fmt::format("blocks of voxel data end after {} bytes: expected {}",
                                                  there, blocks.offsets.back()));
    for (uint64_t& offset : blocks.offsets) offset += first;
    return Data{nullptr,
                std::make_shared<BlockFile>(std::move(file), document.packing, std::move(blocks.offsets),
                                            blocks.block, bytes, blocks.kept, std::move(blocks.memory)),
                {}};
  }
  VOX_TRY(const uint64_t found, read_count(*stream, document));
  if (found != bytes)
    return bad_input(document.name, fmt::format("an array of {} bytes: expected {}", found, bytes));
  if (base64) return Data{std::move(stream), nullptr, {}};
  return Data{nullptr, nullptr, start + static_cast<uint64_t>(document.length_bytes)};
}

}  // namespace voxkit::vti
