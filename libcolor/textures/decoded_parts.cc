#include "libcolor/textures/decoded_parts.h"

#include <algorithm>

#include "libcolor/blocks/block_layout.h"

namespace voxkit::color {
namespace {

constexpr uint64_t part_bytes = uint64_t{part_colors} * sizeof(Rgb);

}  // namespace

DecodedParts::DecodedParts(uint64_t parts, MemoryBudget& memory, uint64_t work_bytes, Decode decode)
    : count_(parts),
      memory_(memory),
      work_bytes_(work_bytes),
      decode_(std::move(decode)),
      slots_(std::make_unique<Slot[]>(parts)) {}

Result<std::shared_ptr<const DecodedParts::Part>> DecodedParts::get(uint64_t part) {
  Slot& slot = slots_[part];
  const std::lock_guard lock(slot.mutex);
  VOX_CHECK(slot.status);
  if (!slot.part) {
    auto decoded = decode(part);
    if (!decoded) {
      slot.status = tl::unexpected<Error>(decoded.error());
      return decoded;
    }
    slot.part = std::move(*decoded);
    ++kept_;
  }
  slot.used = ++calls_;
  return slot.part;
}

Result<std::shared_ptr<const DecodedParts::Part>> DecodedParts::decode(uint64_t part) {
  const uint64_t most = std::max<uint64_t>(memory_.limit() / 4 / part_bytes, 1);
  while (kept_ >= most && forget_one()) {
  }
  auto made = std::make_shared<Part>();
  made->reservation_ = Reservation(memory_);
  for (;;) {
    Status room = made->reservation_.add(part_bytes + work_bytes_, "decoding a part of colors");
    if (room) break;
    if (!forget_one()) return tl::unexpected<Error>(room.error());
  }
  VOX_TRY(made->colors_, decode_(part));
  made->reservation_.release(work_bytes_);
  return made;
}

bool DecodedParts::forget_one() {
  for (uint64_t tried = 0;;) {
    uint64_t oldest = ~uint64_t{0};
    Slot* found = nullptr;
    for (uint64_t i = 0; i < count_; ++i)
      if (const uint64_t used = slots_[i].used; used > tried && used < oldest) {
        oldest = used;
        found = &slots_[i];
      }
    if (found == nullptr) return false;
    tried = oldest;
    // A part that is being asked for stays.
    const std::unique_lock lock(found->mutex, std::try_to_lock);
    if (!lock || !found->part) continue;
    found->part.reset();
    found->used = 0;
    --kept_;
    return true;
  }
}

}  // namespace voxkit::color
