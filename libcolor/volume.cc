// Random access to a compressed surface: opening, single voxels, boxes, all voxels.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <glm/vector_relational.hpp>

#include "formats/volume_chunks.h"
#include "libcolor/dag/box_walk.h"
#include "libcolor/store.h"
#include "libcolor/surface/morton.h"

namespace voxkit::color {
namespace {

Voxel voxel_of(Rgb c, uint32_t alpha) {
  return Voxel::of(static_cast<uint32_t>(c.r | c.g << 8 | c.b << 16) | alpha << 24);
}

/// Calls visit(word, corner, color, state) for the leaf words that touch a box, in Morton order, through an
/// octree or a DAG, whichever there is: where they begin, the number of their first colour, how they are gone
/// through. False if `visit` did not go on, a node is missing or has no octants, or a word has a voxel
/// outside of the volume, which the store then tells.
template <class Visit>
Result<bool> walk_box(const Volume& volume, const Box& box, const Visit& visit_sound) {
  const Store& store = volume.store();
  const Box all = volume.info().box();
  const auto visit = [&](uint64_t word, Index3 corner, uint64_t color, OrderState state) {
    const bool at_end = glm::any(glm::greaterThan(corner + (int64_t{1} << leaf_height), all.hi));
    if (const uint64_t outside = at_end ? word & ~leaf_within(corner, all) : 0; outside != 0) {
      const Index3 at = corner + Index3(morton_place(static_cast<uint64_t>(std::countr_zero(outside))));
      store.report(volume.container(),
                   fmt::format("chunk LEAF: a voxel at {},{},{}: outside the volume", at.x, at.y, at.z));
      return false;
    }
    return visit_sound(word, corner, color, state);
  };
  VOX_TRY(OctreeReader* const octree, store.octree(volume.container(), volume.params()));
  if (octree != nullptr)
    return octree->for_each_word(box, [&](uint64_t word, Index3 corner, uint64_t first) {
      return visit(word, corner, first, morton_state);
    });
  VOX_TRY(const DagView* const view, store.dag(volume.container(), volume.params()));
  return BoxWalk(*view, box).run([&](const WalkedCell& cell) {
    return visit(view->leaf(cell.pointer), cell.corner, cell.color, cell.state);
  });
}

}  // namespace

Volume::Volume() = default;
Volume::~Volume() = default;

Result<std::shared_ptr<const Volume>> Volume::open(std::shared_ptr<const Container> container,
                                                   MemoryBudget* memory, int threads) {
  const std::string& file = container->name();
  if (container->codec() != Codec::color) return bad_input(file, "header, byte 10: not a coloured surface");
  std::shared_ptr<Volume> volume(new Volume);
  VOX_TRY(volume->info_, read_volume_info(*container));
  VOX_TRY(const auto params_bytes, container->only_chunk(params_kind));
  VOX_TRY(volume->params_, unpack_params(params_bytes, volume->info_, file));
  if (memory == nullptr) memory = &volume->own_memory_.emplace();
  volume->store_ = std::make_unique<Store>(*memory, threads);
  VOX_CHECK(volume->store_->find_chunks(*container, volume->params_));
  volume->store_->decode_whole_parts(*container, volume->params_);
  volume->container_ = std::move(container);
  return volume;
}

Result<std::shared_ptr<const Volume>> Volume::recolored(PartColors colors, uint64_t work_bytes,
                                                        MemoryBudget& memory) const {
  std::shared_ptr<Volume> volume(new Volume);
  volume->container_ = container_;
  volume->info_ = info_;
  volume->params_ = params_;
  volume->params_.grmse = 0;  // of other colours
  volume->store_ = std::make_unique<Store>(memory, store_->threads());
  VOX_CHECK(volume->store_->find_chunks(*container_, params_));
  volume->store_->decode_parts(std::move(colors), work_bytes);
  return volume;
}

const std::vector<AttributeParams>& Volume::attributes() const {
  return store_->attributes().params();
}

Result<Rgb> Volume::color(uint64_t index) const {
  if (index >= params_.color_count) return fail(ErrorCode::internal, container_->name(), "no such color");
  ColorReader reader(*store_, *container_, params_);
  const Rgb color = reader.color(index);
  VOX_CHECK(store_->status());
  return color;
}

Result<std::optional<Rgb>> Volume::voxel(Index3 place) const {
  if (!info_.box().contains(place))
    return fail(ErrorCode::internal, container_->name(), "voxel outside the volume");
  VOX_TRY(const DagView* const view, store_->dag(*container_, params_));
  const Found found =
      find_voxel(*view, morton_code(static_cast<uint32_t>(place.x), static_cast<uint32_t>(place.y),
                                    static_cast<uint32_t>(place.z)));
  if (!found.there) return std::optional<Rgb>();
  if (found.color >= params_.color_count)
    return bad_input(container_->name(),
                     fmt::format("color {} of a voxel: there are {}", found.color, params_.color_count));
  VOX_TRY(const Rgb color, this->color(found.color));
  return std::optional<Rgb>(color);
}

Status Volume::decode(const Box& box, VoxelSpan out) const {
  if (box.empty()) return {};
  if (!info_.box().contains(box))
    return fail(ErrorCode::internal, container_->name(), "box outside the volume");
  fill(out, box.size(), VoxelFormat::rgba32, {});
  if (params_.leaf_voxels == 0) return {};
  ColorReader reader(*store_, *container_, params_);
  std::optional<AttributeReader> opacity;
  if (params_.attributes.has(Attribute::opacity))
    opacity.emplace(*store_, *container_, params_, Attribute::opacity);
  VOX_TRY(const bool complete,
          walk_box(*this, box, [&](uint64_t leaf, Index3 corner, uint64_t color, OrderState state) {
            if (leaf == 0) return false;
            for (uint64_t left = leaf & leaf_within(corner, box); left != 0; left &= left - 1) {
              const auto bit = static_cast<uint32_t>(std::countr_zero(left));
              const uint64_t index = color + leaf_index(leaf, bit, params_.colors, state);
              // What is there is not void.
              const uint32_t alpha = opacity ? std::max(1u, opacity->value(index)) : 255;
              const Voxel voxel = voxel_of(reader.color(index), alpha);
              const Index3 to = corner + Index3(morton_place(bit)) - box.lo;
              std::memcpy(out.row(to.y, to.z) + to.x * 4, voxel.bytes.data(), 4);
            }
            return true;
          }));
  if (!complete) store_->report(*container_, "chunk NODE: a node or a word is missing, or without voxels");
  return store_->status();
}

std::optional<Voxel> Volume::uniform(const Box& box) const {
  if (params_.leaf_voxels == 0) return Voxel{};
  if (box.empty()) return std::nullopt;
  if (const auto octree = store_->octree(*container_, params_); octree && *octree != nullptr)
    return (*octree)->is_void(box) ? std::optional(Voxel{}) : std::nullopt;
  const auto view = store_->dag(*container_, params_);
  if (!view) return std::nullopt;
  // Along the sides of a large box there may be many nodes: then it is not known.
  VoidSearch is_void(**view, 4096);
  const auto corner = [](Index3 at, uint32_t(&out)[3]) {
    for (int a = 0; a < 3; ++a) out[a] = static_cast<uint32_t>(at[a]);
  };
  uint32_t lo[3], hi[3];
  corner(box.lo, lo);
  corner(box.hi, hi);
  return is_void(lo, hi) ? std::optional(Voxel{}) : std::nullopt;
}

Status Volume::for_each_voxel(const SurfaceSource::Sink& sink, Context& ctx) const {
  if (params_.leaf_voxels == 0) return {};
  VOX_TRY(OctreeReader* const octree, store_->octree(*container_, params_));
  if (octree != nullptr) VOX_CHECK(octree->decode_all(ctx));
  return for_each_voxel(info_.box(), sink);
}

Status Volume::for_each_voxel(const Box& box, const SurfaceSource::Sink& sink) const {
  if (!info_.box().contains(box))
    return fail(ErrorCode::internal, container_->name(), "box outside the volume");
  if (params_.leaf_voxels == 0 || box.empty()) return {};
  const bool whole = box == info_.box();
  ColorReader reader(*store_, *container_, params_);
  AttributesReader attributes(*store_, *container_, params_);
  constexpr uint64_t run_voxels = 1 << 16;
  std::vector<SurfaceVoxel> run;
  run.reserve(run_voxels + 64);
  std::vector<std::byte> values;
  uint64_t found = 0, flushed = 0;
  Status status;
  const auto flush = [&] {
    flushed = found;
    status = check_interrupt();
    if (status) status = store_->status();
    if (status && !run.empty()) status = sink({run, values});
    run.clear();
    values.clear();
    return status.has_value();
  };
  const auto complete =
      walk_box(*this, box, [&](uint64_t leaf, Index3 corner, uint64_t color, OrderState state) {
        const uint64_t first = morton_code(static_cast<uint32_t>(corner.x), static_cast<uint32_t>(corner.y),
                                           static_cast<uint32_t>(corner.z));
        // A word without voxels is of no surface, and there may be any number of them.
        // Counts that do not add up would give voxels the colors of others. (Along a Hilbert curve they come
        // in another order, and of a part there are others in between.)
        if (whole && params_.colors == Colors::leaf && params_.curve == Curve::morton && color != found) {
          store_->report(*container_, "chunk NODE: counts of colors that do not add up");
          return false;
        }
        found += static_cast<uint64_t>(std::popcount(leaf));
        if (leaf == 0 || found > params_.leaf_voxels) return false;
        for (uint64_t left = leaf & leaf_within(corner, box); left != 0; left &= left - 1) {
          const auto bit = static_cast<uint32_t>(std::countr_zero(left));
          const uint64_t index = color + leaf_index(leaf, bit, params_.colors, state);
          run.push_back({first | bit, reader.color(index)});
          attributes.append(index, values);
        }
        return found - flushed < run_voxels || flush();
      });
  VOX_CHECK(complete);
  if (*complete) flush();
  if (status) status = store_->status();
  if (status && (!*complete || (whole && found != params_.leaf_voxels)))
    return bad_input(container_->name(),
                     fmt::format("chunk DAGP, byte 8: {} voxels: others are there", params_.leaf_voxels));
  return status;
}

namespace {

class ColorSource final : public VolumeSource {
 public:
  explicit ColorSource(std::shared_ptr<const Volume> volume) : volume_(std::move(volume)) {
    info_ = volume_->info();
  }
  Status read(const Box& box, VoxelSpan out) override { return volume_->decode(box, out); }
  std::optional<Voxel> uniform(const Box& box) const override { return volume_->uniform(box); }

 private:
  std::shared_ptr<const Volume> volume_;
};

}  // namespace

std::unique_ptr<VolumeSource> open_source(std::shared_ptr<const Volume> volume) {
  return std::make_unique<ColorSource>(std::move(volume));
}

}  // namespace voxkit::color
