#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/mesh/ply_file.h"
#include "formats/mesh/point_runs.h"

namespace voxkit {
namespace {

using namespace ply;

/// Sets what of a point a property is.
class PointFields {
 public:
  explicit PointFields(const Element& element) : colors_(element.has(Role::red)) {}

  CloudPoint blank() const {
    CloudPoint point;
    if (!colors_) point.color = {255, 255, 255};
    return point;
  }
  void set(const Property& property, double value, CloudPoint& point) const {
    if (property.role >= Role::x && property.role <= Role::z) {
      point.at[static_cast<int>(property.role) - static_cast<int>(Role::x)] = value;
    } else if (property.role >= Role::red && property.role <= Role::blue && colors_) {
      const double stored = value * scale_of(property.type);
      point.color[static_cast<size_t>(property.role) - static_cast<size_t>(Role::red)] = byte_of(stored);
    } else if (property.role == Role::alpha) {
      point.alpha = byte_of(value * scale_of(property.type));
    }
  }

 private:
  /// Written so that a NaN becomes 0.
  static uint8_t byte_of(double share) {
    return static_cast<uint8_t>(share > 0 ? std::lround(255 * std::min(share, 1.0)) : 0);
  }
  bool colors_;
};

class PlyPointCloud final : public PointCloud {
 public:
  PlyPointCloud(std::shared_ptr<const MappedFile> file, Header header, size_t vertices)
      : file_(std::move(file)), header_(std::move(header)), vertices_(vertices) {
    size_ = header_.elements[vertices_].count;
    notes_ = header_.notes();
  }

  Status read(const Sink& sink) const override {
    const auto bytes = file_->bytes();
    Numbers numbers(bytes, header_, file_->name());
    for (size_t i = 0; i < vertices_; ++i) {
      const Element& before = header_.elements[i];
      VOX_CHECK(numbers.check_count(before));
      for (uint64_t k = 0; k < before.count && !before.properties.empty(); ++k)
        for (const Property& property : before.properties) VOX_CHECK(numbers.pass(property));
    }
    const Element& element = header_.elements[vertices_];
    VOX_CHECK(numbers.check_count(element));
    const PointFields fields(element);
    const bool lists = std::any_of(element.properties.begin(), element.properties.end(),
                                   [](const Property& p) { return p.list; });
    const CloudPoint blank = fields.blank();
    ReadBytes before(bytes);
    if (header_.ascii || lists)
      return read_in_runs(
          size_, blank, sink,
          [&](uint64_t, CloudPoint& point) -> Result<bool> {
            for (const Property& property : element.properties) {
              if (property.role == Role::none) {
                VOX_CHECK(numbers.pass(property));
                continue;
              }
              VOX_TRY(const double value, numbers.next(property.type));
              fields.set(property, value, point);
            }
            return true;
          },
          [&](uint64_t) { before.release(numbers.at()); });
    // All points take as many bytes, and these were counted.
    size_t stride = 0;
    for (const Property& property : element.properties) stride += bytes_of(property.type);
    const size_t first = numbers.at();
    return read_in_runs(
        size_, blank, sink,
        [&](uint64_t i, CloudPoint& point) -> Result<bool> {
          const std::byte* at = bytes.data() + first + i * stride;
          for (const Property& property : element.properties) {
            if (property.role != Role::none)
              fields.set(property, load(at, property.type, header_.big_endian), point);
            at += bytes_of(property.type);
          }
          return true;
        },
        [&](uint64_t i) { before.release(first + i * stride); });
  }

 private:
  std::shared_ptr<const MappedFile> file_;
  Header header_;
  size_t vertices_;  ///< which element they are
};

}  // namespace

Result<std::unique_ptr<const PointCloud>> open_ply_points(const std::string& path) {
  VOX_TRY(auto file, MappedFile::open(path));
  VOX_TRY(Header header, read_header(file->bytes(), path));
  size_t vertices = header.elements.size();
  for (size_t i = header.elements.size(); i-- > 0;) {
    const Element& element = header.elements[i];
    if (element.has(Role::corners) && element.count > 0) return nullptr;
    if (element.name == "vertex") vertices = i;
  }
  if (vertices == header.elements.size() || !header.elements[vertices].has(Role::x) ||
      !header.elements[vertices].has(Role::y) || !header.elements[vertices].has(Role::z))
    return bad_input(path, "corrupt PLY file: expected one list of vertices with x, y and z");
  if (header.elements[vertices].count == 0) return bad_input(path, "no points");
  return std::make_unique<const PlyPointCloud>(std::move(file), std::move(header), vertices);
}

}  // namespace voxkit
