// The bytes of encoded surfaces, as checksums in tests/golden/color_checksums.csv: the same for every
// compiler, build type, instruction set and number of threads.
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
#include "libcolor/surface/volume_surface.h"
#include "libcolor/terrain/terrain.h"
#include "tests/damage.h"
#include "tests/libcolor/color_runs.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

constexpr const char* columns = "scene,codec,threshold,effort,colors,counts,bytes,xxh64";
constexpr size_t keys = 6;

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, separator);) parts.push_back(part);
  return parts;
}

/// "menger:4" or "terrain:64", say, or the name of one of color_runs.h, on the voxels of a sphere.
std::unique_ptr<SurfaceSource> source_of(const std::string& scene) {
  if (is_terrain(scene)) {
    auto terrain = open_terrain(scene);
    return terrain ? std::move(*terrain) : nullptr;
  }
  if (is_builtin(scene)) {
    auto volume = open_builtin(scene);
    if (!volume) return nullptr;
    auto surface = surface_of(std::move(*volume));
    return surface ? std::move(*surface) : nullptr;
  }
  Voxels voxels = sphere_shell(6);
  for (const ColorCase& c : color_cases(voxels.size(), 5)) {
    if (c.name != scene) continue;
    for (size_t i = 0; i < voxels.size(); ++i) voxels[i].color = c.colors[i];
    return std::make_unique<ListSource>(voxels, Index3(64));
  }
  return nullptr;
}

std::string encoded(const std::string& key, int threads) {
  const auto fields = split(key, ',');
  const auto source = source_of(fields[0]);
  if (!source) return "no such scene";
  Options options;
  const std::map<std::string, ColorCodec> codecs{{"raw", ColorCodec::raw},
                                                 {"fws", ColorCodec::fws},
                                                 {"vws", ColorCodec::vws},
                                                 {"bc1", ColorCodec::bc1},
                                                 {"bc7", ColorCodec::bc7},
                                                 {"palette", ColorCodec::palette},
                                                 {"predicted", ColorCodec::predicted}};
  // "vws-lab": with a threshold in CIELAB; "raw-octree": the way geometry is stored, else as a DAG.
  const auto codec = split(fields[1], '-');
  options.codec = codecs.at(codec[0]);
  options.geometry = Geometry::dag;
  for (const std::string& word : codec) {
    if (word == "lab") options.space = ErrorSpace::lab;
    if (word == "ssvdag") options.geometry = Geometry::ssvdag;
    if (word == "octree") options.geometry = Geometry::octree;
  }
  options.threshold = std::stod(fields[2]);
  options.effort = std::stoi(fields[3]);
  options.palette = 100;  // fewer than the scenes have
  options.colors = fields[4] == "all" ? Colors::all : Colors::leaf;
  options.counts = fields[5] == "pointer" ? Counts::pointer : Counts::node;
  const auto bytes = compressed(*source, options, threads);
  return fmt::format("{},{:016x}", bytes.size(), voxkit::test::checksum(bytes));
}

TEST(ColorGolden, BytesAreThoseOfTheTable) {
  std::ifstream in(VOXKIT_COLOR_GOLDEN_TABLE);
  std::string line;
  std::getline(in, line);
  ASSERT_EQ(line, columns);
  std::vector<std::pair<std::string, std::string>> rows;  // what to encode, what must come out
  while (std::getline(in, line)) {
    const auto fields = split(line, ',');
    ASSERT_GE(fields.size(), keys) << line;
    std::string key, expected;
    for (size_t i = 0; i < fields.size(); ++i) (i < keys ? key : expected) += fields[i] + ",";
    if (!expected.empty()) expected.pop_back();
    rows.emplace_back(key, expected);
  }
  ASSERT_GE(rows.size(), 12u);
  if (const char* bless = std::getenv("VOXKIT_BLESS"); bless && std::string(bless) == "1") {
    std::ofstream out(VOXKIT_COLOR_GOLDEN_TABLE);
    out << columns << "\n";
    for (const auto& row : rows) out << row.first << encoded(row.first, 1) << "\n";
    ASSERT_TRUE(out.flush());
    return;
  }
  for (const auto& [key, expected] : rows)
    for (const int threads : {1, 3})
      EXPECT_EQ(encoded(key, threads), expected) << key << ", " << threads << " threads";
}

}  // namespace
}  // namespace voxkit::color
