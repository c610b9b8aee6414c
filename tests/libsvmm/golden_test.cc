// The bytes of encoded volumes, as checksums in tests/golden/checksums.csv: the same for every compiler,
// build type, instruction set and number of threads.
//
// A row says what to encode; its last two columns are what must come out. VOXKIT_BLESS=1 in the environment
// writes them anew, after a change that is meant to change files.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>

#include "formats/volume/readers.h"
#include "tests/damage.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;

constexpr const char* columns = "volume,layout,base,bound,widths,rootwidth,quality,bytes,xxh64";

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, separator);) parts.push_back(part);
  return parts;
}

/// "menger:4", say, with blanks for commas, or one of tests/libsvmm/volumes.h: "FORMAT CONTENT XxYxZ SEED".
std::unique_ptr<VolumeSource> source_of(const std::string& volume) {
  if (is_builtin(volume)) {
    std::string name = volume;
    std::replace(name.begin(), name.end(), ' ', ',');
    auto source = open_builtin(name);
    return source ? std::move(*source) : nullptr;
  }
  const auto words = split(volume, ' ');
  const std::map<std::string, VoxelFormat> formats{
      {"rgba32", VoxelFormat::rgba32},     {"rgb24", VoxelFormat::rgb24},
      {"density8", VoxelFormat::density8}, {"density16", VoxelFormat::density16},
      {"float32", VoxelFormat::float32},   {"bitmap", VoxelFormat::bitmap}};
  const std::map<std::string, Content> contents{{"noise", Content::noise},
                                                {"smooth", Content::smooth},
                                                {"blobs", Content::blobs},
                                                {"constant", Content::constant},
                                                {"specials", Content::specials}};
  if (words.size() != 4 || !formats.contains(words[0]) || !contents.contains(words[1])) return nullptr;
  const auto sides = split(words[2], 'x');
  if (sides.size() != 3) return nullptr;
  const VolumeInfo info =
      make_info({std::stoll(sides[0]), std::stoll(sides[1]), std::stoll(sides[2])}, formats.at(words[0]));
  const auto voxels = make_voxels(info, contents.at(words[1]), static_cast<uint32_t>(std::stoul(words[3])));
  return std::make_unique<voxkit::test::MemorySource>(info, bytes_of(voxels, info.format));
}

struct Row {
  std::string key;  ///< the columns that say what to encode
  std::string volume;
  Params params;
  std::string expected;  ///< the other columns
};

std::vector<Row> read_table() {
  std::ifstream in(VOXKIT_GOLDEN_TABLE);
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, columns);
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    const auto fields = split(line, ',');
    if (fields.size() < 7) {
      ADD_FAILURE() << "a row of " << fields.size() << " columns: " << line;
      continue;
    }
    Row row;
    row.volume = fields[0];
    const auto source = source_of(row.volume);
    if (!source) {
      ADD_FAILURE() << "no such volume: " << line;
      continue;
    }
    const auto named = [&](const std::string& text, const std::vector<std::string>& names) {
      const auto found = std::find(names.begin(), names.end(), text);
      EXPECT_NE(found, names.end()) << text << " in: " << line;
      return found - names.begin() + 1;
    };
    std::vector<int> widths;
    for (const std::string& width : split(fields[4], ' ')) widths.push_back(std::stoi(width));
    if (widths == std::vector<int>{0}) widths.clear();
    const auto layout = static_cast<Layout>(named(fields[1], {"thesis", "plain"}));
    row.params =
        make_params(source->info().format, std::stod(fields[6]), widths, std::stoll(fields[5]), layout,
                    static_cast<Bound>(named(fields[3], {"local", "global"})), layout == Layout::plain);
    row.params.base = static_cast<Base>(named(fields[2], {"raw", "bitmap", "alpha", "gray", "bc1"}));
    for (size_t i = 0; i < 7; ++i) row.key += fields[i] + ",";
    if (fields.size() == 9) row.expected = fields[7] + "," + fields[8];
    rows.push_back(row);
  }
  return rows;
}

std::string encoded(const Row& row, int threads) {
  const auto source = source_of(row.volume);
  const auto bytes = encode_to_memory(*source, row.params, threads).bytes;
  return fmt::format("{},{:016x}", bytes.size(), voxkit::test::checksum(bytes));
}

TEST(SvmmGolden, BytesAreThoseOfTheTable) {
  const auto rows = read_table();
  ASSERT_GE(rows.size(), 30u);
  const char* bless = std::getenv("VOXKIT_BLESS");
  if (bless && std::string(bless) == "1") {
    std::ofstream out(VOXKIT_GOLDEN_TABLE);
    out << columns << "\n";
    for (const Row& row : rows) out << row.key << encoded(row, 1) << "\n";
    ASSERT_TRUE(out.flush());
    return;
  }
  for (const Row& row : rows)
    for (int threads : {1, 2, 7})
      EXPECT_EQ(encoded(row, threads), row.expected) << row.key << " on " << threads << " threads";
}

}  // namespace
}  // namespace voxkit::svmm
