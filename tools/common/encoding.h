// What the encoders have in common: their input, opened as often as it takes, and what they say in the end.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "formats/fill.h"
#include "libmetrics/volume_diff.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"

namespace voxkit::cli {

/// Opens the input, any number of times: standard input is spooled to disk if it may be wanted twice.
class Inputs {
 public:
  Inputs(const std::string& name, const OpenOptions& open, Context& ctx)
      : name_(name), open_(open), ctx_(ctx) {}
  Result<std::unique_ptr<VolumeSource>> open(bool wanted_again);
  /// What is opened from now on has this fill value.
  void set_fill(double fill) { found_fill_ = fill; }

 private:
  const std::string& name_;
  const OpenOptions& open_;
  Context& ctx_;
  Result<std::unique_ptr<VolumeSource>> open_as_it_is(bool wanted_again);
  std::shared_ptr<const MappedFile> spooled_;
  std::optional<double> found_fill_;
};

/// Before a FLOAT32 volume is encoded with a loss: its range, and a value that is likely to stand for nothing
/// measured is taken as its fill value, unless it has one already, and said. A forward-only source is opened
/// again by `inputs`.
Result<Census> look_at_floats(std::unique_ptr<VolumeSource>& source, Inputs& inputs, const std::string& input,
                              Run& run);

/// The checks of an encoder before any work: of its output, alone and beside the input and its options.
Status check_encoding(const std::string& input, const std::string& output, bool verify, const Run& run);

/// The option --zstd: a level, 0 where it is not given.
void declare_zstd(CommandLine& line, int& level);

/// What was encoded.
struct Encoding {
  std::string input, output;
  VolumeInfo info;
  uint64_t file_bytes = 0;
  double seconds = 0;
  std::optional<VolumeDiff> diff;  ///< with --verify
  bool lossless = false;           ///< every sample of the input comes back as it was
};
/// The keys that all encoders begin with; `params` and those of --verify are added.
Json encoding_json(const Encoding& encoding, const Run& run, Json params);
void add_verified(const Encoding& encoding, Json& json);
/// The line on standard error.
void print_encoding(const Encoding& encoding);

}  // namespace voxkit::cli
