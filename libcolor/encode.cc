// From a surface to a file: the DAG is built while colours are encoded, part by part.
#include <fmt/format.h>

#include <cmath>

#include "formats/clock.h"
#include "formats/parallel.h"
#include "formats/reservation.h"
#include "formats/volume_chunks.h"
#include "libcolor/attributes/attribute_order.h"
#include "libcolor/attributes/attribute_writer.h"
#include "libcolor/blocks/block_encode.h"
#include "libcolor/blocks/lab_colors.h"
#include "libcolor/dag/color_order.h"
#include "libcolor/dag/dag_builder.h"
#include "libcolor/dag/dag_recount.h"
#include "libcolor/dag/symmetric_dag.h"
#include "libcolor/layout.h"
#include "libcolor/octree/octree_encode.h"
#include "libcolor/part_codecs.h"
#include "libcolor/predicted/predicted.h"
#include "libcolor/simplify/hausdorff.h"
#include "libcolor/simplify/simplified_surface.h"
#include "libcolor/textures/astc.h"
#include "libcolor/textures/image_codec.h"
#include "libcolor/textures/texture.h"

namespace voxkit::color {
namespace {

/// Encodes and writes colours in their order, some parts at a time.
class ColorWriter {
 public:
  ColorWriter(const Options& options, const StoredPart& stored, ContainerWriter& container, Context& ctx)
      : options_(options),
        stored_(stored),
        container_(container),
        ctx_(ctx),
        reservation_(*ctx.memory),
        with_places_(options.codec == ColorCodec::predicted) {}

  Status begin() {
    batch_ = static_cast<size_t>(2 * ctx_.threads);
    constexpr uint64_t part_bytes = uint64_t{part_colors} * (sizeof(Rgb) + 4);  // and what becomes of them
    VOX_CHECK(reservation_.add(batch_ * part_bytes, "room for colors"));
    if (makes_images(options_.codec))
      VOX_CHECK(reservation_.add(static_cast<uint64_t>(ctx_.threads) * image_part_work_bytes(options_.codec),
                                 "encoding images of colors"));
    if (with_places_) {
      VOX_CHECK(reservation_.add(batch_ * part_colors * sizeof(uint64_t) +
                                     static_cast<uint64_t>(ctx_.threads) * predicted_encode_bytes,
                                 "predicting colors"));
      places_.reserve(batch_ << part_log2);
    }
    colors_.reserve(batch_ << part_log2);
    return {};
  }
  Status add(Rgb color) {
    colors_.push_back(color);
    return colors_.size() == batch_ << part_log2 ? flush() : Status();
  }
  /// Of a voxel, in Morton order.
  Status add(const SurfaceVoxel& voxel) {
    if (with_places_) places_.push_back(voxel.place);
    return add(voxel.color);
  }
  /// Writes the palette that colours are coded with, before the first of them.
  Status use(const Palette& palette) {
    palette_ = &palette;
    bytes += palette.colors().size_bytes();
    return container_.add(palette_kind, 0, 0, std::as_bytes(palette.colors()));
  }
  /// Encodes what is left.
  Status finish() { return flush(); }

  double seconds = 0;
  uint64_t bytes = 0, blocks = 0, squared_error = 0;
  uint32_t most_squared = 0;

 private:
  Status flush() {
    const auto start = Clock::now();
    const uint64_t count = part_count(colors_.size());
    std::vector<EncodedPart> encoded(count);
    VOX_CHECK(parallel_for(ctx_, static_cast<int64_t>(count), [&](int64_t i) -> Status {
      const auto part = static_cast<uint64_t>(i);
      const size_t first = part << part_log2, own = colors_of_part(colors_.size(), part);
      const PartContext context{
          palette_, with_places_ ? std::span(places_).subspan(first, own) : std::span<const uint64_t>()};
      VOX_TRY(encoded[part],
              stored_or_encoded(next_part_ + part, std::span(colors_).subspan(first, own), context));
      return {};
    }));
    for (const EncodedPart& part : encoded) {
      VOX_CHECK(container_.add(colors_kind, 0, next_part_++, part.bytes));
      bytes += part.bytes.size();
      blocks += part.blocks;
      squared_error += part.squared_error;
      most_squared = std::max(most_squared, part.most_squared);
    }
    colors_.clear();
    places_.clear();
    seconds += seconds_since(start);
    return {};
  }
  Result<EncodedPart> stored_or_encoded(uint64_t number, std::span<const Rgb> colors,
                                        const PartContext& context) const {
    const auto encode = [&] { return part_codec(options_.codec).encode(colors, options_, context); };
    if (!stored_) return encode();
    const auto count = static_cast<uint32_t>(colors.size());
    VOX_TRY(auto known, stored_(number, count));
    if (!known) return encode();
    EncodedPart part;
    part.bytes = std::move(*known);
    if (makes_textures(options_.codec))
      part.blocks = TextureLayout(options_.image_curve, block_size_of(options_), count).blocks();
    return part;
  }

  const Options& options_;
  const StoredPart& stored_;
  ContainerWriter& container_;
  Context& ctx_;
  Reservation reservation_;
  const bool with_places_;
  const Palette* palette_ = nullptr;
  std::vector<Rgb> colors_;
  std::vector<uint64_t> places_;  ///< of the colours, where they tell of them
  size_t batch_ = 0;
  uint64_t next_part_ = 0;
};

/// Writes where the voxels are, as nodes with pointers.
Status write_dag(const Dag& dag, ContainerWriter& container, Params& p) {
  VOX_CHECK(container.add(leaves_kind, 0, 0, std::as_bytes(std::span(dag.leaves))));
  p.dag_bytes = dag.leaves.size() * sizeof(uint64_t);
  for (int h = leaf_height + 1; h <= dag.height; ++h) {
    const auto& nodes = dag.nodes[static_cast<size_t>(h)];
    VOX_CHECK(container.add(nodes_kind, static_cast<uint32_t>(h), 0, std::as_bytes(std::span(nodes))));
    p.dag_bytes += nodes.size() * sizeof(uint32_t);
  }
  p.root = dag.root;
  p.dag_nodes = dag.node_count;
  return {};
}

/// The same with mirror images stored once.
Status write_symmetric(const SymmetricDag& symmetric, ContainerWriter& container, Params& p) {
  p.geometry = Geometry::ssvdag;
  VOX_CHECK(container.add(leaves_kind, 0, 0, std::as_bytes(std::span(symmetric.leaves))));
  p.dag_bytes = symmetric.leaves.size() * sizeof(uint64_t);
  for (int h = leaf_height + 1; h <= symmetric.height; ++h) {
    const auto& nodes = symmetric.nodes[static_cast<size_t>(h)];
    VOX_CHECK(container.add(symmetric_kind, static_cast<uint32_t>(h), 0, std::as_bytes(std::span(nodes))));
    p.dag_bytes += nodes.size();
  }
  p.root = symmetric.root;
  p.dag_nodes = symmetric.node_count;
  return {};
}

/// Or as the masks of an octree.
Status write_octree(const EncodedOctree& encoded, ContainerWriter& container, Params& p) {
  p.geometry = Geometry::octree;
  p.dag_bytes = encoded.bytes;
  p.dag_nodes = encoded.nodes;
  VOX_CHECK(container.add(octree_kind, 0, 0, encoded.directory));
  for (uint32_t part = 0; part < encoded.parts.size(); ++part)
    VOX_CHECK(container.add(masks_kind, 0, part, encoded.parts[part]));
  return {};
}

uint64_t bytes_of(const SymmetricDag& dag) {
  uint64_t bytes = dag.leaves.size() * sizeof(uint64_t);
  for (const auto& nodes : dag.nodes) bytes += nodes.size();
  return bytes;
}

Result<EncodedOctree> encoded_octree(const Dag& dag, Context& ctx) {
  Reservation memory(*ctx.memory);
  VOX_TRY(const Octree octree, octree_of(dag, memory));
  return encode_octree(octree, ctx);
}

Status write_geometry(const Dag& dag, const Options& options, ContainerWriter& container, Params& p,
                      Context& ctx) {
  const bool any = !options.geometry;
  // What was not asked for by name, and is too large, is left out, with a note.
  const auto unless_too_large = [&](const auto& made, const char* what) -> Status {
    if (made) return {};
    if (!any || made.error().code != ErrorCode::limit) return tl::unexpected<Error>(made.error());
    ctx.note(fmt::format("geometry is not stored {}: {}", what, made.error().what));
    return {};
  };
  Result<SymmetricDag> symmetric = SymmetricDag();
  const bool with_symmetry = (any && options.counts == Counts::node) || options.geometry == Geometry::ssvdag;
  if (with_symmetry) {
    symmetric = symmetric_dag_of(dag, ctx);
    VOX_CHECK(unless_too_large(symmetric, "with symmetry"));
  }
  const bool use_symmetric = with_symmetry && symmetric;
  if (any ? options.for_storage : options.geometry == Geometry::octree) {
    const auto encoded = encoded_octree(dag, ctx);
    VOX_CHECK(unless_too_large(encoded, "as an octree"));
    if (encoded && (!use_symmetric || encoded->bytes <= bytes_of(*symmetric)))
      return write_octree(*encoded, container, p);
  }
  return use_symmetric ? write_symmetric(*symmetric, container, p) : write_dag(dag, container, p);
}

/// Room for more of what all voxels have, ahead of need: counted, and so is the copy while they move.
template <class T>
Status make_room(std::vector<T>& held, size_t more, const char* what, Reservation& reservation) {
  if (held.capacity() - held.size() >= more) return {};
  const size_t before = held.capacity(), room = std::max(held.size() + more, before + before / 2);
  VOX_CHECK(reservation.add(room * sizeof(T), what));
  held.reserve(room);
  reservation.release(before * sizeof(T));
  return {};
}

}  // namespace

BlockSize block_size_of(const Options& options) {
  return options.codec == ColorCodec::astc ? astc_block_size(options.quality) : BlockSize{};
}

Status validate(const Options& o) {
  if (!(o.threshold >= 0)) return bad_usage(fmt::format("threshold {}: expected 0 or more", o.threshold));
  if (o.weight_bits < 1 || o.weight_bits > most_weight_bits)
    return bad_usage(fmt::format("{} bits a weight: expected 1 to {}", o.weight_bits, most_weight_bits));
  if (o.quality < 0 || o.quality > 100)
    return bad_usage(fmt::format("quality {}: expected 0 to 100", o.quality));
  if (o.palette < 1 || o.palette > most_palette_colors)
    return bad_usage(fmt::format("a palette of {} colors: expected 1 to {}", o.palette, most_palette_colors));
  if (o.image_palette != 0 && (o.image_palette < 2 || o.image_palette > 256))
    return bad_usage(fmt::format("a palette of {} colors: expected 2 to 256, or 0", o.image_palette));
  if (o.geometry == Geometry::ssvdag && o.counts == Counts::pointer)
    return bad_usage("counts beside pointers: expected --counts node with --geometry ssvdag");
  for (const auto& threshold : o.attribute_thresholds)
    if (threshold && !(*threshold >= 0))
      return bad_usage(fmt::format("threshold {} of an attribute: expected 0 or more", *threshold));
  if (!(o.simplify >= 0 && o.simplify <= most_simplify))
    return bad_usage(fmt::format("simplify {}: expected 0 to {} voxels", o.simplify, most_simplify));
  VOX_CHECK(part_codec(o.codec).support(o));
  if (o.effort < 1 || o.effort > 9) return bad_usage(fmt::format("effort {}: expected 1 to 9", o.effort));
  return {};
}

Result<Report> encode(SurfaceSource& source, const Options& options, const ByteSink& sink, Context& ctx) {
  return encode(source, options, {}, sink, ctx);
}

Result<Report> encode(SurfaceSource& source, const Options& options, const StoredPart& stored,
                      const ByteSink& sink, Context& ctx) {
  VOX_CHECK(validate(options));
  const auto start = Clock::now();
  const VolumeInfo& info = source.info();
  const int height = height_of(info.dims);
  if (info.format != VoxelFormat::rgba32 || height > most_levels)
    return fail(ErrorCode::internal, {}, "not the extents of a surface");
  if (!checked_voxels(info.dims))
    return fail(ErrorCode::limit, {}, "a grid of more than 2^62 voxels: use a lower --resolution");
  ContainerWriter container(sink, Codec::color, container_version_for(info), options.zstd, *ctx.memory);
  VOX_CHECK(add_volume_info(container, info));

  ColorWriter colors(options, stored, container, ctx);
  VOX_CHECK(colors.begin());
  DagBuilder builder(height, ctx), exact(height, ctx);
  SimplifiedSurface simplified(source, options.simplify, [&](const VoxelRun& run) { return exact.add(run); });
  SurfaceSource& wanted = options.simplify > 0 ? simplified : source;
  const AttributeSet attributes = wanted.attributes();
  AttributeWriter values(attributes, options, container, ctx);
  VOX_CHECK(values.begin());
  const bool all = options.colors == Colors::all, reorder = all || options.curve != Curve::morton;
  // Until the nodes above, or the palette, are known.
  const bool hold = reorder || options.codec == ColorCodec::palette;
  std::vector<Rgb> held;
  std::vector<std::byte> held_values;
  Reservation reservation(*ctx.memory);
  VOX_CHECK(wanted.read(ctx, [&](const VoxelRun& run) -> Status {
    if (run.attributes.size() != run.voxels.size() * attributes.bytes())
      return fail(ErrorCode::internal, {}, "a run of voxels without the attributes that its source has");
    VOX_CHECK(builder.add(run));
    if (hold) {
      VOX_CHECK(make_room(held, run.voxels.size(), "room for all colors", reservation));
      for (const SurfaceVoxel& voxel : run.voxels) held.push_back(voxel.color);
    } else {
      for (const SurfaceVoxel& voxel : run.voxels) VOX_CHECK(colors.add(voxel));
    }
    if (!reorder) return values.add(run.attributes);
    VOX_CHECK(make_room(held_values, run.attributes.size(), "room for all attributes", reservation));
    held_values.insert(held_values.end(), run.attributes.begin(), run.attributes.end());
    return {};
  }));
  VOX_TRY(Dag dag, builder.finish());
  Report report;
  Params& p = report.params;
  if (options.simplify > 0) {
    VOX_TRY(const Dag before, exact.finish());
    p.simplify = options.simplify;
    VOX_TRY(p.hausdorff, hausdorff_distance(view_of(before), view_of(dag), options.simplify, ctx));
  }
  dag.curve = options.curve;
  Dag recounted;
  const bool other_counts = all || options.counts != Counts::node;
  if (other_counts) {
    VOX_TRY(recounted, recount(dag, options.colors, options.counts, options.curve, ctx));
  }
  if (reorder) {
    const uint64_t count = other_counts ? recounted.color_count : dag.color_count;
    VOX_TRY(held, colors_in_order(dag, count, options.colors, options.curve, held, reservation));
    VOX_TRY(held_values, attributes_in_order(dag, count, options.colors, options.curve, attributes,
                                             held_values, reservation));
  }
  if (other_counts) dag = std::move(recounted);
  std::optional<Palette> palette;
  if (options.codec == ColorCodec::palette) {
    const auto quantise_start = Clock::now();
    VOX_TRY(palette, Palette::choose(held, options.palette, options.effort, ctx));
    VOX_CHECK(colors.use(*palette));
    colors.seconds += seconds_since(quantise_start);
  }
  for (const Rgb color : held) VOX_CHECK(colors.add(color));
  VOX_CHECK(colors.finish());
  VOX_CHECK(values.add(held_values));
  VOX_CHECK(values.finish());

  VOX_CHECK(write_geometry(dag, options, container, p, ctx));
  p.codec = options.codec;
  p.colors = options.colors;
  p.counts = options.counts;
  p.curve = options.curve;
  p.height = height;
  p.leaf_voxels = dag.voxels;
  p.color_count = dag.color_count;
  p.attributes = attributes;
  p.color_bytes = colors.bytes;
  p.blocks = colors.blocks;
  if (palette) p.palette_colors = static_cast<uint32_t>(palette->colors().size());
  if (palette || makes_blocks(options.codec))
    p.macro_blocks = (dag.color_count + macro_block_colors - 1) / macro_block_colors;
  p.image_curve = options.image_curve;
  p.block_size = block_size_of(options);
  if (has_threshold(options.codec)) {
    if (makes_blocks(options.codec)) p.endpoints = endpoints_for(options.threshold, options.space);
    p.threshold = options.threshold;
    p.space = options.space;
    p.weight_bits = options.codec == ColorCodec::fws ? options.weight_bits : 0;
  }
  if (dag.color_count > 0)
    p.grmse =
        std::sqrt(static_cast<double>(colors.squared_error) / (3 * static_cast<double>(dag.color_count)));
  report.most_error = std::sqrt(static_cast<double>(colors.most_squared));
  if (p.space == ErrorSpace::lab) report.most_error /= lab_scale;
  VOX_CHECK(container.add(params_kind, 0, 0, pack_params(p)));
  VOX_CHECK(container.finish());
  report.attributes = values.params();
  report.color_seconds = colors.seconds + values.seconds;
  report.build_seconds = seconds_since(start) - report.color_seconds;
  return report;
}

}  // namespace voxkit::color
