// Growing a tree of contexts from samples.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/context.h"
#include "libcolor/octree/context_tree.h"

namespace voxkit::color {

/// Facts of octants, apart by whether these are solid.
class ContextSamples {
 public:
  void add(const Facts& facts, bool solid) { of_[solid ? 1 : 0].push_back(packed(facts)); }
  /// All of some, of which each is given back as it is taken.
  static ContextSamples joined(std::vector<ContextSamples>&& parts);
  uint64_t size() const { return of_[0].size() + of_[1].size(); }
  static constexpr uint64_t sample_bytes = 24;

  /// A tree whose leaves each have a probability. A question is asked where it saves more than it takes in
  /// the file, of `scale` times as many octants as there are samples. Integer arithmetic: the same on every
  /// machine and any number of threads. The samples are put in another order.
  Result<ContextTree> grow(uint64_t scale, const Context& ctx) &&;

 private:
  /// Bit f of them is fact f.
  using Packed = std::array<uint64_t, 3>;
  static Packed packed(const Facts& facts);

  struct Range {
    size_t begin = 0, end = 0;
    size_t size() const { return end - begin; }
  };
  /// By fact: of how many samples it is true, by whether they are solid.
  using Counts = std::array<std::array<uint32_t, fact_count>, 2>;
  /// A leaf that may become a question.
  struct Leaf {
    uint32_t node = 0;
    int questions = 0;            ///< on the way to it
    std::array<Range, 2> ranges;  ///< its samples, by whether they are solid
    Counts counts;
    size_t size() const { return ranges[0].size() + ranges[1].size(); }
  };
  Counts count(const std::array<Range, 2>& ranges) const;
  /// The fact that tells most, or `fact_count` where none tells enough; `least`: bits that it has to save, in
  /// parts of 2^24.
  static uint32_t best_fact(const Leaf& leaf, int64_t least);
  /// What is left of a leaf where the answer is no, and where it is yes.
  std::array<Leaf, 2> parted(const Leaf& leaf, uint32_t fact);

  std::array<std::vector<Packed>, 2> of_;
};

}  // namespace voxkit::color
