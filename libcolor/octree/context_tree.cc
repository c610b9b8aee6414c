#include "libcolor/octree/context_tree.h"

namespace voxkit::color {
namespace {

constexpr int fact_bits = 8, number_bits = 5;

}  // namespace

void ContextTree::write(page::BitWriter& out) const {
  std::vector<uint32_t> open{0};
  while (!open.empty()) {
    const Node& node = nodes_[open.back()];
    open.pop_back();
    const bool asks = node.number == 0;
    out.put(asks ? 1 : 0, 1);
    if (asks) {
      out.put(node.fact, fact_bits);
      open.push_back(node.next + 1);
      open.push_back(node.next);
    } else {
      out.put(node.number, number_bits);
    }
  }
}

Result<ContextTree> ContextTree::read(page::BitReader& in) {
  const auto wrong = [](const char* what) { return bad_input({}, what); };
  ContextTree tree;
  struct Open {
    uint32_t node;
    int questions;
  };
  std::vector<Open> open{{0, 0}};
  while (!open.empty()) {
    const auto [node, questions] = open.back();
    open.pop_back();
    if (in.get(1) != 0) {
      const uint32_t fact = in.get(fact_bits);
      if (fact >= fact_count) return wrong("a question about an unknown fact: expected one below 156");
      if (questions == most_questions) return wrong("more than 48 questions on the way to a leaf");
      const uint32_t first = tree.split(node, fact);
      open.push_back({first + 1, questions + 1});
      open.push_back({first, questions + 1});
    } else {
      const uint32_t number = in.get(number_bits);
      if (number == 0) return wrong("a probability with the number 0: expected 1 to 31");
      tree.set_number(node, static_cast<uint8_t>(number));
    }
    if (in.overrun()) return wrong("a tree of contexts that is cut off");
  }
  return tree;
}

}  // namespace voxkit::color
