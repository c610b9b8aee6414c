#include "libsvmm/packed/page_cache.h"

#include <algorithm>

namespace voxkit::svmm {
namespace {

/// Of an entry beside its page.
constexpr uint64_t entry_bytes = 160;

}  // namespace

PageCache::PageCache(MemoryBudget& memory)
    : memory_(memory), shard_limit_(std::min(memory.limit() / 8, uint64_t{256} << 20) / shard_count) {}

PageCache::~PageCache() {
  for (Shard& shard : shards_) memory_.release(shard.bytes);
}

std::shared_ptr<const PageCache::Page> PageCache::find(const Key& key) {
  Shard& shard = shard_of(key);
  const std::lock_guard lock(shard.mutex);
  const auto at = shard.places.find(key);
  if (at == shard.places.end()) return nullptr;
  at->second->used = true;
  return at->second->page;
}

void PageCache::keep(const Key& key, std::shared_ptr<const Page> page) {
  Shard& shard = shard_of(key);
  const uint64_t bytes = page->size() + entry_bytes;
  const std::lock_guard lock(shard.mutex);
  if (shard.places.contains(key)) return;
  while (!shard.entries.empty() && shard.bytes + bytes > shard_limit_) drop_last(shard);
  if (bytes > shard_limit_ || !memory_.reserve(bytes, "pages that were used lately")) return;
  shard.bytes += bytes;
  shard.entries.push_front({key, std::move(page), false});
  shard.places.emplace(key, shard.entries.begin());
}

void PageCache::drop_last(Shard& shard) {
  while (shard.entries.back().used) {
    shard.entries.back().used = false;
    shard.entries.splice(shard.entries.begin(), shard.entries, std::prev(shard.entries.end()));
  }
  const uint64_t bytes = shard.entries.back().page->size() + entry_bytes;
  shard.places.erase(shard.entries.back().key);
  shard.entries.pop_back();
  shard.bytes -= bytes;
  memory_.release(bytes);
}

}  // namespace voxkit::svmm
