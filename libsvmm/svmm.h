// Sparse Voxel Mip-Maps: lossy compression of colour and density volumes with level of detail and random
// access. Source: M. E. Faas, "Sparse Voxel Mip-Maps", Leiden 2016, chapters 2 and 3.1. File:
// formats/FORMAT.md, section 2.
//
// A volume V_0 is cut into blocks of w_0^3 voxels. Each block has an equivalent voxel, its average, in V_1,
// which is w_0 times smaller; V_1 is cut into blocks of w_1^3, and so on up to V_{n-1}, the root level, one
// block. A block whose voxels are all within delta of their average is not stored: its equivalent voxel is
// terminal.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "formats/container.h"
#include "formats/context.h"
#include "formats/mapped_file.h"
#include "formats/source.h"

namespace voxkit::svmm {

struct Store;

/// Which bits a level is stored in.
enum class Layout : uint8_t {
  thesis = 1,  ///< Table 2.1: 32 or 16 bit words that share value, terminal flag and block offset; 3-bit
               ///< alpha; RGBA32, RGB24 and DENSITY8 only; the root is reached as soon as one side is <= r
  plain = 2,   ///< values in the volume's own format beside 64-bit links; root when all sides are <= r
};
/// How the base level (level 0) is stored (section 2.1.1, last paragraph). All but raw are lossy.
enum class Base : uint8_t {
  raw = 1,  ///< thesis: structural words; plain: the volume's own voxels
  bitmap =
      2,  ///< one bit a voxel and one value per 2^3 voxels (for w = 2 the value comes from the level above)
  alpha = 3,  ///< RGBA32: 8-bit alpha a voxel, colour as for bitmap
  gray = 4,   ///< colours: 8-bit luma a voxel, 0 = void
  bc1 = 5,    ///< colours, w >= 4: S3TC, 4x4 tiles of each slice, 8 bytes a tile
};
/// What delta bounds.
enum class Bound : uint8_t {
  local = 1,   ///< the distance between an average and the voxels of its own block (the thesis)
  global = 2,  ///< the distance between every original voxel and what is decoded for it (with base raw)
};

/// Largest block width: 2^10.
inline constexpr int max_blockwidth = 1024;
/// Most voxels of a volume that is encoded: up to there 64 bits hold the sums that averages are made of.
inline constexpr uint64_t most_voxels = uint64_t{1} << 48;
/// Every level halves a side of at most 2^31, down to 1, rounded up to even.
inline constexpr int max_levels = 33;

struct Params {
  Layout layout = Layout::plain;
  Base base = Base::raw;
  Bound bound = Bound::global;
  bool alpha_weight = true;  ///< colour averages are weighted by alpha (RGBA32)
  std::vector<int>
      blockwidths;  ///< powers of two 2..1024, base level first, the last repeated; empty: stepped 2, 4, 8 …
  int64_t rootwidth = 32;   ///< r >= 1
  double quality = 90;      ///< 0..100; recorded, the encoder works with delta
  double delta = 0.1;       ///< Euclidean distance of attributes scaled to 0..1
  double full_scale = 255;  ///< stored value that stands for 1: 255; DENSITY16, FLOAT32: see full_scale.h
  int zstd = 0;  ///< level of zstd for the file's chunks, 1 to 19; 0: as they are. Of the encoder alone
};

/// The delta that a quality q of 0..100 stands for. plain: sqrt(n) (1 - q/100) over the format's n
/// attributes; thesis: 1 - q/100.
double delta_of_quality(double quality, VoxelFormat format, Layout layout);
/// Checks whether the parameters go together and with a volume. Errors: ErrorCode::usage, saying which do
/// not.
Status validate(const Params& params, const VolumeInfo& info);

/// One mip-map level; 0 is the base, the last one the root.
struct Level {
  uint32_t blockwidth = 0;       ///< w; 0 for the root, whose one block is the whole level
  uint64_t mip_factor = 1;       ///< base voxels along the edge of one voxel of this level
  Index3 dims{0};                ///< voxels, rounded up to even
  uint64_t blocks = 0;           ///< stored blocks
  uint64_t block_bytes = 0;      ///< bytes of each
  uint64_t terminal_voxels = 0;  ///< stored voxels, inside the volume, with nothing below
};

/// The levels of a volume, with blocks and terminal_voxels zero (but for the root: one block).
std::vector<Level> plan_levels(const VolumeInfo& info, const Params& params);
/// Size of the file as the thesis counts it: 64 bytes, 24 a level, and the blocks.
uint64_t thesis_bytes(std::span<const Level> levels);

/// Compresses `source` into a container written to `sink`, in one pass over the source. Memory: a few slabs
/// of max(32, 2 w_0) slices if the source is forward only, else a few tiles of that width; plus a slab of
/// each higher level. Of labels (VolumeInfo::is_labels) an equivalent voxel is the commonest of the values
/// below it, and not an average; they are lossless only. The bytes written do not depend on ctx.threads.
/// Returns the levels. Errors:
/// - ErrorCode::usage: those of `validate`.
/// - ErrorCode::limit: more than `most_voxels`; more than 2^32 blocks in a level of Layout::thesis; more
///   memory than ctx.memory allows.
/// - ErrorCode::interrupted: a signal came.
/// - Those of `source` and of `sink`, as they are.
Result<std::vector<Level>> encode(VolumeSource& source, const Params& params, const ByteSink& sink,
                                  Context& ctx);

/// A compressed volume, opened for random access. Safe on any bytes: every operation returns an error or a
/// well-formed answer and touches only the chunks it needs. All const functions are thread-safe.
class Volume {
 public:
  static Result<std::shared_ptr<const Volume>> open(std::shared_ptr<const Container> container);
  ~Volume();

  const VolumeInfo& info() const { return info_; }
  const Params& params() const { return params_; }
  const std::vector<Level>& levels() const { return levels_; }
  const Container& container() const { return *container_; }
  /// The blocks, for walks (walk.h).
  const Store& store() const { return *store_; }
  /// ceil(dims / mip_factor): the volume as seen at a level.
  Index3 dims_at(int level) const;

  /// The voxel at (x, y, z) of level `level` (0 = as decoded in full).
  Result<Voxel> sample(Index3 voxel, int level = 0) const;
  /// Decodes `box`, in voxels of `level` and inside dims_at(level), depth first.
  Status decode(const Box& box, int level, VoxelSpan out) const;
  /// The value of the box where terminal voxels of a single block cover it; nothing where finding out would
  /// take decoding.
  std::optional<Voxel> uniform(const Box& box, int level) const;
  /// Verifies every checksum, every link and every count.
  Status check(Context& ctx) const;

 private:
  Volume();
  friend struct Decoder;
  std::shared_ptr<const Container> container_;
  VolumeInfo info_;
  Params params_;
  std::vector<Level> levels_;
  std::unique_ptr<Store> store_;
};

/// A compressed volume as a source, at a mip level; info() has that level's dims, spacing and origin.
Result<std::unique_ptr<VolumeSource>> open_source(std::shared_ptr<const Volume> volume, int level);

}  // namespace voxkit::svmm
