// The result of a tool as a JSON object.
#pragma once

#include <concepts>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "formats/volume.h"

namespace voxkit::cli {

/// A JSON object whose keys keep their order, or an array.
class Json {
 public:
  static Json object();
  static Json array();
  /// An object with "schema": 1, as every result is.
  static Json result();
  Json(Json&&) noexcept;
  Json& operator=(Json&&) noexcept;
  ~Json();

  Json& set(const std::string& key, std::string_view value);
  Json& set(const std::string& key, const char* value) { return set(key, std::string_view(value)); }
  /// Infinity is "inf" or "-inf", no number "nan".
  Json& set(const std::string& key, std::floating_point auto value) {
    return set_real(key, static_cast<double>(value));
  }
  template <std::integral T>
  Json& set(const std::string& key, T value) {
    if constexpr (std::same_as<T, bool>) {
      return set_bool(key, value);
    } else if constexpr (std::signed_integral<T>) {
      return set_signed(key, value);
    } else {
      return set_unsigned(key, value);
    }
  }
  /// [x, y, z]
  Json& set(const std::string& key, Index3 value);
  Json& set(const std::string& key, Json value);
  Json& push(Json value);
  Json& push(std::string_view value);
  Json& push(double value);
  Json& push(int64_t value);

  /// Text of the whole, with a line feed at its end.
  std::string text() const;
  /// The same in one line.
  std::string line() const;

 private:
  struct Value;
  explicit Json(std::unique_ptr<Value> value);
  Json& set_real(const std::string& key, double value);
  Json& set_bool(const std::string& key, bool value);
  Json& set_signed(const std::string& key, int64_t value);
  Json& set_unsigned(const std::string& key, uint64_t value);
  std::unique_ptr<Value> value_;
};

/// A number for people: "inf", or a few digits.
std::string readable(double value);

}  // namespace voxkit::cli
