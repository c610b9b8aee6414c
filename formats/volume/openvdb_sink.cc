#include "formats/volume/openvdb_sink.h"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>
#include <type_traits>

#include "formats/little_endian.h"
#include "formats/reservation.h"
#include "formats/volume/openvdb_archive.h"
#include "formats/volume/wide_integers.h"

namespace voxkit {
namespace {

using openvdb::Coord;

/// The affine as one of the library's maps: the simplest that keeps all bits.
openvdb::math::Transform::Ptr transform_of(const VolumeInfo& info) {
  namespace math = openvdb::math;
  const Affine affine = info.affine.is_valid() ? info.affine : Affine{};
  const openvdb::Vec3d origin(affine.origin[0], affine.origin[1], affine.origin[2]);
  math::MapBase::Ptr map;
  if (affine.is_plain()) {
    const auto s = affine.spacing();
    if (s[0] == s[1] && s[0] == s[2])
      map = std::make_shared<math::UniformScaleTranslateMap>(s[0], origin);
    else
      map = std::make_shared<math::ScaleTranslateMap>(openvdb::Vec3d(s[0], s[1], s[2]), origin);
  } else {
    openvdb::Mat4d m = openvdb::Mat4d::identity();
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) m(a, b) = affine.axes[static_cast<size_t>(a)][static_cast<size_t>(b)];
      m(3, a) = affine.origin[static_cast<size_t>(a)];
    }
    map = std::make_shared<math::AffineMap>(m);
  }
  // A transform that is made of a map is simplified, by differences of places, which costs bits; one that is
  // read is not.
  std::stringstream bytes;
  openvdb::io::setCurrentVersion(bytes);
  openvdb::writeString(bytes, map->type());
  map->write(bytes);
  auto transform = std::make_shared<math::Transform>();
  transform->read(bytes);
  return transform;
}

void set_metadata(openvdb::GridBase& grid, const VolumeInfo& info) {
  const auto put = [&](const char* key, const std::string& text) {
    grid.insertMeta(key, openvdb::StringMetadata(text));
  };
  if (info.world != World::unknown) put(world_key, std::string(name(info.world)));
  if (info.unit != Unit::unknown) put(unit_key, std::string(name(info.unit)));
  if (!info.description.empty()) put(description_key, info.description);
  if (info.slope != 1 || info.intercept != 0)
    put(scale_key, fmt::format("{} {}", info.slope, info.intercept));
}

template <class Grid_>
class VdbSink : public VolumeSink {
 protected:
  using Grid = Grid_;
  using Value = typename Grid::ValueType;
  using Leaf = typename Grid::TreeType::LeafNodeType;

 public:
  VdbSink(const VolumeInfo& info, std::unique_ptr<OutputFile> file, MemoryBudget* memory)
      : info_(info), file_(std::move(file)), memory_(*memory), grid_(Grid::create()) {
    grid_->setTransform(transform_of(info));
    set_metadata(*grid_, info);
    grid_->setName(is_color(info.format) ? "color" : "density");
    if (!is_color(info.format)) grid_->setGridClass(openvdb::GRID_FOG_VOLUME);
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
      return fail(ErrorCode::internal, file_->name(), first_line(error.what()));
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
      // Halfs that were read stay such; what is none of them makes all of them floats.
      if (info_.sample_type == SampleType::f16 && halves_) grid_->setSaveFloatAsHalf(true);
      VdbArchive().write_to(stream, grid_);
      stream.close();
    } catch (const std::bad_alloc&) {
      return fail(ErrorCode::limit, file_->name(), "not enough memory to write the OpenVDB grid");
    } catch (const std::ios_base::failure&) {
      return fail(ErrorCode::output, file_->name(), "cannot write the file");
    } catch (const std::exception& error) {
      return fail(ErrorCode::output, file_->name(), "cannot write: " + first_line(error.what()));
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
  bool value_of(const std::byte* voxel, Value& value) {
    if constexpr (std::is_same_v<Value, float>) {
      if (info_.format == VoxelFormat::float32) {
        std::memcpy(&value, voxel, sizeof value);
        if (info_.sample_type == SampleType::f16)
          halves_ &= static_cast<float>(openvdb::math::half(value)) == value || value != value;
      } else {
        value = static_cast<float>(stored_at(voxel) - static_cast<double>(info_.bias()));
      }
      return value != 0;
    } else if constexpr (std::is_integral_v<Value>) {
      std::array<std::byte, 8> sample{};
      to_wide(voxel, 1, info_, sample.data());
      if (info_.sample_type == SampleType::u32)
        value = static_cast<Value>(load_le<uint32_t>(sample.data()));
      else if (info_.sample_type == SampleType::i32)
        value = static_cast<Value>(load_le<int32_t>(sample.data()));
      else
        value = static_cast<Value>(load_le<int64_t>(sample.data()));
      return value != 0;
    } else {
      for (int c = 0; c < 3; ++c) value[c] = static_cast<float>(voxel[c]) / 255.0f;
      return info_.format == VoxelFormat::rgb24 || voxel[3] != std::byte{0};
    }
  }
  int32_t stored_at(const std::byte* voxel) const {
    const int32_t low = static_cast<int32_t>(voxel[0]);
    return info_.format == VoxelFormat::density16 ? low | static_cast<int32_t>(voxel[1]) << 8 : low;
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
  bool halves_ = true;  ///< all values are halfs
};

/// The same grid from voxels one by one, so that void costs nothing.
class VdbVoxelSink final : public VoxelSink, private VdbSink<openvdb::Vec3SGrid> {
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

/// Whether all values of a volume of wide integers are int64; of 64 unsigned bits some may not be.
bool fits_int64(const VolumeInfo& info) {
  if (info.sample_type != SampleType::u64) return true;
  if (info.labels) return info.labels->empty() || info.labels->back() >= 0;  // ascending as they are unsigned
  return info.format == VoxelFormat::float32 ? !info.rounded
                                             : info.wide_base >= 0 && info.wide_base <= INT64_MAX - 65535;
}

Status check_grid(const std::string& path, const VolumeInfo& info) {
  for (int axis = 0; axis < 3; ++axis)
    if (info.dims[axis] > INT32_MAX)
      return fail(ErrorCode::usage, path, "OpenVDB grids have at most 2^31 - 1 voxels a side");
  if (is_wide(info.sample_type) && !is_color(info.format) && !fits_int64(info))
    return fail(ErrorCode::usage, path,
                "OpenVDB grids hold integers below 2^63: expected others, or --type f32");
  if (path == "-") return bad_usage("an OpenVDB file cannot be written to standard output: name a file");
  return {};
}

/// What a grid does not say.
void note_losses(const std::string& path, const VolumeInfo& info, Context& ctx) {
  if (info.fill) ctx.note(path + ": an OpenVDB file does not hold its fill value: dropped");
  if (info.is_labels) ctx.note(path + ": an OpenVDB file does not hold that its values are labels: dropped");
}

}  // namespace

VoxelSinkResult create_vdb_voxel_sink(const std::string& path, const VolumeInfo& info, bool force,
                                      Context& ctx) {
  VOX_CHECK(check_grid(path, info));
  note_losses(path, info, ctx);
  VOX_TRY(auto file, OutputFile::create(path, force));
  try {
    register_vdb_types();
    return std::make_unique<VdbVoxelSink>(info, std::move(file), ctx.memory);
  } catch (const std::exception& error) {
    return fail(ErrorCode::output, path, first_line(error.what()));
  }
}

SinkResult create_vdb_sink(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  VOX_CHECK(check_grid(path, info));
  note_losses(path, info, ctx);
  VOX_TRY(auto file, OutputFile::create(path, force));
  try {
    register_vdb_types();
    if (is_color(info.format))
      return std::make_unique<VdbSink<openvdb::Vec3SGrid>>(info, std::move(file), ctx.memory);
    if (info.sample_type == SampleType::i32 && is_wide(info.sample_type))
      return std::make_unique<VdbSink<openvdb::Int32Grid>>(info, std::move(file), ctx.memory);
    if (is_wide(info.sample_type))
      return std::make_unique<VdbSink<openvdb::Int64Grid>>(info, std::move(file), ctx.memory);
    return std::make_unique<VdbSink<openvdb::FloatGrid>>(info, std::move(file), ctx.memory);
  } catch (const std::exception& error) {
    return fail(ErrorCode::output, path, first_line(error.what()));
  }
}

}  // namespace voxkit
