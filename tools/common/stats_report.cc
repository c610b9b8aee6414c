#include "tools/common/stats_report.h"

#include <fmt/format.h>

#include <algorithm>

namespace voxkit::cli {
namespace {

/// Of colours; the only channel of scalars has none.
std::string_view channel_name(const VolumeStats& stats, size_t channel) {
  constexpr std::string_view names[] = {"red", "green", "blue", "alpha"};
  return stats.channels.size() > 1 ? names[channel] : "";
}

double percent(uint64_t part, uint64_t of) {
  return of > 0 ? 100 * static_cast<double>(part) / static_cast<double>(of) : 0;
}

/// Rows of four bins each, with a bar as long as their share of the fullest row.
std::string histogram_text(const SampleStats& s) {
  constexpr size_t together = 4, longest = 40;
  std::vector<uint64_t> rows((s.histogram.size() + together - 1) / together);
  for (size_t i = 0; i < s.histogram.size(); ++i) rows[i / together] += s.histogram[i];
  const uint64_t most = *std::max_element(rows.begin(), rows.end());
  std::string text;
  for (size_t i = 0; i < rows.size(); ++i) {
    const auto bar = static_cast<size_t>(static_cast<double>(rows[i]) / static_cast<double>(most) * longest);
    text += fmt::format("{:>12.6g}  {:>14}{}\n", s.least + static_cast<double>(i * together) * s.bin_width,
                        rows[i], rows[i] > 0 ? "  " + std::string(std::max<size_t>(bar, 1), '#') : "");
  }
  return text;
}

}  // namespace

std::string stats_text(const VolumeStats& stats) {
  std::string text = fmt::format("void        {} of {} voxels ({:.4g} %)\n", stats.void_voxels, stats.voxels,
                                 percent(stats.void_voxels, stats.voxels));
  if (stats.fill > 0) text += fmt::format("fill        {} voxels\n", stats.fill);
  if (stats.nan + stats.infinite > 0)
    text += fmt::format("not finite  {} NaN, {} infinite\n", stats.nan, stats.infinite);
  for (size_t c = 0; c < stats.channels.size(); ++c) {
    const SampleStats& s = stats.channels[c];
    if (stats.channels.size() > 1) text += fmt::format("channel     {}\n", channel_name(stats, c));
    if (s.samples == 0) {
      text += "samples     none that count\n";
      continue;
    }
    text += fmt::format("samples     {}: {:.9g} to {:.9g}, mean {:.9g}, deviation {:.9g}\n", s.samples,
                        s.least, s.greatest, s.mean, s.deviation);
    text += "percentiles";
    for (size_t i = 0; i < s.percentiles.size(); ++i)
      text += fmt::format("{} {:g} %: {:.6g}", i > 0 ? "," : "", SampleStats::shares[i], s.percentiles[i]);
    text += "\n";
    text += s.different ? fmt::format("different   {} values, entropy {:.6g} bits a sample\n", *s.different,
                                      *s.entropy)
                        : "different   more than 65536 values\n";
    text += histogram_text(s);
  }
  return text;
}

Json stats_json(const VolumeStats& stats) {
  Json json = Json::object(), channels = Json::array();
  json.set("voxels", stats.voxels).set("void_voxels", stats.void_voxels);
  json.set("void_percent", percent(stats.void_voxels, stats.voxels));
  json.set("fill_voxels", stats.fill).set("nan", stats.nan).set("infinite", stats.infinite);
  for (size_t c = 0; c < stats.channels.size(); ++c) {
    const SampleStats& s = stats.channels[c];
    Json channel = Json::object(), percentiles = Json::object(), histogram = Json::object(),
         counts = Json::array();
    if (stats.channels.size() > 1) channel.set("name", channel_name(stats, c));
    channel.set("samples", s.samples);
    if (s.samples > 0) {
      channel.set("least", s.least).set("greatest", s.greatest);
      channel.set("mean", s.mean).set("deviation", s.deviation);
      for (size_t i = 0; i < s.percentiles.size(); ++i)
        percentiles.set(fmt::format("{:g}", SampleStats::shares[i]), s.percentiles[i]);
      channel.set("percentiles", std::move(percentiles));
      if (s.different) channel.set("different_values", *s.different).set("entropy_bits", *s.entropy);
      for (const uint64_t count : s.histogram) counts.push(static_cast<int64_t>(count));
      histogram.set("first", s.least).set("width", s.bin_width).set("counts", std::move(counts));
      channel.set("histogram", std::move(histogram));
    }
    channels.push(std::move(channel));
  }
  json.set("channels", std::move(channels));
  return json;
}

}  // namespace voxkit::cli
