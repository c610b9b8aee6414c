#include "libcolor/dag/symmetric_dag.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <unordered_map>

#include "formats/reservation.h"
#include "libcolor/dag/dag_pool.h"

namespace voxkit::color {
namespace {

/// What a node of the DAG, or a leaf word, has become: a class of mirror images, and how the one that stands
/// for the class is to be mirrored.
struct Image {
  uint32_t number = 0, mirror = 0;
};

/// A class of mirror images.
struct Class {
  uint8_t symmetries = 1;  ///< by mirror: whether it stays as it is
  uint64_t uses = 0;       ///< pointers to it
  uint64_t colors = 0;
  uint32_t address = 0;
};

/// The least of equal mirrors.
uint32_t least_mirror(uint32_t mirror, uint8_t symmetries) {
  uint32_t least = mirror;
  for (uint32_t m = 1; m < 8; ++m)
    if ((symmetries >> m & 1) != 0) least = std::min(least, mirror ^ m);
  return least;
}

/// What stands for a class of nodes: the mask, and for each octant in it the class of its subtree and the
/// mirror, on top.
struct Form {
  std::array<uint32_t, 9> words{};
  uint32_t length = 1;
  friend auto operator<=>(const Form& a, const Form& b) {
    return std::lexicographical_compare_three_way(a.words.begin(), a.words.begin() + a.length,
                                                  b.words.begin(), b.words.begin() + b.length);
  }
  friend bool operator==(const Form& a, const Form& b) { return (a <=> b) == 0; }
};

/// Classes of a height, the one that stands for each as a run of words.
struct Level {
  std::vector<uint32_t> forms;   ///< of nodes
  std::vector<uint32_t> begins;  ///< by class: where its form begins
  std::vector<Class> classes;
};

class Builder {
 public:
  Builder(const Dag& dag, Context& ctx)
      : view_(view_of(dag)), memory_(*ctx.memory), levels_(static_cast<size_t>(dag.height) + 1) {
    out_.height = dag.height;
    out_.colors = dag.colors;
    out_.curve = dag.curve;
    out_.nodes.resize(levels_.size());
  }

  Result<SymmetricDag> run(uint64_t voxels) {
    if (voxels == 0) {
      out_.leaves.push_back(0);
      return std::move(out_);
    }
    VOX_CHECK(find_words());
    for (int h = leaf_height + 1; h <= view_.height; ++h) {
      VOX_CHECK(find_nodes(h));
      VOX_CHECK(check_interrupt());
    }
    const Image root = images_[view_.root];
    count_uses();
    place_words();
    for (int h = leaf_height + 1; h <= view_.height; ++h) VOX_CHECK(write_nodes(h));
    out_.root = level(view_.height).classes[root.number].address | root.mirror << mirror_shift;
    return std::move(out_);
  }

 private:
  Level& level(int h) { return levels_[static_cast<size_t>(h)]; }

  Status find_words() {
    // The table of words takes about 40 bytes each.
    VOX_CHECK(memory_.add(view_.leaf_count * (sizeof(Image) + sizeof(Class) + 40), "mirror images of words"));
    Level& words = level(leaf_height);
    std::unordered_map<uint64_t, uint32_t> known;
    images_.resize(view_.leaf_count);
    for (uint64_t i = 0; i < view_.leaf_count; ++i) {
      Image best;
      uint64_t least = ~uint64_t{0};
      uint8_t symmetries = 0;  // of the least image
      for (uint32_t m = 0; m < 8; ++m)
        if (const uint64_t word = mirrored_word(view_.leaves[i], m); m == 0 || word < least) {
          least = word;
          best.mirror = m;
        }
      for (uint32_t m = 0; m < 8; ++m)
        if (mirrored_word(least, m) == least) symmetries |= static_cast<uint8_t>(1u << m);
      const auto [at, added] = known.try_emplace(least, static_cast<uint32_t>(words_.size()));
      if (added) {
        words_.push_back(least);
        words.classes.push_back({symmetries, 0, leaf_colors(least, view_.colors), 0});
      }
      images_[i] = {at->second, best.mirror};
    }
    return {};
  }

  /// A node as it is when mirrored.
  Form form_of(const NodeRef& node, int h, uint32_t mirror) {
    const std::vector<Class>& below = level(h - 1).classes;
    Form form;
    form.words[0] = mirrored_octants(node.mask, mirror);
    for (uint32_t octant = 0; octant < 8; ++octant) {
      if ((form.words[0] >> octant & 1) == 0) continue;
      const Image image = images_[view_.pointer(node, octant ^ mirror)];
      form.words[form.length++] =
          image.number | least_mirror(image.mirror ^ mirror, below[image.number].symmetries) << mirror_shift;
    }
    return form;
  }

  /// Classes of the nodes of a height; of those below, images_ says what they have become.
  Status find_nodes(int h) {
    const auto at_height = static_cast<size_t>(h);
    VOX_CHECK(memory_.add(view_.words[at_height] * (sizeof(Image) + 3 * sizeof(uint32_t)),
                          "mirror images of nodes"));
    Level& nodes = level(h);
    UniqueRuns<uint32_t> unique;
    std::unordered_map<uint32_t, uint32_t> class_at;  // by where its form begins
    std::vector<Image> images(view_.words[at_height]);
    for (uint64_t at = 0; at < view_.words[at_height];) {
      const auto pointer = static_cast<uint32_t>(at);
      const NodeRef node = view_.node(h, pointer);
      std::array<Form, 8> forms;
      uint32_t best = 0;
      for (uint32_t m = 0; m < 8; ++m) {
        forms[m] = form_of(node, h, m);
        if (forms[m] < forms[best]) best = m;
      }
      const uint32_t begin = unique.add(nodes.forms, std::span(forms[best].words.data(), forms[best].length));
      const auto [known, added] = class_at.try_emplace(begin, static_cast<uint32_t>(nodes.classes.size()));
      if (added) {
        if (nodes.classes.size() >= address_mask)
          return fail(ErrorCode::limit, {}, "more than 2^29 different nodes: use --geometry dag");
        uint8_t symmetries = 0;
        for (uint32_t m = 0; m < 8; ++m)
          if (forms[best ^ m] == forms[best]) symmetries |= static_cast<uint8_t>(1u << m);
        nodes.begins.push_back(begin);
        nodes.classes.push_back({symmetries, 0, view_.colors_below(h, pointer), 0});
      }
      images[at] = {known->second, best};
      at += node_words(count_octants(node.mask), *node.words >> 8 == wide_count, Counts::node);
    }
    out_.node_count += nodes.classes.size();
    images_ = std::move(images);
    return {};
  }

  void count_uses() {
    for (int h = leaf_height + 1; h <= view_.height; ++h)
      for (size_t i = 0; i < level(h).classes.size(); ++i)
        for_each_child(h, i,
                       [&](uint32_t, uint32_t number, uint32_t) { ++level(h - 1).classes[number].uses; });
  }
  /// Calls visit(octant, class, mirror) for each octant of what stands for a class.
  template <class Visit>
  void for_each_child(int h, size_t number, const Visit& visit) {
    const uint32_t* form = &level(h).forms[level(h).begins[number]];
    const uint32_t mask = *form++;
    for (uint32_t octant = 0; octant < 8; ++octant)
      if ((mask >> octant & 1) != 0) {
        visit(octant, *form & address_mask, *form >> mirror_shift);
        ++form;
      }
  }

  /// Classes of a height, the most used ones first.
  std::vector<uint32_t> by_use(int h) {
    const std::vector<Class>& classes = level(h).classes;
    std::vector<uint32_t> order(classes.size());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(order, std::greater(), [&](uint32_t i) { return classes[i].uses; });
    return order;
  }
  static uint32_t pointer_bytes(uint64_t address) {
    return address < 1u << 13 ? 2 : address < 1u << 21 ? 3 : 4;
  }
  static uint32_t word_bytes(uint64_t word) { return 1 + count_octants(leaf_octants(word)); }

  /// Which words lie in a table, and which in the nodes that have them: what is shorter in all.
  void place_words() {
    for (const uint32_t i : by_use(leaf_height)) {
      Class& own = level(leaf_height).classes[i];
      const uint32_t bytes = pointer_bytes(out_.leaves.size());
      const bool in_nodes =
          view_.height > leaf_height &&
          (bytes == 4 || own.uses * word_bytes(words_[i]) < own.uses * bytes + sizeof(uint64_t));
      own.address = in_nodes ? word_in_node : static_cast<uint32_t>(out_.leaves.size());
      if (!in_nodes) out_.leaves.push_back(words_[i]);
    }
    // There is always one word, as there is without symmetry.
    if (out_.leaves.empty()) out_.leaves.push_back(words_[0]);
  }

  Status write_nodes(int h) {
    std::vector<uint8_t>& bytes = out_.nodes[static_cast<size_t>(h)];
    const uint64_t most = h == leaf_height + 1 ? word_in_node : uint64_t{1} << mirror_shift;
    for (const uint32_t i : by_use(h)) {
      if (bytes.size() + 64 > most)
        return fail(ErrorCode::limit, {},
                    fmt::format("the nodes of {} voxels a side take more than {} MiB: use --geometry dag",
                                uint64_t{1} << h, most >> 20));
      Class& own = level(h).classes[i];
      own.address = static_cast<uint32_t>(bytes.size());
      bytes.resize(bytes.size() + 2);
      uint64_t left = own.colors;
      for (; left >= 0x80; left >>= 7) bytes.push_back(static_cast<uint8_t>(left | 0x80));
      bytes.push_back(static_cast<uint8_t>(left));
      uint32_t codes = 0;
      std::vector<uint8_t> words;
      for_each_child(h, i, [&](uint32_t octant, uint32_t number, uint32_t mirror) {
        codes |= write_child(bytes, words, h, number, mirror) << 2 * octant;
      });
      bytes.insert(bytes.end(), words.begin(), words.end());
      bytes[own.address] = static_cast<uint8_t>(codes);
      bytes[own.address + 1] = static_cast<uint8_t>(codes >> 8);
    }
    return memory_.add(bytes.size(), "a DAG with symmetry");
  }
  /// Appends a pointer, or a word; its code.
  uint32_t write_child(std::vector<uint8_t>& pointers, std::vector<uint8_t>& words, int h, uint32_t number,
                       uint32_t mirror) {
    const Class& child = level(h - 1).classes[number];
    if (h == leaf_height + 1 && child.address == word_in_node) {
      const uint64_t word = mirrored_word(words_[number], mirror);
      words.push_back(static_cast<uint8_t>(leaf_octants(word)));
      for (int octant = 0; octant < 8; ++octant)
        if (const auto mask = static_cast<uint8_t>(word >> 8 * octant); mask != 0) words.push_back(mask);
      return code_other;
    }
    const uint32_t length = pointer_bytes(child.address);
    const uint32_t pointer = child.address << 3 | mirror;
    for (uint32_t i = 0; i < length; ++i) pointers.push_back(static_cast<uint8_t>(pointer >> 8 * i));
    return length - 1;
  }

  const DagView view_;
  Reservation memory_;
  std::vector<Level> levels_;    ///< by height
  std::vector<uint64_t> words_;  ///< by class of words: the least image
  std::vector<Image> images_;    ///< by pointer, of the height that was done last
  SymmetricDag out_;
};

}  // namespace

Result<SymmetricDag> symmetric_dag_of(const Dag& dag, Context& ctx) {
  return Builder(dag, ctx).run(dag.voxels);
}

DagView view_of(const SymmetricDag& dag) {
  DagView view;
  view.symmetric = true;
  view.height = dag.height;
  view.colors = dag.colors;
  view.curve = dag.curve;
  view.root = dag.root;
  view.leaves = dag.leaves.data();
  view.leaf_count = dag.leaves.size();
  for (size_t h = 0; h < dag.nodes.size(); ++h) {
    view.coded[h] = dag.nodes[h].data();
    view.coded_bytes[h] = dag.nodes[h].size();
  }
  return view;
}

}  // namespace voxkit::color
