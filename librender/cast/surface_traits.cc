#include "librender/cast/surface_traits.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <optional>

#include "formats/clock.h"
#include "libcolor/attribute_reader.h"
#include "libcolor/store.h"
#include "libcolor/surface/morton.h"
#include "libcolor/surface/octahedral.h"
#include "librender/cast/beam.h"
#include "librender/cast/pixel_rows.h"

namespace voxkit::render {
namespace {

using color::Attribute;

float share(uint32_t value, int byte) {
  return static_cast<float>(value >> 8 * byte & 255u) * (1.0f / 255);
}

/// Of the cell with a voxel, of those that a pixel sees; 0 of none: then it is a voxel.
int height_at(const Glimpse* glimpse, const int32_t (&voxel)[3]) {
  for (int n = 0; n < Beam::most_cells && glimpse->ninths > 0; ++n, ++glimpse) {
    bool same = true;
    for (int a = 0; a < 3; ++a) same &= (glimpse->voxel[a] ^ voxel[a]) >> glimpse->log2_edge == 0;
    if (same) return glimpse->log2_edge;
  }
  return 0;
}

}  // namespace

color::AttributeSet traits_of(const color::Volume& volume, color::AttributeSet wanted) {
  for (size_t i = 0; i < color::attribute_kinds.size(); ++i)
    if (const auto attribute = static_cast<Attribute>(i); !volume.params().attributes.has(attribute))
      wanted.remove(attribute);
  return wanted;
}

Status look_up_traits(const color::Volume& volume, color::AttributeSet wanted, const Glimpse* glimpses,
                      Frame& frame, Context& ctx) {
  VOX_CHECK(frame.begin_traits(traits_of(volume, wanted), ctx));
  if (frame.has.empty()) return {};
  const auto start = Clock::now();
  VOX_TRY(const color::DagView* const dag, volume.store().dag(volume.container(), volume.params()));
  const GridTransform grid(volume.info());
  const glm::dmat3 to_world = glm::transpose(grid.along);
  struct Worker {
    std::array<std::optional<color::AttributeReader>, color::attribute_kinds.size()> readers;
    color::CellFinder finder;
    std::optional<uint32_t> read(Attribute attribute, uint64_t index) {
      auto& reader = readers[static_cast<size_t>(attribute)];
      return reader ? std::optional(reader->value(index)) : std::nullopt;
    }
  };
  const auto make = [&] {
    Worker worker{{}, color::CellFinder(*dag)};
    for (size_t i = 0; i < worker.readers.size(); ++i)
      if (const auto attribute = static_cast<Attribute>(i); frame.has.has(attribute))
        worker.readers[i].emplace(volume.store(), volume.container(), volume.params(), attribute);
    return worker;
  };
  VOX_CHECK(for_each_pixel(frame, ctx, make, [&](Worker& worker, size_t i) {
    PixelTraits& traits = frame.traits[i];
    traits = {};
    const int32_t(&voxel)[3] = frame.details[i].voxel;
    if (voxel[0] < 0) return;
    const uint64_t place = color::morton_code(
        static_cast<uint32_t>(voxel[0]), static_cast<uint32_t>(voxel[1]), static_cast<uint32_t>(voxel[2]));
    const auto found =
        worker.finder.find(place, glimpses ? height_at(glimpses + i * Beam::most_cells, voxel) : 0);
    if (!found.there) return;
    const uint64_t index = found.color;
    if (const auto light = worker.read(Attribute::emissive, index))
      for (int k = 0; k < 3; ++k) traits.emissive[k] = share(*light, k);
    if (const auto opacity = worker.read(Attribute::opacity, index)) traits.opacity = share(*opacity, 0);
    if (const auto bytes = worker.read(Attribute::normal, index)) {
      const auto n = color::direction_of({static_cast<uint8_t>(*bytes), static_cast<uint8_t>(*bytes >> 8)});
      const glm::dvec3 world =
          glm::normalize(to_world * (glm::dvec3(static_cast<double>(n[0]), static_cast<double>(n[1]),
                                                static_cast<double>(n[2])) /
                                     grid.voxel));
      for (int k = 0; k < 3; ++k) traits.normal[k] = static_cast<float>(world[k]);
    }
    if (const auto rm = worker.read(Attribute::rm, index))
      for (int k = 0; k < 2; ++k) traits.rm[k] = share(*rm, k);
    if (const auto id = worker.read(Attribute::id, index)) traits.id = *id;
  }));
  const double seconds = seconds_since(start);
  frame.lookup_seconds += seconds;
  frame.seconds += seconds;
  return volume.store().status();
}

}  // namespace voxkit::render
