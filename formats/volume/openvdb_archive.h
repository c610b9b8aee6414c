// What reading and writing OpenVDB files share: the library's headers, our own metadata, its archive.
#pragma once

#include <openvdb/util/logging.h>
// What the library's templates say about damaged files goes to standard error, which is ours.
#undef OPENVDB_LOG_WARN
#define OPENVDB_LOG_WARN(message) static_cast<void>(0)
#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/openvdb.h>

#include <string>

#include "formats/volume/openvdb_grids.h"

#ifdef VOXKIT_OPENVDB_INSTANTIATED
// The library has these, and compiling them once more takes longer than all of this file.
namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {
extern template class Grid<FloatTree>;
extern template class Grid<DoubleTree>;
extern template class Grid<BoolTree>;
extern template class Grid<Int32Tree>;
extern template class Grid<Int64Tree>;
extern template class Grid<Vec3STree>;
extern template class Grid<Vec3ITree>;
namespace tree {
extern template class Tree<FloatTree::RootNodeType>;
extern template class Tree<DoubleTree::RootNodeType>;
extern template class Tree<BoolTree::RootNodeType>;
extern template class Tree<Int32Tree::RootNodeType>;
extern template class Tree<Int64Tree::RootNodeType>;
extern template class Tree<Vec3STree::RootNodeType>;
extern template class Tree<Vec3ITree::RootNodeType>;
}  // namespace tree
}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
#endif

namespace voxkit {

/// Metadata of ours. The extent, x, y, z from (0, 0, 0), since the box of the active voxels leaves out empty
/// borders; world and unit of places, by their names; slope and intercept of values; a line for people.
inline constexpr const char *dims_key = "voxkit_dims", *world_key = "voxkit_world", *unit_key = "voxkit_unit",
                            *scale_key = "voxkit_scale", *description_key = "voxkit_description";

/// Registers what is read: metadata of other types stay bytes, so that no library code interprets them.
void register_vdb_types();

inline std::string first_line(const std::string& text) {
  return text.substr(0, text.find('\n'));
}

/// io::File hides its streams, and with them what goes wrong on them: a short read yields zeros and a full
/// disk a cut file.
class VdbArchive : public openvdb::io::Archive {
 public:
  /// The grid without its tree, at which the stream stands then.
  openvdb::GridBase::Ptr read_head(std::istream& stream, const GridEntry& entry) {
    stream.seekg(0);
    readHeader(stream);
    openvdb::io::setStreamMetadataPtr(stream, state_, /*transfer=*/false);
    openvdb::io::setVersion(stream, libraryVersion(), fileVersion());
    openvdb::io::setDataCompression(stream, compression());
    stream.seekg(entry.descriptor);
    openvdb::io::GridDescriptor descriptor;
    openvdb::GridBase::Ptr grid = descriptor.read(stream);
    stream.seekg(entry.start);
    readGridCompression(stream);
    grid->readMeta(stream);
    openvdb::io::setGridClass(stream, grid->getGridClass());
    grid->readTransform(stream);
    return grid;
  }
  /// The tree, which check_vdb_tree has passed: OpenVDB itself checks nothing.
  void read_tree(std::istream& stream, openvdb::GridBase& grid) {
    grid.readTopology(stream);
    grid.readBuffers(stream);
    openvdb::io::clearStreamMetadataPtr(stream);
  }
  void write_to(std::ostream& stream, const openvdb::GridBase::Ptr& grid) {
    setCompression(openvdb::io::COMPRESS_ACTIVE_MASK |
                   (hasBloscCompression() ? openvdb::io::COMPRESS_BLOSC : openvdb::io::COMPRESS_ZIP));
    write(stream, openvdb::GridCPtrVec{grid}, /*seekable=*/true);
    // The header holds a random UUID; the same volume shall give the same bytes.
    constexpr int64_t uuid_offset = 21;
    stream.seekp(uuid_offset);
    stream.write("00000000-0000-0000-0000-000000000000", 36);
    stream.flush();
  }

 private:
  using openvdb::io::Archive::write;
  openvdb::io::StreamMetadata::Ptr state_{new openvdb::io::StreamMetadata};  ///< the stream only points to it
};

}  // namespace voxkit
