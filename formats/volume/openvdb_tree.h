// The tree of an OpenVDB grid as bytes: checked before OpenVDB reads it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "formats/result.h"

namespace voxkit {

/// How the values of a tree are stored; the flags are OpenVDB's.
struct VdbCoding {
  static constexpr uint32_t zip = 1, active_mask = 2, blosc = 4;
  uint32_t flags = 0;
  int value_bytes = 4;   ///< in memory, and of background and tile values
  int stored_bytes = 4;  ///< in blocks of values: fewer where floats are stored as halves
  bool bits = false;     ///< leaves hold bits: a mask, an origin, the values
};

struct VdbTree {
  uint64_t upper = 0, lower = 0, leaves = 0;  ///< nodes of 32^3, 16^3 and 8^3 entries
  uint64_t end = 0;                           ///< byte offset behind the tree
};

/// Walks through a tree of the usual configuration (5, 4, 3), file version 222 or later, that starts at byte
/// `start`. OpenVDB copies as many bytes into a node as a block of values says it has, whatever the node can
/// hold, and trusts the lengths within Blosc blocks; where this check passes, every block fits its node and
/// lies within the file.
Result<VdbTree> check_vdb_tree(std::span<const std::byte> file, const std::string& name, uint64_t start,
                               const VdbCoding& coding);

}  // namespace voxkit
