#include <algorithm>
#include <limits>

#include "formats/cpu.h"
#include "libpage/decode_kernel.h"
#include "libpage/page.h"

namespace voxkit::page {
namespace {

/// Decodes the pages of some lanes, all of one extent, row by row. What they become does not depend on the
/// type of samples, so that there are few of these, which are much to compile.
template <class Width, int lane_count, bool masked, bool avx2>
[[gnu::always_inline]] inline void decode_rows_body(const ModelData& model, Extent extent,
                                                    std::array<Lane<Width>, lane_count>& lanes,
                                                    std::array<typename Width::Stored*, lane_count> out) {
  using Stored = typename Width::Stored;
  decode_lanes<Width, lane_count, masked, avx2>(
      model, extent, lanes, [&](size_t n, const Stored* row) __attribute__((always_inline)) {
        std::copy(row, row + extent.nx, out[n]);
        out[n] += extent.nx;
      });
}

template <class Width, int lane_count, bool masked>
void decode_rows_anywhere(const ModelData& model, Extent extent, std::array<Lane<Width>, lane_count>& lanes,
                          const std::array<typename Width::Stored*, lane_count>& out) {
  decode_rows_body<Width, lane_count, masked, false>(model, extent, lanes, out);
}
#ifdef VOXKIT_AVX2
template <class Width, int lane_count, bool masked>
VOXKIT_AVX2_CODE void decode_rows_avx2(const ModelData& model, Extent extent,
                                       std::array<Lane<Width>, lane_count>& lanes,
                                       const std::array<typename Width::Stored*, lane_count>& out) {
  decode_rows_body<Width, lane_count, masked, true>(model, extent, lanes, out);
}
#endif

/// The same on every machine, and as fast as it can.
template <class Width, int lane_count, bool masked>
void decode_rows(const ModelData& model, Extent extent, std::array<Lane<Width>, lane_count>& lanes,
                 const std::array<typename Width::Stored*, lane_count>& out) {
#ifdef VOXKIT_AVX2
  if (has_avx2()) return decode_rows_avx2<Width, lane_count, masked>(model, extent, lanes, out);
#endif
  decode_rows_anywhere<Width, lane_count, masked>(model, extent, lanes, out);
}

/// Pages of one extent, all of them with residuals.
template <class Width, int lane_count, bool masked, class T>
void decode_group(const ModelData& model, const PageJob<T>* const* jobs, bool* whole) {
  using Stored = typename Width::Stored;
  std::array<Lane<Width>, lane_count> lanes;
  std::array<std::array<Stored, max_voxels>, lane_count> values;
  std::array<Stored*, lane_count> out;
  for (size_t n = 0; n < lane_count; ++n) {
    lanes[n].coder.open(jobs[n]->page);
    lanes[n].mask = jobs[n]->mask;
    out[n] = values[n].data();
    if (model.classes.parents) load_parents(model, jobs[n]->parent, jobs[n]->extent, lanes[n].memory);
  }
  decode_rows<Width, lane_count, masked>(model, jobs[0]->extent, lanes, out);
  const uint32_t* const palette = model.palette.empty() ? nullptr : model.palette.data();
  for (size_t n = 0; n < lane_count; ++n) {
    whole[n] = lanes[n].coder.finished();
    T* const samples = jobs[n]->out.data();
    for (size_t i = 0; i < jobs[n]->out.size(); ++i) {
      const uint32_t value = static_cast<uint32_t>(values[n][i]) + static_cast<uint32_t>(Width::offset);
      samples[i] = static_cast<T>(palette ? palette[value] : value);
    }
  }
}

template <class T>
Status usable(const Model& model, const PageJob<T>& job) {
  if (!job.extent.valid() || job.out.size() != static_cast<size_t>(job.extent.voxels()))
    return bad_usage("a page decoded into another number of samples than its extent: expected room for all");
  if (model.has_parents() && !covers(job.parent, job.extent))
    return bad_usage(
        "a page decoded without the parents of all its voxels: expected those that its model has");
  if (model.max_sample() > std::numeric_limits<T>::max())
    return bad_usage("a page decoded into samples of too few bits: expected those of its model");
  if (job.mask && model.data().labels) return bad_usage("labels with void voxels: expected all to be solid");
  if (job.mask && model.data().wide())
    return bad_usage("a page with void voxels of more than 16 bits: expected a model of at most so many");
  return {};
}

/// Pages without residuals. False: it has some.
template <class T>
bool decode_constant(const ModelData& model, const PageJob<T>& job, bool& whole) {
  whole = true;
  if (job.page.size() > model.value_bytes()) return false;
  const auto value = model.value_of(job.page);
  whole = value.has_value();
  if (whole) std::ranges::fill(job.out, sample_of<T>(model, *value));
  return true;
}

template <class T>
bool decode_names(const LabelTables& tables, const PageJob<T>& job) {
  std::vector<uint32_t> parents;
  std::array<uint32_t, max_voxels> values;
  const auto room = std::span(values).first(job.out.size());
  const bool whole = decode_labels(tables, job.page, job.extent, widened(job.parent, parents), room);
  std::ranges::transform(room, job.out.begin(), [](uint32_t value) { return static_cast<T>(value); });
  return whole;
}

Status damaged() {
  return bad_input({},
                   "page: it does not end where its symbols end: expected a page of this model and extent");
}

template <class T>
Status decode_all(const Model& shared, std::span<const PageJob<T>> jobs, size_t* failed) {
  const ModelData& model = shared.data();
  for (const PageJob<T>& job : jobs) VOX_CHECK(usable(shared, job));
  size_t bad = jobs.size();
  constexpr size_t group = 2;
  std::array<const PageJob<T>*, group> waiting;
  size_t count = 0;
  const auto judge = [&](const PageJob<T>* job, bool whole) {
    if (!whole) bad = std::min(bad, static_cast<size_t>(job - jobs.data()));
  };
  const auto decode_waiting = [&] {
    std::array<bool, group> whole{};
    if (count == group) {
      if (model.wide())
        decode_group<Wide, group, false>(model, waiting.data(), whole.data());
      else
        decode_group<Narrow, group, false>(model, waiting.data(), whole.data());
    } else if (count == 1) {
      if (model.wide())
        decode_group<Wide, 1, false>(model, waiting.data(), whole.data());
      else
        decode_group<Narrow, 1, false>(model, waiting.data(), whole.data());
    }
    for (size_t n = 0; n < count; ++n) judge(waiting[n], whole[n]);
    count = 0;
  };
  for (const PageJob<T>& job : jobs) {
    bool whole = true;
    if (decode_constant(model, job, whole)) {
      judge(&job, whole);
      continue;
    }
    if (model.labels) {
      judge(&job, decode_names(*model.labels, job));
      continue;
    }
    if (job.mask && *job.mask != full_mask(job.extent)) {
      const PageJob<T>* const alone = &job;
      decode_group<Narrow, 1, true>(model, &alone, &whole);
      judge(&job, whole);
      continue;
    }
    if (count != 0 && waiting[0]->extent != job.extent) decode_waiting();
    waiting[count++] = &job;
    if (count == group) decode_waiting();
  }
  decode_waiting();
  if (failed) *failed = bad;
  if (bad != jobs.size()) return damaged();
  return {};
}

template <class T>
Status decode_one(const Model& model, std::span<const std::byte> page, Extent extent, std::span<T> out,
                  const Parent<T>& parent, const Mask* mask) {
  const PageJob<T> job{page, extent, out, parent, mask};
  return decode_all<T>(model, std::span<const PageJob<T>>(&job, 1), nullptr);
}

}  // namespace

Result<std::optional<uint32_t>> uniform_sample(const Model& model, std::span<const std::byte> page) {
  const ModelData& data = model.data();
  if (page.size() > data.value_bytes()) return std::nullopt;
  const auto value = data.value_of(page);
  if (!value) return tl::unexpected<Error>(damaged().error());
  return sample_of<uint32_t>(data, *value);
}

Status decode_page(const Model& model, std::span<const std::byte> page, Extent extent, std::span<uint8_t> out,
                   const Parent<uint8_t>& parent, const Mask* mask) {
  return decode_one(model, page, extent, out, parent, mask);
}
Status decode_page(const Model& model, std::span<const std::byte> page, Extent extent,
                   std::span<uint16_t> out, const Parent<uint16_t>& parent, const Mask* mask) {
  return decode_one(model, page, extent, out, parent, mask);
}
Status decode_page(const Model& model, std::span<const std::byte> page, Extent extent,
                   std::span<uint32_t> out, const Parent<uint32_t>& parent, const Mask* mask) {
  return decode_one(model, page, extent, out, parent, mask);
}
Status decode_pages(const Model& model, std::span<const PageJob<uint8_t>> jobs, size_t* failed) {
  return decode_all(model, jobs, failed);
}
Status decode_pages(const Model& model, std::span<const PageJob<uint16_t>> jobs, size_t* failed) {
  return decode_all(model, jobs, failed);
}
Status decode_pages(const Model& model, std::span<const PageJob<uint32_t>> jobs, size_t* failed) {
  return decode_all(model, jobs, failed);
}

}  // namespace voxkit::page
