// Writes the seeds of every reader: FOLDER/READER/NUMBER.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tests/fuzz/harness.h"

int main(int count, char** arguments) {
  if (count != 2) {
    std::fputs("usage: fuzz_seeds FOLDER\n", stderr);
    return 2;
  }
  for (const auto& reader : voxkit::fuzz::readers()) {
    const auto folder = std::filesystem::path(arguments[1]) / reader.name;
    std::filesystem::create_directories(folder);
    int number = 0;
    for (const std::string& seed : reader.seeds()) {
      std::ofstream(folder / std::to_string(number++), std::ios::binary) << seed;
    }
  }
}
