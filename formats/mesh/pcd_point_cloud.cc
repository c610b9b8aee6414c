// Points in PCD files.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "formats/little_endian.h"
#include "formats/mesh/lzf.h"
#include "formats/mesh/pcd_file.h"
#include "formats/mesh/point_runs.h"

namespace voxkit {
namespace {

using namespace pcd;

/// A point as its file has it.
struct Raw {
  glm::dvec3 at{0};
  std::optional<uint32_t> color;
  double intensity = 0;
};

bool is_finite(const glm::dvec3& p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

class PcdPointCloud final : public PointCloud {
 public:
  /// `data`: what is behind the header, unpacked.
  PcdPointCloud(std::shared_ptr<const MappedFile> file, std::string path, Header header,
                std::span<const std::byte> data, const PointExtras& wanted)
      : file_(std::move(file)), path_(std::move(path)), header_(std::move(header)), data_(data) {
    least_alpha_ = wanted.alpha ? 1 : 128;
    size_ = header_.points;
    notes_ = header_.notes;
    columns_ = header_.data == Data::compressed;
  }

  /// What must be known of all points before the first: the greatest intensity, whether alpha counts.
  Status look_through() {
    const Roles& roles = header_.roles;
    const bool is_float_text =
        header_.data == Data::ascii && roles.color >= 0 && field(roles.color).type == 'F';
    has_.alpha = roles.has_alpha;
    if (!roles.has_alpha && roles.intensity < 0 && !is_float_text) return {};
    uint64_t lost = 0;
    uint32_t alphas = 0;
    double least = 0, greatest = -std::numeric_limits<double>::infinity();
    VOX_CHECK(walk([](std::span<const CloudPoint>) -> Status { return {}; },
                   [&](const Raw& raw, CloudPoint&) {
                     if (!is_finite(raw.at)) return;
                     if (roles.color >= 0 && !raw.color) ++lost;
                     alphas |= raw.color.value_or(0) >> 24;
                     if (!std::isfinite(raw.intensity)) return;
                     least = std::min(least, raw.intensity);
                     greatest = std::max(greatest, raw.intensity);
                   }));
    if (lost > 0)
      notes_.push_back(fmt::format("{} points have a color that is no number: they are white", lost));
    if (roles.has_alpha && alphas == 0) {
      header_.roles.has_alpha = has_.alpha = false;
      notes_.emplace_back("alpha is 0 everywhere: it is not counted");
    }
    if (roles.intensity >= 0 && greatest > least) {
      least_ = least;
      range_ = greatest - least;
      notes_.push_back(fmt::format("no colors: intensity, {:g} to {:g}, is taken as gray", least, greatest));
    } else if (roles.intensity >= 0) {
      notes_.emplace_back("no colors, and no intensity that differs: points are white");
    }
    return {};
  }

  Status read(const Sink& sink) const override {
    const bool has_color = header_.roles.color >= 0, has_alpha = header_.roles.has_alpha;
    return walk(sink, [&](const Raw& raw, CloudPoint& point) {
      point.at = raw.at;
      if (raw.color && has_color) {
        point.color = {static_cast<uint8_t>(*raw.color >> 16), static_cast<uint8_t>(*raw.color >> 8),
                       static_cast<uint8_t>(*raw.color)};
        if (has_alpha) point.alpha = static_cast<uint8_t>(*raw.color >> 24);
      } else if (range_ > 0) {
        // Written so that a NaN becomes 0.
        const double share = (raw.intensity - least_) / range_;
        point.color.fill(static_cast<uint8_t>(share > 0 ? std::lround(255 * std::min(share, 1.0)) : 0));
      }
    });
  }

 private:
  const Field& field(int index) const { return header_.fields[static_cast<size_t>(index)]; }

  /// `use(raw, point)` makes a point of what the file has.
  template <class Use>
  Status walk(const Sink& sink, const Use& use) const {
    CloudPoint blank;
    blank.color = {255, 255, 255};
    if (header_.data == Data::ascii) return walk_text(blank, sink, use);
    return columns_ ? walk_columns(blank, sink, use) : walk_rows(blank, sink, use);
  }

  template <class Use>
  Status walk_rows(const CloudPoint& blank, const Sink& sink, const Use& use) const {
    ReadBytes before(data_);
    return read_in_runs(
        size_, blank, sink,
        [&](uint64_t i, CloudPoint& point) -> Result<bool> {
          use(raw_at([&](const Field& f) { return data_.data() + i * header_.bytes + f.bytes; }), point);
          return true;
        },
        [&](uint64_t i) { before.release(i * header_.bytes); }, least_alpha_);
  }

  /// Of compressed files: all numbers of a field before those of the next.
  template <class Use>
  Status walk_columns(const CloudPoint& blank, const Sink& sink, const Use& use) const {
    std::vector<ReadBytes> before;
    for (const Field& f : header_.fields)
      before.emplace_back(data_.subspan(size_ * f.bytes, size_ * f.count * f.size));
    return read_in_runs(
        size_, blank, sink,
        [&](uint64_t i, CloudPoint& point) -> Result<bool> {
          use(raw_at([&](const Field& f) { return data_.data() + size_ * f.bytes + i * f.count * f.size; }),
              point);
          return true;
        },
        [&](uint64_t i) {
          for (size_t f = 0; f < before.size(); ++f)
            before[f].release(i * header_.fields[f].count * header_.fields[f].size);
        },
        least_alpha_);
  }

  template <class At>
  Raw raw_at(const At& at) const {
    const Roles& roles = header_.roles;
    Raw raw;
    for (int a = 0; a < 3; ++a) raw.at[a] = load(at(field(roles.at[a])), field(roles.at[a]));
    if (roles.color >= 0) raw.color = load_le<uint32_t>(at(field(roles.color)));
    if (roles.intensity >= 0) raw.intensity = load(at(field(roles.intensity)), field(roles.intensity));
    return raw;
  }

  /// A line a point.
  template <class Use>
  Status walk_text(const CloudPoint& blank, const Sink& sink, const Use& use) const {
    const auto* const text = reinterpret_cast<const char*>(data_.data());
    size_t at = 0;
    const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
    const auto skip = [&] {
      while (at < data_.size() && is_space(text[at])) ++at;
      return at < data_.size() && text[at] != '\n';
    };
    const auto bad = [&](size_t where, const std::string& why) {
      return bad_input(path_, fmt::format("corrupt PCD file: byte {}: {}", header_.end + where, why));
    };
    // Which words of a line count, and as what, ascending.
    struct Meaning {
      uint64_t word;
      int what;
      bool operator<(const Meaning& other) const { return word < other.word; }
    };
    std::vector<Meaning> meanings;
    const Roles& roles = header_.roles;
    const auto means = [&](int index, int what) {
      if (index >= 0) meanings.push_back({field(index).words, what});
    };
    for (int a = 0; a < 3; ++a) means(roles.at[a], a);
    means(roles.color, 3);
    means(roles.intensity, 4);
    std::sort(meanings.begin(), meanings.end());

    ReadBytes before(data_);
    const auto next = [&](uint64_t i, CloudPoint& point) -> Result<bool> {
      while (!skip()) {  // empty lines
        if (at == data_.size())
          return bad_input(path_, fmt::format("PCD file ends after {} of {} points", i, size_));
        ++at;
      }
      Raw raw;
      auto meaning = meanings.begin();
      for (uint64_t w = 0; w < header_.words; ++w) {
        if (!skip()) return bad(at, fmt::format("a line of {} numbers: expected {}", w, header_.words));
        const size_t begin = at;
        while (at < data_.size() && !is_space(text[at]) && text[at] != '\n') ++at;
        if (meaning == meanings.end() || meaning->word != w) continue;
        const int what = (meaning++)->what;
        const std::string_view word(text + begin, at - begin);
        const bool sound = what < 3    ? parse(word, raw.at[what])
                           : what == 3 ? parse_color(word, field(roles.color), raw.color)
                                       : parse(word, raw.intensity);
        if (!sound) return bad(begin, "expected a number");
      }
      if (skip()) return bad(at, fmt::format("a line of more than {} numbers", header_.words));
      use(raw, point);
      if (i + 1 == size_) {
        for (; at < data_.size(); ++at)
          if (skip()) return bad(at, fmt::format("more than the {} points of its header", size_));
      }
      return true;
    };
    return read_in_runs(
        size_, blank, sink, next, [&](uint64_t) { before.release(at); }, least_alpha_);
  }

  std::shared_ptr<const MappedFile> file_;
  std::string path_;
  Header header_;
  std::span<const std::byte> data_;
  bool columns_ = false;
  uint8_t least_alpha_ = 128;
  double least_ = 0, range_ = 0;  ///< of intensities
};

/// The data of a compressed file, in a file of its own.
Result<std::shared_ptr<const MappedFile>> unpack(const MappedFile& file, const Header& header) {
  const auto data = file.bytes().subspan(header.end);
  const auto bad = [&](const std::string& why) {
    return bad_input(file.name(), fmt::format("corrupt PCD file: byte {}: {}", header.end, why));
  };
  if (data.size() < 8) return bad("expected the sizes of the packed data");
  const uint64_t packed = load_le<uint32_t>(data.data()), size = load_le<uint32_t>(data.data() + 4);
  if (size != header.points * header.bytes)
    return bad(fmt::format("unpacked data of {} bytes: expected {} points of {} bytes", size, header.points,
                           header.bytes));
  if (packed > data.size() - 8)
    return bad(fmt::format("{} packed bytes: there are {}", packed, data.size() - 8));
  TemporaryFile unpacked(file.name());
  VOX_CHECK(unpack_lzf(data.subspan(8, packed), size, file.name(),
                       [&](std::span<const std::byte> bytes) { return unpacked.write(bytes); }));
  release_bytes(data);
  return unpacked.map();
}

}  // namespace

Result<std::unique_ptr<const PointCloud>> open_pcd_points(const std::string& path,
                                                          const PointExtras& wanted) {
  VOX_TRY(auto file, MappedFile::open(path));
  VOX_TRY(Header header, read_header(file->bytes(), path));
  if (header.points == 0) return bad_input(path, "no points");
  auto data = file->bytes().subspan(header.end);
  if (header.data == Data::compressed) {
    VOX_TRY(file, unpack(*file, header));
    data = file->bytes();
  }
  // Of text at least a digit and what ends it.
  const uint64_t least = header.points * (header.data == Data::ascii ? 2 * header.words : header.bytes);
  if (data.size() + (header.data == Data::ascii) < least)
    return bad_input(path, fmt::format("PCD file ends after {} bytes: expected {} points",
                                       file->bytes().size(), header.points));
  auto points = std::make_unique<PcdPointCloud>(std::move(file), path, std::move(header), data, wanted);
  VOX_CHECK(points->look_through());
  return points;
}

}  // namespace voxkit
