#include "formats/volume/wide_integers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <unordered_set>

#include "formats/parallel.h"

namespace voxkit {
namespace {

constexpr int64_t most_labels = 65536, float_exact = int64_t{1} << 24;
constexpr int64_t part_samples = int64_t{1} << 20;

/// Sample values as int64, u64 by their bits: so that equal ones are equal and differences are right modulo
/// 2^64.
template <class T>
int64_t load(const std::byte* at, bool big_endian) {
  T value;
  std::memcpy(&value, at, sizeof value);
  if (big_endian) {
    if constexpr (sizeof(T) == 4) value = static_cast<T>(__builtin_bswap32(static_cast<uint32_t>(value)));
    if constexpr (sizeof(T) == 8) value = static_cast<T>(__builtin_bswap64(static_cast<uint64_t>(value)));
  }
  return static_cast<int64_t>(value);
}

/// Calls f(T{}) with the C++ type of a wide sample type.
template <class F>
auto with_type(SampleType type, const F& f) {
  switch (type) {
    case SampleType::u32:
      return f(uint32_t{});
    case SampleType::i32:
      return f(int32_t{});
    case SampleType::u64:
      return f(uint64_t{});
    default:
      return f(int64_t{});
  }
}

/// What the samples of a part are.
struct Values {
  std::unordered_set<int64_t> different;  ///< up to one more than a table holds
  bool too_many = false;

  void add(int64_t value) {
    if (too_many) return;
    different.insert(value);
    too_many = static_cast<int64_t>(different.size()) > most_labels;
  }
};

template <class T>
std::string text(int64_t bits) {
  return fmt::format("{}", static_cast<T>(bits));
}

template <class T>
struct Fit {
  std::span<const std::byte> samples;
  bool big_endian, round;
  const std::string& file;
  VolumeInfo& info;
  Context& ctx;
  int64_t count = static_cast<int64_t>(samples.size() / sizeof(T));
  int64_t parts = (count + part_samples - 1) / part_samples;

  T at(int64_t i) const {
    return static_cast<T>(load<T>(samples.data() + i * static_cast<int64_t>(sizeof(T)), big_endian));
  }

  /// Least and greatest.
  Result<std::pair<T, T>> range() const {
    using Pair = std::pair<T, T>;
    std::vector<Pair> ends(static_cast<size_t>(parts),
                           Pair(std::numeric_limits<T>::max(), std::numeric_limits<T>::min()));
    VOX_CHECK(parallel_for(ctx, parts, [&](int64_t part) -> Status {
      T lo = std::numeric_limits<T>::max(), hi = std::numeric_limits<T>::min();
      for (int64_t i = part * part_samples, end = std::min(count, i + part_samples); i < end; ++i) {
        const T v = at(i);
        lo = std::min(lo, v);
        hi = std::max(hi, v);
      }
      ends[static_cast<size_t>(part)] = {lo, hi};
      return {};
    }));
    Pair all = ends[0];
    for (const Pair& part : ends) all = {std::min(all.first, part.first), std::max(all.second, part.second)};
    return all;
  }

  /// The different values, ascending; nothing where a table does not hold them.
  Result<std::shared_ptr<std::vector<int64_t>>> labels() const {
    Values all;
    for (int64_t first = 0; first < parts && !all.too_many; first += ctx.threads) {
      const int64_t some = std::min<int64_t>(ctx.threads, parts - first);
      std::vector<Values> found(static_cast<size_t>(some));
      VOX_CHECK(parallel_for(ctx, some, [&](int64_t k) -> Status {
        Values& part = found[static_cast<size_t>(k)];
        int64_t i = (first + k) * part_samples;
        int64_t last = ~static_cast<int64_t>(at(i));
        for (const int64_t end = std::min(count, i + part_samples); i < end; ++i) {
          const auto v = static_cast<int64_t>(at(i));
          if (v != last) part.add(v);
          last = v;
        }
        return {};
      }));
      for (const Values& part : found) {
        all.too_many |= part.too_many;
        for (const int64_t value : part.different) all.add(value);
      }
    }
    if (all.too_many) return nullptr;
    auto table = std::make_shared<std::vector<int64_t>>(all.different.begin(), all.different.end());
    std::sort(table->begin(), table->end(),
              [](int64_t a, int64_t b) { return static_cast<T>(a) < static_cast<T>(b); });
    return table;
  }

  Status run() const {
    VOX_TRY(const auto ends, range());
    const auto [lo, hi] = ends;
    const auto distance = static_cast<uint64_t>(hi) - static_cast<uint64_t>(lo);
    const auto hold = [&](uint64_t values) {
      info.format = values <= 256 ? VoxelFormat::density8 : VoxelFormat::density16;
    };
    if (distance <= 65535) {
      info.wide_base = static_cast<int64_t>(lo);
      hold(distance + 1);
      return {};
    }
    VOX_TRY(auto table, labels());
    if (table) {
      hold(table->size());
      info.labels = std::move(table);
      return {};
    }
    bool exact = hi <= static_cast<T>(float_exact);
    if constexpr (std::is_signed_v<T>) exact &= lo >= static_cast<T>(-float_exact);
    if (exact) return {};
    if (round) {
      info.rounded = true;
      ctx.note(fmt::format("{}: values from {} to {} are rounded to 32-bit floats", file, lo, hi));
      return {};
    }
    return bad_input(
        file, fmt::format("more than {} different values, from {} to {}: no voxel format holds all of them "
                          "exactly: expected --type f32, which rounds them",
                          most_labels, lo, hi));
  }
};

}  // namespace

Status fit_wide_integers(std::span<const std::byte> samples, bool big_endian, bool round,
                         const std::string& file, VolumeInfo& info, Context& ctx) {
  return with_type(info.sample_type, [&](auto type) -> Status {
    return Fit<decltype(type)>{samples, big_endian, round, file, info, ctx}.run();
  });
}

void from_wide(const std::byte* in, bool big_endian, int64_t count, const VolumeInfo& info, std::byte* out) {
  with_type(info.sample_type, [&](auto type) {
    using T = decltype(type);
    const auto convert = [&](auto stored, const auto& make) {
      using Stored = decltype(stored);
      for (int64_t i = 0; i < count; ++i) {
        const Stored voxel = make(load<T>(in + i * static_cast<int64_t>(sizeof(T)), big_endian));
        std::memcpy(out + i * static_cast<int64_t>(sizeof voxel), &voxel, sizeof voxel);
      }
    };
    const auto integers = [&](auto stored) {
      using Stored = decltype(stored);
      if (!info.labels) {
        convert(stored, [base = static_cast<uint64_t>(info.wide_base)](int64_t v) {
          return static_cast<Stored>(static_cast<uint64_t>(v) - base);
        });
        return;
      }
      const auto less = [](int64_t a, int64_t b) { return static_cast<T>(a) < static_cast<T>(b); };
      const std::vector<int64_t>& labels = *info.labels;
      int64_t last = labels[0];
      Stored index = 0;
      convert(stored, [&](int64_t v) {
        if (v != last) {  // labels come in runs
          last = v;
          const auto found = std::lower_bound(labels.begin(), labels.end(), v, less);
          index = static_cast<Stored>(std::min<ptrdiff_t>(found - labels.begin(), std::ssize(labels) - 1));
        }
        return index;
      });
    };
    if (info.format == VoxelFormat::density8) return integers(uint8_t{});
    if (info.format == VoxelFormat::density16) return integers(uint16_t{});
    convert(float{}, [](int64_t v) { return static_cast<float>(static_cast<T>(v)); });
  });
}

void to_wide(const std::byte* in, int64_t count, const VolumeInfo& info, std::byte* out) {
  with_type(info.sample_type, [&](auto type) {
    using T = decltype(type);
    const auto convert = [&](auto stored, const auto& make) {
      using Stored = decltype(stored);
      for (int64_t i = 0; i < count; ++i) {
        Stored voxel;
        std::memcpy(&voxel, in + i * static_cast<int64_t>(sizeof voxel), sizeof voxel);
        const T sample = make(voxel);
        std::memcpy(out + i * static_cast<int64_t>(sizeof sample), &sample, sizeof sample);
      }
    };
    const auto integer = [&](uint64_t v) {
      if (!info.labels) return static_cast<T>(v + static_cast<uint64_t>(info.wide_base));
      return static_cast<T>((*info.labels)[std::min<size_t>(v, info.labels->size() - 1)]);
    };
    if (info.format == VoxelFormat::density8 || info.format == VoxelFormat::bitmap)
      return convert(uint8_t{}, integer);
    if (info.format == VoxelFormat::density16) return convert(uint16_t{}, integer);
    convert(float{}, [](float v) {
      // Both ends are powers of two, or 0, so floats hold them.
      const float rounded = std::nearbyint(v), end = std::ldexp(1.0f, std::numeric_limits<T>::digits);
      if (std::isnan(v)) return T{0};
      if (rounded >= end) return std::numeric_limits<T>::max();
      if (rounded <= static_cast<float>(std::numeric_limits<T>::min())) return std::numeric_limits<T>::min();
      return static_cast<T>(rounded);
    });
  });
}

}  // namespace voxkit
