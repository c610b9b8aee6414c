// The one way work is spread over threads.
#pragma once

#include <cstdint>
#include <functional>

#include "formats/context.h"

namespace voxkit {

/// Threads this process may use: its affinity mask, bounded by the cgroup's CPU quota; at least 1.
int available_threads();

/// Runs body(0) … body(count - 1) on ctx.threads threads, in any order. Where several fail, the error of the
/// lowest index that failed is returned, and indices not yet started are skipped. Exceptions other than
/// bad_alloc must not leave the body; bad_alloc becomes ErrorCode::limit. Also checks for an interrupt before
/// each index.
Status parallel_for(const Context& ctx, int64_t count, const std::function<Status(int64_t)>& body);

}  // namespace voxkit
