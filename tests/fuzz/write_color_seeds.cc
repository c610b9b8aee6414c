// Writes the seeds of the fuzz target of surfaces: FOLDER/color/NUMBER.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tests/libcolor/scenes.h"

int main(int count, char** arguments) {
  using namespace voxkit;
  using namespace voxkit::color;
  if (count != 2) {
    std::fputs("usage: color_seeds FOLDER\n", stderr);
    return 2;
  }
  const std::filesystem::path folder = std::filesystem::path(arguments[1]) / "color";
  std::filesystem::create_directories(folder);
  int number = 0;
  for (const ColorCodec codec : codecs())
    for (const Counts counts : {Counts::node, Counts::pointer})
      for (const Colors colors : {Colors::leaf, Colors::all}) {
        Options options;
        options.codec = codec;
        options.counts = counts;
        options.colors = colors;
        // Each geometry with some codecs.
        constexpr Geometry geometries[] = {Geometry::dag, Geometry::octree, Geometry::ssvdag};
        options.geometry = geometries[(number / 2) % (counts == Counts::node ? 3 : 2)];
        ListSource shell(sphere_shell(3), Index3(8)), few(scattered(6, 30, 1), Index3(64));
        for (ListSource* source : {&shell, &few}) {
          const std::vector<std::byte> file = compressed(*source, options);
          std::ofstream(folder / std::to_string(number++), std::ios::binary)
              .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
        }
      }
}
