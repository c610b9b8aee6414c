// Volumes with a formula: the Marschner-Lobb signal and a ball.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <vector>

#include "formats/volume/builtin.h"

namespace voxkit {
namespace {

constexpr double frequency = 6;  // f_M
constexpr double alpha = 0.25;   // weight of the radial part
using std::numbers::pi;

struct SineCosine {
  double sine, cosine;
};

/// sin and cos of 2 pi t, |t| < 2^31, within 1e-15. Taylor series to the accuracy of a double on an eighth of
/// a turn, in basic operations only, which IEEE 754 defines to the last bit; the reduction of t is exact.
SineCosine turn(double t) {
  const double quarters = std::floor(4 * t + 0.5);
  const double angle = 2 * pi * (t - 0.25 * quarters);
  const double q = angle * angle;
  double sine = 0, cosine = 0;
  for (int n = 16; n >= 2;
       n -= 2) {  // Horner's scheme over 1 - q/(2 3) (1 - q/(4 5) (… and 1 - q/(1 2) (1 - q/(3 4) (…
    sine = (1 + sine) * -q * (1.0 / (n * (n + 1)));
    cosine = (1 + cosine) * -q * (1.0 / (n * (n - 1)));
  }
  sine = angle + angle * sine;
  cosine = 1 + cosine;
  switch (static_cast<int64_t>(quarters) & 3) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

/// rho = radial_part + axial_part.
double radial_part(double x, double y) {
  const double r = std::sqrt(x * x + y * y);
  return alpha * (1 + turn(frequency * turn(r / 4).cosine).cosine) / (2 * (1 + alpha));
}
double axial_part(double z) {
  return (1 - turn(z / 4).sine) / (2 * (1 + alpha));
}

class MarschnerLobbSource final : public VolumeSource {
 public:
  explicit MarschnerLobbSource(int64_t side) {
    info_.dims = Index3(side);
    info_.format = VoxelFormat::density16;
    info_.sample_type = SampleType::u16;
    info_.slope = 1.0 / 65535;
    const double step = 2 / static_cast<double>(side - 1);
    info_.affine = Affine::plain({step, step, step}, {-1, -1, -1});
  }

  Status read(const Box& box, VoxelSpan out) override {
    // The radial part costs most and is the same for all z, so z runs inside y.
    std::vector<double> radial(static_cast<size_t>(box.size().x));
    for (int64_t y = box.lo.y; y < box.hi.y; ++y) {
      for (int64_t x = box.lo.x; x < box.hi.x; ++x) {
        radial[static_cast<size_t>(x - box.lo.x)] = radial_part(coordinate(x), coordinate(y));
      }
      for (int64_t z = box.lo.z; z < box.hi.z; ++z) {
        const double axial = axial_part(coordinate(z));
        std::byte* row = out.row(y - box.lo.y, z - box.lo.z);
        for (const double r : radial) {
          const auto value = static_cast<uint16_t>(static_cast<int32_t>(65535 * (r + axial) + 0.5));
          std::memcpy(row, &value, sizeof value);
          row += sizeof value;
        }
      }
    }
    return {};
  }

 private:
  double coordinate(int64_t i) const {
    return static_cast<double>(2 * i - (info_.dims.x - 1)) / static_cast<double>(info_.dims.x - 1);
  }
};

int64_t floor_sqrt(int64_t n) {
  auto root = static_cast<int64_t>(std::sqrt(static_cast<double>(n)));
  while (root * root > n) --root;
  while ((root + 1) * (root + 1) <= n) ++root;
  return root;
}

/// With p = 2 v + 1 - N (an odd or even whole number on each axis) the distance of a voxel from the centre is
/// sqrt(S) / 2, S = |p|^2, and its value is floor((256 + 204 N - 255 sqrt(S)) / 2), held to 0 … 255. All
/// comparisons with sqrt(S) are made between squares: 65025 S < 2^63 for every N whose cube fits 62 bits.
class SphereSource final : public VolumeSource {
 public:
  explicit SphereSource(int64_t side) {
    info_.dims = Index3(side);
    info_.format = VoxelFormat::density8;
    const int64_t inner = 204 * side - 254, outer = 204 * side + 254;
    inside_ = inner < 0 ? -1 : inner * inner / 65025;
    surface_ = outer * outer / 65025;
  }

  Status read(const Box& box, VoxelSpan out) override {
    for (int64_t z = box.lo.z; z < box.hi.z; ++z) {
      for (int64_t y = box.lo.y; y < box.hi.y; ++y) {
        write_row(box.lo.x, box.hi.x, square(y) + square(z), out.row(y - box.lo.y, z - box.lo.z));
      }
    }
    return {};
  }

  std::optional<Voxel> uniform(const Box& box) const override {
    if (box.empty()) return std::nullopt;
    int64_t nearest = 0, farthest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const int64_t first = centred(box.lo[axis]), last = centred(box.hi[axis] - 1);
      farthest += std::max(first * first, last * last);
      // Where the range reaches across the centre the least |p| is 0, or 1 for an even side.
      const int64_t least = first > 0 ? first : last < 0 ? -last : (info_.dims.x + 1) % 2;
      nearest += least * least;
    }
    if (farthest <= inside_) return Voxel::of(uint8_t{255});
    if (nearest > surface_) return Voxel{};
    if (box.voxels() == 1) return Voxel::of(value(nearest));
    return std::nullopt;
  }

 private:
  int64_t centred(int64_t i) const { return 2 * i + 1 - info_.dims.x; }
  int64_t square(int64_t i) const { return centred(i) * centred(i); }

  uint8_t value(int64_t s) const {
    if (s <= inside_) return 255;
    if (s > surface_) return 0;
    // The greatest k with 2 k <= top - 255 sqrt(s): a guess in floating point, put right in whole numbers.
    const int64_t top = 256 + 204 * info_.dims.x;
    auto k = static_cast<int64_t>((static_cast<double>(top) - 255 * std::sqrt(static_cast<double>(s))) / 2);
    const auto reached = [&](int64_t v) {
      return top >= 2 * v && (top - 2 * v) * (top - 2 * v) >= 65025 * s;
    };
    while (!reached(k)) --k;
    while (reached(k + 1)) ++k;
    return static_cast<uint8_t>(std::clamp<int64_t>(k, 0, 255));
  }

  /// The coordinates with centred(x)^2 <= s as a half-open range within lo .. hi.
  std::pair<int64_t, int64_t> chord(int64_t s, int64_t lo, int64_t hi) const {
    if (s < 0) return {hi, hi};
    const int64_t root = floor_sqrt(s), side = info_.dims.x;
    const int64_t first =
        std::clamp((side - 1 - root + 1) >> 1, lo, hi);  // least x with 2 x + 1 - N >= -root
    return {first, std::clamp(((side - 1 + root) >> 1) + 1, first, hi)};
  }

  void write_row(int64_t lo, int64_t hi, int64_t yz, std::byte* row) const {
    auto [shell_lo, shell_hi] = chord(surface_ - yz, lo, hi);
    auto [core_lo, core_hi] = chord(inside_ - yz, lo, hi);
    if (core_lo == core_hi) core_lo = core_hi = shell_hi;
    const auto set = [&](int64_t from, int64_t to, int v) {
      std::memset(row + (from - lo), v, static_cast<size_t>(to - from));
    };
    const auto compute = [&](int64_t from, int64_t to) {
      for (int64_t x = from; x < to; ++x) row[x - lo] = std::byte{value(square(x) + yz)};
    };
    set(lo, shell_lo, 0);
    compute(shell_lo, core_lo);
    set(core_lo, core_hi, 255);
    compute(core_hi, shell_hi);
    set(shell_hi, hi, 0);
  }

  int64_t inside_;   ///< greatest S of value 255; -1 for none
  int64_t surface_;  ///< greatest S of a value above 0
};

}  // namespace

double marschner_lobb(double x, double y, double z) {
  return radial_part(x, y) + axial_part(z);
}

std::array<double, 3> marschner_lobb_gradient(double x, double y, double z) {
  const double r = std::sqrt(x * x + y * y);
  const SineCosine ring = turn(r / 4);
  const double slope = turn(frequency * ring.cosine).sine * 2 * pi * frequency * ring.sine * pi / 2;
  const double radial = r > 0 ? alpha * slope / (2 * (1 + alpha)) / r : 0;
  return {radial * x, radial * y, -turn(z / 4).cosine * pi / 2 / (2 * (1 + alpha))};
}

std::unique_ptr<VolumeSource> marschner_lobb_source(int64_t side) {
  return std::make_unique<MarschnerLobbSource>(side);
}
std::unique_ptr<VolumeSource> sphere_source(int64_t side) {
  return std::make_unique<SphereSource>(side);
}

}  // namespace voxkit
