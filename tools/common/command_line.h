// The options of a tool: those that every tool has, and its own.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "formats/result.h"
#include "tools/common/parse.h"

namespace voxkit::cli {

enum class ProgressMode { automatic, plain, never };

/// What every tool understands.
struct CommonOptions {
  bool quiet = false, verbose = false;
  bool force = false;  ///< overwrite an existing output
  bool json = false;   ///< one JSON object on standard output
  int threads = 1;     ///< at least 1: 0 has become what this process may use
  ProgressMode progress = ProgressMode::automatic;
  uint64_t max_memory = 0;  ///< bytes; 0: the default of MemoryBudget
};

/// Declares options, then reads argv. Values are stored by the parsers, whose targets must live until then.
/// Where a tool uses a short name that the common options have as well, theirs is the long name only.
class CommandLine {
 public:
  /// `purpose`: one sentence. `examples`: lines of runnable commands, one for each main use.
  CommandLine(const std::string& tool, const std::string& purpose, const std::string& examples);
  ~CommandLine();

  /// `names` as in "-w,--blockwidth"; `metavar` names the value in the help.
  void option(const std::string& names, const std::string& metavar, const std::string& help, Parser parse,
              bool required = false);
  void text(const std::string& names, const std::string& metavar, const std::string& help, std::string& value,
            bool required = false);
  /// A text that names a file.
  void file(const std::string& names, const std::string& metavar, const std::string& help, std::string& value,
            bool required = false);
  void flag(const std::string& names, const std::string& help, bool& value);
  /// An argument without a name, which must be given, unless not `required`, and names a file; in the order
  /// of the calls.
  void argument(const std::string& metavar, const std::string& help, std::string& value,
                bool required = true);
  /// One such argument, or more; the last of the calls.
  void arguments(const std::string& metavar, const std::string& help, std::vector<std::string>& values);
  /// An option that may come after each of the `arguments`, and is of that one. `store` is called with the
  /// argument's number, from 0, and the value; an argument has at most one.
  void behind_arguments(const std::string& name, const std::string& metavar, const std::string& help,
                        std::function<Status(size_t, const std::string&)> store);

  /// What to do after the arguments have been read: the work, or print a text and stop: help, version, or, of
  /// `--describe` alone, all of this as JSON, from which manual pages and completions are made
  /// (packaging/README.md).
  struct Outcome {
    std::optional<std::string> print;
    CommonOptions options;
  };
  /// Errors: ErrorCode::usage; an unknown option names the nearest one.
  Result<Outcome> parse(int argc, char** argv);

 private:
  void declare_common();
  Status store_behind_arguments();
  std::string description() const;

  struct State;
  std::unique_ptr<State> state_;
};

/// "0.1.0 (commit, compiler, SIMD target, cuda no)".
std::string version_text();

}  // namespace voxkit::cli
