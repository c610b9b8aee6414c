// Masks by the book: slow and plain, written from the format. It expects valid bytes.
#pragma once

#include "tests/libpage/reference.h"

namespace voxkit::page::test {

class ReferenceMasks {
 public:
  explicit ReferenceMasks(std::span<const std::byte> model) {
    ReferenceBits in(model);
    parents_ = in.get(8) == 2;
    for (size_t c = 0; c < numbers_.size(); ++c) {
      c += in.golomb(2);
      if (c < numbers_.size()) numbers_[c] = in.get(5);
    }
  }

  /// Of each voxel whether it is solid. `above`: the same of the page of parents, of which (x, y, z) is the
  /// parent of the first voxel.
  std::vector<bool> decode(std::span<const std::byte> page, Extent e, const std::vector<bool>& above,
                           Extent above_extent, int x0, int y0, int z0) const {
    std::vector<bool> solid(static_cast<size_t>(e.voxels()));
    const auto at = [&](int x, int y, int z) -> uint64_t {
      if (x < 0 || y < 0 || z < 0 || x >= e.nx || y >= e.ny) return 0;
      return solid[static_cast<size_t>((z * e.ny + y) * e.nx + x)];
    };
    const auto parent = [&](int x, int y, int z) -> uint64_t {
      if (x < 0 || y < 0 || z < 0 || x >= above_extent.nx || y >= above_extent.ny || z >= above_extent.nz)
        return 0;
      return above[static_cast<size_t>((z * above_extent.ny + y) * above_extent.nx + x)];
    };
    uint64_t state = 0;
    const size_t state_bytes = page.size() <= 8 ? page.size() : 5 + (page.size() - 5) % 4;
    for (size_t i = state_bytes; i-- > 0;) state = state << 8 | std::to_integer<uint64_t>(page[i]);
    std::span<const std::byte> words = page.subspan(state_bytes);
    for (int z = 0; z < e.nz; ++z)
      for (int y = 0; y < e.ny; ++y)
        for (int x = 0; x < e.nx; ++x) {
          if (page.empty()) continue;
          const int i = x0 + x / 2, j = y0 + y / 2, k = z0 + z / 2;
          if (parents_ && parent(i, j, k) == 0) continue;
          auto&& here = solid[static_cast<size_t>((z * e.ny + y) * e.nx + x)];
          if (page.size() == 1) {
            here = true;
            continue;
          }
          uint64_t context = 0;
          if (parents_) {
            const uint64_t bits[] = {at(x - 1, y, z),
                                     at(x - 1, y - 1, z),
                                     at(x, y - 1, z),
                                     at(x + 1, y - 1, z),
                                     at(x - 1, y, z - 1),
                                     at(x, y, z - 1),
                                     at(x, y - 1, z - 1),
                                     parent(i + (x % 2 != 0 ? 1 : -1), j, k),
                                     parent(i, j + (y % 2 != 0 ? 1 : -1), k),
                                     parent(i, j, k + (z % 2 != 0 ? 1 : -1))};
            for (size_t b = 0; b < 10; ++b) context += bits[b] << b;
            context += static_cast<uint64_t>(4 * (z % 2) + 2 * (y % 2) + x % 2) << 10;
          } else {
            const uint64_t bits[] = {at(x - 1, y, z),
                                     at(x - 2, y, z),
                                     at(x - 1, y - 1, z),
                                     at(x, y - 1, z),
                                     at(x + 1, y - 1, z),
                                     at(x - 1, y, z - 1),
                                     at(x, y, z - 1),
                                     at(x + 1, y, z - 1),
                                     at(x, y - 2, z),
                                     at(x, y - 1, z - 1),
                                     at(x, y + 1, z - 1),
                                     at(x, y, z - 2),
                                     z > 0};
            for (size_t b = 0; b < 13; ++b) context += bits[b] << b;
          }
          constexpr uint64_t parts[] = {1024, 1,    2,    4,    7,    12,   20,   32,   48,   72,   104,
                                        148,  208,  288,  392,  528,  700,  900,  1148, 1348, 1520, 1656,
                                        1760, 1840, 1900, 1944, 1976, 2000, 2016, 2028, 2041, 2047};
          const uint64_t part = parts[numbers_[context]], slot = state % 2048;
          here = slot < part;
          state = slot < part ? state / 2048 * part + slot : state / 2048 * (2048 - part) + slot - part;
          if (state >> 32 == 0 && !words.empty()) {
            for (size_t b = 4; b-- > 0;)
              state = state << 8 | std::to_integer<uint64_t>(words[words.size() - 4 + b]);
            words = words.first(words.size() - 4);
          }
        }
    return solid;
  }

 private:
  bool parents_ = false;
  std::array<uint64_t, 8192> numbers_{};
};

}  // namespace voxkit::page::test
