// Small valid files of each kind: what the fuzzers start from and hostile_test.cc damages.
#pragma once

#include <string>
#include <vector>

namespace voxkit::fuzz {

std::vector<std::string> nrrd_seeds();
std::vector<std::string> nifti_seeds();
std::vector<std::string> mrc_seeds();
std::vector<std::string> npy_seeds();
std::vector<std::string> meta_image_seeds();
std::vector<std::string> vtk_seeds();
std::vector<std::string> vti_seeds();
std::vector<std::string> raw_seeds();
std::vector<std::string> gunzip_seeds();
std::vector<std::string> bunzip2_seeds();
std::vector<std::string> image_seeds();
std::vector<std::string> openvdb_seeds();
std::vector<std::string> dicom_seeds();
std::vector<std::string> mesh_ply_seeds();
std::vector<std::string> mesh_gltf_seeds();
std::vector<std::string> mesh_obj_seeds();
std::vector<std::string> mesh_stl_seeds();
std::vector<std::string> mesh_3ds_seeds();
std::vector<std::string> points_pcd_seeds();
std::vector<std::string> points_las_seeds();
std::vector<std::string> jpeg_seeds();
std::vector<std::string> jp2_seeds();
std::vector<std::string> png_seeds();

}  // namespace voxkit::fuzz
