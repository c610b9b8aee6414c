#include "libcolor/blocks/block_encode.h"

#include <algorithm>
#include <cmath>

#include "libcolor/blocks/bit_writer.h"
#include "libcolor/blocks/block_plan.h"
#include "libcolor/blocks/directions.h"
#include "libcolor/blocks/lab_colors.h"

namespace voxkit::color {
namespace {

uint32_t to_565(Rgb c) {
  return c.r >> 3 | static_cast<uint32_t>(c.g >> 2) << 5 | static_cast<uint32_t>(c.b >> 3) << 11;
}

/// A part as it grows, macro block by macro block.
class PartWriter {
 public:
  PartWriter(Endpoints endpoints, size_t macro_blocks)
      : endpoints_(endpoints), heads_(macro_blocks * macro_head) {}

  void add(const MacroColors& colors, const Fitter& fitter, const std::vector<PlannedBlock>& plan) {
    const uint64_t weights = begin_macro_block(0);
    std::vector<uint8_t> run(colors.size() + color_vector);
    for (const PlannedBlock& block : plan) {
      const uint64_t offset = block.bits == 0 ? no_weights : weights_.size() - weights;
      const uint32_t bits = block.bits == 0 ? 0 : static_cast<uint32_t>(block.bits - 1);
      add_header(block.first | bits << 14 | static_cast<uint32_t>(offset) << 16, block);
      const uint32_t most_squared =
          fitter.weights(block.fit, block.first, block.last, block.bits, run.data());
      if (block.bits > 0)
        for (uint32_t i = 0; i < block.last - block.first; ++i) weights_.add(run[i], block.bits);
      add_error(colors, block, run, most_squared);
    }
  }
  /// A macro block of colours as they are.
  void add_raw(std::span<const Rgb> colors) {
    weights_.align();
    begin_macro_block(raw_macro_block);
    const auto bits = static_cast<int>(8 * value_bytes(endpoints_));
    for (const Rgb c : colors)
      weights_.add(c.r | static_cast<uint32_t>(c.g) << 8 | static_cast<uint32_t>(c.b) << 16, bits);
  }
  EncodedPart finish() {
    weights_.align();
    std::vector<std::byte>& bytes = part_.bytes;
    bytes.resize(part_head);
    store_le(bytes.data(), static_cast<uint32_t>(part_.blocks));
    bytes.insert(bytes.end(), heads_.begin(), heads_.end());
    bytes.insert(bytes.end(), headers_.begin(), headers_.end());
    bytes.resize((bytes.size() + 7) / 8 * 8);
    bytes.insert(bytes.end(), weights_.bytes().begin(), weights_.bytes().end());
    bytes.resize(bytes.size() + part_tail);
    return std::move(part_);
  }

 private:
  /// Squared errors are of RGB, wherever distances are measured.
  void add_error(const MacroColors& colors, const PlannedBlock& block, std::span<const uint8_t> weights,
                 uint32_t most_squared) {
    const uint32_t furthest = std::max(part_.most_squared, most_squared);
    if (colors.space() == ErrorSpace::rgb) {
      part_.squared_error += block.fit.squared_error;
    } else {
      const uint32_t most = block.bits == 0 ? 1 : (1u << block.bits) - 1;
      for (uint32_t i = block.first; i < block.last; ++i)
        part_.add_error(colors.color(i),
                        mix(block.fit.a, block.fit.b, block.bits == 0 ? 0 : weights[i - block.first], most));
    }
    part_.most_squared = furthest;
  }
  uint64_t begin_macro_block(uint64_t flag) {
    std::byte* const head = &heads_[macro_head * macro_blocks_++];
    store_le(head, part_.blocks | flag);
    store_le(head + 8, weights_.size());
    return weights_.size();
  }
  void add_header(uint32_t word, const PlannedBlock& block) {
    std::array<std::byte, 10> header;
    store_le(header.data(), word);
    const Rgb a = block.fit.a, b = block.fit.b;
    if (endpoints_ == Endpoints::rgb565) {
      store_le(&header[4], block.bits == 0 ? to_single(a) : to_565(a) | to_565(b) << 16);
    } else {
      const std::array<uint8_t, 6> ends = {a.r, a.g, a.b, b.r, b.g, b.b};
      const size_t own = value_bytes(endpoints_);
      for (size_t i = 0; i < 2 * own; ++i)
        header[4 + i] = static_cast<std::byte>(ends[i < own ? i : 3 + i - own]);
    }
    headers_.insert(headers_.end(), header.begin(), header.begin() + header_bytes(endpoints_));
    ++part_.blocks;
  }

  Endpoints endpoints_;
  EncodedPart part_;
  std::vector<std::byte> heads_, headers_;
  BitWriter weights_;
  size_t macro_blocks_ = 0;
};

uint64_t cost_of(const std::vector<PlannedBlock>& plan, Endpoints endpoints) {
  uint64_t cost = 0;
  for (const PlannedBlock& block : plan) cost += block_cost(block.last - block.first, block.bits, endpoints);
  return cost;
}

const std::vector<PlannedBlock>& plan_of(const MacroColors& colors, const Fitter& fitter, Endpoints endpoints,
                                         uint32_t allowed, const BlockOptions& options, PlanMemory& memory) {
  if (options.weight_bits > 0)
    return merge_greedily(colors, fitter, endpoints, options.weight_bits, options.weight_bits, memory);
  if (options.effort == 1) return merge_greedily(colors, fitter, endpoints, 0, most_weight_bits, memory);
  const auto& plan = parse_optimally(colors, fitter, endpoints, options.effort, memory);
  if (options.effort < greedy_too) return plan;
  // Not all ends of blocks are tried: now and then what greedy merging finds is less.
  const Fitter plain(colors, endpoints, allowed, 1);
  const auto& greedy = merge_greedily(colors, plain, endpoints, 0, most_weight_bits, memory);
  return cost_of(greedy, endpoints) < cost_of(plan, endpoints) ? greedy : plan;
}

/// The greatest squared distance, in the unit of a Fit.
uint32_t allowed_of(const BlockOptions& options) {
  constexpr double greatest = 442;  // no two colours are further apart
  const double threshold = std::min(options.threshold, greatest);
  if (options.space == ErrorSpace::rgb) return static_cast<uint32_t>(threshold * threshold);
  if (options.space == ErrorSpace::angle) return squared_chord(threshold);
  // Where points are not exact the threshold holds none the less.
  const double within = lab_scale * std::max(0.0, threshold - lab_precision);
  return static_cast<uint32_t>(within * within);
}

}  // namespace

Endpoints endpoints_for(double threshold, ErrorSpace space) {
  const double worst_565 = space == ErrorSpace::rgb ? 6.13 : 5.33;
  return threshold < worst_565 ? Endpoints::rgb888 : Endpoints::rgb565;
}

EncodedPart encode_part(std::span<const Rgb> colors, const BlockOptions& options) {
  return encode_part(colors, endpoints_for(options.threshold, options.space), options);
}

EncodedPart encode_part(std::span<const Rgb> colors, Endpoints endpoints, const BlockOptions& options) {
  const uint32_t allowed = allowed_of(options);
  const size_t macro_blocks = (colors.size() + macro_block_colors - 1) / macro_block_colors;
  PartWriter writer(endpoints, macro_blocks);
  MacroColors macro;
  PlanMemory memory;
  for (size_t m = 0; m < macro_blocks; ++m) {
    const size_t first = m * macro_block_colors;
    const auto own = colors.subspan(first, std::min<size_t>(macro_block_colors, colors.size() - first));
    macro.assign(own, options.space);
    const Fitter fitter(macro, endpoints, allowed, options.effort);
    const auto& plan = plan_of(macro, fitter, endpoints, allowed, options, memory);
    if (cost_of(plan, endpoints) >= 8 * value_bytes(endpoints) * own.size())
      writer.add_raw(own);
    else
      writer.add(macro, fitter, plan);
  }
  return writer.finish();
}

}  // namespace voxkit::color
