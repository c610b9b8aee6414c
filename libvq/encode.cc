// From a volume to a file: bricks are collected, then the file is laid out and written.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "formats/volume_chunks.h"
#include "libvq/cluster.h"

namespace voxkit::vq {
namespace {

/// Lays out and writes what has been collected.
class Writer {
 public:
  Writer(const VolumeInfo& info, const Options& options, const Quantiser& quantiser,
         const Collected& collected, const ByteSink& sink, Context& ctx)
      : info_(info),
        options_(options),
        quantiser_(quantiser),
        codes_(collected.codes),
        numbers_(collected.numbers),
        container_(sink, Codec::vq, container_version_for(info_), options.zstd, *ctx.memory),
        reservation_(*ctx.memory) {}

  Result<Report> write(Report report) {
    Params& p = report_.params;
    report_ = std::move(report);
    p.codebook = options_.codebook;
    p.codewords = codes_.size();
    find_bits_and_common();
    if (p.codebook == Codebook::rbuc) VOX_CHECK(place_bricks());
    VOX_CHECK(choose_mapping());
    VOX_CHECK(add_volume_info(container_, info_));
    VOX_CHECK(container_.add(params_kind, 0, 0, pack_params(p, id_of(common_))));
    for (uint64_t part = 0; part < chunks(numbers_.size(), block_chunk_log2 + 6); ++part)
      VOX_CHECK(container_.add(offsets_kind, 0, part,
                               pack_offsets(numbers_, part, common_, [&](uint32_t n) { return id_of(n); })));
    if (p.codebook == Codebook::packed) {
      VOX_CHECK(write_packed());
    } else {
      if (p.mapping == Mapping::indirect) VOX_CHECK(write_addresses());
      VOX_CHECK(write_codewords());
    }
    VOX_CHECK(container_.finish());
    return report_;
  }

 private:
  static uint64_t chunks(uint64_t count, int log2) { return divide_up(count, uint64_t{1} << log2); }

  void find_bits_and_common() {
    Params& p = report_.params;
    uint16_t lo = 65535, hi = 0;
    for (uint64_t n = 0; n < codes_.size(); ++n) {
      const BrickRange range = codes_.range(n);
      lo = std::min(lo, range.min);
      hi = std::max(hi, range.max);
    }
    least_ = lo;
    p.special = quantiser_.special();
    p.bits = std::max(1, static_cast<int>(std::bit_width(static_cast<unsigned>(hi - lo))));
    p.base = quantiser_.origin() + quantiser_.step() * lo;
    if (p.special) p.special = static_cast<uint16_t>(*p.special - lo);
    if (p.special && *p.special > hi - lo) p.special.reset();  // there is none
    p.step = quantiser_.step();
    std::vector<uint64_t> counts(codes_.size());
    for (const uint32_t n : numbers_)
      if (n != no_number) ++counts[n];
    common_ = static_cast<uint32_t>(std::max_element(counts.begin(), counts.end()) - counts.begin());
  }

  /// The length of a brick with its range.
  uint8_t length_of(uint64_t number) const {
    const int bits = report_.params.bits;
    const auto codeword = static_cast<int>(codes_.codeword(number).size());
    return static_cast<uint8_t>(range_bytes(bits) + std::min(codeword, codeword ? 1 + plain_bytes(bits) : 0));
  }

  Status place_bricks() {
    VOX_CHECK(reservation_.add(codes_.size() * sizeof(uint64_t), "addresses of bricks"));
    constexpr uint64_t chunk = uint64_t{1} << address_chunk_log2;
    addresses_.reserve(codes_.size());
    for (uint64_t first = 0; first < codes_.size(); first += group_bricks) {
      // A group lies in one chunk, so that lengths alone tell where its bricks are.
      const uint64_t last = std::min(codes_.size(), first + group_bricks);
      uint64_t bytes = 0;
      for (uint64_t n = first; n < last; ++n) bytes += length_of(n);
      if (end_ % chunk + bytes > chunk) end_ = (end_ / chunk + 1) * chunk;
      for (uint64_t n = first; n < last; ++n) {
        addresses_.push_back(end_);
        end_ += length_of(n);
      }
      report_.params.codebook_bytes += bytes;
    }
    return {};
  }

  uint64_t id_of(uint32_t number) const {
    return report_.params.mapping == Mapping::direct ? addresses_[number] : number;
  }

  /// The paper's rule: whichever takes fewer bytes, tables included.
  Status choose_mapping() {
    Params& p = report_.params;
    const auto number = [](uint32_t n) -> uint64_t { return n; };
    const auto address = [&](uint32_t n) { return addresses_[n]; };
    OffsetsSize indirect = measure_offsets(numbers_, common_, number);
    p.mapping = Mapping::indirect;
    if (p.codebook == Codebook::packed) {
      p.codebook_bytes = codes_.size() * static_cast<uint64_t>(packed_bytes(p.bits));
    } else {
      indirect.bytes += divide_up(codes_.size(), group_bricks) * group_bytes;
      const bool possible = end_ < (uint64_t{1} << 32) - 1;
      if (options_.mapping == Mapping::direct && !possible)
        return fail(ErrorCode::limit, {},
                    "--offsets direct: the codebook is longer than 4 GiB: use --offsets indirect");
      if (possible && options_.mapping != Mapping::indirect) {
        const OffsetsSize direct = measure_offsets(numbers_, common_, address);
        if (options_.mapping == Mapping::direct || direct.bytes <= indirect.bytes) {
          p.mapping = Mapping::direct;
          indirect = direct;
        }
      }
    }
    p.offset_bytes = indirect.bytes;
    p.offset_bits = indirect.widest;
    return {};
  }

  Status write_addresses() {
    std::vector<std::byte> bytes;
    for (uint64_t part = 0; part < chunks(codes_.size(), group_log2 + group_chunk_log2); ++part) {
      const uint64_t first = part << (group_log2 + group_chunk_log2);
      const uint64_t last = std::min(codes_.size(), first + (uint64_t{1} << (group_log2 + group_chunk_log2)));
      bytes.assign(divide_up(last - first, group_bricks) * group_bytes, std::byte{0});
      for (uint64_t n = first; n < last; ++n) {
        std::byte* const group = &bytes[(n - first) / group_bricks * group_bytes];
        if (n % group_bricks == 0) store_le(group, addresses_[n]);
        group[8 + n % group_bricks] = static_cast<std::byte>(length_of(n));
      }
      VOX_CHECK(container_.add(addresses_kind, 0, part, bytes));
    }
    return {};
  }

  /// A brick's range, less the least code of all.
  void store_range(std::byte* bytes, BrickRange range) const {
    const int bits = report_.params.bits;
    store_bits(bytes, 0, static_cast<uint32_t>(range.min - least_));
    store_bits(bytes, static_cast<uint64_t>(bits), static_cast<uint32_t>(range.max - least_));
  }

  Status write_codewords() {
    const int bits = report_.params.bits;
    std::vector<std::byte> chunk(size_t{1} << address_chunk_log2);
    std::array<std::byte, 160> brick;
    uint64_t part = 0, used = 0;
    for (uint64_t n = 0; n < codes_.size(); ++n) {
      if (addresses_[n] >> address_chunk_log2 != part) {
        VOX_CHECK(container_.add(codebook_kind, 0, part++, std::span(chunk).first(used)));
        used = 0;
      }
      const auto codeword = codes_.codeword(n);
      const uint8_t length = length_of(n);
      std::byte* const code = brick.data() + range_bytes(bits);
      brick.fill(std::byte{0});
      store_range(brick.data(), codes_.range(n));
      if (length < range_bytes(bits) + static_cast<int>(codeword.size())) {
        *code = std::byte{escape};
        encode_plain(codes_.decode(n), least_, bits, code + 1);
      } else if (!codeword.empty()) {
        std::copy(codeword.begin(), codeword.end(), code);
        ++report_.transform_codewords[static_cast<size_t>(transform_of(codeword.data()))];
      }
      std::copy_n(brick.begin(), length, &chunk[used]);
      used += length;
    }
    return container_.add(codebook_kind, 0, part, std::span(chunk).first(used));
  }

  Status write_packed() {
    const int bits = report_.params.bits, log2 = packed_chunk_log2(bits);
    const auto stride = static_cast<size_t>(packed_bytes(bits));
    for (uint64_t part = 0; part < chunks(codes_.size(), log2); ++part) {
      const uint64_t first = part << log2, count = std::min(codes_.size() - first, uint64_t{1} << log2);
      std::vector<std::byte> chunk(count * stride + 8);
      for (uint64_t i = 0; i < count; ++i) {
        std::byte* const brick = &chunk[i * stride];
        store_range(brick, codes_.range(first + i));
        encode_plain(codes_.decode(first + i), least_, bits, brick + range_bytes(bits));
      }
      VOX_CHECK(container_.add(codebook_kind, 0, part, std::span(chunk).first(count * stride)));
    }
    return {};
  }

  const VolumeInfo& info_;
  const Options& options_;
  const Quantiser& quantiser_;
  const UniqueCodes& codes_;
  const BrickNumbers& numbers_;
  ContainerWriter container_;
  Reservation reservation_;
  Report report_;
  uint16_t least_ = 0;               ///< code of all
  uint32_t common_ = 0;              ///< number of the brick that occurs most often
  std::vector<uint64_t> addresses_;  ///< by number
  uint64_t end_ = 0;                 ///< address behind the last brick
};

}  // namespace

Status validate(const Options& options, const VolumeInfo& info) {
  if (is_color(info.format))
    return bad_input({}, fmt::format("{} voxels: expected a scalar volume", name(info.format)));
  if (options.codebook == Codebook::packed && options.mapping == Mapping::direct)
    return bad_usage("--offsets direct: bricks of equal size have no addresses: use --codebook rbuc");
  if (options.max_error && !(*options.max_error >= 0 && std::isfinite(*options.max_error)))
    return bad_usage(fmt::format("--max-error {}: expected a number of at least 0", *options.max_error));
  if ((options.codewords > 0) + (options.reduce > 0) + options.max_error.has_value() > 1)
    return bad_usage("--codewords, --reduce and --max-error: expected one of them");
  if ((options.keep_nan || info.fill) && (options.codewords > 0 || options.reduce > 0))
    return bad_usage(
        "--codewords and --reduce: bricks with a fill value have no average: expected --max-error");
  return {};
}

Result<double> error_bound(const Options& options, const VolumeInfo& info) {
  VOX_TRY(const Quantiser quantiser, Quantiser::make(options, info));
  return quantiser.bound();
}

Result<Report> encode(VolumeSource& source, const Options& options, const ByteSink& sink, Context& ctx) {
  VOX_CHECK(validate(options, source.info()));
  VOX_TRY(const Quantiser quantiser, Quantiser::make(options, source.info()));
  Collected collected(ctx);
  VOX_CHECK(collect(source, quantiser, collected, ctx));
  Report report;
  report.bricks = product(bricks_of(source.info().dims));
  report.quantisation_error = collected.loss.greatest_error;
  report.replaced = collected.loss.replaced;
  report.params.unique_bricks = collected.codes.size();
  report.params.max_error = quantiser.bound();
  VOX_CHECK(cluster(collected, options, source.info(), quantiser, report, ctx));
  return Writer(source.info(), options, quantiser, collected, sink, ctx).write(std::move(report));
}

}  // namespace voxkit::vq
