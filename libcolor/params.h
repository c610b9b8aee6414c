// What an encoder is asked for, and what a file of coloured surfaces says about itself: the terms that all
// parts of the codec share. FORMAT.md, section 4.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "formats/result.h"
#include "libcolor/surface/attributes.h"

namespace voxkit::color {

/// What has a colour. Numbers are part of FORMAT.md.
enum class Colors : uint8_t {
  leaf = 1,  ///< voxels
  all = 2,   ///< nodes and voxels
};
/// Where counts of colours are.
enum class Counts : uint8_t {
  node = 1,     ///< in nodes: small
  pointer = 2,  ///< beside pointers: fewer words to read on the way
};

/// How it is stored where voxels are. Numbers are part of FORMAT.md.
enum class Geometry : uint8_t {
  dag = 0,     ///< nodes with pointers, equal ones once: for access, as published
  ssvdag = 1,  ///< mirror images once as well, pointers of 2 to 4 bytes: for access, smaller
  octree = 2,  ///< masks alone, entropy-coded: for storage; a DAG is made of it in memory where one is needed
};

/// In which order a walk comes to the octants of a cell. Numbers are part of FORMAT.md.
enum class Curve : uint8_t {
  morton = 1,
  hilbert = 2,  ///< each voxel touches the next one
};

/// How a part of the colours fills an image. Numbers are part of FORMAT.md.
enum class ImageCurve : uint8_t {
  morton = 1,
  hilbert = 2,  ///< neighbours on the curve are neighbours in the image, too
};

/// How the values at both ends of a block are held. Numbers are part of FORMAT.md.
enum class Endpoints : uint8_t {
  rgb565 = 1,  ///< 16 bits each
  rgb888 = 2,  ///< 24 bits each
  // Of attributes of one or two bytes, which are as colours that are otherwise black.
  one = 3,
  two = 4,
};

/// Where distances are measured. Numbers are part of FORMAT.md.
enum class ErrorSpace : uint8_t {
  rgb = 0,    ///< sRGB of 0 to 255, or bytes of attributes
  lab = 1,    ///< CIELAB
  angle = 2,  ///< degrees between directions in two bytes (octahedral.h)
};

/// Of fws and vws: bits of a voxel's step between the ends of its block.
inline constexpr int most_weight_bits = 4;

/// Pixels of a block.
struct BlockSize {
  uint32_t width = 4, height = 4;
  friend bool operator==(const BlockSize&, const BlockSize&) = default;
};

/// Height of a leaf word: 4 x 4 x 4 voxels.
inline constexpr int leaf_height = 2;
/// Colours of a part, which is stored by itself.
inline constexpr int part_log2 = 20;
inline constexpr uint32_t part_colors = 1 << part_log2;
/// How many parts so many colours have.
constexpr uint64_t part_count(uint64_t colors) {
  return (colors >> part_log2) + ((colors & (part_colors - 1)) != 0);
}
/// Colours of a part.
constexpr uint32_t colors_of_part(uint64_t colors, uint64_t part) {
  const uint64_t left = colors - (part << part_log2);
  return static_cast<uint32_t>(left < part_colors ? left : part_colors);
}

/// How colours are stored. Numbers are part of FORMAT.md.
enum class ColorCodec : uint8_t {
  raw = 1,      ///< 24 bits each
  fws = 2,      ///< variable bitrate blocks, weights of fixed size (section 4.2)
  vws = 3,      ///< the same, weights of variable size (section 4.3)
  bc1 = 4,      ///< an image of them, in blocks of 16 (section 4.1): 4 bits each
  astc = 5,     ///< the same, blocks of 16 bytes for 16 to 144 colours; not in every build
  bc7 = 6,      ///< the same, blocks of 16 bytes for 16 colours: 8 bits each
  palette = 7,  ///< indices into palettes of blocks, of a palette of the scene (Dado et al. 2016)
  // Decoded as a whole, from here on. The same image as a file, a module each:
  jpeg = 8,
  jp2 = 9,
  png = 10,
  predicted = 11,  ///< from the voxels around, within a threshold (section 4.12): for storage
};

/// Whether a codec makes blocks of colours on a line.
constexpr bool makes_blocks(ColorCodec codec) {
  return codec == ColorCodec::fws || codec == ColorCodec::vws;
}

/// Whether a codec keeps within a threshold.
constexpr bool has_threshold(ColorCodec codec) {
  return makes_blocks(codec) || codec == ColorCodec::predicted;
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

/// Greatest distance within which a surface may be simplified, in voxels.
inline constexpr int most_simplify = 8;

/// What an encoder is asked for.
struct Options {
  ColorCodec codec = ColorCodec::vws;
  double threshold = 9.56;             ///< of fws, vws, predicted: greatest distance of a decoded colour
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
  /// Not said: ssvdag, or dag with Counts::pointer, and where an ssvdag would take more than its pointers
  /// reach or there is memory for; `for_storage`: or octree, if that is smaller.
  std::optional<Geometry> geometry;
  bool for_storage = false;
  Curve curve = Curve::morton;  ///< in which order voxels have their colours
  /// By attribute, of fws and vws: greatest error of a value; not said: emissive as colours, or 9.56; opacity
  /// 4; normal 3 degrees; rm 8.
  std::array<std::optional<double>, attribute_kinds.size()> attribute_thresholds{};
  /// Fewer voxels: each that there was has one within that distance, in voxels, and the other way around; 0
  /// to most_simplify (simplified_surface.h).
  double simplify = 0;
  int zstd = 0;  ///< level of zstd for the file's chunks, 1 to 19; 0: as they are
};

/// The blocks of what is encoded with these options.
BlockSize block_size_of(const Options& options);

/// What a file says about itself.
struct Params {
  ColorCodec codec = ColorCodec::vws;
  Colors colors = Colors::leaf;
  Counts counts = Counts::node;
  Geometry geometry = Geometry::dag;
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
  uint64_t dag_nodes = 0;    ///< leaf words not counted; of an octree, all nodes
  uint64_t dag_bytes = 0;    ///< of nodes and leaf words; of an octree, of all of it
  uint64_t color_bytes = 0;  ///< of all parts
  uint64_t macro_blocks = 0, blocks = 0;
  AttributeSet attributes;  ///< beside colours
  double simplify = 0;      ///< as was asked for
  double hausdorff = 0;     ///< distance to what was there, as measured; in voxels, symmetric
};

}  // namespace voxkit::color
