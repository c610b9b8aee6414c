#include <fmt/format.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <mutex>

#include "formats/parallel.h"
#include "formats/volume_chunks.h"
#include "libsvmm/packed/indexed_colors.h"
#include "libsvmm/packed/packed_pages.h"
#include "libsvmm/packed/page_ranges.h"

namespace voxkit::svmm {

PartChunks::PartChunks(uint32_t chunk_kind, uint64_t entries_of_page, uint64_t parts)
    : kind(chunk_kind),
      entries(entries_of_page),
      chunks(parts, ~size_t{0}),
      checked(std::make_unique<std::atomic<bool>[]>(parts)) {}

Result<PartView> PackedPages::part(const Container& container, int level, const PartChunks& chunks,
                                   uint64_t number) const {
  VOX_TRY(const auto bytes, container.chunk(chunks.chunks[number]));
  const PartView view(bytes, levels[static_cast<size_t>(level)].grid.pages_of(number) * chunks.entries);
  if (!chunks.checked[number].load(std::memory_order_acquire)) {
    if (!view.valid())
      return bad_input(container.name(),
                       fmt::format("chunk {} {}.{}: lengths of pages that do not add up",
                                   chunks.kind == mask_kind ? "MASK" : "PAGE", level, number));
    chunks.checked[number].store(true, std::memory_order_release);
  }
  return view;
}

Result<std::span<const std::byte>> PackedPages::entry(const Container& container, int level,
                                                      const PartChunks& chunks, uint64_t number,
                                                      uint64_t entry) const {
  const uint64_t a_part = levels[static_cast<size_t>(level)].grid.pages_a_part();
  VOX_TRY(const PartView view, part(container, level, chunks, number / a_part));
  return view.page(number % a_part * chunks.entries + entry);
}

Error at_page(const Container& container, int level, uint64_t number, const PageGrid& grid,
              const Error& error) {
  const Index3 lo = grid.box(number).lo;
  return {ErrorCode::input, container.name(),
          fmt::format("level {}, page at {},{},{}: {}", level, lo.x, lo.y, lo.z, error.what)};
}

bool is_packed(const Container& container) {
  return container.codec() == Codec::svmm && container.has_chunk(packed_kind);
}

PackedVolume::PackedVolume() = default;
PackedVolume::~PackedVolume() = default;

/// Chunk CTAB: no color twice, and none that is void.
static Status read_colors(const Container& container, const VolumeInfo& info, ValueMap& map) {
  VOX_TRY(const auto bytes, container.only_chunk(color_table_kind));
  const auto each = static_cast<size_t>(voxel_bytes(info.format));
  const size_t count = bytes.size() / each;
  if (bytes.size() % each != 0 || count == 0 || count > most_indexed_colors)
    return bad_input(container.name(),
                     fmt::format("chunk CTAB: {} bytes: expected 1 to {} colors of {} bytes", bytes.size(),
                                 most_indexed_colors, each));
  std::vector<Voxel> colors(count);
  for (size_t i = 0; i < count; ++i) {
    std::memcpy(colors[i].bytes.data(), bytes.data() + i * each, each);
    const uint32_t before = i == 0 ? 0 : colors[i - 1].as<uint32_t>();
    if (colors[i].as<uint32_t>() <= before)
      return bad_input(container.name(),
                       fmt::format("chunk CTAB, byte {}: expected colors above 0, ascending", i * each));
  }
  map.colors = std::make_shared<const std::vector<Voxel>>(std::move(colors));
  return {};
}

Result<std::shared_ptr<const PackedVolume>> PackedVolume::open(std::shared_ptr<const Container> container,
                                                               MemoryBudget& memory) {
  const auto bad = [&](const std::string& what) { return bad_input(container->name(), what); };
  const std::shared_ptr<PackedVolume> volume(new PackedVolume);
  VOX_TRY(volume->info_, read_volume_info(*container));
  VOX_TRY(const auto bytes, container->only_chunk(packed_kind));
  VOX_TRY(volume->params_, unpack_packed_params(bytes, volume->info_, container->name()));
  const int levels = volume->params_.levels;
  volume->pages_ = std::make_unique<PackedPages>(memory);
  PackedPages& pages = *volume->pages_;
  const VoxelFormat format = volume->info_.format;
  const bool colors = volume->params_.has_channels();
  if (volume->params_.map.kind == CodeKind::indexed)
    VOX_CHECK(read_colors(*container, volume->info_, volume->params_.map));
  const Channels of_colors = volume->params_.channels;
  const size_t channels = colors ? of_colors.count : 1;
  const auto& table = container->table();
  constexpr size_t none = ~size_t{0};
  for (int i = 0; i < levels; ++i) {
    PackedPages::Level level;
    level.grid = PageGrid(level_dims(volume->info_.dims, i), volume->params_.page_side);
    // A level with fewer is not there, and takes no memory.
    const uint64_t parts = level.grid.parts() <= table.size() ? level.grid.parts() : 0;
    level.pages = PartChunks(pages_kind, channels, parts);
    if (colors) level.masks = PartChunks(mask_kind, 1, parts);
    volume->levels_.push_back({level.grid.dims, level.grid.count, 0, 0, 0});
    pages.levels.push_back(std::move(level));
  }
  // By level: of each channel, and behind these of masks.
  std::vector<std::array<size_t, most_channels + 1>> models(pages.levels.size());
  for (auto& of_level : models) of_level.fill(none);
  for (size_t i = 0; i < table.size(); ++i) {
    const ChunkEntry& entry = table[i];
    const bool model = entry.kind == model_kind || (colors && entry.kind == mask_model_kind);
    const bool part = entry.kind == pages_kind || (colors && entry.kind == mask_kind);
    const auto end = [&] { return i + 1 < table.size() ? table[i + 1].offset : container->file_bytes(); };
    if (entry.kind == ranges_kind && entry.index == 0 && entry.part == 0) {
      volume->levels_[0].page_bytes += entry.length;
      volume->levels_[0].end = end();
    }
    if (!model && !part) continue;
    size_t* slot = nullptr;
    if (entry.index < static_cast<uint32_t>(levels)) {
      PackedPages::Level& level = pages.levels[entry.index];
      PartChunks& chunks = entry.kind == mask_kind ? level.masks : level.pages;
      if (entry.kind == model_kind && entry.part < channels) slot = &models[entry.index][entry.part];
      if (entry.kind == mask_model_kind && entry.part == 0) slot = &models[entry.index][channels];
      if (part && entry.part < chunks.chunks.size()) slot = &chunks.chunks[entry.part];
    }
    if (slot == nullptr || *slot != none)
      return bad(fmt::format("table: chunk {} {}.{}: not expected, or twice",
                             entry.kind == pages_kind   ? "PAGE"
                             : entry.kind == model_kind ? "MODL"
                             : entry.kind == mask_kind  ? "MASK"
                                                        : "MMOD",
                             entry.index, entry.part));
    *slot = i;
    PackedLevel& level = volume->levels_[entry.index];
    (part ? level.page_bytes : level.model_bytes) += entry.length;
    level.end = end();
  }
  // Of a file that was cut the finest levels have no pages at all.
  const auto absent = [&](const PackedPages::Level& level) {
    const auto none_of = [&](size_t chunk) { return chunk == none; };
    return std::ranges::all_of(level.pages.chunks, none_of) &&
           std::ranges::all_of(level.masks.chunks, none_of);
  };
  while (volume->finest_ + 1 < levels && absent(pages.levels[static_cast<size_t>(volume->finest_)]))
    ++volume->finest_;
  const auto finest = static_cast<size_t>(volume->finest_);
  for (size_t i = finest; i < pages.levels.size(); ++i) {
    const PackedPages::Level& level = pages.levels[i];
    if (level.pages.chunks.size() < level.grid.parts())
      return bad(fmt::format("fewer chunks PAGE than the {} of level {}", level.grid.parts(), i));
    for (const PartChunks* const chunks : {&level.pages, &level.masks})
      for (size_t part = 0; part < chunks->chunks.size(); ++part)
        if (chunks->chunks[part] == none)
          return bad(fmt::format("no chunk {} {}.{}", chunks->kind == mask_kind ? "MASK" : "PAGE", i, part));
  }
  for (size_t i = 0; i < pages.levels.size(); ++i) {
    PackedPages::Level& level = pages.levels[i];
    const auto of_level = std::span(models[i]).first(channels + (colors ? 1 : 0));
    if (std::ranges::all_of(of_level, [](size_t at) { return at == none; })) {
      if (i > 0) {
        level.model = pages.levels[i - 1].model;
        level.color = pages.levels[i - 1].color;
      }
      if (i >= finest && !level.model && !level.color) return bad(fmt::format("no chunk MODL {}.0", finest));
      continue;
    }
    std::vector<page::Model> found;
    for (size_t c = 0; c < channels; ++c) {
      if (of_level[c] == none) return bad(fmt::format("no chunk MODL {}.{}", i, c));
      VOX_TRY(const auto model_bytes, container->chunk(of_level[c]));
      auto model = page::Model::parse(model_bytes);
      if (!model) return bad(fmt::format("chunk MODL {}.{}: {}", i, c, model.error().what));
      const uint64_t most = colors                          ? of_colors.greatest(c)
                            : format == VoxelFormat::bitmap ? 1
                            : is_color(format)              ? volume->params_.map.colors->size()
                                                            : (uint64_t{1} << 8 * code_bytes(format)) - 1;
      if (model->max_sample() > most)
        return bad(fmt::format("chunk MODL {}.{}: samples up to {}: expected at most {}", i, c,
                               model->max_sample(), most));
      found.push_back(std::move(*model));
    }
    if (!colors) {
      level.model = std::move(found[0]);
      continue;
    }
    if (of_level[channels] == none) return bad(fmt::format("no chunk MMOD {}.0", i));
    VOX_TRY(const auto mask_bytes, container->chunk(of_level[channels]));
    auto masks = page::MaskModel::parse(mask_bytes);
    if (!masks) return bad(fmt::format("chunk MMOD {}.0: {}", i, masks.error().what));
    for (const page::Model& model : found)
      if (model.has_parents() != masks->has_parents())
        return bad(fmt::format("models of level {}: some with parents, and some without", i));
    level.color = ColorModel{std::move(*masks), std::move(found)};
  }
  const PackedPages::Level& last = pages.levels.back();
  if (colors ? last.color->mask.has_parents() : last.model->has_parents())
    return bad("the model of the coarsest level: expected one without parents");
  volume->container_ = std::move(container);
  return std::shared_ptr<const PackedVolume>(volume);
}

Status PackedVolume::decode(const Box& box, int level, VoxelSpan out) const {
  if (box.empty()) return {};
  if (params_.has_channels()) return decode_colors(*container_, *pages_, params_, box, level, out);
  return decode_scalars(*container_, *pages_, params_, info_.format, box, level, out);
}

Result<Voxel> PackedVolume::sample(Index3 voxel, int level) const {
  if (!params_.has_channels())
    return sample_scalar(*container_, *pages_, params_, info_.format, voxel, level);
  Ancestors last;
  return sample_color(*container_, *pages_, params_, voxel, level, last);
}

std::optional<Voxel> PackedVolume::uniform(const Box& box, int level) const {
  const auto& l = pages_->levels[static_cast<size_t>(level)];
  const bool colors = params_.has_channels();
  const Index3 first = box.lo / l.grid.side, last = (box.hi + (l.grid.side - 1)) / l.grid.side;
  for (int64_t z = first.z; z < last.z; ++z)
    for (int64_t y = first.y; y < last.y; ++y)
      for (int64_t x = first.x; x < last.x; ++x) {
        const auto bytes =
            pages_->entry(*container_, level, colors ? l.masks : l.pages, l.grid.number({x, y, z}));
        if (!bytes || !bytes->empty()) return std::nullopt;
      }
  if (colors) return Voxel{};
  return voxel_of(l.model->background(), params_.map, info_.format);
}

Status PackedVolume::check(Context& ctx) const {
  for (size_t i = 0; i < container_->table().size(); ++i) VOX_CHECK(container_->chunk(i));
  VOX_TRY(const auto ranges, page_ranges(*this));
  std::mutex mutex;
  PageRanges::Range all{1, 0};
  for (auto level = static_cast<size_t>(finest_); level < pages_->levels.size(); ++level) {
    const PageGrid& grid = pages_->levels[level].grid;
    constexpr int64_t run = 32;  // pages
    const Index3 runs((grid.count.x + run - 1) / run, grid.count.y, grid.count.z);
    VOX_CHECK(parallel_for(ctx, runs.x * runs.y * runs.z, [&](int64_t i) -> Status {
      const Index3 lo = Index3(i % runs.x * run, i / runs.x % runs.y, i / (runs.x * runs.y)) * grid.side;
      const Box box{lo, glm::min(lo + Index3(run, 1, 1) * grid.side, grid.dims)};
      std::vector<std::byte> voxels(static_cast<size_t>(box.voxels() * voxel_bytes(info_.format)));
      const VoxelSpan out = packed(voxels.data(), box.size(), info_.format);
      VOX_CHECK(decode(box, static_cast<int>(level), out));
      if (level > 0 || !ranges) return {};
      for (int64_t x = lo.x; x < box.hi.x; x += grid.side) {
        const uint64_t number = grid.number(Index3(x, lo.y, lo.z) / grid.side);
        const PageRanges::Range& said = ranges->pages[number];
        const ConstVoxelSpan page{out.data + (x - lo.x) * voxel_bytes(info_.format), out.row_stride,
                                  out.slice_stride};
        const auto found = range_of(page, grid.box(number).size(), info_.format);
        if (found.lo > found.hi) continue;
        if (!(said.lo <= found.lo && found.hi <= said.hi))
          return tl::unexpected<Error>(at_page(
              *container_, 0, number, grid, {ErrorCode::input, {}, "values that chunk RNGE does not say"}));
        const std::lock_guard lock(mutex);
        all = merged(all, found);
      }
      return {};
    }));
  }
  const ValueRange found = all.lo <= all.hi
                               ? ValueRange{static_cast<double>(all.lo), static_cast<double>(all.hi)}
                               : ValueRange{1, 0};
  if (ranges && ranges->all != found)
    return bad_input(container_->name(), fmt::format("chunk RNGE 0.0: values of {} to {}: expected {} to {}",
                                                     ranges->all.lo, ranges->all.hi, found.lo, found.hi));
  return {};
}

Status PackedVolume::visit_masks(const std::function<Status(Index3 lo, const page::Mask& mask)>& take,
                                 Context& ctx) const {
  if (!is_color(info_.format))
    return bad_usage(fmt::format("masks of {} voxels: expected colours", name(info_.format)));
  if (finest_ > 0) return bad_usage("masks of a file that was cut: expected level 0");
  if (!params_.has_channels()) return visit_solid(*this, take, ctx);
  return svmm::visit_masks(*container_, *pages_, take, ctx);
}

VolumeInfo PackedVolume::info_of(int level) const {
  VolumeInfo info = info_;
  info.dims = levels_[static_cast<size_t>(level)].dims;
  const double factor = std::ldexp(1.0, level);
  info.affine = info.affine.coarser({factor, factor, factor});
  info.rounded = info.rounded || params_.max_error > 0;
  return info;
}

uint64_t PackedVolume::pages_decoded() const {
  return pages_->decoded;
}

namespace {

class PackedSource final : public VolumeSource {
 public:
  PackedSource(std::shared_ptr<const PackedVolume> volume, int level)
      : volume_(std::move(volume)), level_(level) {
    info_ = volume_->info_of(level);
  }
  Status read(const Box& box, VoxelSpan out) override { return volume_->decode(box, level_, out); }
  std::optional<Voxel> uniform(const Box& box) const override { return volume_->uniform(box, level_); }

 private:
  std::shared_ptr<const PackedVolume> volume_;
  int level_;
};

}  // namespace

Result<std::unique_ptr<VolumeSource>> open_source(std::shared_ptr<const PackedVolume> volume, int level) {
  const int levels = volume->params().levels;
  if (level < 0 || level >= levels)
    return bad_usage(fmt::format("--level {}: the file has levels 0 to {}", level, levels - 1));
  if (level < volume->finest())
    return bad_input(volume->container().name(),
                     fmt::format("level {} is not there, the file was cut: expected --level {}, or up to {}",
                                 level, volume->finest(), levels - 1));
  return std::make_unique<PackedSource>(std::move(volume), level);
}

}  // namespace voxkit::svmm
