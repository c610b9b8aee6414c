// Layout packed: the levels of a volume in pages, each predicted, quantised within a bound and entropy-coded,
// decodable alone (libpage). File: formats/FORMAT.md, section 2.6.
//
// Level 0 is the volume; each voxel of level l + 1 stands for 2^3 voxels of level l: their mean, without
// those that stand for nothing measured; of labels the commonest. The last level fits into one page. Each
// page is predicted from the one page of the next coarser level that its voxels are part of, too, so that
// levels cost little, and decoding a page takes one page of each coarser level.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "formats/container.h"
#include "formats/context.h"
#include "formats/source.h"
#include "libpage/mask.h"
#include "libsvmm/packed/value_map.h"

namespace voxkit::svmm {

struct PackedPages;
struct Ancestors;

/// Level 31 of the longest side is one voxel.
inline constexpr int max_packed_levels = 32;

/// What a file is to have, in place of a bound: the encoder finds one that leads to it.
struct PackedTarget {
  enum class Kind {
    psnr,  ///< decibels of level 0, as voxdiff counts them: within 0.2 of the target
    bits   ///< of the whole file, for each voxel of level 0: within 2 %, of floats mostly
  };
  Kind kind = Kind::psnr;
  double value = 0;  ///< above 0, at most 1000
};

struct PackedOptions {
  /// No decoded voxel of level 0 is further from its original than this, nor one of another level from the
  /// mean it stands for; in units of samples. 0: all are equal. Only means of 8 bits may be off by 2 in any
  /// case, and where all integers that there are lie further apart than this bound, means by half of that
  /// distance, or a 43rd of the range.
  double max_error = 0;
  /// With it `max_error` is 0, and is found: for floats any number, for integers a whole one. Where no whole
  /// bound leads near enough, the largest one with at least the decibels, which may be 0; or the smallest one
  /// with no more than the bits, or, if all have more, the one with the fewest. Samples of the pages tell
  /// which; then the whole volume is encoded, and, where that is off, up to three times more.
  std::optional<PackedTarget> target = std::nullopt;
  bool levels = true;  ///< whether there are levels above 0
  int page_side = 16;  ///< 16 or 8 voxels
};

/// What differences are more in their channels, and their greatest sample.
inline constexpr int difference_offset = 255;
inline constexpr uint32_t most_difference = 510;

/// What the channels of a file are: G; R and B, or how much they are more than G; and of RGBA32 alpha.
struct Channels {
  size_t count = 4;
  bool differences = true;

  uint32_t greatest(size_t channel) const {
    return differences && (channel == 1 || channel == 2) ? most_difference : 255;
  }
  friend bool operator==(const Channels&, const Channels&) = default;
};

/// What a file says about itself.
struct PackedParams {
  int page_side = 16;
  ValueMap map;          ///< from voxels to the samples that pages hold
  Channels channels;     ///< of colours, if they have any
  bool opaque = false;   ///< of RGBA32: whether all solid voxels of level 0 have an alpha of 255
  double max_error = 0;  ///< promised; for the reader's information
  int levels = 1;

  /// Whether pages have a mask and channels; else they have codes.
  bool has_channels() const { return map.kind == CodeKind::colors; }
};

/// A level of an opened file.
struct PackedLevel {
  Index3 dims{0};           ///< voxels
  Index3 pages{0};          ///< along each axis
  uint64_t page_bytes = 0;  ///< of all pages with their index
  uint64_t model_bytes = 0;
  /// Where what follows its last chunk begins: of a file of ours, so many bytes from its begin are a file of
  /// this level and the coarser ones.
  uint64_t end = 0;
};

/// Whether a volume may be encoded with a loss: not labels, nor integers that a table or a fill value has
/// among them.
inline bool may_be_off(const VolumeInfo& info) {
  return !info.is_labels && !info.labels && (!info.fill || info.format == VoxelFormat::float32);
}

/// Compresses `source`, scalars of any format, into a container written to `sink`. Two passes over a source
/// of random access, of which each page is encoded alone; one that is forward-only must have been spooled
/// (formats/spool.h). Coarser levels go through temporary files of a seventh of the raw bytes ($TMPDIR).
/// Memory: some MB a thread, and a slab of 32 slices. Bytes do not depend on ctx.threads. Errors:
/// - ErrorCode::usage: colours; options outside their ranges; a bound that is not finite; a bound for labels.
/// - ErrorCode::limit: more memory than ctx.memory allows. ErrorCode::output: no room for temporary files.
/// - ErrorCode::interrupted. Those of `source` and of `sink`.
Result<PackedParams> encode_packed(VolumeSource& source, const PackedOptions& options, const ByteSink& sink,
                                   Context& ctx);

/// Whether a container of Codec::svmm is of this layout.
bool is_packed(const Container& container);

/// A page of a volume.
struct PackedPage {
  Index3 lo{0}, size{0};             ///< size: of scalars
  bool uniform = false;              ///< all voxels are `value`
  Voxel value;                       ///< of a uniform one
  const std::byte* codes = nullptr;  ///< of scalars, x fastest, if it is not uniform
};

/// A file of this layout, opened for random access. Safe on any bytes. All const functions are thread-safe. A
/// file that was cut where a level ends has that level and the coarser ones; of the finer ones it has nothing
/// but their extents in `levels()`, and nobody may ask for their voxels.
class PackedVolume {
 public:
  /// `memory`, which must outlive it, counts decoded pages that are kept. Errors: ErrorCode::input.
  static Result<std::shared_ptr<const PackedVolume>> open(std::shared_ptr<const Container> container,
                                                          MemoryBudget& memory);
  ~PackedVolume();
  const VolumeInfo& info() const { return info_; }
  /// The same of a level: its dims and place, and whether its values are rounded.
  VolumeInfo info_of(int level) const;
  const PackedParams& params() const { return params_; }
  const std::vector<PackedLevel>& levels() const { return levels_; }
  /// The finest level that is there: 0, unless the file was cut.
  int finest() const { return finest_; }
  const Container& container() const { return *container_; }

  /// Decodes `box`, in voxels of `level` and inside its dims: only the pages that it touches, and of coarser
  /// levels those that these are predicted from, as far as they are not kept.
  Status decode(const Box& box, int level, VoxelSpan out) const;
  /// One voxel, through a cache of decoded pages.
  Result<Voxel> sample(Index3 voxel, int level = 0) const;
  /// Of colours: which voxels of level 0 are solid, 16^3 at a time from `lo` on, but for those that are all
  /// void, in any order, from several threads at once. Decodes masks only. Errors: ErrorCode::input; those of
  /// `take`.
  Status visit_masks(const std::function<Status(Index3 lo, const page::Mask& mask)>& take,
                     Context& ctx) const;
  /// Voxels of a level that is there, for one thread, which asks for neighbours mostly. Keeps pages beside
  /// those that are kept for all: `reader_pages`.
  class Reader {
   public:
    struct Recent;
    Reader(const PackedVolume& volume, int level);
    ~Reader();
    Result<Voxel> at(Index3 voxel);
    /// The page that a voxel is in. What it points to is there until a page is asked for that is less than 4
    /// pages away.
    Result<PackedPage> page(Index3 voxel);
    /// Of scalars: the voxels of a small box.
    Status read(const Box& box, VoxelSpan out);

   private:
    const PackedVolume& volume_;
    int level_;
    std::unique_ptr<Recent> recent_;
  };
  static constexpr size_t reader_pages = 64;
  /// The value of the box where its pages take no bytes; nothing where that takes decoding.
  std::optional<Voxel> uniform(const Box& box, int level) const;
  /// Verifies every checksum and decodes every page. Errors name level and page.
  Status check(Context& ctx) const;
  /// Pages that were decoded so far, of all levels.
  uint64_t pages_decoded() const;

  /// For the library itself.
  const PackedPages& pages() const { return *pages_; }

 private:
  PackedVolume();
  std::shared_ptr<const Container> container_;
  VolumeInfo info_;
  PackedParams params_;
  std::vector<PackedLevel> levels_;
  int finest_ = 0;
  std::unique_ptr<PackedPages> pages_;
};

/// A level of a file as a source; info() has that level's dims and place. Errors: ErrorCode::usage where
/// there is no such level; ErrorCode::input where the file was cut before it.
Result<std::unique_ptr<VolumeSource>> open_source(std::shared_ptr<const PackedVolume> volume, int level);

}  // namespace voxkit::svmm
