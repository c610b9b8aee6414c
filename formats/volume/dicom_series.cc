#include "formats/volume/dicom_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>

#include "formats/natural_order.h"
#include "formats/volume/parts.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;
using Vector = std::array<double, 3>;

constexpr double same_place = 1e-4;      ///< mm
constexpr double uneven = 0.02;          ///< of the distance of slices
constexpr size_t most_filled = 1 << 16;  ///< slices that are not there

double dot(const Vector& a, const std::vector<double>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

std::string file_name(const std::string& path) {
  return fs::path(path).filename().string();
}

/// The series that an option names: its number in the list, or the end of its UID.
Result<std::string> choose_series(const std::string& name, const std::vector<DicomHeader>& headers,
                                  const OpenOptions& options, std::vector<std::string>& parts) {
  struct Series {
    size_t slices = 0;
    std::string description;
  };
  std::map<std::string, Series> all;
  for (const DicomHeader& h : headers) {
    Series& series = all[h.series];
    series.slices += h.frames.size();
    series.description = h.description;
  }
  std::vector<std::string> uids;
  std::string list;
  for (const auto& [uid, series] : all) {
    if (list.size() < 600)
      list += fmt::format("{}{}: {} ({} slices{}{})", list.empty() ? "" : ", ", uids.size(),
                          uid.empty() ? "no identifier" : uid, series.slices,
                          series.description.empty() ? "" : ", ", series.description);
    uids.push_back(uid);
  }
  const auto chosen = [&](size_t i) {
    if (uids.size() > 1) parts.push_back(fmt::format("--series {} of {}", i, list));
    return uids[i];
  };
  if (options.series.empty()) {
    if (uids.size() == 1 || options.any_part) return chosen(0);
    return bad_input(name, fmt::format("slices of {} series: expected --series N or ID with one of {}",
                                       uids.size(), list));
  }
  const std::string& word = options.series;
  std::vector<size_t> matches;
  for (size_t i = 0; i < uids.size(); ++i)
    if (uids[i] == word) return chosen(i);
  size_t number = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error == std::errc() && stop == word.data() + word.size() && number < uids.size())
    return chosen(number);
  for (size_t i = 0; i < uids.size(); ++i)
    if (uids[i].ends_with(word)) matches.push_back(i);
  if (matches.size() == 1) return chosen(matches[0]);
  return bad_input(name, fmt::format("--series {}: {} such series: expected one of {}", word,
                                     matches.empty() ? "no" : "several", list));
}

Status check_alike(const DicomPlan& plan, const DicomSlice& slice) {
  const DicomSlice& start = plan.slices.front();
  const DicomHeader &first = plan.header(start), &h = plan.header(slice);
  const DicomFrame &first_frame = plan.frame(start), &frame = plan.frame(slice);
  const auto differs = [&](const char* what) {
    return bad_input(
        h.path, fmt::format("{} differs from that of {}: expected one for all slices", what, first.path));
  };
  const auto near = [](const std::vector<double>& a, const std::vector<double>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](double x, double y) { return std::abs(x - y) < 1e-3; });
  };
  if (h.rows != first.rows || h.columns != first.columns) return differs("size of the image");
  if (h.bits_allocated != first.bits_allocated || h.bits_stored != first.bits_stored ||
      h.high_bit != first.high_bit || h.is_signed != first.is_signed || h.is_float != first.is_float ||
      h.samples != first.samples)
    return differs("pixel type");
  if (h.photometric != first.photometric) return differs("photometric interpretation");
  if (h.padding != first.padding) return differs("pixel padding value");
  if (!near(frame.pixel_spacing, first_frame.pixel_spacing)) return differs("pixel spacing");
  if (!near(frame.orientation, first_frame.orientation)) return differs("orientation");
  return {};
}

/// Puts slices in order of what is less by `before`, which numbers them all, or by the names of files.
void sort_by_number(DicomPlan& plan) {
  std::set<int64_t> instances;
  for (const DicomHeader& h : plan.files)
    if (h.instance) instances.insert(*h.instance);
  const bool numbered = instances.size() == plan.files.size();
  std::stable_sort(plan.slices.begin(), plan.slices.end(), [&](const DicomSlice& a, const DicomSlice& b) {
    if (a.file == b.file) return a.frame < b.frame;
    const DicomHeader &x = plan.header(a), &y = plan.header(b);
    return numbered ? *x.instance < *y.instance : natural_less(x.path, y.path);
  });
}

class Planner {
 public:
  Planner(const std::string& name, const OpenOptions& options, Context& ctx, DicomPlan& plan)
      : name_(name), options_(options), ctx_(ctx), plan_(plan) {}

  Status run() {
    for (size_t f = 0; f < plan_.files.size(); ++f)
      for (size_t k = 0; k < plan_.files[f].frames.size(); ++k) plan_.slices.push_back({f, k});
    for (const DicomSlice& slice : plan_.slices) VOX_CHECK(check_alike(plan_, slice));
    const DicomFrame& first = plan_.frame(plan_.slices.front());
    const std::vector<double> o = first.orientation;
    const bool placed = !o.empty() && std::all_of(plan_.slices.begin(), plan_.slices.end(),
                                                  [&](auto& s) { return !plan_.frame(s).position.empty(); });
    if (!o.empty()) {
      normal_ = {o[1] * o[5] - o[2] * o[4], o[2] * o[3] - o[0] * o[5], o[0] * o[4] - o[1] * o[3]};
      const double length =
          std::sqrt(normal_[0] * normal_[0] + normal_[1] * normal_[1] + normal_[2] * normal_[2]);
      if (!(std::abs(length - 1) < 0.01))
        return bad_input(plan_.files.front().path,
                         "orientation is none: expected two unit vectors at right angles");
    }
    if (placed) {
      VOX_CHECK(sort_by_place());
    } else {
      sort_by_number(plan_);
      VOX_CHECK(split_films());
    }
    place_axes(placed);
    if (placed && plan_.slices.size() > 1) VOX_CHECK(check_distances());
    if (!plan_.affine.is_valid())
      return bad_input(plan_.files.front().path, "its places are those of no volume: expected finite ones");
    return {};
  }

 private:
  double along(const DicomSlice& slice) const { return dot(normal_, plan_.frame(slice).position); }
  /// What orders slices of one place in time.
  std::pair<double, int64_t> moment(const DicomSlice& slice) const {
    const DicomHeader& h = plan_.header(slice);
    const auto frame = static_cast<int64_t>(slice.frame);
    return {plan_.frame(slice).time, h.frames.size() > 1 ? frame : h.instance.value_or(0)};
  }

  /// By place along the normal; where each place has several slices, these are time steps.
  Status sort_by_place() {
    auto& slices = plan_.slices;
    std::stable_sort(slices.begin(), slices.end(),
                     [&](const DicomSlice& a, const DicomSlice& b) { return along(a) < along(b); });
    std::vector<std::vector<DicomSlice>> places;
    for (const DicomSlice& slice : slices) {
      if (places.empty() || along(slice) - along(places.back().front()) >= same_place) places.emplace_back();
      places.back().push_back(slice);
    }
    const size_t times = places.front().size();
    for (auto& place : places) {
      std::stable_sort(place.begin(), place.end(),
                       [&](const DicomSlice& a, const DicomSlice& b) { return moment(a) < moment(b); });
      for (size_t i = 1; i < place.size(); ++i)
        if (place.size() != times || moment(place[i]) == moment(place[i - 1]))
          return bad_input(plan_.header(place[i]).path,
                           fmt::format("lies where {} lies: expected one slice at each position, or as many "
                                       "time steps at each",
                                       plan_.header(place[i - 1]).path));
      if (place.size() != times)
        return bad_input(plan_.header(places.front().back()).path,
                         fmt::format("{} slices at one position, {} at another: expected as many at each",
                                     times, place.size()));
    }
    VOX_TRY(const int64_t time, choose_time(static_cast<int64_t>(times)));
    slices.clear();
    for (const auto& place : places) slices.push_back(place[static_cast<size_t>(time)]);
    return {};
  }

  /// Frames of a film are time steps of one slice each.
  Status split_films() {
    if (!plan_.files.front().frames_are_times) return {};
    VOX_TRY(const int64_t time, choose_time(std::ssize(plan_.files.front().frames)));
    std::erase_if(plan_.slices, [&](const DicomSlice& s) { return static_cast<int64_t>(s.frame) != time; });
    if (plan_.slices.empty()) return bad_input(name_, "films of different lengths: expected one");
    return {};
  }

  Result<int64_t> choose_time(int64_t times) {
    VolumeInfo info;
    VOX_TRY(const auto chosen, choose_parts(name_,
                                            {{"--time", "time steps", times, options_.time},
                                             {"--channel", "channels", 1, options_.channel}},
                                            options_, info));
    plan_.parts.insert(plan_.parts.end(), info.parts.begin(), info.parts.end());
    return chosen[0];
  }

  /// Says which lengths are assumed because the file has none, or none that can be. Where directions are not
  /// said either, 1 is no claim. Of several slices places say the distance, or another note does.
  void tell_assumed(const DicomFrame& first, double distance) {
    if (first.odd_spacing)
      ctx_.note(fmt::format("{}: its distances of pixels are not two numbers above 0: {}", name_,
                            first.pixel_spacing.empty() ? "1 is assumed" : "those of all frames are taken"));
    else if (first.pixel_spacing.empty() && !first.orientation.empty())
      ctx_.note(fmt::format("{}: does not say how far apart its pixels are: 1 mm is assumed", name_));
    if (first.odd_thickness && plan_.slices.size() == 1)
      ctx_.note(
          fmt::format("{}: its distance of slices is no number above 0: {} mm is assumed", name_, distance));
  }

  void place_axes(bool placed) {
    const auto& slices = plan_.slices;
    const DicomFrame &first = plan_.frame(slices.front()), &last = plan_.frame(slices.back());
    double row = 1, column = 1;
    if (!first.pixel_spacing.empty()) {
      row = first.pixel_spacing[0];
      column = first.pixel_spacing[1];
      plan_.unit = Unit::millimetre;
    }
    const double distance = first.thickness > 0 ? first.thickness : 1;
    tell_assumed(first, distance);
    if (slices.size() > 1 && !placed)
      ctx_.note(
          fmt::format("{}: its slices do not say where they lie: in the order of their {}, taken to be {} "
                      "mm apart",
                      name_, plan_.files.size() > 1 ? "numbers" : "frames", distance));
    const auto& o = first.orientation;
    if (o.empty()) {
      plan_.affine = Affine::plain({column, row, distance}, {});
      if (!first.position.empty()) std::copy_n(first.position.begin(), 3, plan_.affine.origin.begin());
      if (!first.position.empty()) plan_.world = World::lps, plan_.unit = Unit::millimetre;
      return;
    }
    plan_.world = World::lps;
    plan_.unit = Unit::millimetre;
    for (size_t a = 0; a < 3; ++a) {
      plan_.affine.axes[0][a] = o[a] * column;
      plan_.affine.axes[1][a] = o[3 + a] * row;
      plan_.affine.axes[2][a] = normal_[a] * distance;
      if (!first.position.empty()) plan_.affine.origin[a] = first.position[a];
      if (placed && slices.size() > 1)
        plan_.affine.axes[2][a] =
            (last.position[a] - first.position[a]) / static_cast<double>(slices.size() - 1);
    }
    for (Vector& axis : plan_.affine.axes)
      for (double& x : axis) x += 0.0;  // no negative zeros
  }

  /// That slices lie at equal distances on a line; else what the option says is done about it.
  Status check_distances() {
    auto& slices = plan_.slices;
    std::vector<double> gaps;
    for (size_t i = 1; i < slices.size(); ++i) gaps.push_back(along(slices[i]) - along(slices[i - 1]));
    // The distance that most have; of several the least.
    std::vector<double> sorted = gaps;
    std::sort(sorted.begin(), sorted.end());
    double unit = sorted.front();
    size_t most = 0;
    for (size_t i = 0, end = 0; i < sorted.size(); ++i) {
      while (end < sorted.size() && sorted[end] <= sorted[i] * (1 + uneven)) ++end;
      if (end - i > most) most = end - i, unit = sorted[(i + end - 1) / 2];
    }
    const double slack = std::max(uneven * unit, 10 * same_place);
    std::vector<int64_t> missing;
    std::string first_wrong, unfit;  // what is wrong first, and what no slices fill
    for (size_t i = 0; i < gaps.size(); ++i) {
      const double ratio = std::round(gaps[i] / unit);
      const bool fits = ratio >= 1 && ratio < static_cast<double>(most_filled) &&
                        std::abs(gaps[i] - ratio * unit) <= slack * ratio;
      missing.push_back(fits ? static_cast<int64_t>(ratio) - 1 : 0);
      if (fits && ratio == 1) continue;
      const std::string between =
          fmt::format("between {} at {:.6g} mm and {} at {:.6g} mm", file_name(plan_.header(slices[i]).path),
                      along(slices[i]), file_name(plan_.header(slices[i + 1]).path), along(slices[i + 1]));
      const double next = along(slices[i]) + unit;
      const std::string wrong =
          !fits ? fmt::format("slices are unevenly far apart: {:.6g} mm, but {:.6g} mm {}", unit, gaps[i],
                              between)
          : ratio == 2 ? fmt::format("the slice at {:.6g} mm is missing, {}", next, between)
                       : fmt::format("{} slices from {:.6g} mm on are missing, {}", ratio - 1, next, between);
      if (first_wrong.empty()) first_wrong = wrong;
      if (!fits && unfit.empty()) unfit = wrong;
    }
    if (first_wrong.empty()) return check_line();
    if (options_.gaps == OpenOptions::Gaps::refuse && !options_.any_part)
      return bad_input(name_, first_wrong + ": expected equal distances, or --gaps accept or fill");
    ctx_.note(name_ + ": " + first_wrong);
    const double count = static_cast<double>(slices.size() - 1);
    if (options_.gaps != OpenOptions::Gaps::fill) {
      ctx_.note(fmt::format("{}: slices are taken to be {:.6g} mm apart", name_,
                            (along(slices.back()) - along(slices.front())) / count));
      return {};
    }
    if (!unfit.empty())
      return bad_input(name_, unfit + ": no whole number of slices fills it: expected --gaps accept");
    std::vector<DicomSlice> filled{slices.front()};
    for (size_t i = 1; i < slices.size(); ++i) {
      const auto empty = static_cast<size_t>(missing[i - 1]);
      if (filled.size() + empty > slices.size() + most_filled)
        return bad_input(name_, fmt::format("more than {} slices are missing", most_filled));
      filled.insert(filled.end(), empty, DicomSlice{});
      filled.push_back(slices[i]);
    }
    const auto steps = static_cast<double>(filled.size() - 1);
    for (double& x : plan_.affine.axes[2]) x *= count / steps;
    slices = std::move(filled);
    return {};
  }

  Status check_line() const {
    const double slack = std::max(uneven * std::abs(along(plan_.slices[1]) - along(plan_.slices[0])), 0.01);
    for (size_t i = 0; i < plan_.slices.size(); ++i) {
      const Vector at = plan_.affine.place({0, 0, static_cast<double>(i)});
      const auto& position = plan_.frame(plan_.slices[i]).position;
      for (size_t a = 0; a < 3; ++a)
        if (std::abs(at[a] - position[a]) > slack && options_.gaps != OpenOptions::Gaps::accept)
          return bad_input(
              plan_.header(plan_.slices[i]).path,
              fmt::format("its corner lies at {:.6g}, {:.6g}, {:.6g} mm, off the line through the "
                          "others: expected one line, or --gaps accept",
                          position[0], position[1], position[2]));
    }
    return {};
  }

  const std::string& name_;
  const OpenOptions& options_;
  Context& ctx_;
  DicomPlan& plan_;
  Vector normal_{};
};

}  // namespace

Result<std::vector<DicomHeader>> find_dicom(const std::string& name) {
  std::vector<DicomHeader> headers;
  std::error_code error;
  std::string folder = name;
  if (!fs::is_directory(name, error)) {
    VOX_TRY(auto header, read_dicom_header(name));
    if (header) {
      headers.push_back(std::move(*header));
      return headers;
    }
    std::string last = fs::path(name).filename().string();
    for (char& c : last) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    if (last != "DICOMDIR") return bad_input(name, "no DICOM image: expected one with pixels");
    folder = fs::path(name).parent_path().string();
    if (folder.empty()) folder = ".";
  }
  error.clear();
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    VOX_CHECK(check_interrupt());
    std::error_code ignored;
    if (!it->is_regular_file(ignored)) continue;
    VOX_TRY(auto header, read_dicom_header(it->path().string()));
    if (header) headers.push_back(std::move(*header));
  }
  if (error) return bad_input(folder, "cannot read the folder: " + error.message());
  if (headers.empty()) return bad_input(folder, "no DICOM images in this folder");
  // The order of a folder's entries is chance: messages shall not depend on it.
  std::sort(headers.begin(), headers.end(), [](auto& a, auto& b) { return natural_less(a.path, b.path); });
  return headers;
}

Result<DicomPlan> plan_dicom(const std::string& name, std::vector<DicomHeader> headers,
                             const OpenOptions& options, Context& ctx) {
  DicomPlan plan;
  VOX_TRY(const std::string series, choose_series(name, headers, options, plan.parts));
  for (DicomHeader& h : headers)
    if (h.series == series) plan.files.push_back(std::move(h));
  VOX_CHECK(Planner(name, options, ctx, plan).run());
  return plan;
}

}  // namespace voxkit
