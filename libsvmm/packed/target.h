// The search for the bound with which a file has so many decibels, or so many bits a voxel.
#pragma once

#include <optional>
#include <vector>

#include "libsvmm/packed/packed.h"

namespace voxkit::svmm {

/// Knows what some bounds led to, and says which to try next, and which is best. Bounds are counted by their
/// binary logarithm, beside which both goals fall nearly evenly: 6.02 dB, or one bit, each time that the
/// bound doubles, and less where voxels are predicted within it.
class BoundSearch {
 public:
  /// `least`, `most`: of bounds above 0. `whole`: bounds are whole numbers.
  BoundSearch(const PackedTarget& target, bool whole, double least, double most);

  /// The bound to sample next; nothing where those that are known tell enough, or are four. `guess`: where
  /// to begin; 0: without loss.
  std::optional<double> next(double guess) const;
  /// What samples, or the whole volume, had with a bound: decibels (infinite: nothing was lost), or bits.
  void add(double bound, double measured);
  /// The whole volume had so much: what samples said is moved by how far it was off there.
  void correct(double bound, double measured);
  /// The bound that comes nearest. Of whole bounds, where none is near: the largest one that has the
  /// decibels, or the smallest one that keeps to the bits. 0: without loss.
  double best() const;
  /// Whether what the whole volume had is near enough.
  bool near(double measured) const;
  /// Whether one whole volume is better than another.
  bool better(double measured, double than) const;

 private:
  struct Try {
    double bound, at;  ///< `at`: its logarithm
    double excess;     ///< decibels, or bits on an evened scale; above 0: the bound may be larger
    bool whole;        ///< of the whole volume, not of samples
  };
  double at(double bound) const;
  double excess_of(double measured) const;
  void put(double bound, double measured, bool whole);
  double bound_at(double at) const;
  /// What is to be expected; finite.
  double excess_at(double at) const;
  /// Where the excess is 0, of the tries that are finite; there must be one.
  double zero() const;
  double slope(const Try& a, const Try& b) const;
  std::vector<Try> finite() const;

  PackedTarget target_;
  bool whole_;
  double least_, most_;
  double tolerance_;        ///< of an excess
  double steepest_;         ///< by which an excess changes when the bound doubles
  std::vector<Try> tries_;  ///< by ascending bounds
};

}  // namespace voxkit::svmm
