// One ray, followed by GridRay and by Algorithm 1 beside the exact path.
#pragma once

#include <cstdint>
#include <string>

#include "tests/stress/exact_path.h"
#include "tests/stress/ray_families.h"

namespace voxkit::stress {

/// How a traversal differs from the exact path.
struct Errors {
  int64_t wrong = 0;     ///< visited, but not on the exact path
  int64_t apart = 0;     ///< of these, which the ray does not even touch
  int64_t missed = 0;    ///< on the exact path, but not visited
  int64_t repeated = 0;  ///< visited when it, or a later one, has been
  double time = 0;       ///< greatest relative error of t
  int64_t voxels = 0;    ///< visited
  int64_t exact = 0;     ///< exact decisions
  void add(const Errors& other);
  bool any() const { return wrong + missed + repeated > 0; }
};

/// By how many margins times, or positions, were apart when GridRay decided: at most, where it did so
/// exactly; at least, where it did so in doubles.
struct Switch {
  double exactly = 0, in_doubles = 1 / 0.0;
  void add(const Switch& other);
};

struct Counts {
  int64_t rays = 0, hits = 0;
  int64_t checked = 0;          ///< voxels at which the references agreed
  Errors single, cells, boxes;  ///< GridRay: voxel by voxel, over aligned cubes, over boxes
  Errors algorithm1;
  Switch times, positions;  ///< of the families of near ties
  Worst worst;
  std::string first_error;  ///< the ray and the place, in hexadecimal; empty: none
  void add(const Counts& other);
  int64_t steps() const { return single.voxels + cells.voxels + boxes.voxels; }
};

/// Follows a ray, single steps up to `most` of them.
void follow(const TestRay& ray, int64_t most, Random& random, Counts& counts);

/// Holds the fast references against the plain one, up to `most` steps of it. Returns the steps made.
int64_t check_reference(const TestRay& ray, int64_t most, Random& random, Counts& counts);

}  // namespace voxkit::stress
