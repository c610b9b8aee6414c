#include "tools/common/attributes.h"

#include <fmt/format.h>

#include <algorithm>

#include "libcolor/attributes/attribute_selection.h"
#include "libcolor/part_codecs.h"

namespace voxkit::cli {
namespace {

std::vector<std::string> parts_of(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ',')
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

std::optional<color::Attribute> attribute_named(std::string_view name) {
  for (size_t i = 0; i < color::attribute_kinds.size(); ++i)
    if (color::attribute_kinds[i].name == name) return static_cast<color::Attribute>(i);
  return std::nullopt;
}

/// Whether all values are as they were.
bool is_lossless(const color::AttributeParams& p) {
  return !color::has_threshold(p.codec) || p.most_error == 0;
}

std::string_view unit_of(const color::AttributeParams& p) {
  return p.space == color::ErrorSpace::angle ? " degrees"
         : p.space == color::ErrorSpace::lab ? " in CIELAB"
                                             : "";
}

}  // namespace

Parser attribute_list(std::optional<color::AttributeSet>& value) {
  return [&value](const std::string& text) -> Status {
    color::AttributeSet set;
    bool color = false;
    for (const std::string& part : parts_of(text)) {
      const auto attribute = attribute_named(part);
      color |= part == "color";
      if (attribute) set.add(*attribute);
      if (!attribute && part != "color")
        return bad_usage(fmt::format("\"{}\": expected color, emissive, opacity, normal, rm or id", part));
    }
    if (!color) return bad_usage(fmt::format("\"{}\": expected color among them", text));
    value = set;
    return {};
  };
}

Parser attribute_thresholds(Thresholds& value) {
  return [&value](const std::string& text) -> Status {
    for (const std::string& part : parts_of(text)) {
      const size_t sign = part.find('=');
      const auto attribute = attribute_named(part.substr(0, sign));
      if (sign == std::string::npos || !attribute || *attribute == color::Attribute::id)
        return bad_usage(
            fmt::format("\"{}\": expected emissive, opacity, normal or rm, and =E, such as opacity=4", part));
      std::optional<double>& threshold = value[static_cast<size_t>(*attribute)];
      if (threshold) return bad_usage(fmt::format("\"{}\": expected each attribute once", part));
      VOX_TRY(threshold, read_number(part.substr(sign + 1), 0, 1e6));
    }
    return {};
  };
}

std::string names_of(color::AttributeSet set) {
  std::string names;
  for (size_t i = 0; i < color::attribute_kinds.size(); ++i)
    if (set.has(static_cast<color::Attribute>(i)))
      names += fmt::format("{}{}", names.empty() ? "" : ", ", color::attribute_kinds[i].name);
  return names;
}

color::AttributeSet without(color::AttributeSet a, color::AttributeSet b) {
  for (size_t i = 0; i < color::attribute_kinds.size(); ++i)
    if (b.has(static_cast<color::Attribute>(i))) a.remove(static_cast<color::Attribute>(i));
  return a;
}

Result<std::unique_ptr<color::SurfaceSource>> with_wanted(std::unique_ptr<color::SurfaceSource> source,
                                                          const std::optional<color::AttributeSet>& wanted,
                                                          const std::string& name) {
  if (!wanted) return source;
  const color::AttributeSet has = source->attributes();
  if (const std::string missing = names_of(without(*wanted, has)); !missing.empty())
    return fail(ErrorCode::usage, name,
                fmt::format("--attributes: it has no {}: expected some of color{}{}", missing,
                            has.empty() ? "" : ", ", names_of(has)));
  return color::with_attributes(std::move(source), *wanted);
}

Json attributes_json(std::span<const color::AttributeParams> attributes, uint64_t voxels) {
  Json list = Json::array();
  for (const color::AttributeParams& p : attributes) {
    Json one = Json::object();
    one.set("name", color::kind_of(p.attribute).name).set("codec", color::part_codec(p.codec).name);
    one.set("bytes", p.bytes);
    one.set("bits_per_voxel",
            8 * static_cast<double>(p.bytes) / static_cast<double>(std::max<uint64_t>(voxels, 1)));
    if (color::has_threshold(p.codec)) one.set("threshold", p.threshold);
    one.set("most_error", p.most_error).set("lossless", is_lossless(p));
    list.push(std::move(one));
  }
  return list;
}

std::string attributes_text(std::span<const color::AttributeParams> attributes, uint64_t values) {
  std::string text;
  for (const color::AttributeParams& p : attributes) {
    text +=
        fmt::format("{:<12}{}, {} bytes ({:.4g} bits each), ", color::kind_of(p.attribute).name,
                    color::part_codec(p.codec).name, p.bytes,
                    8 * static_cast<double>(p.bytes) / static_cast<double>(std::max<uint64_t>(values, 1)));
    text += is_lossless(p) ? "exact"
                           : fmt::format("greatest error {:.4g}{}, threshold {:.6g}", p.most_error,
                                         unit_of(p), p.threshold);
    text += "\n";
  }
  return text;
}

std::string attribute_bytes_text(std::span<const color::AttributeParams> attributes) {
  std::string text;
  for (const color::AttributeParams& p : attributes)
    text += fmt::format(", {} {}", color::kind_of(p.attribute).name, p.bytes);
  return text;
}

std::string broken_attributes(const color::SurfaceDiff& diff,
                              std::span<const color::AttributeParams> attributes) {
  if (!diff.same_attributes) return "attributes are missing";
  for (size_t i = 0; i < diff.attributes.size(); ++i) {
    const color::AttributeParams& p = attributes[i];
    const double bound = color::has_threshold(p.codec) ? p.threshold : 0;
    if (diff.attributes[i].most_error > bound)
      return fmt::format("{}, greatest error {:.6g}{}: expected at most {}", color::kind_of(p.attribute).name,
                         diff.attributes[i].most_error, unit_of(p), bound);
  }
  return {};
}

}  // namespace voxkit::cli
