// Pages that are predicted from those of the next coarser level.
#include <gtest/gtest.h>

#include "libpage/model_data.h"
#include "libpage/page.h"
#include "tests/libpage/pages.h"
#include "tests/libpage/reference.h"

namespace voxkit::page {
namespace {

using test::extents;

template <class T>
struct Family {
  Extent extent;
  std::vector<T> samples;
  std::vector<T> parents;
  Parent<T> parent;
};

template <class T>
std::vector<T> as(const std::vector<uint32_t>& samples) {
  std::vector<T> out;
  for (const uint32_t sample : samples) out.push_back(static_cast<T>(sample));
  return out;
}

/// Pages in any of the places that pages have in that of their parents.
template <class T>
std::vector<Family<T>> make_families(uint32_t greatest, uint32_t raster, std::mt19937& random) {
  std::vector<Family<T>> out;
  for (const Extent e : extents)
    for (int kind = 0; kind < test::page_kinds; ++kind) {
      const auto corner = [&](int n) { return n <= 16 && random() % 2 != 0 ? 8 : 0; };
      const auto side = [&](int n, int at) {
        return std::min(16, at + (n + 1) / 2 + (random() % 2 != 0 ? 3 : 0));
      };
      const int x = corner(e.nx), y = corner(e.ny), z = corner(e.nz);
      const Extent parents{side(e.nx, x), side(e.ny, y), side(e.nz, z)};
      std::vector<uint32_t> samples = test::make_page(kind, e, greatest, random);
      for (uint32_t& sample : samples) sample = sample / raster * raster;
      Family<T> family{e,
                       as<T>(samples),
                       as<T>(test::make_parents(samples, e, parents, x, y, z, greatest, random)),
                       {{}, parents, x, y, z}};
      out.push_back(std::move(family));
      out.back().parent.samples = out.back().parents;
    }
  return out;
}

template <class T>
void round_trip(const Model& model, const std::vector<Family<T>>& families) {
  ASSERT_TRUE(model.has_parents());
  test::ReferenceDecoder reference(model.serialise());
  std::vector<std::vector<std::byte>> coded(families.size());
  std::vector<std::vector<T>> decoded, again;
  std::vector<PageJob<T>> jobs;
  for (size_t i = 0; i < families.size(); ++i) {
    const Family<T>& f = families[i];
    std::vector<T> expected(f.samples.size()), out(f.samples.size());
    const Status encoded = encode_page(model, std::span<const T>(f.samples), f.extent, coded[i], f.parent,
                                       std::span<T>(expected));
    ASSERT_TRUE(encoded) << encoded.error().what;
    const Status status = decode_page(model, coded[i], f.extent, std::span<T>(out), f.parent);
    ASSERT_TRUE(status) << status.error().what;
    ASSERT_EQ(out, expected);
    for (size_t v = 0; v < out.size(); ++v)
      ASSERT_LE(std::abs(int64_t{f.samples[v]} - int64_t{out[v]}), int64_t{model.max_error()})
          << "page " << i << ", voxel " << v;
    const test::ReferenceParent parent{
        {f.parents.begin(), f.parents.end()}, f.parent.extent, f.parent.x, f.parent.y, f.parent.z};
    ASSERT_EQ(as<T>(reference.decode(coded[i], f.extent, parent)), out) << "page " << i;
    ASSERT_TRUE(reference.finished());
    decoded.push_back(std::move(out));
    again.emplace_back(f.samples.size());
  }
  for (size_t i = 0; i < families.size(); ++i)
    jobs.push_back({coded[i], families[i].extent, again[i], families[i].parent});
  ASSERT_TRUE(decode_pages(model, std::span<const PageJob<T>>(jobs)));
  EXPECT_EQ(again, decoded);
}

template <class T>
Model fit(const std::vector<Family<T>>& families, const ModelOptions& options) {
  ModelBuilder builder;
  for (const Family<T>& f : families) builder.add(std::span<const T>(f.samples), f.extent, f.parent);
  const Result<Model> model = builder.build(options);
  EXPECT_TRUE(model) << model.error().what;
  const Result<Model> parsed = Model::parse(model->serialise());
  EXPECT_TRUE(parsed) << parsed.error().what;
  EXPECT_EQ(parsed->serialise(), model->serialise());
  return *parsed;
}

template <class T>
void try_all(uint32_t greatest, std::initializer_list<uint32_t> errors) {
  std::mt19937 random(greatest);
  for (const uint32_t max_error : errors) {
    SCOPED_TRACE(max_error);
    const auto families = make_families<T>(greatest, 1, random);
    ModelOptions options;
    options.max_error = max_error;
    options.max_sample = greatest;
    options.parents = true;
    round_trip(fit(families, options), families);
    const Result<Model> blank = ModelBuilder().build(options);
    ASSERT_TRUE(blank);
    round_trip(*blank, families);
  }
}

TEST(Parents, OfEightBits) {
  try_all<uint8_t>(255, {0, 1, 16, 300});
}
TEST(Parents, OfOneBit) {
  try_all<uint8_t>(1, {0});
}
TEST(Parents, OfSixteenBits) {
  try_all<uint16_t>(65535, {0, 4, 30000});
}
TEST(Parents, OfTwelveBits) {
  try_all<uint16_t>(4095, {0, 5});
}
TEST(Parents, OfThirtyTwoBits) {
  try_all<uint32_t>(0xffffffff, {0, 16, 1 << 20});
}

TEST(Parents, OfAPaletteLieBetweenItsEntries) {
  std::mt19937 random(9);
  const auto families = make_families<uint16_t>(4095, 273, random);
  ModelOptions options;
  options.max_sample = 4095;
  options.parents = true;
  for (uint32_t value = 0; value <= 4095; value += 273) options.values.push_back(value);
  const Model model = fit(families, options);
  EXPECT_LT(model.data().max_value, 16u);
  round_trip(model, families);
}

/// The last child of each parent is known from the others, or nearly so.
TEST(Parents, SaveBytes) {
  std::mt19937 random(5);
  ModelBuilder builder;
  std::vector<std::vector<uint16_t>> samples, parents;
  std::vector<Parent<uint16_t>> places;
  for (int i = 0; i < 8; ++i) {
    const auto page = test::make_page(0, Extent{}, 4095, random);
    samples.push_back(as<uint16_t>(page));
    parents.push_back(as<uint16_t>(test::make_parents(page, Extent{}, {8, 8, 8}, 0, 0, 0, 4095, random)));
    places.push_back({parents.back(), {8, 8, 8}, 0, 0, 0});
    builder.add(std::span<const uint16_t>(samples.back()), Extent{}, places.back());
  }
  std::vector<std::byte> alone, beside;
  const Result<Model> plain =
      builder.build({.max_error = 0, .max_sample = 4095, .values = {}, .parents = false});
  const Result<Model> with =
      builder.build({.max_error = 0, .max_sample = 4095, .values = {}, .parents = true});
  ASSERT_TRUE(plain && with);
  for (size_t i = 0; i < samples.size(); ++i) {
    ASSERT_TRUE(encode_page(*plain, std::span<const uint16_t>(samples[i]), Extent{}, alone));
    ASSERT_TRUE(encode_page(*with, std::span<const uint16_t>(samples[i]), Extent{}, beside, places[i]));
  }
  EXPECT_LT(beside.size(), alone.size() * 92 / 100);
}

TEST(Parents, ThatAreNotThoseOfAllVoxelsAreRefused) {
  const Result<Model> model =
      ModelBuilder().build({.max_error = 0, .max_sample = 255, .values = {}, .parents = true});
  ASSERT_TRUE(model);
  const std::vector<uint8_t> samples(27, 3), parents(8, 3);
  const Extent e{3, 3, 3};
  std::vector<std::byte> bytes;
  std::vector<uint8_t> out(27);
  const auto tried = [&](const Parent<uint8_t>& parent) {
    const bool encoded = encode_page(*model, std::span<const uint8_t>(samples), e, bytes, parent).has_value();
    EXPECT_EQ(decode_page(*model, bytes, e, std::span<uint8_t>(out), parent).has_value(), encoded);
    ModelBuilder builder;
    builder.add(std::span<const uint8_t>(samples), e, parent);
    EXPECT_EQ(builder.build({.max_error = 0, .max_sample = 255, .values = {}, .parents = true}).has_value(),
              encoded);
    return encoded;
  };
  EXPECT_TRUE(tried({parents, {2, 2, 2}, 0, 0, 0}));
  EXPECT_FALSE(tried({}));
  EXPECT_FALSE(tried({parents, {2, 2, 1}, 0, 0, 0}));
  EXPECT_FALSE(tried({parents, {2, 2, 2}, 1, 0, 0}));
  EXPECT_FALSE(tried({parents, {2, 2, 2}, 0, -1, 0}));
  EXPECT_FALSE(tried({parents, {8, 1, 1}, 0, 0, 0}));
}

TEST(Parents, AnyBytesDecodeToSamplesOfTheModel) {
  std::mt19937 random(6);
  for (const uint32_t greatest : {255u, 65535u, 0xffffffffu}) {
    const auto families = make_families<uint32_t>(greatest, 1, random);
    const Model model =
        fit(families, {.max_error = 0, .max_sample = greatest, .values = {}, .parents = true});
    const auto model_bytes = model.serialise();
    for (size_t length = 0; length < model_bytes.size(); length += 1 + random() % 16)
      EXPECT_FALSE(Model::parse(std::span(model_bytes).first(length)));
    for (int round = 0; round < 300; ++round) {
      auto changed = model_bytes;
      if (round % 2 == 0)
        changed[1 + random() % (changed.size() - 1)] ^= static_cast<std::byte>(1 << random() % 8);
      const Result<Model> parsed = Model::parse(changed);
      if (!parsed) continue;
      const Family<uint32_t>& f = families[random() % families.size()];
      std::vector<std::byte> noise(random() % 200);
      for (std::byte& byte : noise) byte = static_cast<std::byte>(random());
      std::vector<uint32_t> any = f.parents, out(f.samples.size());
      for (uint32_t& sample : any) sample = static_cast<uint32_t>(random());
      Parent<uint32_t> parent = f.parent;
      parent.samples = any;
      if (decode_page(*parsed, noise, f.extent, std::span<uint32_t>(out), parent)) {
        for (const uint32_t sample : out) EXPECT_LE(sample, parsed->max_sample());
      }
    }
  }
}

}  // namespace
}  // namespace voxkit::page
