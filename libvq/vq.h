// Vector quantisation of scalar volumes in 4^3 bricks: lossless, near-lossless or lossy, with random access.
// Sources: S. Guthe, M. Goesele, "Variable Length Coding for GPU-Based Direct Volume Rendering", VMV 2016,
// sections 3 and 4. File: formats/FORMAT.md, section 3.
//
// A volume is cut into bricks of 4^3 voxels; equal ones are stored once, in the codebook; the offset volume
// says for each place which one is there. Voxels become codes of 1 to 16 bits first; a code stands for the
// value base + step * code.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>

#include "formats/container.h"
#include "formats/context.h"
#include "formats/source.h"
#include "libvq/kmeans.h"

namespace voxkit::vq {

class Store;
struct View;

/// How bricks are stored. Numbers are part of FORMAT.md.
enum class Codebook : uint8_t {
  rbuc = 1,    ///< codewords of variable length (rbuc.h)
  packed = 2,  ///< 64 codes of equal width: larger, decoded faster
};
/// What the offset volume holds.
enum class Mapping : uint8_t {
  direct = 1,    ///< addresses in the codebook
  indirect = 2,  ///< numbers of bricks; of a codebook with variable length, tables have their addresses
};
/// Bricks that a codebook may have.
inline constexpr int64_t most_codewords = 0xfffffffe;

/// What an encoder is asked for.
struct Options {
  Codebook codebook = Codebook::rbuc;
  std::optional<Mapping> mapping;  ///< nothing: whichever makes the smaller file; packed is always indirect
  /// Greatest error allowed, in sample values, of a file without k-means: integers lose what lies below
  /// (rounded down to a whole number), floats are quantised to it. Nothing: integers are exact, floats get
  /// 65536 levels.
  std::optional<double> max_error;
  /// k-means to so many bricks, or to the number of unique bricks divided by `reduce` (at least one brick);
  /// 0: no k-means, nor where that many bricks are all there are. Not with `max_error`.
  uint64_t codewords = 0, reduce = 0;
  Seeding seeding = Seeding::furthest;
  uint32_t max_iterations = ~uint32_t{0};  ///< of k-means; more only while clusters would be empty
  int zstd = 0;                            ///< level of zstd for the file's chunks, 1 to 19; 0: as they are
  /// FLOAT32: least and greatest stored value, as from `measure_range`.
  ValueRange range;
  /// FLOAT32: NaN comes back as NaN, for which there is one level less. Not with k-means, which has no
  /// averages of it.
  bool keep_nan = false;
  /// Told before k-means begins, and then of the PSNR so far (of peak `full_scale`), after seeding and after
  /// each iteration, on the calling thread. May be empty.
  std::function<void()> clustering;
  std::function<void(uint32_t iteration, double psnr_db)> clustered;
};

/// What a file says about itself.
struct Params {
  Codebook codebook = Codebook::rbuc;
  Mapping mapping = Mapping::indirect;
  int bits = 1;            ///< of a code, 1 to 16
  uint64_t codewords = 0;  ///< bricks in the codebook
  double base = 0;         ///< the stored value of code 0 ...
  double step = 1;         ///< ... and the distance to that of the next one
  /// The code that stands for no value of that kind: NaN of a FLOAT32 volume, the fill value of others.
  std::optional<uint16_t> special;
  // For the reader's information.
  double max_error = 0;            ///< no voxel is further than this from the original; -1: no promise
  uint64_t unique_bricks = 0;      ///< of the volume that was compressed
  std::optional<Seeding> seeding;  ///< of k-means; nothing without
  uint32_t iterations = 0;         ///< of k-means
  int offset_bits = 0;             ///< of the widest entries of the offset volume
  uint64_t offset_bytes = 0, codebook_bytes = 0;  ///< of the chunks; tables of addresses count as offsets
};

/// What encoding found out.
struct Report {
  Params params;
  uint64_t bricks = 0;                            ///< of the volume
  std::array<uint64_t, 4> transform_codewords{};  ///< codewords by transform; constant bricks have none
  double quantisation_error = 0;  ///< greatest error so far, before k-means, of finite samples
  bool replaced = false;          ///< there were samples that are no numbers, or infinite
  double seeding_seconds = 0, kmeans_seconds = 0;
};

/// Checks whether the options go together and with a volume. Errors: ErrorCode::usage, saying which do not;
/// ErrorCode::input: colours are not supported.
Status validate(const Options& options, const VolumeInfo& info);

/// The greatest error, in sample values, that encoding a finite voxel with these options may make, before
/// k-means: 0 for integers without `max_error`. Errors: ErrorCode::usage where 16 bits do not suffice for
/// what is asked.
Result<double> error_bound(const Options& options, const VolumeInfo& info);

/// Compresses `source` into a container written to `sink`, in one pass over the source. Of a FLOAT32 volume
/// minus infinity is encoded as the least value, plus infinity as the greatest, and not a number, without
/// `keep_nan`, as the least. The fill value of an integer volume (VolumeInfo::fill) is exact with any
/// `max_error`. Memory: the codebook, compressed, and 4 bytes for each brick; with k-means, what that takes
/// for the unique bricks as well. What is written does not depend on ctx.threads. Errors:
/// - ErrorCode::usage: those of `validate` and of `error_bound`.
/// - ErrorCode::input: colours.
/// - ErrorCode::limit: more than most_codewords different bricks; a codebook of over 4 GiB with
///   Mapping::direct; more memory than ctx.memory allows.
/// - ErrorCode::interrupted: a signal came.
/// - Those of `source` and of `sink`, as they are.
Result<Report> encode(VolumeSource& source, const Options& options, const ByteSink& sink, Context& ctx);

/// A FLOAT32 volume as `encode` takes it, for comparing: minus infinity is range.lo, plus infinity range.hi,
/// and not a number, without `keep_nan`, range.lo. `source` must outlive it.
std::unique_ptr<VolumeSource> finite_source(VolumeSource& source, const ValueRange& range, bool keep_nan);

/// A compressed volume, opened for random access. Safe on any bytes: every operation returns an error or a
/// well-formed answer and touches only the chunks it needs. All const functions are thread-safe. For inner
/// loops, on the host or a device, there is `Reader` in view.h.
class Volume {
 public:
  static Result<std::shared_ptr<const Volume>> open(std::shared_ptr<const Container> container);
  ~Volume();

  const VolumeInfo& info() const { return info_; }
  const Params& params() const { return params_; }
  const Container& container() const { return *container_; }
  const View& view() const;
  /// The chunks, for `MappedPools`.
  const Store& store() const { return *store_; }
  /// Bricks along x, y and z.
  Index3 bricks() const;

  /// Which brick is at a place of the offset volume: a number that is the same for equal bricks, their place
  /// in the codebook.
  Result<uint64_t> brick_id(Index3 brick) const;
  /// The least and the greatest code of a brick, without decoding it.
  Result<BrickRange> brick_range(uint64_t id) const;
  /// The codes of a brick.
  Status decode_brick(uint64_t id, Brick& codes) const;
  /// The voxel that a code stands for.
  Voxel voxel_of(uint16_t code) const;
  /// What params().special stands for.
  Voxel no_value() const;

  /// The voxel at a place inside the volume.
  Result<Voxel> sample(Index3 voxel) const;
  /// Decodes `box`, inside the volume; returns how many bricks were read for it, each place of the offset
  /// volume counted once.
  Result<uint64_t> decode(const Box& box, VoxelSpan out) const;
  /// The value of the box where it is known from ranges alone.
  std::optional<Voxel> uniform(const Box& box) const;
  /// Verifies every checksum, entry, address, range and codeword.
  Status check(Context& ctx) const;

 private:
  Volume();
  friend struct Decoder;
  std::shared_ptr<const Container> container_;
  VolumeInfo info_;
  Params params_;
  std::unique_ptr<Store> store_;
};

/// A compressed volume as a source.
std::unique_ptr<VolumeSource> open_source(std::shared_ptr<const Volume> volume);

}  // namespace voxkit::vq
