#include "librender/frame.h"

#include <fmt/core.h>

#include <algorithm>

namespace voxkit::render {
namespace {

/// Bytes of an array once it has `count` elements: what it had before is not given back.
template <class T>
uint64_t bytes_of(const std::vector<T>& array, size_t count) {
  return std::max(array.capacity(), count) * sizeof(T);
}
template <class T>
void resize(std::vector<T>& array, size_t count) {
  if (array.capacity() < count) array = {};  // not both at once, and not twice as much
  array.resize(count);
}

}  // namespace

Status Frame::begin(const FrameJob& job, const Context& ctx) {
  const size_t count = job.rays(), detail_count = job.details ? count : 0, cost_count = job.costs ? count : 0,
               trait_count = job.traits.empty() ? 0 : count;
  held_ = Reservation(*ctx.memory);
  const Status status = held_.add(bytes_of(pixels, count) + bytes_of(details, detail_count) +
                                      bytes_of(costs, cost_count) + bytes_of(traits, trait_count),
                                  fmt::format("a frame of {} x {} rays", job.width, job.height));
  if (!status) {
    *this = Frame();
    return status;
  }
  width = job.width;
  height = job.height;
  resize(pixels, count);
  resize(details, detail_count);
  resize(costs, cost_count);
  traits.clear();
  traits.reserve(trait_count);
  has = {};
  static_cast<FrameCounts&>(*this) = {};
  rays = count;
  return {};
}

Status Frame::begin_traits(color::AttributeSet attributes, const Context&) {
  const size_t count = attributes.empty() ? 0 : pixels.size();
  VOX_CHECK(held_.add(bytes_of(traits, count) - bytes_of(traits, 0),
                      fmt::format("attributes of {} x {} pixels", width, height)));
  resize(traits, count);
  has = attributes;
  return {};
}

}  // namespace voxkit::render
