// Codewords of bricks: how long they can be made, and whether they come back.
#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "libvq/codebook.h"
#include "libvq/rbuc.h"
#include "libvq/view.h"
#include "tests/stress/report.h"
#include "tests/stress/search.h"

namespace voxkit::stress {
namespace {

using vq::Brick;

Brick brick_of(const Point& at) {
  Brick brick;
  for (size_t i = 0; i < brick.size(); ++i) brick[i] = static_cast<uint16_t>(at[i]);
  return brick;
}

/// What comes back from a brick: false where it is not the same, by any decoder.
bool comes_back(const Brick& brick, const vq::CodedBrick& coded, int bits) {
  if (coded.length == 0) return coded.range.min == coded.range.max;
  // In memory of just its size, and what decoders may read beyond.
  std::vector<std::byte> memory(coded.length + size_t{vq::read_slack});
  std::copy_n(coded.codeword.begin(), coded.length, memory.begin());
  Brick here, portable;
  return vq::codeword_length(memory.data(), coded.length, bits) == coded.length &&
         vq::codeword_length(memory.data(), coded.length - 1u, bits) == 0 &&
         vq::decode_codeword(memory.data(), coded.length, bits, coded.range, here.data()) &&
         vq::decode_codeword_portable(memory.data(), coded.length, bits, coded.range, portable.data()) &&
         here == brick && portable == brick;
}

std::string input_of(const Point& at) {
  std::string all;
  for (const int64_t v : at) all += fmt::format("{}{}", all.empty() ? "" : ",", v);
  return all;
}

/// The longest codeword of voxels of so many bits.
void longest(int bits, const Effort& effort, Report& report) {
  const std::vector<Range> all(vq::brick_voxels, Range{0, (int64_t{1} << bits) - 1});
  int64_t lost = 0;
  Point lost_at;
  const Worst found =
      climb(all, {}, effort.tries, effort.seed + static_cast<uint64_t>(bits), [&](const Point& at) {
        const Brick brick = brick_of(at);
        vq::CodedBrick coded;
        vq::code_brick(brick, coded);
        if (!comes_back(brick, coded, bits)) {
          ++lost;
          lost_at = at;
        }
        // What does not make it longer yet, but comes near: residuals of all octants at their widest.
        return static_cast<double>(coded.length);
      });
  const int plain = vq::plain_bytes(bits), most = 1 + std::bit_width(static_cast<unsigned>(bits)) + plain;
  report.add(
      {fmt::format("codeword, {} bit voxels", bits),
       fmt::format("at most {} bytes of {}, 0 lost", most, plain),
       fmt::format("{:.0f} bytes ({:+.1f} %), {} lost", found.score, 100 * (found.score / plain - 1), lost),
       lost == 0 && found.score <= most, found.tried, input_of(lost == 0 ? found.at : lost_at)});
}

/// Every residual, at every range and prediction: none needs more bits than the voxel, and all come back.
void folds(const Effort& effort, Report& report) {
  int64_t lost = 0, seen = 0;
  Point lost_at;
  const auto look = [&](uint32_t top, uint32_t voxel, uint32_t predicted) {
    const uint32_t modulo = vq::fold_modulo(voxel, predicted, top),
                   bounded = vq::fold_bounded(voxel, predicted, top);
    ++seen;
    if (modulo <= top && bounded <= top && vq::unfold_modulo(modulo, predicted, top) == voxel &&
        vq::unfold_bounded(bounded, predicted, top) == voxel)
      return;
    ++lost;
    lost_at = {top, voxel, predicted};
  };
  constexpr uint32_t all = 160;  // every one up to here
  for (uint32_t top = 1; top <= all; ++top)
    for (uint32_t voxel = 0; voxel <= top; ++voxel)
      for (uint32_t predicted = 0; predicted <= top; ++predicted) look(top, voxel, predicted);
  const std::vector<Range> ranges = {{1, 65535}, {0, 65535}, {0, 65535}};
  climb(ranges, {}, effort.tries, effort.seed, [&](const Point& at) {
    const int64_t top = at[0], voxel = at[1] % (top + 1), predicted = at[2] % (top + 1);
    look(static_cast<uint32_t>(top), static_cast<uint32_t>(voxel), static_cast<uint32_t>(predicted));
    return static_cast<double>(lost);
  });
  report.add({fmt::format("residuals, all up to {}, others searched", all), "none above the range, 0 lost",
              fmt::format("{} lost", lost), lost == 0, seen, lost == 0 ? "" : input_of(lost_at)});
}

void fill(const Effort& effort, Report& report) {
  for (const int bits : {1, 2, 4, 8, 12, 15, 16}) longest(bits, effort, report);
  folds(effort, report);
}

}  // namespace
}  // namespace voxkit::stress

int main(int argc, char** argv) {
  return voxkit::stress::stress_main(argc, argv, "stress_codewords", "Codewords", 300000,
                                     voxkit::stress::fill);
}
