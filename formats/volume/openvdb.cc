// OpenVDB files: sparse grids of floats (densities) and of Vec3s (colours).
#include <openvdb/util/logging.h>
// What the library's templates say about damaged files goes to standard error, which is ours.
#undef OPENVDB_LOG_WARN
#define OPENVDB_LOG_WARN(message) static_cast<void>(0)
#include <fmt/format.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/openvdb.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <mutex>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/reservation.h"
#include "formats/volume/openvdb_grids.h"
#include "formats/volume/openvdb_tree.h"
#include "formats/volume/volume_module.h"

#ifdef VOXKIT_OPENVDB_INSTANTIATED
// The library has these, and compiling them once more takes longer than all of this file.
namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {
extern template class Grid<FloatTree>;
extern template class Grid<Vec3STree>;
namespace tree {
extern template class Tree<FloatTree::RootNodeType>;
extern template class Tree<Vec3STree::RootNodeType>;
}  // namespace tree
}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
#endif

namespace voxkit {
namespace {

using openvdb::Coord;

/// Extent that our writer states, since the box of the active voxels leaves out empty borders: x, y, z from
/// (0, 0, 0).
constexpr const char* dims_key = "voxkit_dims";

std::string one_line(const std::string& text) {
  return text.substr(0, text.find('\n'));
}

/// Only what is read here is registered. Metadata of other types stay bytes, so that no library code
/// interprets them.
void register_types() {
  static std::once_flag once;
  std::call_once(once, [] {
    namespace math = openvdb::math;
    // Else the logger of the library complains, on standard error, that it has nowhere to log to.
    setenv("LOG4CPLUS_LOGLOG_QUIETMODE", "true", /*overwrite=*/0);
    math::MapRegistry::registerMap(math::AffineMap::mapType(), math::AffineMap::create);
    math::MapRegistry::registerMap(math::UnitaryMap::mapType(), math::UnitaryMap::create);
    math::MapRegistry::registerMap(math::ScaleMap::mapType(), math::ScaleMap::create);
    math::MapRegistry::registerMap(math::UniformScaleMap::mapType(), math::UniformScaleMap::create);
    math::MapRegistry::registerMap(math::TranslationMap::mapType(), math::TranslationMap::create);
    math::MapRegistry::registerMap(math::ScaleTranslateMap::mapType(), math::ScaleTranslateMap::create);
    math::MapRegistry::registerMap(math::UniformScaleTranslateMap::mapType(),
                                   math::UniformScaleTranslateMap::create);
    openvdb::FloatGrid::registerGrid();
    openvdb::Vec3SGrid::registerGrid();
    openvdb::Vec3IMetadata::registerType();
    openvdb::BoolMetadata::registerType();  // whether values are stored as halves
  });
}

/// io::File hides its streams, and with them what goes wrong on them: a short read yields zeros and a full
/// disk a cut file.
class Archive : public openvdb::io::Archive {
 public:
  /// The grid without its tree, at which the stream stands then.
  openvdb::GridBase::Ptr read_head(std::istream& stream, const GridEntry& entry) {
    stream.seekg(0);
    readHeader(stream);
    openvdb::io::setStreamMetadataPtr(stream, state_, /*transfer=*/false);
    openvdb::io::setVersion(stream, libraryVersion(), fileVersion());
    openvdb::io::setDataCompression(stream, compression());
    stream.seekg(entry.descriptor);
    openvdb::io::GridDescriptor descriptor;
    openvdb::GridBase::Ptr grid = descriptor.read(stream);
    stream.seekg(entry.start);
    readGridCompression(stream);
    grid->readMeta(stream);
    openvdb::io::setGridClass(stream, grid->getGridClass());
    grid->readTransform(stream);
    return grid;
  }
  /// The tree, which check_vdb_tree has passed: OpenVDB itself checks nothing.
  void read_tree(std::istream& stream, openvdb::GridBase& grid) {
    grid.readTopology(stream);
    grid.readBuffers(stream);
    openvdb::io::clearStreamMetadataPtr(stream);
  }
  void write_to(std::ostream& stream, const openvdb::GridBase::Ptr& grid) {
    setCompression(openvdb::io::COMPRESS_ACTIVE_MASK |
                   (hasBloscCompression() ? openvdb::io::COMPRESS_BLOSC : openvdb::io::COMPRESS_ZIP));
    write(stream, openvdb::GridCPtrVec{grid}, /*seekable=*/true);
    // The header holds a random UUID; the same volume shall give the same bytes.
    constexpr int64_t uuid_offset = 21;
    stream.seekp(uuid_offset);
    stream.write("00000000-0000-0000-0000-000000000000", 36);
    stream.flush();
  }

 private:
  using openvdb::io::Archive::write;
  openvdb::io::StreamMetadata::Ptr state_{new openvdb::io::StreamMetadata};  ///< the stream only points to it
};

// -----------------------------------------------------------------------------------------------------
// reading

/// How a grid's values become voxels, and back.
struct Density {
  using Grid = openvdb::FloatGrid;
  static constexpr VoxelFormat format = VoxelFormat::float32;
  static Voxel voxel(float value, bool) { return Voxel::of(value); }
};
struct Colour {
  using Grid = openvdb::Vec3SGrid;
  static constexpr VoxelFormat format = VoxelFormat::rgba32;
  /// What is inactive is void, whatever colour it has.
  static Voxel voxel(const openvdb::Vec3s& value, bool active) {
    Voxel v;
    if (!active) return v;
    for (int c = 0; c < 3; ++c)  // the comparison's order makes NaN 0
      v.bytes[static_cast<size_t>(c)] =
          std::byte(value[c] > 0 ? static_cast<int>(std::min(value[c], 1.0f) * 255.0f + 0.5f) : 0);
    v.bytes[3] = std::byte{255};
    return v;
  }
};

template <class Kind>
class VdbSource : public VolumeSource {
  using Grid = typename Kind::Grid;
  using Tree = typename Grid::TreeType;
  using Leaf = typename Tree::LeafNodeType;                  // 8^3 voxels
  using Upper = typename Tree::RootNodeType::ChildNodeType;  // 32^3 of the next, or tiles: 4096^3 voxels
  using Lower = typename Upper::ChildNodeType;               // 16^3 leaves or tiles: 128^3 voxels

 public:
  static SourceResult create(const std::string& path, typename Grid::Ptr grid, Context& ctx) {
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
    info.sample_type = is_colour(Kind::format) ? SampleType::u8 : SampleType::f32;
    const openvdb::Vec3d size = grid->voxelSize();
    const openvdb::Vec3d corner = grid->indexToWorld(openvdb::Vec3d(static_cast<double>(source->min_.x),
                                                                    static_cast<double>(source->min_.y),
                                                                    static_cast<double>(source->min_.z)));
    for (int axis = 0; axis < 3; ++axis) {
      if (std::isfinite(size[axis]) && size[axis] > 0)
        info.affine.axes[static_cast<size_t>(axis)][static_cast<size_t>(axis)] = size[axis];
      if (std::isfinite(corner[axis])) info.affine.origin[static_cast<size_t>(axis)] = corner[axis];
    }
    return source;
  }

  Status read(const Box& box, VoxelSpan out) override {
    const Box asked = in_index_space(box);
    each_block<Lower::DIM>(asked, [&](Coord at, const Box& part) {
      const Lower* lower = grid_->tree().template probeConstNode<Lower>(at);
      if (!lower) {
        fill(span_of(part, asked, out), part.size(), Kind::format, tile(at));
        return true;
      }
      each_block<Leaf::DIM>(part, [&](Coord leaf_at, const Box& piece) {
        const openvdb::Index n = Lower::coordToOffset(leaf_at);
        const VoxelSpan target = span_of(piece, asked, out);
        if (lower->isChildMaskOn(n))
          copy_leaf(*lower->getTable()[n].getChild(), piece, target);
        else
          fill(target, piece.size(), Kind::format,
               Kind::voxel(lower->getTable()[n].getValue(), lower->isValueMaskOn(n)));
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
                 agrees(Kind::voxel(lower->getTable()[n].getValue(), lower->isValueMaskOn(n)));
        });
      });
    });
    return same ? common : std::nullopt;
  }

 private:
  VdbSource() = default;

  Box in_index_space(const Box& box) const { return {box.lo + min_, box.hi + min_}; }

  static VoxelSpan span_of(const Box& part, const Box& whole, VoxelSpan out) {
    const Index3 at = part.lo - whole.lo;
    return {out.row(at.y, at.z) + at.x * voxel_bytes(Kind::format), out.row_stride, out.slice_stride};
  }

  /// Value of the tile around a voxel, or the background.
  Voxel tile(Coord at) const { return Kind::voxel(grid_->tree().getValue(at), grid_->tree().isValueOn(at)); }

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
  static void copy_leaf(const Leaf& leaf, const Box& part, VoxelSpan out) {
    const auto* values = leaf.buffer().data();
    const int bytes = voxel_bytes(Kind::format);
    for (int64_t z = part.lo.z; z < part.hi.z; ++z)
      for (int64_t y = part.lo.y; y < part.hi.y; ++y) {
        std::byte* row = out.row(y - part.lo.y, z - part.lo.z);
        for (int64_t x = part.lo.x; x < part.hi.x; ++x, row += bytes) {
          const auto n = static_cast<openvdb::Index>((x & 7) << 6 | (y & 7) << 3 | (z & 7));
          const Voxel v = Kind::voxel(values[n], leaf.isValueOn(n));
          std::memcpy(row, v.bytes.data(), static_cast<size_t>(bytes));
        }
      }
  }

  typename Grid::ConstPtr grid_;
  Index3 min_{0};  ///< in the grid's index space, of our voxel (0, 0, 0)
  Reservation memory_;
};

/// The grid of that name, or the first of a type that we read.
Result<GridEntry> choose(const std::string& path, const std::vector<GridEntry>& entries,
                         const std::string& name) {
  std::string list;
  for (const GridEntry& entry : entries)
    list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", entry.name, entry.type);
  if (list.empty()) return bad_input(path, "file holds no grids");
  for (const GridEntry& entry : entries) {
    const bool readable = entry.is_float() || entry.is_vec3s();
    if (name.empty() ? !readable : entry.name != name) continue;
    if (!readable)
      return bad_input(path, fmt::format("grid {} has unsupported grid type {}: expected float or vec3s",
                                         name, entry.type));
    if (!entry.parent.empty())
      return bad_input(
          path, fmt::format("grid {} shares the voxels of another: expected a grid of its own", entry.name));
    return entry;
  }
  if (name.empty())
    return bad_input(path, "unsupported grid type: expected a float or vec3s grid: there are " + list);
  return bad_input(path, fmt::format("no grid is named {}: there are {}", name, list));
}

/// Bytes of the tree in memory, within a percent or two.
template <class Tree>
uint64_t memory_of(const VdbTree& tree) {
  using Upper = typename Tree::RootNodeType::ChildNodeType;
  using Leaf = typename Tree::LeafNodeType;
  return tree.upper * sizeof(Upper) + tree.lower * sizeof(typename Upper::ChildNodeType) +
         tree.leaves * (sizeof(Leaf) + Leaf::SIZE * sizeof(typename Tree::ValueType));
}

SourceResult open_grid(const std::string& path, const OpenOptions& options, Context& ctx) {
  const std::string& name = options.grid;
  std::ifstream stream(path, std::ios_base::binary | std::ios_base::ate);
  if (!stream) return bad_input(path, "cannot open the file");
  const int64_t size = stream.tellg();
  if (size < 0) return bad_input(path, "cannot read the file");
  try {
    register_types();
    stream.exceptions(std::ios_base::failbit | std::ios_base::badbit | std::ios_base::eofbit);
    VOX_TRY(const auto entries, Walker(stream, size).grids(path));
    VOX_TRY(const GridEntry entry, choose(path, entries, name));
    Archive archive;
    const openvdb::GridBase::Ptr grid = archive.read_head(stream, entry);
    const int value_bytes = entry.is_float() ? 4 : 12;
    const VdbCoding coding{openvdb::io::getDataCompression(stream), value_bytes,
                           grid->saveFloatAsHalf() ? value_bytes / 2 : value_bytes};
    VOX_TRY(const auto file, MappedFile::open(path));
    VOX_TRY(const VdbTree tree,
            check_vdb_tree(file->bytes(), path, static_cast<uint64_t>(stream.tellg()), coding));
    if (const auto end = static_cast<int64_t>(tree.end); end != entry.end && entry.end != size)
      return bad_input(path, fmt::format("grid {} ends at byte {}: expected {}", entry.name, end, entry.end));
    {
      const uint64_t bytes =
          entry.is_float() ? memory_of<openvdb::FloatTree>(tree) : memory_of<openvdb::Vec3STree>(tree);
      VOX_TRY(const Reservation loading, Reservation::take(bytes, "loading the OpenVDB grid", ctx));
      archive.read_tree(stream, *grid);
    }
    if (const auto floats = openvdb::gridPtrCast<openvdb::FloatGrid>(grid))
      return VdbSource<Density>::create(path, floats, ctx);
    return VdbSource<Colour>::create(path, openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid), ctx);
  } catch (const std::ios_base::failure&) {
    return bad_input(path, fmt::format("corrupt OpenVDB file: a length leads past its end at byte {}", size));
  } catch (const std::bad_alloc&) {
    return bad_input(path, "corrupt OpenVDB file: a grid that no memory can hold");
  } catch (const std::exception& error) {
    return bad_input(path, "corrupt OpenVDB file: " + one_line(error.what()));
  }
}

// -----------------------------------------------------------------------------------------------------
// writing

template <class Kind>
class VdbSink : public VolumeSink {
 protected:
  using Grid = typename Kind::Grid;
  using Value = typename Grid::ValueType;
  using Leaf = typename Grid::TreeType::LeafNodeType;

 public:
  VdbSink(const VolumeInfo& info, std::unique_ptr<OutputFile> file, MemoryBudget* memory)
      : info_(info), file_(std::move(file)), memory_(*memory), grid_(Grid::create()) {
    openvdb::math::Mat4d matrix = openvdb::math::Mat4d::identity();
    for (int axis = 0; axis < 3; ++axis) {
      const double spacing = info.affine.axes[static_cast<size_t>(axis)][static_cast<size_t>(axis)],
                   origin = info.affine.origin[static_cast<size_t>(axis)];
      matrix(axis, axis) = std::isfinite(spacing) && spacing > 0 ? spacing : 1;
      matrix(3, axis) = std::isfinite(origin) ? origin : 0;
    }
    grid_->setTransform(openvdb::math::Transform::createLinearTransform(matrix));
    grid_->setName(is_colour(info.format) ? "color" : "density");
    if (!is_colour(info.format)) grid_->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid_->insertMeta(dims_key, openvdb::Vec3IMetadata(openvdb::Vec3i(static_cast<int>(info.dims.x),
                                                                      static_cast<int>(info.dims.y),
                                                                      static_cast<int>(info.dims.z))));
  }

  Status write(int64_t z0, int64_t z1, ConstVoxelSpan voxels) override {
    if (z0 != next_ || z1 < z0 || z1 > info_.dims.z)
      return fail(ErrorCode::internal, file_->name(), "slices out of order");
    try {
      for (int64_t z = z0; z < z1; z = (z | 7) + 1)
        for (int64_t y = 0; y < info_.dims.y; y += 8)
          for (int64_t x = 0; x < info_.dims.x; x += 8)
            VOX_CHECK(write_leaf(
                {{x, y, z},
                 {std::min(x + 8, info_.dims.x), std::min(y + 8, info_.dims.y), std::min((z | 7) + 1, z1)}},
                z0, voxels));
    } catch (const std::bad_alloc&) {
      return no_memory();
    } catch (const std::exception& error) {
      return fail(ErrorCode::internal, file_->name(), one_line(error.what()));
    }
    next_ = z1;
    return {};
  }

  Status finish() override {
    if (next_ != info_.dims.z) return fail(ErrorCode::internal, file_->name(), "slices are missing");
    try {
      grid_->tree().prune(openvdb::zeroVal<Value>());
      std::ofstream stream;
      stream.exceptions(std::ios_base::failbit | std::ios_base::badbit);
      stream.open(file_->temporary(), std::ios_base::binary | std::ios_base::trunc);
      Archive().write_to(stream, grid_);
      stream.close();
    } catch (const std::bad_alloc&) {
      return fail(ErrorCode::limit, file_->name(), "not enough memory to write the OpenVDB grid");
    } catch (const std::ios_base::failure&) {
      return fail(ErrorCode::output, file_->name(), "cannot write the file");
    } catch (const std::exception& error) {
      return fail(ErrorCode::output, file_->name(), "cannot write: " + one_line(error.what()));
    }
    return file_->commit();
  }

 protected:
  /// The leaf around a voxel, made where there is none.
  Result<Leaf*> leaf_at(const Coord& at) {
    if (Leaf* const leaf = grid_->tree().probeLeaf(at)) return leaf;
    VOX_CHECK(memory_.add(leaf_bytes, "the OpenVDB grid"));
    return grid_->tree().touchLeaf(at);
  }
  Status no_memory() const {
    return fail(ErrorCode::limit, file_->name(), "not enough memory for the OpenVDB grid");
  }
  /// Nothing more will come.
  void end() { next_ = info_.dims.z; }

 private:
  /// A voxel's value, and whether it is active: whatever is not background or void.
  bool value_of(const std::byte* voxel, Value& value) const {
    if constexpr (std::is_same_v<Value, float>) {
      if (info_.format == VoxelFormat::float32) {
        std::memcpy(&value, voxel, sizeof value);
      } else {
        int32_t stored = static_cast<int32_t>(voxel[0]);
        if (info_.format == VoxelFormat::density16) stored |= static_cast<int32_t>(voxel[1]) << 8;
        value = static_cast<float>(stored - static_cast<double>(info_.bias()));
      }
      return value != 0;
    } else {
      for (int c = 0; c < 3; ++c) value[c] = static_cast<float>(voxel[c]) / 255.0f;
      return info_.format == VoxelFormat::rgb24 || voxel[3] != std::byte{0};
    }
  }

  /// The voxels of `box`, which lie in one leaf. A leaf is made only where there is something to hold.
  Status write_leaf(const Box& box, int64_t z0, ConstVoxelSpan voxels) {
    Leaf* leaf = nullptr;
    const Coord at(static_cast<int>(box.lo.x), static_cast<int>(box.lo.y), static_cast<int>(box.lo.z));
    const int bytes = voxel_bytes(info_.format);
    for (int64_t z = box.lo.z; z < box.hi.z; ++z)
      for (int64_t y = box.lo.y; y < box.hi.y; ++y) {
        const std::byte* row = voxels.row(y, z - z0);
        for (int64_t x = box.lo.x; x < box.hi.x; ++x) {
          Value value;
          if (!value_of(row + x * bytes, value)) continue;
          if (!leaf) {
            VOX_TRY(leaf, leaf_at(at));
          }
          leaf->setValueOn(static_cast<openvdb::Index>((x & 7) << 6 | (y & 7) << 3 | (z & 7)), value);
        }
      }
    return {};
  }

  static constexpr uint64_t leaf_bytes = sizeof(Leaf) + Leaf::SIZE * sizeof(Value) + 64;
  VolumeInfo info_;
  std::unique_ptr<OutputFile> file_;
  Reservation memory_;
  typename Grid::Ptr grid_;
  int64_t next_ = 0;
};

/// The same grid from voxels one by one, so that void costs nothing.
class VdbVoxelSink final : public VoxelSink, private VdbSink<Colour> {
 public:
  using VdbSink::VdbSink;

  Status add(std::span<const ModelVoxel> voxels) override {
    try {
      Leaf* leaf = nullptr;
      Coord known;
      for (const ModelVoxel& v : voxels) {
        const Coord at(v.place[0], v.place[1], v.place[2]), corner = at & ~7;
        if (!leaf || corner != known) {
          VOX_TRY(leaf, leaf_at(at));
          known = corner;
        }
        Value value;
        for (int c = 0; c < 3; ++c) value[c] = static_cast<float>(v.color[static_cast<size_t>(c)]) / 255.0f;
        leaf->setValueOn(Leaf::coordToOffset(at), value);
      }
    } catch (const std::bad_alloc&) {
      return no_memory();
    }
    return {};
  }
  Status finish() override {
    end();
    return VdbSink::finish();
  }
};

Status check_grid(const std::string& path, const VolumeInfo& info) {
  for (int axis = 0; axis < 3; ++axis)
    if (info.dims[axis] > INT32_MAX)
      return fail(ErrorCode::usage, path, "OpenVDB grids have at most 2^31 - 1 voxels a side");
  if (path == "-") return bad_usage("an OpenVDB file cannot be written to standard output: name a file");
  return {};
}

VoxelSinkResult create_voxels(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  VOX_CHECK(check_grid(path, info));
  VOX_TRY(auto file, OutputFile::create(path, force));
  try {
    register_types();
    return std::make_unique<VdbVoxelSink>(info, std::move(file), ctx.memory);
  } catch (const std::exception& error) {
    return fail(ErrorCode::output, path, one_line(error.what()));
  }
}

SinkResult create_grid(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  VOX_CHECK(check_grid(path, info));
  VOX_TRY(auto file, OutputFile::create(path, force));
  try {
    register_types();
    if (is_colour(info.format)) return std::make_unique<VdbSink<Colour>>(info, std::move(file), ctx.memory);
    return std::make_unique<VdbSink<Density>>(info, std::move(file), ctx.memory);
  } catch (const std::exception& error) {
    return fail(ErrorCode::output, path, one_line(error.what()));
  }
}

const VolumeModule volumes{.open = open_grid, .create = create_grid, .create_voxels = create_voxels};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.volume = &voxkit::volumes)
