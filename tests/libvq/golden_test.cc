// The bytes of encoded volumes, as checksums in tests/golden/vq_checksums.csv: the same for every compiler,
// build type, instruction set and number of threads.
//
// A row says what to encode; its last two columns are what must come out. VOXKIT_BLESS=1 in the environment
// writes them anew, after a change that is meant to change files.
#include <fmt/format.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>

#include "formats/copy.h"
#include "formats/volume/readers.h"
#include "tests/damage.h"
#include "tests/libvq/volumes.h"

namespace voxkit::vq {
namespace {

using namespace voxkit::vq::test;

constexpr const char* columns = "volume,codebook,offsets,max_error,k_means,bytes,xxh64";
constexpr size_t keys = 5;

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, separator);) parts.push_back(part);
  return parts;
}

/// "sphere:40", say, with blanks for commas, or one of volumes.h: "TYPE CONTENT XxYxZ BITS SEED".
std::unique_ptr<VolumeSource> source_of(const std::string& volume) {
  if (is_builtin(volume)) {
    std::string name = volume;
    std::replace(name.begin(), name.end(), ' ', ',');
    auto source = open_builtin(name);
    return source ? std::move(*source) : nullptr;
  }
  const auto words = split(volume, ' ');
  const std::map<std::string, SampleType> types{{"u8", SampleType::u8},
                                                {"u16", SampleType::u16},
                                                {"i16", SampleType::i16},
                                                {"f32", SampleType::f32},
                                                {"bit", SampleType::bit}};
  const std::map<std::string, Content> contents{{"noise", Content::noise},
                                                {"scan", Content::scan},
                                                {"levels", Content::levels},
                                                {"constant", Content::constant},
                                                {"blobs", Content::blobs}};
  if (words.size() != 5 || !types.contains(words[0]) || !contents.contains(words[1])) return nullptr;
  const auto sides = split(words[2], 'x');
  if (sides.size() != 3) return nullptr;
  const VolumeInfo info = voxkit::test::scalar_info(
      {std::stoll(sides[0]), std::stoll(sides[1]), std::stoll(sides[2])}, types.at(words[0]));
  return std::make_unique<voxkit::test::MemorySource>(
      info, make_voxels(info, contents.at(words[1]), std::stoi(words[3]),
                        static_cast<uint32_t>(std::stoul(words[4]))));
}

struct Row {
  std::string key;  ///< the columns that say what to encode
  std::string volume;
  Options options;
  std::string expected;  ///< the other columns
};

std::vector<Row> read_table() {
  std::ifstream in(VOXKIT_VQ_GOLDEN_TABLE);
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, columns);
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    const auto fields = split(line, ',');
    if (fields.size() < keys) {
      ADD_FAILURE() << "a row of " << fields.size() << " columns: " << line;
      continue;
    }
    Row row;
    row.volume = fields[0];
    row.options.codebook = fields[1] == "packed" ? Codebook::packed : Codebook::rbuc;
    if (fields[2] != "auto")
      row.options.mapping = fields[2] == "direct" ? Mapping::direct : Mapping::indirect;
    if (fields[3] != "-") row.options.max_error = std::stod(fields[3]);
    if (const auto words = split(fields[4], ' '); words.size() == 2) {
      row.options.reduce = std::stoull(words[0]);
      row.options.seeding = words[1] == "d2" ? Seeding::d2 : Seeding::furthest;
    }
    for (size_t i = 0; i < keys; ++i) row.key += fields[i] + ",";
    if (fields.size() == keys + 2) row.expected = fields[keys] + "," + fields[keys + 1];
    rows.push_back(row);
  }
  return rows;
}

std::string encoded(Row row, int threads) {
  const auto source = source_of(row.volume);
  if (!source) return "no such volume";
  if (source->info().format == VoxelFormat::float32) {
    Context ctx = context();
    const auto range = measure_range(*source, ctx);
    EXPECT_TRUE(range);
    row.options.range = *range;
  }
  const auto bytes = encode_to_memory(*source, row.options, threads).bytes;
  return fmt::format("{},{:016x}", bytes.size(), voxkit::test::checksum(bytes));
}

TEST(VqGolden, BytesAreThoseOfTheTable) {
  const auto rows = read_table();
  ASSERT_GE(rows.size(), 18u);
  const char* bless = std::getenv("VOXKIT_BLESS");
  if (bless && std::string(bless) == "1") {
    std::ofstream out(VOXKIT_VQ_GOLDEN_TABLE);
    out << columns << "\n";
    for (const Row& row : rows) out << row.key << encoded(row, 1) << "\n";
    ASSERT_TRUE(out.flush());
    return;
  }
  for (const Row& row : rows)
    for (const int threads : {1, 2, 7})
      EXPECT_EQ(encoded(row, threads), row.expected) << row.key << " on " << threads << " threads";
}

}  // namespace
}  // namespace voxkit::vq
