#include "tools/common/json.h"

#include <fmt/core.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

namespace voxkit::cli {

using Ordered = nlohmann::ordered_json;

struct Json::Value {
  Ordered json;
};

namespace {

Ordered real(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  return value;
}

}  // namespace

Json::Json(std::unique_ptr<Value> value) : value_(std::move(value)) {}
Json::Json(Json&&) noexcept = default;
Json& Json::operator=(Json&&) noexcept = default;
Json::~Json() = default;

Json Json::object() {
  return Json(std::make_unique<Value>(Value{Ordered::object()}));
}
Json Json::array() {
  return Json(std::make_unique<Value>(Value{Ordered::array()}));
}
Json Json::result() {
  return std::move(object().set("schema", 1));
}

Json& Json::set(const std::string& key, std::string_view value) {
  value_->json[key] = value;
  return *this;
}
Json& Json::set(const std::string& key, Index3 value) {
  value_->json[key] = {value.x, value.y, value.z};
  return *this;
}
Json& Json::set(const std::string& key, Json value) {
  value_->json[key] = std::move(value.value_->json);
  return *this;
}
Json& Json::push(Json value) {
  value_->json.push_back(std::move(value.value_->json));
  return *this;
}
Json& Json::push(std::string_view value) {
  value_->json.push_back(value);
  return *this;
}
Json& Json::push(double value) {
  value_->json.push_back(real(value));
  return *this;
}
Json& Json::push(int64_t value) {
  value_->json.push_back(value);
  return *this;
}
Json& Json::set_real(const std::string& key, double value) {
  value_->json[key] = real(value);
  return *this;
}
Json& Json::set_bool(const std::string& key, bool value) {
  value_->json[key] = value;
  return *this;
}
Json& Json::set_signed(const std::string& key, int64_t value) {
  value_->json[key] = value;
  return *this;
}
Json& Json::set_unsigned(const std::string& key, uint64_t value) {
  value_->json[key] = value;
  return *this;
}

std::string Json::text() const {
  // File names may be no UTF-8.
  return value_->json.dump(2, ' ', false, Ordered::error_handler_t::replace) + "\n";
}

std::string Json::line() const {
  return value_->json.dump(-1, ' ', false, Ordered::error_handler_t::replace) + "\n";
}

std::string readable(double value) {
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  return fmt::format("{:.6g}", value);
}

}  // namespace voxkit::cli
