// Any bytes, as a model and as a page: an error or samples within the model's range, and no other memory
// touched.
#include <gtest/gtest.h>

#include "libpage/page.h"
#include "tests/libpage/pages.h"

namespace voxkit::page {
namespace {

using Bytes = std::vector<std::byte>;

/// Exactly its bytes on the heap, so that a sanitizer sees any read past the end.
template <class T>
bool decode_exactly(const Model& model, const Bytes& page, Extent extent) {
  const Bytes copy(page.begin(), page.end());
  std::vector<T> out(static_cast<size_t>(extent.voxels()));
  const Status status = decode_page(model, copy, extent, std::span<T>(out));
  if (!status) {
    EXPECT_EQ(status.error().code, ErrorCode::input) << status.error().what;
    return false;
  }
  for (const T sample : out) EXPECT_LE(sample, model.max_sample());
  return true;
}

void attack(const Bytes& model_bytes, const std::vector<Bytes>& pages, const std::vector<Extent>& sizes,
            bool& parsed) {
  const Bytes copy(model_bytes.begin(), model_bytes.end());
  const Result<Model> model = Model::parse(copy);
  parsed = model.has_value();
  if (!model) {
    EXPECT_EQ(model.error().code, ErrorCode::input);
    EXPECT_FALSE(model.error().what.empty());
    return;
  }
  EXPECT_EQ(Model::parse(model->serialise())->serialise(), model->serialise());
  for (size_t i = 0; i < pages.size(); ++i) decode_exactly<uint32_t>(*model, pages[i], sizes[i]);
}

struct Seeds {
  Bytes model;
  std::vector<Bytes> pages;
  std::vector<Extent> sizes;
};

Seeds make_seeds(uint32_t greatest, uint32_t max_error, bool palette) {
  std::mt19937 random(greatest + max_error);
  ModelBuilder builder;
  std::vector<std::vector<uint32_t>> samples;
  Seeds seeds;
  for (const Extent e : {Extent{8, 8, 8}, Extent{16, 3, 2}, Extent{1, 1, 3}})
    for (int kind = 0; kind < test::page_kinds; ++kind) {
      samples.push_back(test::make_page(kind, e, greatest, random));
      if (palette)
        for (uint32_t& sample : samples.back()) sample = sample / 8 * 8;
      seeds.sizes.push_back(e);
      builder.add(std::span<const uint32_t>(samples.back()), e);
    }
  ModelOptions options;
  options.max_error = max_error;
  options.max_sample = greatest;
  if (palette)
    for (uint32_t value = 0; value <= greatest; value += 8) options.values.push_back(value);
  const Result<Model> model = builder.build(options);
  EXPECT_TRUE(model);
  seeds.model = model->serialise();
  for (size_t i = 0; i < samples.size(); ++i) {
    seeds.pages.emplace_back();
    EXPECT_TRUE(
        encode_page(*model, std::span<const uint32_t>(samples[i]), seeds.sizes[i], seeds.pages.back()));
  }
  return seeds;
}

class Hostile : public testing::TestWithParam<std::tuple<uint32_t, uint32_t, bool>> {
 protected:
  Seeds seeds = make_seeds(std::get<0>(GetParam()), std::get<1>(GetParam()), std::get<2>(GetParam()));
};

TEST_P(Hostile, EveryCutOfAModelIsRefused) {
  for (size_t length = 0; length < seeds.model.size(); ++length)
    EXPECT_FALSE(Model::parse(std::span(seeds.model).first(length))) << length;
  Bytes longer = seeds.model;
  longer.push_back(std::byte{0});
  EXPECT_FALSE(Model::parse(longer));
}

/// Where a coder's state holds little but raw bits, as in noise, a cut shows less often.
TEST_P(Hostile, CutPages) {
  const Result<Model> model = Model::parse(seeds.model);
  ASSERT_TRUE(model);
  int refused = 0, tried = 0;
  for (size_t i = 0; i < seeds.pages.size(); ++i) {
    const Bytes& page = seeds.pages[i];
    for (size_t length = 0; length < page.size(); ++length) {
      ++tried;
      refused += decode_exactly<uint32_t>(
                     *model, Bytes(page.begin(), page.begin() + static_cast<long>(length)), seeds.sizes[i])
                     ? 0
                     : 1;
    }
    Bytes longer = page;
    longer.push_back(std::byte{1});
    decode_exactly<uint32_t>(*model, longer, seeds.sizes[i]);
  }
  EXPECT_GE(refused, tried * 9 / 10);
}

TEST_P(Hostile, ChangedModels) {
  std::mt19937 random(1);
  int parsed = 0;
  for (int round = 0; round < 600; ++round) {
    Bytes changed = seeds.model;
    for (auto changes = 1 + random() % 3; changes-- > 0;)
      changed[random() % changed.size()] ^= static_cast<std::byte>(1 << random() % 8);
    if (round % 4 == 0)
      for (size_t i = random() % changed.size(); i < changed.size(); ++i)
        changed[i] = static_cast<std::byte>(random());
    bool valid = false;
    attack(changed, seeds.pages, seeds.sizes, valid);
    parsed += valid ? 1 : 0;
  }
  EXPECT_GT(parsed, 0);
}

TEST_P(Hostile, ChangedPages) {
  const Result<Model> model = Model::parse(seeds.model);
  ASSERT_TRUE(model);
  std::mt19937 random(2);
  int refused = 0, tried = 0;
  for (int round = 0; round < 40; ++round)
    for (size_t i = 0; i < seeds.pages.size(); ++i) {
      Bytes changed = seeds.pages[i];
      if (changed.size() < 16) continue;
      changed[random() % changed.size()] ^= static_cast<std::byte>(1 << random() % 8);
      ++tried;
      refused += decode_exactly<uint32_t>(*model, changed, seeds.sizes[i]) ? 0 : 1;
    }
  // A changed raw bit changes one sample, and nothing else.
  EXPECT_GE(refused, tried / 3);
  for (int round = 0; round < 400; ++round) {
    Bytes noise(random() % 300);
    for (std::byte& byte : noise) byte = static_cast<std::byte>(random());
    decode_exactly<uint32_t>(*model, noise,
                             test::extents[static_cast<size_t>(round) % std::size(test::extents)]);
  }
}

INSTANTIATE_TEST_SUITE_P(Models, Hostile,
                         testing::Values(std::tuple{255u, 0u, false}, std::tuple{4095u, 3u, false},
                                         std::tuple{65535u, 0u, true}, std::tuple{0xffffffffu, 0u, false},
                                         std::tuple{0xffffffffu, 100u, false}));

}  // namespace
}  // namespace voxkit::page
