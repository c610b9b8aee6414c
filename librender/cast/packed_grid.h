// What a ray sees of a packed volume of scalars: voxels of pages that are decoded when a ray first comes
// there, and whole pages where these hold one value.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <memory>
#include <mutex>
#include <optional>

#include "librender/cast/grid.h"
#include "libsvmm/packed/packed.h"

namespace voxkit::render {

/// A packed volume, drawn from its file: of one that was cut, the finest level that is there.
class PackedGrid {
 public:
  explicit PackedGrid(std::shared_ptr<const svmm::PackedVolume> volume);
  const VolumeInfo& info() const { return info_; }
  const svmm::PackedVolume& volume() const { return *volume_; }

 private:
  VolumeInfo info_;
  std::shared_ptr<const svmm::PackedVolume> volume_;
};

/// The first error of several threads.
class FirstError {
 public:
  void keep(Error error) {
    const std::lock_guard lock(mutex_);
    if (status_) status_ = tl::unexpected<Error>(std::move(error));
  }
  /// When no thread is at work any more.
  const Status& status() const { return status_; }

 private:
  std::mutex mutex_;
  Status status_;
};

struct PackedCastView {
  const svmm::PackedVolume* volume;
  FirstError* error;

  class Cursor {
   public:
    explicit Cursor(const PackedCastView& view)
        : volume_(*view.volume),
          error_(*view.error),
          code_bytes_(is_color(volume_.info().format) ? 0 : svmm::code_bytes(volume_.info().format)),
          log2_side_(std::countr_zero(static_cast<uint32_t>(volume_.params().page_side))),
          coarsest_(volume_.params().levels - 1 - volume_.finest()) {}
    /// `finest`: cells of edge 2^finest, of a coarser level, are fine enough; -1: all detail. Of a damaged
    /// page all is void.
    Cell locate(uint32_t x, uint32_t y, uint32_t z, int finest) {
      const int coarser = std::clamp(finest, 0, coarsest_);
      Seen& seen = seen_[static_cast<size_t>(coarser)];
      x >>= coarser, y >>= coarser, z >>= coarser;
      const uint32_t key[3] = {x >> log2_side_, y >> log2_side_, z >> log2_side_};
      if (key[0] != seen.key[0] || key[1] != seen.key[1] || key[2] != seen.key[2]) enter(coarser, seen, key);
      ++voxels_;
      if (seen.page.uniform) return {seen.page.value, log2_side_ + coarser};
      return {code_bytes_ != 0 ? scalar(seen.page, x, y, z) : color(*seen.reader, {x, y, z}), coarser};
    }
    static uint32_t blocks() { return 0; }
    /// Of voxels looked at.
    uint32_t bytes() const { return voxels_ * static_cast<uint32_t>(voxel_bytes(volume_.info().format)); }

   private:
    /// The page of a level that was last looked at.
    struct Seen {
      uint32_t key[3] = {~0u, ~0u, ~0u};
      svmm::PackedPage page;
      std::optional<svmm::PackedVolume::Reader> reader;
    };

    [[gnu::noinline]] void enter(int coarser, Seen& seen, const uint32_t (&key)[3]) {
      if (!seen.reader) seen.reader.emplace(volume_, volume_.finest() + coarser);
      for (int a = 0; a < 3; ++a) seen.key[a] = key[a];
      auto page = seen.reader->page(Index3(key[0], key[1], key[2]) << int64_t{log2_side_});
      if (page) {
        seen.page = *page;
      } else {
        error_.keep(std::move(page).error());
        seen.page = {};
        seen.page.uniform = true;
      }
    }
    Voxel scalar(const svmm::PackedPage& page, uint32_t x, uint32_t y, uint32_t z) const {
      const int64_t at = ((z - page.lo.z) * page.size.y + (y - page.lo.y)) * page.size.x + (x - page.lo.x);
      const std::byte* const code = page.codes + at * code_bytes_;
      switch (code_bytes_) {
        case 1:
          return Voxel::of(load_le<uint8_t>(code));
        case 2:
          return Voxel::of(load_le<uint16_t>(code));
        default:
          return Voxel::of(volume_.params().map.value(load_le<uint32_t>(code)));
      }
    }
    Voxel color(svmm::PackedVolume::Reader& reader, Index3 voxel) {
      auto found = reader.at(voxel);
      if (found) return *found;
      error_.keep(std::move(found).error());
      return {};
    }

    const svmm::PackedVolume& volume_;
    std::array<Seen, svmm::max_packed_levels> seen_;  ///< by level
    FirstError& error_;
    int code_bytes_, log2_side_, coarsest_;  ///< code_bytes_: 0 of colours
    uint32_t voxels_ = 0;
  };
  Cursor cursor() const { return Cursor(*this); }
};

}  // namespace voxkit::render
