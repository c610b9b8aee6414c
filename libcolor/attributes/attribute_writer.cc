#include "libcolor/attributes/attribute_writer.h"

#include <algorithm>

#include "formats/clock.h"
#include "formats/parallel.h"
#include "libcolor/attributes/attribute_encode.h"

namespace voxkit::color {

AttributeWriter::AttributeWriter(AttributeSet set, const Options& options, ContainerWriter& container,
                                 Context& ctx)
    : set_(set),
      options_(options),
      container_(container),
      ctx_(ctx),
      reservation_(*ctx.memory),
      cell_bytes_(set.bytes()) {
  for (size_t i = 0; i < attribute_kinds.size(); ++i)
    if (const auto attribute = static_cast<Attribute>(i); set.has(attribute))
      params_.push_back(attribute_plan(attribute, options));
  most_squared_.resize(params_.size());
}

Status AttributeWriter::begin() {
  if (set_.empty()) return {};
  batch_ = static_cast<uint64_t>(2 * ctx_.threads);
  // Values, those of one attribute while they are encoded, and what becomes of them.
  VOX_CHECK(reservation_.add(batch_ * part_colors * (2 * cell_bytes_ + 4), "room for attributes"));
  values_.reserve(batch_ * part_colors * cell_bytes_);
  return {};
}

Status AttributeWriter::add(std::span<const std::byte> values) {
  const size_t full = batch_ * part_colors * cell_bytes_;
  while (!values.empty()) {
    const auto some = values.first(std::min(values.size(), full - values_.size()));
    values_.insert(values_.end(), some.begin(), some.end());
    values = values.subspan(some.size());
    if (values_.size() == full) VOX_CHECK(flush());
  }
  return {};
}

Status AttributeWriter::flush() {
  const auto start = Clock::now();
  const uint64_t count = values_.size() / std::max<size_t>(cell_bytes_, 1), parts = part_count(count);
  std::vector<EncodedPart> encoded(parts * params_.size());
  VOX_CHECK(parallel_for(ctx_, static_cast<int64_t>(encoded.size()), [&](int64_t i) -> Status {
    const auto at = static_cast<size_t>(i);
    const AttributeParams& params = params_[at % params_.size()];
    const uint64_t part = at / params_.size();
    const size_t bytes = kind_of(params.attribute).bytes;
    std::vector<std::byte> own(colors_of_part(count, part) * bytes);
    const std::byte* from = &values_[(part << part_log2) * cell_bytes_ + set_.offset(params.attribute)];
    for (size_t to = 0; to < own.size(); to += bytes, from += cell_bytes_) std::copy_n(from, bytes, &own[to]);
    encoded[at] = encode_attribute_part(own, params, options_.effort);
    return {};
  }));
  for (size_t i = 0; i < encoded.size(); ++i) {
    const size_t which = i % params_.size();
    AttributeParams& params = params_[which];
    VOX_CHECK(container_.add(attribute_values_kind, static_cast<uint32_t>(params.attribute),
                             next_part_ + i / params_.size(), encoded[i].bytes));
    params.bytes += encoded[i].bytes.size();
    params.blocks += encoded[i].blocks;
    most_squared_[which] = std::max(most_squared_[which], encoded[i].most_squared);
  }
  next_part_ += parts;
  values_.clear();
  seconds += seconds_since(start);
  return {};
}

Status AttributeWriter::finish() {
  VOX_CHECK(flush());
  for (size_t i = 0; i < params_.size(); ++i) {
    AttributeParams& params = params_[i];
    params.most_error = most_error_of(most_squared_[i], params.space);
    VOX_CHECK(container_.add(attribute_params_kind, static_cast<uint32_t>(params.attribute), 0,
                             pack_attribute(params)));
  }
  return {};
}

}  // namespace voxkit::color
