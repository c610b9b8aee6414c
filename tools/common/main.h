// The life of a tool: options, work, one line about an error, an exit code.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "formats/clock.h"
#include "formats/context.h"
#include "tools/common/command_line.h"
#include "tools/common/progress.h"

namespace voxkit::cli {

class Json;

/// What the work of a tool is given.
class Run {
 public:
  Run(std::string tool_name, const CommonOptions& common)
      : tool(std::move(tool_name)), options(common), memory_(common.max_memory) {
    ctx.threads = common.threads;
    ctx.memory = &memory_;
    ctx.note = [this](const std::string& line) { say(line); };
  }

  std::string tool;
  CommonOptions options;
  Context ctx;              ///< its progress goes to the stage begun last
  bool json_lines = false;  ///< results are lines of JSON: there are several

  /// Begins a stage of work for the progress display, such as "encode".
  void stage(const std::string& name);
  /// Adds to the progress display of this stage: words such as "iteration=3".
  void detail(const std::string& text);
  /// A line on standard error unless --quiet is given: what of an input is dropped, assumed or found. Each
  /// once.
  void say(const std::string& line);
  /// A line on standard error, with --verbose only.
  void note(const std::string& line) const;
  /// Prints the result of --json.
  Status print_result(const Json& json) const;
  /// Seconds since the tool started.
  double seconds() const;

 private:
  MemoryBudget memory_;
  std::mutex said_mutex_;
  std::set<std::string> said_;
  std::unique_ptr<Progress> progress_;
  Clock::time_point start_ = Clock::now();
};

/// The body of every main(): `declare` adds the tool's options, `work` does it and returns the exit code (0
/// or 1). Handles signals: outputs that are not complete are removed, and the exit code is 128 + the signal.
int run_tool(int argc, char** argv, const std::string& tool, const std::string& purpose,
             const std::string& examples, const std::function<void(CommandLine&)>& declare,
             const std::function<Result<int>(Run&)>& work);

/// What `work` returns, or the error of what it throws.
Result<int> guarded(const std::function<Result<int>()>& work);
/// The exit code of an error.
int exit_code(const Error& error);

/// One line about an error on standard error: "TOOL: FILE: what is wrong: what was expected".
void report(const std::string& tool, const Error& error);

/// One line for people on standard error, such as what was done.
void tell(const std::string& line);

/// Writes to standard output; ErrorCode::output if that fails.
Status print(const std::string& text);

/// The largest resident set of this process so far.
uint64_t peak_rss_bytes();

}  // namespace voxkit::cli
