#include "libsvmm/packed/packed_layout.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include "formats/little_endian.h"

namespace voxkit::svmm {
namespace {

constexpr size_t params_bytes = 64;
constexpr uint32_t most_length_bits = 24;

}  // namespace

int level_count(Index3 dims, int page_side) {
  int count = 1;
  while (std::max({dims.x, dims.y, dims.z}) > page_side) {
    dims = level_dims(dims, 1);
    ++count;
  }
  return count;
}

std::vector<uint64_t> spread_pages(uint64_t pages, uint64_t most) {
  std::vector<uint64_t> numbers;
  uint64_t stride = pages - pages * 382 / 1000;  // near the golden section; there are fewer than 2^50
  while (std::gcd(stride, pages) != 1) ++stride;
  for (uint64_t i = 0, number = stride / 2 % pages; i < std::min(pages, most); ++i) {
    numbers.push_back(number);
    number = (number + stride) % pages;
  }
  return numbers;
}

std::vector<std::pair<uint64_t, uint64_t>> runs_of(const PageGrid& grid, uint64_t first, uint64_t last) {
  std::vector<std::pair<uint64_t, uint64_t>> runs;
  const auto row = static_cast<uint64_t>(grid.count.x);
  constexpr uint64_t longest = 32;
  while (first < last) {
    const uint64_t end = std::min({last, (first / row + 1) * row, first + longest});
    runs.emplace_back(first, end);
    first = end;
  }
  return runs;
}

std::vector<std::byte> pack_params(const PackedParams& p) {
  std::vector<std::byte> bytes(params_bytes);
  bytes[0] = static_cast<std::byte>(std::countr_zero(static_cast<unsigned>(p.page_side)));
  bytes[1] = static_cast<std::byte>(p.levels);
  bytes[2] = static_cast<std::byte>(p.map.kind);
  bytes[3] = static_cast<std::byte>(p.opaque);
  if (p.has_channels()) bytes[4] = static_cast<std::byte>(p.channels.differences);
  store_le(&bytes[8], p.map.lo);
  store_le(&bytes[16], p.map.step);
  store_le(&bytes[24], p.max_error);
  return bytes;
}

Result<PackedParams> unpack_packed_params(std::span<const std::byte> bytes, const VolumeInfo& info,
                                          const std::string& file) {
  const auto bad = [&](size_t at, const std::string& what) {
    return bad_input(file, fmt::format("chunk PAKP, byte {}: {}", at, what));
  };
  if (bytes.size() != params_bytes) return bad(bytes.size(), "ends here: expected 64 bytes");
  PackedParams p;
  const int log2_side = std::to_integer<int>(bytes[0]);
  if (log2_side != 3 && log2_side != 4)
    return bad(0, fmt::format("pages of 2^{}: expected 3 or 4", log2_side));
  p.page_side = 1 << log2_side;
  p.levels = std::to_integer<int>(bytes[1]);
  const int most = level_count(info.dims, p.page_side);
  if (p.levels != 1 && p.levels != most)
    return bad(1, fmt::format("{} levels: expected 1 or {}", p.levels, most));
  const auto kind = std::to_integer<uint8_t>(bytes[2]);
  const bool floats = info.format == VoxelFormat::float32;
  if (is_color(info.format) ? kind != 4 && kind != 5 : floats ? kind != 2 && kind != 3 : kind != 1)
    return bad(2, fmt::format("unknown kind of codes {}", kind));
  const int opaque = std::to_integer<int>(bytes[3]);
  if (opaque > 1 || (opaque == 1 && info.format != VoxelFormat::rgba32))
    return bad(3, fmt::format("opaque {}: expected 0, or of RGBA32 0 or 1", opaque));
  p.opaque = opaque == 1;
  const int differences = std::to_integer<int>(bytes[4]);
  if (kind == 4 ? differences > 1 : differences != 0)
    return bad(4, fmt::format("differences {}: expected 0, or of channels of colours 0 or 1", differences));
  p.channels.differences = differences == 1;
  p.channels.count = info.format == VoxelFormat::rgba32 ? 4 : 3;
  p.map.kind = static_cast<CodeKind>(kind);
  p.map.lo = load_le<double>(&bytes[8]);
  p.map.step = load_le<double>(&bytes[16]);
  p.max_error = load_le<double>(&bytes[24]);
  if (p.map.kind == CodeKind::steps &&
      !(std::isfinite(p.map.lo) && std::isfinite(p.map.step) && p.map.step > 0))
    return bad(8, "steps that are no finite numbers");
  return p;
}

std::vector<std::byte> pack_part(std::span<const std::vector<std::byte>> pages) {
  size_t longest = 0, total = 0;
  for (const auto& page : pages) {
    longest = std::max(longest, page.size());
    total += page.size();
  }
  const auto bits = static_cast<uint32_t>(std::bit_width(longest));
  std::vector<std::byte> bytes(1 + (pages.size() * bits + 7) / 8);
  bytes[0] = static_cast<std::byte>(bits);
  bytes.reserve(bytes.size() + total);
  for (size_t i = 0; i < pages.size(); ++i)
    for (uint32_t b = 0; b < bits; ++b)
      if (pages[i].size() >> b & 1) {
        const size_t at = i * bits + b;
        bytes[1 + at / 8] |= static_cast<std::byte>(1u << at % 8);
      }
  for (const auto& page : pages) bytes.insert(bytes.end(), page.begin(), page.end());
  return bytes;
}

PartView::PartView(std::span<const std::byte> bytes, uint64_t pages) : bytes_(bytes), pages_(pages) {
  if (bytes.empty()) return;
  bits_ = std::to_integer<uint32_t>(bytes[0]);
  head_ = 1 + (pages * bits_ + 7) / 8;
}

uint64_t PartView::length(uint64_t number) const {
  const uint64_t at = number * bits_;
  uint64_t word = 0;
  std::memcpy(&word, &bytes_[1 + at / 8], std::min<size_t>(8, head_ - 1 - at / 8));
  return word >> at % 8 & ((uint64_t{1} << bits_) - 1);
}

bool PartView::valid() const {
  if (head_ == 0 || bits_ > most_length_bits || head_ > bytes_.size()) return false;
  uint64_t total = 0;
  for (uint64_t i = 0; i < pages_ && bits_ > 0; ++i) total += length(i);
  return head_ + total == bytes_.size();
}

std::span<const std::byte> PartView::page(uint64_t number) const {
  if (bits_ == 0) return {};
  uint64_t at = head_;
  for (uint64_t i = 0; i < number; ++i) at += length(i);
  return bytes_.subspan(at, length(number));
}

}  // namespace voxkit::svmm
