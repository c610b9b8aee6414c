#include "formats/volume/image_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "formats/image/image_input.h"
#include "formats/natural_order.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;

/// Names of the regular files in a folder, hidden ones left out.
Result<std::vector<std::string>> files_in(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(folder.empty() ? "." : folder, error), end; !error && it != end;
       it.increment(error)) {
    std::error_code ignored;
    const std::string file = it->path().filename().string();
    if (!file.starts_with('.') && it->is_regular_file(ignored)) names.push_back(file);
  }
  if (error) return bad_input(folder.empty() ? "." : folder, "cannot read the folder: " + error.message());
  return names;
}

}  // namespace

Result<std::set<uint64_t>> numbers_of(const NumberedName& pattern) {
  VOX_TRY(const auto files, files_in(pattern.folder));
  std::set<uint64_t> numbers;
  for (const std::string& file : files)
    if (const auto number = pattern.number(file)) numbers.insert(*number);
  return numbers;
}

Result<std::vector<std::string>> slices_of_pattern(const std::string& text) {
  VOX_TRY(const NumberedName pattern, numbered_name(text));
  VOX_TRY(const auto numbers, numbers_of(pattern));
  if (numbers.empty()) return bad_input(text, "no file has a name of this pattern");
  std::vector<std::string> paths;
  uint64_t expected = *numbers.begin();
  for (const uint64_t number : numbers) {
    if (number != expected)
      return bad_input(pattern.path(expected),
                       fmt::format("slice is missing: expected every number from {} to {}", *numbers.begin(),
                                   *numbers.rbegin()));
    paths.push_back(pattern.path(number));
    ++expected;
  }
  return paths;
}

Result<std::vector<std::string>> slices_of_folder(const std::string& folder) {
  VOX_TRY(auto files, files_in(folder));
  std::erase_if(files, [](const std::string& file) { return image_format(file) == nullptr; });
  if (files.empty()) return bad_input(folder, "no images in this folder: expected .tif, .png or .exr files");
  std::sort(files.begin(), files.end(), natural_less);
  for (const std::string& file : files)
    if (ending_of(file) != ending_of(files.front()))
      return bad_input(folder,
                       fmt::format("images of several kinds, as {} and {}: expected one kind, or a pattern",
                                   files.front(), file));
  for (std::string& file : files) file = folder + (folder.ends_with('/') ? "" : "/") + file;
  return files;
}

}  // namespace voxkit
