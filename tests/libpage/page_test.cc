// What is encoded comes back within the bound, and as the decoder by the book has it.
#include "libpage/page.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/libpage/pages.h"
#include "tests/libpage/reference.h"

namespace voxkit::page {
namespace {

using test::extents;
using test::make_page;

template <class T>
std::vector<T> as(const std::vector<uint32_t>& samples) {
  std::vector<T> out;
  for (const uint32_t sample : samples) out.push_back(static_cast<T>(sample));
  return out;
}

template <class T>
Model fit(const std::vector<std::vector<uint32_t>>& pages, const std::vector<Extent>& sizes,
          const ModelOptions& options) {
  ModelBuilder builder;
  for (size_t i = 0; i < pages.size(); ++i) builder.add(std::span<const T>(as<T>(pages[i])), sizes[i]);
  const Result<Model> model = builder.build(options);
  EXPECT_TRUE(model) << model.error().what;
  const Result<Model> parsed = Model::parse(model->serialise());
  EXPECT_TRUE(parsed) << parsed.error().what;
  EXPECT_EQ(parsed->serialise(), model->serialise());
  return *parsed;
}

/// Encodes and decodes, one by one and all together, and holds them against the decoder by the book.
template <class T>
void round_trip(const Model& model, const std::vector<std::vector<uint32_t>>& pages,
                const std::vector<Extent>& sizes) {
  test::ReferenceDecoder reference(model.serialise());
  std::vector<std::vector<std::byte>> coded(pages.size());
  std::vector<std::vector<T>> decoded;
  for (size_t i = 0; i < pages.size(); ++i) {
    const std::vector<T> samples = as<T>(pages[i]);
    const Status encoded = encode_page(model, std::span<const T>(samples), sizes[i], coded[i]);
    ASSERT_TRUE(encoded) << encoded.error().what;
    std::vector<T> out(samples.size());
    const Status status = decode_page(model, coded[i], sizes[i], std::span<T>(out));
    ASSERT_TRUE(status) << status.error().what;
    for (size_t v = 0; v < samples.size(); ++v)
      ASSERT_LE(std::abs(int64_t{samples[v]} - int64_t{out[v]}), int64_t{model.max_error()})
          << "page " << i << ", voxel " << v;
    ASSERT_EQ(as<T>(reference.decode(coded[i], sizes[i])), out) << "page " << i;
    ASSERT_TRUE(reference.finished());
    decoded.push_back(std::move(out));
  }
  std::vector<std::vector<T>> again;
  std::vector<PageJob<T>> jobs;
  for (const auto& page : pages) again.emplace_back(page.size());
  for (size_t i = 0; i < pages.size(); ++i) jobs.push_back({coded[i], sizes[i], again[i]});
  size_t failed = 0;
  ASSERT_TRUE(decode_pages(model, std::span<const PageJob<T>>(jobs), &failed));
  EXPECT_EQ(failed, jobs.size());
  EXPECT_EQ(again, decoded);
}

template <class T>
void try_all(uint32_t greatest, std::initializer_list<uint32_t> errors) {
  std::mt19937 random(greatest);
  for (const uint32_t max_error : errors) {
    SCOPED_TRACE(max_error);
    std::vector<std::vector<uint32_t>> pages;
    std::vector<Extent> sizes;
    for (const Extent e : extents)
      for (int kind = 0; kind < test::page_kinds; ++kind) {
        pages.push_back(make_page(kind, e, greatest, random));
        sizes.push_back(e);
      }
    ModelOptions options;
    options.max_error = max_error;
    options.max_sample = greatest;
    round_trip<T>(fit<T>(pages, sizes, options), pages, sizes);
    // A model that was made for other pages, or for none, makes them larger at most.
    const std::vector<std::vector<uint32_t>> few(pages.begin(), pages.begin() + 2);
    round_trip<T>(fit<T>(few, sizes, options), pages, sizes);
    const Result<Model> blank = ModelBuilder().build(options);
    ASSERT_TRUE(blank);
    round_trip<T>(*blank, pages, sizes);
  }
}

TEST(Page, OfEightBits) {
  try_all<uint8_t>(255, {0, 1, 4, 16, 127, 255, 1000});
}
TEST(Page, OfFewBits) {
  try_all<uint8_t>(1, {0, 1});
  try_all<uint8_t>(5, {0, 1, 2});
}
TEST(Page, OfSixteenBits) {
  try_all<uint16_t>(65535, {0, 1, 4, 16, 64, 30000, 65535});
}
TEST(Page, OfTwelveBits) {
  try_all<uint16_t>(4095, {0, 1, 5, 64});
}
TEST(Page, OfThirtyTwoBits) {
  try_all<uint32_t>(0xffffffff, {0, 1, 16, 1 << 20, 0x7ffffffe});
}
TEST(Page, OfSeventeenBits) {
  try_all<uint32_t>(0x1ffff, {0, 1, 4, 1000});
}

TEST(Page, OfFewValuesHasAPalette) {
  std::mt19937 random(3);
  const std::vector<uint32_t> values = {7, 1000, 1001, 40000, 65535};
  std::vector<std::vector<uint32_t>> pages;
  std::vector<Extent> sizes;
  for (const Extent e : extents) {
    pages.emplace_back();
    sizes.push_back(e);
    for (int i = 0; i < e.voxels(); ++i) pages.back().push_back(values[random() % values.size()]);
  }
  ModelOptions options;
  const Model plain = fit<uint16_t>(pages, sizes, options);
  options.values = values;
  const Model numbered = fit<uint16_t>(pages, sizes, options);
  round_trip<uint16_t>(numbered, pages, sizes);
  round_trip<uint32_t>(numbered, pages, sizes);
  std::vector<std::byte> with_plain, with_palette;
  const std::vector<uint16_t> samples = as<uint16_t>(pages[0]);
  ASSERT_TRUE(encode_page(plain, std::span<const uint16_t>(samples), sizes[0], with_plain));
  ASSERT_TRUE(encode_page(numbered, std::span<const uint16_t>(samples), sizes[0], with_palette));
  EXPECT_LT(with_palette.size(), with_plain.size() / 2);
  EXPECT_EQ(numbered.max_sample(), 65535u);

  const uint16_t other[] = {8};
  std::vector<std::byte> out;
  EXPECT_FALSE(encode_page(numbered, std::span<const uint16_t>(other), Extent{1, 1, 1}, out));
}

TEST(Page, APaletteMayHaveNumbersOfMoreThan16Bits) {
  ModelOptions options;
  for (uint32_t i = 0; i < 70000; ++i) options.values.push_back(i * 61000u + i % 7);
  std::vector<std::vector<uint32_t>> pages(96);
  const std::vector<Extent> sizes(pages.size(), Extent{});
  uint32_t number = 0;
  for (auto& page : pages)
    for (int i = 0; i < max_voxels; ++i) page.push_back(options.values[number = (number + i % 5) % 70000]);
  ModelOptions plain = options;
  plain.values.clear();
  const Model numbered = fit<uint32_t>(pages, sizes, options);
  EXPECT_LT(numbered.serialise().size(), size_t{1} << 19);
  EXPECT_GT(numbered.serialise().size(), 2 * fit<uint32_t>(pages, sizes, plain).serialise().size());
  round_trip<uint32_t>(numbered, pages, sizes);
  options.values.resize((size_t{1} << 18) + 1);
  for (uint32_t i = 0; i < options.values.size(); ++i) options.values[i] = i;
  EXPECT_EQ(ModelBuilder().build(options).error().code, ErrorCode::usage);
}

TEST(Page, ConstantWithinTheBoundCostsNextToNothing) {
  ModelBuilder builder;
  const std::vector<uint16_t> empty(4096, 100), full(4096, 3000);
  builder.add(std::span<const uint16_t>(empty), Extent{});
  builder.add(std::span<const uint16_t>(empty), Extent{});
  builder.add(std::span<const uint16_t>(full), Extent{});
  const Result<Model> model = builder.build({.max_error = 3, .max_sample = 4095, .values = {}});
  ASSERT_TRUE(model);
  EXPECT_EQ(model->background(), 100u);
  std::vector<uint16_t> noisy = empty;
  for (size_t i = 0; i < noisy.size(); ++i) noisy[i] = static_cast<uint16_t>(97 + i % 7);
  std::vector<std::byte> out;
  ASSERT_TRUE(encode_page(*model, std::span<const uint16_t>(noisy), Extent{}, out));
  EXPECT_EQ(out.size(), 0u);
  for (size_t i = 0; i < noisy.size(); ++i) noisy[i] = static_cast<uint16_t>(500 + i % 7);
  ASSERT_TRUE(encode_page(*model, std::span<const uint16_t>(noisy), Extent{}, out));
  EXPECT_EQ(out.size(), 2u);
}

TEST(Page, WhatDoesNotFitIsAnError) {
  ModelBuilder builder;
  const std::vector<uint16_t> samples(8, 9);
  builder.add(std::span<const uint16_t>(samples), Extent{2, 2, 2});
  EXPECT_FALSE(builder.build({.max_error = 0x7fffffff, .max_sample = 9, .values = {}}));
  EXPECT_FALSE(builder.build({.max_error = 0, .max_sample = 8, .values = {}}));
  EXPECT_FALSE(builder.build({.max_error = 0, .max_sample = 9, .values = {3, 3, 9}}));
  EXPECT_FALSE(builder.build({.max_error = 0, .max_sample = 9, .values = {3, 4}}));
  const Result<Model> model = builder.build({.max_error = 0, .max_sample = 300, .values = {}});
  ASSERT_TRUE(model);
  std::vector<std::byte> out;
  EXPECT_FALSE(encode_page(*model, std::span<const uint16_t>(samples), Extent{2, 2, 1}, out));
  EXPECT_FALSE(encode_page(*model, std::span<const uint16_t>(samples), Extent{17, 1, 1}, out));
  const std::vector<uint16_t> large(8, 301);
  EXPECT_FALSE(encode_page(*model, std::span<const uint16_t>(large), Extent{2, 2, 2}, out));
  EXPECT_TRUE(out.empty());
  std::vector<uint8_t> narrow(8);
  EXPECT_FALSE(decode_page(*model, out, Extent{2, 2, 2}, std::span<uint8_t>(narrow)));
  std::vector<uint16_t> short_of(7);
  EXPECT_FALSE(decode_page(*model, out, Extent{2, 2, 2}, std::span<uint16_t>(short_of)));
}

/// Bytes are the same on every machine and with every compiler.
TEST(Page, BytesStayWhatTheyAre) {
  std::mt19937 random(1);
  uint64_t sum = 14695981039346656037u;
  for (const uint32_t max_error : {0u, 2u})
    for (const uint32_t greatest : {255u, 4095u, 0xffffffffu}) {
      ModelBuilder builder;
      std::vector<std::vector<uint32_t>> pages;
      for (int kind = 0; kind < test::page_kinds; ++kind) {
        pages.push_back(make_page(kind, Extent{}, greatest, random));
        builder.add(std::span<const uint32_t>(pages.back()), Extent{});
      }
      const Result<Model> model =
          builder.build({.max_error = max_error, .max_sample = greatest, .values = {}});
      ASSERT_TRUE(model);
      std::vector<std::byte> bytes = model->serialise();
      for (const auto& page : pages)
        ASSERT_TRUE(encode_page(*model, std::span<const uint32_t>(page), Extent{}, bytes));
      for (const std::byte byte : bytes) sum = (sum ^ std::to_integer<uint64_t>(byte)) * 1099511628211u;
    }
  EXPECT_EQ(sum, 9033261626472832872u)
      << "if the format is meant to change, this is the sum of its bytes now";
}

}  // namespace
}  // namespace voxkit::page
