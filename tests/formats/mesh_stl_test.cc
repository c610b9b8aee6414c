// Triangles in STL files.
#include <cmath>

#include "tests/formats/mesh_file_test.h"

namespace voxkit {
namespace {

class StlTest : public MeshReadingTest {
 protected:
  /// The colours of triangles, in the order of the file, as 8 bits in sRGB.
  static std::vector<std::array<int, 3>> colors(const Mesh& mesh) {
    std::vector<std::array<int, 3>> out;
    for (const MeshTriangle& t : mesh.triangles) {
      const glm::vec4 light = mesh.materials[t.material].color;
      const auto stored = [](float c) {
        return static_cast<int>(std::lround(
            255 * (c <= 0.0031308f ? 12.92 * c : 1.055 * std::pow(static_cast<double>(c), 1 / 2.4) - 0.055)));
      };
      out.push_back({stored(light.r), stored(light.g), stored(light.b)});
    }
    return out;
  }
};
using Colors = std::vector<std::array<int, 3>>;

TEST_F(StlTest, Ascii) {
  const Mesh mesh = read("a.stl", stl_ascii());
  EXPECT_EQ(mesh.triangles.size(), 2u);
  expect_box(mesh, {0, 0, 0}, {1, 1, 0});
  EXPECT_DOUBLE_EQ(area(mesh), 1);
  EXPECT_EQ(colors(mesh), (Colors{{255, 255, 255}, {255, 255, 255}}));
  EXPECT_TRUE(mesh.notes.empty());
  // Several solids, without names, and lines of DOS.
  std::string two = "solid\n" + stl_ascii().substr(15);
  two += two;
  std::string dos;
  for (const char c : two) dos += c == '\n' ? std::string("\r\n") : std::string(1, c);
  EXPECT_EQ(read("b.stl", dos).triangles.size(), 4u);
}

TEST_F(StlTest, AsciiRefusals) {
  const std::string good = stl_ascii();
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    return text.replace(text.find(from), from.size(), to);
  };
  expect_error("a.stl", changed("endsolid a square\n", ""), "ends at line 16: expected endsolid");
  expect_error("a.stl", changed("vertex 1 0 0", "vertex 1 zero 0"), "line 5: zero: expected a number");
  expect_error("a.stl", changed("      vertex 1 1e0 0\n", ""), "line 6: endloop: expected vertex");
  expect_error("a.stl", changed("endloop", "vertex 1 1 1 endloop"), "line 7: vertex: expected endloop");
  expect_error("a.stl", changed("facet normal", "face normal"), "line 2: face: expected facet or endsolid");
  expect_error("a.stl", good + "rest", "line 17: rest: expected solid");
  expect_error("a.stl", changed("vertex 1 0 0", "vertex 1 nan 0"), "expected finite coordinates");
  expect_error("a.stl", "solid nothing\nendsolid nothing\n", "a mesh without triangles");
  expect_error("a.stl", "", "STL file ends after 0 bytes");
}

TEST_F(StlTest, BinaryAlsoWhereItBeginsAsText) {
  const std::vector<StlTriangle> square{{}, {{1, 0, 0, 1, 1, 0, 0, 1, 0}, 0}};
  for (const char* head : {"solid made by a program", "", "   solid", "binary"}) {
    const Mesh mesh = read("a.stl", stl_binary(head, square));
    EXPECT_EQ(mesh.triangles.size(), 2u) << head;
    expect_box(mesh, {0, 0, 0}, {1, 1, 0});
    EXPECT_DOUBLE_EQ(area(mesh), 1);
    EXPECT_TRUE(mesh.notes.empty());
  }
  const std::string file = stl_binary("head", square);
  expect_error("a.stl", file.substr(0, file.size() - 1), "it holds 1 of 2 triangles");
  expect_error("a.stl", file.substr(0, 83), "ends after 83 bytes");
  expect_error("a.stl", stl_binary("", {}), "a mesh without triangles");
  std::string huge = file;
  huge.replace(80, 4, "\xff\xff\xff\xff");
  expect_error("a.stl", huge, "it holds 2 of 4294967295 triangles");
  const Mesh longer = read("a.stl", file + "rest");
  EXPECT_EQ(longer.triangles.size(), 2u);
  EXPECT_TRUE(has_note(longer, "dropped: 4 bytes behind the triangles"));
  expect_error("a.stl", stl_binary("", {{{0, 0, 0, 1, 0, 0, 0, NAN, 0}, 0}}), "expected finite coordinates");
}

/// Triangles of the same place with these bytes behind them.
std::vector<StlTriangle> with(const std::vector<int>& attributes) {
  std::vector<StlTriangle> out;
  for (const int attribute : attributes)
    out.push_back({StlTriangle{}.corners, static_cast<uint16_t>(attribute)});
  return out;
}

// Five bits a channel: 31 is 255, and 16 is 16 * 255 / 31 = 131.6.
TEST_F(StlTest, ColorsOfVisCam) {
  const Mesh mesh =
      read("a.stl", stl_binary("", with({0x8000 | 31 << 10, 0x8000 | 16 << 5 | 31, 0, 0x8000, 0x1234})));
  EXPECT_EQ(colors(mesh), (Colors{{255, 0, 0}, {0, 132, 255}, {255, 255, 255}, {0, 0, 0}, {255, 255, 255}}));
  EXPECT_TRUE(has_note(mesh, "2 of 5 triangles have no color: they are white"));
  EXPECT_TRUE(has_note(mesh, "attributes of 1 of 5 triangles: they are not marked as colors"));
  EXPECT_TRUE(read("b.stl", stl_binary("", with({0x8001, 0x8002}))).notes.empty());
}

TEST_F(StlTest, ColorsOfMagics) {
  const std::string head =
      std::string("made by COLOR=") + "\x80\x40\xff\xff" + ",MATERIAL=" + std::string(12, '\1');
  const Mesh mesh = read("a.stl", stl_binary(head, with({31, 16 << 5 | 31 << 10, 0x8000, 0xffff, 0x8123})));
  EXPECT_EQ(colors(mesh),
            (Colors{{255, 0, 0}, {0, 132, 255}, {128, 64, 255}, {128, 64, 255}, {128, 64, 255}}));
  EXPECT_TRUE(has_note(mesh, "attributes of 1 of 5 triangles: the header says COLOR="));
  EXPECT_TRUE(has_note(mesh, "MATERIAL="));
  // Where all are marked as without, and some have one.
  const Mesh all = read("c.stl", stl_binary(head, with({0x8000 | 31, 0x8000 | 31 << 10, 0xffff})));
  EXPECT_EQ(colors(all), (Colors{{255, 0, 0}, {0, 0, 255}, {255, 255, 255}}));
  EXPECT_TRUE(has_note(all, "these are taken"));
  // A colour for all, half clear.
  const Mesh clear = read("b.stl", stl_binary("COLOR=\xff\xff\xff\x40", with({0x8000})));
  ASSERT_EQ(clear.triangles.size(), 1u);
  const MeshMaterial& material = clear.materials[clear.triangles[0].material];
  EXPECT_EQ(material.alpha_mode, AlphaMode::blend);
  EXPECT_NEAR(material.color.a, 64 / 255.0, 1e-6);
}

TEST_F(StlTest, MemoryIsCounted) {
  MemoryBudget small(1 << 20);
  ctx_.memory = &small;
  expect_error("a.stl", stl_binary("", std::vector<StlTriangle>(20000)), "the mesh", ErrorCode::limit);
  std::string text = stl_ascii();
  const size_t begin = text.find("  facet"), end = text.find("  FACET");
  const std::string facet = text.substr(begin, end - begin);
  for (int i = 0; i < 14; ++i) text.insert(begin, text.substr(begin, facet.size() << i));
  expect_error("a.stl", text, "the mesh", ErrorCode::limit);
}

}  // namespace
}  // namespace voxkit
