// Small meshes, and points.
#include "tests/formats/gltf_file.h"
#include "tests/formats/mesh_files.h"
#include "tests/formats/point_files.h"
#include "tests/formats/studio_file.h"
#include "tests/fuzz/seeds.h"

namespace voxkit::fuzz {
namespace {

const std::string grid =
    R"({"dims":[3,4,5],"axes":[[1,0,0],[0,1,0],[0,0,2]],"origin":[0,0,0],"world":"RAS","unit":"mm",)"
    R"("space_code":1,"description":"d"})";

/// With nodes, colours, a material with a picture transform, and an accessor that is partly zeros.
GltfSquare rich_square() {
  GltfSquare file;
  file.attributes = R"(,"COLOR_0":3,"TEXCOORD_1":4)";
  file.accessors =
      R"(,{"bufferView":3,"componentType":5126,"count":4,"type":"VEC3"})"
      R"(,{"componentType":5126,"count":4,"type":"VEC2","sparse":{"count":1,"indices":{"bufferView":4,)"
      R"("componentType":5123},"values":{"bufferView":5}}})";
  file.extra = bytes_of(std::vector<float>(12, 0.5f)) + std::string("\2\0\0\0", 4) +
               bytes_of(std::vector<float>{0.25f, 1});
  file.views =
      R"(,{"buffer":0,"byteOffset":92,"byteLength":48},{"buffer":0,"byteOffset":140,"byteLength":2},)"
      R"({"buffer":0,"byteOffset":144,"byteLength":8})";
  file.nodes = R"([{"mesh":0,"translation":[10,0,0],"extras":{"voxel_grid":)" + grid +
               R"(}},{"children":[2],"scale":[2,2,2]},)"
               R"({"mesh":0,"rotation":[0,0,0.6,0.8]}])";
  file.scene = "[0,1]";
  file.material = R"({"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,0.75]},"alphaMode":"MASK"})";
  return file;
}

/// With a skin, morph weights, instances, quantised places, points, strips and packed parts.
std::string bent_square() {
  GltfFile file;
  const int position =
      file.numbers<int16_t>({0, 0, 0, 9, 0, 0, 9, 9, 0, 0, 9, 0}, 5122, "VEC3", R"(,"normalized":true)");
  const int joints = file.numbers<uint8_t>({0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, 5121, "VEC4");
  const int weights =
      file.numbers<float>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0.5f, 0.5f, 0, 0}, 5126, "VEC4");
  const int shift = file.numbers<float>({0, 0, 0, 3, 0, 0}, 5126, "VEC3");
  const int target = file.numbers<float>({0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 2, 0}, 5126, "VEC3");
  file.primitives = fmt::format(
      R"({{"attributes":{{"POSITION":{0},"JOINTS_0":{1},"WEIGHTS_0":{2}}},"indices":{3},"targets":[{{"POSITION":{4}}}]}},)"
      R"({{"attributes":{{"POSITION":{0}}},"mode":0}},{{"attributes":{{"POSITION":{0}}},"mode":5}})",
      position, joints, weights, file.square_corners(), target);
  file.nodes = fmt::format(
      R"([{{"mesh":0,"skin":0,"weights":[0.5]}},{{"children":[2]}},{{"translation":[0,3,0]}},)"
      R"({{"mesh":0,"extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":{}}}}}}}}}])",
      shift);
  file.scenes = R"([{"nodes":[0,1,3]}])";
  file.rest = R"(,"skins":[{"joints":[1,2]}])";
  return file.json();
}
std::string packed_square() {
  GltfFile file;
  const std::string packed = unhex(meshopt_places);
  file.view(packed);
  const int position = file.accessor(
      std::string(48, '\0'), 5126, 4, "VEC3", "",
      fmt::format(
          R"(,"extensions":{{"EXT_meshopt_compression":{{"buffer":0,"byteLength":{},"byteStride":12,"count":4,"mode":"ATTRIBUTES"}}}})",
          packed.size()));
  file.primitives =
      fmt::format(R"({{"attributes":{{"POSITION":{}}},"indices":{}}})", position, file.square_corners());
  return file.json();
}
std::string draco_square(const char* hex) {
  GltfFile file;
  const int view = file.view(unhex(hex));
  file.primitives = fmt::format(
      R"({{"attributes":{{"POSITION":{}}},"indices":{},"extensions":{{"KHR_draco_mesh_compression":{{"bufferView":{},"attributes":{{"POSITION":0}}}}}}}})",
      file.raw_accessor(R"("componentType":5126,"count":4,"type":"VEC3")"),
      file.raw_accessor(R"("componentType":5123,"count":6,"type":"SCALAR")"), view);
  return file.json();
}

}  // namespace

std::vector<std::string> mesh_ply_seeds() {
  return {
      ply_triangle(false), ply_triangle(true),
      "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
      "property list uchar float texcoord\nend_header\n"
      "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 8 0 0 1 0 1 1 0 1\n",
      "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nproperty uchar red\n"
      "element vertex 4\nproperty double x\nproperty float y\nproperty float z\nproperty uchar a\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
      "4 0 1 2 3 9\n0 0 0 1\n3 0 0 1\n1 1 0 1\n0 3 0 1\n6 0 1 2 -1 2 3\n"};
}

std::vector<std::string> mesh_gltf_seeds() {
  return {GltfSquare{}.glb(),
          rich_square().glb(),
          rich_square().gltf(),
          bent_square(),
          packed_square(),
          draco_square(draco_sequential),
          draco_square(draco_edgebreaker)};
}

std::vector<std::string> mesh_obj_seeds() {
  return {obj_square(), obj_square("o a\ng b\ns 1\nvn 0 0 1\n") + "usemtl x\nf 1//1 -2//1 3//1\nl 1 2\np 1\n",
          "# voxel_grid " + grid +
              "\nf 1 2 \\\n3 4 5\nv .5 0 0 1 0 .5\nv 2 1. 0\nv 0 2e0 0\nv 1 1 0 .25\nv +1 -0.5 0\n"};
}

std::vector<std::string> mesh_stl_seeds() {
  const std::vector<StlTriangle> colored{{{0, 0, 0, 1, 0, 0, 0, 1, 0}, 0x8421},
                                         {{0, 0, 0, 1, 0, 0, 0, 0, 1}, 0x1234}};
  return {stl_ascii(), stl_binary("solid by hand", colored),
          stl_binary(std::string("COLOR=\1\2\3\xff,MATERIAL=") + "123412341234", colored)};
}

std::vector<std::string> mesh_3ds_seeds() {
  using namespace studio_file;
  Object object;
  object.axes = {0, 1, 0, -1, 0, 0, 0, 0, 1, 10, 0, 0};
  object.groups = group("a", {0}) + group("b", {1});
  const std::string scene =
      material("a", chunk(0xa020, color_24(255, 9, 0) + chunk(0x0012, "abc")) +
                        chunk(0xa050, chunk(0x0030, u16(9)))) +
      material("b", chunk(0xa020, chunk(0x0010, floats({0, 0.5f, 1}))) +
                        chunk(0xa200, chunk(0x0031, floats({0})) + chunk(0xa351, u16(2)) +
                                          chunk(0xa354, floats({2})))) +
      object.chunks() + chunk(0x4000, text("lamp") + chunk(0x4600, floats({1, 2, 3})));
  Node parent, child;
  parent.object = "$$$DUMMY";
  parent.turn = {1, 0, 1, 0};
  child.id = 1;
  child.parent = 0;
  child.pivot = {1, 2, 3};
  child.keys = 2;
  return {file(scene), file(scene, child.chunks() + parent.chunks() + Node{.id = 2}.chunks())};
}

std::vector<std::string> points_pcd_seeds() {
  const PcdFile colors{"x y z rgba _", "4 8 2 4 1", "F F I U U", "1 1 1 1 3"};
  const PcdFile gray{"x y z intensity", "4 4 4 4", "F F F F", "1 1 1 1"};
  const std::string numbers = bytes_of(std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8});
  return {PcdFile{}.ascii("1 2 3\n4.5 -5e1 nan\n"),
          gray.ascii("1 2 3 4\n5 6 7 -8\n"),
          colors.binary(std::string(42, '@')),
          gray.binary(numbers),
          gray.compressed(lzf_literals(numbers), 32),
          gray.compressed("\x03" + numbers.substr(0, 4) + std::string("\xe0\x13\x03", 3), 32)};
}

std::vector<std::string> points_las_seeds() {
  LasFile old, colored, new_one;
  old.format = 1;
  old.minor = 1;
  old.points = {{{1, 2, 3}, {}, 100, 0x80}, {{4, 5, 6}, {}, 200, 2}};
  colored.format = 3;
  colored.records = LasFile::record("LASF_Projection", 34735, bytes_of(std::vector<uint16_t>(12, 1)));
  colored.record_count = 1;
  colored.points = {{{1, 2, 3}, {255, 0, 1}}, {{4, 5, -6}, {2, 3, 4}}};
  new_one.format = 7;
  new_one.minor = 4;
  new_one.extra = 2;
  new_one.points = {{{1, 2, 3}, {65535, 0, 256}}};
  new_one.tail = LasFile::record("LASF_Projection", 2112, "PROJCS[\"a\"]", true);
  new_one.tail_count = 1;
  return {old.text(), colored.text(), new_one.text()};
}

}  // namespace voxkit::fuzz
