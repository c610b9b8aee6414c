// What is left of a damaged file of layout packed.
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "libsvmm/packed/packed.h"

namespace voxkit::svmm {

/// The pages that a damaged file has lost, and those that it may have, as they are met. Thread-safe.
class Losses {
 public:
  struct Page {
    int level = 0;
    Index3 at{0};           ///< its corner, in voxels of its level
    bool doubtful = false;  ///< it was decoded, but the checksum of its part is wrong; else it is lost
  };
  /// By level, the coarsest first, then in raster order.
  std::vector<Page> pages() const;

 private:
  friend class SalvagedSource;
  struct Key {
    int level = 0;  ///< counted from below 0, so that the coarsest comes first
    uint64_t number = 0;
    auto operator<=>(const Key&) const = default;
  };
  mutable std::mutex mutex_;
  std::map<Key, Page> pages_;
};

/// A level of a file as a source, page by page: where one is damaged, or one of a coarser level that it is
/// predicted from, voxels are the fill value (NaN in FLOAT32, as formats/fill.h has it), or, without one, the
/// sample 0. A page may be sound though the checksum of its part is wrong, and decodes then as a rule, where
/// a damaged one as a rule does not: it is kept, and called doubtful. Of colours all pages of such a part are
/// lost. `losses` hears of the pages that are
/// read, and of those that they are predicted from. Errors: as of open_source, none for damage.
Result<std::unique_ptr<VolumeSource>> open_salvaged(std::shared_ptr<const PackedVolume> volume, int level,
                                                    std::shared_ptr<Losses> losses);

}  // namespace voxkit::svmm
