#include <algorithm>
#include <cstdlib>

#include "libpage/model_data.h"
#include "libpage/page.h"
#include "libpage/row.h"

namespace voxkit::page {
namespace {

/// Of models without and with parents.
constexpr uint32_t version_alone = 1, version_with_parents = 2, version_labels = 3,
                   version_labels_with_parents = 4;
constexpr int weight_golomb = 7, palette_golomb = 2;

tl::unexpected<Error> wrong(const char* what) {
  return bad_input({}, std::string("page model: ") + what);
}

void write_weights(BitWriter& out, const Weights& weights, Classes classes, int voxel_class) {
  for (int t = 0; t < tap_count; ++t)
    if (classes.has(voxel_class, t) && t != classes.rest(voxel_class))
      out.signed_golomb(weights[static_cast<size_t>(t)], weight_golomb);
}

bool read_weights(BitReader& in, Weights& weights, Classes classes, int voxel_class) {
  weights = {};
  const int rest = classes.rest(voxel_class);
  if (rest < 0) return true;
  int64_t left = weight_one, size = 0;
  for (int t = 0; t < tap_count; ++t) {
    if (!classes.has(voxel_class, t) || t == rest) continue;
    const int32_t weight = in.signed_golomb(weight_golomb);
    if (weight > INT16_MAX || weight < -INT16_MAX) return false;
    weights[static_cast<size_t>(t)] = static_cast<int16_t>(weight);
    left -= weight;
    size += std::abs(weight);
  }
  if (std::abs(left) > INT16_MAX || size + std::abs(left) > most_weight) return false;
  weights[static_cast<size_t>(rest)] = static_cast<int16_t>(left);
  return true;
}

/// The number of the entry next to a sample, the lower one of two.
uint32_t search_nearest(std::span<const uint32_t> palette, uint32_t sample) {
  const auto at = std::ranges::lower_bound(palette, sample);
  const auto number = static_cast<uint32_t>(at - palette.begin());
  if (at == palette.begin()) return 0;
  if (at == palette.end()) return number - 1;
  return sample - *(at - 1) <= *at - sample ? number - 1 : number;
}

}  // namespace

void ModelData::derive() {
  if (labels) return;
  half_steps = static_cast<uint32_t>((uint64_t{1} << 15) / step());
  decoding.resize(static_cast<size_t>(contexts()));
  for (size_t c = 0; c < decoding.size(); ++c) {
    starts[c] = page::starts(tables[c]);
    fill_decoding_table(tables[c], wide() ? Wide::escape_bits : Narrow::escape_bits, decoding[c]);
  }
  set_weights(weights);
}

void ModelData::set_weights(const std::array<Weights, most_classes>& fitted) {
  weights = fitted;
  if (!classes.parents) {
    for (size_t row = 0; row < 6; ++row)
      for (size_t i = 0; i < pairs[row].size() && 2 * i < static_cast<size_t>(row_taps(false)); ++i) {
        const Weights& w = weights[3 * row + inner];
        std::array<int16_t, max_side> first, second;
        first.fill(w[row_tap(2 * i)]);
        second.fill(w[row_tap(2 * i + 1)]);
        pairs[row][i] = paired(first, second);
      }
    return;
  }
  for (size_t row = 0; row < rows.size(); ++row)
    for (size_t t = 0; t < tap_count; ++t)
      for (size_t x = 0; x < max_side; ++x)
        rows[row][t][x] =
            weights[4 * row + static_cast<size_t>(classes.along(static_cast<int>(x), max_side))][t];
  for (size_t row = 0; row < rows.size(); ++row)
    for (size_t i = 0; i < pairs[row].size(); ++i)
      pairs[row][i] = paired(rows[row][row_tap(2 * i)], rows[row][row_tap(2 * i + 1)]);
}

void ModelData::set_palette(std::vector<uint32_t> ascending) {
  palette = std::move(ascending);
  numbers.clear();
  if (palette.empty() || palette.back() > 0xffff) return;
  numbers.reserve(size_t{palette.back()} + 1);
  for (uint32_t sample = 0; sample <= palette.back(); ++sample)
    numbers.push_back(static_cast<uint16_t>(search_nearest(palette, sample)));
}

uint32_t ModelData::nearest(uint32_t sample) const {
  if (palette.empty()) return std::min(sample, max_value);
  if (!numbers.empty()) return sample < numbers.size() ? numbers[sample] : max_value;
  return search_nearest(palette, sample);
}

std::optional<uint32_t> ModelData::value_of(std::span<const std::byte> page) const {
  if (page.empty()) return background;
  uint32_t value = 0;
  for (size_t i = 0; i < page.size(); ++i) value |= std::to_integer<uint32_t>(page[i]) << 8 * i;
  if (page.size() != value_bytes() || value > max_value) return std::nullopt;
  return value;
}

bool ModelData::number(std::span<uint32_t> samples) const {
  if (palette.empty()) return true;
  for (uint32_t& sample : samples) {
    const uint32_t at = nearest(sample);
    if (palette[at] != sample) return false;
    sample = at;
  }
  return true;
}

std::vector<std::byte> Model::serialise() const {
  const ModelData& m = *data_;
  BitWriter out;
  if (m.labels) {
    out.put(m.classes.parents ? version_labels_with_parents : version_labels, 8);
    out.put(m.max_value, 16);
    out.put(m.background, 16);
    write_decision_numbers(out, m.labels->numbers);
    return out.take();
  }
  out.put(m.classes.parents ? version_with_parents : version_alone, 8);
  out.put(m.palette.empty() ? 0 : 1, 1);
  out.put(m.max_value, 32);
  out.golomb(m.max_error, 0);
  out.golomb(m.background, 8);
  uint32_t before = 0;
  for (size_t i = 0; i < m.palette.size(); ++i) {
    out.golomb(m.palette[i] - before, palette_golomb);
    before = m.palette[i] + 1;
  }
  for (int c = 0; c < m.classes.count(); ++c)
    write_weights(out, m.weights[static_cast<size_t>(c)], m.classes, c);
  const Frequencies* previous = nullptr;
  for (const Frequencies& table : std::span(m.tables).first(static_cast<size_t>(m.contexts()))) {
    const bool same = previous && table == *previous;
    out.put(same ? 1 : 0, 1);
    if (!same) write_frequencies(out, table);
    previous = &table;
  }
  return out.take();
}

Result<Model> Model::parse(std::span<const std::byte> bytes) {
  BitReader in(bytes);
  const uint32_t version = in.get(8);
  if (version < version_alone || version > version_labels_with_parents)
    return wrong("unknown version: expected 1 to 4");
  auto made = std::make_shared<ModelData>();
  ModelData& m = *made;
  if (version >= version_labels) {
    m.classes.parents = version == version_labels_with_parents;
    m.max_value = in.get(16);
    m.background = in.get(16);
    if (m.background > m.max_value) return wrong("background: expected at most the greatest sample");
    LabelTables& tables = m.labels.emplace();
    tables.parents = m.classes.parents;
    tables.max_value = m.max_value;
    tables.numbers.resize(label_contexts(tables.parents));
    if (!read_decision_numbers(in, tables.numbers))
      return wrong("contexts: expected known ones from 1 to 31");
    if (!in.at_end()) return wrong("expected it to end with its last context");
    return Model(std::move(made));
  }
  const bool has_palette = in.get(1) != 0;
  m.classes.parents = version == version_with_parents;
  m.max_value = in.get(32);
  m.max_error = in.golomb(0);
  m.background = in.golomb(8);
  if (in.overrun()) return wrong("cut off: expected its bounds");
  if (m.max_error > most_error) return wrong("error bound: expected at most 2^31 - 2");
  if (m.background > m.max_value) return wrong("background: expected at most the greatest sample");
  if (has_palette) {
    if (m.max_error != 0 || m.max_value >= most_palette)
      return wrong("palette: expected at most 262144 entries, and no error");
    uint64_t next = 0;
    std::vector<uint32_t> palette;
    for (uint32_t i = 0; i <= m.max_value; ++i) {
      const uint64_t value = next + in.golomb(palette_golomb);
      if (in.overrun() || value > UINT32_MAX) return wrong("palette: expected ascending values of 32 bits");
      palette.push_back(static_cast<uint32_t>(value));
      next = value + 1;
    }
    m.set_palette(std::move(palette));
  }
  for (int c = 0; c < m.classes.count(); ++c)
    if (!read_weights(in, m.weights[static_cast<size_t>(c)], m.classes, c) || in.overrun())
      return wrong("weights: expected a sum of magnitudes below 16");
  for (size_t c = 0; c < static_cast<size_t>(m.contexts()); ++c) {
    const bool same = in.get(1) != 0;
    if (same && c == 0) return wrong("tables: expected one before that is the same");
    if (same)
      m.tables[c] = m.tables[c - 1];
    else if (!read_frequencies(in, m.tables[c]))
      return wrong("table of probabilities: expected parts of 2048 that leave some to the escape");
  }
  if (!in.at_end()) return wrong("expected it to end with its last table");
  m.derive();
  return Model(std::move(made));
}

uint32_t Model::max_error() const {
  return data_->max_error;
}
bool Model::has_parents() const {
  return data_->classes.parents;
}
bool Model::has_labels() const {
  return data_->labels.has_value();
}
uint32_t Model::max_sample() const {
  return data_->palette.empty() ? data_->max_value : data_->palette.back();
}
size_t Model::value_bytes() const {
  return data_->value_bytes();
}
uint32_t Model::background() const {
  return data_->palette.empty() ? data_->background : data_->palette[data_->background];
}

}  // namespace voxkit::page
