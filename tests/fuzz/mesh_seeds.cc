// Small meshes.
#include "tests/formats/mesh_files.h"
#include "tests/fuzz/seeds.h"

namespace voxkit::fuzz {
namespace {

/// With nodes, colours, a material with a texture transform, and an accessor that is partly zeros.
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
  file.nodes = R"([{"mesh":0,"translation":[10,0,0]},{"children":[2],"scale":[2,2,2]},)"
               R"({"mesh":0,"rotation":[0,0,0.6,0.8]}])";
  file.scene = "[0,1]";
  file.material = R"({"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,0.75]},"alphaMode":"MASK"})";
  return file;
}

}  // namespace

std::vector<std::string> mesh_ply_seeds() {
  return {ply_triangle(false), ply_triangle(true),
          "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty float y\n"
          "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
          "property list uchar float texcoord\nend_header\n"
          "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 8 0 0 1 0 1 1 0 1\n"};
}

std::vector<std::string> mesh_gltf_seeds() {
  return {GltfSquare{}.glb(), rich_square().glb(), rich_square().gltf()};
}

std::vector<std::string> mesh_obj_seeds() {
  return {obj_square(),
          obj_square("o a\ng b\ns 1\nvn 0 0 1\n") + "usemtl x\nf 1//1 -2//1 3//1\nl 1 2\np 1\n"};
}

}  // namespace voxkit::fuzz
