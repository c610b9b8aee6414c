// Writes the seeds of the fuzz target of pages: FOLDER/page/NUMBER.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "libpage/page.h"
#include "tests/libpage/pages.h"

namespace {

using namespace voxkit::page;

struct Kind {
  uint32_t greatest, max_error;
  bool palette, parents, labels = false;
};
constexpr Kind kinds[] = {
    {255, 0, false, false},        {255, 3, false, false},       {1, 0, false, false},
    {4095, 0, true, false},        {65535, 100, false, false},   {70000, 2, false, false},
    {0xffffffff, 0, false, false}, {0xffffffff, 0, true, false}, {255, 0, false, true},
    {65535, 3, false, true},       {4095, 0, true, true},        {0xffffffff, 0, false, true},
    {9, 0, false, false, true},    {999, 0, false, true, true}};
constexpr Extent sizes[] = {{8, 8, 8}, {16, 3, 2}, {1, 1, 3}, {5, 1, 4}};

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::fputs("usage: page_seeds FOLDER\n", stderr);
    return 2;
  }
  const std::filesystem::path folder = std::filesystem::path(arguments[1]) / "page";
  std::filesystem::create_directories(folder);
  std::mt19937 random(1);
  int number = 0;
  for (const Kind& kind : kinds) {
    ModelOptions options;
    options.max_error = kind.max_error;
    options.max_sample = kind.greatest;
    options.parents = kind.parents;
    options.labels = kind.labels;
    const uint32_t part = kind.greatest / 9;
    if (kind.palette)
      for (uint32_t i = 0; i < 10; ++i) options.values.push_back(part * i);
    ModelBuilder builder;
    std::vector<std::vector<uint32_t>> pages, above;
    std::vector<Parent<uint32_t>> parents;
    for (const Extent extent : sizes)
      for (int content = 0; content < test::page_kinds; ++content) {
        pages.push_back(test::make_page(content, extent, kind.greatest, random));
        if (kind.palette)
          for (uint32_t& sample : pages.back()) sample = sample / part * part;
        const Extent half{(extent.nx + 1) / 2, (extent.ny + 1) / 2, (extent.nz + 1) / 2};
        above.push_back(test::make_parents(pages.back(), extent, half, 0, 0, 0, kind.greatest, random));
        parents.push_back({above.back(), half, 0, 0, 0});
        builder.add(std::span<const uint32_t>(pages.back()), extent, parents.back());
      }
    const auto model = builder.build(options);
    if (!model) return 1;
    const auto bytes = model->serialise();
    for (size_t i = 0; i < pages.size(); i += 4) {
      const Extent extent = sizes[i / test::page_kinds];
      std::vector<std::byte> seed;
      for (const size_t byte : {static_cast<size_t>(extent.nx - 1), static_cast<size_t>(extent.ny - 1),
                                static_cast<size_t>(extent.nz - 1), bytes.size() & 255, bytes.size() >> 8})
        seed.push_back(static_cast<std::byte>(byte));
      seed.insert(seed.end(), bytes.begin(), bytes.end());
      for (const uint32_t sample : above[i])
        for (int byte = 0; byte < 4 && kind.parents; ++byte)
          seed.push_back(static_cast<std::byte>(sample >> 8 * byte & 0xff));
      if (!encode_page(*model, std::span<const uint32_t>(pages[i]), extent, seed, parents[i])) return 1;
      std::ofstream(folder / std::to_string(number++), std::ios::binary)
          .write(reinterpret_cast<const char*>(seed.data()), static_cast<std::streamsize>(seed.size()));
    }
  }
}
