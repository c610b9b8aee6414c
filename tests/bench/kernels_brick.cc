// Bricks of 4^3 voxels to codewords and back (RBUC).
#include <array>
#include <vector>

#include "formats/copy.h"
#include "formats/volume/builtin.h"
#include "libvq/rbuc.h"
#include "tests/bench/bricks.h"
#include "tests/bench/ceilings.h"
#include "tests/bench/kernels.h"

namespace voxkit::bench {
namespace {

struct Coded {
  std::vector<vq::Brick> bricks;  ///< none of one value only
  std::vector<vq::BrickRange> ranges;
  std::vector<std::byte> bytes;
  std::vector<uint32_t> first;  ///< of each codeword
  int bits = 16;
};

Result<std::shared_ptr<const Coded>> make_coded(std::unique_ptr<VolumeSource> source, int bits) {
  auto made = std::make_shared<Coded>();
  made->bits = bits;
  VOX_TRY(const std::vector<vq::Brick> all, bricks_of(*source, context()));
  for (const vq::Brick& brick : all) {
    const vq::BrickRange range = vq::range_of(brick);
    if (range.min == range.max) continue;
    std::array<std::byte, vq::longest_codeword + 8> code{};
    const int length = vq::encode_codeword(brick, range, code.data());
    made->bricks.push_back(brick);
    made->ranges.push_back(range);
    made->first.push_back(static_cast<uint32_t>(made->bytes.size()));
    made->bytes.insert(made->bytes.end(), code.begin(), code.begin() + length);
  }
  made->bytes.resize(made->bytes.size() + vq::longest_codeword + 8);
  return made;
}

void report_bricks(benchmark::State& state, const Coded& c) {
  state.SetBytesProcessed(static_cast<int64_t>(state.iterations() * c.bricks.size() * vq::brick_voxels) *
                          (c.bits > 8 ? 2 : 1));
  const double bricks = static_cast<double>(c.bricks.size()),
               code = static_cast<double>(c.bytes.size()) / bricks;
  state.counters["codeword_bytes"] = code;
  // Half of what is moved is read, half is written, as far as that goes.
  report(state, bricks, {copying_ns((code + sizeof(vq::Brick)) / 2), "moving brick and codeword"});
}

template <class Decode>
void decode_all(benchmark::State& state, const Coded& c, const Decode& decode) {
  vq::Brick voxels;
  for (auto _ : state)
    for (size_t i = 0; i < c.bricks.size(); ++i) {
      if (!decode(c.bytes.data() + c.first[i], vq::longest_codeword, c.bits, c.ranges[i], voxels.data()))
        return give_up(state, Error{ErrorCode::internal, {}, "a codeword is not valid"});
      benchmark::DoNotOptimize(voxels);
    }
  report_bricks(state, c);
}

void add_coding(const std::string& name, const std::shared_ptr<Lazy<Coded>>& input) {
  add("rbuc/decode/" + name, input,
      [](benchmark::State& state, const Coded& c) { decode_all(state, c, vq::decode_codeword); });
  add("rbuc/decode_portable/" + name, input, [](benchmark::State& state, const Coded& c) {
    decode_all(state, c, [](auto... arguments) { return vq::decode_codeword_portable(arguments...); });
  });
  add("rbuc/encode/" + name, input, [](benchmark::State& state, const Coded& c) {
    std::array<std::byte, vq::longest_codeword + 8> code;
    for (auto _ : state)
      for (size_t i = 0; i < c.bricks.size(); ++i) {
        benchmark::DoNotOptimize(vq::encode_codeword(c.bricks[i], c.ranges[i], code.data()));
        benchmark::ClobberMemory();
      }
    report_bricks(state, c);
  });
}

}  // namespace

void add_brick_kernels(bool quick) {
  const int64_t side = quick ? 16 : 128;
  add_coding("8bit",
             std::make_shared<Lazy<Coded>>([=] { return make_coded(membrane_source(Index3(side), 1), 8); }));
  add_coding("16bit",
             std::make_shared<Lazy<Coded>>([=] { return make_coded(marschner_lobb_source(side), 16); }));
}

}  // namespace voxkit::bench
