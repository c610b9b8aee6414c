#include "formats/volume/vti_blocks.h"

#include <fmt/format.h>
#include <lz4.h>
#include <zlib.h>

#include <algorithm>
#include <cstring>

namespace voxkit::vti {
namespace {

constexpr int64_t batch_voxels = 1 << 16;

class BlockSource final : public VolumeSource {
 public:
  BlockSource(std::shared_ptr<BlockFile> blocks, const VolumeInfo& info, const SampleLayout& layout)
      : blocks_(std::move(blocks)), layout_(layout) {
    info_ = info;
  }
  Status read(const Box& box, VoxelSpan out) override {
    if (box.empty()) return {};
    const Index3 size = box.size();
    const int64_t bytes = layout_.bytes_per_voxel();
    std::vector<std::byte> row(static_cast<size_t>(std::min(size.x, batch_voxels) * bytes));
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y)
        for (int64_t x = 0; x < size.x; x += batch_voxels) {
          const int64_t n = std::min(batch_voxels, size.x - x);
          const int64_t voxel = ((box.lo.z + z) * info_.dims.y + box.lo.y + y) * info_.dims.x + box.lo.x + x;
          const auto part = std::span(row).first(static_cast<size_t>(n * bytes));
          VOX_CHECK(blocks_->read(static_cast<uint64_t>(voxel * bytes), part));
          convert_samples(part.data(), layout_, n, info_, out.row(y, z) + x * voxel_bytes(info_.format));
        }
    return {};
  }

 private:
  std::shared_ptr<BlockFile> blocks_;
  SampleLayout layout_;
};

/// Whether `packed` is, unpacked, exactly as long as `out`, which it fills then.
bool unpack(Packing packing, std::span<const std::byte> packed, std::span<std::byte> out) {
  if (packing == Packing::lz4) {  // whose sizes are ints, as blocks are
    if (packed.size() > LZ4_MAX_INPUT_SIZE) return false;
    const int count = ::LZ4_decompress_safe(reinterpret_cast<const char*>(packed.data()),
                                            reinterpret_cast<char*>(out.data()),
                                            static_cast<int>(packed.size()), static_cast<int>(out.size()));
    return count >= 0 && static_cast<size_t>(count) == out.size();
  }
  uLongf count = out.size();
  const int code = ::uncompress(reinterpret_cast<Bytef*>(out.data()), &count,
                                reinterpret_cast<const Bytef*>(packed.data()), packed.size());
  return code == Z_OK && count == out.size();
}

class BlockStream final : public InputStream {
 public:
  BlockStream(std::shared_ptr<BlockFile> blocks, const std::string& name, uint64_t bytes)
      : blocks_(std::move(blocks)), bytes_(bytes) {
    name_ = name;
  }
  Result<size_t> read(std::span<std::byte> out) override {
    const size_t take = static_cast<size_t>(std::min<uint64_t>(out.size(), bytes_ - position_));
    VOX_CHECK(blocks_->read(position_, out.first(take)));
    position_ += take;
    return take;
  }

 private:
  std::shared_ptr<BlockFile> blocks_;
  uint64_t bytes_;
};

}  // namespace

Result<std::shared_ptr<const std::vector<std::byte>>> BlockFile::get(uint64_t index) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(recent_.begin(), recent_.end(),
                                    [&](const Block& block) { return block.index == index; });
    if (found != recent_.end()) {
      recent_.splice(recent_.begin(), recent_, found);
      return recent_.front().bytes;
    }
  }
  const uint64_t first = offsets_[index], expected = std::min(block_, bytes_ - index * block_);
  const auto packed = file_->bytes().subspan(first, offsets_[index + 1] - first);
  auto bytes = std::make_shared<std::vector<std::byte>>(static_cast<size_t>(expected));
  if (!unpack(packing_, packed, *bytes))
    return bad_input(file_->name(),
                     fmt::format("block {} of voxel data at byte {}: corrupt data: expected {} bytes", index,
                                 first, expected));
  const std::lock_guard lock(mutex_);
  recent_.push_front({index, bytes});
  if (recent_.size() > kept_) recent_.pop_back();
  return std::shared_ptr<const std::vector<std::byte>>(std::move(bytes));
}

Status BlockFile::read(uint64_t at, std::span<std::byte> out) {
  while (!out.empty()) {
    VOX_CHECK(check_interrupt());
    VOX_TRY(const auto block, get(at / block_));
    const uint64_t within = at % block_;
    const size_t take = static_cast<size_t>(std::min<uint64_t>(out.size(), block->size() - within));
    std::memcpy(out.data(), block->data() + within, take);
    out = out.subspan(take);
    at += take;
  }
  return {};
}

std::unique_ptr<InputStream> stream_of(std::shared_ptr<BlockFile> blocks, const std::string& name,
                                       uint64_t bytes) {
  return std::make_unique<BlockStream>(std::move(blocks), name, bytes);
}

std::unique_ptr<VolumeSource> block_source(std::shared_ptr<BlockFile> blocks, const VolumeInfo& info,
                                           const SampleLayout& layout) {
  return std::make_unique<BlockSource>(std::move(blocks), info, layout);
}

}  // namespace voxkit::vti
