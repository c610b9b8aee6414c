#include "tools/common/formats_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <span>
#include <string_view>
#include <vector>

#include "formats/volume/volume_formats.h"

namespace voxkit::cli {
namespace {

struct Row {
  std::string_view name;
  std::span<const std::string_view> reads, writes;
  std::string_view types;
  bool levels;
  std::string_view random_access;
};

constexpr std::string_view svmm[] = {".svmm"}, vqv[] = {".vqv"}, dagc[] = {".dagc"};
/// Those of our own, which the table of formats/ does not know.
constexpr Row compressed[] = {
    {"svmm", svmm, svmm, "u8 i8 u16 i16 u32 i32 u64 i64 f16 f32 rgb8 rgba8 bit", true, "yes"},
    {"vqv", vqv, vqv, "u8 i8 u16 i16 f32", false, "yes"},
    {"dagc", dagc, dagc, "rgb8 rgba8", true, "yes"},
};

std::vector<Row> rows() {
  std::vector<Row> all;
  for (const VolumeFormat& f : volume_formats())
    all.push_back({f.name, f.endings, f.endings.first(f.written), f.types, false, f.random_access});
  all.insert(all.end(), std::begin(compressed), std::end(compressed));
  return all;
}

Json list(std::span<const std::string_view> words) {
  Json json = Json::array();
  for (const std::string_view word : words) json.push(word);
  return json;
}

}  // namespace

std::string formats_text() {
  std::string text;
  for (const Row& row : rows()) {
    text += fmt::format("{:<10} reads {}\n", row.name, fmt::join(row.reads, " "));
    text += row.writes.empty() ? "           writes nothing\n"
                               : fmt::format("           writes {}\n", fmt::join(row.writes, " "));
    text += fmt::format("           types {}; levels: {}; random access: {}\n", row.types,
                        row.levels ? "yes" : "no", row.random_access);
  }
  return text;
}

Json formats_json(const Run& run) {
  Json json = Json::result();
  json.set("tool", run.tool).set("version", version_text());
  Json formats = Json::array();
  for (const Row& row : rows()) {
    Json types = Json::array();
    for (std::string_view rest = row.types; !rest.empty();) {
      const size_t end = std::min(rest.find(' '), rest.size());
      types.push(rest.substr(0, end));
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    Json entry = Json::object();
    entry.set("name", row.name).set("reads", list(row.reads)).set("writes", list(row.writes));
    entry.set("types", std::move(types)).set("levels", row.levels);
    entry.set("random_access", row.random_access);
    formats.push(std::move(entry));
  }
  json.set("formats", std::move(formats));
  return json;
}

}  // namespace voxkit::cli
