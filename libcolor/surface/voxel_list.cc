#include "libcolor/surface/voxel_list.h"

#include <fmt/format.h>

#include <algorithm>

#include "libcolor/surface/attribute_choice.h"
#include "libcolor/surface/linear_light.h"
#include "libcolor/surface/morton.h"

namespace voxkit::color {
namespace {

class VoxelList final : public SurfaceSource {
 public:
  /// `voxels` ascend strictly; `bytes`: their attributes.
  VoxelList(VolumeInfo info, std::vector<SurfaceVoxel> voxels, std::vector<std::byte> bytes,
            AttributeSet attributes, Reservation memory, std::vector<std::string> notes)
      : voxels_(std::move(voxels)), bytes_(std::move(bytes)), memory_(std::move(memory)) {
    attributes_ = attributes;
    emits_ = attributes.has(Attribute::emissive);
    info_ = std::move(info);
    notes_ = std::move(notes);
    info_.format = VoxelFormat::rgba32;
  }
  Status read(Context&, const Sink& sink) override {
    return voxels_.empty() ? Status() : sink({voxels_, bytes_});
  }

 private:
  std::vector<SurfaceVoxel> voxels_;
  std::vector<std::byte> bytes_;
  Reservation memory_;
};

/// Which of a scene's materials there are, and what is delivered of them.
Result<AttributeSet> choose(VoxelScene& scene, const std::optional<AttributeSet>& wanted, bool emission) {
  std::array<bool, 256> used{};
  for (const ModelVoxel& voxel : scene.voxels) used[voxel.number] = true;
  int clear = 0, shining = 0, special = 0;
  for (size_t i = 0; i < used.size(); ++i) {
    clear += used[i] && scene.materials[i].opacity < 1;
    shining += used[i] && scene.materials[i].emission > 0;
    special += used[i] && scene.materials[i].special;
  }
  AttributeSet can, by_itself;
  for (const Attribute a : {Attribute::opacity, Attribute::rm, Attribute::id}) can.add(a);
  add_if(can, Attribute::emissive, emission);
  add_if(by_itself, Attribute::emissive, emission && shining > 0);
  add_if(by_itself, Attribute::opacity, clear > 0);
  VOX_TRY(const AttributeSet attributes, choose_attributes(wanted, can, by_itself));
  const int dropped = special + (attributes.has(Attribute::opacity) ? 0 : clear) +
                      (attributes.has(Attribute::emissive) ? 0 : shining);
  if (dropped)
    scene.notes.push_back(fmt::format("dropped: materials of {} colors that are glass or shine", dropped));
  return attributes;
}

/// Appends the attributes of a voxel.
void append_attributes(const VoxelMaterial& material, const ModelVoxel& voxel, AttributeSet attributes,
                       std::vector<std::byte>& out) {
  const auto put = [&](uint32_t value) { out.push_back(static_cast<std::byte>(value)); };
  const auto share = [](float part) { return static_cast<uint32_t>(part * 255 + 0.5f); };
  if (attributes.has(Attribute::emissive)) {
    const LightTables& tables = light_tables();
    for (const uint8_t c : voxel.color)
      put(tables
              .stored[static_cast<size_t>(static_cast<float>(tables.linear[c]) * material.emission + 0.5f)]);
  }
  // What is there covers something.
  if (attributes.has(Attribute::opacity)) put(std::max(share(material.opacity), 1u));
  if (attributes.has(Attribute::rm)) put(share(material.roughness)), put(share(material.metalness));
  if (attributes.has(Attribute::id)) put(voxel.number), put(0), put(0), put(0);
}

}  // namespace

Result<std::unique_ptr<SurfaceSource>> surface_of(VoxelScene scene, Context& ctx,
                                                  const std::optional<AttributeSet>& wanted, bool emission) {
  if (scene.voxels.empty()) return bad_input({}, "no voxels");
  VOX_TRY(const AttributeSet attributes, choose(scene, wanted, emission));
  Index3 lo(INT32_MAX), hi(INT32_MIN);
  for (const ModelVoxel& voxel : scene.voxels)
    for (size_t a = 0; a < 3; ++a) {
      const auto axis = static_cast<Index3::length_type>(a);
      lo[axis] = std::min<int64_t>(lo[axis], voxel.place[a]);
      hi[axis] = std::max<int64_t>(hi[axis], voxel.place[a]);
    }
  VolumeInfo info;
  info.dims = hi - lo + Index3(1);
  for (size_t a = 0; a < 3; ++a)
    info.affine.origin[a] = static_cast<double>(lo[static_cast<Index3::length_type>(a)]) + 0.5;
  if (std::max({info.dims.x, info.dims.y, info.dims.z}) > int64_t{1} << most_levels ||
      !checked_voxels(info.dims))
    return bad_input(
        {}, fmt::format("a scene of {} x {} x {} voxels: expected at most {} a side, and 2^62 in all",
                        info.dims.x, info.dims.y, info.dims.z, 1 << most_levels));
  VOX_TRY(Reservation memory,
          Reservation::take(scene.voxels.size() * (2 * sizeof(SurfaceVoxel) + attributes.bytes()),
                            "the voxels of a scene, sorted", ctx));
  struct Placed {
    uint64_t place;
    uint64_t number;  ///< in the scene
  };
  std::vector<Placed> order;
  order.reserve(scene.voxels.size());
  for (const ModelVoxel& v : scene.voxels)
    order.push_back(
        {morton_code(static_cast<uint32_t>(v.place[0] - lo.x), static_cast<uint32_t>(v.place[1] - lo.y),
                     static_cast<uint32_t>(v.place[2] - lo.z)),
         order.size()});
  std::sort(order.begin(), order.end(), [](const Placed& a, const Placed& b) {
    return a.place != b.place ? a.place < b.place : a.number < b.number;
  });
  std::vector<SurfaceVoxel> voxels;
  voxels.reserve(order.size());
  std::vector<std::byte> bytes;
  bytes.reserve(order.size() * attributes.bytes());
  // Of several at one place the last one stays.
  for (size_t i = 0; i < order.size(); ++i) {
    if (i + 1 < order.size() && order[i + 1].place == order[i].place) continue;
    const ModelVoxel& v = scene.voxels[order[i].number];
    voxels.push_back({order[i].place, {v.color[0], v.color[1], v.color[2]}});
    append_attributes(scene.materials[v.number], v, attributes, bytes);
  }
  return std::make_unique<VoxelList>(std::move(info), std::move(voxels), std::move(bytes), attributes,
                                     std::move(memory), std::move(scene.notes));
}

}  // namespace voxkit::color
