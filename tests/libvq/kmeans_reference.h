// K-means by the book: Algorithms 1 to 4 of Guthe and Goesele 2016, section 4, one brick and one centre after
// the other, in exact numbers. Where the paper leaves something open or is misprinted:
//
// 1  Norms are compared without rounding their roots.
// 2  Brought up to date is a codeword that has taken all centres into account (printed: k). One that is
// promoted
//    has distance 0 and takes part no more. It ends when the furthest is at 0. Ties: the first codeword.
// 3  The distance is passed, and the new one is stored.
// 4  An empty cluster gets the codeword of the greatest weighted error that is not alone in its cluster;
// means
//    are rounded, halves up; a codeword leaves its centre only for a nearer one, the first of those.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <set>
#include <span>
#include <tuple>
#include <vector>

namespace voxkit::vq::reference {

using Codeword = std::array<uint16_t, 64>;
using Wide = unsigned __int128;

inline uint64_t dot(const Codeword& a, const Codeword& b) {
  uint64_t sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += uint64_t{a[i]} * b[i];
  return sum;
}
inline constexpr uint64_t infinite = ~uint64_t{0};

/// Algorithm 1.
inline uint64_t distance_s(uint64_t most, const Codeword& a, const Codeword& b) {
  // (|a| - |b|)^2 >= most, that is, aa + bb - most >= 2 |a| |b|.
  const auto aa = static_cast<__int128>(dot(a, a)), bb = static_cast<__int128>(dot(b, b));
  if (most != infinite) {
    const __int128 left = aa + bb - static_cast<__int128>(most);
    if (left >= 0 && left * left >= 4 * aa * bb) return most;
  }
  return dot(a, a) + dot(b, b) - 2 * dot(a, b);
}

struct Clusters {
  std::vector<Codeword> centres;
  std::vector<uint32_t> centre;    // of each codeword
  std::vector<uint64_t> distance;  // p, squared
  uint32_t iterations = 0;
  uint32_t filled = 0;  // empty clusters
};

/// Algorithm 2.
inline Clusters furthest_first(std::span<const Codeword> codebook, uint32_t k) {
  const size_t n = codebook.size();
  Clusters c{{}, std::vector<uint32_t>(n), std::vector<uint64_t>(n)};
  size_t closest = 0;
  for (size_t i = 1; i < n; ++i)
    if (dot(codebook[i], codebook[i]) < dot(codebook[closest], codebook[closest])) closest = i;
  c.centres.push_back(codebook[closest]);
  std::vector<size_t> eval(n, 1);
  struct Later {  // the furthest comes first, of those the first codeword
    bool operator()(const std::pair<uint64_t, size_t>& a, const std::pair<uint64_t, size_t>& b) const {
      return a.first != b.first ? a.first > b.first : a.second < b.second;
    }
  };
  std::set<std::pair<uint64_t, size_t>, Later> queue;
  for (size_t i = 0; i < n; ++i) {
    if (i == closest) continue;
    c.distance[i] = distance_s(infinite, codebook[i], c.centres[0]);
    queue.insert({c.distance[i], i});
  }
  const auto bring_up_to_date = [&](size_t i) {
    for (; eval[i] < c.centres.size(); ++eval[i])
      if (const uint64_t d = distance_s(c.distance[i], codebook[i], c.centres[eval[i]]); d < c.distance[i]) {
        c.distance[i] = d;
        c.centre[i] = static_cast<uint32_t>(eval[i]);
      }
  };
  while (c.centres.size() < k && !queue.empty() && queue.begin()->first > 0) {
    const size_t i = queue.begin()->second;
    queue.erase(queue.begin());
    bring_up_to_date(i);
    const std::pair<uint64_t, size_t> now{c.distance[i], i};
    if (queue.empty() || !Later{}(*queue.begin(), now)) {
      if (now.first == 0) break;
      c.centre[i] = static_cast<uint32_t>(c.centres.size());
      c.centres.push_back(codebook[i]);
      c.distance[i] = 0;
      eval[i] = infinite;
    } else {
      queue.insert(now);
    }
  }
  eval[closest] = infinite;
  for (size_t i = 0; i < n; ++i) bring_up_to_date(i);
  return c;
}

/// Weighted D^2, as seeding.h has it.
inline Clusters d2(std::span<const Codeword> codebook, std::span<const uint64_t> weights, uint32_t k) {
  const size_t n = codebook.size();
  Clusters c{{}, std::vector<uint32_t>(n), std::vector<uint64_t>(n, 1)};
  uint64_t state = 0;
  const auto next = [&state] {
    uint64_t z = state += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  };
  while (c.centres.size() < k) {
    std::vector<Wide> shares(n);
    Wide sum = 0, mask = 0;
    for (size_t i = 0; i < n; ++i) sum += shares[i] = Wide{weights[i]} * c.distance[i];
    if (sum == 0) break;
    while (mask < sum) mask = 2 * mask + 1;
    const size_t draws = std::clamp<size_t>(c.centres.size() / 4, 1, 2048);
    for (size_t draw = 0; draw < draws && c.centres.size() < k; ++draw) {
      Wide r;
      do {
        r = next();
        if (mask >> 64 != 0) r |= Wide{next()} << 64;
        r &= mask;
      } while (r >= sum);
      size_t i = 0;
      for (; r >= shares[i]; ++i) r -= shares[i];
      if (r >= Wide{weights[i]} * c.distance[i]) continue;
      const auto centre = static_cast<uint32_t>(c.centres.size());
      c.centres.push_back(codebook[i]);
      for (size_t j = 0; j < n; ++j)
        if (const uint64_t d = distance_s(infinite, codebook[j], codebook[i]);
            centre == 0 || d < c.distance[j]) {
          c.distance[j] = d;
          c.centre[j] = centre;
        }
      if (centre == 0) break;
    }
  }
  return c;
}

/// Algorithms 3 and 4, after a seeding.
inline void k_means(Clusters& c, std::span<const Codeword> codebook, std::span<const uint64_t> weights,
                    uint32_t max_iterations) {
  const size_t n = codebook.size(), k = c.centres.size();
  const auto members = [&](uint32_t centre) { return std::count(c.centre.begin(), c.centre.end(), centre); };
  for (;;) {
    bool any_empty = false;
    for (uint32_t e = 0; e < k; ++e) any_empty |= members(e) == 0;
    if (c.iterations >= max_iterations && !any_empty) return;

    for (uint32_t e = 0; e < k; ++e) {
      if (members(e) != 0) continue;
      size_t worst = n;
      const auto error = [&](size_t i) { return Wide{c.distance[i]} * weights[i]; };
      for (size_t i = 0; i < n; ++i)
        if (c.distance[i] > 0 && members(c.centre[i]) > 1 && (worst == n || error(i) > error(worst)))
          worst = i;
      c.centre[worst] = e;
      ++c.filled;
    }
    std::vector<bool> changed(k);
    for (uint32_t e = 0; e < k; ++e) {
      Codeword mean;
      for (size_t v = 0; v < mean.size(); ++v) {
        Wide sum = 0, weight = 0;
        for (size_t i = 0; i < n; ++i)
          if (c.centre[i] == e) {
            sum += Wide{weights[i]} * codebook[i][v];
            weight += weights[i];
          }
        mean[v] = static_cast<uint16_t>((2 * sum + weight) / (2 * weight));
      }
      changed[e] = mean != c.centres[e];
      c.centres[e] = mean;
    }
    if (std::find(changed.begin(), changed.end(), true) == changed.end()) return;

    for (size_t i = 0; i < n; ++i) {
      const bool moved = changed[c.centre[i]];
      uint64_t d = moved ? distance_s(infinite, codebook[i], c.centres[c.centre[i]]) : c.distance[i];
      if (d > 0) {
        const bool all = d > c.distance[i];
        const uint32_t own = c.centre[i];
        for (uint32_t e = 0; e < k; ++e) {
          if (e == own || (!all && !changed[e])) continue;
          if (const uint64_t other = distance_s(d, codebook[i], c.centres[e]); other < d) {
            d = other;
            c.centre[i] = e;
          }
        }
      }
      c.distance[i] = d;
    }
    ++c.iterations;
  }
}

}  // namespace voxkit::vq::reference
