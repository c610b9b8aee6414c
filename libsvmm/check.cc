// Finding blocks, and verifying a whole file.
#include <fmt/format.h>

#include <algorithm>

#include "formats/parallel.h"
#include "libsvmm/store.h"

namespace voxkit::svmm {

Result<const std::byte*> Store::block(const Volume& volume, size_t level, uint64_t number) const {
  const LevelStore& store = levels[level];
  if (number >= store.blocks)
    return bad_input(
        volume.container().name(),
        fmt::format("level {}: a link to block {}: expected a number below {}", level, number, store.blocks));
  const uint64_t chunk = number >> store.chunk_log2;
  VOX_TRY(const auto bytes, volume.container().chunk(store.chunks[chunk]));
  store.found[chunk].store(bytes.data(), std::memory_order_release);
  return bytes.data() + (number - (chunk << store.chunk_log2)) * store.block_bytes;
}

const std::byte* Store::block_or_null(const Volume& volume, int level, uint64_t number) const {
  const auto bytes = block(volume, static_cast<size_t>(level), number);
  if (bytes) return *bytes;
  const std::lock_guard lock(mutex_);
  if (status_) status_ = tl::unexpected<Error>(bytes.error());
  return nullptr;
}

Status Store::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

Status Volume::check(Context& ctx) const {
  const std::string& file = container_->name();
  VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(container_->table().size()), [&](int64_t i) -> Status {
    VOX_CHECK(container_->chunk(static_cast<size_t>(i)));
    return {};
  }));
  // Links of a level count through the blocks of the level below, in order, each block once.
  for (size_t k = levels_.size() - 1; k >= 1; --k) {
    std::vector<std::pair<uint64_t, uint64_t>> runs;  // [first, end) of children, block after block
    uint64_t children = 0;
    for (uint64_t b = 0; b < levels_[k].blocks; ++b) {
      VOX_CHECK(check_interrupt());
      VOX_TRY(const std::byte* bytes, store_->block(*this, k, b));
      const StructuralBlock block{bytes, store_->levels[k].size, info_.format, params_.layout};
      for (int64_t s = 0; s < block.subblocks(); ++s) {
        const Link link = block.link(s);
        if (link.mask == 0) continue;
        const uint64_t count = static_cast<uint64_t>(link.children());
        if (link.first > levels_[k - 1].blocks || count > levels_[k - 1].blocks - link.first)
          return bad_input(
              file,
              fmt::format("level {}, block {}, subblock {}: links to blocks {} to {}: expected below {}", k,
                          b, s, link.first, link.first + count - 1, levels_[k - 1].blocks));
        if (!runs.empty() && runs.back().second == link.first)
          runs.back().second += count;
        else
          runs.emplace_back(link.first, link.first + count);
        children += count;
      }
    }
    std::sort(runs.begin(), runs.end());
    bool each_once = children == levels_[k - 1].blocks;
    uint64_t end = 0;
    for (const auto& [first, last] : runs) {
      each_once &= first == end;
      end = last;
    }
    if (!each_once)
      return bad_input(file, fmt::format("level {}: its links do not reach each of the {} blocks below once",
                                         k, levels_[k - 1].blocks));
  }
  return {};
}

}  // namespace voxkit::svmm
