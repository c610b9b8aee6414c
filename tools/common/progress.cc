#include "tools/common/progress.h"

#include <fmt/core.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <utility>

namespace voxkit::cli {

using namespace std::chrono_literals;

namespace {

std::atomic<bool> on_terminal{false};  ///< whether the last line there is one of progress

}  // namespace

Progress::Progress(ProgressMode mode, std::string stage) : mode_(mode), stage_(std::move(stage)) {
  if (mode_ == ProgressMode::automatic && !isatty(STDERR_FILENO)) mode_ = ProgressMode::never;
}

Progress::~Progress() {
  clear();
}

void Progress::clear() {
  if (on_terminal.exchange(false)) std::fputs("\r\033[K", stderr);
}

void Progress::detail(const std::string& text) {
  detail_ = text;
  if (mode_ == ProgressMode::plain) {
    std::fputs(fmt::format("stage={} {}\n", stage_, detail_).c_str(), stderr);
  } else {
    update(fraction_);
  }
}

void Progress::update(double fraction) {
  const auto now = Clock::now();
  fraction_ = fraction;
  if (mode_ == ProgressMode::plain) {
    // The end is always reported, once; what is before it twice a second.
    const bool end = fraction >= 1;
    if (complete_ || (!end && now - last_ < 500ms)) return;
    complete_ = end;
    last_ = now;
    std::fputs(fmt::format("stage={} done={:.2f}\n", stage_, fraction).c_str(), stderr);
  } else if (mode_ == ProgressMode::automatic) {
    if (now - start_ < 1s || (shown_ && now - last_ < 100ms)) return;
    shown_ = true;
    on_terminal = true;
    last_ = now;
    std::fputs(
        fmt::format("\r{} {:3.0f} %{}{}\033[K", stage_, 100 * fraction, detail_.empty() ? "" : ", ", detail_)
            .c_str(),
        stderr);
    std::fflush(stderr);
  }
}

}  // namespace voxkit::cli
