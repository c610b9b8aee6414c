// A coloured surface, compressed and opened again.
#include <vector>

#include "formats/volume/builtin.h"
#include "libcolor/color.h"
#include "libcolor/surface/volume_surface.h"

namespace consumer {

/// Voxels of the Menger sponge of 27 voxels a side, as its compressed form counts them.
voxkit::Result<unsigned long long> surface_voxels(voxkit::Context& ctx) {
  VOX_TRY(const auto surface, voxkit::color::surface_of(voxkit::menger_source(3)));
  std::vector<std::byte> bytes;
  const auto append = [&bytes](std::span<const std::byte> more) -> voxkit::Status {
    bytes.insert(bytes.end(), more.begin(), more.end());
    return {};
  };
  VOX_TRY(const auto report, voxkit::color::encode(*surface, {}, append, ctx));
  VOX_TRY(const auto container, voxkit::Container::open(bytes, "sponge", nullptr));
  VOX_TRY(const auto volume, voxkit::color::Volume::open(container));
  VOX_CHECK(volume->check(ctx));
  return volume->params().leaf_voxels;
}

}  // namespace consumer
