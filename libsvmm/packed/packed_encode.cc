// The encoder: a pass that surveys values and makes the coarser levels, then each level, the coarsest first,
// page by page.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "formats/copy.h"
#include "formats/full_scale.h"
#include "formats/mapped_file.h"
#include "formats/parallel.h"
#include "formats/reservation.h"
#include "formats/volume_chunks.h"
#include "libpage/page.h"
#include "libsvmm/packed/color_encode.h"
#include "libsvmm/packed/halve.h"
#include "libsvmm/packed/indexed_colors.h"
#include "libsvmm/packed/packed_layout.h"
#include "libsvmm/packed/page_codes.h"
#include "libsvmm/packed/page_ranges.h"
#include "libsvmm/packed/raster.h"
#include "libsvmm/packed/survey.h"
#include "libsvmm/packed/target.h"

namespace voxkit::svmm {
namespace {

/// How far voxels of coarser levels of 8 bits may be from means: this saves up to half of what levels of
/// clean volumes cost.
constexpr uint32_t bound_of_coarse_bytes = 2;
/// Of floats without a bound, in codes: a 512th to a 1024th of each.
constexpr uint32_t bound_of_coarse_floats = 1 << 14;
/// Floats of fewer values, such as masks, have exact means.
constexpr size_t least_values_of_coarse_floats = 1024;
/// Of a level, to learn what a bound leads to: fitting takes much longer than coding.
constexpr uint64_t fewest_fitted = 16, most_fitted = 64, share_fitted = 8;
constexpr int sampling_rounds = 2;
/// Of level 0, at most, what its ranges take.
constexpr uint64_t share_of_ranges = 64;
/// Of a target: two are the rule.
constexpr int most_attempts = 4;

class Encoder {
 public:
  Encoder(VolumeSource& source, const PackedOptions& options, Context& ctx)
      : source_(source), info_(source.info()), written_(info_), ctx_(ctx), survey_(info_.format) {
    params_.page_side = options.page_side;
    params_.levels = options.levels ? level_count(info_.dims, options.page_side) : 1;
  }
  /// `numbers` of the colors of a volume of that info.
  Encoder(VolumeSource& numbers, const VolumeInfo& info, const std::vector<Voxel>& colors,
          const PackedOptions& options, Context& ctx)
      : Encoder(numbers, options, ctx) {
    written_ = info;
    params_.map.kind = CodeKind::indexed;
    params_.map.colors = std::make_shared<const std::vector<Voxel>>(colors);
    params_.opaque =
        info.format == VoxelFormat::rgba32 &&
        std::ranges::all_of(colors, [](const Voxel& color) { return color.bytes[3] == std::byte{255}; });
  }

  Result<PackedParams> run(double max_error, const ByteSink& sink) {
    VOX_CHECK(prepare());
    VOX_CHECK(write(max_error, sink));
    return params_;
  }

  /// The bound is found by samples; the whole volume says how far these are off.
  Result<PackedParams> run(const PackedTarget& target, const ByteSink& sink) {
    VOX_CHECK(prepare());
    const bool floats = info_.format == VoxelFormat::float32, psnr = target.kind == PackedTarget::Kind::psnr;
    const std::vector<uint32_t> values = floats ? std::vector<uint32_t>() : survey_.values();
    const ValueRange range =
        floats ? survey_.range()
               : ValueRange{static_cast<double>(values.front()), static_cast<double>(values.back())};
    const double extent = range.hi - range.lo, peak = full_scale(info_, range);
    const auto voxels = static_cast<double>(*checked_voxels(info_.dims));
    const auto measure = [&](const Written& w) {
      return psnr ? 10 * std::log10(peak * peak * voxels / w.squared_error) : 8 * w.bytes / voxels;
    };
    // Errors are spread evenly within the bound where it is small.
    const double error = std::sqrt(3.0) * peak * std::pow(10, -target.value / 20);
    BoundSearch search(target, !floats, floats ? ValueMap::least_error(range) : 1, extent);
    std::optional<double> bound = search.next(psnr ? error : 0);
    while (bound) {
      VOX_TRY(const Written sampled, sample(*bound, psnr));
      search.add(*bound, measure(sampled));
      bound = search.next(std::ldexp(extent, -static_cast<int>(target.value) - 1));
    }
    struct Attempt {
      double bound = 0, measured = 0;
      PackedParams params;
      std::unique_ptr<TemporaryFile> file = std::make_unique<TemporaryFile>("the compressed volume");
    };
    std::optional<Attempt> kept;
    std::vector<double> bounds;
    for (int i = 0; i < most_attempts; ++i) {
      Attempt next;
      next.bound = search.best();
      if (std::ranges::find(bounds, next.bound) != bounds.end()) break;
      bounds.push_back(next.bound);
      VOX_TRY(const Written written, write(next.bound, [&](auto bytes) { return next.file->write(bytes); }));
      next.measured = measure(written);
      next.params = params_;
      search.correct(next.bound, next.measured);
      const bool done = search.near(next.measured);
      if (!kept || search.better(next.measured, kept->measured)) kept = std::move(next);
      if (done) break;
    }
    params_ = kept->params;
    ctx_.note(fmt::format(
        "greatest error {:.6g}: {:.6g} {}{}", params_.max_error, kept->measured, psnr ? "dB" : "bits a voxel",
        search.near(kept->measured) ? std::string()
                                    : fmt::format(", where {:.6g} was asked for", target.value)));
    VOX_TRY(const auto file, kept->file->map());
    VOX_CHECK(sink(file->bytes()));
    return params_;
  }

 private:
  /// What came of a bound.
  struct Written {
    double bytes = 0, squared_error = 0;
  };

  /// Encodes the volume within a bound. After the first pass, any number of times.
  Result<Written> write(double max_error, const ByteSink& sink) {
    decoded_.reset();
    squared_error_ = 0;
    ranges_.clear();
    coded_bytes_ = 0;
    VOX_CHECK(set_bound(max_error));
    if (params_.map.kind == CodeKind::steps) VOX_CHECK(choose_map());
    ContainerWriter container(sink, Codec::svmm, container_version_for(written_), 0, *ctx_.memory);
    VOX_CHECK(add_volume_info(container, written_));
    VOX_CHECK(container.add(packed_kind, 0, 0, pack_params(params_)));
    if (params_.map.colors) {
      std::vector<std::byte> table;
      for (const Voxel& color : *params_.map.colors)
        table.insert(table.end(), color.bytes.begin(), color.bytes.begin() + voxel_bytes(written_.format));
      VOX_CHECK(container.add(color_table_kind, 0, 0, table));
    }
    // The coarsest level has no parents; the model of those between is fitted to the largest of them.
    const int top = params_.levels - 1;
    std::optional<page::Model> model;
    for (int level = top; level >= 0; --level) {
      if (level == top || level == top - 1 || level == 0) {
        const int fitted = level == 0 || level == top ? level : 1;
        VOX_TRY(model, fit(fitted));
        VOX_CHECK(container.add(model_kind, static_cast<uint32_t>(fitted), 0, model->serialise()));
      }
      VOX_CHECK(encode(level, *model, container));
      if (level == 0 && !has_no_means(info_)) {
        const std::vector<std::byte> ranges = pack_ranges(ranges_);
        if (share_of_ranges * ranges.size() <= coded_bytes_)
          VOX_CHECK(container.add(ranges_kind, 0, 0, ranges));
      }
      // What is there by now is a file of the coarser levels.
      VOX_CHECK(level == 0 ? container.finish() : container.checkpoint());
    }
    return Written{static_cast<double>(container.bytes_written()), squared_error_};
  }

  /// About what would come of a bound; with `only_error` no bytes.
  Result<Written> sample(double max_error, bool only_error) {
    decoded_.reset();
    VOX_CHECK(set_bound(max_error));
    Written all;
    if (only_error && max_error == 0) return all;
    if (only_error && info_.format == VoxelFormat::float32) {
      VOX_TRY(all.squared_error, error_of_steps());
      return all;
    }
    for (int level = 0; level < std::min(params_.levels, only_error ? 1 : 2); ++level) {
      const uint64_t pages = grid(level).pages();
      VOX_TRY(const page::Model model,
              fit(level, std::clamp(pages / share_fitted, fewest_fitted, most_fitted), sampling_rounds));
      VOX_TRY(const Sampled few, encode_samples(level, model));
      const Index3 dims = grid(level).dims;
      const double times = static_cast<double>(dims.x * dims.y * dims.z) / few.voxels;
      // Levels above the second have a seventh of its voxels.
      const double levels = level > 0 && level + 1 < params_.levels ? 8.0 / 7 : 1;
      all.bytes +=
          static_cast<double>(model.serialise().size()) + static_cast<double>(few.bytes) * times * levels;
      if (level == 0) all.squared_error = few.squared_error * times;
    }
    return all;
  }

  VolumeSource& source(int level) { return level == 0 ? source_ : *coarser_[static_cast<size_t>(level - 1)]; }
  const Raster& raster(int level) const { return level == 0 ? all_values_ : raster_; }
  /// Of the codes of a level, and of integers of their samples.
  uint32_t bound(int level) const {
    if (info_.format == VoxelFormat::float32) return level > 0 && coarse_floats_ ? bound_of_coarse_floats : 0;
    const auto bound = static_cast<uint32_t>(params_.max_error);
    if (level == 0) return bound;
    if (!raster_.empty()) return 0;
    return coarse_bytes_ ? std::max(bound, bound_of_coarse_bytes) : bound;
  }
  PageGrid grid(int level) { return {source(level).info().dims, params_.page_side}; }

  /// The first pass.
  Status prepare() {
    const auto look = [&](ConstVoxelSpan voxels, Index3 size) { survey_.look(voxels, size); };
    if (params_.levels == 1) {
      VOX_CHECK(visit_voxels(
          source_, [&](ConstVoxelSpan voxels, Index3 size, int64_t) { look(voxels, size); }, ctx_));
    } else {
      for (int level = 1; level < params_.levels; ++level) {
        const auto visit = level == 1 ? std::function<void(ConstVoxelSpan, Index3)>(look) : nullptr;
        VOX_TRY(auto next, halved(source(level - 1), visit, ctx_));
        coarser_.push_back(std::move(next));
      }
    }
    return {};
  }

  /// What follows from a bound and the values that there are.
  Status set_bound(double max_error) {
    params_.max_error = max_error;
    if (info_.format == VoxelFormat::float32) {
      params_.map = ValueMap::for_floats(survey_.range(), max_error);
      coarse_floats_ = false;
      if (params_.map.kind == CodeKind::ordered) {
        params_.max_error = 0;
        const auto values = survey_.values();
        coarse_floats_ =
            survey_.finite() && (values.empty() || values.size() > least_values_of_coarse_floats);
      }
      return params_.map.kind == CodeKind::steps ? place_steps() : Status();
    }
    params_.max_error = std::floor(max_error);
    raster_ = {};
    coarse_bytes_ = false;
    if (has_no_means(info_) || info_.fill) return {};
    const auto values = survey_.values();
    Raster raster(values);
    if (raster.step() > 2 * params_.max_error) raster_ = std::move(raster);
    coarse_bytes_ =
        info_.format == VoxelFormat::density8 && !values.empty() && values.back() - values.front() >= 128;
    return {};
  }

  /// Steps from the least value or through 0: volumes are full of one of these, as a rule, or of values
  /// around it, and have much smaller errors where it is a step itself.
  Status place_steps() {
    const ValueMap from_least = params_.map;
    VOX_TRY(const double error_from_least, error_of_steps());
    params_.map = from_least.through_zero();
    VOX_TRY(const double error_through_zero, error_of_steps());
    if (!(error_through_zero < error_from_least)) params_.map = from_least;
    return {};
  }

  /// About what is lost of floats, whose codes are kept as they are: nothing but steps changes a voxel.
  Result<double> error_of_steps() {
    double error = 0, voxels = 0;
    VOX_CHECK(sample_pages(0, most_sampled_pages,
                           [&](const PageReader& reader, uint64_t, auto codes, page::Extent) -> Status {
                             error += reader.squared_error();
                             voxels += static_cast<double>(codes.size());
                             return {};
                           }));
    return error * static_cast<double>(*checked_voxels(info_.dims)) / voxels;
  }

  /// Of floats: steps within the bound, or, where these take more bytes, all bits.
  Status choose_map() {
    const ValueMap steps = params_.map, ordered{CodeKind::ordered, 0, 1, {}};
    params_.map = ordered;
    VOX_TRY(const page::Model exact, fit(0));
    VOX_TRY(const Sampled all_bits, encode_samples(0, exact));
    params_.map = steps;
    VOX_TRY(const page::Model bounded, fit(0));
    VOX_TRY(const Sampled in_steps, encode_samples(0, bounded));
    if (all_bits.bytes + exact.serialise().size() >= in_steps.bytes + bounded.serialise().size()) return {};
    params_.map = ordered;
    params_.max_error = 0;
    return {};
  }

  /// Up to `most` pages of a level, that models are fitted to: calls take(reader, number, codes, extent).
  template <class Take>
  Status sample_pages(int level, uint64_t most, const Take& take) {
    const PageGrid pages = grid(level);
    PageReader reader(source(level), pages, params_, raster(level));
    for (const uint64_t number : spread_pages(pages.pages(), most)) {
      VOX_CHECK(reader.read(number, number + 1, [&](uint64_t page, auto codes, page::Extent extent) {
        return take(reader, page, codes, extent);
      }));
      // Rows of a page lie far apart: of mapped files each is a page of memory.
      source(level).release(pages.box(number).lo.z, pages.box(number).hi.z);
    }
    return {};
  }
  struct Sampled {
    uint64_t bytes = 0;  ///< without the model
    double squared_error = 0, voxels = 0;
  };
  Result<Sampled> encode_samples(int level, const page::Model& model) {
    Sampled sampled;
    std::vector<std::byte> bytes;
    VOX_CHECK(sample_pages(
        level, most_sampled_pages,
        [&](const PageReader& reader, uint64_t number, auto codes, page::Extent extent) -> Status {
          using T = std::remove_const_t<typename decltype(codes)::element_type>;
          std::vector<T> codes_above;
          page::Parent<T> parent;
          if (model.has_parents()) {
            VOX_TRY(parent, parent_of(level, number, codes_above));
          }
          std::array<T, page::max_voxels> room;
          const std::span<T> decoded(room.data(), codes.size());
          VOX_CHECK(page::encode_page(model, codes, extent, bytes, parent, decoded));
          sampled.squared_error += squared_error<T>(reader, codes, decoded);
          sampled.voxels += static_cast<double>(codes.size());
          return {};
        }));
    sampled.bytes = bytes.size();
    return sampled;
  }

  /// The parents of a page: as they were decoded, or, where that is still to come, about so, in `room`.
  template <class T>
  Result<page::Parent<T>> parent_of(int level, uint64_t number, std::vector<T>& room) {
    const Index3 child = grid(level).index(number);
    if (decoded_ && decoded_->level() == level + 1) return decoded_->parent_of<T>(child);
    const PageGrid above = grid(level + 1);
    const uint64_t parent_number = above.number(child / int64_t{2});
    const uint32_t bound_above = bound(level + 1);
    const uint64_t step = 2 * uint64_t{bound_above} + 1;
    VOX_CHECK(PageReader(source(level + 1), above, params_, raster(level + 1))
                  .read(parent_number, parent_number + 1, [&](uint64_t, auto codes, page::Extent) -> Status {
                    for (const auto code : codes)
                      room.push_back(static_cast<T>(std::min<uint64_t>(
                          (uint64_t{code} + bound_above) / step * step, std::numeric_limits<T>::max())));
                    return {};
                  }));
    page::Parent<T> parent = placed<T>(child, above);
    parent.samples = room;
    return parent;
  }

  Result<page::Model> fit(int level, uint64_t most_pages = most_sampled_pages,
                          int rounds = page::ModelOptions().rounds) {
    page::ModelBuilder builder;
    VOX_TRY(const Reservation memory,
            Reservation::take(2 * most_sampled_pages * page::max_voxels * sizeof(uint32_t),
                              "pages to fit a model to", ctx_));
    page::ModelOptions options;
    options.parents = level + 1 < params_.levels;
    options.rounds = rounds;
    VOX_CHECK(
        sample_pages(level, most_pages,
                     [&](const PageReader&, uint64_t number, auto codes, page::Extent extent) -> Status {
                       using T = std::remove_const_t<typename decltype(codes)::element_type>;
                       std::vector<T> room;
                       page::Parent<T> parent;
                       if (options.parents) {
                         VOX_TRY(parent, parent_of(level, number, room));
                       }
                       builder.add(codes, extent, parent);
                       return {};
                     }));
    if (info_.format == VoxelFormat::float32) {
      const bool steps = params_.map.kind == CodeKind::steps;
      options.max_error = bound(level);
      options.max_sample = steps ? params_.map.code(static_cast<float>(survey_.range().hi)) : 0xffffffff;
      if (!steps && level == 0) options.values = survey_.values();
    } else {
      options.max_error = bound(level);
      const auto values = survey_.values();
      options.max_sample = values.empty() ? 0 : values.back();
      // Means of voxels may be other values.
      const bool same_values = level == 0 || has_no_means(info_);
      if (options.max_error == 0 && same_values) options.values = values;
      options.labels = has_no_means(info_);
      if (level > 0 && !raster_.empty()) options.values = raster_.values();
      // Values that are few beside the steps of the bound may take fewer bytes than these.
      const uint64_t steps = options.max_sample / (2 * uint64_t{options.max_error} + 1) + 1;
      if (options.max_error > 0 && values.size() <= 2 * steps && level == 0) {
        page::ModelOptions exact;
        exact.parents = options.parents;
        exact.max_sample = options.max_sample;
        exact.values = values;
        VOX_TRY(const page::Model bounded, builder.build(options, ctx_));
        VOX_TRY(const page::Model lossless, builder.build(exact, ctx_));
        VOX_TRY(const Sampled with_bound, encode_samples(level, bounded));
        VOX_TRY(const Sampled without, encode_samples(level, lossless));
        const bool smaller =
            without.bytes + lossless.serialise().size() < with_bound.bytes + bounded.serialise().size();
        return smaller ? lossless : bounded;
      }
    }
    return builder.build(options, ctx_);
  }

  Status encode(int level, const page::Model& model, ContainerWriter& container) {
    const PageGrid pages = grid(level);
    auto decoded = std::make_unique<DecodedLevel>(level, pages, code_bytes(info_.format));
    std::vector<std::byte> batch;  // of decoded pages
    const auto batch_parts = static_cast<uint64_t>(2 * ctx_.threads);
    for (uint64_t part = 0; part < pages.parts(); part += batch_parts) {
      const uint64_t end_part = std::min(part + batch_parts, pages.parts()),
                     first = part * pages.pages_a_part(),
                     last = std::min(end_part * pages.pages_a_part(), pages.pages());
      std::vector<std::vector<std::byte>> encoded(last - first);
      std::vector<double> errors(last - first);  // squared, of level 0
      std::vector<CodeRange> ranges(level == 0 ? last - first : 0);
      const auto runs = runs_of(pages, first, last);
      if (level > 0) batch.resize((last - first) * decoded->page_bytes());
      VOX_CHECK(parallel_for(ctx_, static_cast<int64_t>(runs.size()), [&](int64_t i) -> Status {
        PageReader reader(source(level), pages, params_, raster(level));
        const auto [begin, end] = runs[static_cast<size_t>(i)];
        return reader.read(begin, end, [&](uint64_t number, auto codes, page::Extent extent) {
          using T = std::remove_const_t<typename decltype(codes)::element_type>;
          page::Parent<T> parent;
          if (model.has_parents()) parent = decoded_->parent_of<T>(pages.index(number));
          std::array<T, page::max_voxels> room;
          T* const kept = level == 0
                              ? room.data()
                              : reinterpret_cast<T*>(batch.data() + (number - first) * decoded->page_bytes());
          const std::span<T> again(kept, codes.size());
          const Status status =
              page::encode_page(model, codes, extent, encoded[number - first], parent, again);
          if (level == 0) {
            errors[number - first] = squared_error<T>(reader, codes, again);
            ranges[number - first] = finite_range(std::span<const T>(again), params_.map);
          }
          return status;
        });
      }));
      for (const double error : errors) squared_error_ += error;
      for (size_t i = 0; i < ranges.size(); ++i) {
        if (encoded[i].size() > model.value_bytes()) ranges_.push_back(ranges[i]);
        coded_bytes_ += encoded[i].size();
      }
      if (level > 0) VOX_CHECK(decoded->write(batch));
      std::span<const std::vector<std::byte>> left = encoded;
      for (uint64_t p = part; p < end_part; ++p) {
        const uint64_t count = pages.pages_of(p);
        VOX_CHECK(container.add(pages_kind, static_cast<uint32_t>(level), p, pack_part(left.first(count))));
        left = left.subspan(count);
      }
      source(level).release(pages.box(first).lo.z, pages.box(last - 1).lo.z);
      if (model.has_parents()) decoded_->release(pages.index(last - 1).z / 2);
      if (level == 0) ctx_.progress(static_cast<double>(last) / static_cast<double>(pages.pages()));
    }
    if (level > 0) VOX_CHECK(decoded->finish());
    decoded_ = std::move(decoded);
    return {};
  }

  VolumeSource& source_;
  const VolumeInfo info_;
  VolumeInfo written_;  ///< what the file is one of
  Context& ctx_;
  PackedParams params_;
  Survey survey_;
  const Raster all_values_;
  Raster raster_;               ///< of coarser levels
  bool coarse_bytes_ = false;   ///< whether these are of 8 bits, and need not be exact
  bool coarse_floats_ = false;  ///< whether they are floats, and need not be exact
  std::vector<std::unique_ptr<VolumeSource>> coarser_;
  std::unique_ptr<DecodedLevel> decoded_;  ///< the level above that which comes next
  double squared_error_ = 0;               ///< of level 0
  std::vector<CodeRange> ranges_;          ///< of the coded pages of level 0
  uint64_t coded_bytes_ = 0;               ///< of the pages of level 0
};

/// Few colors are coded both ways, as names and by their channels, and the smaller file is kept.
Result<PackedParams> encode_colors(VolumeSource& source, const PackedOptions& options, const ByteSink& sink,
                                   Context& ctx) {
  VOX_TRY(const auto colors, few_colors(source, ctx));
  if (!colors || colors->empty()) return encode_packed_colors(source, options, sink, ctx);
  struct Way {
    PackedParams params;
    uint64_t bytes = 0;
    TemporaryFile file{"the compressed volume"};
  } indexed, channels;
  const auto into = [](Way& way) {
    return [&way](std::span<const std::byte> bytes) {
      way.bytes += bytes.size();
      return way.file.write(bytes);
    };
  };
  const auto numbers = numbers_of(source, *colors);
  VOX_TRY(indexed.params, Encoder(*numbers, source.info(), *colors, options, ctx).run(0.0, into(indexed)));
  VOX_TRY(channels.params, encode_packed_colors(source, options, into(channels), ctx));
  Way& smaller = indexed.bytes <= channels.bytes ? indexed : channels;
  VOX_TRY(const auto file, smaller.file.map());
  VOX_CHECK(sink(file->bytes()));
  return smaller.params;
}

}  // namespace

Result<PackedParams> encode_packed(VolumeSource& source, const PackedOptions& options, const ByteSink& sink,
                                   Context& ctx) {
  const VolumeInfo& info = source.info();
  if (options.target && is_color(info.format))
    return bad_usage(fmt::format("a target for voxels of {}: expected scalars, or a bound (--max-error)",
                                 name(info.format)));
  if (options.page_side != 8 && options.page_side != 16)
    return bad_usage(fmt::format("pages of {} voxels: expected 8 or 16", options.page_side));
  if (!(options.max_error >= 0 && options.max_error <= 1e300))
    return bad_usage(fmt::format("--max-error {}: expected a finite bound, 0 or more", options.max_error));
  const bool floats = info.format == VoxelFormat::float32;
  if (options.max_error >= (floats ? 1e300 : 0x1p31 - 1))
    return bad_usage(fmt::format("--max-error {}: expected less than 2^31 - 1", options.max_error));
  if (options.target && options.max_error > 0)
    return bad_usage("a bound, and a target, for which one is to be found: expected one of them");
  if (options.target && !(options.target->value > 0 && options.target->value <= 1000))
    return bad_usage(
        fmt::format("a target of {}: expected a number above 0, up to 1000", options.target->value));
  if ((options.max_error > 0 || options.target) && (info.is_labels || info.labels))
    return bad_usage(fmt::format("{}: expected a bound of 0 (--max-error 0 or --quality 100)",
                                 info.is_labels ? "labels have no values between them"
                                                : "values that are 65536 and more apart are held by a table, "
                                                  "which has no steps"));
  if ((options.max_error >= 1 || options.target) && info.fill && !floats)
    return bad_usage(
        "integers with a fill value, which is to come back as it is: expected a bound of 0 (--max-error 0 or "
        "--quality 100)");
  if (source.forward_only()) return fail(ErrorCode::internal, {}, "a source that was not spooled");
  if (is_color(info.format)) return encode_colors(source, options, sink, ctx);
  Encoder encoder(source, options, ctx);
  return options.target ? encoder.run(*options.target, sink) : encoder.run(options.max_error, sink);
}

}  // namespace voxkit::svmm
