#include "libsvmm/packed/salvage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "libsvmm/packed/packed_pages.h"

namespace voxkit::svmm {

std::vector<Losses::Page> Losses::pages() const {
  const std::lock_guard lock(mutex_);
  std::vector<Page> found;
  for (const auto& [key, page] : pages_) found.push_back(page);
  return found;
}

class SalvagedSource final : public VolumeSource {
 public:
  SalvagedSource(std::shared_ptr<const PackedVolume> volume, int level, const VolumeInfo& info,
                 std::shared_ptr<Losses> losses)
      : volume_(std::move(volume)), level_(level), losses_(std::move(losses)) {
    info_ = info;
    const double sample_0 = info.stored(0), nothing = info.fill.value_or(sample_0);
    if (is_color(info.format))
      void_ = Voxel{};
    else if (info.format == VoxelFormat::float32)
      void_ = Voxel::of(info.fill ? std::numeric_limits<float>::quiet_NaN() : 0.0f);
    else if (info.format == VoxelFormat::density16)
      void_ = Voxel::of(static_cast<uint16_t>(std::clamp(nothing, 0.0, 65535.0)));
    else
      void_ = Voxel::of(static_cast<uint8_t>(std::clamp(nothing, 0.0, 255.0)));
  }

  Status read(const Box& box, VoxelSpan out) override {
    if (volume_->params().has_channels()) {
      read_colors(box, out);
      return {};
    }
    switch (code_bytes(info_.format)) {
      case 4:
        read_as<uint32_t>(box, out);
        break;
      case 2:
        read_as<uint16_t>(box, out);
        break;
      default:
        read_as<uint8_t>(box, out);
    }
    return {};
  }

 private:
  using Codes = std::shared_ptr<const PageCache::Page>;

  /// Calls decode(number, page, part, voxels) for each page of which a part is in the box; where that is
  /// false, the part is void.
  template <class Decode>
  void each_page(const Box& box, VoxelSpan out, const Decode& decode) {
    const PageGrid& grid = volume_->pages().levels[static_cast<size_t>(level_)].grid;
    const Index3 first = box.lo / grid.side, last = (box.hi + (grid.side - 1)) / grid.side;
    for (int64_t z = first.z; z < last.z; ++z)
      for (int64_t y = first.y; y < last.y; ++y)
        for (int64_t x = first.x; x < last.x; ++x) {
          const uint64_t number = grid.number({x, y, z});
          const Box page = grid.box(number), part = intersect(page, box);
          const Index3 at = part.lo - box.lo;
          const VoxelSpan voxels{out.row(at.y, at.z) + at.x * voxel_bytes(info_.format), out.row_stride,
                                 out.slice_stride};
          if (!decode(number, page, part, voxels)) fill(voxels, part.size(), info_.format, void_);
        }
  }
  /// Of colours each page comes back as a whole, or is lost: a part whose checksum is wrong as well.
  void read_colors(const Box& box, VoxelSpan out) {
    each_page(box, out, [&](uint64_t number, const Box&, const Box& part, VoxelSpan voxels) {
      if (volume_->decode(part, level_, voxels)) return true;
      note(level_, number, false);
      return false;
    });
  }
  template <class T>
  void read_as(const Box& box, VoxelSpan out) {
    each_page(box, out, [&](uint64_t number, const Box& page, const Box& part, VoxelSpan voxels) {
      const Codes codes = codes_of<T>(level_, number);
      if (codes)
        place(reinterpret_cast<const T*>(codes->data()), page, part, volume_->params().map, info_.format,
              voxels);
      return codes != nullptr;
    });
  }

  /// The codes of a page; null where it is lost.
  template <class T>
  Codes codes_of(int level, uint64_t number) {
    const auto& pages = volume_->pages();
    const auto& l = pages.levels[static_cast<size_t>(level)];
    const PageCache::Key key{level, number};
    if (is_lost(level, number)) return nullptr;
    if (Codes kept = pages.cache.find(key)) return kept;
    const auto lost = [&]() -> Codes {
      note(level, number, false);
      return nullptr;
    };
    page::Parent<T> parent;
    Codes parents;
    if (l.model->has_parents()) {
      const PageGrid& above = pages.levels[static_cast<size_t>(level + 1)].grid;
      const Index3 child = l.grid.index(number);
      parents = codes_of<T>(level + 1, above.number(child / int64_t{2}));
      if (!parents) return lost();
      parent = placed<T>(child, above);
      parent.samples = {reinterpret_cast<const T*>(parents->data()), parents->size() / sizeof(T)};
    }
    const Container& container = volume_->container();
    const size_t chunk = l.pages.chunks[number / l.grid.pages_a_part()];
    const auto checked = container.chunk(chunk);
    if (!checked && container.table()[chunk].compressed()) return lost();
    const PartView part(checked ? *checked : container.unchecked(chunk),
                        l.grid.pages_of(number / l.grid.pages_a_part()));
    if (!part.valid()) return lost();
    const page::Extent extent = l.grid.extent(number);
    const auto count = static_cast<size_t>(extent.voxels());
    auto made = std::make_shared<PageCache::Page>(count * sizeof(T));
    if (!page::decode_page(*l.model, part.page(number % l.grid.pages_a_part()), extent,
                           std::span<T>(reinterpret_cast<T*>(made->data()), count), parent))
      return lost();
    if (checked)
      pages.cache.keep(key, made);  // others find only sound ones there
    else
      note(level, number, true);
    return made;
  }

  bool is_lost(int level, uint64_t number) const {
    const std::lock_guard lock(losses_->mutex_);
    const auto found = losses_->pages_.find({-level, number});
    return found != losses_->pages_.end() && !found->second.doubtful;
  }
  void note(int level, uint64_t number, bool doubtful) {
    const Index3 at = volume_->pages().levels[static_cast<size_t>(level)].grid.box(number).lo;
    const std::lock_guard lock(losses_->mutex_);
    losses_->pages_.insert_or_assign({-level, number}, Losses::Page{level, at, doubtful});
  }

  std::shared_ptr<const PackedVolume> volume_;
  int level_;
  std::shared_ptr<Losses> losses_;
  Voxel void_;
};

Result<std::unique_ptr<VolumeSource>> open_salvaged(std::shared_ptr<const PackedVolume> volume, int level,
                                                    std::shared_ptr<Losses> losses) {
  VOX_TRY(const auto sound, open_source(volume, level));
  return std::make_unique<SalvagedSource>(std::move(volume), level, sound->info(), std::move(losses));
}

}  // namespace voxkit::svmm
