// What compressed surfaces have beside colours, in pictures.
#include <gtest/gtest.h>

#include <cmath>

#include "librender/cast/ray_cast.h"
#include "librender/device/device_grid.h"
#include "librender/layers.h"
#include "librender/shade.h"
#include "librender/stored.h"
#include "tests/libcolor/attribute_scenes.h"

namespace voxkit::render {
namespace {

using color::Attribute;
using color::AttributeSet;

class SurfaceTraits : public testing::Test {
 protected:
  SurfaceTraits() {
    ctx_.memory = &memory_;
    ctx_.threads = 3;
  }
  static AttributeSet set_of(std::initializer_list<Attribute> attributes) {
    AttributeSet set;
    for (const Attribute a : attributes) set.add(a);
    return set;
  }
  /// The shell of a sphere, 32 voxels wide, with these bytes of each voxel.
  std::shared_ptr<const color::Volume> volume(AttributeSet set, std::vector<std::byte> values) {
    color::AttributedSource source(color::sphere_shell(5), Index3(32), set, std::move(values));
    color::Options options;
    options.codec = color::ColorCodec::raw;
    const auto bytes = std::make_shared<const std::vector<std::byte>>(color::compressed(source, options));
    auto container = Container::open(*bytes, "file", bytes);
    EXPECT_TRUE(container);
    auto opened = color::Volume::open(*container);
    EXPECT_TRUE(opened);
    return *opened;
  }
  std::shared_ptr<const color::Volume> random_volume(AttributeSet set) {
    return volume(set, color::interleaved(set, color::sphere_shell(5).size(), color::Pattern::random, 5));
  }
  CastOptions options() const {
    CastOptions out;
    out.width = 90;
    out.height = 70;
    out.details = true;
    return out;
  }
  MemoryBudget memory_;
  Context ctx_;
  Camera camera_ = Camera::orbit(40, 25, 1.5, 45);
};

TEST_F(SurfaceTraits, AreThoseOfTheVoxelsThatAreHit) {
  const AttributeSet set = set_of({Attribute::emissive, Attribute::normal, Attribute::rm, Attribute::id});
  const auto opened = random_volume(set);
  CastOptions how = options();
  Frame plain, frame;
  ASSERT_TRUE(cast(DagGrid(opened), camera_, how, plain, ctx_));
  EXPECT_TRUE(plain.traits.empty());
  how.traits = color::all_attributes();
  ASSERT_TRUE(cast(DagGrid(opened), camera_, how, frame, ctx_));
  EXPECT_EQ(frame.has, set);
  ASSERT_EQ(frame.traits.size(), frame.pixels.size());
  std::map<uint64_t, std::vector<std::byte>> values;
  ASSERT_TRUE(opened->for_each_voxel(
      [&](const color::VoxelRun& run) -> Status {
        for (size_t i = 0; i < run.voxels.size(); ++i) {
          const auto bytes = run.attributes.subspan(i * set.bytes(), set.bytes());
          values[run.voxels[i].place].assign(bytes.begin(), bytes.end());
        }
        return {};
      },
      ctx_));
  size_t hits = 0;
  for (size_t i = 0; i < frame.pixels.size(); ++i) {
    for (int k = 0; k < 4; ++k) ASSERT_EQ(frame.pixels[i].color[k], plain.pixels[i].color[k]);
    const int32_t(&v)[3] = frame.details[i].voxel;
    const PixelTraits& traits = frame.traits[i];
    if (v[0] < 0) {
      EXPECT_EQ(traits.id, 0u);
      continue;
    }
    ++hits;
    const auto& bytes = values.at(color::morton_code(static_cast<uint32_t>(v[0]), static_cast<uint32_t>(v[1]),
                                                     static_cast<uint32_t>(v[2])));
    const auto at = [&](Attribute a, size_t k) { return std::to_integer<uint8_t>(bytes[set.offset(a) + k]); };
    EXPECT_FLOAT_EQ(traits.emissive[1] * 255, at(Attribute::emissive, 1));
    EXPECT_FLOAT_EQ(traits.rm[1] * 255, at(Attribute::rm, 1));
    EXPECT_EQ(traits.id >> 24, at(Attribute::id, 3));
    const auto n = color::direction_of({at(Attribute::normal, 0), at(Attribute::normal, 1)});
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(traits.normal[k], n[k], 1e-5);
  }
  EXPECT_GT(hits, 1000u);
}

TEST_F(SurfaceTraits, WhatIsTranslucentIsThatOfTheVoxels) {
  const auto opened = random_volume(set_of({Attribute::opacity, Attribute::id}));
  const auto decoded = color::open_source(opened);
  const auto dense = DenseGrid::read(*decoded, ctx_);
  ASSERT_TRUE(dense);
  for (const double distance : {0.2, 1.5}) {
    const Camera camera = Camera::orbit(33, 20, distance, 45);
    CastOptions how = options();
    Frame expected, frame;
    ASSERT_TRUE(cast(**dense, camera, how, expected, ctx_));
    how.traits = set_of({Attribute::opacity});
    for (const Traversal traversal : {Traversal::path, Traversal::restart}) {
      how.traversal = traversal;
      ASSERT_TRUE(cast(DagGrid(opened), camera, how, frame, ctx_));
      for (size_t i = 0; i < frame.pixels.size(); ++i) {
        for (int k = 0; k < 4; ++k) ASSERT_EQ(frame.pixels[i].color[k], expected.pixels[i].color[k]);
        ASSERT_EQ(frame.details[i].voxel[0], expected.details[i].voxel[0]);
        if (frame.details[i].voxel[0] < 0) {
          ASSERT_EQ(frame.traits[i].opacity, 0);
        }
      }
    }
  }
}

TEST_F(SurfaceTraits, LightShinesThrough) {
  // All voxels emit, and are half there: the light of a ray is that of all that it comes through.
  const AttributeSet set = set_of({Attribute::emissive, Attribute::opacity});
  std::vector<std::byte> values;
  const size_t count = color::sphere_shell(5).size();
  for (size_t i = 0; i < count; ++i)
    for (const int byte : {255, 0, 128, 128}) values.push_back(static_cast<std::byte>(byte));
  CastOptions how = options();
  how.traits = set;
  Frame frame;
  ASSERT_TRUE(cast(DagGrid(volume(set, values)), camera_, how, frame, ctx_));
  for (size_t i = 0; i < frame.pixels.size(); ++i) {
    EXPECT_NEAR(frame.traits[i].emissive[0], frame.pixels[i].color[3], 0.02);
    EXPECT_NEAR(frame.traits[i].emissive[2], frame.pixels[i].color[3] * 128 / 255, 0.02);
  }
}

TEST_F(SurfaceTraits, NormalsAndLightAreShaded) {
  // All look along z; one half of what is seen gives all of its light.
  const AttributeSet set = set_of({Attribute::emissive, Attribute::normal});
  const auto voxels = color::sphere_shell(5);
  std::vector<std::byte> values;
  for (const color::SurfaceVoxel& voxel : voxels) {
    const bool lamp = color::morton_place(voxel.place).x < 16;
    for (const uint8_t part : {voxel.color.r, voxel.color.g, voxel.color.b})
      values.push_back(static_cast<std::byte>(lamp ? part : 0));
    values.insert(values.end(), {std::byte{128}, std::byte{128}});
  }
  const Camera camera = Camera::orbit(0, 0, 1.5, 45);
  CastOptions how = options();
  how.traits = set;
  Frame frame;
  ASSERT_TRUE(cast(DagGrid(volume(set, values)), camera, how, frame, ctx_));
  ShadeOptions shading;
  shading.normals = true;
  const auto picture = shade(frame, camera, 1.0 / 32, shading, ctx_);
  ASSERT_TRUE(picture);
  size_t lamps = 0;
  for (int y = 0; y < frame.height; ++y)
    for (int x = 0; x < frame.width; ++x) {
      const size_t i = static_cast<size_t>(y * frame.width + x);
      if (frame.details[i].voxel[0] < 0) continue;
      EXPECT_NEAR(picture->normals->row(y)[3 * x + 2], 1, 1e-5);
      const bool lamp = frame.details[i].voxel[0] < 16;
      lamps += lamp;
      for (int k = 0; k < 3 && lamp; ++k)  // what it shows is no less than its light
        EXPECT_GE(picture->rgba.row(y)[4 * x + k], frame.pixels[i].color[k] - 0.01f);
    }
  EXPECT_GT(lamps, 100u);
  const auto id = make_layer(Layer::emissive, frame, camera, std::nullopt, 1, ctx_);
  ASSERT_TRUE(id);
  EXPECT_EQ(id->channels, "RGB");
}

TEST_F(SurfaceTraits, SumsOfLight) {
  for (const float color : {0.0f, 0.1f, 0.5f, 1.0f}) {
    EXPECT_NEAR(without_light(color, color), 0, 1e-6);
    EXPECT_NEAR(with_light(color, 0), color, 1e-5);
    EXPECT_NEAR(with_light(without_light(1, color), color), 1, 1e-4);
  }
  EXPECT_NEAR(with_light(0.5f, 0.5f), 0.6857, 1e-3);  // twice the light
}

TEST_F(SurfaceTraits, DevicesRefuseWhatIsTranslucent) {
  const auto backend = *Backend::open(BackendKind::threads);
  const auto refused =
      DeviceGrid::upload(DagGrid(random_volume(set_of({Attribute::opacity}))), backend, ctx_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::device);
  const auto opened = random_volume(set_of({Attribute::id}));
  const auto device = DeviceGrid::upload(DagGrid(opened), backend, ctx_);
  ASSERT_TRUE(device);
  CastOptions how = options();
  how.traits = set_of({Attribute::id});
  Frame expected, frame;
  ASSERT_TRUE(cast(DagGrid(opened), camera_, how, expected, ctx_));
  ASSERT_TRUE((*device)->cast(camera_, how, frame, ctx_));
  for (size_t i = 0; i < frame.pixels.size(); ++i) ASSERT_EQ(frame.traits[i].id, expected.traits[i].id);
}

}  // namespace
}  // namespace voxkit::render
