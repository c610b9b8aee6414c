// What casting or direct volume rendering leaves: a picture before shading, and what it cost.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/reservation.h"
#include "libcolor/surface/attributes.h"
#include "librender/pixel.h"

namespace voxkit::render {

/// What a frame is to hold.
struct FrameJob {
  int width = 0, height = 0;        ///< rays, 1 and more
  bool details = false;             ///< a PixelDetail for each
  bool costs = false;               ///< a PixelCost for each
  color::AttributeSet traits = {};  ///< if any, a PixelTraits for each

  uint64_t rays() const { return static_cast<uint64_t>(width) * static_cast<uint64_t>(height); }
  /// Of memory.
  uint64_t bytes() const {
    return rays() * (sizeof(Pixel) + (details ? sizeof(PixelDetail) : 0) + (costs ? sizeof(PixelCost) : 0) +
                     (traits.empty() ? 0 : sizeof(PixelTraits)));
  }
};

/// What a picture cost.
struct FrameCounts {
  uint64_t rays = 0, rays_hit = 0;
  uint64_t cells_visited = 0;   ///< of one value each, whatever their size; dvr: places looked at, each of up
                                ///< to 8 rays
  uint64_t blocks_touched = 0;  ///< times that a block was entered, or a brick decoded
  uint64_t bytes_touched = 0;   ///< of links and values looked at
  uint64_t samples = 0;         ///< dvr: taken
  uint64_t bricks_decoded = 0;  ///< dvr: places of bricks that were decoded, each counted once
  uint64_t pages_decoded = 0;   ///< of packed volumes; not those that were kept from before
  double seconds = 0;           ///< of casting alone
  double lookup_seconds = 0;    ///< of that, for colours that were looked up afterwards
};

/// The pixels of a picture before shading, row by row from the top, and what they cost. Its memory serves one
/// picture after the other.
struct Frame : FrameCounts {
  int width = 0, height = 0;
  std::vector<Pixel> pixels;
  std::vector<PixelDetail> details;  ///< as many, or none
  std::vector<PixelCost> costs;      ///< as many, or none
  std::vector<PixelTraits> traits;   ///< as many, or none
  color::AttributeSet has;           ///< what of them is known

  /// Gives the frame the size of `job` and what that wants, all counts but `rays` being 0; what pixels hold
  /// is left to whoever draws. What the frame has of memory counts against ctx.memory, which must outlive it.
  /// Errors: ErrorCode::limit; then it holds nothing.
  Status begin(const FrameJob& job, const Context& ctx);
  /// Room for the traits of all pixels, of which these become known; none of no attributes. Errors:
  /// ErrorCode::limit.
  Status begin_traits(color::AttributeSet attributes, const Context& ctx);

 private:
  Reservation held_;
};

}  // namespace voxkit::render
