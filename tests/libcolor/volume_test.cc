// Whole files: what comes back is what went in, for all ways of storing it, and damaged files are refused.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "libcolor/color.h"
#include "libcolor/store.h"
#include "libcolor/surface/volume_surface.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

struct Fixture {
  MemoryBudget memory;
  Context ctx;
  explicit Fixture(int threads = 2) {
    ctx.memory = &memory;
    ctx.threads = threads;
  }
};

struct Encoded {
  std::vector<std::byte> bytes;
  Report report;
};
Encoded encoded(SurfaceSource& source, const Options& options, int threads = 2) {
  Fixture f(threads);
  Encoded out;
  auto report = encode(
      source, options,
      [&](std::span<const std::byte> bytes) -> Status {
        out.bytes.insert(out.bytes.end(), bytes.begin(), bytes.end());
        return {};
      },
      f.ctx);
  EXPECT_TRUE(report) << report.error().what;
  if (report) out.report = *report;
  return out;
}
Result<std::shared_ptr<const Volume>> opened(const std::vector<std::byte>& bytes) {
  auto kept = std::make_shared<const std::vector<std::byte>>(bytes);
  VOX_TRY(auto container, Container::open(*kept, "file", kept));
  return Volume::open(container);
}
double distance(Rgb a, Rgb b) {
  const double r = a.r - b.r, g = a.g - b.g, c = a.b - b.b;
  return std::sqrt(r * r + g * g + c * c);
}

std::vector<std::pair<Voxels, Index3>> scenes() {
  return {{{}, Index3(7, 3, 30)},
          {{{0, {1, 2, 3}}}, Index3(1)},
          {voxels_where(2, [](uint32_t x, uint32_t y, uint32_t z) { return x != y || z == 0; }), Index3(4)},
          {sphere_shell(6), Index3(64)},
          {voxels_where(5, [](uint32_t x, uint32_t y,
                              uint32_t z) { return x < 17 && y < 30 && z < 9 && (x ^ y ^ z) % 3; }),
           Index3(17, 30, 9)},
          {scattered(21, 20000, 7), Index3(1 << 20, 1 << 20, 1 << 20)}};
}
/// Those of a scene that are inside its extents.
Voxels inside(const Voxels& voxels, Index3 dims) {
  Voxels kept;
  for (const SurfaceVoxel& v : voxels)
    if (const Index3 at(morton_place(v.place)); at.x < dims.x && at.y < dims.y && at.z < dims.z)
      kept.push_back(v);
  return kept;
}

TEST(ColorVolume, EveryVoxelComesBack) {
  for (const auto& [all, dims] : scenes())
    for (const ColorCodec codec : codecs())
      for (const auto& [counts, colors] : {std::pair(Counts::node, Colors::leaf),
                                           {Counts::pointer, Colors::leaf},
                                           {Counts::node, Colors::all},
                                           {Counts::pointer, Colors::all}}) {
        const Voxels voxels = inside(all, dims);
        SCOPED_TRACE(testing::Message() << voxels.size() << " voxels, codec " << static_cast<int>(codec));
        Options options;
        options.codec = codec;
        options.counts = counts;
        options.colors = colors;
        if (counts == Counts::pointer) options.image_curve = ImageCurve::hilbert;
        if ((counts == Counts::pointer) == (codec == ColorCodec::raw || codec == ColorCodec::vws) &&
            codec != ColorCodec::predicted)
          options.curve = Curve::hilbert;
        if (!validate(options)) continue;
        if (counts == Counts::pointer) {
          options.quality = colors == Colors::leaf ? 0 : 60;
        }
        // Each way of storing geometry with each of the counts, and both orders of colours.
        if (static_cast<int>(codec) % 2 == (colors == Colors::all ? 1 : 0))
          options.geometry = Geometry::octree;
        ListSource source(voxels, dims);
        const Encoded file = encoded(source, options);
        const double bound = has_threshold(codec) ? options.threshold : file.report.most_error;
        if (codec == ColorCodec::raw) {
          EXPECT_EQ(bound, 0);
        }
        EXPECT_EQ(file.report.params.leaf_voxels, voxels.size());
        const auto volume = opened(file.bytes);
        ASSERT_TRUE(volume) << volume.error().what;
        Fixture f;
        const Status checked = (*volume)->check(f.ctx);
        EXPECT_TRUE(checked) << checked.error().what;
        EXPECT_EQ((*volume)->info().dims, dims);

        // In order ...
        size_t next = 0;
        double squares = 0, furthest = 0;
        ASSERT_TRUE((*volume)->for_each_voxel(
            [&](std::span<const SurfaceVoxel> run) -> Status {
              for (const SurfaceVoxel& v : run) {
                if (next >= voxels.size() || v.place != voxels[next].place) return bad_usage("another voxel");
                const double d = distance(v.color, voxels[next++].color);
                furthest = std::max(furthest, d);
                squares += d * d;
              }
              return {};
            },
            f.ctx));
        EXPECT_EQ(next, voxels.size());
        EXPECT_LE(furthest, bound);
        EXPECT_LE(furthest, file.report.most_error);
        if (!voxels.empty() && colors == Colors::leaf) {
          EXPECT_DOUBLE_EQ(furthest, file.report.most_error);
          EXPECT_NEAR(std::sqrt(squares / (3 * static_cast<double>(voxels.size()))), file.report.params.grmse,
                      1e-9);
        }
        // ... one by one ...
        for (size_t i = 0; i < voxels.size(); i += 17) {
          const auto voxel = (*volume)->voxel(Index3(morton_place(voxels[i].place)));
          ASSERT_TRUE(voxel && *voxel);
          EXPECT_LE(distance(**voxel, voxels[i].color), bound);
        }
        // ... and box by box.
        std::map<uint64_t, Rgb> known;
        for (const SurfaceVoxel& v : voxels) known[v.place] = v.color;
        const auto plain = open_source(*volume);
        std::mt19937_64 random(8);
        for (int round = 0; round < 20; ++round) {
          Box box;
          for (int a = 0; a < 3; ++a) {
            box.lo[a] = static_cast<int64_t>(random() % static_cast<uint64_t>(dims[a]));
            if (round % 2 == 0 && !voxels.empty())
              box.lo[a] = Index3(morton_place(voxels[random() % voxels.size()].place))[a];
            box.hi[a] = std::min(dims[a], box.lo[a] + 1 + static_cast<int64_t>(random() % 23));
          }
          std::vector<std::byte> memory(static_cast<size_t>(box.voxels()) * 4, std::byte{0x55});
          const VoxelSpan span = packed(memory.data(), box.size(), VoxelFormat::rgba32);
          ASSERT_TRUE(plain->read(box, span));
          bool any = false;
          for (int64_t z = box.lo.z; z < box.hi.z; ++z)
            for (int64_t y = box.lo.y; y < box.hi.y; ++y)
              for (int64_t x = box.lo.x; x < box.hi.x; ++x) {
                const std::byte* const p = span.row(y - box.lo.y, z - box.lo.z) + (x - box.lo.x) * 4;
                const auto found = known.find(morton_code(static_cast<uint32_t>(x), static_cast<uint32_t>(y),
                                                          static_cast<uint32_t>(z)));
                any |= found != known.end();
                ASSERT_EQ(p[3], std::byte{static_cast<unsigned char>(found != known.end() ? 255 : 0)});
                const Rgb c{static_cast<uint8_t>(p[0]), static_cast<uint8_t>(p[1]),
                            static_cast<uint8_t>(p[2])};
                ASSERT_LE(distance(c, found != known.end() ? found->second : Rgb{}), bound);
              }
          EXPECT_EQ(plain->uniform(box).has_value(), !any);
          // Those of the box alone, in order, each with the color that it has there.
          auto expected = known.begin();
          const auto to_inside = [&] {
            while (expected != known.end() && !box.contains(Index3(morton_place(expected->first))))
              ++expected;
          };
          ASSERT_TRUE((*volume)->for_each_voxel(box, [&](std::span<const SurfaceVoxel> run) -> Status {
            for (const SurfaceVoxel& v : run) {
              to_inside();
              if (expected == known.end() || v.place != expected->first) return bad_usage("another voxel");
              const Index3 to = Index3(morton_place(v.place)) - box.lo;
              const std::byte* const p = span.row(to.y, to.z) + to.x * 4;
              EXPECT_EQ(v.color, (Rgb{static_cast<uint8_t>(p[0]), static_cast<uint8_t>(p[1]),
                                      static_cast<uint8_t>(p[2])}));
              ++expected;
            }
            return {};
          }));
          to_inside();
          EXPECT_TRUE(expected == known.end());
        }
      }
}

/// The colour of each node is the mean of its voxels in linear light.
void nodes_have_the_mean_of_their_voxels(Curve curve) {
  const Voxels voxels = scattered(5, 2000, 11);
  Options options;
  options.curve = curve;
  options.codec = ColorCodec::raw;
  options.colors = Colors::all;
  ListSource source(voxels, Index3(32));
  const Encoded file = encoded(source, options);
  const auto volume = opened(file.bytes);
  ASSERT_TRUE(volume);
  // The cells in the order of a walk, with their voxels.
  uint64_t number = 0;
  const std::function<void(int, uint64_t, OrderState)> walk = [&](int h, uint64_t cell, OrderState state) {
    double light[3] = {}, count = 0;
    for (const SurfaceVoxel& v : voxels) {
      if (v.place >> 3 * h != cell) continue;
      const uint8_t channels[3] = {v.color.r, v.color.g, v.color.b};
      for (int k = 0; k < 3; ++k) {
        const double c = channels[k] / 255.0;
        light[k] += c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
      }
      ++count;
    }
    if (count == 0) return;
    const auto color = (*volume)->color(number++);
    ASSERT_TRUE(color);
    const uint8_t channels[3] = {color->r, color->g, color->b};
    for (int k = 0; k < 3; ++k) {
      const double l = light[k] / count;
      EXPECT_NEAR(channels[k], 255 * (l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055),
                  0.6);
    }
    for (int i = 0; h > 0 && i < 8; ++i) {
      const uint64_t octant = octant_orders.octant[state][static_cast<size_t>(i)];
      walk(h - 1, cell << 3 | octant, octant_orders.next[state][octant]);
    }
  };
  walk(5, 0, first_state(curve));
  EXPECT_EQ(number, (*volume)->params().color_count);
}
TEST(ColorVolume, NodesHaveTheMeanOfTheirVoxels) {
  for (const Curve curve : {Curve::morton, Curve::hilbert}) nodes_have_the_mean_of_their_voxels(curve);
}

TEST(ColorVolume, ThreadsAndRunsDoNotMatter) {
  const Voxels voxels = scattered(12, 30000, 9);
  ListSource one(voxels, Index3(4096), 1), many(voxels, Index3(4096), 100000);
  EXPECT_EQ(encoded(one, {}, 1).bytes, encoded(many, {}, 7).bytes);
}

/// More colours than a part has.
TEST(ColorVolume, ManyParts) {
  const Voxels voxels =
      voxels_where(7, [](uint32_t x, uint32_t y, uint32_t z) { return (x + y + z) % 3 != 0; });
  ASSERT_GT(voxels.size(), part_colors);
  ListSource source(voxels, Index3(128));
  const Encoded file = encoded(source, {}, 1);
  const auto volume = opened(file.bytes);
  ASSERT_TRUE(volume);
  Fixture f;
  EXPECT_TRUE((*volume)->check(f.ctx));
  for (size_t i = 0; i < voxels.size(); i += 101) {
    const auto color = (*volume)->color(i);
    ASSERT_TRUE(color);
    EXPECT_LE(distance(*color, voxels[i].color), 9.56);
  }
}

/// Parts of textures, and how large they are.
TEST(ColorVolume, TexturesTakeAsManyBitsAsTheyMust) {
  const Voxels voxels =
      voxels_where(7, [](uint32_t x, uint32_t y, uint32_t z) { return (x + y + z) % 3 != 0; });
  Options options;
  options.codec = ColorCodec::bc1;
  options.image_curve = ImageCurve::hilbert;
  ListSource source(voxels, Index3(128));
  const Encoded file = encoded(source, options, 2);
  EXPECT_EQ(file.report.params.color_bytes, (voxels.size() + 15) / 16 * 8);
  const auto volume = opened(file.bytes);
  ASSERT_TRUE(volume);
  for (size_t i = 0; i < voxels.size(); i += 1001) {
    const auto color = (*volume)->color(i);
    ASSERT_TRUE(color);
    EXPECT_LE(distance(*color, voxels[i].color), file.report.most_error);
  }
}

TEST(ColorVolume, AVolumeIsASurface) {
  // Of a compressed surface, as a volume: the same file again.
  const Voxels voxels = inside(sphere_shell(8), Index3(256, 200, 256));
  Options options;
  options.codec = ColorCodec::raw;
  ListSource source(voxels, Index3(256, 200, 256));
  const Encoded first = encoded(source, options);
  const auto volume = opened(first.bytes);
  ASSERT_TRUE(volume);
  auto surface = surface_of(open_source(*volume));
  ASSERT_TRUE(surface);
  EXPECT_EQ(encoded(**surface, options).bytes, first.bytes);
}

TEST(ColorVolume, DamagedFilesAreRefused) {
  const Voxels voxels = sphere_shell(5);
  for (const ColorCodec codec : {ColorCodec::raw, ColorCodec::vws})
    for (const Counts counts : {Counts::node, Counts::pointer}) {
      Options options;
      options.codec = codec;
      options.counts = counts;
      ListSource source(voxels, Index3(32));
      const Encoded file = encoded(source, options);
      for (size_t length = 0; length < file.bytes.size(); length += 1 + file.bytes.size() / 400)
        EXPECT_FALSE(opened({file.bytes.begin(), file.bytes.begin() + static_cast<ptrdiff_t>(length)}));
      // Any byte of a chunk: a checksum fails.
      const auto good = opened(file.bytes);
      ASSERT_TRUE(good);
      for (const ChunkEntry& entry : (*good)->container().table()) {
        if (entry.length == 0) continue;
        auto bytes = file.bytes;
        bytes[entry.offset + entry.length / 2] ^= std::byte{1};
        const auto volume = opened(bytes);
        if (!volume) continue;
        Fixture f;
        EXPECT_FALSE((*volume)->check(f.ctx));
        std::vector<std::byte> memory(32 * 32 * 32 * 4);
        EXPECT_FALSE(open_source(*volume)->read((*volume)->info().box(),
                                                packed(memory.data(), Index3(32), VoxelFormat::rgba32)));
      }
    }
}

// What walks through all voxels counts on their places.
TEST(ColorVolume, AVoxelOutsideIsAnError) {
  for (const Geometry geometry : {Geometry::dag, Geometry::ssvdag, Geometry::octree}) {
    Options options;
    options.codec = ColorCodec::raw;
    options.geometry = geometry;
    ListSource source({{morton_code(3, 1, 2), {4, 5, 6}}, {morton_code(2, 2, 2), {1, 2, 3}}}, Index3(3));
    const Encoded file = encoded(source, options);
    Fixture f;
    std::vector<std::byte> voxels(27 * 4);
    const auto none = [](std::span<const SurfaceVoxel>) -> Status { return {}; };
    // All voxels, a part whose word has it, and the same decoded; a volume found to be damaged stays so.
    const auto expect_refused = [&](const std::function<Status(const Volume&)>& use) {
      const auto volume = opened(file.bytes);
      ASSERT_TRUE(volume) << volume.error().what;
      const Status used = use(**volume);
      ASSERT_FALSE(used);
      EXPECT_EQ(used.error().code, ErrorCode::input);
      EXPECT_EQ(used.error().what, "chunk LEAF: a voxel at 3,1,2: outside the volume");
    };
    expect_refused([&](const Volume& v) { return v.for_each_voxel(none, f.ctx); });
    expect_refused([&](const Volume& v) { return v.for_each_voxel({{0, 0, 0}, {3, 3, 2}}, none); });
    expect_refused([&](const Volume& v) {
      return v.decode({{0, 0, 0}, {3, 3, 3}}, packed(voxels.data(), Index3(3), VoxelFormat::rgba32));
    });
  }
}

}  // namespace
}  // namespace voxkit::color
