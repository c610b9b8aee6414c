#include "libcolor/attributes/attribute_order.h"

#include "libcolor/attributes/attribute_means.h"
#include "libcolor/dag/cell_order.h"

namespace voxkit::color {
namespace {

class AttributesOut {
 public:
  using Sums = AttributeSums;
  AttributesOut(bool all, AttributeSet set, std::span<const std::byte> voxels, std::vector<std::byte>& out)
      : all_(all), bytes_(set.bytes()), means_(set), voxels_(voxels), out_(out) {}

  Sums voxel(uint64_t first) {
    const auto own = voxels_.subspan(first * bytes_, bytes_);
    out_.insert(out_.end(), own.begin(), own.end());
    return all_ ? means_.of(own) : Sums{};
  }
  size_t begin() {
    const size_t room = out_.size();
    if (all_) out_.resize(room + bytes_);
    return room;
  }
  void end(size_t room, int, Sums& sums) {
    if (!all_) return;
    sums.elect();
    means_.put(sums, std::span(out_).subspan(room, bytes_));
  }

 private:
  const bool all_;
  const size_t bytes_;
  const AttributeMeans means_;
  std::span<const std::byte> voxels_;
  std::vector<std::byte>& out_;
};

}  // namespace

Result<std::vector<std::byte>> attributes_in_order(const Dag& dag, uint64_t count, Colors colors, Curve curve,
                                                   AttributeSet set, std::span<const std::byte> voxels,
                                                   Reservation& memory) {
  std::vector<std::byte> ordered;
  if (voxels.empty()) return ordered;
  VOX_CHECK(memory.add(count * set.bytes(), "room for attributes in order"));
  ordered.reserve(count * set.bytes());
  AttributesOut out(colors == Colors::all, set, voxels, ordered);
  CellOrder(dag, out).run(curve);
  return ordered;
}

}  // namespace voxkit::color
