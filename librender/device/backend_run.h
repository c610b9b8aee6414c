// Running kernels on whatever backend it is: on threads right here, on a GPU by what cuda_run.h has compiled.
#pragma once

#include <cstring>

#include "formats/clock.h"
#include "formats/parallel.h"
#include "librender/device/backend.h"
#include "librender/dvr/dvr_lanes.h"

namespace voxkit::render {

/// Calls body(first, last) for pieces of 0 … count, on threads; returns how long that took.
template <class Body>
Result<double> run_on_threads(int64_t count, int64_t piece, const Context& ctx, const Body& body) {
  const auto start = Clock::now();
  VOX_CHECK(parallel_for(ctx, (count + piece - 1) / piece, [&](int64_t i) -> Status {
    body(i * piece, std::min(count, (i + 1) * piece));
    return {};
  }));
  return seconds_since(start);
}

template <class Kernel>
Result<double> Backend::run(const char* name, int64_t count, const Kernel& kernel, Context& ctx) const {
  if (count <= 0) return 0.0;
  if (kind_ == BackendKind::cuda) {
#ifdef VOXKIT_CUDA
    if constexpr (requires { Kernel::on_devices; }) return run_on_cuda(name, count, kernel);
#endif
    return not_on_devices(name);
  }
  return run_on_threads(count, 1024, ctx, [&](int64_t first, int64_t last) {
    for (int64_t i = first; i < last; ++i) kernel(i);
  });
}

template <class Kernel>
Result<double> Backend::run_groups(const char* name, const Kernel& kernel, Context& ctx) const {
  using Lanes = PortableLanes;
  const int64_t count = kernel.template groups<Lanes>();
  if (count <= 0) return 0.0;
  if (kind_ == BackendKind::cuda) {
#ifdef VOXKIT_CUDA
    if constexpr (requires { Kernel::on_devices; }) return run_groups_on_cuda(name, kernel);
#endif
    return not_on_devices(name);
  }
  return run_on_threads(count, 16, ctx, [&](int64_t first, int64_t last) {
    typename Kernel::Shared shared;
    for (int64_t i = first; i < last; ++i) {
      std::memset(&shared, 0xa5, sizeof shared);  // nothing of the group before is left
      kernel.template operator()<Lanes>(i, shared);
    }
  });
}

}  // namespace voxkit::render
