// Where the chunks of an opened volume are: found by part, verified when first touched.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "libvq/layout.h"

namespace voxkit::vq {

class Store {
 public:
  /// The chunks of one kind, in order of their parts.
  struct Section {
    std::vector<size_t> chunks;                              ///< indices into the container's table
    std::vector<uint64_t> sizes;                             ///< bytes of each
    std::unique_ptr<std::atomic<const std::byte*>[]> found;  ///< once they have been verified
  };
  View view;
  Section offsets, addresses, codebook;

  /// Finds the chunks of each kind in the container's table: all that follow from the view, and no others.
  Status find_chunks(const Container& container);
  /// The bytes of a chunk; null if there is none or it is damaged, which `status` then tells.
  [[gnu::always_inline]] Bytes bytes(const Section& section, uint64_t part,
                                     const Container& container) const {
    if (part >= section.chunks.size()) return {};
    const std::byte* data = section.found[part].load(std::memory_order_acquire);
    if (data == nullptr) data = verify(section, part, container);
    return {data, section.sizes[part]};
  }
  /// The first damaged chunk that was met.
  Status status() const;

 private:
  [[gnu::cold]] const std::byte* verify(const Section& section, uint64_t part,
                                        const Container& container) const;
  mutable std::mutex mutex_;
  mutable Status status_;
};

/// The chunks of a mapped file, for `Reader`.
class MappedPools {
 public:
  explicit MappedPools(const Volume& volume) : store_(&volume.store()), container_(&volume.container()) {}
  [[gnu::always_inline]] Bytes offsets(uint64_t part) const {
    return store_->bytes(store_->offsets, part, *container_);
  }
  [[gnu::always_inline]] Bytes addresses(uint64_t part) const {
    return store_->bytes(store_->addresses, part, *container_);
  }
  [[gnu::always_inline]] Bytes codebook(uint64_t part) const {
    return store_->bytes(store_->codebook, part, *container_);
  }

 private:
  const Store* store_;
  const Container* container_;
};

}  // namespace voxkit::vq
