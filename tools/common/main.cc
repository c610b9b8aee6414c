#include "tools/common/main.h"

#include <fmt/core.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <system_error>

#include "formats/output_file.h"
#include "tools/common/json.h"

namespace voxkit::cli {
namespace {

/// The first signal asks the work to stop, which then removes what it has begun, folders too. Where it does
/// not come to that within two seconds (a read from a pipe that says nothing, say), or at a second signal,
/// the process ends here.
void stop(int signal) {
  if (interrupt_signal == 0 && signal != SIGALRM) {
    interrupt_signal = signal;
    alarm(2);
    return;
  }
  remove_temporaries();
  _exit(128 + (signal == SIGALRM ? interrupt_signal.load() : signal));
}

void handle_signals() {
  struct sigaction action = {};
  action.sa_handler = stop;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGALRM}) {
    struct sigaction old;
    // What the parent ignores (nohup) stays ignored.
    if (sigaction(signal, nullptr, &old) == 0 && old.sa_handler == SIG_IGN) continue;
    sigaction(signal, &action, nullptr);
  }
  // Writing to a closed pipe, or past a limit on file sizes, is an error of the write.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

}  // namespace

void Run::stage(const std::string& name) {
  ctx.progress = [](double) {};
  progress_.reset();
  if (options.quiet) return;
  progress_ = std::make_unique<Progress>(options.progress, name);
  ctx.progress = [progress = progress_.get()](double fraction) { progress->update(fraction); };
}

void Run::detail(const std::string& text) {
  if (progress_) progress_->detail(text);
}

void Run::say(const std::string& line) {
  if (options.quiet) return;
  std::lock_guard lock(said_mutex_);
  if (said_.insert(line).second) report(tool, {ErrorCode::input, {}, line});
}

void Run::note(const std::string& line) const {
  if (options.verbose) tell(fmt::format("{}: {}", tool, line));
}

Status Run::print_result(const Json& json) const {
  return print(json_lines ? json.line() : json.text());
}

double Run::seconds() const {
  return seconds_since(start_);
}

Result<int> guarded(const std::function<Result<int>()>& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, {}, "out of memory: use --max-memory or fewer --threads");
  } catch (const std::system_error& e) {
    // Of threads that cannot be had; of memory for them, as a rule.
    const bool resources = e.code() == std::errc::resource_unavailable_try_again;
    return resources ? fail(ErrorCode::limit, {}, "no memory for threads: use fewer --threads")
                     : fail(ErrorCode::internal, {}, fmt::format("a bug of ours: {}", e.what()));
  } catch (const std::exception& e) {
    return fail(ErrorCode::internal, {}, fmt::format("a bug of ours: {}", e.what()));
  } catch (...) {
    return fail(ErrorCode::internal, {}, "a bug of ours: an unknown exception");
  }
}

int exit_code(const Error& error) {
  switch (error.code) {
    case ErrorCode::usage:
      return 2;
    case ErrorCode::input:
      return 3;
    case ErrorCode::output:
      return 4;
    case ErrorCode::limit:
      return 5;
    case ErrorCode::device:
      return 6;
    case ErrorCode::interrupted:
      return 128 + interrupt_signal;
    case ErrorCode::internal:
      break;
  }
  return 70;
}

int run_tool(int argc, char** argv, const std::string& tool, const std::string& purpose,
             const std::string& examples, const std::function<void(CommandLine&)>& declare,
             const std::function<Result<int>(Run&)>& work) {
  handle_signals();
  const Result<int> result = guarded([&]() -> Result<int> {
    CommandLine line(tool, purpose, examples);
    declare(line);
    VOX_TRY(const auto outcome, line.parse(argc, argv));
    if (outcome.print) {
      VOX_CHECK(print(*outcome.print));
      return 0;
    }
    Run run(tool, outcome.options);
    return work(run);
  });
  if (result) return *result;
  report(tool, result.error());
  return exit_code(result.error());
}

void report(const std::string& tool, const Error& error) {
  std::string line = tool + ": " + (error.file.empty() ? "" : error.file + ": ") + error.what;
  // A file name, or the message of a library, may have line feeds.
  for (char& c : line)
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = ' ';
  tell(line);
}

void tell(const std::string& line) {
  Progress::clear();
  std::fputs((line + "\n").c_str(),
             stderr);  // unlike fmt::print, which throws where nobody reads it any more
}

Status print(const std::string& text) {
  Progress::clear();
  const char* at = text.data();
  size_t left = text.size();
  while (left > 0) {
    const ssize_t written = write(STDOUT_FILENO, at, left);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return fail(ErrorCode::output, "standard output", std::strerror(errno));
    at += written;
    left -= static_cast<size_t>(written);
  }
  return {};
}

uint64_t peak_rss_bytes() {
  struct rusage usage;
  return getrusage(RUSAGE_SELF, &usage) == 0 ? static_cast<uint64_t>(usage.ru_maxrss) * 1024 : 0;
}

}  // namespace voxkit::cli
