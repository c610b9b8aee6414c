#include "tools/common/retype.h"

#include <utility>

#include "formats/copy.h"

namespace voxkit::cli {

Result<std::unique_ptr<VolumeSource>> retyped(std::unique_ptr<VolumeSource> source,
                                              const OpenSource& open_again,
                                              const std::optional<TargetType>& type,
                                              const std::optional<ValueRange>& range, Run& run) {
  if (!type) return source;
  const VolumeInfo& info = source->info();
  ValueRange stored;
  if (needs_range(info, *type)) {
    if (range) {
      stored = {info.stored(range->lo), info.stored(range->hi)};
    } else if (source->forward_only() && !open_again) {
      if (!info.range)
        return bad_usage(
            "the values of a stream cannot be looked at twice: give their range with --range LO,HI");
      stored = *info.range;
    } else {
      run.stage("measure");
      VOX_TRY(stored, measure_range(*source, run.ctx));
      if (source->forward_only()) {
        VOX_TRY(source, open_again());
      }
    }
  }
  return convert_type(std::move(source), *type, stored, run.ctx);
}

void declare_range_option(CommandLine& line, std::optional<ValueRange>& range, const std::string& help) {
  line.option("--range", "LO,HI", help, [&range](const std::string& text) -> Status {
    VOX_TRY(const auto ends, read_numbers(text, 2));
    if (!(ends[0] < ends[1])) return bad_usage("\"" + text + "\": expected LO,HI with LO less than HI");
    range = ValueRange{ends[0], ends[1]};
    return {};
  });
}

}  // namespace voxkit::cli
