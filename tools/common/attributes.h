// Attributes of surfaces as options, and what the tools say about them.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "libcolor/compare.h"
#include "libcolor/surface/surface.h"
#include "tools/common/json.h"
#include "tools/common/parse.h"

namespace voxkit::cli {

/// color,emissive,id …: what voxels have; color must be among it, and is no attribute.
Parser attribute_list(std::optional<color::AttributeSet>& value);
/// opacity=4,normal=2 …: by attribute.
using Thresholds = std::array<std::optional<double>, color::attribute_kinds.size()>;
Parser attribute_thresholds(Thresholds& value);

/// emissive, opacity …; empty of none.
std::string names_of(color::AttributeSet set);
/// Those of `a` that are not in `b`.
color::AttributeSet without(color::AttributeSet a, color::AttributeSet b);

/// A surface with the attributes that are wanted, or all that it has. ErrorCode::usage where it has not one.
Result<std::unique_ptr<color::SurfaceSource>> with_wanted(std::unique_ptr<color::SurfaceSource> source,
                                                          const std::optional<color::AttributeSet>& wanted,
                                                          const std::string& name);

/// What a file has: `attributes` of JSON; lines of vox-info; ", opacity 123", bytes of each.
Json attributes_json(std::span<const color::AttributeParams> attributes, uint64_t voxels);
std::string attributes_text(std::span<const color::AttributeParams> attributes, uint64_t values);
std::string attribute_bytes_text(std::span<const color::AttributeParams> attributes);

/// Which bound is broken by what a comparison found; empty if none is.
std::string broken_attributes(const color::SurfaceDiff& diff,
                              std::span<const color::AttributeParams> attributes);

}  // namespace voxkit::cli
