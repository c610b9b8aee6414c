#include "formats/volume/openvdb_tree.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstring>
#include <map>
#include <vector>

#include "formats/little_endian.h"

namespace voxkit {
namespace {

constexpr uint64_t leaf_entries = 512, lower_entries = 4096, upper_entries = 32768;
constexpr int32_t upper_extent = 4096;  // voxels a side of a child of the root
constexpr uint64_t blosc_header = 16;

class Walker {
 public:
  Walker(std::span<const std::byte> file, const std::string& name, uint64_t start, const VdbCoding& coding)
      : file_(file), name_(name), at_(start), coding_(coding) {}

  Result<VdbTree> walk() {
    VOX_TRY(const auto buffers, number<int32_t>());
    if (buffers != 1) return broken(fmt::format("tree of {} buffers: expected 1", buffers));
    VOX_CHECK(skip(value_bytes()));  // background
    VOX_TRY(const auto tiles, number<uint32_t>());
    VOX_TRY(const auto children, number<uint32_t>());
    VOX_CHECK(skip(tiles * (12 + value_bytes() + 1)));
    // OpenVDB reads the buffers of leaves in the order of the root's table, not in that of the file.
    std::map<std::array<int32_t, 3>, std::vector<uint64_t>> leaf_masks;
    for (uint32_t i = 0; i < children; ++i) {
      std::array<int32_t, 3> origin;
      for (int32_t& side : origin) {
        VOX_TRY(side, number<int32_t>());
        if (side % upper_extent != 0) return broken("origin of a node is not a multiple of 4096");
      }
      const auto [entry, is_new] = leaf_masks.try_emplace(origin);
      if (!is_new) return broken("two nodes have one origin");
      VOX_CHECK(upper_node(entry->second));
    }
    for (const auto& [origin, masks] : leaf_masks) {
      for (const uint64_t mask : masks) VOX_CHECK(leaf_buffer(mask));
    }
    tree_.end = at_;
    return tree_;
  }

 private:
  tl::unexpected<Error> broken(const std::string& why) const {
    return bad_input(name_, fmt::format("corrupt OpenVDB file: tree at byte {}: {}", at_, why));
  }
  uint64_t value_bytes() const { return static_cast<uint64_t>(coding_.value_bytes); }
  Status skip(uint64_t bytes) {
    if (bytes > file_.size() - at_)
      return broken(fmt::format("a length leads past the end of the file: {} bytes: expected at most {}",
                                bytes, file_.size() - at_));
    at_ += bytes;
    return {};
  }
  template <class T>
  Result<T> number() {
    const uint64_t from = at_;
    VOX_CHECK(skip(sizeof(T)));
    return load_le<T>(file_.data() + from);
  }
  /// Skips a mask of so many bits; gives its byte offset.
  Result<uint64_t> mask(uint64_t bits) {
    const uint64_t from = at_;
    VOX_CHECK(skip(bits / 8));
    return from;
  }
  bool bit(uint64_t mask, uint64_t i) const {
    return std::to_integer<unsigned>(file_[mask + i / 8]) >> (i % 8) & 1;
  }
  uint64_t count(uint64_t mask, uint64_t bits) const {
    uint64_t ones = 0;
    for (uint64_t i = 0; i < bits / 8; i += 8)
      ones += static_cast<uint64_t>(std::popcount(load_le<uint64_t>(file_.data() + mask + i)));
    return ones;
  }

  Status upper_node(std::vector<uint64_t>& leaf_masks) {
    ++tree_.upper;
    VOX_TRY(const auto children, mask(upper_entries));
    VOX_TRY(const auto active, mask(upper_entries));
    VOX_CHECK(values(active, upper_entries));
    for (uint64_t i = 0; i < upper_entries; ++i) {
      if (bit(children, i)) VOX_CHECK(lower_node(leaf_masks));
    }
    return {};
  }

  Status lower_node(std::vector<uint64_t>& leaf_masks) {
    ++tree_.lower;
    VOX_TRY(const auto children, mask(lower_entries));
    VOX_TRY(const auto active, mask(lower_entries));
    VOX_CHECK(values(active, lower_entries));
    const uint64_t leaves = count(children, lower_entries);
    tree_.leaves += leaves;
    for (uint64_t i = 0; i < leaves; ++i) {
      VOX_TRY(leaf_masks.emplace_back(), mask(leaf_entries));
    }
    return {};
  }

  Status leaf_buffer(uint64_t active) {
    VOX_TRY(const auto again, mask(leaf_entries));
    if (std::memcmp(file_.data() + again, file_.data() + active, leaf_entries / 8) != 0)
      return broken("mask of a leaf's buffer differs from that of the leaf");
    if (coding_.bits) return skip(12 + leaf_entries / 8);
    return values(active, leaf_entries);
  }

  /// The values of a node: a byte that says what is left out, inactive values, a mask that selects between
  /// them, and a block of all or of the active values.
  Status values(uint64_t active, uint64_t entries) {
    VOX_TRY(const auto kind, number<uint8_t>());
    if (kind > 6) return broken(fmt::format("values of kind {}: expected 0 to 6", kind));
    const uint64_t inactive_values = kind == 5 ? 2 : kind == 2 || kind == 4 ? 1 : 0;
    VOX_CHECK(skip(inactive_values * value_bytes()));
    if (kind >= 3 && kind <= 5) VOX_CHECK(skip(entries / 8));
    const bool all = kind == 6 || (coding_.flags & VdbCoding::active_mask) == 0;
    const uint64_t stored = all ? entries : count(active, entries);
    if (stored == 0 && coding_.stored_bytes != coding_.value_bytes) return {};
    return block(stored * static_cast<uint64_t>(coding_.stored_bytes));
  }

  /// `bytes` bytes of values, compressed or not.
  Status block(uint64_t bytes) {
    if ((coding_.flags & (VdbCoding::zip | VdbCoding::blosc)) == 0) return skip(bytes);
    VOX_TRY(const auto length, number<int64_t>());
    if (length <= 0) {
      // Stored as it is, with its length negated.
      if (uint64_t{0} - static_cast<uint64_t>(length) != bytes)
        return broken(fmt::format("block of length {}: expected -{} for its values", length, bytes));
      return skip(bytes);
    }
    const uint64_t from = at_;
    VOX_CHECK(skip(static_cast<uint64_t>(length)));
    if ((coding_.flags & VdbCoding::blosc) == 0) return {};
    const std::byte* header = file_.data() + from;
    if (static_cast<uint64_t>(length) < blosc_header || load_le<uint32_t>(header + 4) != bytes ||
        load_le<uint32_t>(header + 12) != static_cast<uint64_t>(length))
      return broken(fmt::format("Blosc block is not one of {} bytes that unpacks to {}", length, bytes));
    return {};
  }

  std::span<const std::byte> file_;
  const std::string& name_;
  uint64_t at_;
  VdbCoding coding_;
  VdbTree tree_;
};

}  // namespace

Result<VdbTree> check_vdb_tree(std::span<const std::byte> file, const std::string& name, uint64_t start,
                               const VdbCoding& coding) {
  if (start > file.size()) return bad_input(name, "corrupt OpenVDB file: its tree lies past its end");
  return Walker(file, name, start, coding).walk();
}

}  // namespace voxkit
