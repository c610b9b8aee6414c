// What a survey says does not depend on which thread saw what first.
#include "libsvmm/packed/survey.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

namespace voxkit::svmm {
namespace {

TEST(Survey, MoreFloatsThanAreCountedAreNoneFromAnyThreads) {
  constexpr int threads = 4;
  constexpr int64_t side = 400;  // 160000 values a thread
  std::vector<std::vector<float>> parts(threads);
  for (size_t i = 0; i < threads; ++i)
    for (int64_t v = 0; v < side * side; ++v)
      parts[i].push_back(static_cast<float>(v + static_cast<int64_t>(i) * side * side));
  for (int round = 0; round < 20; ++round) {
    Survey survey(VoxelFormat::float32);
    std::atomic<int> ready{0};
    std::vector<std::thread> running;
    for (size_t i = 0; i < threads; ++i)
      running.emplace_back([&, i] {
        ++ready;
        while (ready < threads) std::this_thread::yield();
        const auto* const voxels = reinterpret_cast<const std::byte*>(parts[i].data());
        survey.look(packed(voxels, {side, side, 1}, VoxelFormat::float32), {side, side, 1});
      });
    for (std::thread& thread : running) thread.join();
    ASSERT_TRUE(survey.values().empty()) << round;
    EXPECT_EQ(survey.range(), (ValueRange{0, threads * side * side - 1}));
  }
}

TEST(Survey, ValuesAscend) {
  Survey floats(VoxelFormat::float32);
  const float some[] = {3, -1, 3, 0.5f};
  floats.look(packed(reinterpret_cast<const std::byte*>(some), {4, 1, 1}, VoxelFormat::float32), {4, 1, 1});
  EXPECT_EQ(floats.values().size(), 3u);
  EXPECT_TRUE(std::ranges::is_sorted(floats.values()));
  Survey bytes(VoxelFormat::density8);
  const uint8_t few[] = {9, 4, 9};
  bytes.look(packed(reinterpret_cast<const std::byte*>(few), {3, 1, 1}, VoxelFormat::density8), {3, 1, 1});
  EXPECT_EQ(bytes.values(), (std::vector<uint32_t>{4, 9}));
}

}  // namespace
}  // namespace voxkit::svmm
