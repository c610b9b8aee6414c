#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "formats/mesh/ply_file.h"
#include "formats/mesh/point_runs.h"

namespace voxkit {
namespace {

using namespace ply;

/// Written so that a NaN becomes 0.
uint8_t byte_of(double share) {
  return static_cast<uint8_t>(share > 0 ? std::lround(255 * std::min(share, 1.0)) : 0);
}

/// A label as 32 bits; what is below 0 counts back from 2^32.
uint32_t label_of(double value) {
  constexpr double most = 4294967295.0;
  if (!(value >= -most && value <= most)) return 0;
  return static_cast<uint32_t>(std::llround(value));
}

/// What numbers are grey.
struct Grays {
  double least = 0, range = 0;
};

/// Sets what of a point a property is.
class PointFields {
 public:
  PointFields(const Element& element, const Grays& grays) : colors_(element.has(Role::red)), grays_(grays) {}

  CloudPoint blank() const {
    CloudPoint point;
    if (!colors_) point.color = {255, 255, 255};
    return point;
  }
  void set(const Property& property, double value, CloudPoint& point) const {
    switch (property.role) {
      case Role::x:
      case Role::y:
      case Role::z:
        point.at[static_cast<int>(property.role) - static_cast<int>(Role::x)] = value;
        break;
      case Role::red:
      case Role::green:
      case Role::blue:
        if (colors_)
          point.color[static_cast<size_t>(property.role) - static_cast<size_t>(Role::red)] =
              byte_of(value * scale_of(property.type));
        break;
      case Role::alpha:
        point.alpha = byte_of(value * scale_of(property.type));
        break;
      case Role::nx:
      case Role::ny:
      case Role::nz:
        point.normal[static_cast<int>(property.role) - static_cast<int>(Role::nx)] =
            static_cast<float>(value);
        break;
      case Role::roughness:
        point.roughness = byte_of(value * scale_of(property.type));
        break;
      case Role::metalness:
        point.metalness = byte_of(value * scale_of(property.type));
        break;
      case Role::emissive_red:
      case Role::emissive_green:
      case Role::emissive_blue:
        point.emission[static_cast<size_t>(property.role) - static_cast<size_t>(Role::emissive_red)] =
            byte_of(value * scale_of(property.type));
        break;
      case Role::label:
        point.label = label_of(value);
        break;
      case Role::intensity:
        if (grays_.range > 0) point.color.fill(byte_of((value - grays_.least) / grays_.range));
        break;
      default:
        break;
    }
  }

 private:
  bool colors_;
  Grays grays_;
};

class PlyPointCloud final : public PointCloud {
 public:
  PlyPointCloud(std::shared_ptr<const MappedFile> file, Header header, size_t vertices,
                const PointExtras& wanted)
      : file_(std::move(file)),
        header_(std::move(header)),
        vertices_(vertices),
        least_alpha_(wanted.alpha ? 1 : 128) {
    const Element& element = header_.elements[vertices_];
    size_ = element.count;
    has_ = {.alpha = element.has(Role::alpha),
            .normals = element.has(Role::nx) && element.has(Role::ny) && element.has(Role::nz),
            .rm = element.has(Role::roughness) || element.has(Role::metalness),
            .labels = element.has(Role::label),
            .emission = element.has(Role::emissive_red) && element.has(Role::emissive_green) &&
                        element.has(Role::emissive_blue)};
    grid_ = header_.grid;
    if (!wanted.normals || !has_.normals) header_.drop(Role::nx, Role::nz);
    if (!wanted.rm) header_.drop(Role::roughness, Role::metalness);
    if (!wanted.emission || !has_.emission) header_.drop(Role::emissive_red, Role::emissive_blue);
    if (!wanted.labels) header_.drop(Role::label, Role::label);
    if (element.has(Role::red)) header_.drop(Role::intensity, Role::intensity);
    notes_ = header_.notes();
  }

  /// What must be known of all points before the first: the greatest intensity, where that is grey.
  Status look_through() {
    const Element& element = header_.elements[vertices_];
    if (!element.has(Role::intensity)) return {};
    double least = 0, greatest = -std::numeric_limits<double>::infinity();
    VOX_CHECK(walk([](std::span<const CloudPoint>) -> Status { return {}; },
                   [&](const Property& property, double value, CloudPoint&) {
                     if (property.role != Role::intensity || !std::isfinite(value)) return;
                     least = std::min(least, value);
                     greatest = std::max(greatest, value);
                   }));
    if (greatest > least) {
      grays_ = {least, greatest - least};
      notes_.push_back(fmt::format("no colors: intensity, {:g} to {:g}, is taken as gray", least, greatest));
    } else {
      notes_.emplace_back("no colors, and no intensity that differs: points are white");
    }
    return {};
  }

  Status read(const Sink& sink) const override {
    const PointFields fields(header_.elements[vertices_], grays_);
    return walk(sink, [&](const Property& property, double value, CloudPoint& point) {
      fields.set(property, value, point);
    });
  }

 private:
  /// `set(property, value, point)` for what of a point has a role.
  template <class Set>
  Status walk(const Sink& sink, const Set& set) const {
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
    const bool lists = std::any_of(element.properties.begin(), element.properties.end(),
                                   [](const Property& p) { return p.list; });
    const CloudPoint blank = PointFields(element, grays_).blank();
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
              set(property, value, point);
            }
            return true;
          },
          [&](uint64_t) { before.release(numbers.at()); }, least_alpha_);
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
              set(property, load(at, property.type, header_.big_endian), point);
            at += bytes_of(property.type);
          }
          return true;
        },
        [&](uint64_t i) { before.release(first + i * stride); }, least_alpha_);
  }

  std::shared_ptr<const MappedFile> file_;
  Header header_;
  size_t vertices_;  ///< which element they are
  uint8_t least_alpha_;
  Grays grays_;
};

}  // namespace

Result<std::unique_ptr<const PointCloud>> open_ply_points(const std::string& path,
                                                          const PointExtras& wanted) {
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
  auto points = std::make_unique<PlyPointCloud>(std::move(file), std::move(header), vertices, wanted);
  VOX_CHECK(points->look_through());
  return points;
}

}  // namespace voxkit
