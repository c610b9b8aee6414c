#include "formats/mesh/mesh_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <vector>

#include "formats/names.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// Whether there is a file; follows links.
bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

/// The file that a path means where upper and lower case are the same; empty where there is none.
fs::path find_in_any_case(const fs::path& path) {
  if (is_file(path)) return path;
  std::error_code error;
  fs::path found = path.is_absolute() ? path.root_path() : fs::path(".");
  for (const fs::path& part : path.relative_path()) {
    if (fs::exists(found / part, error)) {
      found /= part;
      continue;
    }
    const std::string wanted = lower(part.string());
    std::vector<std::string> matches;
    for (fs::directory_iterator it(found, error), end; !error && it != end; it.increment(error))
      if (std::string name = it->path().filename().string(); lower(name) == wanted)
        matches.push_back(std::move(name));
    if (matches.empty()) return {};
    found /= *std::min_element(matches.begin(), matches.end());  // folders list their files in any order
  }
  return is_file(found) ? found : fs::path{};
}

/// %20 and the like become the characters that they mean.
std::string unescaped(const std::string& text) {
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    const auto digit = [&](size_t at) {
      return at < text.size() && std::isxdigit(static_cast<unsigned char>(text[at]));
    };
    if (text[i] == '%' && digit(i + 1) && digit(i + 2)) {
      plain += static_cast<char>(std::stoi(text.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      plain += text[i];
    }
  }
  return plain;
}

}  // namespace

MeshFolder::MeshFolder(const std::string& path, bool allow_outside)
    : path_(path), folder_(fs::path(path).parent_path().string()), allow_outside_(allow_outside) {}

Result<std::string> MeshFolder::find(const std::string& name, const std::string& what,
                                     const std::string& by) {
  std::string slashes = name;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const auto bad = [&](const char* why) {
    return bad_input(path_, fmt::format("{} \"{}\": {}", what, name.substr(0, 200), why));
  };
  const fs::path base(folder_);
  // From the folder of the mesh to that of what has the name, and then itself.
  std::vector<fs::path> folders;
  if (!by.empty())
    folders.push_back(fs::path(by).parent_path().lexically_normal().lexically_relative(
        base.empty() ? "." : base.lexically_normal()));
  folders.emplace_back();
  bool forbidden = false, is_there = false;
  const std::string all_written[] = {slashes, unescaped(slashes)};
  for (const bool last_part : {false, true})
    for (const std::string& written : all_written) {
      if (written.empty() || written.find('\0') != std::string::npos) continue;
      for (const fs::path& from : folders) {
        const fs::path file = from / (last_part ? fs::path(written).filename() : fs::path(written));
        if (!allow_outside_ && leaves_folder(folder_, file.string())) {
          forbidden = true;
          continue;
        }
        if (const fs::path found = find_in_any_case(base / file); !found.empty()) {
          if (last_part) moved_.insert(name);
          return found.string();
        }
        std::error_code error;
        is_there |= !last_part && fs::exists(base / file, error);
      }
    }
  if (forbidden) return bad("lies outside of the mesh's folder: expected --allow-outside");
  if (is_there) return bad("is not a regular file");
  return std::string();
}

std::string MeshFolder::note() const {
  if (moved_.empty()) return {};
  constexpr size_t most = 5;
  std::vector<std::string> names;
  for (const std::string& name : moved_)
    if (names.size() < most) names.push_back(name.substr(0, 200));
  return fmt::format("not where the mesh names it, and taken from beside the mesh: {}{}",
                     fmt::join(names, ", "),
                     moved_.size() > most ? fmt::format(" and {} more", moved_.size() - most) : "");
}

}  // namespace voxkit
