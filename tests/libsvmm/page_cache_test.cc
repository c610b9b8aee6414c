// What is kept is found, as long as there is memory for it; what was used lately stays longest.
#include "libsvmm/packed/page_cache.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

namespace voxkit::svmm {
namespace {

using Page = PageCache::Page;

std::shared_ptr<const Page> page_of(uint64_t number, size_t bytes) {
  auto page = std::make_shared<Page>(bytes);
  std::memcpy(page->data(), &number, sizeof number);
  return page;
}
uint64_t number_in(const Page& page) {
  uint64_t number;
  std::memcpy(&number, page.data(), sizeof number);
  return number;
}

TEST(PageCache, FindsWhatItKeepsAndNothingElse) {
  MemoryBudget memory(uint64_t{1} << 26);  // an eighth of it: 8 MiB
  {
    PageCache cache(memory);
    EXPECT_EQ(cache.find({0, 1}), nullptr);
    std::mt19937_64 random(3);
    size_t found = 0;
    for (int i = 0; i < 60000; ++i) {
      const PageCache::Key key{static_cast<int>(random() % 3),
                               random() % 4000 * (random() % 2 == 0 ? 1 : 1 << 20)};
      const uint64_t content = key.number * 4 + static_cast<uint64_t>(key.level);
      if (const auto page = cache.find(key)) {
        ++found;
        ASSERT_EQ(number_in(*page), content);
      } else {
        cache.keep(key, page_of(content, 1000 + content % 3000));
      }
    }
    EXPECT_GT(found, 1000u);
    // No more than its share is taken of it.
    EXPECT_TRUE(memory.reserve((uint64_t{1} << 26) / 8 * 7, "the rest"));
    memory.release((uint64_t{1} << 26) / 8 * 7);
    EXPECT_FALSE(memory.reserve(uint64_t{1} << 26, "all"));
  }
  EXPECT_TRUE(memory.reserve(uint64_t{1} << 26, "all"));
}

TEST(PageCache, SparesWhatIsUsed) {
  MemoryBudget memory(uint64_t{1} << 24);
  PageCache cache(memory);
  for (uint64_t number = 0; number < 100; ++number) cache.keep({0, number}, page_of(number, 4096));
  for (uint64_t number = 100; number < 20000; ++number) {
    cache.keep({0, number}, page_of(number, 4096));
    for (uint64_t used = 0; used < 20 && number % 8 == 0; ++used)
      ASSERT_NE(cache.find({0, used}), nullptr) << number;
  }
  EXPECT_EQ(cache.find({0, 50}), nullptr);
}

}  // namespace
}  // namespace voxkit::svmm
