#include "libvq/store.h"

#include <fmt/format.h>

#include <algorithm>

namespace voxkit::vq {

Status Store::find_chunks(const Container& container) {
  const auto& table = container.table();
  const auto find = [&](uint32_t kind, const char* letters, Section& section) -> Status {
    const auto bad = [&](const std::string& what) { return bad_input(container.name(), "table: " + what); };
    for (size_t i = 0; i < table.size(); ++i)
      if (table[i].kind == kind) section.chunks.push_back(i);
    const uint64_t expected = chunk_count(kind, view), found = section.chunks.size();
    const bool any = kind == codebook_kind && view.codebook == Codebook::rbuc;
    if (any ? found == 0 : found != expected)
      return bad(any ? fmt::format("no chunk {}", letters)
                     : fmt::format("{} chunks {}: expected {}", found, letters, expected));
    std::stable_sort(section.chunks.begin(), section.chunks.end(),
                     [&](size_t a, size_t b) { return table[a].part < table[b].part; });
    for (uint64_t part = 0; part < found; ++part) {
      const ChunkEntry& entry = table[section.chunks[part]];
      if (entry.index != 0 || entry.part != part)
        return bad(fmt::format("chunk {} {}.{}: expected index 0 and parts 0 to {}, each once", letters,
                               entry.index, entry.part, found - 1));
      const ChunkSize size = chunk_size(kind, part, view);
      if (entry.length < size.least || entry.length > size.most)
        return bad(fmt::format("chunk {} 0.{} has {} bytes: expected {} to {}", letters, part, entry.length,
                               size.least, size.most));
      section.sizes.push_back(entry.length);
    }
    section.found = std::make_unique<std::atomic<const std::byte*>[]>(found);
    return {};
  };
  VOX_CHECK(find(offsets_kind, "OFFS", offsets));
  VOX_CHECK(find(addresses_kind, "ADDR", addresses));
  return find(codebook_kind, "CODE", codebook);
}

const std::byte* Store::verify(const Section& section, uint64_t part, const Container& container) const {
  auto chunk = container.chunk(section.chunks[part]);
  if (chunk && &section == &offsets) {
    // Of the entries' places the first and the last, as FORMAT.md has them; the others are looked at when
    // used.
    const uint64_t first = chunk_size(offsets_kind, part, view).least;
    const auto start = [&](uint64_t header) { return load_le<uint32_t>(chunk->data() + header + 4); };
    if (uint64_t{start(0)} * 8 != first || uint64_t{start(first - block_header)} * 8 != chunk->size())
      chunk = bad_input(container.name(),
                        fmt::format("chunk OFFS 0.{}: entries from byte {} to {}: expected {} to {}", part,
                                    uint64_t{start(0)} * 8, uint64_t{start(first - block_header)} * 8, first,
                                    chunk->size()));
  }
  if (chunk) {
    section.found[part].store(chunk->data(), std::memory_order_release);
    return chunk->data();
  }
  const std::lock_guard lock(mutex_);
  if (status_) status_ = tl::unexpected<Error>(chunk.error());
  return nullptr;
}

Status Store::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace voxkit::vq
