// Measures of distance at the extremes, beside exact ones: structural similarity, and the sums of volumes.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/image/image.h"
#include "libmetrics/image_diff.h"
#include "libmetrics/ssim.h"
#include "libmetrics/volume_diff.h"
#include "tests/memory_volume.h"
#include "tests/stress/exact.h"
#include "tests/stress/report.h"
#include "tests/stress/search.h"

namespace voxkit::stress {
namespace {

Image image_of(int64_t width, int64_t height, SampleType type, const std::vector<float>& samples,
               Context& ctx) {
  Image image = must(Image::create(width, height, 1, type, ctx));
  std::copy_n(samples.begin(), width * height, image.row(0));
  return image;
}

// --- SSIM

/// The definition, window by window.
double exact_ssim(int64_t width, int64_t height, const std::vector<float>& a, const std::vector<float>& b,
                  double peak) {
  const int64_t nx = std::min<int64_t>(width, 11), ny = std::min<int64_t>(height, 11);
  const auto gaussian = [](int64_t taps) {
    std::vector<Exact> weights;
    Exact sum = 0;
    for (int64_t i = 0; i < taps; ++i) {
      const double x = static_cast<double>(i) - 0.5 * static_cast<double>(taps - 1);
      weights.push_back(std::exp(-x * x / (2 * 1.5 * 1.5)));
      sum += weights.back();
    }
    for (Exact& w : weights) w /= sum;
    return weights;
  };
  const auto gx = gaussian(nx), gy = gaussian(ny);
  const Exact c1 = Exact(0.01) * peak * (Exact(0.01) * peak), c2 = Exact(0.03) * peak * (Exact(0.03) * peak);
  Exact all = 0;
  int64_t windows = 0;
  for (int64_t y = 0; y + ny <= height; ++y)
    for (int64_t x = 0; x + nx <= width; ++x, ++windows) {
      const auto sum = [&](auto term) {
        Exact s = 0;
        for (int64_t j = 0; j < ny; ++j)
          for (int64_t i = 0; i < nx; ++i) {
            const auto at = static_cast<size_t>((y + j) * width + x + i);
            s += gx[static_cast<size_t>(i)] * gy[static_cast<size_t>(j)] * term(Exact(a[at]), Exact(b[at]));
          }
        return s;
      };
      const Exact ma = sum([](Exact p, Exact) { return p; }), mb = sum([](Exact, Exact q) { return q; });
      // From a sample of the window on: means of equal samples are off by a rounding, which may be more than
      // c2.
      const auto first = static_cast<size_t>(y * width + x);
      const Exact a0 = Exact(a[first]), b0 = Exact(b[first]);
      const Exact da = sum([&](Exact p, Exact) { return p - a0; }),
                  db = sum([&](Exact, Exact q) { return q - b0; });
      const Exact variances = sum(
          [&](Exact p, Exact q) { return (p - a0 - da) * (p - a0 - da) + (q - b0 - db) * (q - b0 - db); });
      const Exact covariance = sum([&](Exact p, Exact q) { return (p - a0 - da) * (q - b0 - db); });
      all += (2 * ma * mb + c1) / (ma * ma + mb * mb + c1) * (2 * covariance + c2) / (variances + c2);
    }
  return to_double(all / static_cast<Exact>(windows));
}

struct Pictures {
  int64_t width, height;
  std::vector<float> a, b;
};
/// Samples are few values in patterns, so that windows can be flat, steep, or both.
Pictures pictures_of(const Point& at, bool floats) {
  Pictures p{at[0], at[1], {}, {}};
  const auto value = [&](size_t i) { return floats ? float_of(at[i]) : static_cast<float>(at[i]); };
  for (int64_t i = 0; i < p.width * p.height; ++i) {
    const int64_t x = i % p.width, y = i / p.width;
    const bool other = at[2] == 0   ? false
                       : at[2] == 1 ? x == p.width / 2 && y == p.height / 2
                       : at[2] == 2 ? (x + y) % 2 != 0
                       : at[2] == 3 ? x > p.width / 2
                                    : (x * 7 + y * 3) % 5 == 0;
    p.a.push_back(other ? value(4) : value(5));
    const bool last = at[3] == 0   ? other
                      : at[3] == 1 ? i == 0
                      : at[3] == 2 ? y % 2 == 0
                                   : (x * 3 + y) % 4 == 0;
    p.b.push_back(last ? value(6) : value(7));
  }
  return p;
}
void ssim_row(SampleType type, const char* name, const Effort& effort, Report& report) {
  const bool floats = type == SampleType::f32;
  const Range value = floats ? finite_floats : Range{0, type == SampleType::u8 ? 255 : 65535};
  const std::vector<Range> ranges = {{1, 14}, {1, 14}, {0, 4}, {0, 3}, value, value, value, value};
  Context ctx = stress_context();
  std::vector<Point> starts;
  const int64_t top = floats ? number_of(1e8f) : value.hi;
  for (const int64_t pattern : {0, 1, 2, 3})
    for (const int64_t low : {top, top - 1, int64_t{0}})
      starts.push_back({12, 12, pattern, 0, top, low, top, top});
  int64_t outside = 0;
  const Worst found = climb(ranges, starts, effort.share(10), effort.seed, [&](const Point& at) {
    const Pictures p = pictures_of(at, floats);
    const Image a = image_of(p.width, p.height, type, p.a, ctx),
                b = image_of(p.width, p.height, type, p.b, ctx);
    const Ssim is = must(ssim(a, b, std::nullopt, ctx));
    const Ssim same = must(ssim(a, a, std::nullopt, ctx));
    outside += !(is.ssim >= -1.000001 && is.ssim <= 1 && is.ms_ssim >= 0 && is.ms_ssim <= 1) ||
               same.ssim != 1 || same.ms_ssim != 1;
    return std::abs(is.ssim - exact_ssim(p.width, p.height, p.a, p.b, a.peak()));
  });
  const Pictures p = pictures_of(found.at, floats);
  report.add(
      {fmt::format("SSIM, {}", name), "off by 1e-6; within −1 … 1; exactly 1 of equal images",
       fmt::format("{:.3g}; {} others", found.score, outside), found.score <= 1e-6 && outside == 0,
       found.tried,
       fmt::format("{}x{} patterns {},{} values {:a},{:a} {:a},{:a}", p.width, p.height, found.at[2],
                   found.at[3], *std::min_element(p.a.begin(), p.a.end()),
                   *std::max_element(p.a.begin(), p.a.end()), *std::min_element(p.b.begin(), p.b.end()),
                   *std::max_element(p.b.begin(), p.b.end()))});
}

// --- images with what is no number

bool same_number(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}
void odd_images(const Effort& effort, Report& report) {
  const std::vector<Range> ranges = {{1, 5}, {1, 5}, {0, 7}, {0, 7}, {0, 7}, {0, 7}};
  constexpr float inf = std::numeric_limits<float>::infinity();
  constexpr std::array<float, 8> values = {0,
                                           1,
                                           -0.0f,
                                           1e-45f,
                                           std::numeric_limits<float>::max(),
                                           inf,
                                           -inf,
                                           std::numeric_limits<float>::quiet_NaN()};
  Context ctx = stress_context();
  int64_t surprises = 0;
  Point surprise;
  const Worst found = climb(ranges, {}, effort.share(10), effort.seed, [&](const Point& at) {
    std::vector<float> a, b;
    for (int64_t i = 0; i < at[0] * at[1]; ++i) {
      a.push_back(values[static_cast<size_t>(i % 2 == 0 ? at[2] : at[3])]);
      b.push_back(values[static_cast<size_t>(i % 2 == 0 ? at[4] : at[5])]);
    }
    const Image image_a = image_of(at[0], at[1], SampleType::f32, a, ctx),
                image_b = image_of(at[0], at[1], SampleType::f32, b, ctx);
    const ImageDiff is = must(diff_images(image_a, image_b, std::nullopt, ctx));
    const Ssim similar = must(ssim(image_a, image_b, std::nullopt, ctx));
    // By the documented rules: NaN beside NaN is no error, beside a number an infinite one; and so is an
    // infinity beside anything but itself.
    Exact squares = 0;
    double greatest = 0;
    bool infinite = false, odd = false;
    for (size_t i = 0; i < a.size(); ++i) {
      odd |= !std::isfinite(a[i]) || !std::isfinite(b[i]);
      if (a[i] == b[i] || (std::isnan(a[i]) && std::isnan(b[i]))) continue;
      if (!std::isfinite(a[i]) || !std::isfinite(b[i])) {
        infinite = true;
        continue;
      }
      const Exact d = Exact(a[i]) - Exact(b[i]);
      squares += d * d;
      greatest = std::max(greatest, to_double(magnitude(d)));
    }
    const double mse = infinite ? HUGE_VAL : to_double(squares / static_cast<Exact>(a.size()));
    if (infinite) greatest = HUGE_VAL;
    const double psnr = mse == 0 ? HUGE_VAL : 10 * std::log10(1 / mse);
    const bool right = (mse == is.mse || std::abs(is.mse - mse) <= 1e-14 * mse) &&
                       is.max_abs_error == greatest &&
                       (same_number(is.psnr_db, psnr) || std::abs(is.psnr_db - psnr) < 1e-9) &&
                       std::isnan(similar.ssim) == odd && std::isnan(similar.ms_ssim) == odd;
    if (!right) ++surprises, surprise = at;
    return static_cast<double>(surprises) + 1e-3 * (odd + infinite + (mse > 0));
  });
  std::string input;
  for (const int64_t v : surprises > 0 ? surprise : found.at) input += fmt::format("{} ", v);
  report.add({"images with NaN and infinities, from one pixel on",
              "errors as documented; SSIM NaN where there is one, and only there",
              fmt::format("{} others", surprises), surprises == 0, found.tried, input});
}

// --- volumes

/// A volume of one value but for a box of another: sums of any size at no cost.
class TwoValues : public VolumeSource {
 public:
  TwoValues(const VolumeInfo& info, const Box& box, const Voxel& inside, const Voxel& outside)
      : box_(box), inside_(inside), outside_(outside) {
    info_ = info;
  }
  Status read(const Box& wanted, VoxelSpan out) override {
    const int bytes = voxel_bytes(info_.format);
    for (int64_t z = wanted.lo.z; z < wanted.hi.z; ++z)
      for (int64_t y = wanted.lo.y; y < wanted.hi.y; ++y)
        for (int64_t x = wanted.lo.x; x < wanted.hi.x; ++x)
          std::memcpy(out.row(y - wanted.lo.y, z - wanted.lo.z) + (x - wanted.lo.x) * bytes,
                      (box_.contains({x, y, z}) ? inside_ : outside_).bytes.data(),
                      static_cast<size_t>(bytes));
    return {};
  }
  std::optional<Voxel> uniform(const Box& wanted) const override {
    if (box_.contains(wanted)) return inside_;
    return intersect(box_, wanted).empty() ? std::optional(outside_) : std::nullopt;
  }

 private:
  Box box_;
  Voxel inside_, outside_;
};

/// 2^33 voxels and more: their sums beside exact ones, relatively.
void sums(SampleType type, const char* name, double promised, const Effort& effort, Report& report) {
  const bool floats = type == SampleType::f32;
  const Range value = floats ? finite_floats : Range{0, type == SampleType::u8 ? 255 : 65535};
  // Sides in 2^10 voxels, a box in voxels, and four values.
  const std::vector<Range> ranges = {{1, 4},  {1, 4}, {1, 4}, {0, 40}, {0, 40},
                                     {0, 40}, value,  value,  value,   value};
  const std::vector<Point> starts = {{2, 2, 2, 9, 9, 9, value.hi, value.lo, 0, value.hi},
                                     {4, 4, 4, 1, 1, 1, value.lo, value.hi, 0, value.lo}};
  Context ctx = stress_context();
  const Worst found = climb(ranges, starts, effort.share(200), effort.seed, [&](const Point& at) {
    const VolumeInfo info = test::scalar_info({at[0] << 10, at[1] << 10, at[2] << 10}, type);
    const auto voxel = [&](size_t i) {
      return floats ? Voxel::of(float_of(at[i])) : Voxel::of(static_cast<uint32_t>(at[i]));
    };
    const auto sample = [&](size_t i) { return floats ? Exact(float_of(at[i])) : static_cast<Exact>(at[i]); };
    const Box box{{500, 600, 700}, {500 + at[3], 600 + at[4], 700 + at[5]}};
    TwoValues a(info, box, voxel(6), voxel(7)), b(info, box, voxel(8), voxel(9));
    const VolumeDiff is = must(diff_volumes(a, b, 1.0, nullptr, ctx));
    const auto inside = static_cast<Exact>(box.voxels()), all = static_cast<Exact>(info.box().voxels()),
               outside = all - inside;
    const Exact din = magnitude(sample(6) - sample(8)), dout = magnitude(sample(7) - sample(9));
    const Exact mse = (inside * din * din + outside * dout * dout) / all,
                mean = (inside * din + outside * dout) / all;
    const Exact signal = (inside * sample(6) * sample(6) + outside * sample(7) * sample(7)) / all;
    const auto off = [](double is_value, Exact expected) {
      return expected == 0 ? std::abs(is_value) : to_double(magnitude(Exact(is_value) - expected) / expected);
    };
    double worst = std::max({off(is.mse, mse), off(is.mean_abs_error, mean), off(is.rmse, root(mse))});
    const double psnr = mse == 0 ? HUGE_VAL : -10 * std::log10(to_double(mse));
    const double snr = mse == 0      ? HUGE_VAL
                       : signal == 0 ? -HUGE_VAL
                                     : 10 * std::log10(to_double(signal / mse));
    const auto decibels = [&](double d, double expected) {
      if (d != expected && !(std::abs(d - expected) <= 1e-10 * std::max(1.0, std::abs(expected))))
        worst = 1e9;
    };
    decibels(is.psnr_db, psnr);
    decibels(is.snr_db, snr);
    if (is.max_abs_error != std::max(box.empty() ? 0 : to_double(din), to_double(dout))) worst = 1e9;
    return worst;
  });
  std::string input;
  for (const int64_t v : found.at) input += fmt::format("{} ", v);
  report.add({fmt::format("sums of up to 2^36 voxels, {}", name),
              fmt::format("relatively off by {:.3g}", promised), fmt::format("{:.3g}", found.score),
              found.score <= promised, found.tried, input});
}

/// The same for colours: errors per channel and of the vector, alpha apart.
void color_sums(const Effort& effort, Report& report) {
  const Range color{0, 0xffffffff};
  const std::vector<Range> ranges = {{1, 4},  {1, 4}, {1, 4}, {0, 40}, {0, 40},
                                     {0, 40}, color,  color,  color,   color};
  const std::vector<Point> starts = {{2, 2, 2, 9, 9, 9, 0xffffffff, 0, 0, 0xffffffff},
                                     {4, 4, 4, 1, 1, 1, 0, 0, 1, 0}};
  Context ctx = stress_context();
  const Worst found = climb(ranges, starts, effort.share(200), effort.seed, [&](const Point& at) {
    const VolumeInfo info = test::color_info({at[0] << 10, at[1] << 10, at[2] << 10}, VoxelFormat::rgba32);
    const Box box{{500, 600, 700}, {500 + at[3], 600 + at[4], 700 + at[5]}};
    const auto voxel = [&](size_t i) { return Voxel::of(static_cast<uint32_t>(at[i])); };
    TwoValues a(info, box, voxel(6), voxel(7)), b(info, box, voxel(8), voxel(9));
    const VolumeDiff is = must(diff_volumes(a, b, std::nullopt, nullptr, ctx));
    const auto squares = [&](size_t p, size_t q, int channels) {
      int64_t sum = 0;
      for (int c = 0; c < channels; ++c) {
        const int64_t d = (at[p] >> (8 * c) & 255) - (at[q] >> (8 * c) & 255);
        sum += d * d;
      }
      return static_cast<Exact>(sum);
    };
    const auto inside = static_cast<Exact>(box.voxels()), all = static_cast<Exact>(info.box().voxels());
    const Exact rgb = inside * squares(6, 8, 3) + (all - inside) * squares(7, 9, 3),
                rgba = inside * squares(6, 8, 4) + (all - inside) * squares(7, 9, 4);
    const auto off = [](double is_value, Exact expected) {
      return expected == 0 ? std::abs(is_value) : to_double(magnitude(Exact(is_value) - expected) / expected);
    };
    return std::max({off(is.mse, rgba / (4 * all)), off(*is.grmse, root(rgb / (3 * all))),
                     off(*is.grmse_distance, root(rgb / all))});
  });
  std::string input;
  for (const int64_t v : found.at) input += fmt::format("{} ", v);
  report.add({"sums of up to 2^36 voxels, RGBA: MSE, GRMSE", "relatively off by 1e-15",
              fmt::format("{:.3g}", found.score), found.score <= 1e-15, found.tried, input});
}

/// A volume of many different floats, as its rows are added one by one.
void float_rows(const Effort& effort, Report& report) {
  const std::vector<Range> ranges = {finite_floats, finite_floats, {1, 4096}, {0, 30}};
  Context ctx = stress_context();
  constexpr int64_t width = 4096, height = 16;
  const VolumeInfo info = test::scalar_info({width, height, 1}, SampleType::f32);
  const VolumeInfo zero_info = info;
  const std::vector<float> zeros(width * height);
  test::MemorySource zero(zero_info, test::bytes_of(zeros));
  const Worst found = climb(ranges, {}, effort.share(100), effort.seed, [&](const Point& at) {
    std::vector<float> values;
    Exact squares = 0, absolute = 0;
    for (int64_t i = 0; i < width * height; ++i) {
      const float v = float_of(i % at[2] == 0 ? at[0] : at[1]);
      values.push_back(v);
      squares += Exact(v) * Exact(v);
      absolute += magnitude(Exact(v));
    }
    test::MemorySource source(info, test::bytes_of(values));
    const VolumeDiff is = must(diff_volumes(source, zero, 1.0, nullptr, ctx));
    const Exact n = static_cast<Exact>(width * height);
    const auto off = [](double is_value, Exact expected) {
      return expected == 0 ? std::abs(is_value) : to_double(magnitude(Exact(is_value) - expected) / expected);
    };
    return std::max(off(is.mse, squares / n), off(is.mean_abs_error, absolute / n));
  });
  report.add({"sums of 65536 floats", "relatively off by 1e-12", fmt::format("{:.3g}", found.score),
              found.score <= 1e-12, found.tried,
              fmt::format("every {} is {:a}, others {:a}", found.at[2], float_of(found.at[0]),
                          float_of(found.at[1]))});
}

void fill(const Effort& effort, Report& report) {
  ssim_row(SampleType::u8, "8 bits", effort, report);
  ssim_row(SampleType::u16, "16 bits", effort, report);
  ssim_row(SampleType::f32, "floats", effort, report);
  odd_images(effort, report);
  sums(SampleType::u8, "u8", 1e-15, effort, report);
  sums(SampleType::u16, "u16", 1e-15, effort, report);
  sums(SampleType::f32, "floats", 1e-11, effort, report);
  color_sums(effort, report);
  float_rows(effort, report);
}

}  // namespace
}  // namespace voxkit::stress

int main(int argc, char** argv) {
  return voxkit::stress::stress_main(argc, argv, "stress_metrics", "Measures", 100000, voxkit::stress::fill);
}
