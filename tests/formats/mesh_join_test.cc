// Meshes and points in one.
#include "formats/mesh/mesh_join.h"

#include <gtest/gtest.h>

#include "formats/mesh/joined_points.h"

namespace voxkit {
namespace {

/// A triangle at z, in one material.
Mesh triangle(double z, const std::string& name) {
  Mesh mesh;
  mesh.positions = {{0, 0, z}, {1, 0, z}, {0, 1, z}};
  mesh.triangles = {{{0, 1, 2}, 0}};
  mesh.materials.emplace_back().name = name;
  mesh.notes = {name};
  return mesh;
}

class TwoPoints final : public PointCloud {
 public:
  TwoPoints() {
    size_ = 3;  // one of them is nowhere
    notes_ = {"dropped: labels"};
  }
  Status read(const Sink& sink) const override {
    const std::vector<CloudPoint> points = {{{1, 2, 3}, {255, 0, 0}}, {{4, 5, 6}, {0, 188, 255}}};
    return sink(points);
  }
};

class MeshJoin : public testing::Test {
 protected:
  MeshJoin() { ctx_.memory = &memory_; }
  MemoryBudget memory_;
  Context ctx_;
};

TEST_F(MeshJoin, EachKeepsWhatItHas) {
  std::vector<Mesh> meshes(3);
  meshes[0] = triangle(0, "first");
  meshes[1] = triangle(1, "second");
  meshes[1].uvs = {{0.1f, 0}, {0.2f, 0}, {0.3f, 0}};
  meshes[1].pictures.resize(2);
  meshes[1].materials[0].picture = 1;
  meshes[1].grid.emplace();
  meshes[2] = triangle(2, "third");
  meshes[2].uvs = meshes[2].emission_uvs = {{0.4f, 0}, {0.5f, 0}, {0.6f, 0}};
  meshes[2].colors.resize(3, glm::vec4(0.5f));
  meshes[2].pictures.resize(1);
  meshes[2].materials[0].emission_picture = 0;
  meshes[2].points = {{2, 0}};
  const auto joined = join_meshes(std::move(meshes), ctx_);
  ASSERT_TRUE(joined);
  ASSERT_EQ(joined->triangles.size(), 3u);
  for (uint32_t i = 0; i < 3; ++i) {
    EXPECT_EQ(joined->triangles[i].material, i);
    for (uint32_t c = 0; c < 3; ++c) {
      EXPECT_EQ(joined->triangles[i].vertices[c], 3 * i + c);
      EXPECT_EQ(joined->positions[3 * i + c].z, i);
    }
  }
  EXPECT_EQ(joined->points.at(0).vertex, 8u);
  EXPECT_EQ(joined->points.at(0).material, 2u);
  EXPECT_EQ(joined->uvs.at(0), glm::vec2(0));
  EXPECT_EQ(joined->uvs.at(4), glm::vec2(0.2f, 0));
  EXPECT_EQ(joined->emission_uvs.at(4), glm::vec2(0.2f, 0));  // went by those of colours, and still do
  EXPECT_EQ(joined->emission_uvs.at(8), glm::vec2(0.6f, 0));
  EXPECT_EQ(joined->colors.at(5), glm::vec4(1));
  EXPECT_EQ(joined->colors.at(6), glm::vec4(0.5f));
  for (uint32_t i = 0; i < 3; ++i) EXPECT_EQ(joined->materials.at(i).number, i);
  EXPECT_EQ(joined->pictures.size(), 3u);
  EXPECT_EQ(joined->materials.at(0).picture, -1);
  EXPECT_EQ(joined->materials.at(1).picture, 1);
  EXPECT_EQ(joined->materials.at(2).emission_picture, 2);
  EXPECT_FALSE(joined->grid);
  EXPECT_EQ(joined->notes, (std::vector<std::string>{"first", "second", "third"}));
}

TEST_F(MeshJoin, MemoryIsCounted) {
  MemoryBudget little(100);
  ctx_.memory = &little;
  std::vector<Mesh> meshes(2);
  for (Mesh& mesh : meshes) mesh = triangle(0, "");
  EXPECT_EQ(join_meshes(std::move(meshes), ctx_).error().code, ErrorCode::limit);
  EXPECT_EQ(mesh_of_points(TwoPoints(), ctx_).error().code, ErrorCode::limit);
}

TEST_F(MeshJoin, GridsMoveWithTheirMeshes) {
  Mesh mesh = triangle(1, "");
  mesh.grid.emplace().affine.origin = {5, 6, 7};
  move_mesh(mesh, {1, -2, 0.5});
  EXPECT_EQ(mesh.positions[1], glm::dvec3(2, -2, 1.5));
  EXPECT_EQ(mesh.grid->affine.origin[1], 4);
}

TEST_F(MeshJoin, PointsBecomeAMesh) {
  const auto mesh = mesh_of_points(TwoPoints(), ctx_);
  ASSERT_TRUE(mesh);
  ASSERT_EQ(mesh->points.size(), 2u);
  EXPECT_EQ(mesh->points[1].vertex, 1u);
  EXPECT_EQ(mesh->positions[1], glm::dvec3(4, 5, 6));
  EXPECT_EQ(mesh->colors[0], glm::vec4(1, 0, 0, 1));
  EXPECT_NEAR(mesh->colors[1].g, 0.503, 0.001);
  EXPECT_EQ(mesh->materials.size(), 1u);
  ASSERT_EQ(mesh->notes.size(), 2u);
  EXPECT_EQ(mesh->notes[1].substr(0, 8), "1 of 3 p");
}

TEST_F(MeshJoin, CloudsComeOneAfterTheOther) {
  std::vector<PlacedPoints> clouds(2);
  clouds[0] = {std::make_unique<TwoPoints>(), {0, 0, 0}, "a: "};
  clouds[1] = {std::make_unique<TwoPoints>(), {10, 20, -30}, "b: "};
  const auto joined = join_points(std::move(clouds));
  EXPECT_EQ(joined->size(), 6u);
  EXPECT_EQ(joined->notes(), (std::vector<std::string>{"a: dropped: labels", "b: dropped: labels"}));
  std::vector<glm::dvec3> places;
  ASSERT_TRUE(joined->read([&](std::span<const CloudPoint> run) -> Status {
    for (const CloudPoint& point : run) places.push_back(point.at);
    return {};
  }));
  EXPECT_EQ(places, (std::vector<glm::dvec3>{{1, 2, 3}, {4, 5, 6}, {11, 22, -27}, {14, 25, -24}}));
}

}  // namespace
}  // namespace voxkit
