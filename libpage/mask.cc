#include "libpage/mask.h"

#include "libpage/decision.h"
#include "libpage/parent_rows.h"

namespace voxkit::page {
namespace {

constexpr uint32_t version_alone = 1, version_with_parents = 2;

/// Rows as a mask has them, at bits 2 to 17, with void around: bit x + 2 is voxel x.
uint32_t row_at(const Mask& mask, int y, int z) {
  if (y < 0 || z < 0 || y >= max_side) return 0;
  return uint32_t{mask.row(y, z)} << 2;
}
/// The voxels before, at and behind x.
uint32_t three(uint32_t row, int x) {
  return row >> (x + 1) & 7;
}

/// What of the context of row (y, z) does not depend on the row itself.
struct RowContext {
  uint32_t above, second_above, behind, behind_above, behind_below, second_behind;
  uint32_t plane;

  RowContext(const Mask& mask, int y, int z)
      : above(row_at(mask, y - 1, z)),
        second_above(row_at(mask, y - 2, z)),
        behind(row_at(mask, y, z - 1)),
        behind_above(row_at(mask, y - 1, z - 1)),
        behind_below(row_at(mask, y + 1, z - 1)),
        second_behind(row_at(mask, y, z - 2)),
        plane(z > 0 ? 1 : 0) {}
  /// `left`: the voxel before and the second before.
  uint32_t alone(int x, uint32_t left) const {
    const auto at = [x](uint32_t row) { return row >> (x + 2) & 1; };
    return left | three(above, x) << 2 | three(behind, x) << 5 | at(second_above) << 8 |
           at(behind_above) << 9 | at(behind_below) << 10 | at(second_behind) << 11 | plane << 12;
  }
  uint32_t with_parents(int x, uint32_t left) const {
    const auto at = [x](uint32_t row) { return row >> (x + 2) & 1; };
    return (left & 1) | three(above, x) << 1 | (three(behind, x) & 3) << 4 | at(behind_above) << 6;
  }
};

/// The parents of a row's voxels.
struct RowParents {
  uint32_t own, along_y, along_z;  ///< bit 1 + i: that of voxels 2 i and 2 i + 1; those on the voxels' side

  RowParents(const MaskParent& parent, int y, int z) {
    const auto row = [&](int py, int pz) -> uint32_t {
      if (py < 0 || pz < 0 || py >= parent.extent.ny || pz >= parent.extent.nz) return 0;
      return uint32_t{parent.mask->row(py, pz)} << 1 >> parent.x;
    };
    const int py = parent.y + y / 2, pz = parent.z + z / 2;
    own = row(py, pz);
    along_y = row(py + toward(y), pz);
    along_z = row(py, pz + toward(z));
  }
  bool solid(int x) const { return (own >> (x / 2 + 1) & 1) != 0; }
  uint32_t context(int x) const {
    const auto at = [](uint32_t row, int i) { return row >> (i + 1) & 1; };
    return at(own, x / 2 + toward(x)) | at(along_y, x / 2) << 1 | at(along_z, x / 2) << 2;
  }
};

/// Calls code(context, solid) for each voxel that is not known to be void, in order: x fastest, then y, z.
/// What it returns is whether the voxel is solid.
template <class Code>
void visit(bool parents, Mask& mask, Extent extent, const MaskParent& parent, const Code& code) {
  for (int z = 0; z < extent.nz; ++z)
    for (int y = 0; y < extent.ny; ++y) {
      const RowContext around(mask, y, z);
      uint32_t bits = mask.row(y, z), left = 0, out = 0;
      if (parents) {
        const RowParents above(parent, y, z);
        for (int x = 0; x < extent.nx; ++x) {
          bool solid = false;
          if (above.solid(x)) {
            const uint32_t child = first_child(y, z) + (static_cast<uint32_t>(x) & 1);
            solid = code(child << 10 | above.context(x) << 7 | around.with_parents(x, left),
                         (bits >> x & 1) != 0);
          }
          left = (left << 1 | (solid ? 1u : 0u)) & 3;
          out |= (solid ? 1u : 0u) << x;
        }
      } else {
        for (int x = 0; x < extent.nx; ++x) {
          const bool solid = code(around.alone(x, left), (bits >> x & 1) != 0);
          left = (left << 1 | (solid ? 1u : 0u)) & 3;
          out |= (solid ? 1u : 0u) << x;
        }
      }
      mask.row(y, z) = static_cast<uint16_t>(out);
    }
}

/// All that may be solid.
Mask possible(bool parents, Extent extent, const MaskParent& parent) {
  if (!parents) return full_mask(extent);
  Mask mask;
  for (int z = 0; z < extent.nz; ++z)
    for (int y = 0; y < extent.ny; ++y) {
      const RowParents above(parent, y, z);
      for (int x = 0; x < extent.nx; ++x)
        if (above.solid(x)) mask.set(x, y, z);
    }
  return mask;
}

}  // namespace

Mask full_mask(Extent extent) {
  Mask mask;
  for (int z = 0; z < extent.nz; ++z)
    for (int y = 0; y < extent.ny; ++y) mask.row(y, z) = static_cast<uint16_t>((1u << extent.nx) - 1);
  return mask;
}

void MaskModel::Builder::add(const Mask& mask, Extent extent, const MaskParent& parent) {
  if (mask.empty() || mask == possible(parents_, extent, parent)) return;
  Mask copy = mask;
  visit(parents_, copy, extent, parent, [&](uint32_t context, bool solid) {
    ++counts_[context][solid ? 1 : 0];
    return solid;
  });
}

MaskModel MaskModel::Builder::build() const {
  auto data = std::make_shared<Data>();
  data->parents = parents_;
  for (size_t c = 0; c < contexts; ++c) data->number[c] = decision_number(counts_[c]);
  return MaskModel(std::move(data));
}

std::vector<std::byte> MaskModel::serialise() const {
  BitWriter out;
  out.put(data_->parents ? version_with_parents : version_alone, 8);
  write_decision_numbers(out, data_->number);
  return out.take();
}

Result<MaskModel> MaskModel::parse(std::span<const std::byte> bytes) {
  const auto wrong = [](const char* what) { return bad_input({}, std::string("mask model: ") + what); };
  BitReader in(bytes);
  const uint32_t version = in.get(8);
  if (version != version_alone && version != version_with_parents)
    return wrong("unknown version: expected 1 or 2");
  auto data = std::make_shared<Data>();
  data->parents = version == version_with_parents;
  if (!read_decision_numbers(in, data->number))
    return wrong("expected 8192 contexts, known ones from 1 to 31");
  if (!in.at_end()) return wrong("expected it to end with its last context");
  return MaskModel(std::move(data));
}

void MaskModel::encode(const Mask& mask, Extent extent, std::vector<std::byte>& out,
                       const MaskParent& parent) const {
  if (mask.empty()) return;
  if (mask == possible(data_->parents, extent, parent)) {
    out.push_back(std::byte{1});
    return;
  }
  std::vector<Decision> decisions;
  decisions.reserve(max_voxels);
  Mask copy = mask;
  visit(data_->parents, copy, extent, parent, [&](uint32_t context, bool solid) {
    decisions.push_back(decision(data_->number[context], solid));
    return solid;
  });
  RansEncoder coder;
  for (size_t i = decisions.size(); i-- > 0;) coder.put(decisions[i].part, decisions[i].start, 0, 0);
  coder.finish(out, 1);
}

Result<Mask> MaskModel::decode(std::span<const std::byte> page, Extent extent,
                               const MaskParent& parent) const {
  if (!extent.valid()) return bad_usage("a mask of no valid extent");
  if (data_->parents && !(parent.mask && covers(parent.extent, parent.x, parent.y, parent.z, extent)))
    return bad_usage(
        "a mask decoded without the parents of all its voxels: expected those that its model has");
  if (page.empty()) return Mask{};
  if (page.size() == 1) {
    if (page[0] != std::byte{1}) return bad_input({}, "mask: a byte that is not 1");
    return possible(data_->parents, extent, parent);
  }
  Mask mask;
  RansDecoder coder;
  coder.open(page);
  visit(data_->parents, mask, extent, parent,
        [&](uint32_t context, bool) { return decide(coder, data_->number[context]); });
  if (!coder.finished())
    return bad_input({}, "mask: it does not end where its voxels end: expected one of this model and extent");
  return mask;
}

}  // namespace voxkit::page
