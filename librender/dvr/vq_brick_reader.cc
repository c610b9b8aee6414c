// Bricks of VQ files, decoded where something can be seen of them.
#include <algorithm>
#include <array>
#include <cstring>
#include <limits>

#include "librender/dvr/brick_cache.h"
#include "libvq/store.h"

namespace voxkit::render {
namespace {

/// Least and greatest value; lo > hi: none.
struct Extent {
  float lo = std::numeric_limits<float>::infinity(), hi = -lo;
  void add(const Extent& other) { lo = std::min(lo, other.lo), hi = std::max(hi, other.hi); }
};

/// A slot has voxels of up to eight bricks. Brick s is one further along the axes whose bits are set in s.
/// The cells of region r are those between two bricks along the axes in r, so they have voxels of the bricks
/// s whose bits are all in r.
constexpr int parts = 8;
constexpr bool is_within(int s, int r) {
  return (s & ~r) == 0;
}

template <class T>
class VqReader final : public BrickReader<T> {
 public:
  VqReader(std::shared_ptr<const vq::Volume> volume, const TransferFunction* shown)
      : BrickReader<T>(bricks_of(volume->info())),
        volume_(std::move(volume)),
        shown_(shown),
        pools_(*volume_),
        reader_(volume_->view(), pools_),
        remembered_(slots) {
    const vq::Params& params = volume_->params();
    const double most = volume_->info().format == VoxelFormat::density16 ? 65535 : 255;
    offset_ = static_cast<uint16_t>(params.base);
    // Codes that are values less a constant, none of them too large.
    if constexpr (!std::is_floating_point_v<T>)
      only_offset_ = params.step == 1 && params.base >= 0 && !params.special &&
                     params.base + static_cast<double>((1 << params.bits) - 1) <= most;
  }

  void read(uint32_t x, uint32_t y, uint32_t z, T* values) override {
    const Index3& n = this->bricks();
    const Index3& dims = volume_->info().dims;
    const uint32_t at[3] = {x, y, z};
    uint32_t width[3];  // of what is inside the volume
    int beyond = 0;     // axes along which there is no further brick
    for (int a = 0; a < 3; ++a) {
      const bool last = at[a] + 1 == n[a];
      width[a] = last ? static_cast<uint32_t>(dims[a] - int64_t{at[a]} * vq::brick_edge) : slot_edge;
      beyond |= last ? 1 << a : 0;
    }
    Part found[parts];
    bool all_known = true;
    for (int s = 0; s < parts; ++s) {
      Part& part = found[s];
      if ((s & beyond) != 0) continue;
      find(x + (s & 1), y + (s >> 1 & 1), z + (s >> 2), part);
      if (part.known) copy(remembered_[part.id % slots].values.data(), s, width, values);
      all_known &= part.known;
    }
    if (!all_known) decode_shown(found, beyond, width, values);
    replicate(width, values);
  }
  void forget() override {
    for (Remembered& brick : remembered_) brick.id = reader_.no_brick;
  }

 private:
  static constexpr uint32_t slots = remembered_bricks;
  struct Remembered {
    uint64_t id = vq::Reader<vq::MappedPools>::no_brick;
    std::array<T, vq::brick_voxels> values;
  };
  struct Part {
    uint32_t x, y, z;
    uint64_t id;
    bool known = false;  ///< its values are in the slot
    // Of what is not known:
    vq::Record record;
    Extent extent;
    bool shows = false;  ///< by its extent
  };

  T value(uint16_t code) const {
    return only_offset_ ? static_cast<T>(code + offset_) : value_of<T>(volume_->voxel_of(code));
  }

  /// The end of a range: the code for no value is above those of all others.
  float greatest(uint16_t code) const {
    return static_cast<float>(
        value(volume_->params().special == code && code > 0 ? static_cast<uint16_t>(code - 1) : code));
  }

  void find(uint32_t x, uint32_t y, uint32_t z, Part& part) {
    part.x = x, part.y = y, part.z = z;
    part.id = reader_.brick_id(x, y, z);
    part.known = remembered_[part.id % slots].id == part.id && part.id != reader_.no_brick;
    if (part.known) return;
    // What is damaged shows anything: the store has the error.
    if (part.id == reader_.no_brick || !reader_.find(part.id, part.record)) part.record = {};
    part.extent = {static_cast<float>(value(part.record.range.min)), greatest(part.record.range.max)};
    part.shows = shows(part.extent);
  }

  /// Decodes the bricks of all regions that may show something, beginning with those that show something
  /// themselves: what these have at a face is often not what they have inside.
  void decode_shown(Part (&found)[parts], int beyond, const uint32_t (&width)[3], T* values) {
    for (int r = 0; r < parts; ++r) {
      if ((r & beyond) != 0) continue;
      for (int s = next_of(found, r, width, values); s >= 0; s = next_of(found, r, width, values)) {
        copy(decode(found[s]), s, width, values);
        found[s].known = true;
      }
    }
    for (int s = 0; s < parts; ++s)
      if ((s & beyond) == 0 && !found[s].known) {
        std::array<T, vq::brick_voxels> any;
        any.fill(value(found[s].record.range.min));
        copy(any.data(), s, width, values);
      }
  }
  /// The brick to decode next for a region; -1: none.
  int next_of(const Part (&found)[parts], int r, const uint32_t (&width)[3], const T* values) const {
    int next = -1;
    for (int s = r; s >= 0; --s)
      if (is_within(s, r) && !found[s].known) {
        next = s;
        if (found[s].shows) return s;
      }
    if (next < 0) return -1;
    Extent all;
    for (int s = 0; s < parts; ++s)
      if (is_within(s, r)) all.add(found[s].known ? extent(s, r, width, values) : found[s].extent);
    return shows(all) ? next : -1;
  }
  bool shows(const Extent& extent) const { return shown_ == nullptr || shown_->shows(extent.lo, extent.hi); }

  /// Of the values of brick s, which are in the slot, that cells of region r have.
  static Extent extent(int s, int r, const uint32_t (&width)[3], const T* values) {
    uint32_t from[3], to[3];
    for (int a = 0; a < 3; ++a) {
      const bool further = s >> a & 1, between = r >> a & 1;
      from[a] = further ? 4 : between ? 3 : 0;
      to[a] = further ? 5 : std::min(width[a], 4u);
    }
    Extent found;
    for (uint32_t k = from[2]; k < to[2]; ++k)
      for (uint32_t j = from[1]; j < to[1]; ++j)
        for (uint32_t i = from[0]; i < to[0]; ++i) {
          const auto v = static_cast<float>(values[(k * slot_edge + j) * slot_edge + i]);
          found.add({v, v});
        }
    return found;
  }

  /// What a slot has of brick s; what a partial brick is filled up with is left out.
  static void copy(const T* brick, int s, const uint32_t (&width)[3], T* values) {
    uint32_t from[3], count[3];
    for (int a = 0; a < 3; ++a) {
      from[a] = s >> a & 1 ? 4 : 0;
      count[a] = s >> a & 1 ? 1 : std::min(width[a], 4u);
    }
    for (uint32_t k = 0; k < count[2]; ++k)
      for (uint32_t j = 0; j < count[1]; ++j) {
        const T* const row = brick + 4 * j + 16 * k;
        T* const to = values + ((from[2] + k) * slot_edge + from[1] + j) * slot_edge + from[0];
        if (count[0] == 4)
          std::memcpy(to, row, 4 * sizeof(T));
        else
          for (uint32_t i = 0; i < count[0]; ++i) to[i] = row[i];
      }
  }
  /// Beyond the volume all is as at its edge.
  static void replicate(const uint32_t (&width)[3], T* values) {
    const auto place = [&](uint32_t i, uint32_t j, uint32_t k) {
      return values + (k * slot_edge + j) * slot_edge + i;
    };
    for (uint32_t k = 0; k < width[2]; ++k)
      for (uint32_t j = 0; j < width[1]; ++j)
        for (uint32_t i = width[0]; i < slot_edge; ++i) *place(i, j, k) = *place(width[0] - 1, j, k);
    for (uint32_t k = 0; k < width[2]; ++k)
      for (uint32_t j = width[1]; j < slot_edge; ++j)
        std::copy_n(place(0, width[1] - 1, k), slot_edge, place(0, j, k));
    for (uint32_t k = width[2]; k < slot_edge; ++k)
      std::copy_n(place(0, 0, width[2] - 1), slot_edge * slot_edge, place(0, 0, k));
  }

  const T* decode(const Part& part) {
    Remembered& brick = remembered_[part.id % slots];
    brick.id = part.id;
    const vq::BrickRange& range = part.record.range;
    if (range.min == range.max) {
      brick.values.fill(value(range.min));
      return brick.values.data();
    }
    this->count(part.x, part.y, part.z);
    alignas(32) uint16_t codes[vq::brick_voxels];
    // Of a damaged brick the values mean nothing; the store has the error.
    if (!reader_.decode(part.record, codes)) std::fill_n(codes, vq::brick_voxels, range.min);
    if (only_offset_) {
      for (size_t i = 0; i < brick.values.size(); ++i) brick.values[i] = static_cast<T>(codes[i] + offset_);
    } else {
      for (size_t i = 0; i < brick.values.size(); ++i) brick.values[i] = value(codes[i]);
    }
    return brick.values.data();
  }

  std::shared_ptr<const vq::Volume> volume_;
  const TransferFunction* shown_;
  vq::MappedPools pools_;
  vq::Reader<vq::MappedPools> reader_;
  bool only_offset_ = false;
  uint16_t offset_ = 0;
  std::vector<Remembered> remembered_;
};

}  // namespace

template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const vq::Volume> volume,
                                             const TransferFunction* shown) {
  return std::make_unique<VqReader<T>>(std::move(volume), shown);
}
template std::unique_ptr<BrickReader<uint16_t>> brick_reader(std::shared_ptr<const vq::Volume>,
                                                             const TransferFunction*);
template std::unique_ptr<BrickReader<float>> brick_reader(std::shared_ptr<const vq::Volume>,
                                                          const TransferFunction*);

}  // namespace voxkit::render
