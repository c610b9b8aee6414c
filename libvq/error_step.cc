#include "libvq/error_step.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <unordered_set>

#include "formats/copy.h"
#include "formats/parallel.h"
#include "libvq/codebook.h"
#include "libvq/layout.h"
#include "libvq/quantise.h"

namespace voxkit::vq {
namespace {

constexpr uint64_t most_samples = 2048;
constexpr int octaves = 2;  // below `most`, in which the scale is searched
constexpr double whole_up_to = 32;

/// Errors of the scale from `octaves` below `most` on, ascending.
std::vector<double> scale_up_to(double most, bool integers) {
  std::vector<double> scale;
  if (integers)
    for (double e = std::max(1.0, std::floor(most / 4)); e <= std::min(most, whole_up_to); ++e)
      scale.push_back(e);
  const int steps = integers ? 16 : 64;  // of an octave
  const int last = static_cast<int>(std::floor(std::log2(most) * steps));
  for (int k = last - octaves * steps; k <= last + 1; ++k) {
    double e = std::exp2(static_cast<double>(k) / steps);
    if (integers) e = std::floor(e);
    if (e <= most && (!integers || e > whole_up_to) && (scale.empty() || e > scale.back()))
      scale.push_back(e);
  }
  return scale;
}

/// Voxels of bricks that are spread evenly over a volume, each with its edges repeated where the volume ends.
class Sample {
 public:
  static Result<Sample> take(VolumeSource& source, Context& ctx) {
    Sample sample;
    const VolumeInfo& info = source.info();
    const Index3 bricks = bricks_of(info.dims);
    const uint64_t all = product(bricks), count = std::min(all, most_samples);
    const int64_t bytes = voxel_bytes(info.format);
    sample.bytes_ = static_cast<size_t>(brick_voxels * bytes);
    sample.voxels_.resize(count * sample.bytes_);
    std::unique_ptr<Buffer> slab;
    int64_t slab_z = -1;
    if (source.forward_only()) {
      uint64_t slab_bytes = 0;
      const auto slice = static_cast<uint64_t>(info.dims.x) * static_cast<uint64_t>(info.dims.y);
      if (__builtin_mul_overflow(slice, static_cast<uint64_t>(brick_edge * bytes), &slab_bytes))
        slab_bytes = std::numeric_limits<uint64_t>::max() / 2;
      VOX_TRY(slab, Buffer::allocate(slab_bytes, "a slab of the input", ctx));
    }
    for (uint64_t i = 0; i < count; ++i) {
      VOX_CHECK(check_interrupt());
      // The middle of the i-th of `count` equal runs of bricks.
      const auto at = static_cast<int64_t>((static_cast<unsigned __int128>(2 * i + 1) * all) / (2 * count));
      const Index3 lo =
          Index3(at % bricks.x, at / bricks.x % bricks.y, at / (bricks.x * bricks.y)) * int64_t{brick_edge};
      const Box box = intersect({lo, lo + Index3(brick_edge)}, info.box());
      std::array<std::byte, brick_voxels * 4> own;
      VoxelSpan read = packed(own.data(), box.size(), info.format);
      if (slab) {
        const Box slices{{0, 0, box.lo.z}, {info.dims.x, info.dims.y, box.hi.z}};
        const VoxelSpan whole = packed(slab->data(), slices.size(), info.format);
        if (box.lo.z != slab_z) VOX_CHECK(source.read(slices, whole));
        slab_z = box.lo.z;
        read = {whole.row(box.lo.y, 0) + box.lo.x * bytes, whole.row_stride, whole.slice_stride};
      } else {
        VOX_CHECK(source.read(box, read));
      }
      std::byte* out = &sample.voxels_[i * sample.bytes_];
      const Index3 last = box.size() - Index3(1);
      for (int64_t z = 0; z < brick_edge; ++z)
        for (int64_t y = 0; y < brick_edge; ++y)
          for (int64_t x = 0; x < brick_edge; ++x, out += bytes)
            std::copy_n(read.row(std::min(y, last.y), std::min(z, last.z)) + std::min(x, last.x) * bytes,
                        bytes, out);
    }
    return sample;
  }

  /// Bytes of the sample's different bricks, as a codebook has them.
  uint64_t bytes(const Quantiser& quantiser) const {
    uint64_t codewords = 0, different = 0;
    uint16_t least = std::numeric_limits<uint16_t>::max(), greatest = 0;
    std::unordered_set<uint64_t> seen;
    CodedBrick coded;
    Brick codes;
    Loss loss;
    for (size_t at = 0; at < voxels_.size(); at += bytes_) {
      quantiser.codes(&voxels_[at], brick_voxels, codes.data(), loss);
      code_brick(codes, coded);
      least = std::min(least, coded.range.min);
      greatest = std::max(greatest, coded.range.max);
      if (!seen.insert(hash_of(coded.range, coded.code())).second) continue;
      ++different;
      codewords += coded.length;
    }
    const int bits = std::max(1, static_cast<int>(std::bit_width(static_cast<unsigned>(greatest - least))));
    return codewords + different * static_cast<uint64_t>(range_bytes(bits));
  }

 private:
  size_t bytes_ = 0;  ///< of a brick
  std::vector<std::byte> voxels_;
};

}  // namespace

Result<double> smallest_error_step(VolumeSource& source, double most, const Options& options, Context& ctx) {
  const VolumeInfo& info = source.info();
  const std::vector<double> scale = scale_up_to(most, info.format != VoxelFormat::float32);
  if (scale.empty()) return most;
  VOX_TRY(const Sample sample, Sample::take(source, ctx));
  std::vector<uint64_t> bytes(scale.size(), ~uint64_t{0});
  VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(scale.size()), [&](int64_t i) -> Status {
    Options tried = options;
    tried.max_error = scale[static_cast<size_t>(i)];
    if (const auto quantiser = Quantiser::make(tried, info))
      bytes[static_cast<size_t>(i)] = sample.bytes(*quantiser);
    return {};
  }));
  // Of equals the nearest to the original.
  const auto best = std::min_element(bytes.begin(), bytes.end());
  return *best == ~uint64_t{0} ? most : scale[static_cast<size_t>(best - bytes.begin())];
}

}  // namespace voxkit::vq
