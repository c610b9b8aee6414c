// How probable a bit of a mask is, by what is around it: a tree of questions, each about one fact, whose
// leaves have probabilities. It is grown for each height of a file from its own masks (context_fit.h), as
// W. Chou and others grow decision trees (CART), and stored in it. File: formats/FORMAT.md, section 4.9.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/result.h"
#include "libcolor/octree/surroundings.h"
#include "libpage/bits.h"

namespace voxkit::color {

/// Questions on the way to a leaf, at most.
inline constexpr int most_questions = 48;

class ContextTree {
 public:
  /// A question, or a leaf.
  struct Node {
    uint32_t next = 0;   ///< where it leads if the answer is no; if yes, to the one behind
    uint8_t fact = 0;    ///< that is asked for
    uint8_t number = 0;  ///< of a leaf: of its probability (libpage/decision.h); else 0
  };

  /// A leaf, from which a tree can be grown; its number is to be set.
  ContextTree() : nodes_(1) {}
  const std::vector<Node>& nodes() const { return nodes_; }
  /// A leaf becomes a question about a fact, with two leaves: the first one's number, that of the answer no.
  uint32_t split(uint32_t leaf, uint32_t fact) {
    const auto first = static_cast<uint32_t>(nodes_.size());
    nodes_.resize(nodes_.size() + 2);
    nodes_[leaf] = {first, static_cast<uint8_t>(fact), 0};
    return first;
  }
  void set_number(uint32_t leaf, uint8_t number) { nodes_[leaf].number = number; }

  void write(page::BitWriter& out) const;
  /// Safe on any bytes. Errors: ErrorCode::input, saying which rule is broken.
  static Result<ContextTree> read(page::BitReader& in);

 private:
  std::vector<Node> nodes_;  ///< the root first
};

}  // namespace voxkit::color
