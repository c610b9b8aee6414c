#include <algorithm>
#include <bit>
#include <functional>
#include <limits>
#include <map>
#include <mutex>

#include "formats/parallel.h"
#include "libpage/fit.h"
#include "libpage/page.h"
#include "libpage/parent_rows.h"
#include "libpage/residuals.h"

namespace voxkit::page {
namespace {

using Counts = std::array<uint64_t, symbol_count>;

/// With void voxels: what these become settles slowly.
constexpr int most_masked_rounds = 12;

/// Whether values or numbers of a palette are better is tried with so many.
constexpr size_t pages_to_choose_by = 64;

/// 256 log2(n), rounded down, of whole numbers alone: the same everywhere. 0 of 0.
uint64_t log2_256(uint64_t n) {
  if (n == 0) return 0;
  const auto whole = static_cast<uint64_t>(std::bit_width(n)) - 1;
  uint64_t mantissa = whole > 31 ? n >> (whole - 31) : n << (31 - whole), result = whole;
  for (int bit = 0; bit < 8; ++bit) {
    mantissa = mantissa * mantissa >> 31;
    const uint64_t carry = mantissa >> 32;
    mantissa >>= carry;
    result = 2 * result + carry;
  }
  return result;
}

/// A page as numbers of the model.
struct Sampled {
  Extent extent;
  std::vector<uint32_t> values;
  std::vector<uint32_t> decoded;
  Parent<uint32_t> parent{};        ///< samples
  std::vector<uint32_t> parents{};  ///< as numbers
  const Mask* mask = nullptr;
};

bool is_constant(const ModelData& model, const Sampled& page) {
  const auto [least, greatest] = std::ranges::minmax(page.values);
  return greatest - least <= 2 * uint64_t{model.max_error};
}

/// The value that most pages of one value have; else the most frequent of first voxels.
uint32_t common_value(const ModelData& model, const std::vector<Sampled>& pages) {
  std::map<uint32_t, uint64_t> constants, firsts;
  for (const Sampled& page : pages) {
    const auto [least, greatest] = std::ranges::minmax(page.values);
    if (greatest - least <= 2 * uint64_t{model.max_error}) ++constants[least + (greatest - least) / 2];
    ++firsts[page.values[0]];
  }
  const auto& votes = constants.empty() ? firsts : constants;
  uint32_t best = 0;
  uint64_t most = 0;
  for (const auto& [value, count] : votes)
    if (count > most) {
      best = value;
      most = count;
    }
  return best;
}

/// Codes the pages with the weights that the model has: what their symbols are, and what is decoded.
Result<std::vector<Counts>> count_symbols(const ModelData& model, std::vector<Sampled>& pages,
                                          const Context& ctx) {
  std::vector<Counts> counts(static_cast<size_t>(model.contexts()));
  std::mutex mutex;
  constexpr size_t pages_at_once = 32;
  const size_t parts = (pages.size() + pages_at_once - 1) / pages_at_once;
  VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(parts), [&](int64_t i) -> Status {
    const size_t first = static_cast<size_t>(i) * pages_at_once;
    std::vector<Counts> own(counts.size());
    Residuals residuals;
    for (Sampled& page : std::span(pages).subspan(first, std::min(pages_at_once, pages.size() - first))) {
      find_residuals(model, page.values, page.extent, page.parent, page.mask, residuals, page.decoded.data());
      for (size_t r = 0; r < static_cast<size_t>(residuals.count); ++r)
        ++own[residuals.context[r]][symbol_of(residuals.folded[r])];
    }
    const std::lock_guard lock(mutex);
    for (size_t c = 0; c < counts.size(); ++c)
      for (size_t s = 0; s < symbol_count; ++s) counts[c][s] += own[c][s];
    return {};
  }));
  return counts;
}

/// Bits that symbols take with the best tables, without these, in parts of 256.
uint64_t cost(const std::vector<Counts>& counts) {
  static constexpr auto bins = make_bins(32);
  uint64_t bits = 0;
  for (const Counts& table : counts) {
    uint64_t total = 0;
    for (uint32_t s = 0; s < symbol_count; ++s) {
      total += table[s];
      bits += table[s] * (256 * bins[s].raw_bits - log2_256(table[s]));
    }
    bits += total * log2_256(total);
  }
  return bits;
}

/// Weights and tables. What is predicted from is what the decoder has, which depends on the weights where
/// there is a bound or void: they are fitted again to what those before led to, and the best are kept.
Status fit(ModelData& model, std::vector<Sampled>& pages, int most_rounds, const Context& ctx) {
  model.background = common_value(model, pages);
  std::erase_if(pages, [&](const Sampled& page) { return is_constant(model, page); });
  const double e = model.max_error;
  std::vector<FitPage> sources;
  for (Sampled& page : pages) {
    page.decoded = page.values;
    Parent<uint32_t> parent = page.parent;
    for (const uint32_t sample : parent.samples) page.parents.push_back(model.nearest(sample));
    parent.samples = page.parents;
    sources.push_back({page.extent, page.values, page.decoded, parent, page.mask});
  }
  model.derive();
  Fit equations(model.classes, model.max_value, model.max_error);
  double noise = (4 * e * e + 4 * e) / 12;
  std::array<Weights, most_classes> best{};
  std::vector<Counts> best_counts;
  uint64_t least_cost = 0;
  const bool masked = std::ranges::any_of(pages, [](const Sampled& page) { return page.mask != nullptr; });
  const int rounds = masked ? most_masked_rounds : model.max_error != 0 ? most_rounds : 1;
  for (int round = 0; round < rounds; ++round) {
    VOX_CHECK(equations.add(sources, noise, ctx));
    noise = 0;
    model.set_weights(equations.weights());
    VOX_TRY(std::vector<Counts> counts, count_symbols(model, pages, ctx));
    const uint64_t round_cost = cost(counts);
    const bool settled = masked && round != 0 && round_cost + least_cost / 256 > least_cost;
    if (round == 0 || round_cost < least_cost) {
      least_cost = round_cost;
      best = model.weights;
      best_counts = std::move(counts);
    }
    if (settled) break;
  }
  model.set_weights(best);
  for (size_t c = 0; c < best_counts.size(); ++c) model.tables[c] = normalise(best_counts[c]);
  model.derive();
  return {};
}

}  // namespace

template <class T>
void ModelBuilder::keep(std::span<const T> samples, Extent extent, const Parent<T>& parent,
                        const Mask* mask) {
  if (mask && mask->empty()) return;
  if (mask && extent.valid() && *mask == full_mask(extent)) mask = nullptr;
  pages_.push_back({extent,
                    {samples.begin(), samples.end()},
                    {parent.samples.begin(), parent.samples.end()},
                    {{}, parent.extent, parent.x, parent.y, parent.z},
                    mask ? std::optional(*mask) : std::nullopt});
  if (mask && extent.valid() && samples.size() == static_cast<size_t>(extent.voxels()))
    fill_void(*mask, extent, std::span(pages_.back().samples));
  type_max_ = std::max<uint32_t>(type_max_, std::numeric_limits<T>::max());
}
void ModelBuilder::add(std::span<const uint8_t> samples, Extent extent, const Parent<uint8_t>& parent,
                       const Mask* mask) {
  keep(samples, extent, parent, mask);
}
void ModelBuilder::add(std::span<const uint16_t> samples, Extent extent, const Parent<uint16_t>& parent,
                       const Mask* mask) {
  keep(samples, extent, parent, mask);
}
void ModelBuilder::add(std::span<const uint32_t> samples, Extent extent, const Parent<uint32_t>& parent,
                       const Mask* mask) {
  keep(samples, extent, parent, mask);
}

namespace {

Parent<uint32_t> parent_of(const ModelBuilder::Page& page) {
  Parent<uint32_t> parent = page.parent;
  parent.samples = page.parents;
  return parent;
}

/// Bytes of some pages.
Result<size_t> size_of(const Model& model, std::span<const ModelBuilder::Page* const> pages) {
  std::vector<std::byte> bytes;
  for (const ModelBuilder::Page* page : pages)
    VOX_CHECK(encode_page(model, std::span<const uint32_t>(page->samples), page->extent, bytes,
                          parent_of(*page), {}, page->mask ? &*page->mask : nullptr));
  return bytes.size();
}

/// Every so many, of which there are at most `most`.
std::vector<const ModelBuilder::Page*> some_of(std::span<const ModelBuilder::Page> pages, size_t most) {
  std::vector<const ModelBuilder::Page*> some;
  if (pages.empty()) return some;
  const size_t step = pages.size() / most + (pages.size() % most != 0 ? 1 : 0);
  for (size_t i = 0; i < pages.size(); i += step) some.push_back(&pages[i]);
  return some;
}

bool counts_up_from_zero(const std::vector<uint32_t>& values) {
  return values.empty() || values.back() == values.size() - 1;
}

}  // namespace

Result<Model> ModelBuilder::build(const ModelOptions& options, const Context& ctx) const {
  const std::vector<uint32_t>& values = options.values;
  const uint32_t max_sample = pages_.empty() ? options.max_sample : std::min(options.max_sample, type_max_);
  if (options.max_error > most_error) return bad_usage("page model: expected an error bound below 2^31 - 1");
  if (values.size() > most_palette ||
      std::ranges::adjacent_find(values, std::ranges::greater_equal()) != values.end())
    return bad_usage("page model: expected at most 262144 values, ascending");
  if (!values.empty() && values.back() > max_sample) return bad_usage("page model: a value above max_sample");
  for (const Page& page : pages_) {
    if (!page.extent.valid() || page.samples.size() != static_cast<size_t>(page.extent.voxels()))
      return bad_usage("page model: a page of another number of samples than its extent");
    if (options.parents && !covers(parent_of(page), page.extent))
      return bad_usage("page model: a page without the parents of all its voxels");
    if (*std::ranges::max_element(page.samples) > max_sample)
      return bad_usage("page model: a sample above max_sample");
  }
  const auto fitted = [&](bool palette, std::span<const Page* const> some) -> Result<Model> {
    auto made = std::make_shared<ModelData>();
    made->max_error = options.max_error;
    made->max_value = palette ? static_cast<uint32_t>(values.size() - 1) : max_sample;
    if (palette) made->set_palette(values);
    made->classes.parents = options.parents;
    std::vector<Sampled> pages;
    for (const Page* page : some) {
      pages.push_back(
          {page->extent, page->samples, {}, parent_of(*page), {}, page->mask ? &*page->mask : nullptr});
      if (!made->number(pages.back().values))
        return bad_usage("page model: a sample that is none of the values");
    }
    VOX_CHECK(fit(*made, pages, options.rounds, ctx));
    return Model(std::move(made));
  };
  const std::vector<const Page*> all = some_of(pages_, pages_.size());
  // Bytes of models and of all pages, as some pages, which models are made for, tell.
  const std::vector<const Page*> some = some_of(pages_, pages_to_choose_by);
  const auto size_with = [&](const Model& model, std::span<const Page* const> pages) -> Result<size_t> {
    VOX_TRY(const size_t bytes, size_of(model, pages));
    return model.serialise().size() + bytes * all.size() / std::max<size_t>(pages.size(), 1);
  };
  bool palette = false;
  if (options.max_error == 0 && !counts_up_from_zero(values)) {
    VOX_TRY(const Model as_they_are, fitted(false, some));
    VOX_TRY(const Model numbered, fitted(true, some));
    VOX_TRY(const size_t size, size_with(as_they_are, some));
    VOX_TRY(const size_t numbered_size, size_with(numbered, some));
    palette = numbered_size < size;
  }
  VOX_TRY(Model best, fitted(palette, all));
  if (options.max_error != 0 || !options.labels || max_sample > 0xffff) return best;
  Model labels = named(options.parents, max_sample);
  VOX_TRY(const size_t size, size_with(best, all));
  VOX_TRY(const size_t labels_size, size_with(labels, all));
  return labels_size < size ? labels : best;
}

Model ModelBuilder::named(bool parents, uint32_t max_sample) const {
  auto made = std::make_shared<ModelData>();
  made->classes.parents = parents;
  made->max_value = max_sample;
  LabelTables& tables = made->labels.emplace();
  tables.parents = parents;
  tables.max_value = max_sample;
  std::vector<DecisionCounts> counts(label_contexts(parents));
  std::vector<Sampled> pages;
  for (const Page& page : pages_) pages.push_back({page.extent, page.samples, {}, parent_of(page)});
  made->background = common_value(*made, pages);
  for (const Sampled& page : pages)
    if (!is_constant(*made, page)) count_labels(tables, page.values, page.extent, page.parent, counts);
  for (const DecisionCounts& count : counts) tables.numbers.push_back(decision_number(count));
  return Model(std::move(made));
}

}  // namespace voxkit::page
