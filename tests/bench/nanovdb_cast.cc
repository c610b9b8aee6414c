// Compiled twice, into two libraries, so that the templates of one build do not stand in for those of the
// other. VOXKIT_BENCH_CAST is the name of the function.
#include "tests/bench/nanovdb_cast.h"

#include <nanovdb/NanoVDB.h>
#include <nanovdb/util/HDDA.h>
#include <nanovdb/util/Ray.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "formats/clock.h"
#include "formats/parallel.h"

namespace voxkit::bench {
namespace {

using Grid = nanovdb::NanoGrid<nanovdb::Rgba8>;

constexpr int tile = 32;  // as in librender

/// nanovdb::firstActive with a shorter look ahead, and inside leaves with the voxels that the HDDA counts,
/// which need none.
template <class Ray, class Accessor>
bool first_hit(Ray& ray, const Accessor& accessor, nanovdb::Coord& ijk, float& t) {
  using Real = typename Ray::RealType;
  // Below what floats resolve at a few thousand voxels, or the HDDA's own push forward, rays would pass over
  // nodes.
  constexpr Real ahead = Real(1e-3);
  constexpr int inside_leaf = 7;
  if (!ray.clip(accessor.root().bbox())) return false;
  ijk = nanovdb::RoundDown<nanovdb::Coord>(ray(ray.t0() + ahead));
  nanovdb::HDDA<Ray> hdda(ray, static_cast<int>(accessor.getDim(ijk, ray)));
  for (;;) {
    if (hdda.dim() > 1) {
      if (accessor.isActive(ijk)) break;  // a tile
      if (!hdda.step()) return false;
    } else {
      const auto* leaf = accessor.template getNode<0>();
      const Real soon = hdda.time() + 2 * ahead;
      // The HDDA may begin in the voxel before the leaf, and the ray may miss a leaf that the look ahead saw.
      for (bool entered = false;;) {
        const nanovdb::Coord& v = hdda.voxel();
        if ((((v[0] ^ ijk[0]) | (v[1] ^ ijk[1]) | (v[2] ^ ijk[2])) & ~inside_leaf) == 0) {
          entered = true;
          if (leaf->isActive(v)) {
            ijk = v;
            t = static_cast<float>(hdda.time());
            return true;
          }
        } else if (entered || hdda.time() > soon) {
          break;
        }
        if (!hdda.step()) return false;
      }
    }
    ijk = nanovdb::RoundDown<nanovdb::Coord>(ray(hdda.time() + ahead));
    hdda.update(ray, static_cast<int>(accessor.getDim(ijk, ray)));
  }
  t = static_cast<float>(hdda.time());
  return true;
}

template <class Real>
Result<double> cast_with(const NanovdbGrid& volume, const Cast& cast, std::vector<Hit>& hits, Context& ctx) {
  using Ray = nanovdb::Ray<Real>;
  const Grid& grid = *static_cast<const Grid*>(volume.data());
  const render::GridTransform transform(volume.info());
  const render::RayGenerator rays(cast.camera, cast.width, cast.height);
  const glm::dvec3 eye = transform.point(rays.eye());
  const typename Ray::Vec3T origin(static_cast<Real>(eye.x), static_cast<Real>(eye.y),
                                   static_cast<Real>(eye.z));
  const bool cubes = transform.voxel.x == transform.voxel.y && transform.voxel.x == transform.voxel.z;
  hits.resize(static_cast<size_t>(cast.width) * static_cast<size_t>(cast.height));
  const int64_t across = (cast.width + tile - 1) / tile, down = (cast.height + tile - 1) / tile;
  const auto start = Clock::now();
  VOX_CHECK(parallel_for(ctx, across * down, [&](int64_t i) -> Status {
    auto accessor = grid.getAccessor();
    const int x0 = static_cast<int>(i % across) * tile, y0 = static_cast<int>(i / across) * tile;
    for (int y = y0; y < std::min(y0 + tile, cast.height); ++y)
      for (int x = x0; x < std::min(x0 + tile, cast.width); ++x) {
        // A unit vector in voxels, as NanoVDB's steps are meant; `scale` is how long it is in the world.
        glm::dvec3 d = rays.direction(x + 0.5, y + 0.5);
        double scale = transform.voxel.x;
        if (!cubes) {
          d = transform.direction(d);
          scale = 1 / glm::length(d);
          d *= scale;
        }
        Ray ray(origin, {static_cast<Real>(d.x), static_cast<Real>(d.y), static_cast<Real>(d.z)});
        Hit hit;
        nanovdb::Coord ijk;
        float t = 0;
        if (cast.march == March::first_active ? nanovdb::firstActive(ray, accessor, ijk, t)
                                              : first_hit(ray, accessor, ijk, t)) {
          const nanovdb::Rgba8 value = accessor.getValue(ijk);
          for (int k = 0; k < 4; ++k) hit.color[k] = static_cast<float>(value[k]) / 255;
          hit.distance = t * static_cast<float>(scale);
          for (int a = 0; a < 3; ++a) hit.voxel[a] = ijk[a];
        }
        hits[static_cast<size_t>(y) * static_cast<size_t>(cast.width) + static_cast<size_t>(x)] = hit;
      }
    return {};
  }));
  return seconds_since(start);
}

}  // namespace

Result<double> VOXKIT_BENCH_CAST(const NanovdbGrid& grid, const Cast& cast, std::vector<Hit>& hits,
                                 Context& ctx) {
  return cast.doubles ? cast_with<double>(grid, cast, hits, ctx) : cast_with<float>(grid, cast, hits, ctx);
}

}  // namespace voxkit::bench
