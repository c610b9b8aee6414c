#include "formats/volume/openvdb_source.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <set>
#include <span>
#include <type_traits>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/reservation.h"
#include "formats/volume/openvdb_archive.h"
#include "formats/volume/openvdb_tree.h"
#include "formats/volume/wide_integers.h"

namespace voxkit {
namespace {

using openvdb::Coord;

/// A volume that can be told of which grids it is one.
class VdbVolume : public VolumeSource {
 public:
  void name_parts(std::vector<std::string> parts) { info_.parts = std::move(parts); }
};

/// How a grid's values become voxels. `hold` says so in `info`, once the tree is known.
struct Density {
  using Grid = openvdb::FloatGrid;
  static constexpr VoxelFormat format = VoxelFormat::float32;
  static Voxel voxel(float value, bool, const VolumeInfo&) { return Voxel::of(value); }
};
struct Doubles {
  using Grid = openvdb::DoubleGrid;
  static constexpr VoxelFormat format = VoxelFormat::float32;
  static Voxel voxel(double value, bool, const VolumeInfo&) { return Voxel::of(static_cast<float>(value)); }
};
struct Bits {
  using Grid = openvdb::BoolGrid;
  static constexpr VoxelFormat format = VoxelFormat::bitmap;
  static Voxel voxel(bool value, bool, const VolumeInfo&) { return Voxel::of(uint8_t{value}); }
};
template <class Grid_>
struct Integers {
  using Grid = Grid_;
  static constexpr VoxelFormat format = VoxelFormat::float32;  ///< or as they fit
  static Voxel voxel(typename Grid::ValueType value, bool, const VolumeInfo& info) {
    Voxel v;
    from_wide(reinterpret_cast<const std::byte*>(&value), false, 1, info, v.bytes.data());
    return v;
  }
};
/// Vectors from 0 to `full`; what is inactive is void, whatever colour it has.
template <class Grid_>
struct Color {
  using Grid = Grid_;
  using Value = typename Grid::ValueType;
  static constexpr bool integer = std::is_integral_v<typename Value::value_type>;
  static constexpr float full = integer ? 255.0f : 1.0f;
  static constexpr VoxelFormat format = VoxelFormat::rgba32;
  static Voxel voxel(const Value& value, bool active, const VolumeInfo&) {
    Voxel v;
    if (!active) return v;
    for (int c = 0; c < 3; ++c) {
      const auto part = static_cast<float>(value[c]);  // the comparison's order makes NaN 0
      v.bytes[static_cast<size_t>(c)] =
          std::byte(part > 0 ? static_cast<int>(std::min(part, full) * (255.0f / full) + 0.5f) : 0);
    }
    v.bytes[3] = std::byte{255};
    return v;
  }
};

template <class Kind>
class VdbSource final : public VdbVolume {
  using Grid = typename Kind::Grid;
  using Tree = typename Grid::TreeType;
  using Leaf = typename Tree::LeafNodeType;                  // 8^3 voxels
  using Upper = typename Tree::RootNodeType::ChildNodeType;  // 32^3 of the next, or tiles: 4096^3 voxels
  using Lower = typename Upper::ChildNodeType;               // 16^3 leaves or tiles: 128^3 voxels

 public:
  static SourceResult create(const std::string& path, typename Grid::Ptr grid, const OpenOptions& options,
                             Context& ctx) {
    std::unique_ptr<VdbSource> source(new VdbSource);
    VOX_TRY(source->memory_, Reservation::take(grid->memUsage(), "the OpenVDB grid", ctx));
    source->grid_ = grid;
    const openvdb::CoordBBox box = grid->evalActiveVoxelBoundingBox();
    auto& info = source->info_;
    const auto stated = grid->template getMetadata<openvdb::Vec3IMetadata>(dims_key);
    const auto inside = [&](int axis) {
      return box.empty() ? stated->value()[axis] > 0
                         : box.min()[axis] >= 0 && box.max()[axis] < stated->value()[axis];
    };
    if (stated && inside(0) && inside(1) && inside(2)) {
      for (int axis = 0; axis < 3; ++axis) info.dims[axis] = stated->value()[axis];
    } else if (box.empty()) {
      return bad_input(path, fmt::format("grid {} is empty: expected active voxels", grid->getName()));
    } else {
      source->min_ = {box.min().x(), box.min().y(), box.min().z()};
      for (int axis = 0; axis < 3; ++axis) info.dims[axis] = int64_t{box.max()[axis]} - box.min()[axis] + 1;
    }
    if (!checked_voxels(info.dims))
      return bad_input(
          path, fmt::format("grid {} spans {} x {} x {} voxels: expected at most 2^31 a side and 2^62 in all",
                            grid->getName(), info.dims.x, info.dims.y, info.dims.z));
    info.format = Kind::format;
    VOX_CHECK(source->hold(path, options, ctx));
    VOX_CHECK(source->place(path, ctx));
    return source;
  }

  Status read(const Box& box, VoxelSpan out) override {
    const Box asked = in_index_space(box);
    each_block<Lower::DIM>(asked, [&](Coord at, const Box& part) {
      const Lower* lower = grid_->tree().template probeConstNode<Lower>(at);
      if (!lower) {
        fill(span_of(part, asked, out), part.size(), info_.format, tile(at));
        return true;
      }
      each_block<Leaf::DIM>(part, [&](Coord leaf_at, const Box& piece) {
        const openvdb::Index n = Lower::coordToOffset(leaf_at);
        const VoxelSpan target = span_of(piece, asked, out);
        if (lower->isChildMaskOn(n))
          copy_leaf(*lower->getTable()[n].getChild(), piece, target);
        else
          fill(target, piece.size(), info_.format,
               Kind::voxel(lower->getTable()[n].getValue(), lower->isValueMaskOn(n), info_));
        return true;
      });
      return true;
    });
    return {};
  }

  /// From tiles alone: a box that meets a leaf is not looked at further.
  std::optional<Voxel> uniform(const Box& box) const override {
    if (box.empty()) return std::nullopt;
    std::optional<Voxel> common;
    const auto agrees = [&](const Voxel& v) {
      if (!common) common = v;
      return *common == v;
    };
    // Where there is no node of 4096 voxels a side, one tile speaks for all of it.
    const bool same = each_block<Upper::DIM>(in_index_space(box), [&](Coord corner, const Box& large) {
      if (!grid_->tree().template probeConstNode<Upper>(corner)) return agrees(tile(corner));
      return each_block<Lower::DIM>(large, [&](Coord at, const Box& part) {
        const Lower* lower = grid_->tree().template probeConstNode<Lower>(at);
        if (!lower) return agrees(tile(at));
        return each_block<Leaf::DIM>(part, [&](Coord leaf_at, const Box&) {
          const openvdb::Index n = Lower::coordToOffset(leaf_at);
          return !lower->isChildMaskOn(n) &&
                 agrees(Kind::voxel(lower->getTable()[n].getValue(), lower->isValueMaskOn(n), info_));
        });
      });
    });
    return same ? common : std::nullopt;
  }

 private:
  VdbSource() = default;

  Box in_index_space(const Box& box) const { return {box.lo + min_, box.hi + min_}; }

  VoxelSpan span_of(const Box& part, const Box& whole, VoxelSpan out) const {
    const Index3 at = part.lo - whole.lo;
    return {out.row(at.y, at.z) + at.x * voxel_bytes(info_.format), out.row_stride, out.slice_stride};
  }

  /// Value of the tile around a voxel, or the background.
  Voxel tile(Coord at) const {
    return Kind::voxel(grid_->tree().getValue(at), grid_->tree().isValueOn(at), info_);
  }

  /// Calls body(a voxel, part) for the part of `box` in each aligned block of `side` voxels, until it returns
  /// false.
  template <int64_t side, class Body>
  static bool each_block(const Box& box, const Body& body) {
    for (int64_t z = box.lo.z; z < box.hi.z; z = (z | (side - 1)) + 1)
      for (int64_t y = box.lo.y; y < box.hi.y; y = (y | (side - 1)) + 1)
        for (int64_t x = box.lo.x; x < box.hi.x; x = (x | (side - 1)) + 1) {
          const Box block{{x, y, z}, {(x | (side - 1)) + 1, (y | (side - 1)) + 1, (z | (side - 1)) + 1}};
          if (!body(Coord(static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)),
                    intersect(block, box)))
            return false;
        }
    return true;
  }

  /// In a leaf z runs fastest, in our memory x.
  void copy_leaf(const Leaf& leaf, const Box& part, VoxelSpan out) const {
    const int bytes = voxel_bytes(info_.format);
    for (int64_t z = part.lo.z; z < part.hi.z; ++z)
      for (int64_t y = part.lo.y; y < part.hi.y; ++y) {
        std::byte* row = out.row(y - part.lo.y, z - part.lo.z);
        for (int64_t x = part.lo.x; x < part.hi.x; ++x, row += bytes) {
          const auto n = static_cast<openvdb::Index>((x & 7) << 6 | (y & 7) << 3 | (z & 7));
          const Voxel v = Kind::voxel(value_at(leaf, n), leaf.isValueOn(n), info_);
          std::memcpy(row, v.bytes.data(), static_cast<size_t>(bytes));
        }
      }
  }
  static typename Grid::ValueType value_at(const Leaf& leaf, openvdb::Index n) {
    if constexpr (std::is_same_v<typename Grid::ValueType, bool>)
      return leaf.getValue(n);
    else
      return leaf.buffer().data()[n];
  }

  /// Calls visit(value) for the background, the tiles and the voxels of all leaves, active or not.
  template <class Visit>
  void each_value(const Visit& visit) const {
    const Tree& tree = grid_->tree();
    visit(tree.background(), false);
    auto tiles = tree.cbeginValueAll();
    tiles.setMaxDepth(Tree::ValueAllCIter::LEAF_DEPTH - 1);
    for (; tiles; ++tiles) visit(tiles.getValue(), tiles.isValueOn());
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
      for (openvdb::Index n = 0; n < Leaf::SIZE; ++n) visit(value_at(*leaf, n), leaf->isValueOn(n));
  }

  /// How the values that there are fit voxels.
  Status hold(const std::string& path, const OpenOptions& options, Context& ctx) {
    using Value = typename Grid::ValueType;
    VolumeInfo& info = info_;
    info.is_labels = options.labels && !is_color(info.format);
    if constexpr (is_color(Kind::format)) {
      info.sample_type = SampleType::u8;
      bool outside = false;
      each_value([&](const Value& value, bool active) {
        for (int c = 0; active && c < 3; ++c)
          outside |= !(static_cast<float>(value[c]) >= 0 && static_cast<float>(value[c]) <= Kind::full);
      });
      if (outside)
        ctx.note(
            fmt::format("{}: grid {} has vectors outside of 0..{}, which are no colours: they are clipped",
                        path, grid_->getName(), Kind::full));
    } else if constexpr (std::is_same_v<Value, bool>) {
      info.sample_type = SampleType::bit;
    } else if constexpr (std::is_same_v<Value, double>) {
      info.sample_type = SampleType::f64;
      each_value([&](double value, bool) {
        info.rounded |= static_cast<double>(static_cast<float>(value)) != value && value == value;
      });
      if (info.rounded)
        ctx.note(path + ": 64-bit floats are rounded to 32 bits; those beyond 3.4e38 become infinite");
    } else if constexpr (std::is_integral_v<Value>) {
      info.sample_type = sizeof(Value) == 4 ? SampleType::i32 : SampleType::i64;
      // One of each value stands for all; of more than a table holds, these and the ends.
      constexpr size_t enough = 65537;
      std::set<Value> different;
      Value lo = grid_->tree().background(), hi = lo;
      each_value([&](Value value, bool) {
        lo = std::min(lo, value), hi = std::max(hi, value);
        if (different.size() < enough) different.insert(value);
      });
      different.insert({lo, hi});
      const std::vector<Value> values(different.begin(), different.end());
      VOX_CHECK(
          fit_wide_integers(std::as_bytes(std::span(values)), false, options.round_wide, path, info, ctx));
    } else {
      info.sample_type = grid_->saveFloatAsHalf() ? SampleType::f16 : SampleType::f32;
    }
    return {};
  }

  std::string text_of(const char* key) const {
    const auto found = grid_->template getMetadata<openvdb::StringMetadata>(key);
    return found ? found->value() : std::string();
  }

  /// The grid's transform, and what metadata of ours say.
  Status place(const std::string& path, Context& ctx) {
    VolumeInfo& info = info_;
    const openvdb::Mat4d m = grid_->transform().baseMap()->getAffineMap()->getMat4();
    Affine affine;  // the library's vectors are rows
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) affine.axes[static_cast<size_t>(a)][static_cast<size_t>(b)] = m(a, b);
      affine.origin[static_cast<size_t>(a)] = m(3, a);
    }
    affine = affine.moved_to(
        {static_cast<double>(min_.x), static_cast<double>(min_.y), static_cast<double>(min_.z)});
    if (affine.is_valid())
      info.affine = affine;
    else
      ctx.note(
          fmt::format("{}: the transform of grid {} is that of no volume: dropped", path, grid_->getName()));
    const std::string world = text_of(world_key);
    for (int w = 0; w <= static_cast<int>(World::left_handed); ++w)
      if (name(static_cast<World>(w)) == world) info.world = static_cast<World>(w);
    info.unit = parse_unit(text_of(unit_key)).value_or(Unit::unknown);
    info.description = first_line(text_of(description_key));
    double slope = 1, intercept = 0;
    if (!is_color(info.format) &&
        std::sscanf(text_of(scale_key).c_str(), "%lf %lf", &slope, &intercept) == 2 && std::isfinite(slope) &&
        std::isfinite(intercept))
      info.slope = slope, info.intercept = intercept;
    return {};
  }

  typename Grid::ConstPtr grid_;
  Index3 min_{0};  ///< in the grid's index space, of our voxel (0, 0, 0)
  Reservation memory_;
};

/// The grid of that name; without a name the only one that is read here.
Result<GridEntry> choose(const std::string& path, const std::vector<GridEntry>& entries,
                         const OpenOptions& options, std::vector<std::string>& parts, Context& ctx) {
  const std::string& name = options.grid;
  std::string list;
  const GridEntry* chosen = nullptr;
  size_t readable = 0;
  for (const GridEntry& entry : entries) {
    list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", entry.name, entry.type);
    readable += entry.value_bytes() > 0;
    if (name.empty() ? entry.value_bytes() > 0 : entry.name == name)
      if (!chosen) chosen = &entry;
  }
  if (list.empty()) return bad_input(path, "file holds no grids");
  if (!chosen && name.empty())
    return bad_input(path,
                     "unsupported grid type: expected a grid of float, double, int32, int64, bool, vec3s or "
                     "vec3i: there are " +
                         list);
  if (!chosen) return bad_input(path, fmt::format("no grid is named {}: there are {}", name, list));
  if (name.empty() && readable > 1 && !options.any_part)
    return bad_input(path,
                     fmt::format("{} grids: expected --grid NAME with one of {}", entries.size(), list));
  if (chosen->value_bytes() == 0)
    return bad_input(
        path, fmt::format("grid {} has unsupported grid type {}: expected float, double, int32, int64, "
                          "bool, vec3s or vec3i",
                          name, chosen->type));
  if (!chosen->parent.empty())
    return bad_input(
        path, fmt::format("grid {} shares the voxels of another: expected a grid of its own", chosen->name));
  if (!chosen->is_linear())
    return bad_input(path, fmt::format("grid {} has the transform {}: expected a linear one", chosen->name,
                                       chosen->transform));
  if (entries.size() > 1) parts.push_back(fmt::format("--grid {} of {}", chosen->name, list));
  if (entries.size() > 1 && name.empty() && !options.any_part)
    ctx.note(fmt::format("{}: grid {} is read, the others are of types that are not: {}", path, chosen->name,
                         list));
  return *chosen;
}

template <class Tree>
uint64_t memory_of(const VdbTree& tree) {
  using Upper = typename Tree::RootNodeType::ChildNodeType;
  using Leaf = typename Tree::LeafNodeType;
  return tree.upper * sizeof(Upper) + tree.lower * sizeof(typename Upper::ChildNodeType) +
         tree.leaves * (sizeof(Leaf) + Leaf::SIZE * sizeof(typename Tree::ValueType));
}

template <class Kind>
SourceResult source_of(const std::string& path, const openvdb::GridBase::Ptr& grid,
                       const OpenOptions& options, Context& ctx) {
  return VdbSource<Kind>::create(path, openvdb::gridPtrCast<typename Kind::Grid>(grid), options, ctx);
}

/// Bytes of the tree in memory, within a percent or two.
uint64_t memory_of(const GridEntry& entry, const VdbTree& tree) {
  if (entry.is_vec3s()) return memory_of<openvdb::Vec3STree>(tree);
  if (entry.is("Tree_vec3i_5_4_3")) return memory_of<openvdb::Vec3ITree>(tree);
  if (entry.is("Tree_double_5_4_3")) return memory_of<openvdb::DoubleTree>(tree);
  if (entry.is("Tree_int64_5_4_3")) return memory_of<openvdb::Int64Tree>(tree);
  return memory_of<openvdb::FloatTree>(tree);  // and those that take less
}

/// A tree that was read, as a volume.
SourceResult volume_of(const std::string& path, const openvdb::GridBase::Ptr& grid,
                       const OpenOptions& options, Context& ctx) {
  if (grid->isType<openvdb::FloatGrid>()) return source_of<Density>(path, grid, options, ctx);
  if (grid->isType<openvdb::DoubleGrid>()) return source_of<Doubles>(path, grid, options, ctx);
  if (grid->isType<openvdb::BoolGrid>()) return source_of<Bits>(path, grid, options, ctx);
  if (grid->isType<openvdb::Int32Grid>())
    return source_of<Integers<openvdb::Int32Grid>>(path, grid, options, ctx);
  if (grid->isType<openvdb::Int64Grid>())
    return source_of<Integers<openvdb::Int64Grid>>(path, grid, options, ctx);
  if (grid->isType<openvdb::Vec3IGrid>())
    return source_of<Color<openvdb::Vec3IGrid>>(path, grid, options, ctx);
  return source_of<Color<openvdb::Vec3SGrid>>(path, grid, options, ctx);
}

}  // namespace

SourceResult open_vdb_grid(const std::string& path, const OpenOptions& options, Context& ctx) {
  std::ifstream stream(path, std::ios_base::binary | std::ios_base::ate);
  if (!stream) return bad_input(path, "cannot open the file");
  const int64_t size = stream.tellg();
  if (size < 0) return bad_input(path, "cannot read the file");
  try {
    register_vdb_types();
    stream.exceptions(std::ios_base::failbit | std::ios_base::badbit | std::ios_base::eofbit);
    VOX_TRY(const auto entries, Walker(stream, size).grids(path));
    std::vector<std::string> parts;
    VOX_TRY(const GridEntry entry, choose(path, entries, options, parts, ctx));
    VdbArchive archive;
    const openvdb::GridBase::Ptr grid = archive.read_head(stream, entry);
    const VdbCoding coding{openvdb::io::getDataCompression(stream), entry.value_bytes(),
                           grid->saveFloatAsHalf() ? entry.half_bytes() : entry.value_bytes(),
                           entry.is_bool()};
    VOX_TRY(const auto file, MappedFile::open(path));
    VOX_TRY(const VdbTree tree,
            check_vdb_tree(file->bytes(), path, static_cast<uint64_t>(stream.tellg()), coding));
    if (const auto end = static_cast<int64_t>(tree.end); end != entry.end && entry.end != size)
      return bad_input(path, fmt::format("grid {} ends at byte {}: expected {}", entry.name, end, entry.end));
    {
      const uint64_t bytes = memory_of(entry, tree);
      VOX_TRY(const Reservation loading, Reservation::take(bytes, "loading the OpenVDB grid", ctx));
      archive.read_tree(stream, *grid);
    }
    VOX_TRY(auto source, volume_of(path, grid, options, ctx));
    static_cast<VdbVolume&>(*source).name_parts(std::move(parts));
    return source;
  } catch (const std::ios_base::failure&) {
    return bad_input(path, fmt::format("corrupt OpenVDB file: a length leads past its end at byte {}", size));
  } catch (const std::bad_alloc&) {
    return bad_input(path, "corrupt OpenVDB file: a grid that no memory can hold");
  } catch (const std::exception& error) {
    return bad_input(path, "corrupt OpenVDB file: " + first_line(error.what()));
  }
}

}  // namespace voxkit
