// Points in LAS files.
#include <fmt/format.h>

#include <algorithm>

#include "formats/little_endian.h"
#include "formats/mesh/las_file.h"
#include "formats/mesh/point_runs.h"

namespace voxkit {
namespace {

class LasPointCloud final : public PointCloud {
 public:
  LasPointCloud(std::shared_ptr<const MappedFile> file, las::Header header, bool labels)
      : file_(std::move(file)), header_(std::move(header)), all_(header_.points), labels_(labels) {
    has_.labels = true;
    notes_ = header_.notes;
  }

  /// What must be known of all points before the first: how many count, what their colours are.
  Status look_through() {
    uint16_t greatest_color = 0, greatest_intensity = 0;
    size_ = 0;
    const las::Header& h = header_;
    ReadBytes before(file_->bytes());
    VOX_CHECK(read_in_runs(
        all_, {}, [](std::span<const CloudPoint>) -> Status { return {}; },
        [&](uint64_t i, CloudPoint&) -> Result<bool> {
          const std::byte* const at = record(i);
          if (is_withheld(at)) return false;
          ++size_;
          greatest_intensity = std::max(greatest_intensity, load_le<uint16_t>(at + las::intensity_at));
          for (size_t c = 0; h.color != 0 && c < 3; ++c)
            greatest_color = std::max(greatest_color, load_le<uint16_t>(at + h.color + 2 * c));
          return false;
        },
        [&](uint64_t i) { before.release(record_at(i)); }));

    std::vector<std::string> dropped = h.fields_dropped;
    if (labels_) std::erase(dropped, "classification");
    if (greatest_color > 0) {
      color_ = h.color;
      shift_ = greatest_color > 255 ? 8 : 0;
      dropped.insert(dropped.begin(), "intensity");
      if (shift_ == 0) notes_.emplace_back("no color is above 255: colors are taken as of 8 bits, not of 16");
    } else {
      const char* const why = h.color != 0 ? "all colors are 0" : "no colors";
      greatest_intensity_ = greatest_intensity;
      notes_.push_back(greatest_intensity > 0
                           ? fmt::format("{}: intensity, 0 to {}, is taken as gray", why, greatest_intensity)
                           : fmt::format("{}, and no intensity: points are white", why));
    }
    notes_.push_back(fmt::format("dropped: {}", fmt::join(dropped, ", ")));
    if (size_ < all_)
      notes_.push_back(
          fmt::format("dropped: {} of {} points, which are marked as withheld", all_ - size_, all_));
    return size_ > 0 ? Status() : bad_input(file_->name(), "no points that are not marked as withheld");
  }

  Status read(const Sink& sink) const override {
    CloudPoint blank;
    blank.color = {255, 255, 255};
    const las::Header& h = header_;
    ReadBytes before(file_->bytes());
    return read_in_runs(
        all_, blank, sink,
        [&](uint64_t i, CloudPoint& point) -> Result<bool> {
          const std::byte* const at = record(i);
          if (is_withheld(at)) return false;
          for (int a = 0; a < 3; ++a) point.at[a] = load_le<int32_t>(at + 4 * a) * h.scale[a] + h.offset[a];
          if (labels_) point.label = std::to_integer<uint32_t>(at[h.label]) & h.label_mask;
          if (color_ != 0) {
            for (size_t c = 0; c < 3; ++c)
              point.color[c] = static_cast<uint8_t>(load_le<uint16_t>(at + color_ + 2 * c) >> shift_);
          } else if (greatest_intensity_ > 0) {
            const uint32_t stored = load_le<uint16_t>(at + las::intensity_at);
            point.color.fill(
                static_cast<uint8_t>((2 * 255 * stored + greatest_intensity_) / (2 * greatest_intensity_)));
          }
          return true;
        },
        [&](uint64_t i) { before.release(record_at(i)); });
  }

 private:
  size_t record_at(uint64_t i) const { return header_.begin + i * header_.stride; }
  const std::byte* record(uint64_t i) const { return file_->bytes().data() + record_at(i); }
  bool is_withheld(const std::byte* at) const {
    return (at[header_.flags] & header_.withheld) != std::byte{0};
  }

  std::shared_ptr<const MappedFile> file_;
  las::Header header_;
  uint64_t all_;  ///< points, also those that are withheld
  bool labels_;   ///< are wanted
  size_t color_ = 0;
  int shift_ = 0;                    ///< of colours
  uint32_t greatest_intensity_ = 0;  ///< 0: points are white
};

}  // namespace

Result<std::unique_ptr<const PointCloud>> open_las_points(const std::string& path,
                                                          const PointExtras& wanted) {
  VOX_TRY(auto file, MappedFile::open(path));
  VOX_TRY(las::Header header, las::read_header(file->bytes(), path));
  auto points = std::make_unique<LasPointCloud>(std::move(file), std::move(header), wanted.labels);
  VOX_CHECK(points->look_through());
  return points;
}

}  // namespace voxkit
