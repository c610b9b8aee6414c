#include "formats/volume/builtin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "formats/volume/readers.h"
#include "tests/memory_volume.h"

namespace voxkit {
namespace {

std::unique_ptr<VolumeSource> open(const std::string& name) {
  auto source = open_builtin(name);
  EXPECT_TRUE(source) << source.error().what;
  return source ? std::move(*source) : nullptr;
}

/// The voxels of a box, read into memory with gaps that must stay untouched.
std::vector<Voxel> read_box(VolumeSource& source, const Box& box) {
  const int bytes = voxel_bytes(source.info().format);
  const Index3 size = box.size();
  const int64_t row = size.x * bytes + 3, slice = row * size.y + 5;
  std::vector<std::byte> memory(static_cast<size_t>(slice * size.z), std::byte{0xa5});
  const VoxelSpan span{memory.data(), row, slice};
  EXPECT_TRUE(source.read(box, span));
  std::vector<Voxel> voxels;
  for (int64_t z = 0; z < size.z; ++z) {
    for (int64_t y = 0; y < size.y; ++y) {
      for (int64_t x = 0; x < size.x; ++x) {
        Voxel v;
        std::memcpy(v.bytes.data(), span.row(y, z) + x * bytes, static_cast<size_t>(bytes));
        voxels.push_back(v);
      }
      for (int64_t gap = size.x * bytes; gap < row; ++gap) EXPECT_EQ(span.row(y, z)[gap], std::byte{0xa5});
    }
  }
  return voxels;
}

/// The definition of menger:LEVEL, digit by digit.
Voxel menger_voxel(int level, int64_t side, Index3 v) {
  Index3 rest = v;
  for (int place = 0; place < level; ++place) {
    int ones = 0;
    for (int axis = 0; axis < 3; ++axis) {
      ones += rest[axis] % 3 == 1;
      rest[axis] /= 3;
    }
    if (ones >= 2) return {};
  }
  Voxel color;
  for (int axis = 0; axis < 3; ++axis) {
    color.bytes[static_cast<size_t>(axis)] = static_cast<std::byte>(255 * v[axis] / side);
  }
  color.bytes[3] = std::byte{255};
  return color;
}

int64_t power(int64_t base, int exponent) {
  return exponent == 0 ? 1 : base * power(base, exponent - 1);
}

/// A box within the volume whose sides are at most `largest`.
Box random_box(std::mt19937_64& random, Index3 dims, int64_t largest) {
  Box box;
  for (int axis = 0; axis < 3; ++axis) {
    const int64_t side = std::uniform_int_distribution<int64_t>(1, std::min(largest, dims[axis]))(random);
    box.lo[axis] = std::uniform_int_distribution<int64_t>(0, dims[axis] - side)(random);
    box.hi[axis] = box.lo[axis] + side;
  }
  return box;
}

TEST(Menger, WholeVolumesEqualTheDefinition) {
  for (int level = 0; level <= 4; ++level) {
    const int64_t side = power(3, level);
    auto source = open("menger:" + std::to_string(level));
    ASSERT_EQ(source->info().dims, Index3(side));
    ASSERT_EQ(source->info().format, VoxelFormat::rgba32);
    const std::vector<Voxel> voxels = read_box(*source, source->info().box());
    int64_t solid = 0;
    size_t i = 0;
    for (int64_t z = 0; z < side; ++z)
      for (int64_t y = 0; y < side; ++y)
        for (int64_t x = 0; x < side; ++x, ++i) {
          ASSERT_EQ(voxels[i], menger_voxel(level, side, {x, y, z})) << x << " " << y << " " << z;
          solid += voxels[i].bytes[3] != std::byte{0};
        }
    EXPECT_EQ(solid, power(20, level));
  }
}

TEST(Menger, BoxesOfLargeVolumesEqualTheDefinition) {
  std::mt19937_64 random(1);
  for (const int level : {7, 12, 13}) {
    const int64_t side = power(3, level);
    auto source = open("menger:" + std::to_string(level));
    ASSERT_EQ(source->info().dims, Index3(side));
    for (int n = 0; n < 200; ++n) {
      const Box box = random_box(random, Index3(side), 20);
      const std::vector<Voxel> voxels = read_box(*source, box);
      size_t i = 0;
      for (int64_t z = box.lo.z; z < box.hi.z; ++z)
        for (int64_t y = box.lo.y; y < box.hi.y; ++y)
          for (int64_t x = box.lo.x; x < box.hi.x; ++x)
            ASSERT_EQ(voxels[i++], menger_voxel(level, side, {x, y, z}))
                << level << ": " << x << " " << y << " " << z;
    }
  }
}

TEST(Menger, KnowsItsHoles) {
  auto source = open("menger:12");
  const int64_t third = power(3, 11);
  EXPECT_EQ(source->uniform({Index3(third), Index3(2 * third)}), Voxel{});
  EXPECT_EQ(source->uniform({{third, third, 0}, {2 * third, 2 * third, 3 * third}}), Voxel{});
  EXPECT_EQ(source->uniform({{third, 7, third + 5}, {2 * third, 8, third + 6}}), Voxel{});
  EXPECT_EQ(source->uniform({{third - 1, third, 0}, {2 * third, 2 * third, 1}}), std::nullopt);
  EXPECT_EQ(source->uniform({{third, third, 0}, {2 * third, 2 * third + 1, 1}}), std::nullopt);
  EXPECT_EQ(source->uniform(source->info().box()), std::nullopt);
  EXPECT_EQ(source->uniform({{5, 5, 5}, {5, 6, 6}}), std::nullopt);  // an empty box
}

/// Whatever `uniform` says must be so; returns how many boxes it knew.
int check_uniform(VolumeSource& source, int boxes, int64_t largest) {
  std::mt19937_64 random(2);
  int known = 0;
  for (int n = 0; n < boxes; ++n) {
    const Box box = random_box(random, source.info().dims, largest);
    const std::optional<Voxel> value = source.uniform(box);
    if (!value) continue;
    ++known;
    for (const Voxel& v : read_box(source, box)) EXPECT_EQ(v, *value);
  }
  return known;
}

TEST(Menger, UniformIsNeverWrong) {
  for (const int level : {0, 1, 2, 3, 4, 8}) {
    auto source = open("menger:" + std::to_string(level));
    EXPECT_GT(check_uniform(*source, 3000, 12), 0);
    for (const Voxel& v : read_box(*source, {Index3(0), Index3(1)})) {
      EXPECT_EQ(source->uniform({Index3(0), Index3(1)}), v);
    }
  }
}

TEST(Menger, EveryHoleOfTheThirdLevelIsKnown) {
  auto source = open("menger:3");
  for (int64_t block = 1; block <= 9; block *= 3)
    for (int64_t z = 0; z < 27; z += block)
      for (int64_t y = 0; y < 27; y += block)
        for (int64_t x = 0; x < 27; x += block) {
          const Box box{{x, y, z}, Index3(x, y, z) + block};
          const bool hole =
              menger_voxel(3, 27, box.lo) == Voxel{} && menger_voxel(3, 27, box.hi - int64_t{1}) == Voxel{};
          EXPECT_EQ(source->uniform(box) == Voxel{}, hole) << x << " " << y << " " << z << " block " << block;
        }
}

/// The formula of the paper with the system's functions.
double plain_marschner_lobb(double x, double y, double z) {
  using std::numbers::pi;
  const double rho_r = std::cos(2 * pi * 6 * std::cos(pi * std::hypot(x, y) / 2));
  return (1 - std::sin(pi * z / 2) + 0.25 * (1 + rho_r)) / (2 * (1 + 0.25));
}

TEST(MarschnerLobb, EqualsTheFormulaAndItsDifferences) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int n = 0; n < 20000; ++n) {
    const double x = uniform(random), y = uniform(random), z = uniform(random), h = 1e-5;
    const double value = marschner_lobb(x, y, z);
    ASSERT_NEAR(value, plain_marschner_lobb(x, y, z), 2e-14);
    ASSERT_GE(value, 0);
    ASSERT_LE(value, 1);
    const auto gradient = marschner_lobb_gradient(x, y, z);
    const std::array differences{(marschner_lobb(x + h, y, z) - marschner_lobb(x - h, y, z)) / (2 * h),
                                 (marschner_lobb(x, y + h, z) - marschner_lobb(x, y - h, z)) / (2 * h),
                                 (marschner_lobb(x, y, z + h) - marschner_lobb(x, y, z - h)) / (2 * h)};
    for (size_t axis = 0; axis < 3; ++axis) ASSERT_NEAR(gradient[axis], differences[axis], 1e-5);
  }
  const auto axis = marschner_lobb_gradient(0, 0, 0);
  EXPECT_EQ(axis[0], 0);
  EXPECT_EQ(axis[1], 0);
  EXPECT_NEAR(axis[2], -std::numbers::pi / 5, 1e-15);
}

TEST(MarschnerLobb, SamplesTheSignal) {
  auto source = open("marschner-lobb:31");
  const VolumeInfo& info = source->info();
  ASSERT_EQ(info.format, VoxelFormat::density16);
  const auto voxels = test::read_all<uint16_t>(*source);
  size_t i = 0;
  for (int z = 0; z < 31; ++z)
    for (int y = 0; y < 31; ++y)
      for (int x = 0; x < 31; ++x) {
        const auto at = [&](int k, size_t axis) {
          return info.affine.origin[axis] + k * info.affine.spacing()[axis];
        };
        const double rho = plain_marschner_lobb(at(x, 0), at(y, 1), at(z, 2));
        ASSERT_NEAR(info.slope * voxels[i++] + info.intercept, rho, 0.5000001 / 65535);
      }
  EXPECT_EQ(voxels[15 + 31 * 15], 65535);  // (0, 0, -1): the maximum
  EXPECT_EQ(open("marschner-lobb:2")->info().affine.spacing()[0], 2);
}

TEST(Sphere, EqualsTheDefinition) {
  for (const int64_t side : {1, 2, 3, 5, 10, 31, 64}) {
    auto source = open("sphere:" + std::to_string(side));
    const auto voxels = test::read_all<uint8_t>(*source);
    size_t i = 0;
    for (int64_t z = 0; z < side; ++z)
      for (int64_t y = 0; y < side; ++y)
        for (int64_t x = 0; x < side; ++x) {
          const auto offset = [&](int64_t v) { return static_cast<long double>(2 * v + 1 - side) / 2; };
          const long double d =
              std::sqrt(offset(x) * offset(x) + offset(y) * offset(y) + offset(z) * offset(z));
          const long double cover =
              std::min(1.0L, std::max(0.0L, 0.5L + 0.4L * static_cast<long double>(side) - d));
          ASSERT_NEAR(static_cast<double>(voxels[i++]), static_cast<double>(255 * cover), 0.5001)
              << side << ": " << x << " " << y << " " << z;
        }
  }
}

TEST(Sphere, UniformIsNeverWrong) {
  for (const char* name : {"sphere:1", "sphere:2", "sphere:9", "sphere:64"}) {
    EXPECT_GT(check_uniform(*open(name), 5000, 20), 0);
  }
  auto source = open("sphere:1000000");
  EXPECT_EQ(source->uniform({Index3(400000), Index3(600000)}), Voxel::of(uint8_t{255}));
  EXPECT_EQ(source->uniform({Index3(0), Index3(200000)}), Voxel{});
  EXPECT_EQ(source->uniform({Index3(0), Index3(500000)}), std::nullopt);
}

TEST(Sphere, LargestIsExactAtItsSurface) {
  auto source = open("sphere:1664510");
  // Along the axis the distance is whole or half, and R = 665804: voxel centre 832255.5 + n is n + 0.5 away
  // (in x) and half a voxel off in y and z, which bends the distance by less than a thousandth of a grey
  // level.
  const int64_t middle = 832255, edge = middle + 665804;
  const std::vector<Voxel> voxels =
      read_box(*source, {{edge - 2, middle, middle}, {edge + 2, middle + 1, middle + 1}});
  ASSERT_EQ(voxels.size(), 4u);
  EXPECT_EQ(voxels[0].as<uint8_t>(), 255);
  EXPECT_EQ(voxels[1].as<uint8_t>(), 255);
  EXPECT_EQ(voxels[2].as<uint8_t>(), 0);
  EXPECT_EQ(voxels[3].as<uint8_t>(), 0);
}

TEST(Noise, IsUniformAndIndependent) {
  auto source = open("noise:101:5");
  const auto voxels = test::read_all<uint8_t>(*source);
  std::array<int64_t, 256> counts{};
  for (const uint8_t v : voxels) ++counts[v];
  const double expected = static_cast<double>(voxels.size()) / 256;
  double chi_square = 0;
  for (const int64_t count : counts)
    chi_square += std::pow(static_cast<double>(count) - expected, 2) / expected;
  EXPECT_GT(chi_square, 160);  // 255 degrees of freedom, deviation 22.6
  EXPECT_LT(chi_square, 355);
  for (const size_t lag : {1, 7, 8, 101, 101 * 101}) {
    double sum = 0;
    for (size_t i = lag; i < voxels.size(); ++i) sum += (voxels[i] - 127.5) * (voxels[i - lag] - 127.5);
    EXPECT_LT(std::abs(sum / static_cast<double>(voxels.size()) / (65535.0 / 12)), 0.005) << lag;
  }
  const auto other = test::read_all<uint8_t>(*open("noise:101:6"));
  int64_t same = 0;
  for (size_t i = 0; i < voxels.size(); ++i) same += voxels[i] == other[i];
  EXPECT_NEAR(static_cast<double>(same), expected, 6 * std::sqrt(expected));
}

TEST(Membrane, LooksLikeSectionsOfTissue) {
  auto source = open("membrane:300,200,12:9");
  EXPECT_EQ(source->info().dims, Index3(300, 200, 12));
  const auto voxels = test::read_all<uint8_t>(*source);
  const size_t slice = 300 * 200;
  double dark = 0, bright = 0, near = 0, far = 0, fine = 0;
  for (size_t i = 0; i < voxels.size(); ++i) {
    dark += voxels[i] < 90;
    bright += voxels[i] > 140;
    if (i % 300 > 1) fine += std::abs(voxels[i] - 2 * voxels[i - 1] + voxels[i - 2]);
    if (i >= slice) near += std::abs(voxels[i] - voxels[i - slice]);
    if (i >= 10 * slice) far += std::abs(voxels[i] - voxels[i - 10 * slice]);
  }
  const auto count = static_cast<double>(voxels.size());
  EXPECT_GT(dark / count, 0.05);
  EXPECT_LT(dark / count, 0.4);
  EXPECT_GT(bright / count, 0.5);
  EXPECT_LT(near / (11.0 / 12 * count), 0.5 * far / (2.0 / 12 * count));  // sections change slowly
  EXPECT_GT(fine / count, 3);                                             // noise
  EXPECT_LT(fine / count, 15);
  EXPECT_NE(voxels, test::read_all<uint8_t>(*open("membrane:300,200,12:10")));
}

TEST(Builtin, CellsAreThoseOfTheirPoints) {
  auto source = open("cells:40:30");
  const VolumeInfo& info = source->info();
  EXPECT_TRUE(info.is_labels);
  ASSERT_TRUE(info.labels);
  ASSERT_EQ(info.labels->size(), 30u);
  EXPECT_TRUE(std::ranges::is_sorted(*info.labels, std::less_equal()));
  EXPECT_GT(info.labels->back() - info.labels->front(), 65536);
  const auto voxels = test::read_all<uint8_t>(*source);
  // Cells are convex: between two voxels of one there is no other, but for what rounding makes of it.
  std::mt19937 random(5);
  std::array<int, 30> found{};
  for (const uint8_t v : voxels) ++found[v];
  EXPECT_TRUE(std::ranges::all_of(found, [](int n) { return n > 0; }));
  const auto at = [&](Index3 p) { return voxels[static_cast<size_t>((p.z * 40 + p.y) * 40 + p.x)]; };
  for (int n = 0; n < 20000; ++n) {
    const auto any = [&] { return static_cast<int64_t>(random() % 20) * 2; };
    const Index3 a(any(), any(), any()), b(any(), any(), any());
    if (at(a) == at(b)) {
      ASSERT_EQ(at((a + b) / int64_t{2}), at(a));
    }
  }
  EXPECT_EQ(open("cells:9:257")->info().format, VoxelFormat::density16);
}

TEST(Builtin, BoxesAreSubBoxesOfTheWhole) {
  std::mt19937_64 random(4);
  for (const char* name : {"menger:3", "marschner-lobb:37", "sphere:41", "noise:43:7", "membrane:700,70,9:3",
                           "membrane:1,1,1:0", "cells:45:60", "cells:3:400"}) {
    auto source = open(name);
    const Index3 dims = source->info().dims;
    const std::vector<Voxel> whole = read_box(*source, source->info().box());
    EXPECT_FALSE(source->forward_only());
    for (int n = 0; n < 60; ++n) {
      const Box box = random_box(random, dims, n < 30 ? 9 : 700);
      const std::vector<Voxel> part = read_box(*source, box);
      size_t i = 0;
      for (int64_t z = box.lo.z; z < box.hi.z; ++z)
        for (int64_t y = box.lo.y; y < box.hi.y; ++y)
          for (int64_t x = box.lo.x; x < box.hi.x; ++x)
            ASSERT_EQ(part[i++], whole[static_cast<size_t>((z * dims.y + y) * dims.x + x)])
                << name << " " << x << " " << y << " " << z;
    }
  }
}

TEST(Builtin, LargestVolumesCanBeReadAnywhere) {
  for (const char* name :
       {"menger:13", "marschner-lobb:1664510", "sphere:1664510", "noise:1664510:18446744073709551615",
        "membrane:2147483648,1024,2097152:18446744073709551615", "membrane:1,2147483648,2147483648:0",
        "cells:1664510:65536"}) {
    auto source = open(name);
    ASSERT_TRUE(source) << name;
    const Index3 dims = source->info().dims;
    const Index3 size(std::min<int64_t>(dims.x, 9), 3, 2);
    EXPECT_EQ(read_box(*source, {dims - size, dims}).size(), static_cast<size_t>(size.x * size.y * size.z));
    EXPECT_NE(source->uniform({Index3(0), dims}), Voxel::of(uint8_t{255}));
  }
}

// These sums must never change, on any compiler or machine: files and results are compared by them.
TEST(Builtin, VoxelsAreTheSameEverywhere) {
  const auto sum = [](const char* name) {
    auto source = open(name);
    const auto bytes = test::read_all<uint8_t>(*source);
    uint64_t fnv = 0xcbf29ce484222325;
    for (const uint8_t b : bytes) fnv = (fnv ^ b) * 0x100000001b3;
    return fnv;
  };
  EXPECT_EQ(sum("menger:4"), 0x9dd51327d8c5df55u);
  EXPECT_EQ(sum("marschner-lobb:64"), 0x9b465a74928791ddu);
  EXPECT_EQ(sum("sphere:64"), 0x383edad0264bb0fdu);
  EXPECT_EQ(sum("noise:64:1"), 0x3c7c808e506fa0ccu);
  EXPECT_EQ(sum("membrane:600,64,40:1"), 0x8e6d998fe30e68abu);
  EXPECT_EQ(sum("cells:50:300"), 0xf4eb940f20bdd7e3u);
}

TEST(Builtin, MalformedNamesAreUsageErrors) {
  for (const char* name : {"menger:",
                           "menger:x",
                           "menger:14",
                           "menger:-1",
                           "menger:+1",
                           "menger: 1",
                           "menger:1 ",
                           "menger:1.5",
                           "menger:5:1",
                           "menger:99999999999999999999",
                           "menger:18446744073709551616",
                           "marschner-lobb:1",
                           "marschner-lobb:0",
                           "marschner-lobb:1664511",
                           "sphere:0",
                           "sphere:99999999999",
                           "sphere:",
                           "noise:5",
                           "noise:5:",
                           "noise:5:-1",
                           "noise::1",
                           "noise:0:1",
                           "noise:5:1:2",
                           "noise:5:18446744073709551616",
                           "noise:1664511:1",
                           "membrane:1,2:3",
                           "membrane:1,2,3",
                           "membrane:0,2,3:1",
                           "membrane:1,2,2147483649:1",
                           "membrane:2147483648,2147483648,2:1",
                           "cells:0:1",
                           "cells:5:0",
                           "cells:5:65537",
                           "cells:5",
                           "membrane:1:2:3:4",
                           "membrane:1,2,3,4:1"}) {
    EXPECT_TRUE(is_builtin(name)) << name;
    const auto source = open_builtin(name);
    ASSERT_FALSE(source) << name;
    EXPECT_EQ(source.error().code, ErrorCode::usage);
    const std::string form = std::string(name).substr(0, std::string(name).find(':')) + ":";
    EXPECT_NE(source.error().what.find("expected " + form), std::string::npos) << source.error().what;
  }
}

TEST(Builtin, OtherNamesAreNotBuiltIns) {
  for (const char* name :
       {"", ":", "menger", "Menger:3", "menger3", "file.nrrd", "./menger:3", "terrain:5"}) {
    EXPECT_FALSE(is_builtin(name)) << name;
    EXPECT_FALSE(open_builtin(name)) << name;
  }
}

}  // namespace
}  // namespace voxkit
