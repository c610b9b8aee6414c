// What the programs of this folder share: their options, and the table that they print.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "formats/context.h"

namespace voxkit::stress {

struct Effort {
  int64_t tries = 0;  ///< looks that each search may take, for each of which the program has a share
  uint64_t seed = 1;
  /// A share of them: the looks of slow searches are fewer.
  int64_t share(int64_t of) const { return std::max<int64_t>(tries / of, 10); }
};

/// One search: what was promised, and the worst that was found.
struct Row {
  std::string what, promise, worst;
  bool held = true;
  int64_t tried = 0;
  std::string input;  ///< of the worst case, for doing it again
};

class Report {
 public:
  void add(Row row) { rows_.push_back(std::move(row)); }
  /// Markdown: the table, then the inputs. Returns 1 if a promise was broken, else 0.
  int print(const std::string& title) const;

 private:
  std::vector<Row> rows_;
};

/// The main function of a program of this folder: reads `--tries N` and `--seed S`, fills the report and
/// prints it. Exits 2 at other options, 70 where a library fails that should not.
int stress_main(int argc, char** argv, const std::string& name, const std::string& title, int64_t tries,
                const std::function<void(const Effort&, Report&)>& fill);

/// Ends the program: what cannot fail has.
[[noreturn]] void must_not_happen(const std::string& what);
template <class T>
T must(Result<T> result) {
  if (!result) must_not_happen(result.error().what);
  return std::move(*result);
}
inline void must(const Status& status) {
  if (!status) must_not_happen(status.error().what);
}

/// One thread, and memory enough.
Context stress_context();

/// A number with as many digits as tell it from others; `hex`: and in hexadecimal.
std::string text(double x, bool hex = false);

}  // namespace voxkit::stress
