// Compressed surfaces in memory, and what is read from them.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <vector>

#include "libcolor/color.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {

struct Reading {
  MemoryBudget memory;
  Context ctx;
  Reading() { ctx.memory = &memory; }
};

inline std::shared_ptr<const Volume> opened(std::vector<std::byte> bytes) {
  const auto kept = std::make_shared<const std::vector<std::byte>>(std::move(bytes));
  const auto container = Container::open(*kept, "file", kept);
  if (!container) return nullptr;
  const auto volume = Volume::open(*container);
  return volume ? *volume : nullptr;
}
inline std::shared_ptr<const Volume> volume_of(const Voxels& voxels, Index3 dims, const Options& options) {
  ListSource source(voxels, dims);
  return opened(compressed(source, options));
}

/// All voxels of a source, whose places must ascend and lie inside.
inline Voxels all_of(SurfaceSource& source) {
  Reading reading;
  Voxels voxels;
  const Index3 dims = source.info().dims;
  const Status status = source.read(reading.ctx, [&](std::span<const SurfaceVoxel> run) -> Status {
    for (const SurfaceVoxel& voxel : run) {
      EXPECT_TRUE(voxels.empty() || voxel.place > voxels.back().place);
      EXPECT_TRUE((Box{Index3(0), dims}).contains(Index3(morton_place(voxel.place))));
      voxels.push_back(voxel);
    }
    return {};
  });
  EXPECT_TRUE(status) << status.error().what;
  return voxels;
}

/// The same by their places as people write them.
using Places = std::map<std::array<int64_t, 3>, Rgb>;
inline Places places_of(const Voxels& voxels) {
  Places places;
  for (const SurfaceVoxel& voxel : voxels) {
    const Index3 at(morton_place(voxel.place));
    places[{at.x, at.y, at.z}] = voxel.color;
  }
  return places;
}

/// Those of a scene that are inside its extents.
inline Voxels inside(const Voxels& voxels, Index3 dims) {
  Voxels kept;
  for (const SurfaceVoxel& voxel : voxels)
    if (Box{Index3(0), dims}.contains(Index3(morton_place(voxel.place)))) kept.push_back(voxel);
  return kept;
}

}  // namespace voxkit::color
