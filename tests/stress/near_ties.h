// A search for rays on which doubles are just about not, or just about, enough to tell planes apart.
#pragma once

#include "tests/stress/ray_families.h"

namespace voxkit::stress {

/// What GridRay decides by: the times of two planes, or the position at the time of a plane.
enum class Closeness { times, positions };

/// Makes `ray` (its dims are set) cross two or three planes, ray.target, at times that differ by about
/// the margin at which GridRay changes from doubles to exact numbers: up to four times as much, half of
/// them within an eighth of it, some equal or next to.
void near_tie(Random& random, Closeness closeness, TestRay& ray);

/// The same, and climbs from there, changing directions by ulps and origins by units, to where doubles are
/// off by as much as it can find, relative to that margin. `worst` keeps the record.
void worst_tie(Random& random, Closeness closeness, TestRay& ray);

}  // namespace voxkit::stress
