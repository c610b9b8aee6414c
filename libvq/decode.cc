// Random access to a compressed volume: opening, bricks, single voxels, regions.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <type_traits>

#include "formats/volume_chunks.h"
#include "libvq/store.h"

namespace voxkit::vq {

Volume::Volume() = default;
Volume::~Volume() = default;

Result<std::shared_ptr<const Volume>> Volume::open(std::shared_ptr<const Container> container) {
  const std::string& file = container->name();
  if (container->codec() != Codec::vq) return bad_input(file, "header, byte 10: not a VQ volume");
  std::shared_ptr<Volume> volume(new Volume);
  VOX_TRY(volume->info_, read_volume_info(*container));
  VOX_TRY(const auto params_bytes, container->only_chunk(params_kind));
  VOX_TRY(auto unpacked, unpack_params(params_bytes, volume->info_, file));
  volume->params_ = unpacked.params;
  volume->store_ = std::make_unique<Store>();
  volume->store_->view = unpacked.view;
  VOX_CHECK(volume->store_->find_chunks(*container));
  volume->container_ = std::move(container);
  return volume;
}

const View& Volume::view() const {
  return store_->view;
}
Index3 Volume::bricks() const {
  return bricks_of(info_.dims);
}
Voxel Volume::no_value() const {
  if (info_.format == VoxelFormat::float32) return Voxel::of(std::numeric_limits<float>::quiet_NaN());
  return vq::voxel_of(0, info_.format, info_.fill.value_or(0), 1);
}
Voxel Volume::voxel_of(uint16_t code) const {
  return params_.special == code ? no_value() : vq::voxel_of(code, info_.format, params_.base, params_.step);
}

/// A reader whose failures have reasons.
struct Decoder {
  const Volume& volume;
  const MappedPools pools{volume};
  const Reader<MappedPools> reader{volume.view(), pools};

  /// Why the reader had no answer: a damaged chunk, or contents that are not valid.
  [[gnu::cold]] tl::unexpected<Error> no_answer(const std::string& what) const {
    if (const Status status = volume.store().status(); !status) return tl::unexpected<Error>(status.error());
    return bad_input(volume.container().name(), what);
  }
  [[gnu::cold]] tl::unexpected<Error> no_place(Index3 brick) const {
    return no_answer(
        fmt::format("chunk OFFS: the block of brick {},{},{}: not valid entries", brick.x, brick.y, brick.z));
  }
  [[gnu::cold]] tl::unexpected<Error> no_brick(uint64_t id) const {
    return no_answer(fmt::format("chunk CODE: no valid brick {}", id));
  }

  uint64_t id_at(Index3 brick) const {
    return reader.brick_id(static_cast<uint32_t>(brick.x), static_cast<uint32_t>(brick.y),
                           static_cast<uint32_t>(brick.z));
  }
};
constexpr uint64_t no_id = Reader<MappedPools>::no_brick;

Result<uint64_t> Volume::brick_id(Index3 brick) const {
  if (!Box{Index3(0), bricks()}.contains(brick))
    return fail(ErrorCode::internal, container_->name(), "brick outside the volume");
  const Decoder decoder{*this};
  const uint64_t id = decoder.id_at(brick);
  if (id == no_id) return decoder.no_place(brick);
  return id;
}
Result<BrickRange> Volume::brick_range(uint64_t id) const {
  const Decoder decoder{*this};
  Record record;
  if (!decoder.reader.find(id, record)) return decoder.no_brick(id);
  return record.range;
}
Status Volume::decode_brick(uint64_t id, Brick& codes) const {
  const Decoder decoder{*this};
  Record record;
  if (!decoder.reader.find(id, record) || !decoder.reader.decode(record, codes.data()))
    return decoder.no_brick(id);
  return {};
}

Result<Voxel> Volume::sample(Index3 voxel) const {
  if (!info_.box().contains(voxel))
    return fail(ErrorCode::internal, container_->name(), "sample outside the volume");
  const Decoder decoder{*this};
  const Index3 brick = voxel / Index3(brick_edge);
  const uint64_t id = decoder.id_at(brick);
  if (id == no_id) return decoder.no_place(brick);
  const auto within = static_cast<uint32_t>(voxel.x % 4 + 4 * (voxel.y % 4) + 16 * (voxel.z % 4));
  Record record;
  uint16_t code = 0;
  if (!decoder.reader.find(id, record) || !decoder.reader.decode_one(record, within, code))
    return decoder.no_brick(id);
  return voxel_of(code);
}

namespace {

/// The voxels that the codes of a brick stand for.
template <class T>
void to_voxels(const Brick& codes, const Params& params, int32_t most, std::array<T, brick_voxels>& voxels) {
  if constexpr (std::is_floating_point_v<T>) {
    for (size_t i = 0; i < codes.size(); ++i)
      voxels[i] = static_cast<T>(params.base + params.step * codes[i]);
  } else {
    const auto base = static_cast<int64_t>(params.base), step = static_cast<int64_t>(params.step);
    if (step == 1 && base >= 0 && base <= most) {  // 16 bits are enough, and vectors hold more of them
      const auto offset = static_cast<uint16_t>(base), room = static_cast<uint16_t>(most - base);
      for (size_t i = 0; i < codes.size(); ++i) voxels[i] = static_cast<T>(std::min(codes[i], room) + offset);
    } else {
      for (size_t i = 0; i < codes.size(); ++i)
        voxels[i] = static_cast<T>(std::clamp<int64_t>(base + step * codes[i], 0, most));
    }
  }
}

/// Bricks along x that are decoded side by side before their rows are copied: rows of a box can be so far
/// apart that pieces of a brick's width would drive each other out of the cache.
constexpr int64_t run_bricks = 64;

/// Decodes a box of voxels of type T, none above `most`; returns how many bricks were read.
template <class T>
Result<uint64_t> decode_box(const Decoder& decoder, const Box& box, int32_t most, VoxelSpan out) {
  const Params& params = decoder.volume.params();
  const Index3 first = box.lo / Index3(brick_edge), last = (box.hi - Index3(1)) / Index3(brick_edge);
  Brick codes;
  std::array<T, brick_voxels> voxels;
  std::array<T, brick_voxels * run_bricks> rows;  // 16 of run_bricks * 4 voxels
  uint64_t decoded = no_id, count = 0;
  T no_value;
  std::memcpy(&no_value, decoder.volume.no_value().bytes.data(), sizeof no_value);
  for (int64_t z = first.z; z <= last.z; ++z)
    for (int64_t y = first.y; y <= last.y; ++y)
      for (int64_t begin = first.x; begin <= last.x; begin += run_bricks) {
        const int64_t end = std::min(begin + run_bricks, last.x + 1);
        for (int64_t x = begin; x < end; ++x) {
          const uint64_t id = decoder.id_at({x, y, z});
          if (id == no_id) return decoder.no_place({x, y, z});
          if (id != decoded) {
            Record record;
            if (!decoder.reader.find(id, record) || !decoder.reader.decode(record, codes.data()))
              return decoder.no_brick(id);
            to_voxels(codes, params, most, voxels);
            if (params.special)
              for (size_t i = 0; i < codes.size(); ++i)
                if (codes[i] == *params.special) voxels[i] = no_value;
            decoded = id;
          }
          T* const to = &rows[static_cast<size_t>((x - begin) * brick_edge)];
          for (size_t row = 0; row < 16; ++row)
            std::memcpy(to + row * run_bricks * brick_edge, &voxels[row * brick_edge],
                        brick_edge * sizeof(T));
        }
        count += static_cast<uint64_t>(end - begin);
        const Index3 corner = Index3(begin, y, z) * int64_t{brick_edge};
        const Box part = intersect({corner, Index3(end, y + 1, z + 1) * int64_t{brick_edge}}, box);
        const Index3 from = part.lo - corner, to = part.lo - box.lo, size = part.size();
        for (int64_t v = 0; v < size.z; ++v)
          for (int64_t u = 0; u < size.y; ++u) {
            const int64_t row = from.y + u + 4 * (from.z + v);
            std::memcpy(out.row(to.y + u, to.z + v) + to.x * static_cast<int64_t>(sizeof(T)),
                        &rows[static_cast<size_t>(row * run_bricks * brick_edge + from.x)],
                        static_cast<size_t>(size.x) * sizeof(T));
          }
      }
  return count;
}

}  // namespace

Result<uint64_t> Volume::decode(const Box& box, VoxelSpan out) const {
  if (box.empty()) return 0;
  if (!info_.box().contains(box))
    return fail(ErrorCode::internal, container_->name(), "box outside the volume");
  const Decoder decoder{*this};
  switch (info_.format) {
    case VoxelFormat::float32:
      return decode_box<float>(decoder, box, 0, out);
    case VoxelFormat::density16:
      return decode_box<uint16_t>(decoder, box, 65535, out);
    default:
      return decode_box<uint8_t>(decoder, box, info_.format == VoxelFormat::bitmap ? 1 : 255, out);
  }
}

std::optional<Voxel> Volume::uniform(const Box& box) const {
  if (box.empty()) return std::nullopt;
  const Decoder decoder{*this};
  const Index3 first = box.lo / Index3(brick_edge), last = (box.hi - Index3(1)) / Index3(brick_edge);
  uint64_t known = no_id;
  std::optional<uint16_t> code;
  for (int64_t z = first.z; z <= last.z; ++z)
    for (int64_t y = first.y; y <= last.y; ++y)
      for (int64_t x = first.x; x <= last.x; ++x) {
        const uint64_t id = decoder.id_at({x, y, z});
        if (id == no_id) return std::nullopt;
        if (id == known) continue;
        Record record;
        if (!decoder.reader.find(id, record) || record.range.min != record.range.max) return std::nullopt;
        if (code && *code != record.range.min) return std::nullopt;
        known = id;
        code = record.range.min;
      }
  return voxel_of(*code);
}

namespace {

class VqSource final : public VolumeSource {
 public:
  explicit VqSource(std::shared_ptr<const Volume> volume) : volume_(std::move(volume)) {
    info_ = volume_->info();
  }
  Status read(const Box& box, VoxelSpan out) override {
    VOX_CHECK(volume_->decode(box, out));
    return {};
  }
  std::optional<Voxel> uniform(const Box& box) const override { return volume_->uniform(box); }

 private:
  std::shared_ptr<const Volume> volume_;
};

}  // namespace

std::unique_ptr<VolumeSource> open_source(std::shared_ptr<const Volume> volume) {
  return std::make_unique<VqSource>(std::move(volume));
}

}  // namespace voxkit::vq
