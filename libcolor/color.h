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
#include "libcolor/attributes/attribute_params.h"
#include "libcolor/params.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

class Store;

/// What encoding found out.
struct Report {
  Params params;
  double most_error = 0;  ///< greatest distance of a decoded colour, in RGB or where the threshold is
  std::vector<AttributeParams> attributes;
  double color_seconds = 0,
         build_seconds = 0;  ///< of colours and attributes; of everything else, reading the source included
};

/// Checks whether the options are within their ranges and this build has their codec. Errors:
/// ErrorCode::usage, saying which is not, or naming the package that is missing.
Status validate(const Options& options);

/// Compresses `source`, with the attributes that it has, into a container written to `sink`, in one pass.
/// Memory: the DAG and some parts of colours; with Colors::all or along a Hilbert curve, all colours, twice;
/// with palette, all colours; the same of attributes, but for palette. What is written does not depend on
/// ctx.threads. With Options::simplify also the DAG of what there was, until the distance to it is measured.
/// Errors:
/// - ErrorCode::usage: those of `validate`.
/// - ErrorCode::limit: more than 2^32 - 1 different leaf words, or words of the nodes of a height; as many
///   colours with Counts::pointer; more memory than ctx.memory allows.
/// - ErrorCode::interrupted: a signal came.
/// - ErrorCode::internal: a source that is no surface, or not in Morton order; a library that cannot encode
///   an image.
/// - Those of `source` and of `sink`, as they are.
Result<Report> encode(SurfaceSource& source, const Options& options, const ByteSink& sink, Context& ctx);
/// The bytes of a part of so many colours as the codec stores them, where they are known; its colours in the
/// source are then those that they stand for. Called from any thread.
using StoredPart =
    std::function<Result<std::optional<std::vector<std::byte>>>(uint64_t part, uint32_t colors)>;
/// The same with parts that are encoded already: of bc1, bc7, astc, jpeg, jp2 or png.
Result<Report> encode(SurfaceSource& source, const Options& options, const StoredPart& stored,
                      const ByteSink& sink, Context& ctx);

/// A compressed surface, opened for random access. Safe on any bytes: every operation returns an error or a
/// well-formed answer. The DAG is verified when it is first used, colours part by part. Of images and
/// predicted colours, the first colour of a part takes as long as all of them: they are decoded and kept
/// (decoded_parts.h). Const functions are thread-safe.
class Volume {
 public:
  /// `memory`: what decoded images, octrees and the DAGs that are made of them count against; it must outlive
  /// the volume. Null: a budget of its own. `threads`: what an octree is decoded on.
  static Result<std::shared_ptr<const Volume>> open(std::shared_ptr<const Container> container,
                                                    MemoryBudget* memory = nullptr, int threads = 1);
  ~Volume();

  /// The colours of a part, as many as it has.
  using PartColors = std::function<Result<std::vector<Rgb>>(uint64_t part)>;
  /// The same voxels with other colours, under the same numbers. `colors` is called when a part is first
  /// used, from any thread, and takes `work_bytes`; what it gives counts against `memory`. Both must outlive
  /// the volume.
  Result<std::shared_ptr<const Volume>> recolored(PartColors colors, uint64_t work_bytes,
                                                  MemoryBudget& memory) const;

  /// Voxels are rgba32: where there is one its alpha is its opacity, at least 1, if it has that, else 255;
  /// elsewhere void.
  const VolumeInfo& info() const { return info_; }
  const Params& params() const { return params_; }
  const Container& container() const { return *container_; }
  const Store& store() const { return *store_; }

  /// What voxels have beside colours, under the same numbers (attribute_reader.h): those of
  /// params().attributes, by number.
  const std::vector<AttributeParams>& attributes() const;
  /// The colour with a number below params().color_count.
  Result<Rgb> color(uint64_t index) const;
  /// The colour of the voxel at a place inside the volume; nothing where there is none.
  Result<std::optional<Rgb>> voxel(Index3 place) const;
  /// Decodes `box`, inside the volume.
  Status decode(const Box& box, VoxelSpan out) const;
  /// Void, where the whole box is known to be that.
  std::optional<Voxel> uniform(const Box& box) const;
  /// All voxels in Morton order, in runs, with their attributes.
  Status for_each_voxel(const SurfaceSource::Sink& sink, Context& ctx) const;
  /// Those in a box inside the volume. Whether counts add up is known of the whole only: see `check`.
  Status for_each_voxel(const Box& box, const SurfaceSource::Sink& sink) const;
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
