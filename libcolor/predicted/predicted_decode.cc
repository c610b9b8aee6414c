#include <fmt/format.h>

#include "formats/little_endian.h"
#include "libcolor/predicted/predicted.h"

namespace voxkit::color {
namespace {

struct ReadingCoder {
  page::RansDecoder rans;
  bool decide(MixedChance& chance, bool) {
    const bool yes = page::decide_of_part(rans, chance.part());
    chance.learn(yes);
    return yes;
  }
  bool decide_evenly(bool) { return page::decide_of_part(rans, page::table_total / 2); }
};

}  // namespace

Result<std::vector<Rgb>> decode_predicted(std::span<const std::byte> part, std::span<const PartCell> cells,
                                          uint32_t count) {
  const auto wrong = [](const std::string& what) { return fail(ErrorCode::input, {}, what); };
  ColorSteps steps;
  if (part.size() < steps.steps.size()) return wrong("ends before its steps");
  for (size_t c = 0; c < 3; ++c) steps.steps[c] = std::to_integer<uint8_t>(part[c]);
  if (const auto zeros = std::ranges::count(steps.steps, 0); zeros != 0 && zeros != 3)
    return wrong("a step of 0 beside others");
  size_t at = 3;
  const PartCells part_cells(cells);
  ColorModel model;
  CodedColors coded(count);
  ReadingCoder coder;
  const auto damaged = [&](uint32_t number) {
    return wrong(fmt::format("section {} is damaged", number / section_colors));
  };
  uint32_t number = 0;
  for (const PartCell& cell : cells) {
    const KnownAround around(part_cells, cell);
    for (uint64_t left = cell.mask; left != 0; left &= left - 1, ++number) {
      if (number % section_colors == 0) {
        if (number > 0 && !coder.rans.finished()) return damaged(number - 1);
        const uint32_t length = part.size() - at >= 4 ? load_le<uint32_t>(&part[at]) : 0;
        if (length == 0 || length > part.size() - at - 4) return damaged(number);
        coder.rans.open(part.subspan(at + 4, length));
        at += 4 + length;
      }
      const auto bit = static_cast<uint32_t>(std::countr_zero(left));
      const Expected e = expected(around, bit, number, coded, steps.unit());
      Channels k{};
      if (!model.as_expected(coder, e, false)) k = steps.point(model.point(coder, e, {}));
      coded.set(number, steps.color(e.color, k), k);
    }
  }
  if (!coder.rans.finished()) return damaged(number - 1);
  if (at != part.size()) return wrong(fmt::format("{} bytes behind its sections", part.size() - at));
  return std::move(coded.colors);
}

}  // namespace voxkit::color
