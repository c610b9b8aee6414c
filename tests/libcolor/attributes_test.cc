// Attributes of voxels: parts of values within their bounds, whole files, and what damaged ones are answered.
#include <gtest/gtest.h>

#include <map>

#include "libcolor/attribute_reader.h"
#include "libcolor/attributes/attribute_encode.h"
#include "libcolor/attributes/attribute_means.h"
#include "libcolor/compare.h"
#include "libcolor/store.h"
#include "tests/libcolor/attribute_scenes.h"
#include "tests/libcolor/reading.h"

namespace voxkit::color {
namespace {

std::vector<Attribute> attributes() {
  std::vector<Attribute> all;
  for (size_t i = 0; i < attribute_kinds.size(); ++i) all.push_back(static_cast<Attribute>(i));
  return all;
}

TEST(Octahedral, AllBytesAreDirectionsAndTheDirectionsBytes) {
  for (uint32_t v = 0; v < 65536; ++v) {
    const Octahedral o{static_cast<uint8_t>(v & 255), static_cast<uint8_t>(v >> 8)};
    const auto d = direction_of(o);
    ASSERT_NEAR(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1, 1e-6);
    const Octahedral back = octahedral_of(d[0], d[1], d[2]);
    ASSERT_LT(degrees(v, back.u | static_cast<uint32_t>(back.v) << 8), 1e-3) << v;
  }
  EXPECT_EQ(direction_of({128, 128}), (std::array<float, 3>{0, 0, 1}));
  EXPECT_EQ(direction_of({1, 128}), (std::array<float, 3>{-1, 0, 0}));
  EXPECT_EQ(direction_of({0, 128}), (std::array<float, 3>{-1, 0, 0}));
  EXPECT_EQ(direction_of({128, 255}), (std::array<float, 3>{0, 1, 0}));
  EXPECT_EQ(direction_of({255, 255}), (std::array<float, 3>{0, 0, -1}));
  EXPECT_EQ(octahedral_of(0, 0, 0), Octahedral{});
}

TEST(Octahedral, IsOffByADegreeAtMost) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20000; ++i) {
    const double x = normal(random), y = normal(random), z = normal(random),
                 r = std::sqrt(x * x + y * y + z * z);
    const auto d = direction_of(octahedral_of(x, y, z));
    const double dx = x / r - d[0], dy = y / r - d[1], dz = z / r - d[2];
    ASSERT_LT(2 * std::asin(std::sqrt(dx * dx + dy * dy + dz * dz) / 2) * 180 / std::numbers::pi, 1.0);
  }
}

/// Encodes and reads back: in any order, in order, and by the check.
void expect_part(Attribute attribute, std::span<const std::byte> values, const AttributeParams& params,
                 int effort) {
  const size_t bytes = kind_of(attribute).bytes;
  const auto count = static_cast<uint32_t>(values.size() / bytes);
  const EncodedPart part = encode_attribute_part(values, params, effort);
  EXPECT_EQ(check_attribute_part(part.bytes, params, count), "");
  const AttributePart view(part.bytes.data(), part.bytes.size(), count, AttributeStorage(params));
  AttributePartReader reader;
  reader.open(view);
  double most = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const char* damaged = nullptr;
    const uint32_t is = reader.value(i, damaged), was = value_at(&values[i * bytes], bytes);
    ASSERT_EQ(damaged, nullptr) << damaged;
    ASSERT_EQ(is, view.value(i)) << i;
    most = std::max(most, plain_error(attribute, was, is));
  }
  const double bound = has_threshold(params.codec) ? params.threshold : 0;
  EXPECT_LE(most, bound + 1e-6);
  if (params.space != ErrorSpace::lab) {
    const double precision = params.space == ErrorSpace::angle ? 0.01 : 1e-6;
    EXPECT_NEAR(most, most_error_of(part.most_squared, params.space), precision);
  }
  EXPECT_LE(part.bytes.size(), values.size() + 4096);
}

TEST(Attributes, PartsKeepTheirBounds) {
  for (const Attribute attribute : attributes())
    for (const Pattern pattern : patterns)
      for (const ColorCodec codec : {ColorCodec::raw, ColorCodec::vws, ColorCodec::fws})
        for (const double threshold : {0.0, 5.0}) {
          if (codec == ColorCodec::raw && threshold > 0) continue;
          SCOPED_TRACE(kind_of(attribute).name);
          SCOPED_TRACE(threshold + 1000 * static_cast<int>(codec) + 10000 * static_cast<int>(pattern));
          Options options;
          options.codec = codec;
          options.attribute_thresholds[static_cast<size_t>(attribute)] = threshold;
          const auto values = values_of(attribute, pattern == Pattern::constant ? 17000 : 1500, pattern, 7);
          expect_part(attribute, values, attribute_plan(attribute, options),
                      codec == ColorCodec::fws ? 1 : 2);
        }
}

TEST(Attributes, SmallPartsAndManyIds) {
  for (const Attribute attribute : attributes())
    for (const size_t count : {1, 2, 3, 17})
      for (const ColorCodec codec : {ColorCodec::raw, ColorCodec::vws}) {
        Options options;
        options.codec = codec;
        expect_part(attribute, values_of(attribute, count, Pattern::random, count),
                    attribute_plan(attribute, options), 3);
      }
  // More than a palette has, and as many.
  for (const uint32_t different : {65536u, 65537u}) {
    std::vector<std::byte> ids(size_t{4} * (different + 1000));
    for (uint32_t i = 0; i < different + 1000; ++i) put_value(i % different * 31, 4, &ids[size_t{4} * i]);
    expect_part(Attribute::id, ids, attribute_plan(Attribute::id, {}), 1);
  }
}

TEST(Attributes, ConstantOnesCostNextToNothing) {
  for (const Attribute attribute : attributes()) {
    const auto values = values_of(attribute, part_colors, Pattern::constant, 1);
    const auto part = encode_attribute_part(values, attribute_plan(attribute, {}), 3);
    EXPECT_EQ(part.bytes.size(), kind_of(attribute).bytes);
  }
}

struct Case {
  Options options;
  std::string name;
};
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const ColorCodec codec : {ColorCodec::raw, ColorCodec::vws, ColorCodec::fws})
    for (const Colors colors : {Colors::leaf, Colors::all})
      for (const Curve curve : {Curve::morton, Curve::hilbert}) {
        Options options;
        options.codec = codec;
        options.colors = colors;
        options.curve = curve;
        options.effort = 1;
        options.geometry = curve == Curve::hilbert ? Geometry::octree : Geometry::ssvdag;
        all.push_back({options, std::to_string(static_cast<int>(codec)) + " " +
                                    std::to_string(static_cast<int>(colors)) + " " +
                                    std::to_string(static_cast<int>(curve))});
      }
  return all;
}

TEST(Attributes, WholeFilesComeBack) {
  const Voxels voxels = sphere_shell(4);
  for (const Case& c : cases())
    for (const Pattern pattern : {Pattern::runs, Pattern::random})
      for (const AttributeSet set : {all_attributes(), only(Attribute::opacity)}) {
        SCOPED_TRACE(c.name + " " + std::to_string(static_cast<int>(pattern)));
        const auto values = interleaved(set, voxels.size(), pattern, 5);
        AttributedSource source(voxels, Index3(16), set, values);
        const auto volume = opened(compressed(source, c.options));
        ASSERT_TRUE(volume);
        EXPECT_EQ(volume->params().attributes, set);
        Reading reading;
        ASSERT_TRUE(volume->check(reading.ctx));
        size_t next = 0;
        std::map<Attribute, double> most;
        ASSERT_TRUE(volume->for_each_voxel(
            [&](const VoxelRun& run) -> Status {
              EXPECT_EQ(run.attributes.size(), run.voxels.size() * set.bytes());
              for (size_t i = 0; i < run.voxels.size(); ++i, ++next) {
                EXPECT_EQ(run.voxels[i].place, voxels[next].place);
                for (const AttributeParams& p : volume->attributes()) {
                  const double error = plain_error(p.attribute, value_in(values, set, next, p.attribute),
                                                   value_in(run.attributes, set, i, p.attribute));
                  most[p.attribute] = std::max(most[p.attribute], error);
                }
              }
              return {};
            },
            reading.ctx));
        EXPECT_EQ(next, voxels.size());
        for (const AttributeParams& p : volume->attributes()) {
          EXPECT_LE(most[p.attribute], p.threshold + 1e-6) << kind_of(p.attribute).name;
          EXPECT_LE(most[p.attribute], p.most_error + 0.01) << kind_of(p.attribute).name;
        }
        const auto diff = compare(source, *volume, reading.ctx);
        ASSERT_TRUE(diff);
        EXPECT_TRUE(diff->same_voxels);
        EXPECT_TRUE(diff->same_attributes);
        for (const AttributeDiff& d : diff->attributes)
          EXPECT_NEAR(d.most_error, most[d.attribute], 1e-4) << kind_of(d.attribute).name;
      }
}

TEST(Attributes, BoxesHaveOpacityAsAlpha) {
  const Voxels voxels = sphere_shell(5);
  const AttributeSet set = only(Attribute::opacity);
  auto values = interleaved(set, voxels.size(), Pattern::random, 9);
  values[3] = std::byte{0};  // there, and yet nothing
  AttributedSource source(voxels, Index3(32), set, values);
  Options options;
  options.codec = ColorCodec::raw;
  const auto volume = opened(compressed(source, options));
  ASSERT_TRUE(volume);
  std::vector<std::byte> box(32 * 32 * 32 * 4);
  ASSERT_TRUE(volume->decode(volume->info().box(), packed(box.data(), Index3(32), VoxelFormat::rgba32)));
  size_t there = 0;
  for (size_t i = 0; i < box.size(); i += 4) there += box[i + 3] != std::byte{0} ? 1 : 0;
  EXPECT_EQ(there, voxels.size());
  for (size_t i = 0; i < voxels.size(); ++i) {
    const auto p = morton_place(voxels[i].place);
    const auto alpha = std::to_integer<int>(box[((p.z * 32 + p.y) * 32 + p.x) * 4 + 3]);
    EXPECT_EQ(alpha, std::max(1, std::to_integer<int>(values[i])));
  }
}

/// What the root has, gathered voxel by voxel.
TEST(Attributes, CellsHaveMeans) {
  const AttributeSet set = all_attributes();
  const Voxels voxels = scattered(3, 90, 4);
  const auto values = interleaved(set, voxels.size(), Pattern::random, 5);
  AttributedSource source(voxels, Index3(8), set, values);
  Options options;
  options.codec = ColorCodec::raw;
  options.colors = Colors::all;
  const auto volume = opened(compressed(source, options));
  ASSERT_TRUE(volume);
  AttributesReader reader(volume->store(), volume->container(), volume->params());
  // The root is the first of all.
  std::vector<std::byte> root;
  reader.append(0, root);
  double opacity = 0;
  std::array<double, 3> normal{}, light{};
  std::array<double, 2> rm{};
  const LightTables& tables = light_tables();
  for (size_t i = 0; i < voxels.size(); ++i) {
    opacity += value_in(values, set, i, Attribute::opacity);
    const uint32_t n = value_in(values, set, i, Attribute::normal),
                   m = value_in(values, set, i, Attribute::rm),
                   e = value_in(values, set, i, Attribute::emissive);
    const auto d = direction_of({static_cast<uint8_t>(n & 255), static_cast<uint8_t>(n >> 8)});
    for (size_t a = 0; a < 3; ++a) {
      normal[a] += d[a];
      light[a] += tables.linear[e >> 8 * a & 255];
    }
    for (size_t a = 0; a < 2; ++a) rm[a] += m >> 8 * a & 255;
  }
  const auto n = static_cast<double>(voxels.size());
  EXPECT_EQ(value_in(root, set, 0, Attribute::opacity), std::lround(opacity / n));
  const uint32_t m = value_in(root, set, 0, Attribute::rm), e = value_in(root, set, 0, Attribute::emissive);
  for (size_t a = 0; a < 2; ++a) EXPECT_EQ(m >> 8 * a & 255, std::lround(rm[a] / n));
  for (size_t a = 0; a < 3; ++a)
    EXPECT_EQ(e >> 8 * a & 255, tables.stored[static_cast<size_t>(std::lround(light[a] / n))]);
  const Octahedral o = octahedral_of(normal[0], normal[1], normal[2]);
  EXPECT_LT(degrees(value_in(root, set, 0, Attribute::normal), o.u | static_cast<uint32_t>(o.v) << 8), 1.5);
}

TEST(Attributes, IdsAreElected) {
  AttributeSums sums;
  const auto vote = [](uint32_t id, uint64_t voxels) {
    AttributeSums one;
    one.voxels = voxels;
    one.votes[0] = {id, voxels};
    one.vote_count = 1;
    return one;
  };
  for (const auto& [id, voxels] : {std::pair{7u, 3u}, {5u, 4u}, {7u, 1u}, {9u, 2u}})
    sums.add(vote(id, voxels));
  sums.elect();
  EXPECT_EQ(sums.votes[0].id, 5u);  // of equally many the least
  EXPECT_EQ(sums.votes[0].voxels, 10u);
  EXPECT_EQ(sums.vote_count, 1u);
}

TEST(Attributes, FilesDoNotDependOnThreads) {
  const Voxels voxels = sphere_shell(5);
  const AttributeSet set = all_attributes();
  const auto values = interleaved(set, voxels.size(), Pattern::ramps, 5);
  AttributedSource one(voxels, Index3(32), set, values), many(voxels, Index3(32), set, values, 7);
  EXPECT_EQ(compressed(one, {}, 1), compressed(many, {}, 3));
}

TEST(Attributes, SourcesMustDeliverWhatTheySay) {
  const Voxels voxels = sphere_shell(3);
  AttributedSource source(voxels, Index3(8), only(Attribute::id), std::vector<std::byte>(voxels.size() * 4),
                          5);
  class Liar final : public SurfaceSource {
   public:
    explicit Liar(SurfaceSource& of) : of_(of) {
      info_ = of.info();
      attributes_ = of.attributes();
    }
    Status read(Context& ctx, const Sink& sink) override {
      return of_.read(ctx, [&](const VoxelRun& run) { return sink({run.voxels, {}}); });
    }

   private:
    SurfaceSource& of_;
  } liar(source);
  EXPECT_FALSE(compressed(source, {}).empty());
  EXPECT_TRUE(compressed(liar, {}).empty());
}

}  // namespace
}  // namespace voxkit::color
