// Microscopy-like volumes: cells divided by membranes, from smooth random fields.
//
// A cell is where one of five smooth fields exceeds the four others, a membrane where the two greatest are
// nearly equal: so membranes are curved sheets that meet in threes along lines, as in tissue. Fields are
// cubic B-splines over random lattice values, summed up axis by axis: z and y once for a lattice column, x
// for every voxel.
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "formats/hash.h"
#include "formats/volume/builtin.h"

namespace voxkit {
namespace {

constexpr int tile_x = 512,
              tile_y = 16;  // voxels computed together; multiples of, and of 16 at most, the spacings
constexpr int grain = 64;   // tiles start at multiples of this, the widest spacing
constexpr int max_fields = 7;
using Columns = std::array<float, max_fields>;
using FieldRow = std::array<float, tile_x>;

/// Weights of the four lattice values around a point, at `Spacing` places between two of them.
template <int Spacing>
constexpr std::array<std::array<float, Spacing>, 4> spline_weights() {
  std::array<std::array<float, Spacing>, 4> w{};
  for (int i = 0; i < Spacing; ++i) {
    const double t = (i + 0.5) / Spacing, u = 1 - t;
    const auto at = static_cast<size_t>(i);
    w[0][at] = static_cast<float>(u * u * u / 6);
    w[1][at] = static_cast<float>(2.0 / 3 - t * t * (2 - t) / 2);
    w[2][at] = static_cast<float>(2.0 / 3 - u * u * (2 - u) / 2);
    w[3][at] = static_cast<float>(t * t * t / 6);
  }
  return w;
}

/// `Fields` random fields with lattice points every `Spacing` voxels in x and y and every `SpacingZ` in z,
/// values about -0.5 … 0.5.
template <int Fields, int Spacing, int SpacingZ>
class Layer {
  static_assert(Fields <= max_fields && grain % Spacing == 0);

 public:
  explicit Layer(uint64_t key) : key_(key) {}

  /// Prepares slice z of the columns that the tile at (x0, y0) needs, x0 a multiple of grain and y0 of
  /// tile_y.
  void start_tile(int64_t x0, int64_t y0, int64_t z, int64_t width) {
    columns_ = static_cast<int>((width + Spacing - 1) / Spacing) + 3;
    first_row_ = y0 / Spacing;
    const auto phase = static_cast<size_t>(z % SpacingZ);
    for (int j = 0; j < rows; ++j) {
      for (int i = 0; i < columns_; ++i) at(j, i).fill(0);
      for (int k = 0; k < 4; ++k) {
        const uint64_t row_key = random64(random64(key_, static_cast<uint64_t>(z / SpacingZ + k)),
                                          static_cast<uint64_t>(first_row_ + j));
        const float weight = weights_z[static_cast<size_t>(k)][phase];
        for (int i = 0; i < columns_; ++i) {
          const uint64_t random = random64(row_key, static_cast<uint64_t>(x0 / Spacing + i));
          for (size_t f = 0; f < Fields; ++f) {
            at(j, i)[f] += weight * (static_cast<float>((random >> (8 * f)) & 255) - 127.5f) / 255;
          }
        }
      }
    }
  }

  /// Adds gain times each field, along row y of the tile, to rows[0] … rows[Fields - 1].
  void add_row(int64_t y, float gain, FieldRow* fields) const {
    std::array<Columns, tile_x / Spacing + 3> line;
    const auto phase = static_cast<size_t>(y % Spacing);
    const int j = static_cast<int>(y / Spacing - first_row_);
    for (int i = 0; i < columns_; ++i) {
      for (size_t f = 0; f < Fields; ++f) {
        line[static_cast<size_t>(i)][f] =
            gain * ((weights[0][phase] * at(j, i)[f] + weights[1][phase] * at(j + 1, i)[f]) +
                    (weights[2][phase] * at(j + 2, i)[f] + weights[3][phase] * at(j + 3, i)[f]));
      }
    }
    for (size_t f = 0; f < Fields; ++f) {
      for (int i = 0; i + 3 < columns_; ++i) {
        const Columns* const c = line.data() + i;
        const float c0 = c[0][f], c1 = c[1][f], c2 = c[2][f], c3 = c[3][f];
        float* const to = fields[f].data() + i * Spacing;
        for (size_t t = 0; t < Spacing; ++t) {
          to[t] += (weights[0][t] * c0 + weights[1][t] * c1) + (weights[2][t] * c2 + weights[3][t] * c3);
        }
      }
    }
  }

 private:
  static constexpr auto weights = spline_weights<Spacing>();
  static constexpr auto weights_z = spline_weights<SpacingZ>();
  static constexpr int rows = (tile_y - 1) / Spacing + 4;
  Columns& at(int j, int i) { return slice_[static_cast<size_t>(j)][static_cast<size_t>(i)]; }
  const Columns& at(int j, int i) const { return slice_[static_cast<size_t>(j)][static_cast<size_t>(i)]; }

  uint64_t key_;
  int columns_ = 0;
  int64_t first_row_ = 0;
  std::array<std::array<Columns, tile_x / Spacing + 3>, rows> slice_;
};

/// Greys of one row from its fields: five cell fields, staining, organelles, grain of the plasma.
void shade(const std::array<FieldRow, 8>& fields, int width, float* __restrict grey) {
  for (size_t x = 0; x < static_cast<size_t>(width); ++x) {
    float first = fields[0][x], second = -1e9f;
    for (size_t f = 1; f < 5; ++f) {
      second = std::max(second, std::min(first, fields[f][x]));
      first = std::max(first, fields[f][x]);
    }
    const float membrane = std::max(0.0f, 1 - (first - second) * 40);
    const float organelle = std::clamp((fields[6][x] - 0.27f) * 25, 0.0f, 1.0f);
    const float plasma = 176 + 60 * fields[5][x] + 40 * first + 45 * fields[7][x] - 62 * organelle;
    grey[x] = plasma + (52 - plasma) * membrane * (2 - membrane);
  }
}

class MembraneSource final : public VolumeSource {
 public:
  MembraneSource(Index3 dims, uint64_t seed) : key_(mix64(seed)) {
    info_.dims = dims;
    info_.format = VoxelFormat::density8;
  }

  Status read(const Box& box, VoxelSpan out) override {
    Layer<7, 64, 32> coarse(random64(key_, 0));
    Layer<7, 16, 16> fine(random64(key_, 1));
    Layer<1, 4, 4> speckle(random64(key_, 2));
    std::array<FieldRow, 8> fields;
    FieldRow grey;
    for (int64_t z = box.lo.z; z < box.hi.z; ++z) {
      for (int64_t y0 = box.lo.y / tile_y * tile_y; y0 < box.hi.y; y0 += tile_y) {
        for (int64_t x0 = box.lo.x / grain * grain; x0 < box.hi.x; x0 += tile_x) {
          const int width = static_cast<int>(std::min<int64_t>(tile_x, box.hi.x - x0));
          coarse.start_tile(x0, y0, z, width);
          fine.start_tile(x0, y0, z, width);
          speckle.start_tile(x0, y0, z, width);
          for (int64_t y = std::max(y0, box.lo.y); y < std::min(y0 + tile_y, box.hi.y); ++y) {
            for (FieldRow& f : fields) f.fill(0);
            coarse.add_row(y, 1, fields.data());
            fine.add_row(y, 0.25f, fields.data());
            speckle.add_row(y, 1, fields.data() + 7);
            shade(fields, width, grey.data());
            const int64_t from = std::max(x0, box.lo.x);
            write_row(grey, x0, from, x0 + width, y, z,
                      out.row(y - box.lo.y, z - box.lo.z) + (from - box.lo.x));
          }
        }
      }
    }
    return {};
  }

 private:
  /// Greys of x = from … to of the tile at x0 with the noise of the sensor: triangular, deviation 3.3 grey
  /// levels.
  void write_row(const FieldRow& grey, int64_t x0, int64_t from, int64_t to, int64_t y, int64_t z,
                 std::byte* out) const {
    const uint64_t row_key = random64(random64(key_, static_cast<uint64_t>(z) + 3), static_cast<uint64_t>(y));
    uint64_t random = 0;
    for (int64_t x = from; x < to; ++x) {
      if (x % 8 == 0 || x == from) random = random64(row_key, static_cast<uint64_t>(x / 8));
      const auto bits = static_cast<int>(random >> (8 * (x % 8)));
      const int noise = (bits & 15) + (bits >> 4 & 15) - 15;
      const float value = grey[static_cast<size_t>(x - x0)] + 0.5f * static_cast<float>(noise) + 0.5f;
      *out++ = static_cast<std::byte>(static_cast<int>(std::clamp(value, 0.0f, 255.0f)));
    }
  }

  uint64_t key_;
};

}  // namespace

std::unique_ptr<VolumeSource> membrane_source(Index3 dims, uint64_t seed) {
  return std::make_unique<MembraneSource>(dims, seed);
}

}  // namespace voxkit
