// A tree of contexts laid out for asking: two questions at a time, so that the way to a leaf is half as long.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "libcolor/octree/context_tree.h"

namespace voxkit::color {

/// Where a tree leads.
class ContextLookup {
 public:
  ContextLookup() = default;
  explicit ContextLookup(const ContextTree& tree) : nodes_(1) {
    std::vector<std::array<uint32_t, 2>> open{{0, 0}};  // a node of the tree, and what becomes of it here
    while (!open.empty()) {
      const auto [from, to] = open.back();
      open.pop_back();
      const auto& node = tree.nodes()[from];
      if (node.number != 0) {
        nodes_[to].number = node.number;
        continue;
      }
      const auto next = static_cast<uint32_t>(nodes_.size());
      nodes_.resize(nodes_.size() + 4);
      Node& own = nodes_[to];
      own.next = next;
      own.places[0] = Facts::places[node.fact];
      for (uint32_t answer = 0; answer < 2; ++answer) {
        const uint32_t second = node.next + answer;
        const auto& below = tree.nodes()[second];
        own.places[1 + answer] = Facts::places[below.fact];
        for (uint32_t other = 0; other < 2; ++other)  // a leaf is where both answers lead
          open.push_back({below.number != 0 ? second : below.next + other, next + 2 * answer + other});
      }
    }
  }

  /// The number of the probability that an octant is solid.
  uint8_t number(const Facts& facts) const {
    const Node* node = nodes_.data();
    while (node->number == 0) {
      const auto answer = [&](size_t i) {
        return static_cast<uint32_t>(facts.words[node->places[i].word] >> node->places[i].bit & 1);
      };
      const uint32_t first = answer(0), no = answer(1), yes = answer(2);
      node = &nodes_[node->next + 2 * first + (first != 0 ? yes : no)];
    }
    return node->number;
  }

 private:
  struct Node {
    uint32_t next = 0;                     ///< of four
    std::array<Facts::Place, 3> places{};  ///< of the first question, and the second if it is no, if yes
    uint8_t number = 0;
  };
  std::vector<Node> nodes_;
};

}  // namespace voxkit::color
