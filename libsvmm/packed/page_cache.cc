#include "libsvmm/packed/page_cache.h"

#include <algorithm>
#include <utility>

namespace voxkit::svmm {
namespace {

/// Of an entry beside its page.
constexpr uint64_t entry_bytes = 160;
constexpr size_t fewest_slots = 16;

}  // namespace

size_t PageCache::Shard::place_of(const Key& key) const {
  const size_t mask = slots.size() - 1;
  size_t at = hash(key) >> 20 & mask;
  while (slots[at].page && slots[at].key != key) at = (at + 1) & mask;
  return at;
}

void PageCache::Shard::grow() {
  std::vector<Slot> before(std::max(fewest_slots, 2 * slots.size()));
  std::swap(before, slots);
  for (Slot& slot : before)
    if (slot.page) slots[place_of(slot.key)] = std::move(slot);
}

void PageCache::Shard::free(size_t at) {
  const size_t mask = slots.size() - 1;
  slots[at] = {};
  for (size_t next = (at + 1) & mask; slots[next].page; next = (next + 1) & mask) {
    const size_t place = place_of(slots[next].key);
    if (place != next) slots[place] = std::exchange(slots[next], {});
  }
  --count;
}

PageCache::PageCache(MemoryBudget& memory)
    : memory_(memory), shard_limit_(std::min(memory.limit() / 8, uint64_t{256} << 20) / shard_count) {}

PageCache::~PageCache() {
  for (Shard& shard : shards_) memory_.release(shard.bytes);
}

std::shared_ptr<const PageCache::Page> PageCache::find(const Key& key) {
  Shard& shard = shard_of(key);
  const std::lock_guard lock(shard.mutex);
  if (shard.slots.empty()) return nullptr;
  Slot& slot = shard.slots[shard.place_of(key)];
  if (!slot.page) return nullptr;
  slot.used = true;
  return slot.page;
}

void PageCache::keep(const Key& key, std::shared_ptr<const Page> page) {
  Shard& shard = shard_of(key);
  const uint64_t bytes = page->size() + entry_bytes;
  const std::lock_guard lock(shard.mutex);
  if (2 * (shard.count + 1) > shard.slots.size()) shard.grow();
  if (shard.slots[shard.place_of(key)].page) return;
  while (shard.count > 0 && shard.bytes + bytes > shard_limit_) drop_one(shard);
  if (bytes > shard_limit_ || !memory_.reserve(bytes, "pages that were used lately")) return;
  shard.bytes += bytes;
  ++shard.count;
  shard.slots[shard.place_of(key)] = {key, std::move(page), false};
}

void PageCache::drop_one(Shard& shard) {
  for (;; shard.turn = (shard.turn + 1) & (shard.slots.size() - 1)) {
    Slot& slot = shard.slots[shard.turn];
    if (!slot.page || std::exchange(slot.used, false)) continue;
    const uint64_t bytes = slot.page->size() + entry_bytes;
    shard.free(shard.turn);
    shard.bytes -= bytes;
    memory_.release(bytes);
    return;
  }
}

}  // namespace voxkit::svmm
