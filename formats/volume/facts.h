// What is known of a volume beside its voxels, as files say it: in lines for people, in fields of text, in
// units.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/context.h"
#include "formats/volume.h"

namespace voxkit {

/// "a", "a and b", "a, b and c".
std::string listed(const std::vector<std::string>& words);

/// What a format has a place for.
struct Holds {
  bool place = false;  ///< spacing and origin of axes along those of the world, at least
  bool directions = false;
  bool world = false;
  bool unit = false;
  bool scale = false;  ///< slope and intercept
  bool description = false;
  bool labels = false;
  bool fill = false;
};
/// What is known of a volume that a format has no place for, in words.
std::vector<std::string> not_held(const VolumeInfo& info, const Holds& holds);
/// One note, "FILE: FORMAT cannot hold WHAT: dropped"; none where the list is empty.
void note_dropped(const std::string& file, std::string_view format, const std::vector<std::string>& what,
                  Context& ctx);

/// The text of a field of fixed size, up to its first zero: without blanks at its ends, control characters
/// as blanks. What is no UTF-8 is taken as Latin-1.
std::string text_field(std::string_view bytes);
/// As much of a text of UTF-8 as `most` bytes hold, in whole characters.
std::string cut_text(const std::string& text, size_t most);

/// The same places in another unit, both known: times or divided by a power of ten, but for inches.
Affine in_unit(const Affine& affine, Unit from, Unit to);

/// Axes that are zero, of sides of one voxel, become as long as `steps` says (or 1), at right angles to the
/// others.
void complete_axes(Affine& affine, const Affine::Vector& steps);

}  // namespace voxkit
