// Coloured surfaces, compressed: the geometry as a DAG, the colours in an array of their own.
// Source: D. Dolonius, E. Sintorn, V. Kaempe, U. Assarsson, "Compressing Color Data for Voxelized Surface
// Geometry", TVCG 2019. File: formats/FORMAT.md, section 4.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "formats/container.h"
#include "formats/context.h"
#include "formats/source.h"
#include "libcolor/block_layout.h"
#include "libcolor/dag.h"
#include "libcolor/surface.h"
#include "libcolor/texture_layout.h"

namespace voxkit::color {

class Store;

/// How colours are stored. Numbers are part of FORMAT.md.
enum class ColorCodec : uint8_t {
  raw = 1,      ///< 24 bits each
  fws = 2,      ///< variable bitrate blocks, weights of fixed size (section 4.2)
  vws = 3,      ///< the same, weights of variable size (section 4.3)
  bc1 = 4,      ///< an image of them, in blocks of 16 (section 4.1): 4 bits each
  astc = 5,     ///< the same, blocks of 16 bytes for 16 to 144 colours; not in every build
  bc7 = 6,      ///< the same, blocks of 16 bytes for 16 colours: 8 bits each
  palette = 7,  ///< indices into palettes of blocks, of a palette of the scene (Dado et al. 2016)
  // The same image as a file: a part is decoded as a whole. A module each.
  jpeg = 8,
  jp2 = 9,
  png = 10,
};

/// Whether a codec keeps within a threshold.
constexpr bool has_threshold(ColorCodec codec) {
  return codec == ColorCodec::fws || codec == ColorCodec::vws;
}

/// Whether a codec lays colours into images, in blocks of textures.
constexpr bool makes_textures(ColorCodec codec) {
  return codec == ColorCodec::bc1 || codec == ColorCodec::astc || codec == ColorCodec::bc7;
}

/// Whether a codec lays colours into images that are files.
constexpr bool makes_images(ColorCodec codec) {
  return codec == ColorCodec::jpeg || codec == ColorCodec::jp2 || codec == ColorCodec::png;
}

inline constexpr uint32_t most_palette_colors = 1 << 16;

/// What an encoder is asked for.
struct Options {
  ColorCodec codec = ColorCodec::vws;
  double threshold = 9.56;             ///< of fws and vws: greatest distance of a decoded colour
  ErrorSpace space = ErrorSpace::rgb;  ///< where that is measured
  int weight_bits = 3;                 ///< of fws: 1 to 4
  int effort = 3;          ///< of fws and vws: 1: the paper's greedy merging; up to 9: smaller, slower; of
                           ///< textures: up to 9: nearer, slower; of palette: both
  uint32_t palette = 256;  ///< of palette: colours of the scene's, at most; 1 to 2^16
  int image_palette = 0;   ///< of png: colours of each image, 2 to 256; 0: all
  ImageCurve image_curve = ImageCurve::morton;  ///< of textures and images
  int quality = 100;  ///< of astc: 100: blocks of 4 x 4; down to 0: of 12 x 12; of images: ImageCoding
  Colors colors = Colors::leaf;
  Counts counts = Counts::node;
  Curve curve = Curve::morton;  ///< in which order voxels have their colours
  int zstd = 0;                 ///< level of zstd for the file's chunks, 1 to 19; 0: as they are
};

/// The blocks of what is encoded with these options.
BlockSize block_size_of(const Options& options);

/// What a file says about itself.
struct Params {
  ColorCodec codec = ColorCodec::vws;
  Colors colors = Colors::leaf;
  Counts counts = Counts::node;
  Curve curve = Curve::morton;
  Endpoints endpoints = Endpoints::rgb565;
  ImageCurve image_curve = ImageCurve::morton;  ///< of textures and images
  BlockSize block_size;                         ///< of textures
  int height = leaf_height;                     ///< the grid is 2^height voxels a side
  uint32_t root = 0;
  uint32_t palette_colors = 0;  ///< of palette: of the scene's
  uint64_t leaf_voxels = 0, color_count = 0;
  // For the reader's information.
  int weight_bits = 0;
  double threshold = 0;
  ErrorSpace space = ErrorSpace::rgb;  ///< of the threshold
  double grmse = 0;          ///< root mean square of the errors of all channels of all colours, 0 to 255
  uint64_t dag_nodes = 0;    ///< leaf words not counted
  uint64_t dag_bytes = 0;    ///< of nodes and leaf words
  uint64_t color_bytes = 0;  ///< of all parts
  uint64_t macro_blocks = 0, blocks = 0;
};

/// What encoding found out.
struct Report {
  Params params;
  double most_error = 0;  ///< greatest distance of a decoded colour, in RGB or where the threshold is
  double color_seconds = 0,
         build_seconds = 0;  ///< of colours; of everything else, reading the source included
};

/// Whether the options go together: ErrorCode::usage says which do not.
Status validate(const Options& options);

/// Compresses `source` into a container written to `sink`, in one pass. Memory: the DAG and some parts of
/// colours; with Colors::all or along a Hilbert curve, all colours, twice; with palette, all colours. What is
/// written does not depend on ctx.threads.
Result<Report> encode(SurfaceSource& source, const Options& options, const ByteSink& sink, Context& ctx);
/// The bytes of a part of so many colours as the codec stores them, where they are known; its colours in the
/// source are then those that they stand for. Called from any thread.
using StoredPart =
    std::function<Result<std::optional<std::vector<std::byte>>>(uint64_t part, uint32_t colors)>;
/// The same with parts that are encoded already: of bc1, bc7, astc, jpeg, jp2 or png.
Result<Report> encode(SurfaceSource& source, const Options& options, const StoredPart& stored,
                      const ByteSink& sink, Context& ctx);

/// A compressed surface, opened for random access. Safe on any bytes: every operation returns an error or a
/// well-formed answer. The DAG is verified when it is first used, colours part by part. Of images, the first
/// colour of a part takes as long as all of them: they are decoded and kept (decoded_parts.h). Const
/// functions are thread-safe.
class Volume {
 public:
  /// `memory`: what decoded images count against; it must outlive the volume. Null: a budget of its own.
  static Result<std::shared_ptr<const Volume>> open(std::shared_ptr<const Container> container,
                                                    MemoryBudget* memory = nullptr);
  ~Volume();

  /// The colours of a part, as many as it has.
  using PartColors = std::function<Result<std::vector<Rgb>>(uint64_t part)>;
  /// The same voxels with other colours, under the same numbers. `colors` is called when a part is first
  /// used, from any thread, and takes `work_bytes`; what it gives counts against `memory`. Both must outlive
  /// the volume.
  Result<std::shared_ptr<const Volume>> recolored(PartColors colors, uint64_t work_bytes,
                                                  MemoryBudget& memory) const;

  /// Voxels are rgba32: opaque where there is one, else void.
  const VolumeInfo& info() const { return info_; }
  const Params& params() const { return params_; }
  const Container& container() const { return *container_; }
  const Store& store() const { return *store_; }

  /// The colour with a number below params().color_count.
  Result<Rgb> color(uint64_t index) const;
  /// The colour of the voxel at a place inside the volume; nothing where there is none.
  Result<std::optional<Rgb>> voxel(Index3 place) const;
  /// Decodes `box`, inside the volume.
  Status decode(const Box& box, VoxelSpan out) const;
  /// Void, where the whole box is known to be that.
  std::optional<Voxel> uniform(const Box& box) const;
  /// All voxels in Morton order, in runs.
  Status for_each_voxel(const SurfaceSource::Sink& sink, Context& ctx) const;
  /// Verifies every checksum, node, count and block.
  Status check(Context& ctx) const;

 private:
  Volume();
  std::shared_ptr<const Container> container_;
  VolumeInfo info_;
  Params params_;
  std::optional<MemoryBudget> own_memory_;
  std::unique_ptr<Store> store_;
};

/// A compressed surface as a source of voxels.
std::unique_ptr<VolumeSource> open_source(std::shared_ptr<const Volume> volume);

}  // namespace voxkit::color
