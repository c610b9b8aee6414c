// What an opened file has beside colours: where it is, and its values by number.
#pragma once

#include <vector>

#include "formats/container.h"
#include "libcolor/attributes/attribute_part.h"

namespace voxkit::color {

class Store;

/// Where the chunks of attributes are.
class AttributeStore {
 public:
  /// Finds the chunks that follow from the parameters, and no others.
  Status find(const Container& container, const Params& params);
  /// Of those that the file has, by number.
  const std::vector<AttributeParams>& params() const { return params_; }
  /// The bytes of a part of `params()[which]`, verified when first used.
  Result<std::span<const std::byte>> part(size_t which, uint64_t number, const Container& container) const {
    return container.chunk(parts_[which][number]);
  }

 private:
  std::vector<AttributeParams> params_;
  std::vector<std::vector<size_t>> parts_;  ///< indices into the container's table
};

/// Values of one attribute, one after the other or in any order; one for each thread. Errors are the store's.
class AttributeReader {
 public:
  /// Of an attribute that the file has.
  AttributeReader(const Store& store, const Container& container, const Params& params, Attribute attribute);
  /// That of a colour's number, the lowest byte first; 0 where there is none, or it is damaged.
  uint32_t value(uint64_t index) {
    if (index >= params_->color_count || (index >> part_log2 != part_ && !open(index))) return outside(index);
    const char* wrong = nullptr;
    const uint32_t value = reader_.value(static_cast<uint32_t>(index & (part_colors - 1)), wrong);
    if (wrong != nullptr) damaged(wrong);
    return value;
  }

 private:
  bool open(uint64_t index);
  [[gnu::cold]] uint32_t outside(uint64_t index) const;
  [[gnu::cold]] void damaged(const std::string& what) const;

  const Store* store_;
  const Container* container_;
  const Params* params_;
  Attribute attribute_;
  size_t which_ = 0;
  uint64_t part_ = ~uint64_t{0};
  AttributePartReader reader_;
};

/// All that a file has of a voxel, or some of it.
class AttributesReader {
 public:
  AttributesReader(const Store& store, const Container& container, const Params& params)
      : AttributesReader(store, container, params, params.attributes) {}
  /// `set`: of those that the file has.
  AttributesReader(const Store& store, const Container& container, const Params& params, AttributeSet set);
  /// Appends them, by number.
  void append(uint64_t index, std::vector<std::byte>& out) {
    for (Column& column : columns_) {
      const uint32_t value = column.reader.value(index);
      for (size_t i = 0; i < column.bytes; ++i) out.push_back(static_cast<std::byte>(value >> 8 * i & 0xff));
    }
  }

 private:
  struct Column {
    size_t bytes;
    AttributeReader reader;
  };
  std::vector<Column> columns_;
};

}  // namespace voxkit::color
