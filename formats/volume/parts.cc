#include "formats/volume/parts.h"

#include <fmt/format.h>

#include "formats/volume/facts.h"

namespace voxkit {

Result<std::vector<int64_t>> choose_parts(const std::string& file, const std::vector<PartCount>& kinds,
                                          const OpenOptions& options, VolumeInfo& info) {
  std::vector<int64_t> chosen;
  std::vector<std::string> there, expected;
  for (const PartCount& kind : kinds) {
    const int64_t last = kind.count - 1;
    if (kind.wanted && (*kind.wanted < 0 || *kind.wanted > last))
      return bad_input(file, fmt::format("{} {}: the file has {} {}: expected 0{}", kind.option, *kind.wanted,
                                         kind.count, kind.what, last > 0 ? fmt::format(" to {}", last) : ""));
    chosen.push_back(kind.wanted.value_or(0));
    if (kind.count == 1) continue;
    info.parts.push_back(fmt::format("{} {} of 0..{}", kind.option, chosen.back(), last));
    if (kind.wanted) continue;
    there.push_back(fmt::format("{} {}", kind.count, kind.what));
    expected.push_back(fmt::format("{} N, from 0 to {}", kind.option, last));
  }
  if (there.empty() || options.any_part) return chosen;
  return bad_input(file, fmt::format("has {}: expected {}", listed(there), listed(expected)));
}

Status only_part(const std::string& file, const OpenOptions& options) {
  VolumeInfo none;
  const auto chosen = choose_parts(
      file, {{"--time", "time step", 1, options.time}, {"--channel", "channel", 1, options.channel}}, options,
      none);
  return chosen ? Status{} : Status(tl::unexpected<Error>(chosen.error()));
}

}  // namespace voxkit
