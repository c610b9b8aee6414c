// Where the chunks of an opened file are, verified when first used.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "libcolor/attribute_reader.h"
#include "libcolor/dag/dag_view.h"
#include "libcolor/layout.h"
#include "libcolor/octree/octree_reader.h"
#include "libcolor/palette/palette_layout.h"
#include "libcolor/predicted/part_voxels.h"
#include "libcolor/textures/decoded_parts.h"
#include "libcolor/textures/texture.h"

namespace voxkit::color {

class Store {
 public:
  /// What is made of an octree, or decoded, counts against `memory`, which must outlive the store; an octree
  /// is decoded on so many threads.
  Store(MemoryBudget& memory, int threads);
  int threads() const { return ctx_.threads; }
  /// Finds the chunks that follow from the parameters, and no others; verifies the palette.
  Status find_chunks(const Container& container, const Params& params);
  /// Of images and predicted colours: what parts are decoded by. The arguments must outlive the store.
  void decode_whole_parts(const Container& container, const Params& params);
  /// Colours of parts come from `decode`, whatever the codec.
  void decode_parts(DecodedParts::Decode decode, uint64_t work_bytes);
  /// The DAG, all of which is verified now; or made of the octree.
  Result<const DagView*> dag(const Container& container, const Params& params) const;
  /// The octree whose voxels have colours in their own order, where that is what the file has and no DAG has
  /// been made of it; else null.
  Result<OctreeReader*> octree(const Container& container, const Params& params) const;
  /// The bytes of a part of the colours; null if it is damaged, which `status` then tells.
  const std::byte* part(uint64_t number, const Container& container) const {
    const std::byte* const data = found_[number].load(std::memory_order_acquire);
    return data != nullptr ? data : verify(number, container);
  }
  uint64_t part_bytes(uint64_t number) const { return sizes_[number]; }
  /// Of the scene, if the codec is palette.
  const PaletteBytes& palette() const { return palette_; }
  /// Whether parts are decoded as a whole; the colours of one; null if it is damaged, which `status` then
  /// tells.
  bool decodes_parts() const { return decoded_ != nullptr; }
  std::shared_ptr<const DecodedParts::Part> decoded(uint64_t number) const;
  const AttributeStore& attributes() const { return attributes_; }
  /// The first damage that was met.
  Status status() const;
  /// Of damage that a reader finds: it becomes `status`, unless there is one.
  [[gnu::cold]] void report(const Container& container, const std::string& what) const;
  [[gnu::cold]] void report(const Error& error) const;

 private:
  Status check_geometry(const Container& container, const Params& params) const;
  Status find_palette(const Container& container, const Params& params);
  Status open_octree(const Container& container, const Params& params) const;
  Result<DagView> view_of_chunks(const Container& container, const Params& params) const;
  /// Where the voxels of a part of predicted colours are.
  Result<std::vector<PartCell>> cells_of_part(uint64_t number, const Container& container,
                                              const Params& params) const;
  [[gnu::cold]] const std::byte* verify(uint64_t number, const Container& container) const;

  MemoryBudget& memory_;
  Context ctx_;
  // Indices into the container's table:
  size_t leaves_ = 0, octree_directory_ = 0;
  std::vector<size_t> nodes_;  ///< by height, from 3 on
  std::vector<size_t> masks_;  ///< parts of the octree's
  std::vector<size_t> parts_;
  std::vector<uint64_t> sizes_;  ///< of parts
  PaletteBytes palette_;
  AttributeStore attributes_;
  std::unique_ptr<std::atomic<const std::byte*>[]> found_;
  mutable std::mutex mutex_;
  mutable std::unique_ptr<OctreeReader> octree_;
  mutable Dag made_;  ///< of an octree
  mutable Reservation made_memory_;
  mutable std::optional<DagView> view_;
  mutable std::atomic<const DagView*> ready_{nullptr};
  mutable Status status_;
  std::unique_ptr<DecodedParts> decoded_;
};

/// Colours of an opened file, one after the other or in any order; one for each thread. Errors are the
/// store's.
class ColorReader {
 public:
  ColorReader(const Store& store, const Container& container, const Params& params)
      : store_(store), container_(container), params_(params) {}
  /// Black where there is no such colour, or it is damaged.
  Rgb color(uint64_t index) {
    if (index >= params_.color_count) {
      store_.report(container_, "chunk NODE: counts of colors that do not add up");
      return {};
    }
    const uint64_t part = index >> part_log2;
    if (part != part_ && !open(part)) return {};
    const auto within = static_cast<uint32_t>(index & (part_colors - 1));
    if (plain_) {
      const std::byte* const p = bytes_ + uint64_t{within} * 3;
      return {static_cast<uint8_t>(p[0]), static_cast<uint8_t>(p[1]), static_cast<uint8_t>(p[2])};
    }
    if (makes_textures(params_.codec)) return texture_.color(within);
    if (params_.codec == ColorCodec::palette) return palette_.color(within);
    if (within < first_ || within >= last_) find(within);
    if (first_ == last_) return view_.color(within);
    return view_.color_in(macro_, block_, within % macro_block_colors);
  }

 private:
  bool open(uint64_t part);
  void find(uint32_t within);
  [[gnu::cold]] void damaged(const char* what) const;

  const Store& store_;
  const Container& container_;
  const Params& params_;
  uint64_t part_ = ~uint64_t{0};
  const std::byte* bytes_ = nullptr;
  bool plain_ = false;  ///< `bytes_` are R, G, B of each colour
  std::shared_ptr<const DecodedParts::Part> decoded_;
  TextureReader texture_;
  PaletteReader palette_;
  PartView view_;
  PartView::MacroBlock macro_;
  PartView::Block block_;
  uint32_t first_ = 0, last_ = 0;  ///< colours of the part that the block has; none: not of a block
};

}  // namespace voxkit::color
