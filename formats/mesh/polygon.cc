#include "formats/mesh/polygon.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace voxkit {
namespace {

using Triangles = std::vector<std::array<uint32_t, 3>>;

void fan(uint32_t count, Triangles& triangles) {
  for (uint32_t i = 2; i < count; ++i) triangles.push_back({0, i - 1, i});
}

}  // namespace

/// False where the polygon has no normal.
bool PolygonSplitter::project(std::span<const glm::dvec3> corners) {
  glm::dvec3 normal(0), from = corners.back() - corners[0];
  for (const glm::dvec3& corner : corners) {
    const glm::dvec3 to = corner - corners[0];
    normal.x += (from.y - to.y) * (from.z + to.z);
    normal.y += (from.z - to.z) * (from.x + to.x);
    normal.z += (from.x - to.x) * (from.y + to.y);
    from = to;
  }
  int axis = std::abs(normal.y) > std::abs(normal.x) ? 1 : 0;
  if (std::abs(normal.z) > std::abs(normal[axis])) axis = 2;
  if (!(std::abs(normal[axis]) > 0) || !std::isfinite(normal[axis])) return false;
  int u = (axis + 1) % 3, v = (axis + 2) % 3;
  if (normal[axis] < 0) std::swap(u, v);
  at_.clear();
  for (const glm::dvec3& corner : corners)
    at_.push_back({corner[u] - corners[0][u], corner[v] - corners[0][v]});
  return true;
}

double PolygonSplitter::turn(uint32_t a, uint32_t b, uint32_t c) const {
  const glm::dvec2 u = at_[b] - at_[a], v = at_[c] - at_[b];
  return u.x * v.y - u.y * v.x;
}

/// Turns left everywhere, and once about.
bool PolygonSplitter::is_convex() const {
  const auto count = static_cast<uint32_t>(at_.size());
  int changes = 0;
  double before = 0;  // the last step along x that was one
  for (uint32_t pass = 0; pass < 2; ++pass)
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t next = i + 1 < count ? i + 1 : 0;
      const double step = at_[next].x - at_[i].x;
      if (pass == 0 && turn(i ? i - 1 : count - 1, i, next) < 0) return false;
      if (step == 0) continue;
      // The first pass finds the step that comes before the first.
      if (pass == 1 && before * step < 0) ++changes;
      before = step;
    }
  return changes <= 2;
}

void PolygonSplitter::fill_grid() {
  const auto count = static_cast<uint32_t>(at_.size());
  glm::dvec2 hi = at_[0];
  lo_ = at_[0];
  for (const glm::dvec2& p : at_)
    for (int a = 0; a < 2; ++a) {
      lo_[a] = std::min(lo_[a], p[a]);
      hi[a] = std::max(hi[a], p[a]);
    }
  side_ = std::clamp(static_cast<int>(std::sqrt(static_cast<double>(count))), 1, 2048);
  for (int a = 0; a < 2; ++a) scale_[a] = hi[a] > lo_[a] ? side_ / (hi[a] - lo_[a]) : 0;
  const auto cell_of = [&](const glm::dvec2& p) {
    return static_cast<size_t>(cell_along(1, p.y)) * static_cast<size_t>(side_) +
           static_cast<size_t>(cell_along(0, p.x));
  };
  cell_begin_.assign(static_cast<size_t>(side_) * static_cast<size_t>(side_) + 1, 0);
  for (uint32_t i = 0; i < count; ++i)
    if (reflex_[i]) ++cell_begin_[cell_of(at_[i]) + 1];
  for (size_t i = 1; i < cell_begin_.size(); ++i) cell_begin_[i] += cell_begin_[i - 1];
  listed_.assign(cell_begin_.back(), 0);
  std::vector<uint32_t> next(cell_begin_.begin(), cell_begin_.end() - 1);
  for (uint32_t i = 0; i < count; ++i)
    if (reflex_[i]) listed_[next[cell_of(at_[i])]++] = i;
}

int PolygonSplitter::cell_along(int axis, double v) const {
  return std::clamp(static_cast<int>((v - lo_[axis]) * scale_[axis]), 0, side_ - 1);
}

/// Whether no corner lies in the triangle at a convex one.
bool PolygonSplitter::is_ear(uint32_t b) {
  const uint32_t a = before_[b], c = after_[b];
  if (!(turn(a, b, c) > 0)) return false;
  const std::array<glm::dvec2, 3> p{at_[a], at_[b], at_[c]};
  const double lowest = std::min({p[0].y, p[1].y, p[2].y}), highest = std::max({p[0].y, p[1].y, p[2].y});
  const int last_row = cell_along(1, highest);
  for (int row = cell_along(1, lowest); row <= last_row; ++row) {
    // What the triangle spans in a row, which is taken a little wider than it is.
    const double height = scale_.y > 0 ? 1 / scale_.y : 0;
    const double bottom = lo_.y + (row - 0.01) * height, top = lo_.y + (row + 1.01) * height;
    double left = INFINITY, right = -INFINITY;
    const auto add = [&](double x) { left = std::min(left, x), right = std::max(right, x); };
    for (size_t e = 0; e < 3; ++e) {
      const glm::dvec2 &from = p[e], &to = p[(e + 1) % 3];
      if (from.y >= bottom && from.y <= top) add(from.x);
      for (const double y : {bottom, top})
        if ((from.y < y) != (to.y < y)) add(from.x + (to.x - from.x) * ((y - from.y) / (to.y - from.y)));
    }
    if (left > right) continue;
    const int first = std::max(cell_along(0, left) - 1, 0),
              last = std::min(cell_along(0, right) + 1, side_ - 1);
    const auto cell = static_cast<size_t>(row) * static_cast<size_t>(side_);
    const uint32_t begin = cell_begin_[cell + static_cast<size_t>(first)],
                   end = cell_begin_[cell + static_cast<size_t>(last) + 1];
    steps_ -= 1 + end - begin;
    for (uint32_t k = begin; k < end; ++k) {
      const uint32_t i = listed_[k];
      if (!reflex_[i] || i == a || i == c) continue;
      const glm::dvec2& q = at_[i];
      if (q == p[0] || q == p[1] || q == p[2]) continue;  // as where a hole is tied to the border
      bool inside = true;
      for (size_t e = 0; e < 3; ++e) {
        const glm::dvec2 side = p[(e + 1) % 3] - p[e], to = q - p[e];
        inside &= side.x * to.y - side.y * to.x >= 0;
      }
      if (inside) return false;
    }
  }
  return true;
}

bool PolygonSplitter::clip(Triangles& triangles) {
  const auto count = static_cast<uint32_t>(at_.size());
  before_.resize(count);
  after_.resize(count);
  reflex_.assign(count, 0);
  for (uint32_t i = 0; i < count; ++i) {
    before_[i] = i ? i - 1 : count - 1;
    after_[i] = i + 1 < count ? i + 1 : 0;
  }
  for (uint32_t i = 0; i < count; ++i) reflex_[i] = turn(before_[i], i, after_[i]) <= 0;
  fill_grid();
  uint32_t left = count, at = 0, tried = 0;
  auto hollow = static_cast<uint32_t>(std::count(reflex_.begin(), reflex_.end(), 1));
  const auto remove = [&](uint32_t i) {
    after_[before_[i]] = after_[i];
    before_[after_[i]] = before_[i];
    hollow -= std::exchange(reflex_[i], 0);
    for (const uint32_t j : {before_[i], after_[i]})
      if (reflex_[j] && turn(before_[j], j, after_[j]) > 0) {
        reflex_[j] = 0;
        --hollow;
      }
    --left;
    tried = 0;
  };
  while (left > 3 && hollow > 0) {
    if (steps_ < 0) return false;
    const uint32_t next = after_[at];
    const bool straight = turn(before_[at], at, next) == 0;
    // Where edges cross there may be no ear: then the next corner goes that is convex, or any.
    if (straight || is_ear(at) || (tried > left && !reflex_[at]) || tried > 2 * left) {
      if (!straight) triangles.push_back({before_[at], at, next});
      remove(at);
      at = straight ? next : after_[next];  // the one after: fewer needles
    } else {
      at = next;
      ++tried;
      --steps_;
    }
  }
  // What is left is convex.
  for (uint32_t i = after_[at]; left > 2; --left, i = after_[i]) triangles.push_back({at, i, after_[i]});
  return true;
}

bool PolygonSplitter::split(std::span<const glm::dvec3> corners, Triangles& triangles) {
  const auto count = static_cast<uint32_t>(corners.size());
  steps_ = std::min<int64_t>(steps_ + 256 * int64_t{count}, int64_t{1} << 40);
  if (count < 4 || !project(corners) || is_convex()) {
    fan(count, triangles);
    return true;
  }
  return clip(triangles);
}

}  // namespace voxkit
