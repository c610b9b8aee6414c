// Backends: what is uploaded is what kernels see; every index is run once; sizes and limits are kept.
#include "librender/device/backend.h"

#include <gtest/gtest.h>

#include <numeric>

#include "librender/device/backend_run.h"

namespace voxkit::render {
namespace {

class BackendTest : public testing::Test {
 protected:
  std::shared_ptr<const Backend> backend_ = *Backend::open(BackendKind::threads);
  MemoryBudget memory_{uint64_t{64} << 20};
  Context ctx_{.threads = 3, .memory = &memory_};
};

struct Square {
  const int* from;
  int* to;
  void operator()(int64_t i) const { to[i] += from[i] * from[i]; }
};

TEST_F(BackendTest, RunsEveryIndexOnceOnWhatWasUploaded) {
  for (const int count : {0, 1, 1023, 1024, 5000}) {
    std::vector<int> values(static_cast<size_t>(count));
    std::iota(values.begin(), values.end(), 1);
    const auto from = backend_->upload(std::span<const int>(values), "numbers", ctx_);
    ASSERT_TRUE(from);
    const std::vector<int> zeros(values.size());
    const auto to = backend_->upload(std::span<const int>(zeros), "squares", ctx_);
    ASSERT_TRUE(to);
    ASSERT_EQ(from->size(), values.size());
    ASSERT_NE(from->data(), nullptr);  // empty arrays are something, too
    ASSERT_NE(from->data(), values.data());
    const auto seconds = backend_->run("squaring", count, Square{from->data(), to->data()}, ctx_);
    ASSERT_TRUE(seconds);
    EXPECT_GE(*seconds, 0);
    std::vector<int> squares(values.size());
    ASSERT_TRUE(backend_->download(*to, 0, std::span(squares)));
    for (int i = 0; i < count; ++i) ASSERT_EQ(squares[static_cast<size_t>(i)], (i + 1) * (i + 1));
  }
}

/// Each group writes where its lanes are, if nothing of another group is in what it shares.
struct Mark {
  struct Shared {
    unsigned char used;
  };
  int* to;
  template <class Lanes>
  int64_t groups() const {
    return 100 / Lanes::count;
  }
  template <class Lanes>
  void operator()(int64_t group, Shared& shared) const {
    for (int i = 0; i < Lanes::held; ++i) to[group * Lanes::count + Lanes::first() + i] += shared.used;
    shared.used = 1;
  }
};

TEST_F(BackendTest, GroupsShareMemoryThatBeginsWithAnything) {
  const std::vector<int> zeros(100);
  const auto to = backend_->upload(std::span<const int>(zeros), "marks", ctx_);
  ASSERT_TRUE(to);
  ASSERT_TRUE(backend_->run_groups("marking", Mark{to->data()}, ctx_));
  for (size_t i = 0; i < 96; ++i) ASSERT_EQ(to->data()[i], 0xa5) << i;
  for (size_t i = 96; i < 100; ++i) ASSERT_EQ(to->data()[i], 0) << i;
}

TEST_F(BackendTest, ArraysAreKeptWhereTheySuffice) {
  DeviceArray<int> array;
  ASSERT_TRUE(backend_->reserve(array, 100, "an array", ctx_));
  const int* const first = array.data();
  ASSERT_TRUE(backend_->reserve(array, 7, "an array", ctx_));
  EXPECT_EQ(array.data(), first);
  EXPECT_EQ(array.size(), 100u);
  ASSERT_TRUE(backend_->reserve(array, 101, "an array", ctx_));
  EXPECT_EQ(array.size(), 101u);
}

TEST_F(BackendTest, NothingIsCopiedBeyondAnArray) {
  const auto array = backend_->allocate<int>(10, "an array", ctx_);
  ASSERT_TRUE(array);
  int values[4] = {1, 2, 3, 4};
  EXPECT_TRUE(backend_->fill(*array, 6, std::span<const int>(values)));
  EXPECT_FALSE(backend_->fill(*array, 7, std::span<const int>(values)));
  EXPECT_FALSE(backend_->fill(*array, ~uint64_t{0}, std::span<const int>(values)));
  int back[4] = {};
  EXPECT_TRUE(backend_->download(*array, 6, std::span<int>(back)));
  EXPECT_EQ(back[3], 4);
  EXPECT_FALSE(backend_->download(*array, 7, std::span<int>(back)));
}

TEST_F(BackendTest, MemoryCountsAndIsNamed) {
  const auto refused = backend_->allocate<int>(uint64_t{1} << 30, "an array of numbers", ctx_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::limit);
  EXPECT_NE(refused.error().what.find("an array of numbers needs 4294967296 bytes"), std::string::npos);
}

TEST_F(BackendTest, UploadsCanBeInterrupted) {
  const std::vector<std::byte> bytes(size_t{40} << 20);
  const auto array = backend_->allocate<std::byte>(bytes.size(), "bytes", ctx_);
  ASSERT_TRUE(array);
  interrupt_signal = 2;
  const Status status = backend_->fill(*array, 0, std::span<const std::byte>(bytes));
  interrupt_signal = 0;
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::interrupted);
}

TEST(Backend, WhereThereIsNoGpuItSaysSo) {
  const auto cuda = Backend::open(BackendKind::cuda);
  if (cuda) GTEST_SKIP() << "there is one";
  EXPECT_EQ(cuda.error().code, ErrorCode::device);
  EXPECT_TRUE(cuda.error().what.starts_with("--device cuda: ")) << cuda.error().what;
}

}  // namespace
}  // namespace voxkit::render
