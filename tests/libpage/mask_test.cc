// Masks come back, as the decoder by the book has them, and so do the samples of what is solid.
#include "libpage/mask.h"

#include <gtest/gtest.h>

#include "libpage/page.h"
#include "tests/libpage/pages.h"
#include "tests/libpage/reference.h"
#include "tests/libpage/reference_mask.h"

namespace voxkit::page {
namespace {

using test::extents;

constexpr int mask_kinds = 7;

Mask make_mask(int kind, Extent e, std::mt19937& random) {
  Mask mask;
  for (int z = 0; z < e.nz; ++z)
    for (int y = 0; y < e.ny; ++y)
      for (int x = 0; x < e.nx; ++x) {
        const bool solid = kind == 0   ? random() % 2 != 0
                           : kind == 1 ? random() % 20 == 0
                           : kind == 2 ? (x / 3 % 3 != 1) + (y / 3 % 3 != 1) + (z / 3 % 3 != 1) > 1
                           : kind == 3 ? x + y < z + 5
                           : kind == 4 ? true
                           : kind == 5 ? false
                                       : x == e.nx - 1 && y == e.ny - 1 && z == e.nz - 1;
        if (solid) mask.set(x, y, z);
      }
  return mask;
}

/// A mask, and that of its parents, in a page of more of these, which are any.
struct Family {
  Extent extent;
  Mask mask;
  Mask parents;
  MaskParent parent;
};
std::vector<std::unique_ptr<Family>> make_families(std::mt19937& random) {
  std::vector<std::unique_ptr<Family>> out;
  for (const Extent e : extents)
    for (int kind = 0; kind < mask_kinds; ++kind) {
      const auto corner = [&] { return random() % 2 != 0 ? 8 : 0; };
      const auto side = [&](int n, int at) {
        return std::min(16, at + (n + 1) / 2 + (random() % 2 != 0 ? 3 : 0));
      };
      auto family = std::make_unique<Family>();
      family->extent = e;
      family->mask = make_mask(kind, e, random);
      MaskParent& parent = family->parent;
      parent = {&family->parents, {}, corner(), corner(), corner()};
      parent.extent = {side(e.nx, parent.x), side(e.ny, parent.y), side(e.nz, parent.z)};
      family->parents = make_mask(kind == 0 ? 1 : 0, parent.extent, random);
      for (int z = 0; z < e.nz; ++z)
        for (int y = 0; y < e.ny; ++y)
          for (int x = 0; x < e.nx; ++x)
            if (family->mask.solid(x, y, z))
              family->parents.set(parent.x + x / 2, parent.y + y / 2, parent.z + z / 2);
      out.push_back(std::move(family));
    }
  return out;
}

/// Rows of solid voxels, x fastest.
std::vector<bool> plain(const Mask& mask, Extent e) {
  std::vector<bool> out;
  for (int z = 0; z < e.nz; ++z)
    for (int y = 0; y < e.ny; ++y)
      for (int x = 0; x < e.nx; ++x) out.push_back(mask.solid(x, y, z));
  return out;
}

MaskModel fit(const std::vector<std::unique_ptr<Family>>& families, bool parents, size_t some) {
  MaskModel::Builder builder(parents);
  for (size_t i = 0; i < families.size(); i += some)
    builder.add(families[i]->mask, families[i]->extent, families[i]->parent);
  const MaskModel model = builder.build();
  const auto parsed = MaskModel::parse(model.serialise());
  EXPECT_TRUE(parsed);
  EXPECT_EQ(parsed->serialise(), model.serialise());
  EXPECT_EQ(parsed->has_parents(), parents);
  return *parsed;
}

TEST(Mask, ComesBackAsByTheBook) {
  std::mt19937 random(1);
  const auto families = make_families(random);
  for (const bool parents : {false, true})
    for (const size_t some : {size_t{1}, size_t{9}, families.size()}) {
      const MaskModel model = fit(families, parents, some);
      const test::ReferenceMasks reference(model.serialise());
      for (const auto& f : families) {
        std::vector<std::byte> bytes;
        model.encode(f->mask, f->extent, bytes, f->parent);
        EXPECT_EQ(bytes.empty(), f->mask.empty());
        const auto decoded = model.decode(bytes, f->extent, f->parent);
        ASSERT_TRUE(decoded) << decoded.error().what;
        EXPECT_EQ(*decoded, f->mask);
        const auto book = reference.decode(bytes, f->extent, plain(f->parents, f->parent.extent),
                                           f->parent.extent, f->parent.x, f->parent.y, f->parent.z);
        EXPECT_EQ(book, plain(f->mask, f->extent));
      }
    }
}

TEST(Mask, WhatIsKnownCostsNothing) {
  const Extent e;
  const MaskModel model = MaskModel::Builder(false).build();
  std::vector<std::byte> bytes;
  model.encode(full_mask(e), e, bytes);
  EXPECT_EQ(bytes.size(), 1u);
  EXPECT_EQ(full_mask(e).count(), 4096);
  EXPECT_EQ(full_mask({3, 2, 1}).count(), 6);

  // Of a plane that goes on, next to nothing is left to say.
  std::mt19937 random(2);
  const Mask slope = make_mask(3, e, random);
  MaskModel::Builder builder(false);
  builder.add(slope, e);
  bytes.clear();
  builder.build().encode(slope, e, bytes);
  EXPECT_LT(bytes.size(), 64u);
}

TEST(Mask, DamagedBytesAreRefusedOrRead) {
  std::mt19937 random(3);
  const auto families = make_families(random);
  for (const bool parents : {false, true}) {
    const std::vector<std::byte> good = fit(families, parents, 1).serialise();
    for (int i = 0; i < 3000; ++i) {
      std::vector<std::byte> bad = good;
      if (i % 3 == 0) bad.resize(random() % (bad.size() + 1));
      if (!bad.empty()) bad[random() % bad.size()] ^= static_cast<std::byte>(1 + random() % 255);
      const auto model = MaskModel::parse(bad);
      if (!model) {
        EXPECT_EQ(model.error().code, ErrorCode::input);
        continue;
      }
      const Family& f = *families[random() % families.size()];
      std::vector<std::byte> page(random() % 200);
      for (std::byte& byte : page) byte = static_cast<std::byte>(random());
      if (i % 2 == 0) {
        page.clear();
        if (model->has_parents() == parents) model->encode(f.mask, f.extent, page, f.parent);
        if (!page.empty()) page[random() % page.size()] ^= std::byte{4};
      }
      const auto mask = model->decode(page, f.extent, f.parent);
      if (!mask) {
        EXPECT_EQ(mask.error().code, ErrorCode::input);
        continue;
      }
      const Mask all = full_mask(f.extent);
      for (size_t row = 0; row < all.rows.size(); ++row)
        ASSERT_EQ(mask->rows[row] & ~all.rows[row], 0) << "a solid voxel outside";
    }
  }
  const MaskModel with_parents = fit(families, true, 1);
  EXPECT_EQ(with_parents.decode({}, Extent{}, {}).error().code, ErrorCode::usage);
}

/// Samples of solid voxels are within the bound; void ones are as the decoder by the book has them.
TEST(Mask, SamplesOfSolidVoxelsComeBack) {
  std::mt19937 random(4);
  const auto families = make_families(random);
  for (const bool parents : {false, true})
    for (const uint32_t max_error : {0u, 3u})
      for (const uint32_t greatest : {255u, 510u, 65535u}) {
        ModelBuilder builder;
        std::vector<std::vector<uint16_t>> samples, parent_samples;
        std::vector<Parent<uint16_t>> places;
        for (size_t i = 0; i < families.size(); ++i) {
          const Family& f = *families[i];
          const auto kind = static_cast<int>(random() % test::page_kinds);
          const auto made = test::make_page(kind, f.extent, greatest, random),
                     above = test::make_parents(made, f.extent, f.parent.extent, f.parent.x, f.parent.y,
                                                f.parent.z, greatest, random);
          samples.emplace_back(made.begin(), made.end());
          parent_samples.emplace_back(above.begin(), above.end());
          places.push_back({{}, f.parent.extent, f.parent.x, f.parent.y, f.parent.z});
        }
        for (size_t i = 0; i < families.size(); ++i) {
          if (parents) places[i].samples = parent_samples[i];
          builder.add(std::span<const uint16_t>(samples[i]), families[i]->extent, places[i],
                      &families[i]->mask);
        }
        const auto model =
            builder.build({.max_error = max_error, .max_sample = greatest, .values = {}, .parents = parents});
        ASSERT_TRUE(model) << model.error().what;
        test::ReferenceDecoder reference(model->serialise());
        for (size_t i = 0; i < families.size(); ++i) {
          const Family& f = *families[i];
          std::vector<std::byte> bytes;
          std::vector<uint16_t> kept(samples[i].size()), out(samples[i].size());
          ASSERT_TRUE(encode_page(*model, std::span<const uint16_t>(samples[i]), f.extent, bytes, places[i],
                                  std::span<uint16_t>(kept), &f.mask));
          const Status status =
              decode_page(*model, bytes, f.extent, std::span<uint16_t>(out), places[i], &f.mask);
          ASSERT_TRUE(status) << status.error().what;
          EXPECT_EQ(out, kept);
          const std::vector<bool> solid = plain(f.mask, f.extent);
          for (size_t v = 0; v < solid.size(); ++v)
            ASSERT_TRUE(!solid[v] || std::abs(out[v] - samples[i][v]) <= static_cast<int>(max_error));
          test::ReferenceParent above{{parent_samples[i].begin(), parent_samples[i].end()},
                                      places[i].extent,
                                      places[i].x,
                                      places[i].y,
                                      places[i].z};
          const auto book =
              reference.decode(bytes, f.extent, parents ? above : test::ReferenceParent{}, solid);
          EXPECT_EQ(std::vector<uint16_t>(book.begin(), book.end()), out);
        }
      }
}

TEST(Mask, OfWideSamplesIsRefused) {
  const std::vector<uint32_t> samples(8, 70000);
  Mask mask;
  mask.set(1, 0, 0);
  const auto model = ModelBuilder().build({});
  std::vector<std::byte> bytes;
  const Extent e{2, 2, 2};
  EXPECT_EQ(encode_page(*model, std::span<const uint32_t>(samples), e, bytes, {}, {}, &mask).error().code,
            ErrorCode::usage);
  std::vector<uint32_t> out(8);
  EXPECT_EQ(decode_page(*model, bytes, e, std::span<uint32_t>(out), {}, &mask).error().code,
            ErrorCode::usage);
}

}  // namespace
}  // namespace voxkit::page
