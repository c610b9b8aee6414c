#include "libvq/codebook.h"

#include <algorithm>

#include "formats/hash.h"

namespace voxkit::vq {
namespace {

constexpr size_t head = 5;  // u16 min, u16 max, u8 length of the codeword

}  // namespace

void code_brick(const Brick& brick, CodedBrick& out) {
  out.range = range_of(brick);
  out.length = out.range.min == out.range.max
                   ? uint8_t{0}
                   : static_cast<uint8_t>(encode_codeword(brick, out.range, out.codeword.data()));
}

uint64_t hash_of(BrickRange range, std::span<const std::byte> codeword) {
  uint64_t hash = mix64(uint64_t{range.min} << 32 | uint64_t{range.max} << 8 | codeword.size());
  while (!codeword.empty()) {
    uint64_t word = 0;
    const size_t take = std::min<size_t>(codeword.size(), sizeof word);
    std::memcpy(&word, codeword.data(), take);
    hash = mix64(hash + word);
    codeword = codeword.subspan(take);
  }
  return hash;
}

Result<uint32_t> UniqueCodes::add(BrickRange range, std::span<const std::byte> codeword, uint64_t hash) {
  if (2 * (places_.size() + 1) > table_.size()) VOX_CHECK(grow_table());
  const uint64_t mask = table_.size() - 1;
  const auto tag = static_cast<uint32_t>(hash >> 32);
  uint64_t slot = hash & mask;
  for (; table_[slot].number != Slot{}.number; slot = (slot + 1) & mask) {
    const uint32_t number = table_[slot].number;
    if (table_[slot].hash != tag || this->range(number) != range) continue;
    const auto there = this->codeword(number);
    if (std::equal(there.begin(), there.end(), codeword.begin(), codeword.end())) return number;
  }
  if (places_.size() >= uint64_t{most_codewords})
    return fail(ErrorCode::limit, {},
                "more than 2^32 - 2 different bricks: expected fewer: encode the volume in parts");
  VOX_TRY(const uint64_t place, append(range, codeword));
  const auto number = static_cast<uint32_t>(places_.size());
  if (places_.size() == places_.capacity()) {
    const uint64_t more = std::max<uint64_t>(1024, places_.size());
    VOX_CHECK(reservation_.add(more * sizeof(uint64_t), "the places of unique bricks"));
    places_.reserve(places_.size() + more);
  }
  places_.push_back(place);
  table_[slot] = {number, tag};
  return number;
}

Result<uint64_t> UniqueCodes::append(BrickRange range, std::span<const std::byte> codeword) {
  constexpr uint64_t segment = uint64_t{1} << segment_log2;
  const uint64_t bytes = head + codeword.size();
  if (segments_.empty() || end_ + bytes + read_slack > segment) {
    VOX_CHECK(reservation_.add(segment, "the codes of unique bricks"));
    segments_.push_back(std::make_unique<std::byte[]>(segment));
    end_ = 0;
  }
  const uint64_t place = (segments_.size() - 1) << segment_log2 | end_;
  std::byte* const p = segments_.back().get() + end_;
  store_le(p, range.min);
  store_le(p + 2, range.max);
  p[4] = static_cast<std::byte>(codeword.size());
  std::copy(codeword.begin(), codeword.end(), p + head);
  end_ += bytes;
  return place;
}

Status UniqueCodes::grow_table() {
  const uint64_t slots = std::max<uint64_t>(4096, 2 * table_.size());
  VOX_CHECK(reservation_.add(slots * sizeof(Slot), "the table of unique bricks"));
  const uint64_t old = table_.size() * sizeof(Slot);
  std::vector<Slot> table(slots);
  for (uint32_t number = 0; number < places_.size(); ++number) {
    const uint64_t hash = hash_of(range(number), codeword(number));
    uint64_t slot = hash & (slots - 1);
    while (table[slot].number != Slot{}.number) slot = (slot + 1) & (slots - 1);
    table[slot] = {number, static_cast<uint32_t>(hash >> 32)};
  }
  table_ = std::move(table);
  reservation_.release(old);
  return {};
}

BrickRange UniqueCodes::range(uint64_t number) const {
  const std::byte* const p = at(places_[number]);
  return {load_le<uint16_t>(p), load_le<uint16_t>(p + 2)};
}
std::span<const std::byte> UniqueCodes::codeword(uint64_t number) const {
  const std::byte* const p = at(places_[number]);
  return {p + head, std::to_integer<size_t>(p[4])};
}
Brick UniqueCodes::decode(uint64_t number) const {
  Brick brick;
  const BrickRange r = range(number);
  const auto code = codeword(number);
  if (code.empty())
    brick.fill(r.min);
  else
    decode_codeword(code.data(), static_cast<uint32_t>(code.size()), 16, r, brick.data());
  return brick;
}

}  // namespace voxkit::vq
