// The codec by the book: one bit, one voxel, one brick after the other, from FORMAT.md and nothing else.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <optional>
#include <vector>

namespace voxkit::vq::reference {

using Brick = std::array<uint16_t, 64>;
using Bits = std::vector<bool>;

inline void put(Bits& bits, unsigned value, int count) {
  for (int i = 0; i < count; ++i) bits.push_back(value >> i & 1);
}
inline void align(Bits& bits) {
  while (bits.size() % 8 != 0) bits.push_back(false);
}
inline std::vector<uint8_t> bytes_of(const Bits& bits) {
  std::vector<uint8_t> bytes((bits.size() + 7) / 8);
  for (size_t i = 0; i < bits.size(); ++i)
    bytes[i / 8] = static_cast<uint8_t>(bytes[i / 8] | bits[i] << (i % 8));
  return bytes;
}
/// Bits that a number needs.
inline int width(unsigned value) {
  int bits = 0;
  while (value >> bits != 0) ++bits;
  return bits;
}

/// A voxel, zero outside the brick.
struct Voxels {
  const Brick& brick;
  int least;
  int operator()(int x, int y, int z) const {
    return x < 0 || y < 0 || z < 0 ? 0 : brick[static_cast<size_t>(x + 4 * y + 16 * z)] - least;
  }
};

inline int prediction(int transform, const Voxels& u, int x, int y, int z, int top) {
  if (transform == 0) return 0;
  if (transform == 1) return x > 0 ? u(x - 1, y, z) : y > 0 ? u(x, y - 1, z) : z > 0 ? u(x, y, z - 1) : 0;
  const auto plane = [&](int a, int b, int ab) { return std::clamp(a + b - ab, 0, top); };
  const int xy = plane(u(x - 1, y, z), u(x, y - 1, z), u(x - 1, y - 1, z));
  const int xz = plane(u(x - 1, y, z), u(x, y, z - 1), u(x - 1, y, z - 1));
  const int yz = plane(u(x, y - 1, z), u(x, y, z - 1), u(x, y - 1, z - 1));
  if (transform == 3 && z == 0) return xy;
  if (transform == 3 && y == 0) return xz;
  if (transform == 3 && x == 0) return yz;
  std::array<int, 3> sorted{xy, xz, yz};
  std::sort(sorted.begin(), sorted.end());
  return sorted[1];
}

/// The values that a voxel can have, in the order of their residuals.
inline std::vector<int> candidates(int transform, int predicted, int top) {
  std::vector<int> order;
  if (transform == 0) {
    for (int v = 0; v <= top; ++v) order.push_back(v);
    return order;
  }
  const int modulus = top + 1;
  for (int i = 0; static_cast<int>(order.size()) <= top; ++i) {  // 0, -1, +1, -2, +2 ...
    const int e = i % 2 ? -(i / 2 + 1) : i / 2;
    if (transform == 3) {
      if (predicted + e >= 0 && predicted + e <= top) order.push_back(predicted + e);
    } else {
      order.push_back(((predicted + e) % modulus + modulus) % modulus);
    }
  }
  return order;
}

inline int residual(int transform, int voxel, int predicted, int top) {
  const auto order = candidates(transform, predicted, top);
  return static_cast<int>(std::find(order.begin(), order.end(), voxel) - order.begin());
}

/// The codeword of a brick in one transform.
inline std::vector<uint8_t> codeword(const Brick& brick, int transform) {
  const int least = *std::min_element(brick.begin(), brick.end());
  const int top = *std::max_element(brick.begin(), brick.end()) - least;
  const Voxels u{brick, least};
  std::vector<std::vector<unsigned>> octants;
  for (int octant = 0; octant < 8; ++octant) {
    auto& values = octants.emplace_back();
    for (int i = 0; i < 8; ++i) {
      const int x = octant % 2 * 2 + i % 2, y = octant / 2 % 2 * 2 + i / 2 % 2, z = octant / 4 * 2 + i / 4;
      values.push_back(static_cast<unsigned>(
          residual(transform, u(x, y, z), prediction(transform, u, x, y, z, top), top)));
    }
  }
  std::vector<unsigned> widths;
  for (const auto& values : octants)
    widths.push_back(static_cast<unsigned>(width(*std::max_element(values.begin(), values.end()))));
  const int c2 = width(*std::max_element(widths.begin(), widths.end()));
  Bits bits;
  put(bits, static_cast<unsigned>(c2 | transform << 6), 8);
  for (const unsigned c1 : widths) put(bits, c1, c2);
  align(bits);
  for (size_t octant = 0; octant < 8; ++octant) {
    for (const unsigned value : octants[octant]) put(bits, value, static_cast<int>(widths[octant]));
    align(bits);
  }
  return bytes_of(bits);
}

/// The shortest; of equals that of the first transform.
inline std::vector<uint8_t> codeword(const Brick& brick) {
  std::vector<uint8_t> best = codeword(brick, 0);
  for (int transform = 1; transform < 4; ++transform) {
    auto other = codeword(brick, transform);
    if (other.size() < best.size()) best = std::move(other);
  }
  return best;
}

/// A brick from a codeword of a brick with this range; nothing if it is not valid. `bits`: of plain codes.
inline std::optional<Brick> decode(const std::vector<uint8_t>& bytes, int least, int greatest, int bits) {
  size_t at = 0;  // in bits
  const auto take = [&](int count) -> std::optional<unsigned> {
    if (at + static_cast<size_t>(count) > 8 * bytes.size()) return std::nullopt;
    unsigned value = 0;
    for (int i = 0; i < count; ++i, ++at) value |= (bytes[at / 8] >> (at % 8) & 1u) << i;
    return value;
  };
  const auto head = take(8);
  if (!head) return std::nullopt;
  Brick brick{};
  if (*head == 255) {
    for (uint16_t& voxel : brick) {
      const auto value = take(bits);
      if (!value || static_cast<int>(*value) < least || static_cast<int>(*value) > greatest)
        return std::nullopt;
      voxel = static_cast<uint16_t>(*value);
    }
    return brick;
  }
  const int top = greatest - least, c2 = static_cast<int>(*head & 63),
            transform = static_cast<int>(*head >> 6);
  if (c2 > 5) return std::nullopt;
  std::array<int, 8> widths{};
  for (int& c1 : widths) {
    const auto value = take(c2);
    if (!value || *value > 16) return std::nullopt;
    c1 = static_cast<int>(*value);
  }
  at = (at + 7) / 8 * 8;
  std::array<int, 64> residuals{};
  for (size_t octant = 0; octant < 8; ++octant) {
    for (size_t i = 0; i < 8; ++i) {
      const auto value = take(widths[octant]);
      if (!value || static_cast<int>(*value) > top) return std::nullopt;
      const size_t x = octant % 2 * 2 + i % 2, y = octant / 2 % 2 * 2 + i / 2 % 2, z = octant / 4 * 2 + i / 4;
      residuals[x + 4 * y + 16 * z] = static_cast<int>(*value);
    }
    at = (at + 7) / 8 * 8;
  }
  const Voxels u{brick, least};
  for (int z = 0; z < 4; ++z)
    for (int y = 0; y < 4; ++y)
      for (int x = 0; x < 4; ++x) {
        const auto i = static_cast<size_t>(x + 4 * y + 16 * z);
        const int predicted = prediction(transform, u, x, y, z, top);
        brick[i] = static_cast<uint16_t>(
            least + candidates(transform, predicted, top)[static_cast<size_t>(residuals[i])]);
      }
  return brick;
}

/// The bricks of a volume of codes, and how often each occurs; the volume's last voxels are repeated.
inline std::map<Brick, uint64_t> bricks_of(const std::vector<uint16_t>& codes, int x_size, int y_size,
                                           int z_size) {
  std::map<Brick, uint64_t> bricks;
  for (int z = 0; z < z_size; z += 4)
    for (int y = 0; y < y_size; y += 4)
      for (int x = 0; x < x_size; x += 4) {
        Brick brick;
        for (int i = 0; i < 64; ++i) {
          const int vx = std::min(x + i % 4, x_size - 1), vy = std::min(y + i / 4 % 4, y_size - 1),
                    vz = std::min(z + i / 16, z_size - 1);
          brick[static_cast<size_t>(i)] = codes[static_cast<size_t>((vz * y_size + vy) * x_size + vx)];
        }
        ++bricks[brick];
      }
  return bricks;
}

}  // namespace voxkit::vq::reference
