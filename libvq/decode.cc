// Random access to a compressed volume: opening, bricks, single voxels, regions.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <type_traits>

#include "libvq/store.h"

namespace voxkit::vq {

Volume::Volume() = default;
Volume::~Volume() = default;

Result<std::shared_ptr<const Volume>> Volume::open(std::shared_ptr<const Container> container) {
  const std::string& file = container->name();
  if (container->codec() != Codec::vq) return bad_input(file, "header, byte 10: not a VQ volume");
  std::shared_ptr<Volume> volume(new Volume);
  VOX_TRY(const auto info_bytes, container->only_chunk(volume_info_kind));
  VOX_TRY(volume->info_, unpack_volume_info(info_bytes, file));
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
Voxel Volume::voxel_of(uint16_t code) const {
  return vq::voxel_of(code, info_.format, params_.base, params_.step);
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
void to_voxels(const Brick& codes, const Params& params, int32_t most, std::byte* out) {
  std::array<T, brick_voxels> voxels;
  if constexpr (std::is_floating_point_v<T>) {
    for (size_t i = 0; i < codes.size(); ++i)
      voxels[i] = static_cast<T>(params.base + params.step * codes[i]);
  } else {
    const auto base = static_cast<int64_t>(params.base), step = static_cast<int64_t>(params.step);
    if (step == 1 && base >= 0) {
      const auto offset = static_cast<int32_t>(base);
      for (size_t i = 0; i < codes.size(); ++i)
        voxels[i] = static_cast<T>(std::min<int32_t>(offset + codes[i], most));
    } else {
      for (size_t i = 0; i < codes.size(); ++i)
        voxels[i] = static_cast<T>(std::clamp<int64_t>(base + step * codes[i], 0, most));
    }
  }
  std::memcpy(out, voxels.data(), sizeof voxels);
}

void to_voxels(const Brick& codes, VoxelFormat format, const Params& params, std::byte* out) {
  switch (format) {
    case VoxelFormat::float32:
      return to_voxels<float>(codes, params, 0, out);
    case VoxelFormat::density16:
      return to_voxels<uint16_t>(codes, params, 65535, out);
    default:
      return to_voxels<uint8_t>(codes, params, format == VoxelFormat::bitmap ? 1 : 255, out);
  }
}

/// Copies the part of a brick, of 4^3 voxels of `bytes` bytes, that begins at `from`.
void copy_part(const std::byte* brick, Index3 from, Index3 size, int bytes, VoxelSpan out) {
  const auto row_of = [&](int64_t y, int64_t z) {
    return brick + (from.x + 4 * (from.y + y) + 16 * (from.z + z)) * bytes;
  };
  const auto copy_rows = [&](auto width) {  // a constant, where rows are whole
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y)
        std::memcpy(out.row(y, z), row_of(y, z), static_cast<size_t>(width));
  };
  const int64_t width = size.x * bytes;
  if (width == 4) return copy_rows(std::integral_constant<int, 4>());
  if (width == 8) return copy_rows(std::integral_constant<int, 8>());
  if (width == 16) return copy_rows(std::integral_constant<int, 16>());
  copy_rows(width);
}

}  // namespace

Result<uint64_t> Volume::decode(const Box& box, VoxelSpan out) const {
  if (box.empty()) return 0;
  if (!info_.box().contains(box))
    return fail(ErrorCode::internal, container_->name(), "box outside the volume");
  const Decoder decoder{*this};
  const int bytes = voxel_bytes(info_.format);
  const Index3 first = box.lo / Index3(brick_edge), last = (box.hi - Index3(1)) / Index3(brick_edge);
  Brick codes;
  std::array<std::byte, brick_voxels * sizeof(float)> voxels;
  uint64_t decoded = no_id, count = 0;
  for (int64_t z = first.z; z <= last.z; ++z)
    for (int64_t y = first.y; y <= last.y; ++y)
      for (int64_t x = first.x; x <= last.x; ++x) {
        const uint64_t id = decoder.id_at({x, y, z});
        if (id == no_id) return decoder.no_place({x, y, z});
        ++count;
        if (id != decoded) {
          Record record;
          if (!decoder.reader.find(id, record) || !decoder.reader.decode(record, codes.data()))
            return decoder.no_brick(id);
          to_voxels(codes, info_.format, params_, voxels.data());
          decoded = id;
        }
        const Index3 corner = Index3(x, y, z) * int64_t{brick_edge};
        const Box part = intersect({corner, corner + Index3(brick_edge)}, box);
        const Index3 to = part.lo - box.lo;
        copy_part(voxels.data(), part.lo - corner, part.size(), bytes,
                  {out.row(to.y, to.z) + to.x * bytes, out.row_stride, out.slice_stride});
      }
  return count;
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
