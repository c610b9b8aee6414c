// Every reader on damaged files: each prefix of valid ones, and seeded mutations, through what the fuzz
// targets call.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <random>
#include <string>

#include "formats/module.h"
#include "tests/fuzz/harness.h"

namespace voxkit::fuzz {
namespace {

Verdict answer(const Reader& reader, const std::string& input) {
  // A buffer of exactly this size: a sanitizer sees any byte read past the end.
  const std::vector<char> exact(input.begin(), input.end());
  return reader.read(std::as_bytes(std::span(exact)));
}

/// One to three changes of the kinds that break readers: single bits and bytes, extreme counts, bytes lost,
/// doubled or cut.
std::string mutate(std::string file, std::mt19937& random) {
  for (auto changes = 1 + random() % 3; changes > 0 && file.size() > 8; --changes) {
    const size_t at = random() % file.size(), length = std::min<size_t>(1 + random() % 16, file.size() - at);
    switch (random() % 7) {
      case 0:
        file[at] = static_cast<char>(file[at] ^ 1 << random() % 8);
        break;
      case 1:
        file[at] = static_cast<char>(random());
        break;
      case 2:
      case 3: {
        constexpr uint32_t extremes[] = {0, 1, 0x7fffffff, 0x80000000, 0xffffffff, 0x10000, 0xfffffff0};
        const uint32_t value = extremes[random() % std::size(extremes)];
        for (size_t i = 0; i < std::min<size_t>(length, 4); ++i)
          file[at + i] = static_cast<char>(value >> (8 * i));
        break;
      }
      case 4:
        file.erase(at, length);
        break;
      case 5:
        file.insert(at, file.substr(at, length));
        break;
      case 6:
        if (random() % 8 == 0) file.resize(at);
        break;
    }
  }
  return file;
}

class Hostile : public testing::TestWithParam<Reader> {
 protected:
  void SetUp() override {
    const char* module = GetParam().module;
    if (module && !std::filesystem::exists(module_folder() + "/" + module + ".so")) {
      GTEST_SKIP() << "built without the module " << module;
    }
  }
};

TEST_P(Hostile, SeedsAreValid) {
  for (const std::string& seed : GetParam().seeds()) {
    ASSERT_FALSE(seed.empty());
    const Verdict verdict = answer(GetParam(), seed);
    EXPECT_EQ(verdict.fault, "");
    EXPECT_TRUE(verdict.accepted);
  }
}

TEST_P(Hostile, PrefixesAreAnsweredSoundly) {
  for (const std::string& seed : GetParam().seeds()) {
    // Long files: every prefix of the headers, then some.
    for (size_t length = 0; length < seed.size(); length += length < 1500 ? 1 : 13) {
      ASSERT_EQ(answer(GetParam(), seed.substr(0, length)).fault, "")
          << "cut to " << length << " of " << seed.size();
    }
  }
}

TEST_P(Hostile, MutationsAreAnsweredSoundly) {
  const auto seeds = GetParam().seeds();
  std::mt19937 random(11);
  for (int i = 0; i < 2000; ++i) {
    const std::string file = mutate(seeds[random() % seeds.size()], random);
    ASSERT_EQ(answer(GetParam(), file).fault, "") << "mutation " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Readers, Hostile, testing::ValuesIn(readers()),
                         [](const auto& reader) { return std::string(reader.param.name); });

}  // namespace
}  // namespace voxkit::fuzz
