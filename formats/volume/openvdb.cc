// OpenVDB files: sparse grids of numbers (densities, masks, labels) and of vectors (colours).
#include <cstdlib>
#include <mutex>

#include "formats/volume/openvdb_archive.h"
#include "formats/volume/openvdb_sink.h"
#include "formats/volume/openvdb_source.h"
#include "formats/volume/volume_module.h"

namespace voxkit {

void register_vdb_types() {
  static std::once_flag once;
  std::call_once(once, [] {
    namespace math = openvdb::math;
    // Else the logger of the library complains, on standard error, that it has nowhere to log to.
    setenv("LOG4CPLUS_LOGLOG_QUIETMODE", "true", /*overwrite=*/0);
    math::MapRegistry::registerMap(math::AffineMap::mapType(), math::AffineMap::create);
    math::MapRegistry::registerMap(math::UnitaryMap::mapType(), math::UnitaryMap::create);
    math::MapRegistry::registerMap(math::ScaleMap::mapType(), math::ScaleMap::create);
    math::MapRegistry::registerMap(math::UniformScaleMap::mapType(), math::UniformScaleMap::create);
    math::MapRegistry::registerMap(math::TranslationMap::mapType(), math::TranslationMap::create);
    math::MapRegistry::registerMap(math::ScaleTranslateMap::mapType(), math::ScaleTranslateMap::create);
    math::MapRegistry::registerMap(math::UniformScaleTranslateMap::mapType(),
                                   math::UniformScaleTranslateMap::create);
    openvdb::FloatGrid::registerGrid();
    openvdb::DoubleGrid::registerGrid();
    openvdb::BoolGrid::registerGrid();
    openvdb::Int32Grid::registerGrid();
    openvdb::Int64Grid::registerGrid();
    openvdb::Vec3SGrid::registerGrid();
    openvdb::Vec3IGrid::registerGrid();
    openvdb::StringMetadata::registerType();
    openvdb::Vec3IMetadata::registerType();
    openvdb::BoolMetadata::registerType();  // whether values are stored as halves
  });
}

namespace {

const VolumeModule volumes{
    .open = open_vdb_grid, .create = create_vdb_sink, .create_voxels = create_vdb_voxel_sink};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.volume = &voxkit::volumes)
