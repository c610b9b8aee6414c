#include "tests/bench/faiss_kmeans.h"

#ifdef VOXKIT_FAISS

#include <faiss/Clustering.h>
#include <faiss/IndexFlat.h>
#include <omp.h>

#include <cmath>
#include <vector>

#include "formats/clock.h"

namespace voxkit::bench {

std::optional<FaissResult> faiss_kmeans(std::span<const vq::Brick> bricks, std::span<const uint64_t> weights,
                                        uint32_t codewords, int iterations, int threads) {
  constexpr size_t width = vq::brick_voxels;
  std::vector<float> points(bricks.size() * width);
  for (size_t i = 0; i < bricks.size(); ++i)
    for (size_t v = 0; v < width; ++v) points[i * width + v] = bricks[i][v];
  const std::vector<float> floats(weights.begin(), weights.end());
  const auto count = static_cast<faiss::Index::idx_t>(bricks.size());

  omp_set_num_threads(threads);
  faiss::ClusteringParameters parameters;
  parameters.niter = iterations;
  parameters.min_points_per_centroid = 1;
  parameters.max_points_per_centroid = static_cast<int>(bricks.size());  // no samples
  faiss::Clustering clustering(static_cast<int>(width), static_cast<int>(codewords), parameters);
  faiss::IndexFlatL2 index(static_cast<faiss::Index::idx_t>(width));
  const auto start = Clock::now();
  clustering.train(count, points.data(), index, floats.data());
  FaissResult result;
  result.seconds = seconds_since(start);

  std::vector<float> distances(bricks.size());
  std::vector<faiss::Index::idx_t> nearest(bricks.size());
  index.search(count, points.data(), 1, distances.data(), nearest.data());
  for (size_t i = 0; i < bricks.size(); ++i) {
    double squares = 0;
    for (size_t v = 0; v < width; ++v) {
      const double apart =
          std::round(clustering.centroids[static_cast<size_t>(nearest[i]) * width + v]) - bricks[i][v];
      squares += apart * apart;
    }
    result.squared_error += squares * static_cast<double>(weights[i]);
  }
  return result;
}

}  // namespace voxkit::bench

#else

namespace voxkit::bench {

std::optional<FaissResult> faiss_kmeans(std::span<const vq::Brick>, std::span<const uint64_t>, uint32_t, int,
                                        int) {
  return std::nullopt;
}

}  // namespace voxkit::bench

#endif
