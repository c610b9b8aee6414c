// A frame where kernels write it: memory of a backend that serves all pictures.
#pragma once

#include <mutex>

#include "librender/device/backend.h"
#include "librender/frame.h"

namespace voxkit::render {

struct FrameBuffers {
  DeviceArray<Pixel> pixels;
  DeviceArray<PixelDetail> details;
  DeviceArray<PixelCost> costs;
  std::mutex mutex;  ///< held while a picture is drawn

  Status reserve(const Backend& backend, uint64_t count, Context& ctx) {
    VOX_CHECK(backend.reserve(pixels, count, "the pixels of a frame", ctx));
    VOX_CHECK(backend.reserve(details, count, "the details of a frame", ctx));
    return backend.reserve(costs, count, "the costs of a frame", ctx);
  }
  /// `count` pixels and what belongs to them, to those of a frame with details and costs from `first` on.
  Status download(const Backend& backend, Frame& frame, size_t first, size_t count) const {
    const auto part = [&](auto& array) { return std::span(array).subspan(first, count); };
    VOX_CHECK(backend.download(pixels, 0, part(frame.pixels)));
    VOX_CHECK(backend.download(details, 0, part(frame.details)));
    return backend.download(costs, 0, part(frame.costs));
  }
};

}  // namespace voxkit::render
