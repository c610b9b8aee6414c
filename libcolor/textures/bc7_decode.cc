#include <bit>
#include <utility>

#include "formats/little_endian.h"
#include "libcolor/textures/bc7.h"
#include "libcolor/textures/bc7_modes.h"

namespace voxkit::color {
namespace {

/// The bits of a block, lowest first.
class Bits {
 public:
  explicit Bits(const std::byte* block)
      : low_(load_le<uint64_t>(block)), high_(load_le<uint64_t>(block + 8)) {}
  /// The next 0 to 8.
  uint32_t next(int count) {
    if (count == 0) return 0;
    const auto value = static_cast<uint32_t>(low_ & ((uint64_t{1} << count) - 1));
    low_ = low_ >> count | high_ << (64 - count);
    high_ >>= count;
    return value;
  }

 private:
  uint64_t low_, high_;
};

}  // namespace

void decode_bc7(const std::byte* block, Pixels16& out) {
  if (!valid_bc7(block)) {
    out.fill({});
    return;
  }
  const int number = std::countr_zero(std::to_integer<unsigned>(block[0]));
  const bc7::Mode& mode = bc7::modes[static_cast<size_t>(number)];
  Bits bits(block);
  bits.next(number + 1);
  const uint32_t partition = bits.next(mode.partition_bits), rotation = bits.next(mode.rotation_bits),
                 selection = bits.next(mode.selection_bits);

  const int ends = 2 * mode.subsets;
  int at[6][4];
  for (int k = 0; k < 4; ++k)
    for (int e = 0; e < ends; ++e)
      at[e][k] = static_cast<int>(bits.next(k < 3 ? mode.color_bits : mode.alpha_bits));
  if (mode.has_p()) {
    int lowest[6];
    for (int e = 0; e < ends; ++e)
      lowest[e] = mode.shared_p != 0 && e % 2 == 1 ? lowest[e - 1] : static_cast<int>(bits.next(1));
    for (int e = 0; e < ends; ++e)
      for (int k = 0; k < 4; ++k) at[e][k] = at[e][k] << 1 | lowest[e];
  }
  const int p = mode.has_p() ? 1 : 0;
  for (int e = 0; e < ends; ++e)
    for (int k = 0; k < 4; ++k)
      at[e][k] = k < 3                  ? bc7::expand(at[e][k], mode.color_bits + p)
                 : mode.alpha_bits == 0 ? 255
                                        : bc7::expand(at[e][k], mode.alpha_bits + p);

  uint32_t first[16], second[16] = {};
  for (uint32_t i = 0; i < 16; ++i) {
    const uint32_t subset = bc7::subset_of(mode.subsets, partition, i);
    first[i] = bits.next(mode.index_bits - (i == bc7::anchor_of(mode.subsets, partition, subset) ? 1 : 0));
  }
  if (mode.second_bits != 0)
    for (uint32_t i = 0; i < 16; ++i) second[i] = bits.next(mode.second_bits - (i == 0 ? 1 : 0));

  for (uint32_t i = 0; i < 16; ++i) {
    const uint32_t subset = bc7::subset_of(mode.subsets, partition, i);
    const auto& a = at[2 * subset];
    const auto& b = at[2 * subset + 1];
    int of_color = bc7::weight_of(mode.index_bits, first[i]), of_alpha = of_color;
    if (mode.second_bits != 0) {
      of_alpha = bc7::weight_of(mode.second_bits, second[i]);
      if (selection != 0) std::swap(of_color, of_alpha);
    }
    int v[4];
    for (int k = 0; k < 4; ++k) v[k] = bc7::mixed(a[k], b[k], k < 3 ? of_color : of_alpha);
    if (rotation != 0) std::swap(v[3], v[rotation - 1]);
    out[i] = {static_cast<uint8_t>(v[0]), static_cast<uint8_t>(v[1]), static_cast<uint8_t>(v[2])};
  }
}

}  // namespace voxkit::color
