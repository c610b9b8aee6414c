// Which voxels of a page are solid. Void ones have no sample; where they lie is coded apart from samples.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "formats/result.h"
#include "libpage/extent.h"

namespace voxkit::page {

/// A bit for each voxel of a page: bit x of row y of plane z.
struct Mask {
  std::array<uint16_t, max_side * max_side> rows{};

  uint16_t& row(int y, int z) { return rows[static_cast<size_t>(z * max_side + y)]; }
  uint16_t row(int y, int z) const { return rows[static_cast<size_t>(z * max_side + y)]; }
  bool solid(int x, int y, int z) const { return (row(y, z) >> x & 1) != 0; }
  void set(int x, int y, int z) { row(y, z) = static_cast<uint16_t>(row(y, z) | 1u << x); }
  bool empty() const {
    return std::ranges::all_of(rows, [](uint16_t bits) { return bits == 0; });
  }
  int count() const {
    int sum = 0;
    for (const uint16_t bits : rows) sum += std::popcount(bits);
    return sum;
  }
  friend bool operator==(const Mask&, const Mask&) = default;
};
/// A page without void voxels.
Mask full_mask(Extent extent);

/// Void voxels become as the one before, above or behind; those that have none, as the first solid one.
/// Without solid voxels nothing changes.
template <class T>
void fill_void(const Mask& mask, Extent extent, std::span<T> samples) {
  const auto index = [&](int x, int y, int z) {
    return static_cast<size_t>((z * extent.ny + y) * extent.nx + x);
  };
  const auto visit = [&](const auto& take) {
    for (int z = 0; z < extent.nz; ++z)
      for (int y = 0; y < extent.ny; ++y)
        for (int x = 0; x < extent.nx; ++x) take(x, y, z, samples[index(x, y, z)]);
  };
  std::optional<T> first_solid;
  visit([&](int x, int y, int z, T sample) {
    if (!first_solid && mask.solid(x, y, z)) first_solid = sample;
  });
  if (!first_solid) return;
  visit([&](int x, int y, int z, T& sample) {
    if (mask.solid(x, y, z)) return;
    sample = x > 0   ? samples[index(x - 1, y, z)]
             : y > 0 ? samples[index(x, y - 1, z)]
             : z > 0 ? samples[index(x, y, z - 1)]
                     : *first_solid;
  });
}

/// The mask of the page of the next coarser level that a page's parents lie in, and where in it they do: the
/// parent of voxel (i, j, k) is (x + i / 2, y + j / 2, z + k / 2). All children of a void voxel are void.
struct MaskParent {
  const Mask* mask = nullptr;
  Extent extent{};
  int x = 0, y = 0, z = 0;
};

/// How probable solid voxels are beside what is known around them: what the masks of a level are coded with.
/// Immutable; copies share what they hold.
class MaskModel {
 public:
  /// Contexts of a model: 12 bits of neighbours, and whether there is a plane before; or, with parents, which
  /// child a voxel is, 7 bits of neighbours and 3 of its parent's.
  static constexpr size_t contexts = 8192;

  /// Counts void and solid voxels of sample pages.
  class Builder {
   public:
    explicit Builder(bool parents) : parents_(parents), counts_(contexts) {}
    void add(const Mask& mask, Extent extent, const MaskParent& parent = {});
    MaskModel build() const;

   private:
    bool parents_;
    std::vector<std::array<uint64_t, 2>> counts_;  ///< void, solid
  };

  /// Safe on any bytes: a model, or ErrorCode::input.
  static Result<MaskModel> parse(std::span<const std::byte> bytes);
  std::vector<std::byte> serialise() const;
  bool has_parents() const { return data_->parents; }

  /// Appends the bytes of a page: none where all voxels are void, one where all are solid whose parents are.
  /// Solid voxels lie inside of `extent`. With parents, they are children of solid ones.
  void encode(const Mask& mask, Extent extent, std::vector<std::byte>& out,
              const MaskParent& parent = {}) const;
  /// Safe on any bytes. Errors: ErrorCode::input for a page that does not end where its voxels end;
  /// ErrorCode::usage for parents that are not those of all voxels.
  Result<Mask> decode(std::span<const std::byte> page, Extent extent, const MaskParent& parent = {}) const;

 private:
  struct Data {
    bool parents = false;
    std::array<uint8_t, contexts> number{};  ///< numbers of probabilities; 0: not known
  };
  explicit MaskModel(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
  std::shared_ptr<const Data> data_;
};

}  // namespace voxkit::page
