// The bits of a part of an attribute's values, and how one is found. File: formats/FORMAT.md, section 4.11.
//
// A part has the values that belong to the colours of the part with its number. Where all are equal it is
// that value alone. Else:
//
//   raw       the values, one after the other
//   fws, vws  blocks (block_layout.h)
//   palette   u32: different ids, ascending, that follow; then numbers of these (palette_layout.h); 0: the
//             ids follow as they are
#pragma once

#include "libcolor/attributes/attribute_params.h"
#include "libcolor/blocks/block_layout.h"
#include "libcolor/palette/palette_layout.h"

namespace voxkit::color {

/// How the values of an attribute are stored, as inner loops need to know it.
struct AttributeStorage {
  ColorCodec codec = ColorCodec::raw;
  Endpoints endpoints = Endpoints::rgb888;
  uint32_t bytes = 1;  ///< of a value

  AttributeStorage() = default;
  explicit AttributeStorage(const AttributeParams& p)
      : codec(p.codec), endpoints(p.endpoints), bytes(static_cast<uint32_t>(kind_of(p.attribute).bytes)) {}
};

/// A part of the values, to be read. Safe on any bytes: what is not there is 0.
class AttributePart {
 public:
  AttributePart() = default;
  /// `count`: of values, 1 to 2^20.
  VOX_HD AttributePart(const std::byte* bytes, uint64_t size, uint32_t count, AttributeStorage storage)
      : value_bytes_(storage.bytes), count_(count) {
    if (size == value_bytes_) {
      plain_ = bytes;
      way_ = Way::constant;
    } else if (storage.codec == ColorCodec::raw) {
      take_plain(bytes, size);
    } else if (storage.codec != ColorCodec::palette) {
      blocks_ = PartView(bytes, size, count, storage.endpoints);
      if (blocks_.valid()) way_ = Way::blocks;
    } else if (size >= 4) {
      ids_ = load_le<uint32_t>(bytes);
      const uint64_t behind = 4 + 4 * uint64_t{ids_};
      if (ids_ == 0) {
        take_plain(bytes + 4, size - 4);
      } else if (ids_ <= most_palette_colors && size >= behind) {
        plain_ = bytes + 4;
        numbers_ = PaletteView(bytes + behind, size - behind, count, palette_bits(ids_));
        if (numbers_.valid()) way_ = Way::ids;
      }
    }
  }

  enum class Way : uint8_t { none, constant, plain, blocks, ids };
  /// none: it has not the bytes that it says it has.
  VOX_HD Way way() const { return way_; }
  VOX_HD const PartView& blocks() const { return blocks_; }
  VOX_HD const PaletteView& numbers() const { return numbers_; }
  VOX_HD uint32_t ids() const { return ids_; }
  /// Of the part's ids one; value i of those that are plain.
  VOX_HD uint32_t plain(uint64_t i) const {
    const std::byte* const at = plain_ + i * value_bytes_;
    uint32_t value = 0;
    for (uint32_t b = 0; b < value_bytes_; ++b) value |= static_cast<uint32_t>(at[b]) << 8 * b;
    return value;
  }
  VOX_HD uint32_t id(uint32_t number) const { return number < ids_ ? plain(number) : 0; }
  VOX_HD static uint32_t value_of(Rgb c) {
    return c.r | static_cast<uint32_t>(c.g) << 8 | static_cast<uint32_t>(c.b) << 16;
  }

  /// Value `index` of the part.
  VOX_HD uint32_t value(uint32_t index) const {
    if (index >= count_) return 0;
    switch (way_) {
      case Way::constant:
        return plain(0);
      case Way::plain:
        return plain(index);
      case Way::blocks:
        return value_of(blocks_.color(index));
      case Way::ids:
        return id(numbers_.number(index));
      case Way::none:
        break;
    }
    return 0;
  }

 private:
  VOX_HD void take_plain(const std::byte* bytes, uint64_t size) {
    if (size != uint64_t{count_} * value_bytes_) return;
    plain_ = bytes;
    way_ = Way::plain;
  }

  const std::byte* plain_ = nullptr;
  PartView blocks_;
  PaletteView numbers_;
  Way way_ = Way::none;
  uint32_t value_bytes_ = 1, count_ = 0, ids_ = 0;
};

/// Values of a part one after the other, or in any order.
class AttributePartReader {
 public:
  void open(const AttributePart& part) {
    part_ = part;
    first_ = last_ = 0;
    if (part.way() == AttributePart::Way::ids) numbers_.open(part.numbers(), {});
  }
  /// Value `index` of the part, which has it. `damaged`: is set to what is wrong, where it is.
  uint32_t value(uint32_t index, const char*& damaged) {
    switch (part_.way()) {
      case AttributePart::Way::blocks:
        if ((index < first_ || index >= last_) && !find(index, damaged))
          return AttributePart::value_of(macro_.raw ? part_.blocks().color(index) : Rgb{});
        return AttributePart::value_of(part_.blocks().color_in(macro_, block_, index % macro_block_colors));
      case AttributePart::Way::ids: {
        const uint32_t number = numbers_.number(index);
        if (number >= part_.ids()) damaged = "an index behind the end";
        return part_.id(number);
      }
      case AttributePart::Way::none:
        damaged = "not the bytes that its values take";
        return 0;
      default:
        return part_.value(index);
    }
  }

 private:
  bool find(uint32_t index, const char*& damaged) {
    const uint32_t number = index / macro_block_colors, base = number * macro_block_colors;
    first_ = last_ = 0;
    macro_ = part_.blocks().macro_block(number);
    if (macro_.raw) return false;
    const uint32_t block = part_.blocks().find_block(macro_, index - base);
    if (block == macro_.last) {
      damaged = "a macro block has not its blocks";
      return false;
    }
    block_ = part_.blocks().block(block);
    first_ = base + block_.first;
    last_ = base + (block + 1 < macro_.last ? part_.blocks().first_color(block + 1) : macro_block_colors);
    return true;
  }

  AttributePart part_;
  PaletteReader numbers_;
  PartView::MacroBlock macro_;
  PartView::Block block_;
  uint32_t first_ = 0, last_ = 0;  ///< values that the block has
};

}  // namespace voxkit::color
