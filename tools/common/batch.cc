#include "tools/common/batch.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "formats/names.h"
#include "formats/natural_order.h"
#include "formats/output_file.h"
#include "tools/common/json.h"

namespace voxkit::cli {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view stem_field = "{stem}";

bool is_folder(const std::string& name) {
  std::error_code error;
  return fs::is_directory(name, error);
}

std::string stem_of(const std::string& input) {
  std::string name = fs::path(input).lexically_normal().filename().string();
  if (name.empty()) name = fs::path(input).lexically_normal().parent_path().filename().string();
  for (const std::string_view packed : {".gz", ".bz2"})
    if (has_ending(name, packed)) name.resize(name.size() - packed.size());
  if (const size_t dot = name.rfind('.'); dot != name.npos && dot > 0) name.resize(dot);
  std::replace(name.begin(), name.end(), ':', '-');  // of built-ins
  return name;
}

/// Files of a folder and of those in it that are inputs by name, sorted; and how many are not.
Status add_files(const std::string& folder, const BatchKind& kind, std::vector<std::string>& files,
                 Run& run) {
  std::error_code error;
  uint64_t others = 0;
  const size_t before = files.size();
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    VOX_CHECK(check_interrupt());
    std::error_code unreadable;
    if (!it->is_regular_file(unreadable)) continue;
    const std::string name = it->path().string();
    if (kind.is_input(name))
      files.push_back(name);
    else
      ++others;
  }
  if (error) return bad_input(folder, error.message());
  std::sort(files.begin() + static_cast<std::ptrdiff_t>(before), files.end(), natural_less);
  if (others > 0)
    run.say(fmt::format("{}: {} {} left out: not an input by its ending", folder, others,
                        others == 1 ? "file is" : "files are"));
  if (files.size() == before) return bad_input(folder, "no file in it is an input by its ending");
  return {};
}

/// An output among many. `below`: the folders between the one that was given and the input.
std::string output_of(const std::string& output, const std::string& input, const fs::path& below,
                      std::string_view ending) {
  const std::string stem = stem_of(input);
  if (output.find(stem_field) == output.npos)
    return (fs::path(output) / below / stem).lexically_normal().string() + std::string(ending);
  std::string name = output;
  for (size_t at = 0; (at = name.find(stem_field, at)) != name.npos; at += stem.size())
    name.replace(at, stem_field.size(), stem);
  return name;
}

Status check_jobs(const Batch& batch, const std::vector<Job>& jobs, const Run& run) {
  std::map<std::string, const Job*> of;
  for (const Job& job : jobs) {
    const auto [other, added] = of.try_emplace(job.output, &job);
    if (!added)
      return bad_usage(fmt::format("{} and {} would both become {}: expected an output for each",
                                   other->second->input, job.input, job.output));
  }
  if (batch.skip_existing || batch.keep_going) return {};
  for (const Job& job : jobs) {
    std::error_code error;
    const fs::path folder = fs::path(job.output).parent_path();
    if (folder.empty() || fs::exists(folder, error)) VOX_CHECK(check_output(job.output, run.options.force));
  }
  return {};
}

/// What a line about a job begins with.
Json json_of(const Job& job, const Run& run) {
  Json json = Json::result();
  json.set("tool", run.tool).set("input", job.input).set("output", job.output);
  return json;
}

/// The folder of an output, made where it is not there yet; gone again if nothing comes into it.
class OutputFolder {
 public:
  Status make(const Job& job) {
    const fs::path folder = fs::path(job.output).parent_path();
    std::error_code error;
    for (fs::path at = folder; !at.empty() && !fs::exists(at, error); at = at.parent_path())
      made_.push_back(at);
    if (!folder.empty()) fs::create_directories(folder, error);
    if (error) return fail(ErrorCode::output, folder.string(), error.message());
    return {};
  }
  void remove_empty() {
    std::error_code error;
    for (const fs::path& folder : made_)
      if (!fs::remove(folder, error)) return;
  }

 private:
  std::vector<fs::path> made_;  ///< the innermost first
};

}  // namespace

void declare_batch(CommandLine& line, const std::string& help, std::string_view ending, Batch& batch) {
  line.arguments("INPUT", help, batch.inputs);
  line.file(
      "-o,--output", "OUT",
      fmt::format("Output ({}), or -; one for each of several inputs: a folder that exists or ends with "
                  "/, or a name with {}",
                  ending, stem_field),
      batch.output, true);
  line.flag("--recursive",
            "Of an INPUT that is a folder: each volume or model in it, and in those below, by itself",
            batch.recursive);
  line.flag("--skip-existing", "What has an output already is done", batch.skip_existing);
  line.flag("--keep-going", "One that fails does not stop the others; exit 1 in the end", batch.keep_going);
}

bool is_done(const Batch& batch, const std::string& output, Run& run) {
  std::error_code error;
  if (!batch.skip_existing || output == "-" || !fs::exists(output, error)) return false;
  run.say(output + ": exists: skipped");
  return true;
}

bool names_many(const Batch& batch) {
  const std::string& output = batch.output;
  return output.ends_with('/') || output.find(stem_field) != output.npos ||
         ((batch.inputs.size() > 1 || batch.recursive) && is_folder(output));
}

Result<std::vector<Job>> jobs_of(const Batch& batch, const BatchKind& kind, Run& run) {
  const bool many = names_many(batch);
  if (batch.skip_existing && run.options.force)
    return bad_usage("--skip-existing and --force: expected one of them");
  if (!many && batch.inputs.size() > 1)
    return bad_usage(
        fmt::format("{} inputs: expected as --output a folder that exists or ends with /, or a name with {}",
                    batch.inputs.size(), stem_field));
  if (!many && batch.recursive)
    return bad_usage(
        fmt::format("--recursive: expected as --output a folder, or a name with {}", stem_field));
  if (!many) return std::vector<Job>{{batch.inputs.front(), batch.output}};
  std::vector<Job> jobs;
  for (const std::string& input : batch.inputs) {
    if (input == "-") return bad_usage("standard input has no name: expected one --output for it");
    std::vector<std::string> files;
    const bool folder = batch.recursive && is_folder(input);
    if (folder) {
      VOX_CHECK(add_files(input, kind, files, run));
    } else {
      files.push_back(input);
    }
    for (const std::string& file : files) {
      const fs::path below = folder ? fs::path(file).lexically_relative(input).parent_path() : fs::path();
      jobs.push_back({file, output_of(batch.output, file, below, kind.ending)});
    }
  }
  VOX_CHECK(check_jobs(batch, jobs, run));
  return jobs;
}

Result<int> run_batch(const Batch& batch, const BatchKind& kind, Run& run,
                      const std::function<Result<int>(const Job&, Run&)>& encode) {
  VOX_TRY(const std::vector<Job> jobs, jobs_of(batch, kind, run));
  const bool many = names_many(batch);
  if (!many) return is_done(batch, jobs.front().output, run) ? Result<int>(0) : encode(jobs.front(), run);
  uint64_t encoded = 0, skipped = 0, failed = 0;
  for (const Job& job : jobs) {
    VOX_CHECK(check_interrupt());
    if (is_done(batch, job.output, run)) {
      ++skipped;
      if (run.options.json) VOX_CHECK(print(json_of(job, run).set("skipped", true).line()));
      continue;
    }
    Run own(run.tool, run.options);
    own.json_lines = true;
    OutputFolder folder;
    const Result<int> done = guarded([&]() -> Result<int> {
      VOX_CHECK(folder.make(job));
      return encode(job, own);
    });
    if (done && *done == 0) {
      ++encoded;
      continue;
    }
    ++failed;
    folder.remove_empty();
    const int code = done ? *done : exit_code(done.error());
    const bool stopped = !done && done.error().code == ErrorCode::interrupted;
    if (!done && !stopped && run.options.json) {
      VOX_CHECK(print(json_of(job, run).set("error", done.error().what).set("exit_code", code).line()));
    }
    if (stopped || !batch.keep_going) return done;
    if (!done) report(run.tool, done.error());
  }
  if (!run.options.quiet)
    tell(fmt::format("{}: {} {}: {} encoded, {} skipped, {} failed, in {:.2f} s", run.tool, jobs.size(),
                     jobs.size() == 1 ? "input" : "inputs", encoded, skipped, failed, run.seconds()));
  return failed > 0 ? 1 : 0;
}

}  // namespace voxkit::cli
