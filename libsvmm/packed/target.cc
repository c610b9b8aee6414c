#include "libsvmm/packed/target.h"

#include <algorithm>
#include <cmath>

namespace voxkit::svmm {
namespace {

constexpr size_t most_tries = 4;
constexpr double psnr_tolerance = 0.2;   // dB
constexpr double bits_tolerance = 0.02;  // of the bits
/// Where a bound is far from any that is known.
constexpr double most_doublings = 3;

/// Bits are as many as the bound has doublings less where they are many, and fall by a factor with each where
/// they are few: this changes by about as much everywhere.
double evened(double bits) {
  return bits > 64 ? bits : std::log2(std::exp2(bits) - 1);
}

}  // namespace

BoundSearch::BoundSearch(const PackedTarget& target, bool whole, double least, double most)
    : target_(target),
      whole_(whole),
      least_(least),
      most_(std::max(most, least)),
      tolerance_(target.kind == PackedTarget::Kind::psnr
                     ? psnr_tolerance
                     : evened((1 + bits_tolerance) * target.value) - evened(target.value)),
      steepest_(target.kind == PackedTarget::Kind::psnr ? -20 * std::log10(2.0) : -1) {}

double BoundSearch::at(double bound) const {
  return std::log2(whole_ ? 2 * bound + 1 : bound);
}
double BoundSearch::excess_of(double measured) const {
  return target_.kind == PackedTarget::Kind::psnr ? measured - target_.value
                                                  : evened(measured) - evened(target_.value);
}
double BoundSearch::bound_at(double at) const {
  return whole_ ? (std::exp2(at) - 1) / 2 : std::exp2(at);
}

std::vector<BoundSearch::Try> BoundSearch::finite() const {
  std::vector<Try> found;
  for (const Try& t : tries_)
    if (std::isfinite(t.at) && std::isfinite(t.excess)) found.push_back(t);
  return found;
}

/// Samples are few: what they say of a slope is believed as far as it may be.
double BoundSearch::slope(const Try& a, const Try& b) const {
  return std::clamp((b.excess - a.excess) / (b.at - a.at), 2 * steepest_, steepest_ / 4);
}

double BoundSearch::excess_at(double at) const {
  const auto known = finite();
  if (known.size() == 1) return known[0].excess + (at - known[0].at) * steepest_;
  size_t i = 0;
  while (i + 2 < known.size() && known[i + 1].at < at) ++i;
  const double along = slope(known[i], known[i + 1]);
  const Try& from = std::abs(at - known[i].at) < std::abs(at - known[i + 1].at) ? known[i] : known[i + 1];
  return from.excess + (at - from.at) * along;
}

double BoundSearch::zero() const {
  const auto known = finite();
  if (known.size() == 1) return known[0].at - known[0].excess / steepest_;
  // Two whole volumes tell more than all samples; of what lies far from them, not much.
  auto tries = known;
  std::erase_if(tries, [](const Try& t) { return !t.whole; });
  const bool whole = tries.size() > 1;
  if (!whole) tries = known;
  size_t i = 0;
  while (i + 2 < tries.size() && tries[i + 1].excess > 0) ++i;
  const Try &a = tries[i], &b = tries[i + 1];
  if (a.excess > 0 && b.excess < 0) return a.at + (b.at - a.at) * a.excess / (a.excess - b.excess);
  const Try& from = std::abs(a.excess) < std::abs(b.excess) ? a : b;
  const double steps = -from.excess / slope(a, b), most = whole ? 1 : most_doublings;
  return from.at + std::clamp(steps, -most, most);
}

std::optional<double> BoundSearch::next(double guess) const {
  if (tries_.size() >= most_tries) return std::nullopt;
  // The bounds between which it lies.
  double above = whole_ ? -1 : 0, below = whole_ ? most_ + 1 : most_;
  for (const Try& t : tries_) {
    if (std::abs(t.excess) <= tolerance_ / 4) return std::nullopt;
    if (t.excess > 0) above = std::max(above, t.bound);
    if (t.excess < 0) below = std::min(below, t.bound);
  }
  double bound = guess;
  if (!finite().empty())
    bound = bound_at(zero());
  else if (above > 0)
    bound = 8 * above;  // nothing is lost yet
  if (whole_) {
    if (above + 1 > below - 1) return std::nullopt;
    bound = std::clamp(std::round(bound), above + 1, below - 1);
  } else {
    if (below <= above) return std::nullopt;
    if (bound > 0 || !tries_.empty())
      bound = std::clamp(bound, std::max(least_, above), std::max(least_, below));
  }
  const bool tried = std::ranges::any_of(tries_, [&](const Try& t) { return t.bound == bound; });
  return tried ? std::nullopt : std::optional(bound);
}

void BoundSearch::put(double bound, double measured, bool whole) {
  std::erase_if(tries_, [&](const Try& t) { return t.bound == bound; });
  tries_.push_back({bound, at(bound), excess_of(measured), whole});
  std::ranges::sort(tries_, {}, &Try::bound);
}
void BoundSearch::add(double bound, double measured) {
  put(bound, measured, false);
}

void BoundSearch::correct(double bound, double measured) {
  std::erase_if(tries_, [&](const Try& t) { return t.bound == bound && t.whole; });
  if (!finite().empty() && std::isfinite(measured) && std::isfinite(at(bound))) {
    const double off = excess_of(measured) - excess_at(at(bound));
    for (Try& t : tries_)
      if (!t.whole) t.excess += off;
  }
  put(bound, measured, true);
}

double BoundSearch::best() const {
  const bool psnr = target_.kind == PackedTarget::Kind::psnr;
  const auto lossless = std::ranges::find(tries_, 0.0, &Try::bound);
  if (lossless != tries_.end() && lossless->excess <= 0) return 0;
  if (finite().empty()) return tries_.empty() ? 0 : tries_.back().bound;  // none: no bound is possible
  const double real = bound_at(zero());
  if (!whole_) return psnr && real < least_ ? 0 : std::clamp(real, least_, most_);
  const double bound = std::clamp(psnr ? std::floor(real) : std::ceil(real), 0.0, most_),
               other = bound + (psnr ? 1 : -1);
  const auto close = [&](double b) { return std::abs(excess_at(at(b))) <= 0.75 * tolerance_; };
  return !close(bound) && other >= 0 && other <= most_ && close(other) ? other : bound;
}

bool BoundSearch::near(double measured) const {
  return std::abs(excess_of(measured)) <= tolerance_;
}

bool BoundSearch::better(double measured, double than) const {
  const auto kept = [&](double value) {
    return target_.kind == PackedTarget::Kind::psnr ? value >= target_.value - tolerance_
                                                    : value <= target_.value * (1 + bits_tolerance);
  };
  if (kept(measured) != kept(than)) return kept(measured);
  return std::abs(measured - target_.value) < std::abs(than - target_.value);
}

}  // namespace voxkit::svmm
