// Layers hold what the rays found.
#include "librender/layers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace voxkit::render {
namespace {

class LayersTest : public testing::Test {
 protected:
  /// 12 x 9 pixels; every third one missed, others at a distance of their own.
  LayersTest() {
    frame_.width = 12;
    frame_.height = 9;
    frame_.pixels.resize(12 * 9);
    frame_.details.resize(12 * 9);
    auto normals = Image::create(12, 9, 3, SampleType::f32, ctx_);
    EXPECT_TRUE(normals);
    for (size_t i = 0; i < frame_.pixels.size(); ++i) {
      frame_.details[i].cells = static_cast<uint32_t>(i + 1);
      if (i % 3 != 0) frame_.pixels[i].distance = 1 + static_cast<float>(i) / 64;
      for (int k = 0; k < 3; ++k)
        normals->row(0)[3 * i + static_cast<size_t>(k)] = static_cast<float>(i) + static_cast<float>(k) / 4;
    }
    normals_ = std::move(*normals);
  }

  MemoryBudget memory_{1 << 20};
  Context ctx_{.threads = 2, .memory = &memory_};
  Frame frame_;
  Camera camera_ = Camera::orbit(30, 20, 1.8, 45);
  std::optional<Image> normals_;
};

TEST_F(LayersTest, HoldWhatThePixelInTheMiddleFound) {
  for (const int n : {1, 2, 3}) {
    const RayGenerator rays(camera_, 12, 9);
    const auto depth = make_layer(Layer::depth, frame_, camera_, normals_, n, ctx_);
    const auto normal = make_layer(Layer::normal, frame_, camera_, normals_, n, ctx_);
    const auto position = make_layer(Layer::position, frame_, camera_, normals_, n, ctx_);
    const auto steps = make_layer(Layer::steps, frame_, camera_, normals_, n, ctx_);
    ASSERT_TRUE(depth && normal && position && steps);
    EXPECT_EQ(depth->name + "." + depth->channels, "depth.Z");
    EXPECT_EQ(normal->name + "." + normal->channels, "normal.XYZ");
    EXPECT_EQ(position->name + "." + position->channels, "position.XYZ");
    EXPECT_EQ(steps->name + "." + steps->channels, "steps.S");
    for (const auto* layer : {&*depth, &*normal, &*position, &*steps}) {
      ASSERT_EQ(layer->image.width(), 12 / n);
      ASSERT_EQ(layer->image.height(), 9 / n);
      ASSERT_EQ(layer->image.channels(), static_cast<int>(layer->channels.size()));
      ASSERT_EQ(layer->image.type(), SampleType::f32);
    }
    const int middle = n / 2;
    for (int y = 0; y < 9 / n; ++y)
      for (int x = 0; x < 12 / n; ++x) {
        const int column = x * n + middle, row = y * n + middle, i = 12 * row + column;
        const bool hit = i % 3 != 0;
        const float distance = hit ? 1 + static_cast<float>(i) / 64 : std::numeric_limits<float>::infinity();
        EXPECT_EQ(depth->image.row(y)[x], distance);
        EXPECT_EQ(steps->image.row(y)[x], static_cast<float>(i + 1));
        for (int k = 0; k < 3; ++k) {
          EXPECT_EQ(normal->image.row(y)[3 * x + k], static_cast<float>(i) + static_cast<float>(k) / 4);
          const glm::dvec3 d = rays.direction(column + 0.5, row + 0.5);
          const double expected = hit ? rays.eye()[k] + d[k] * double{distance} : 0;
          EXPECT_NEAR(position->image.row(y)[3 * x + k], expected, 1e-6);
        }
      }
  }
}

}  // namespace
}  // namespace voxkit::render
