// Writes the seeds of the fuzz target of surfaces: FOLDER/color/NUMBER.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tests/libcolor/attribute_scenes.h"

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
  const auto write = [&](SurfaceSource& source, const Options& options) {
    const std::vector<std::byte> file = compressed(source, options);
    std::ofstream(folder / std::to_string(number++), std::ios::binary)
        .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  };
  for (const ColorCodec codec : codecs())
    for (const Counts counts : {Counts::node, Counts::pointer})
      for (const Colors colors : {Colors::leaf, Colors::all}) {
        Options options;
        options.codec = codec;
        options.counts = counts;
        options.colors = colors;
        if (!validate(options)) continue;
        // Each geometry with some codecs.
        constexpr Geometry geometries[] = {Geometry::dag, Geometry::octree, Geometry::ssvdag};
        options.geometry = geometries[(number / 2) % (counts == Counts::node ? 3 : 2)];
        ListSource shell(sphere_shell(3), Index3(8)), few(scattered(6, 30, 1), Index3(64));
        for (ListSource* source : {&shell, &few}) write(*source, options);
      }
  for (const ColorCodec codec : {ColorCodec::raw, ColorCodec::fws, ColorCodec::vws})
    for (const Pattern pattern : {Pattern::runs, Pattern::random}) {
      Options options;
      options.codec = codec;
      options.colors = pattern == Pattern::runs ? Colors::all : Colors::leaf;
      const Voxels voxels = sphere_shell(3);
      const AttributeSet set = all_attributes();
      AttributedSource source(voxels, Index3(8), set, interleaved(set, voxels.size(), pattern, 3));
      write(source, options);
    }
}
