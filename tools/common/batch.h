// Many files in one run of an encoder: an output for each input.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/common/main.h"

namespace voxkit::cli {

/// What is encoded, and how far a run goes.
struct Batch {
  std::vector<std::string> inputs;  ///< as given: files, built-ins, and, with `recursive`, folders
  std::string output;  ///< a file; or a folder, or a name with {stem}, of which each input has one
  bool recursive = false, skip_existing = false, keep_going = false;
};
/// Declares INPUT, of which `help` says what it may be, --output, for files with this ending, --recursive,
/// --skip-existing and --keep-going.
void declare_batch(CommandLine& line, const std::string& help, std::string_view ending, Batch& batch);

/// Whether the output ends with a slash or has {stem} in its name; or is a folder that exists, of several
/// inputs. One input is not put into a folder by accident.
bool names_many(const Batch& batch);

/// An input and its output.
struct Job {
  std::string input, output;
};
/// The kind of files that an encoder takes and makes.
struct BatchKind {
  std::string_view ending;                    ///< of outputs, such as ".svmm"
  bool (*is_input)(const std::string& name);  ///< of files in a folder: whether one is, by its name
};
/// Whether there is nothing to do for an output: --skip-existing, and it exists. That is said.
bool is_done(const Batch& batch, const std::string& output, Run& run);

/// What there is to do, in the order of the inputs, files of folders sorted as people count; all names are
/// checked. The stem is the input's name without folder and endings (a.nii.gz: a; menger:5: menger-5).
/// Errors: ErrorCode::usage where inputs and outputs do not go together or two inputs have one output;
/// ErrorCode::input for a folder; ErrorCode::output where an output exists, unless it is to be replaced or
/// skipped, or --keep-going leaves that to its turn.
Result<std::vector<Job>> jobs_of(const Batch& batch, const BatchKind& kind, Run& run);

/// Does them one after the other, each with a Run of its own, and says in one line how many there were. A job
/// that fails ends the run with its exit code; with --keep-going the others are done, and the exit code is 1.
/// With --json each result is one line, of failures {"input", "output", "error", "exit_code"}, and of
/// what was there already {"input", "output", "skipped"}. One input with one output runs as it is.
Result<int> run_batch(const Batch& batch, const BatchKind& kind, Run& run,
                      const std::function<Result<int>(const Job&, Run&)>& encode);

}  // namespace voxkit::cli
