// Mesh files that are written and read, for tests of their readers.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "formats/image/image.h"
#include "formats/mesh/mesh.h"
#include "formats/module.h"
#include "tests/formats/file_format_test.h"
#include "tests/formats/gltf_file.h"
#include "tests/formats/mesh_files.h"

namespace voxkit {

class MeshReadingTest : public FileFormatTest {
 protected:
  Mesh read(const std::string& name, const std::string& content) {
    auto mesh = read_mesh(put(name, content), ctx_);
    EXPECT_TRUE(mesh) << mesh.error().what;
    return mesh ? std::move(*mesh) : Mesh{};
  }
  void expect_error(const std::string& name, const std::string& content, const std::string& part,
                    ErrorCode code = ErrorCode::input) {
    const auto mesh = read_mesh(put(name, content), ctx_);
    ASSERT_FALSE(mesh) << "accepted; expected an error with: " << part;
    EXPECT_EQ(mesh.error().code, code);
    EXPECT_NE(mesh.error().what.find(part), std::string::npos) << mesh.error().what;
    EXPECT_EQ(mesh.error().what.find('\n'), std::string::npos) << mesh.error().what;
  }
  static bool has_note(const Mesh& mesh, const std::string& part) {
    return std::any_of(mesh.notes.begin(), mesh.notes.end(),
                       [&](const std::string& note) { return note.find(part) != note.npos; });
  }
  static bool reads_images() {
    return load_module(module_folder(), {"image_stack", "reading images", ""}).has_value();
  }

  /// A picture of 2 x 2: red, green over blue, white; or with the alpha of each.
  std::string picture(const std::string& name, const std::vector<float>& alphas = {}) {
    const float texels[4][3] = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 255}};
    auto image = Image::create(2, 2, alphas.empty() ? 3 : 4, SampleType::u8, ctx_);
    float* out = image->row(0);
    for (size_t i = 0; i < 4; ++i) {
      out = std::copy_n(texels[i], 3, out);
      if (!alphas.empty()) *out++ = alphas[i];
    }
    const Status written = write_image(path(name), *image, true);
    EXPECT_TRUE(written) << written.error().what;
    return get(path(name));
  }
  static std::array<int, 4> texel(const Mesh& mesh, size_t picture, int64_t x, int64_t y) {
    const uint8_t* p = mesh.pictures[picture].data() + 4 * (y * mesh.pictures[picture].width + x);
    return {p[0], p[1], p[2], p[3]};
  }
  /// Lowest and highest corner of triangles and points.
  static std::array<glm::dvec3, 2> box(const Mesh& mesh) {
    std::array<glm::dvec3, 2> out{glm::dvec3(1e300), glm::dvec3(-1e300)};
    const auto add = [&](uint32_t v) {
      for (int a = 0; a < 3; ++a) {
        out[0][a] = std::min(out[0][a], mesh.positions[v][a]);
        out[1][a] = std::max(out[1][a], mesh.positions[v][a]);
      }
    };
    for (const MeshTriangle& t : mesh.triangles)
      for (const uint32_t v : t.vertices) add(v);
    for (const MeshPoint& p : mesh.points) add(p.vertex);
    return out;
  }
  static void expect_box(const Mesh& mesh, const glm::dvec3& lo, const glm::dvec3& hi, double within = 1e-6) {
    const auto have = box(mesh);
    for (int a = 0; a < 3; ++a) {
      EXPECT_NEAR(have[0][a], lo[a], within) << "axis " << a;
      EXPECT_NEAR(have[1][a], hi[a], within) << "axis " << a;
    }
  }
  /// Sum of the areas of triangles in a plane of constant z, each counted with its sign.
  static double area(const Mesh& mesh) {
    double sum = 0;
    for (const MeshTriangle& t : mesh.triangles) {
      const glm::dvec3 u = mesh.positions[t.vertices[1]] - mesh.positions[t.vertices[0]],
                       v = mesh.positions[t.vertices[2]] - mesh.positions[t.vertices[0]];
      sum += (u.x * v.y - u.y * v.x) / 2;
    }
    return sum;
  }
};

}  // namespace voxkit
