// The images of a surface's colours as files: written, and read back.
#pragma once

#include <memory>
#include <string>

#include "libcolor/tiles.h"
#include "tools/common/main.h"

namespace voxkit::cli {

/// The names of all tiles. Fails with ErrorCode::usage if `pattern` is none or ends like no tile.
Result<std::vector<std::string>> tile_names(const std::string& option, const std::string& pattern,
                                            const color::Params& params);

/// Writes a file for each part, which there must not be without --force. Returns how many.
Result<uint64_t> write_tiles(const color::Volume& volume, const std::string& pattern, Run& run);

/// A surface with the colours of tiles.
struct TiledSurface {
  std::unique_ptr<color::SurfaceSource> source;
  color::StoredPart stored;  ///< those that are stored as they are
};
/// The surface of a .dagc file with the colours of tiles that were written of it, to be encoded with
/// `options`.
Result<TiledSurface> open_tiled(const std::string& name, const std::string& pattern,
                                const color::Options& options, Context& ctx);

}  // namespace voxkit::cli
