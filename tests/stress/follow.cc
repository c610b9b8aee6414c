#include "tests/stress/follow.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>

#include "tests/stress/algorithm1.h"
#include "tests/stress/counted_ray.h"

namespace voxkit::stress {

void Errors::add(const Errors& other) {
  wrong += other.wrong;
  apart += other.apart;
  missed += other.missed;
  repeated += other.repeated;
  time = std::max(time, other.time);
  voxels += other.voxels;
  exact += other.exact;
}
void Switch::add(const Switch& other) {
  exactly = std::max(exactly, other.exactly);
  in_doubles = std::min(in_doubles, other.in_doubles);
}
void Counts::add(const Counts& other) {
  rays += other.rays;
  hits += other.hits;
  checked += other.checked;
  single.add(other.single);
  cells.add(other.cells);
  boxes.add(other.boxes);
  algorithm1.add(other.algorithm1);
  times.add(other.times);
  positions.add(other.positions);
  worst.time = std::max(worst.time, other.worst.time);
  worst.position = std::max(worst.position, other.worst.position);
  if (first_error.empty()) first_error = other.first_error;
}

namespace {

using render::GridRay;
using Planes = int64_t[3];

struct Start {
  explicit Start(const TestRay& ray) {
    for (int a = 0; a < 3; ++a) {
      origin[a] = static_cast<double>(ray.origin[a]) * 0x1p-20;
      direction[a] = ray.direction[a];
    }
  }
  double origin[3], direction[3];
};

double relative_error(double t, long double exact) {
  if (exact == 0) return t == 0 ? 0 : 1 / 0.0;
  return static_cast<double>(std::fabs((static_cast<long double>(t) - exact) / exact));
}

GridRay make(const TestRay& ray, const Start& start) {
  const render::RayOrigin origin(start.origin, ray.dims);
  return GridRay(origin, start.direction);
}

/// GridRay beside the exact path, whichever way that is found.
class OurRay {
 public:
  OurRay(const TestRay& ray, const Start& start, const Frame& frame, const char* way, Errors& errors,
         Counts& counts)
      : ray_(ray), f_(frame), way_(way), errors_(errors), counts_(counts), grid_(make(ray, start)) {}

  bool enter(bool exact_inside, const Place& exact) {
    return check([&] { return grid_.enter(); }, exact_inside, exact);
  }
  bool leave(int log2_edge, bool exact_inside, const Place& exact) {
    return check([&] { return grid_.leave(log2_edge); }, exact_inside, exact);
  }
  bool leave(const uint32_t (&lo)[3], const uint32_t (&hi)[3], bool exact_inside, const Place& exact) {
    return check([&] { return grid_.leave(lo, hi); }, exact_inside, exact);
  }
  /// Whether the last move was decided exactly.
  bool was_exact() const { return was_exact_; }

 private:
  /// Makes a move; false at the end of the ray, or if it is wrong.
  template <class Move>
  bool check(const Move& move, bool exact_inside, const Place& exact) {
    const int64_t before = render::exact_decisions;
    const bool inside = move();
    was_exact_ = render::exact_decisions != before;
    errors_.exact += was_exact_;
    bool same = true;
    int64_t sum = 0;
    for (int a = 0; a < 3 && inside; ++a) {
      const int64_t v = f_.unmirrored(a, grid_.voxel(a));
      same &= v == exact.v[a];
      sum += v;
    }
    if (inside) {
      ++errors_.voxels;
      errors_.repeated += sum <= sum_;
      sum_ = sum;
    }
    errors_.wrong += inside && !(exact_inside && same);
    errors_.missed += exact_inside && !(inside && same);
    if (inside != exact_inside || (inside && !same)) return report(inside, exact_inside, exact);
    if (inside) errors_.time = std::max(errors_.time, relative_error(grid_.t(), exact.time(f_)));
    return inside;
  }
  bool report(bool inside, bool exact_inside, const Place& exact) {
    if (!counts_.first_error.empty()) return false;
    char text[512];
    std::snprintf(text, sizeof text,
                  "%s: dims %lld %lld %lld, origin %a %a %a, direction %a %a %a: %s voxel %u %u %u, exactly "
                  "%s %lld %lld %lld",
                  way_, static_cast<long long>(ray_.dims[0]), static_cast<long long>(ray_.dims[1]),
                  static_cast<long long>(ray_.dims[2]), static_cast<double>(ray_.origin[0]) * 0x1p-20,
                  static_cast<double>(ray_.origin[1]) * 0x1p-20,
                  static_cast<double>(ray_.origin[2]) * 0x1p-20, ray_.direction[0], ray_.direction[1],
                  ray_.direction[2], inside ? "in" : "out of the grid,", grid_.voxel(0), grid_.voxel(1),
                  grid_.voxel(2), exact_inside ? "in" : "out of the grid,",
                  static_cast<long long>(f_.unmirrored(0, exact.v[0])),
                  static_cast<long long>(f_.unmirrored(1, exact.v[1])),
                  static_cast<long long>(f_.unmirrored(2, exact.v[2])));
    counts_.first_error = text;
    return false;
  }

  const TestRay& ray_;
  const Frame& f_;
  const char* way_;
  Errors& errors_;
  Counts& counts_;
  GridRay grid_;
  int64_t sum_ = -1;
  bool was_exact_ = false;
};

/// Algorithm 1 beside the exact path. Both go one voxel along one axis at a time, so that the sum of the
/// (mirrored) coordinates says which of their voxels to compare.
class Algorithm1Ray {
 public:
  Algorithm1Ray(const TestRay& ray, const Start& start, const Frame& frame, Errors& errors)
      : f_(frame), errors_(errors) {
    inside_ = algorithm_.enter(start.origin, start.direction, ray.dims);
    visit();
  }
  /// The next voxel of the exact path.
  void exact(const Place& at) {
    const int64_t sum = at.v[0] + at.v[1] + at.v[2];
    while (inside_ && sum_ < sum) not_on_path();
    if (!inside_ || sum_ > sum) {
      ++errors_.missed;
    } else if (v_[0] == at.v[0] && v_[1] == at.v[1] && v_[2] == at.v[2]) {
      if (at.axis >= 0)
        errors_.time =
            std::max(errors_.time, relative_error(static_cast<double>(algorithm_.t()), at.time(f_)));
      step();
    } else {
      ++errors_.missed;
      not_on_path();
    }
  }
  /// The exact path has ended; it may go on, up to `most` voxels.
  void finish(int64_t most) {
    while (inside_ && most-- > 0) not_on_path();
  }

 private:
  void not_on_path() {
    ++errors_.wrong;
    errors_.apart += !touches(f_, v_);
    step();
  }
  void step() {
    inside_ = algorithm_.step();
    visit();
  }
  void visit() {
    if (!inside_) return;
    int64_t sum = 0;
    for (int a = 0; a < 3; ++a) sum += v_[a] = f_.unmirrored(a, algorithm_.voxel(a));
    ++errors_.voxels;
    errors_.repeated += sum <= sum_;
    sum_ = sum;
  }

  const Frame& f_;
  Errors& errors_;
  Algorithm1 algorithm_;
  int64_t v_[3], sum_ = -1;
  bool inside_;
};

/// How close GridRay's decisions are, in its own doubles.
class Doubles {
 public:
  explicit Doubles(const TestRay& ray, const Start& start) {
    const render::RayOrigin from(start.origin, ray.dims);
    double end = 1 / 0.0;
    for (int a = 0; a < 3; ++a) {
      const int m = start.direction[a] < 0;
      near_[a] = from.near[m][a];
      origin_[a] = from.at[m][a];
      direction_[a] = std::fabs(start.direction[a]);
      inverse_[a] = 1 / direction_[a];
      end = std::fmin(end, from.to_far[m][a] * inverse_[a]);
    }
    margin_ = end * 0x1p-48;
    clearance_ = 0.5 - from.clear;
  }
  /// Between the first two of three planes, in margins.
  double apart(const Planes& plane) const {
    double t[3];
    for (int a = 0; a < 3; ++a) t[a] = time(a, plane);
    std::sort(t, t + 3);
    return (t[1] - t[0]) / margin_;
  }
  /// From the next plane of another axis, when the first of three planes is crossed.
  double off_planes(const Planes& plane) const {
    int axis = 0;
    for (int a = 1; a < 3; ++a)
      if (time(a, plane) < time(axis, plane)) axis = a;
    double least = 1;
    for (int a = 0; a < 3; ++a) {
      const double x = origin_[a] + direction_[a] * time(axis, plane);
      if (a != axis) least = std::fmin(least, std::fabs(x - std::nearbyint(x)));
    }
    return least / clearance_;
  }

 private:
  double time(int a, const Planes& plane) const {
    return (static_cast<double>(plane[a] + near_[a]) - origin_[a]) * inverse_[a];
  }
  double origin_[3], direction_[3], inverse_[3], margin_, clearance_;
  int64_t near_[3];
};
void note(double margins, bool exact, Switch& at) {
  if (exact)
    at.exactly = std::max(at.exactly, margins);
  else
    at.in_doubles = std::min(at.in_doubles, margins);
}

/// A box around a voxel (mirrored): any, or, if there is a target, at times up to that.
void make_box(const TestRay& ray, const Frame& f, const Place& at, Random& random, Planes& lo, Planes& hi) {
  for (int a = 0; a < 3; ++a) {
    const int64_t target = f.mirrored[a] ? f.dims[a] - ray.target[a] : ray.target[a];
    const bool aim = ray.has_target && target > at.v[a] && random.chance(2);
    hi[a] = aim ? target : at.v[a] + 1 + random.spread(0, f.dims[a] - at.v[a] - 1);
    lo[a] = random.number(0, at.v[a]);
  }
}
/// An aligned cube around a voxel: its edge, and where it ends (mirrored).
int make_cell(const TestRay& ray, const Frame& f, const Place& at, Random& random, Planes& hi) {
  const auto largest = static_cast<uint64_t>(std::max({f.dims[0], f.dims[1], f.dims[2]}));
  int log2_edge = static_cast<int>(random.number(0, 64 - std::countl_zero(largest - 1)));
  const int64_t target = ray.target[random.number(0, 2)];
  if (ray.has_target && target > 0 && random.chance(2))
    log2_edge = static_cast<int>(random.number(0, std::countr_zero(static_cast<uint64_t>(target))));
  for (int a = 0; a < 3; ++a) {
    const int64_t lo = f.unmirrored(a, at.v[a]) >> log2_edge << log2_edge,
                  end = std::min(lo + (int64_t{1} << log2_edge), f.dims[a]);
    hi[a] = f.mirrored[a] ? f.dims[a] - lo : end;
  }
  return log2_edge;
}
void unmirror(const Frame& f, const Planes& lo, const Planes& hi, uint32_t (&low)[3], uint32_t (&high)[3]) {
  for (int a = 0; a < 3; ++a) {
    low[a] = static_cast<uint32_t>(f.mirrored[a] ? f.dims[a] - hi[a] : lo[a]);
    high[a] = static_cast<uint32_t>(f.mirrored[a] ? f.dims[a] - lo[a] : hi[a]);
  }
}

void follow_single(const TestRay& ray, const Start& start, const Frame& f, int64_t most, Counts& counts) {
  Place at;
  bool exact_inside = Jump::enter(f, at);
  ++counts.rays;
  counts.hits += exact_inside;
  OurRay ours(ray, start, f, "single steps", counts.single, counts);
  bool inside = ours.enter(exact_inside, at);
  // In large grids, what is before a target is skipped, and Algorithm 1 left out.
  const bool skip = ray.has_target && std::max({f.dims[0], f.dims[1], f.dims[2]}) > 1000;
  if (skip && inside) {
    Planes lo, hi;
    for (int a = 0; a < 3; ++a) {
      const int64_t target = f.mirrored[a] ? f.dims[a] - ray.target[a] : ray.target[a];
      lo[a] = at.v[a];
      hi[a] = target > at.v[a] + 2 ? target - 2 : f.dims[a];
    }
    uint32_t low[3], high[3];
    unmirror(f, lo, hi, low, high);
    exact_inside = Jump::cross(f, hi, at);
    inside = ours.leave(low, high, exact_inside, at);
    most = 64;
  }
  std::optional<Algorithm1Ray> published;
  if (!skip) published.emplace(ray, start, f, counts.algorithm1);
  if (exact_inside) {
    const Doubles doubles(ray, start);
    Stepper stepper(f, at);
    if (published) published->exact(at);
    while (most-- > 0) {
      const Planes next = {stepper.at().v[0] + 1, stepper.at().v[1] + 1, stepper.at().v[2] + 1};
      exact_inside = stepper.step();
      if (inside) {
        inside = ours.leave(0, exact_inside, stepper.at());
        if (ray.has_target) note(doubles.apart(next), ours.was_exact(), counts.times);
      }
      if (!exact_inside) break;
      if (published) published->exact(stepper.at());
    }
  }
  if (published && !exact_inside) published->finish(most);
}

/// Steps over cells or boxes.
void follow_cells(const TestRay& ray, const Start& start, const Frame& f, bool cubes, Random& random,
                  Counts& counts) {
  Place at;
  bool exact_inside = Jump::enter(f, at);
  OurRay ours(ray, start, f, cubes ? "steps over cells" : "steps over boxes",
              cubes ? counts.cells : counts.boxes, counts);
  const Doubles doubles(ray, start);
  bool inside = ours.enter(exact_inside, at);
  for (int64_t most = 10000; inside && most > 0; --most) {
    Planes lo, hi;
    int log2_edge = 1;
    if (cubes) {
      log2_edge = make_cell(ray, f, at, random, hi);
      exact_inside = Jump::cross(f, hi, at);
      inside = ours.leave(log2_edge, exact_inside, at);
    } else {
      make_box(ray, f, at, random, lo, hi);
      uint32_t low[3], high[3];
      unmirror(f, lo, hi, low, high);
      exact_inside = Jump::cross(f, hi, at);
      inside = ours.leave(low, high, exact_inside, at);
    }
    if (ray.has_target && log2_edge > 0 && doubles.apart(hi) > 2)
      note(doubles.off_planes(hi), ours.was_exact(), counts.positions);
  }
}

}  // namespace

void follow(const TestRay& ray, int64_t most, Random& random, Counts& counts) {
  const Start start(ray);
  const Frame frame(ray);
  const int64_t before = counts.single.voxels;
  follow_single(ray, start, frame, most, counts);
  // As many steps over cells and boxes as an eighth of the single ones, each time other ones.
  const int64_t enough = (counts.single.voxels - before) / 8;
  for (const bool cubes : {true, false}) {
    const Errors& errors = cubes ? counts.cells : counts.boxes;
    const int64_t until = errors.voxels + enough;
    for (int repeat = 0; repeat < 32 && (repeat == 0 || errors.voxels < until); ++repeat)
      follow_cells(ray, start, frame, cubes, random, counts);
  }
}

int64_t check_reference(const TestRay& ray, int64_t most, Random& random, Counts& counts) {
  const Start start(ray);
  const Frame f(ray);
  PlainWalk plain(f);
  int64_t steps = 0;
  while (steps < most && !plain.gone() && !plain.at().inside(f)) plain.step(), ++steps;
  if (steps == most) return steps;
  const auto same = [&](const Place& at) {
    return at.v[0] == plain.at().v[0] && at.v[1] == plain.at().v[1] && at.v[2] == plain.at().v[2] &&
           at.axis == plain.at().axis;
  };
  Place entered;
  if (Jump::enter(f, entered) != plain.at().inside(f)) fail("the references disagree on a hit");
  if (!plain.at().inside(f)) return steps;
  if (!same(entered)) fail("the references disagree on the first voxel");
  Stepper stepper(f, entered);
  Place jumped = entered;
  Planes lo, hi{};
  for (bool inside = true; inside && steps < most; ++steps) {
    const bool left = jumped.v[0] >= hi[0] || jumped.v[1] >= hi[1] || jumped.v[2] >= hi[2];
    if (left) {
      if (!same(jumped)) fail("the references disagree on a jump");
      make_box(ray, f, plain.at(), random, lo, hi);
    }
    plain.step();
    inside = plain.at().inside(f);
    if (stepper.step() != inside || !same(stepper.at())) fail("the references disagree on a step");
    if (plain.at().v[0] >= hi[0] || plain.at().v[1] >= hi[1] || plain.at().v[2] >= hi[2])
      if (Jump::cross(f, hi, jumped) != inside || !same(jumped)) fail("the references disagree on a jump");
    ++counts.checked;
  }
  return steps;
}

}  // namespace voxkit::stress
