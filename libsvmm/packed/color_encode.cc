// The encoder of colours: as that of scalars (packed_encode.cc), with a mask and channels for each page.
#include "libsvmm/packed/color_encode.h"

#include <cmath>
#include <cstring>

#include "formats/copy.h"
#include "formats/mapped_file.h"
#include "formats/parallel.h"
#include "formats/reservation.h"
#include "formats/volume_chunks.h"
#include "libsvmm/packed/color_page.h"
#include "libsvmm/packed/halve.h"
#include "libsvmm/packed/packed_layout.h"

namespace voxkit::svmm {
namespace {

/// How far channels of coarser levels may be from means in any case, but for alpha.
constexpr uint32_t bound_of_coarse_colors = 2;

/// Which values channels may have, and whether all that is solid is opaque.
class ColorSurvey {
 public:
  explicit ColorSurvey(size_t channels) : bytes_(channels) {}
  /// Thread-safe.
  void look(ConstVoxelSpan voxels, Index3 size) {
    const auto mark = [](auto& seen, int value) {
      auto& one = seen[static_cast<size_t>(value)];
      if (!one.load(std::memory_order_relaxed)) one.store(true, std::memory_order_relaxed);
    };
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y) {
        const auto* voxel = reinterpret_cast<const uint8_t*>(voxels.row(y, z));
        uint32_t before = 0;
        for (int64_t x = 0; x < size.x; ++x, voxel += bytes_) {
          uint32_t bits = 0;
          std::memcpy(&bits, voxel, bytes_);
          if (bits == before || bits == 0) continue;
          before = bits;
          for (size_t c = 0; c < bytes_; ++c) mark(bytes_seen_[c], voxel[c]);
          mark(differences_seen_[0], voxel[0] - voxel[1] + difference_offset);
          mark(differences_seen_[1], voxel[2] - voxel[1] + difference_offset);
        }
      }
  }
  std::vector<uint32_t> values(Channels channels, size_t channel) const {
    std::vector<uint32_t> out;
    const bool difference = channels.greatest(channel) == most_difference;
    for (uint32_t value = 0; value <= channels.greatest(channel); ++value)
      if (difference ? differences_seen_[channel - 1][value]
                     : bytes_seen_[channel == 0   ? 1
                                   : channel == 1 ? 0
                                                  : channel][value])
        out.push_back(value);
    return out;
  }
  bool opaque() const {
    return bytes_ == 4 && std::none_of(bytes_seen_[3].begin(), bytes_seen_[3].begin() + 255,
                                       [](const std::atomic<bool>& seen) { return seen.load(); });
  }

 private:
  size_t bytes_;                                                                ///< of a voxel
  std::array<std::array<std::atomic<bool>, 256>, most_channels> bytes_seen_{};  ///< R, G, B, A
  std::array<std::array<std::atomic<bool>, most_difference + 1>, 2> differences_seen_{};
};

/// The pages of a level as they were decoded, in a temporary file, but for those that are void.
class DecodedColors {
 public:
  DecodedColors(int level, const PageGrid& grid) : level_(level), grid_(grid) {}
  int level() const { return level_; }
  /// Pages in order; null: all void.
  Status write(const ColorPage* page) {
    places_.push_back(page ? count_++ : none);
    return page ? file_.write(std::as_bytes(std::span(page, 1))) : Status();
  }
  Status finish() {
    if (count_ == 0) return {};
    VOX_TRY(mapped_, file_.map());
    return {};
  }
  /// Planes of pages before this one are not needed any more.
  void release(int64_t plane) const {
    if (!mapped_) return;
    uint64_t number = grid_.number({0, 0, plane});
    while (number < places_.size() && places_[number] == none) ++number;
    if (number < places_.size()) release_bytes(mapped_->bytes().first(places_[number] * sizeof(ColorPage)));
  }
  ColorParent parent_of(Index3 child) const {
    ColorParent parent;
    parent.place(child, grid_);
    const uint64_t place = places_[grid_.number(child / int64_t{2})];
    parent.page =
        place == none ? &void_page_ : reinterpret_cast<const ColorPage*>(mapped_->bytes().data()) + place;
    return parent;
  }

 private:
  static constexpr uint64_t none = ~uint64_t{0};
  static constexpr ColorPage void_page_{};
  int level_;
  PageGrid grid_;
  std::vector<uint64_t> places_;
  uint64_t count_ = 0;
  TemporaryFile file_{"a coarser level"};
  std::shared_ptr<const MappedFile> mapped_;
};

class ColorEncoder {
 public:
  ColorEncoder(VolumeSource& source, const PackedOptions& options, const ByteSink& sink, Context& ctx)
      : source_(source),
        info_(source.info()),
        ctx_(ctx),
        bound_(static_cast<uint32_t>(std::min(options.max_error / std::sqrt(3.0) * (1 + 1e-12), 255.0))),
        survey_(channel_count(info_.format)),
        container_(sink, Codec::svmm, container_version_for(info_), 0, *ctx.memory) {
    params_.channels.count = channel_count(info_.format);
    params_.page_side = options.page_side;
    params_.map.kind = CodeKind::colors;
    params_.levels = options.levels ? level_count(info_.dims, options.page_side) : 1;
    params_.max_error = bound_ == 0 ? 0 : options.max_error;
  }

  Result<PackedParams> run() {
    VOX_CHECK(prepare());
    VOX_CHECK(add_volume_info(container_, info_));
    VOX_CHECK(container_.add(packed_kind, 0, 0, pack_params(params_)));
    // The coarsest level has no parents; the models of those between are fitted to the largest of them.
    const int top = params_.levels - 1;
    std::optional<ColorModel> model;
    for (int level = top; level >= 0; --level) {
      if (level == top || level == top - 1 || level == 0) {
        const int fitted = level == 0 || level == top ? level : 1;
        VOX_TRY(model, fit(fitted));
        const auto index = static_cast<uint32_t>(fitted);
        VOX_CHECK(container_.add(mask_model_kind, index, 0, model->mask.serialise()));
        for (size_t c = 0; c < params_.channels.count; ++c)
          VOX_CHECK(container_.add(model_kind, index, c, model->models[c].serialise()));
      }
      VOX_CHECK(encode(level, *model));
      // What is there by now is a file of the coarser levels.
      VOX_CHECK(level == 0 ? container_.finish() : container_.checkpoint());
    }
    return params_;
  }

 private:
  VolumeSource& source(int level) { return level == 0 ? source_ : *coarser_[static_cast<size_t>(level - 1)]; }
  PageGrid grid(int level) { return {source(level).info().dims, params_.page_side}; }
  bool has_parents(int level) const { return level + 1 < params_.levels; }
  uint32_t bound(int level, size_t channel) const {
    if (channel == 3) return 0;
    return level == 0 ? bound_ : std::max(bound_, bound_of_coarse_colors);
  }

  /// The first pass.
  Status prepare() {
    const auto look = [&](ConstVoxelSpan voxels, Index3 size) { survey_.look(voxels, size); };
    if (params_.levels == 1)
      VOX_CHECK(visit_voxels(
          source_, [&](ConstVoxelSpan voxels, Index3 size, int64_t) { look(voxels, size); }, ctx_));
    for (int level = 1; level < params_.levels; ++level) {
      const auto visit = level == 1 ? std::function<void(ConstVoxelSpan, Index3)>(look) : nullptr;
      VOX_TRY(auto next, halved(source(level - 1), visit, ctx_));
      coarser_.push_back(std::move(next));
    }
    params_.opaque = survey_.opaque();
    return choose_channels();
  }

  /// Whether R and B take fewer bytes as differences from G: mostly they do, but not where each goes its own
  /// way, as in a colour cube. And whether a bound saves any: few colours may take fewer bytes as they are.
  Status choose_channels() {
    const uint32_t asked = bound_;
    std::optional<uint64_t> least;
    bool best_differences = true;
    uint32_t best_bound = asked;
    for (const uint32_t bound : {asked, 0u}) {
      for (const bool differences : {true, false}) {
        bound_ = bound;
        params_.channels.differences = differences;
        VOX_TRY(const ColorModel model, fit(0, pages_to_choose_by));
        VOX_TRY(const uint64_t bytes, sampled_bytes(0, model, pages_to_choose_by));
        if (least && bytes >= *least) continue;
        least = bytes;
        best_differences = differences;
        best_bound = bound;
      }
      if (asked == 0) break;
    }
    bound_ = best_bound;
    params_.channels.differences = best_differences;
    if (bound_ == 0) params_.max_error = 0;
    return {};
  }

  /// Reads pages `first` to `last`, which are in one row, and calls take(number, voxels) for each that is not
  /// all void.
  template <class Take>
  Status read(int level, uint64_t first, uint64_t last, std::vector<std::byte>& room, const Take& take) {
    const PageGrid pages = grid(level);
    const Box row{pages.box(first).lo, pages.box(last - 1).hi};
    VolumeSource& from = source(level);
    const auto value = from.uniform(row);
    if (value && *value == Voxel{}) return {};
    room.resize(static_cast<size_t>(row.voxels() * voxel_bytes(info_.format)));
    const VoxelSpan span = packed(room.data(), row.size(), info_.format);
    if (value)
      fill(span, row.size(), info_.format, *value);
    else
      VOX_CHECK(from.read(row, span));
    for (uint64_t number = first; number < last; ++number) {
      const ConstVoxelSpan at{span.data + (pages.box(number).lo.x - row.lo.x) * voxel_bytes(info_.format),
                              span.row_stride, span.slice_stride};
      const ColorVoxels voxels(at, pages.extent(number), info_.format);
      if (!voxels.mask.empty()) VOX_CHECK(take(number, voxels));
    }
    return {};
  }

  /// Up to `most` pages of a level to fit models to: not void, and spread over it.
  Result<std::vector<uint64_t>> sample_pages(int level, uint64_t most) {
    const PageGrid pages = grid(level);
    std::vector<uint64_t> sampled;
    std::vector<std::byte> room;
    for (const uint64_t number : spread_pages(pages.pages(), most_candidates)) {
      VOX_CHECK(read(level, number, number + 1, room, [&](uint64_t n, const ColorVoxels&) -> Status {
        sampled.push_back(n);
        return {};
      }));
      release(level, number);
      if (sampled.size() == most) break;
    }
    return sampled;
  }

  /// The parents of a page: as they were decoded, or, where that is still to come, about so, in `room`.
  Result<ColorParent> parent_of(int level, uint64_t number, ColorPage& room) {
    const Index3 child = grid(level).index(number);
    if (decoded_ && decoded_->level() == level + 1) return decoded_->parent_of(child);
    const PageGrid above = grid(level + 1);
    const uint64_t parent_number = above.number(child / int64_t{2});
    room = {};
    std::vector<std::byte> bytes;
    VOX_CHECK(read(level + 1, parent_number, parent_number + 1, bytes,
                   [&](uint64_t, const ColorVoxels& voxels) -> Status {
                     about_as_decoded(voxels, params_.channels, room);
                     return {};
                   }));
    release(level + 1, parent_number);
    ColorParent parent;
    parent.place(child, above);
    parent.page = &room;
    return parent;
  }

  /// Calls take(voxels, parent) for each of some pages.
  template <class Take>
  Status visit(int level, std::span<const uint64_t> numbers, const Take& take) {
    const auto room = std::make_unique<ColorPage>();
    std::vector<std::byte> bytes;
    for (const uint64_t number : numbers) {
      ColorParent parent;
      if (has_parents(level)) {
        VOX_TRY(parent, parent_of(level, number, *room));
      }
      VOX_CHECK(read(level, number, number + 1, bytes,
                     [&](uint64_t, const ColorVoxels& voxels) -> Status { return take(voxels, parent); }));
      release(level, number);
    }
    return {};
  }
  /// Of a page that was read alone: its rows lie far apart, and of mapped files each is a page of memory.
  void release(int level, uint64_t number) {
    const Box page = grid(level).box(number);
    source(level).release(page.lo.z, page.hi.z);
  }

  /// Bytes of the models and of sample pages.
  Result<uint64_t> sampled_bytes(int level, const ColorModel& model, uint64_t most) {
    VOX_TRY(const std::vector<uint64_t> sampled, sample_pages(level, most));
    std::vector<std::byte> mask;
    std::array<std::vector<std::byte>, most_channels> bytes;
    const auto decoded = std::make_unique<ColorPage>();
    VOX_CHECK(visit(level, sampled, [&](const ColorVoxels& voxels, const ColorParent& parent) {
      return encode_color_page(model, params_.channels, voxels, parent, mask, bytes, *decoded);
    }));
    uint64_t sum = 0;
    for (size_t c = 0; c < params_.channels.count; ++c)
      sum += bytes[c].size() + model.models[c].serialise().size();
    return sum;
  }

  Result<ColorModel> fit(int level, uint64_t most = most_sampled_pages) {
    VOX_TRY(const Reservation memory,
            Reservation::take(2 * most_sampled_pages * page::max_voxels * sizeof(uint32_t),
                              "pages to fit a model to", ctx_));
    VOX_TRY(const std::vector<uint64_t> sampled, sample_pages(level, most));
    const bool parents = has_parents(level);
    page::MaskModel::Builder masks(parents);
    VOX_CHECK(visit(level, sampled, [&](const ColorVoxels& voxels, const ColorParent& parent) -> Status {
      masks.add(voxels.mask, voxels.extent, parent.mask());
      return {};
    }));
    ColorModel model{masks.build(), {}};
    for (size_t c = 0; c < params_.channels.count; ++c) {
      page::ModelBuilder builder;
      VOX_CHECK(visit(level, sampled, [&](const ColorVoxels& voxels, const ColorParent& parent) -> Status {
        std::array<uint16_t, page::max_voxels> green, samples;
        const auto count = static_cast<size_t>(voxels.extent.voxels());
        voxels.channel(0, params_.channels, {}, std::span(green).first(count));
        voxels.channel(c, params_.channels, green, std::span(samples).first(count));
        builder.add(std::span<const uint16_t>(samples.data(), count), voxels.extent, parent.channel(c),
                    &voxels.mask);
        return {};
      }));
      page::ModelOptions options;
      options.parents = parents;
      options.max_error = bound(level, c);
      options.max_sample = params_.channels.greatest(c);
      // Differences from greens that are not as they were may be others.
      if (level == 0 && options.max_error == 0 && (bound_ == 0 || params_.channels.greatest(c) == 255))
        options.values = survey_.values(params_.channels, c);
      VOX_TRY(page::Model channel, builder.build(options, ctx_));
      model.models.push_back(std::move(channel));
    }
    return model;
  }

  Status encode(int level, const ColorModel& model) {
    const PageGrid pages = grid(level);
    const size_t channels = params_.channels.count;
    auto decoded = std::make_unique<DecodedColors>(level, pages);
    const auto batch_parts = static_cast<uint64_t>(ctx_.threads);
    const uint64_t most_kept = level == 0 ? 0 : std::min(batch_parts * pages.pages_a_part(), pages.pages());
    VOX_TRY(const Reservation memory,
            Reservation::take(most_kept * sizeof(ColorPage), "decoded pages of a level", ctx_));
    for (uint64_t part = 0; part < pages.parts(); part += batch_parts) {
      const uint64_t end_part = std::min(part + batch_parts, pages.parts()),
                     first = part * pages.pages_a_part(),
                     last = std::min(end_part * pages.pages_a_part(), pages.pages());
      std::vector<std::vector<std::byte>> masks(last - first), encoded((last - first) * channels);
      std::vector<std::unique_ptr<ColorPage>> kept(level > 0 ? last - first : 0);
      const auto runs = runs_of(pages, first, last);
      VOX_CHECK(parallel_for(ctx_, static_cast<int64_t>(runs.size()), [&](int64_t i) -> Status {
        const auto [begin, end] = runs[static_cast<size_t>(i)];
        std::vector<std::byte> room;
        auto page = std::make_unique<ColorPage>();
        return read(level, begin, end, room, [&](uint64_t number, const ColorVoxels& voxels) -> Status {
          ColorParent parent;
          if (has_parents(level)) parent = decoded_->parent_of(pages.index(number));
          VOX_CHECK(encode_color_page(model, params_.channels, voxels, parent, masks[number - first],
                                      std::span(encoded).subspan((number - first) * channels, channels),
                                      *page));
          if (level > 0) {
            kept[number - first] = std::move(page);
            page = std::make_unique<ColorPage>();
          }
          return {};
        });
      }));
      for (const auto& page : kept) VOX_CHECK(decoded->write(page.get()));
      std::span<const std::vector<std::byte>> masks_left = masks, left = encoded;
      for (uint64_t p = part; p < end_part; ++p) {
        const uint64_t count = pages.pages_of(p);
        const auto index = static_cast<uint32_t>(level);
        VOX_CHECK(container_.add(mask_kind, index, p, pack_part(masks_left.first(count))));
        VOX_CHECK(container_.add(pages_kind, index, p, pack_part(left.first(count * channels))));
        masks_left = masks_left.subspan(count);
        left = left.subspan(count * channels);
      }
      source(level).release(pages.box(first).lo.z, pages.box(last - 1).lo.z);
      if (has_parents(level)) decoded_->release(pages.index(last - 1).z / 2);
      if (level == 0) ctx_.progress(static_cast<double>(last) / static_cast<double>(pages.pages()));
    }
    if (level > 0) VOX_CHECK(decoded->finish());
    decoded_ = std::move(decoded);
    return {};
  }

  static constexpr uint64_t most_candidates = 16384, pages_to_choose_by = 64;

  VolumeSource& source_;
  const VolumeInfo info_;
  Context& ctx_;
  uint32_t bound_;  ///< of R, G and B of level 0
  PackedParams params_;
  ColorSurvey survey_;
  std::vector<std::unique_ptr<VolumeSource>> coarser_;
  std::unique_ptr<DecodedColors> decoded_;  ///< the level above that which comes next
  ContainerWriter container_;
};

}  // namespace

Result<PackedParams> encode_packed_colors(VolumeSource& source, const PackedOptions& options,
                                          const ByteSink& sink, Context& ctx) {
  return ColorEncoder(source, options, sink, ctx).run();
}

}  // namespace voxkit::svmm
