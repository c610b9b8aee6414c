#include "librender/camera_file.h"

#include <fmt/core.h>

#include <cmath>
#include <glm/common.hpp>
#include <nlohmann/json.hpp>
#include <optional>

#include "formats/mapped_file.h"

namespace voxkit::render {
namespace {

using Json = nlohmann::json;

constexpr size_t largest_file = size_t{16} << 20;
constexpr int most_frames = 100000;

/// A frame that the file states.
struct Key {
  std::optional<glm::dvec3> eye, target, orbit;
  std::optional<double> fov, at;
};

Camera camera_between(const Key& a, const Key& b, double share) {
  const double fov = glm::mix(*a.fov, *b.fov, share);
  if (a.orbit) {
    const glm::dvec3 orbit = glm::mix(*a.orbit, *b.orbit, share);
    return Camera::orbit(orbit.x, orbit.y, orbit.z, fov);
  }
  return {glm::mix(*a.eye, *b.eye, share), glm::mix(*a.target, *b.target, share), fov};
}

/// Follows the parser through a file and stops it at the first thing that does not belong there, so nothing
/// is held but the cameras, however deep or long the file is.
class PathReader : public nlohmann::json_sax<Json> {
 public:
  explicit PathReader(double fov) : fov_(fov) {}

  std::vector<Camera> take_cameras() { return std::move(cameras_); }
  const std::string& error() const { return error_; }

  bool start_object(size_t) override {
    if (place_ == Place::file) return enter(Place::members);
    if (place_ != Place::frames) return unexpected("an object");
    key_ = {};
    ++keys_;
    return enter(Place::frame);
  }
  bool end_object() override {
    if (place_ == Place::frame) return add(key_) && enter(Place::frames);
    if (!frames_seen_) return wrong("no \"frames\"", form);
    return true;
  }
  bool start_array(size_t) override {
    if (place_ == Place::members && !name_.empty()) return enter(Place::frames);
    if (place_ != Place::frame || name_ == "fov" || name_ == "at") return unexpected("an array");
    count_ = 0;
    return enter(Place::numbers);
  }
  bool end_array() override {
    if (place_ == Place::frames) {
      if (keys_ == 0) return wrong("no frames", "at least one");
      name_.clear();
      return enter(Place::members);
    }
    if (count_ != 3) return wrong(fmt::format("\"{}\" has {} numbers", name_, count_), "3");
    if (name_ == "eye") key_.eye = numbers_;
    if (name_ == "target") key_.target = numbers_;
    if (name_ == "orbit") key_.orbit = numbers_;
    return enter(Place::frame);
  }
  bool key(std::string& name) override {
    if (place_ == Place::members) {
      if (name != "frames") return unknown(name, "\"frames\"");
      if (frames_seen_) return wrong("\"frames\" twice", "it once");
      frames_seen_ = true;
    } else {
      const bool seen = (name == "eye" && key_.eye) || (name == "target" && key_.target) ||
                        (name == "orbit" && key_.orbit) || (name == "fov" && key_.fov) ||
                        (name == "at" && key_.at);
      if (seen) return wrong("\"" + name + "\" twice", "it once");
      if (name != "eye" && name != "target" && name != "orbit" && name != "fov" && name != "at")
        return unknown(name, "eye, target, orbit, fov or at");
    }
    name_ = name;
    return true;
  }
  bool null() override { return unexpected("null"); }
  bool boolean(bool) override { return unexpected("true or false"); }
  bool string(std::string&) override { return unexpected("a text"); }
  bool binary(Json::binary_t&) override { return unexpected("binary data"); }
  bool number_integer(int64_t value) override { return number(static_cast<double>(value)); }
  bool number_unsigned(uint64_t value) override { return number(static_cast<double>(value)); }
  bool number_float(double value, const std::string&) override { return number(value); }
  bool parse_error(size_t position, const std::string&, const Json::exception& problem) override {
    const bool range = dynamic_cast<const Json::out_of_range*>(&problem) != nullptr;
    return wrong(fmt::format("{} at byte {}", range ? "a number too large" : "no JSON", position), form);
  }

 private:
  /// What the parser is in.
  enum class Place { file, members, frames, frame, numbers };
  static constexpr const char* form =
      "{\"frames\": [{\"eye\": [x, y, z]}, {\"orbit\": [az, el, dist]}, ...]}";

  bool enter(Place place) {
    place_ = place;
    return true;
  }
  bool wrong(const std::string& what, const std::string& expected) {
    const bool in_frame = place_ == Place::frame || place_ == Place::numbers;
    error_ = fmt::format("{}{}: expected {}", in_frame ? fmt::format("frames[{}]: ", keys_ - 1) : "", what,
                         expected);
    return false;
  }
  bool unknown(const std::string& name, const std::string& expected) {
    return wrong(fmt::format("unknown \"{}\"", name.substr(0, 40)), expected);
  }
  bool unexpected(const char* what) {
    switch (place_) {
      case Place::frames:
        return wrong(fmt::format("frames[{}] is {}", keys_, what), "an object");
      case Place::frame:
        return wrong(fmt::format("\"{}\" is {}", name_, what),
                     name_ == "fov" || name_ == "at" ? "a number" : "3 numbers in brackets");
      case Place::numbers:
        return wrong(fmt::format("\"{}\" holds {}", name_, what), "3 numbers");
      default:
        return wrong(fmt::format("{} is {}", place_ == Place::file ? "the file" : "\"frames\"", what), form);
    }
  }
  bool number(double value) {
    if (place_ == Place::frame && name_ == "fov") return key_.fov = value, true;
    if (place_ == Place::frame && name_ == "at") return key_.at = value, true;
    if (place_ != Place::numbers) return unexpected("a number");
    if (count_ < 3) numbers_[count_] = value;
    ++count_;
    return true;
  }

  /// Adds the cameras from the key frame before, which has been added, to `key`.
  bool add(Key& key) {
    if (key.eye.has_value() == key.orbit.has_value())
      return wrong(key.eye ? "\"eye\" and \"orbit\"" : "no \"eye\" and no \"orbit\"", "one of them");
    if (key.target && key.orbit) return wrong("\"target\" beside \"orbit\"", "it beside \"eye\"");
    if (key.orbit && !(std::abs(key.orbit->y) <= 90 && key.orbit->z > 0))
      return wrong("\"orbit\"", "an elevation from -90 to 90 and a distance above 0");
    if (key.eye && !key.target) key.target = glm::dvec3(0);
    if (!key.fov) key.fov = fov_;
    if (!(*key.fov >= least_fov && *key.fov <= greatest_fov))
      return wrong(fmt::format("\"fov\" is {}", *key.fov),
                   fmt::format("degrees from {} to {}", least_fov, greatest_fov));
    const double next = static_cast<double>(cameras_.size());
    if (next == most_frames) return wrong("too many frames", fmt::format("at most {}", most_frames));
    if (!key.at) key.at = next;
    if (!(*key.at >= next && *key.at < most_frames && *key.at == std::floor(*key.at)) ||
        (cameras_.empty() && *key.at != 0))
      return wrong(fmt::format("this is frame {}", *key.at),
                   cameras_.empty() ? "0, the first"
                                    : fmt::format("a whole number from {} to {}", next, most_frames - 1));
    if (*key.at > next && before_.orbit.has_value() != key.orbit.has_value())
      return wrong("frames between \"eye\" and \"orbit\"", "both the same");
    const double first = next - 1;  // the number of the frame before
    for (double frame = next; frame <= *key.at; ++frame) {
      const double share = frame == *key.at ? 1 : (frame - first) / (*key.at - first);
      cameras_.push_back(camera_between(frame == *key.at ? key : before_, key, share));
      if (const char* expected = expected_of(cameras_.back()))
        return wrong(fmt::format("frame {}", frame), expected);
    }
    before_ = key;
    return true;
  }

  double fov_;
  Place place_ = Place::file;
  bool frames_seen_ = false;
  std::string name_;      ///< of the member that is read
  size_t keys_ = 0;       ///< objects in "frames" so far
  int count_ = 0;         ///< of the numbers in brackets
  glm::dvec3 numbers_{};  ///< the first three of them
  Key key_, before_;
  std::vector<Camera> cameras_;
  std::string error_;
};

}  // namespace

Result<std::vector<Camera>> read_camera_file(const std::string& path, double fov) {
  VOX_TRY(const auto file, MappedFile::open(path));
  const auto bytes = file->bytes();
  if (bytes.size() > largest_file)
    return bad_input(
        path, fmt::format("a camera path of {} bytes: expected at most {}", bytes.size(), largest_file));
  PathReader reader(fov);
  const char* text = reinterpret_cast<const char*>(bytes.data());
  if (!Json::sax_parse(text, text + bytes.size(), &reader)) return bad_input(path, reader.error());
  return reader.take_cameras();
}

}  // namespace voxkit::render
