#include "formats/mesh/point_cloud.h"

#include "formats/names.h"

namespace voxkit {

bool is_points_name(const std::string& name) {
  for (const char* ending : {".ply", ".pcd", ".las", ".laz"})
    if (has_ending(name, ending)) return true;
  return false;
}

Result<std::unique_ptr<const PointCloud>> open_points(const std::string& path, const PointExtras& wanted) {
  if (has_ending(path, ".pcd")) return open_pcd_points(path, wanted);
  if (has_ending(path, ".las") || has_ending(path, ".laz")) return open_las_points(path, wanted);
  return open_ply_points(path, wanted);
}

}  // namespace voxkit
