#include <algorithm>

#include "libpage/page.h"
#include "libpage/rans.h"
#include "libpage/residuals.h"
#include "libpage/row.h"

namespace voxkit::page {
namespace {

template <class Width>
void write_residuals(const ModelData& model, const Residuals& residuals, std::vector<std::byte>& out) {
  static constexpr auto bins = make_bins(Width::escape_bits);
  RansEncoder coder;
  for (auto i = static_cast<size_t>(residuals.count); i-- > 0;) {
    const size_t context = residuals.context[i];
    const Frequencies& table = model.tables[context];
    uint32_t symbol = symbol_of(residuals.folded[i]);
    if (table[symbol] == 0) symbol = escape_symbol;
    const uint32_t raw = residuals.folded[i] - bins[symbol].base, raw_bits = bins[symbol].raw_bits;
    if constexpr (Width::escape_bits <= 21) {
      coder.put(table[symbol], model.starts[context][symbol], raw, raw_bits);
    } else {
      const uint32_t low_bits = std::min(raw_bits, 16u);
      coder.put_raw(raw >> low_bits, raw_bits - low_bits);
      coder.put_raw(raw & ((1u << low_bits) - 1), low_bits);
      coder.put(table[symbol], model.starts[context][symbol], 0, 0);
    }
  }
  coder.finish(out, model.value_bytes());
}

template <class T>
Status encode(const Model& shared, std::span<const T> samples, Extent extent, std::vector<std::byte>& out,
              const Parent<T>& parent, std::span<T> decoded, const Mask* mask) {
  const ModelData& model = shared.data();
  if (!extent.valid() || samples.size() != static_cast<size_t>(extent.voxels()))
    return bad_usage("a page of another number of samples than its extent: expected them all");
  if (model.classes.parents && !covers(parent, extent))
    return bad_usage("a page without the parents of all its voxels: expected those that its model has");
  if (mask && model.wide())
    return bad_usage("a page with void voxels of more than 16 bits: expected a model of at most so many");
  const auto tell = [&](auto value_at) {
    for (size_t i = 0; i < decoded.size(); ++i) decoded[i] = sample_of<T>(model, value_at(i));
  };
  if (mask && mask->empty()) {
    tell([&](size_t) { return model.background; });
    return {};
  }
  std::array<uint32_t, max_voxels> values;
  std::ranges::copy(samples, values.begin());
  const std::span<uint32_t> page(values.data(), samples.size());
  if (mask) fill_void(*mask, extent, page);
  if (!model.number(page))
    return bad_usage("a sample that the palette of the model lacks: expected all values when it was made");
  const auto range = std::ranges::minmax(page);
  const uint32_t least = range.min, greatest = range.max;
  if (greatest > model.max_value)
    return bad_usage("a sample above the greatest of the model: expected max_sample to be that of all pages");
  if (greatest - least <= 2 * uint64_t{model.max_error}) {
    const auto near = [&](uint32_t value) {
      return int64_t{greatest} - int64_t{value} <= int64_t{model.max_error} &&
             int64_t{value} - int64_t{least} <= int64_t{model.max_error};
    };
    const bool empty = near(model.background);
    const uint32_t middle = empty ? model.background : least + (greatest - least) / 2;
    tell([&](size_t) { return middle; });
    if (empty) return {};
    for (size_t byte = 0; byte < model.value_bytes(); ++byte)
      out.push_back(static_cast<std::byte>(middle >> 8 * byte & 0xff));
    return {};
  }
  if (model.labels) {
    if (mask) return bad_usage("labels with void voxels: expected all to be solid");
    std::vector<uint32_t> parents;
    encode_labels(*model.labels, page, extent, widened(parent, parents), out, model.value_bytes());
    tell([&](size_t i) { return page[i]; });
    return {};
  }
  Residuals residuals;
  std::array<uint32_t, max_voxels> lossy;
  find_residuals(model, page, extent, parent, mask, residuals, lossy.data());
  if (model.wide())
    write_residuals<Wide>(model, residuals, out);
  else
    write_residuals<Narrow>(model, residuals, out);
  tell([&](size_t i) { return lossy[i]; });
  return {};
}

}  // namespace

Status encode_page(const Model& model, std::span<const uint8_t> samples, Extent extent,
                   std::vector<std::byte>& out, const Parent<uint8_t>& parent, std::span<uint8_t> decoded,
                   const Mask* mask) {
  return encode(model, samples, extent, out, parent, decoded, mask);
}
Status encode_page(const Model& model, std::span<const uint16_t> samples, Extent extent,
                   std::vector<std::byte>& out, const Parent<uint16_t>& parent, std::span<uint16_t> decoded,
                   const Mask* mask) {
  return encode(model, samples, extent, out, parent, decoded, mask);
}
Status encode_page(const Model& model, std::span<const uint32_t> samples, Extent extent,
                   std::vector<std::byte>& out, const Parent<uint32_t>& parent, std::span<uint32_t> decoded,
                   const Mask* mask) {
  return encode(model, samples, extent, out, parent, decoded, mask);
}

}  // namespace voxkit::page
