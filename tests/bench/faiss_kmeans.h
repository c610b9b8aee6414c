// The peer: k-means of faiss.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "libvq/brick.h"

namespace voxkit::bench {

struct FaissResult {
  double seconds = 0;        ///< of training; without assigning the bricks to the final centres
  double squared_error = 0;  ///< weighted, with centres rounded to whole numbers, all voxels together
};
/// Weighted, from random bricks, on all of them. Nothing where the build found no faiss.
std::optional<FaissResult> faiss_kmeans(std::span<const vq::Brick> bricks, std::span<const uint64_t> weights,
                                        uint32_t codewords, int iterations, int threads);

}  // namespace voxkit::bench
