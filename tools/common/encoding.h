// What the encoders have in common: their input, opened as often as it takes, and what they say in the end.
#pragma once

#include <memory>
#include <optional>
#include <string>

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

 private:
  const std::string& name_;
  const OpenOptions& open_;
  Context& ctx_;
  std::shared_ptr<const MappedFile> spooled_;
};

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
};
/// The keys that all encoders begin with; `params` and those of --verify are added.
Json encoding_json(const Encoding& encoding, const Run& run, Json params);
void add_verified(const Encoding& encoding, Json& json);
/// The line on standard error.
void print_encoding(const Encoding& encoding);

}  // namespace voxkit::cli
