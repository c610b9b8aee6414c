// How far the work is, on standard error.
#pragma once

#include <string>

#include "formats/clock.h"
#include "tools/common/command_line.h"

namespace voxkit::cli {

class Progress {
 public:
  /// automatic: a line on a terminal, once the stage has taken a second. plain: lines "stage=encode
  /// done=0.25".
  Progress(ProgressMode mode, std::string stage);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  /// Fraction done, 0..1; from one thread at a time.
  void update(double fraction);
  /// What else there is to know, such as "iteration=3 psnr_db=41.2", from now on. plain: a line of its own.
  void detail(const std::string& text);
  /// Takes the line off the terminal, where there is one, before something else is printed there.
  static void clear();

 private:
  ProgressMode mode_;
  std::string stage_, detail_;
  double fraction_ = 0;
  Clock::time_point start_ = Clock::now(), last_ = start_;
  bool shown_ = false, complete_ = false;
};

}  // namespace voxkit::cli
