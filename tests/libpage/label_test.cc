// Labels come back, beside parents or alone; they are smaller so than as numbers; damage is an error, or
// labels.
#include "libpage/label.h"

#include <gtest/gtest.h>

#include "libpage/page.h"
#include "tests/libpage/pages.h"

namespace voxkit::page {
namespace {

using test::extents;

/// Names up to `greatest`, in patches, or of any other kind of page.
std::vector<uint32_t> make_labels(int kind, Extent e, uint32_t greatest, std::mt19937& random) {
  if (kind > 0) return test::make_page(kind - 1, e, greatest, random);
  struct Cell {
    int x, y, z;
    uint32_t name;
  };
  std::vector<Cell> cells;
  for (int i = 0; i < 5; ++i) {
    const auto any = [&] { return static_cast<int>(random() % 16); };
    cells.push_back({any(), any(), any(), static_cast<uint32_t>(random() % (uint64_t{greatest} + 1))});
  }
  std::vector<uint32_t> labels;
  for (int z = 0; z < e.nz; ++z)
    for (int y = 0; y < e.ny; ++y)
      for (int x = 0; x < e.nx; ++x)
        labels.push_back(std::ranges::min_element(cells, {}, [&](const Cell& c) {
                           return (c.x - x) * (c.x - x) + (c.y - y) * (c.y - y) + (c.z - z) * (c.z - z);
                         })->name);
  return labels;
}

struct Case {
  Extent extent;
  std::vector<uint32_t> labels, parents;
  Parent<uint32_t> parent;
};
/// The first `patches` are of whole pages, in which labels are smaller as such.
constexpr int patches = 12;
std::vector<Case> make_cases(uint32_t greatest, std::mt19937& random) {
  std::vector<Case> cases;
  std::vector<std::pair<Extent, int>> kinds(patches, {Extent{}, 0});
  for (const Extent e : extents)
    for (int kind = 0; kind <= test::page_kinds; ++kind) kinds.emplace_back(e, kind);
  for (const auto& [e, kind] : kinds) {
    Case c{e, make_labels(kind, e, greatest, random), {}, {}};
    const auto corner = [&] { return random() % 2 != 0 ? 8 : 0; };
    c.parent.x = corner(), c.parent.y = corner(), c.parent.z = corner();
    const auto side = [&](int n, int at) {
      return std::min(16, at + (n + 1) / 2 + (random() % 2 != 0 ? 3 : 0));
    };
    c.parent.extent = {side(e.nx, c.parent.x), side(e.ny, c.parent.y), side(e.nz, c.parent.z)};
    for (int z = 0; z < c.parent.extent.nz; ++z)
      for (int y = 0; y < c.parent.extent.ny; ++y)
        for (int x = 0; x < c.parent.extent.nx; ++x) {
          const int cx = 2 * (x - c.parent.x), cy = 2 * (y - c.parent.y), cz = 2 * (z - c.parent.z);
          const bool child = cx >= 0 && cy >= 0 && cz >= 0 && cx < e.nx && cy < e.ny && cz < e.nz;
          c.parents.push_back(child ? c.labels[static_cast<size_t>((cz * e.ny + cy) * e.nx + cx)]
                                    : static_cast<uint32_t>(random() % (uint64_t{greatest} + 1)));
        }
    cases.push_back(std::move(c));
  }
  for (Case& c : cases) c.parent.samples = c.parents;
  return cases;
}

Model fit(const std::vector<Case>& cases, uint32_t greatest, bool parents, bool labels) {
  ModelBuilder builder;
  for (const Case& c : cases)
    builder.add(std::span<const uint32_t>(c.labels), c.extent, parents ? c.parent : Parent<uint32_t>());
  ModelOptions options;
  options.max_sample = greatest;
  options.parents = parents;
  options.labels = labels;
  const Result<Model> model = builder.build(options);
  EXPECT_TRUE(model) << model.error().what;
  const Result<Model> parsed = Model::parse(model->serialise());
  EXPECT_TRUE(parsed) << parsed.error().what;
  EXPECT_EQ(parsed->serialise(), model->serialise());
  return *parsed;
}

template <class T>
std::vector<T> as(const std::vector<uint32_t>& values) {
  std::vector<T> out;
  for (const uint32_t v : values) out.push_back(static_cast<T>(v));
  return out;
}

template <class T>
size_t round_trip(const Model& model, const std::vector<Case>& cases) {
  size_t bytes = 0;
  for (const Case& c : cases) {
    const std::vector<T> labels = as<T>(c.labels), parents = as<T>(c.parents);
    const Parent<T> parent{parents, c.parent.extent, c.parent.x, c.parent.y, c.parent.z};
    std::vector<std::byte> page;
    std::vector<T> told(labels.size()), out(labels.size());
    const Status encoded = encode_page(model, std::span<const T>(labels), c.extent, page,
                                       model.has_parents() ? parent : Parent<T>(), std::span<T>(told));
    EXPECT_TRUE(encoded) << encoded.error().what;
    EXPECT_EQ(told, labels);
    const Status decoded =
        decode_page(model, page, c.extent, std::span<T>(out), model.has_parents() ? parent : Parent<T>());
    EXPECT_TRUE(decoded) << decoded.error().what;
    EXPECT_EQ(out, labels);
    bytes += page.size();
  }
  return bytes;
}

TEST(Labels, ComeBack) {
  for (const uint32_t greatest : {3u, 9u, 255u, 256u, 999u, 65535u})
    for (const bool parents : {false, true}) {
      std::mt19937 random(greatest);
      const auto cases = make_cases(greatest, random);
      const Model model = fit({cases.begin(), cases.begin() + patches}, greatest, parents, true);
      ASSERT_TRUE(model.has_labels()) << greatest;
      EXPECT_EQ(model.max_sample(), greatest);
      const size_t bytes = round_trip<uint32_t>(model, cases);
      EXPECT_EQ(round_trip<uint16_t>(model, cases), bytes);
      if (greatest < 256) {
        EXPECT_EQ(round_trip<uint8_t>(model, cases), bytes);
      }
    }
}

TEST(Labels, AreSmallerThanNumbers) {
  std::mt19937 random(7);
  std::vector<Case> cases;
  for (int i = 0; i < 20; ++i) cases.push_back({{16, 16, 16}, make_labels(0, {}, 999, random), {}, {}});
  const size_t labels = round_trip<uint16_t>(fit(cases, 999, false, true), cases),
               numbers = round_trip<uint16_t>(fit(cases, 999, false, false), cases);
  EXPECT_LT(5 * labels, numbers);
}

TEST(Labels, AsNumbersWhereTheseAreSmaller) {
  std::vector<Case> cases;
  for (int i = 0; i < 20; ++i) {
    Case c{{16, 16, 16}, {}, {}, {}};
    for (uint32_t v = 0; v < 4096; ++v)
      c.labels.push_back(2000 + 30 * (v % 16) + 7 * (v / 16 % 16) + 11 * (v / 256));
    cases.push_back(std::move(c));
  }
  EXPECT_FALSE(fit(cases, 65535, false, true).has_labels());
}

/// Any bytes, as a model and as a page.
TEST(Labels, DamageIsAnErrorOrLabels) {
  std::mt19937 random(11);
  for (const bool parents : {false, true}) {
    const auto cases = make_cases(999, random);
    const Model whole = fit(cases, 999, parents, true);
    const std::vector<std::byte> model_bytes = whole.serialise();
    int refused = 0, taken = 0;
    for (int n = 0; n < 3000; ++n) {
      const Case& c = cases[random() % cases.size()];
      std::vector<std::byte> bytes = model_bytes, page;
      ASSERT_TRUE(encode_page(whole, std::span<const uint32_t>(c.labels), c.extent, page,
                              parents ? c.parent : Parent<uint32_t>()));
      auto& damaged = n % 2 == 0 ? bytes : page;
      for (int k = 0; k < 3 && !damaged.empty(); ++k)
        damaged[random() % damaged.size()] = static_cast<std::byte>(random() & 0xff);
      if (random() % 4 == 0) damaged.resize(damaged.empty() ? 0 : random() % damaged.size());
      const Result<Model> model = Model::parse(std::vector<std::byte>(bytes));
      if (!model) {
        EXPECT_EQ(model.error().code, ErrorCode::input);
        ++refused;
        continue;
      }
      const std::vector<std::byte> exactly(page.begin(), page.end());
      std::vector<uint32_t> out(c.labels.size());
      const Status status = decode_page(*model, exactly, c.extent, std::span<uint32_t>(out),
                                        model->has_parents() ? c.parent : Parent<uint32_t>());
      if (!status) {
        EXPECT_EQ(status.error().code, ErrorCode::input);
        ++refused;
        continue;
      }
      ++taken;
      for (const uint32_t v : out) ASSERT_LE(v, model->max_sample());
    }
    EXPECT_GT(refused, 500);
    EXPECT_GT(taken, 50);
  }
}

TEST(Labels, HaveNoMasks) {
  std::mt19937 random(3);
  const auto cases = make_cases(9, random);
  const Model model = fit(cases, 9, false, true);
  Mask mask = full_mask({16, 16, 16});
  mask.row(3, 3) = 5;
  std::vector<std::byte> page;
  std::vector<uint32_t> labels(4096, 1), out(4096);
  labels[5] = 2;
  EXPECT_EQ(encode_page(model, std::span<const uint32_t>(labels), {}, page, {}, {}, &mask).error().code,
            ErrorCode::usage);
  EXPECT_EQ(decode_page(model, page, {}, std::span<uint32_t>(out), {}, &mask).error().code, ErrorCode::usage);
}

}  // namespace
}  // namespace voxkit::page
