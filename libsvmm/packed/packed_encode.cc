// The encoder: a pass that surveys values and makes the coarser levels, then each level, the coarsest first,
// page by page.
#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "formats/copy.h"
#include "formats/mapped_file.h"
#include "formats/parallel.h"
#include "formats/reservation.h"
#include "formats/volume_chunks.h"
#include "libpage/page.h"
#include "libsvmm/packed/color_encode.h"
#include "libsvmm/packed/halve.h"
#include "libsvmm/packed/packed_layout.h"
#include "libsvmm/packed/raster.h"
#include "libsvmm/packed/survey.h"

namespace voxkit::svmm {
namespace {

/// How far voxels of coarser levels of 8 bits may be from means: what this saves is more than half of what
/// levels of clean volumes cost.
constexpr uint32_t bound_of_coarse_bytes = 2;

/// Reads pages of a level as codes.
class PageReader {
 public:
  /// What is read goes through `raster`.
  PageReader(VolumeSource& source, const PageGrid& grid, const PackedParams& params, const Raster& raster)
      : source_(source), grid_(grid), params_(params), raster_(raster) {}

  /// Reads the pages `first` to `last`, which are in one row, and calls take(number, codes, extent) for each.
  template <class Take>
  Status read(uint64_t first, uint64_t last, const Take& take) {
    const Box row{grid_.box(first).lo, grid_.box(last - 1).hi};
    const VoxelFormat format = source_.info().format;
    voxels_.resize(static_cast<size_t>(row.voxels() * voxel_bytes(format)));
    const VoxelSpan span = packed(voxels_.data(), row.size(), format);
    if (const auto value = source_.uniform(row))
      fill(span, row.size(), format, *value);
    else
      VOX_CHECK(source_.read(row, span));
    for (uint64_t number = first; number < last; ++number) {
      const Box box = grid_.box(number);
      const ConstVoxelSpan at{span.data + (box.lo.x - row.lo.x) * voxel_bytes(format), span.row_stride,
                              span.slice_stride};
      VOX_CHECK(format == VoxelFormat::float32     ? codes_of_floats(at, box.size(), number, take)
                : format == VoxelFormat::density16 ? codes_of<uint16_t>(at, box.size(), number, take)
                                                   : codes_of<uint8_t>(at, box.size(), number, take));
    }
    return {};
  }

 private:
  template <class T, class Take>
  Status codes_of(ConstVoxelSpan in, Index3 size, uint64_t number, const Take& take) {
    T codes[page::max_voxels];
    T* out = codes;
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y, out += size.x)
        std::memcpy(out, in.row(y, z), static_cast<size_t>(size.x) * sizeof(T));
    if (!raster_.empty())
      for (T* code = codes; code != out; ++code) *code = static_cast<T>(raster_(*code));
    return take(number, std::span<const T>(codes, out), grid_.extent(number));
  }
  template <class Take>
  Status codes_of_floats(ConstVoxelSpan in, Index3 size, uint64_t number, const Take& take) {
    uint32_t codes[page::max_voxels];
    uint32_t* out = codes;
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y) {
        const auto* const row = reinterpret_cast<const float*>(in.row(y, z));
        for (int64_t x = 0; x < size.x; ++x) {
          *out = params_.map.code(row[x]);
          if (params_.map.kind == CodeKind::steps && std::isfinite(row[x]) &&
              !(std::abs(static_cast<double>(params_.map.value(*out)) - static_cast<double>(row[x])) <=
                params_.max_error))
            return fail(ErrorCode::internal, {}, "a step further than the bound");
          ++out;
        }
      }
    return take(number, std::span<const uint32_t>(codes, out), grid_.extent(number));
  }

  VolumeSource& source_;
  const PageGrid& grid_;
  const PackedParams& params_;
  const Raster& raster_;
  std::vector<std::byte> voxels_;
};

/// The codes of a coarser level as they were decoded, in a temporary file, page by page.
class DecodedLevel {
 public:
  DecodedLevel(int level, const PageGrid& grid, int code_bytes)
      : level_(level),
        grid_(grid),
        stride_(static_cast<size_t>(grid.side * grid.side * grid.side * code_bytes)) {}
  int level() const { return level_; }
  size_t page_bytes() const { return stride_; }
  /// Pages in order, each of `page_bytes()`.
  Status write(std::span<const std::byte> pages) { return file_.write(pages); }
  Status finish() {
    VOX_TRY(mapped_, file_.map());
    return {};
  }
  /// The parents of a page of the next finer level.
  template <class T>
  page::Parent<T> parent_of(Index3 child) const {
    const uint64_t number = grid_.number(child / int64_t{2});
    page::Parent<T> parent = placed<T>(child, grid_);
    parent.samples = {reinterpret_cast<const T*>(mapped_->bytes().data() + number * stride_),
                      static_cast<size_t>(parent.extent.voxels())};
    return parent;
  }

 private:
  int level_;
  PageGrid grid_;
  size_t stride_;
  TemporaryFile file_{"a coarser level"};
  std::shared_ptr<const MappedFile> mapped_;
};

class Encoder {
 public:
  Encoder(VolumeSource& source, const PackedOptions& options, const ByteSink& sink, Context& ctx)
      : source_(source),
        info_(source.info()),
        ctx_(ctx),
        survey_(info_.format),
        container_(sink, Codec::svmm, container_version_for(info_), 0, *ctx.memory) {
    params_.page_side = options.page_side;
    const bool floats = info_.format == VoxelFormat::float32;
    params_.max_error = floats ? options.max_error : std::floor(options.max_error);
    params_.levels = options.levels ? level_count(info_.dims, options.page_side) : 1;
  }

  Result<PackedParams> run() {
    VOX_CHECK(prepare());
    VOX_CHECK(add_volume_info(container_, info_));
    VOX_CHECK(container_.add(packed_kind, 0, 0, pack_params(params_)));
    // The coarsest level has no parents; the model of those between is fitted to the largest of them.
    const int top = params_.levels - 1;
    std::optional<page::Model> model;
    for (int level = top; level >= 0; --level) {
      if (level == top || level == top - 1 || level == 0) {
        const int fitted = level == 0 || level == top ? level : 1;
        VOX_TRY(model, fit(fitted));
        VOX_CHECK(container_.add(model_kind, static_cast<uint32_t>(fitted), 0, model->serialise()));
      }
      VOX_CHECK(encode(level, *model));
    }
    VOX_CHECK(container_.finish());
    return params_;
  }

 private:
  VolumeSource& source(int level) { return level == 0 ? source_ : *coarser_[static_cast<size_t>(level - 1)]; }
  const Raster& raster(int level) const { return level == 0 ? all_values_ : raster_; }
  /// Of the codes of a level, and of integers of their samples.
  uint32_t bound(int level) const {
    if (info_.format == VoxelFormat::float32) return 0;
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
      VOX_CHECK(visit_voxels(source_, look, ctx_));
    } else {
      for (int level = 1; level < params_.levels; ++level) {
        const auto visit = level == 1 ? std::function<void(ConstVoxelSpan, Index3)>(look) : nullptr;
        VOX_TRY(auto next, halved(source(level - 1), visit, ctx_));
        coarser_.push_back(std::move(next));
      }
    }
    if (info_.format == VoxelFormat::float32) {
      VOX_CHECK(choose_map());
    } else if (!has_no_means(info_) && !info_.fill) {
      const auto values = survey_.values();
      Raster raster(values);
      if (raster.step() > 2 * params_.max_error) raster_ = std::move(raster);
      coarse_bytes_ =
          info_.format == VoxelFormat::density8 && !values.empty() && values.back() - values.front() >= 128;
    }
    return {};
  }

  /// Steps within the bound, or, where these take more bytes, all bits.
  Status choose_map() {
    params_.map.kind = CodeKind::ordered;
    const ValueMap steps = ValueMap::for_floats(survey_.range(), params_.max_error);
    if (steps.kind == CodeKind::steps) {
      VOX_TRY(const page::Model exact, fit(0));
      VOX_TRY(const uint64_t exact_bytes, sampled_bytes(0, exact));
      params_.map = steps;
      VOX_TRY(const page::Model bounded, fit(0));
      VOX_TRY(const uint64_t bounded_bytes, sampled_bytes(0, bounded));
      if (exact_bytes < bounded_bytes) params_.map = {CodeKind::ordered, 0, 1};
    }
    if (params_.map.kind == CodeKind::ordered) params_.max_error = 0;
    return {};
  }

  /// Pages of a level that models are fitted to.
  template <class Take>
  Status sample_pages(int level, const Take& take) {
    const PageGrid pages = grid(level);
    PageReader reader(source(level), pages, params_, raster(level));
    for (const uint64_t number : spread_pages(pages.pages(), most_sampled_pages))
      VOX_CHECK(reader.read(number, number + 1, take));
    return {};
  }
  /// Bytes of these pages, and of the model.
  Result<uint64_t> sampled_bytes(int level, const page::Model& model) {
    std::vector<std::byte> bytes = model.serialise();
    VOX_CHECK(sample_pages(level, [&](uint64_t number, auto codes, page::Extent extent) -> Status {
      using T = std::remove_const_t<typename decltype(codes)::element_type>;
      std::vector<T> codes_above;
      page::Parent<T> parent;
      if (model.has_parents()) {
        VOX_TRY(parent, parent_of(level, number, codes_above));
      }
      return page::encode_page(model, codes, extent, bytes, parent);
    }));
    return bytes.size();
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
                      room.push_back(static_cast<T>(std::min<uint64_t>((code + bound_above) / step * step,
                                                                       std::numeric_limits<T>::max())));
                    return {};
                  }));
    page::Parent<T> parent = placed<T>(child, above);
    parent.samples = room;
    return parent;
  }

  Result<page::Model> fit(int level) {
    page::ModelBuilder builder;
    VOX_TRY(const Reservation memory,
            Reservation::take(2 * most_sampled_pages * page::max_voxels * sizeof(uint32_t),
                              "pages to fit a model to", ctx_));
    page::ModelOptions options;
    options.parents = level + 1 < params_.levels;
    VOX_CHECK(sample_pages(level, [&](uint64_t number, auto codes, page::Extent extent) -> Status {
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
      options.max_sample = steps ? params_.map.code(static_cast<float>(survey_.range().hi)) : 0xffffffff;
      if (!steps && level == 0) options.values = survey_.values();
    } else {
      options.max_error = bound(level);
      const auto values = survey_.values();
      options.max_sample = values.empty() ? 0 : values.back();
      // Means of voxels may be other values.
      const bool same_values = level == 0 || has_no_means(info_);
      if (options.max_error == 0 && same_values) options.values = values;
      if (level > 0 && !raster_.empty()) options.values = raster_.values();
      // Values that are few beside the steps of the bound may take fewer bytes than these.
      const uint64_t steps = options.max_sample / (2 * uint64_t{options.max_error} + 1) + 1;
      if (options.max_error > 0 && values.size() <= 2 * steps && level == 0) {
        page::ModelOptions exact;
        exact.parents = options.parents;
        exact.max_sample = options.max_sample;
        exact.values = values;
        VOX_TRY(const page::Model bounded, builder.build(options));
        VOX_TRY(const page::Model lossless, builder.build(exact));
        VOX_TRY(const uint64_t bounded_bytes, sampled_bytes(level, bounded));
        VOX_TRY(const uint64_t lossless_bytes, sampled_bytes(level, lossless));
        return lossless_bytes < bounded_bytes ? lossless : bounded;
      }
    }
    return builder.build(options);
  }

  Status encode(int level, const page::Model& model) {
    const PageGrid pages = grid(level);
    auto decoded = std::make_unique<DecodedLevel>(level, pages, code_bytes(info_.format));
    std::vector<std::byte> batch;  // of decoded pages
    const auto batch_parts = static_cast<uint64_t>(2 * ctx_.threads);
    for (uint64_t part = 0; part < pages.parts(); part += batch_parts) {
      const uint64_t end_part = std::min(part + batch_parts, pages.parts()),
                     first = part * pages.pages_a_part(),
                     last = std::min(end_part * pages.pages_a_part(), pages.pages());
      std::vector<std::vector<std::byte>> encoded(last - first);
      const auto runs = runs_of(pages, first, last);
      if (level > 0) batch.resize((last - first) * decoded->page_bytes());
      VOX_CHECK(parallel_for(ctx_, static_cast<int64_t>(runs.size()), [&](int64_t i) -> Status {
        PageReader reader(source(level), pages, params_, raster(level));
        const auto [begin, end] = runs[static_cast<size_t>(i)];
        return reader.read(begin, end, [&](uint64_t number, auto codes, page::Extent extent) {
          using T = std::remove_const_t<typename decltype(codes)::element_type>;
          page::Parent<T> parent;
          if (model.has_parents()) parent = decoded_->parent_of<T>(pages.index(number));
          std::span<T> kept;
          if (level > 0)
            kept = {reinterpret_cast<T*>(batch.data() + (number - first) * decoded->page_bytes()),
                    codes.size()};
          return page::encode_page(model, codes, extent, encoded[number - first], parent, kept);
        });
      }));
      if (level > 0) VOX_CHECK(decoded->write(batch));
      std::span<const std::vector<std::byte>> left = encoded;
      for (uint64_t p = part; p < end_part; ++p) {
        const uint64_t count = pages.pages_of(p);
        VOX_CHECK(container_.add(pages_kind, static_cast<uint32_t>(level), p, pack_part(left.first(count))));
        left = left.subspan(count);
      }
      source(level).release(pages.box(first).lo.z, pages.box(last - 1).lo.z);
      if (level == 0) ctx_.progress(static_cast<double>(last) / static_cast<double>(pages.pages()));
    }
    if (level > 0) VOX_CHECK(decoded->finish());
    decoded_ = std::move(decoded);
    return {};
  }

  VolumeSource& source_;
  const VolumeInfo info_;
  Context& ctx_;
  PackedParams params_;
  Survey survey_;
  const Raster all_values_;
  Raster raster_;              ///< of coarser levels
  bool coarse_bytes_ = false;  ///< whether these are of 8 bits, and need not be exact
  std::vector<std::unique_ptr<VolumeSource>> coarser_;
  std::unique_ptr<DecodedLevel> decoded_;  ///< the level above that which comes next
  ContainerWriter container_;
};

}  // namespace

Result<PackedParams> encode_packed(VolumeSource& source, const PackedOptions& options, const ByteSink& sink,
                                   Context& ctx) {
  const VolumeInfo& info = source.info();
  if (options.page_side != 8 && options.page_side != 16)
    return bad_usage(fmt::format("pages of {} voxels: expected 8 or 16", options.page_side));
  if (!(options.max_error >= 0 && options.max_error <= 1e300))
    return bad_usage(fmt::format("--max-error {}: expected a finite bound, 0 or more", options.max_error));
  const bool floats = info.format == VoxelFormat::float32;
  if (options.max_error >= (floats ? 1e300 : 0x1p31 - 1))
    return bad_usage(fmt::format("--max-error {}: expected less than 2^31 - 1", options.max_error));
  if (options.max_error > 0 && (info.is_labels || info.labels))
    return bad_usage(
        "labels have no values between them: expected a bound of 0 (--max-error 0 or --quality 100)");
  if (options.max_error >= 1 && info.fill && !floats)
    return bad_usage(
        "integers with a fill value, which is to come back as it is: expected a bound of 0 (--max-error 0 or "
        "--quality 100)");
  if (source.forward_only()) return fail(ErrorCode::internal, {}, "a source that was not spooled");
  if (is_color(info.format)) return encode_packed_colors(source, options, sink, ctx);
  return Encoder(source, options, sink, ctx).run();
}

}  // namespace voxkit::svmm
