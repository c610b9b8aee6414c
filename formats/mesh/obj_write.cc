// Faces of voxels as a Wavefront file: a polygon of four corners each, with their library of one material and
// its texture.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "formats/mesh/face_files.h"
#include "formats/mesh/voxel_grid.h"
#include "formats/output_file.h"

namespace voxkit {
namespace {

/// The last part of a path.
std::string name_in_folder(const std::string& path) {
  return path.substr(path.rfind('/') + 1);
}

class ObjWriter final : public FaceWriter {
 public:
  ObjWriter(const VolumeInfo& info, std::vector<std::unique_ptr<OutputFile>> files, Context& ctx)
      : files_(std::move(files)), ctx_(ctx), info_(info) {}

  Status add(std::span<const FaceRectangle> faces) override { return spool_.add(faces); }
  Status add_enclosed(std::span<const ModelVoxel> voxels) override { return spool_.add_enclosed(voxels); }

  Status finish() override {
    VOX_CHECK(spool_.close());
    if (spool_.faces() == 0)
      return fail(ErrorCode::usage, files_[0]->name(), "there are no voxels: a mesh has at least one face");
    const std::string library = name_in_folder(files_[1]->name()),
                      picture = name_in_folder(files_[2]->name());
    VOX_CHECK(
        files_[1]->write(fmt::format("newmtl palette\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {}\n", picture)));
    VOX_TRY(const std::vector<std::byte> bytes, spool_.palette().png(ctx_));
    VOX_CHECK(files_[2]->write(bytes));

    add_text("# {} {}\nmtllib {}\no surface\nusemtl palette\n", voxel_grid_name, voxel_grid_text(info_),
             library);
    for (uint32_t i = 0; i < spool_.palette().count(); ++i) {
      const auto [u, v] = spool_.palette().texel(i);
      add_text("vt {} {}\n", u, 1 - v);
      VOX_CHECK(flush_if_full());
    }
    VOX_CHECK(put_faces());
    if (spool_.enclosed() > 0) VOX_CHECK(put_points());
    VOX_CHECK(files_[0]->write(text_));
    // The mesh last, which names the others.
    std::reverse(files_.begin(), files_.end());
    return commit_together(files_);
  }

 private:
  Status put_faces() {
    // Seen from outside corners turn counterclockwise, also where the volume's axes are mirrored.
    const bool turn_about = info_.affine.determinant() < 0;
    uint64_t number = 1;
    return spool_.each_face([&](std::span<const FaceRectangle> faces) -> Status {
      for (const FaceRectangle& face : faces) {
        auto corners = corners_of(face);
        if (turn_about) std::reverse(corners.begin(), corners.end());
        for (const auto& corner : corners) add_vertex({corner[0] - 0.5, corner[1] - 0.5, corner[2] - 0.5});
        const uint32_t color = spool_.palette().index_of(face.color) + 1;
        add_text("f {0}/{4} {1}/{4} {2}/{4} {3}/{4}\n", number, number + 1, number + 2, number + 3, color);
        number += 4;
        VOX_CHECK(flush_if_full());
      }
      return {};
    });
  }

  Status put_points() {
    add_text("o enclosed\n");
    uint64_t number = 4 * spool_.faces() + 1;
    return spool_.each_enclosed([&](std::span<const ModelVoxel> voxels) -> Status {
      for (const ModelVoxel& voxel : voxels) {
        add_vertex({static_cast<double>(voxel.place[0]), static_cast<double>(voxel.place[1]),
                    static_cast<double>(voxel.place[2])});
        add_text("p {}/{}\n", number++, spool_.palette().index_of(voxel.color) + 1);
        VOX_CHECK(flush_if_full());
      }
      return {};
    });
  }

  void add_vertex(const Affine::Vector& index) {
    const Affine::Vector at = info_.affine.place(index);
    // The shortest digits from which the same doubles are read.
    add_text("v {} {} {}\n", at[0], at[1], at[2]);
  }
  template <class... Values>
  void add_text(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
  }
  Status flush_if_full() {
    if (text_.size() < (size_t{1} << 20)) return {};
    VOX_CHECK(files_[0]->write(text_));
    text_.clear();
    return {};
  }

  std::vector<std::unique_ptr<OutputFile>> files_;  ///< the mesh, its library, its texture
  Context& ctx_;
  VolumeInfo info_;
  FaceSpool spool_;
  std::string text_;
};

}  // namespace

Result<std::unique_ptr<FaceWriter>> create_obj_faces(const std::string& path, const VolumeInfo& info,
                                                     bool force, Context& ctx) {
  const std::string name = name_in_folder(path);
  if (name.front() == ' ' ||
      std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < ' ' || c == '\x7f'; }))
    return fail(ErrorCode::usage, path, "an .obj file cannot name its .mtl: expected another name");
  std::vector<std::unique_ptr<OutputFile>> files;
  for (const std::string& file : files_of_faces(path)) {
    VOX_TRY(auto out, OutputFile::create(file, force));
    files.push_back(std::move(out));
  }
  return std::make_unique<ObjWriter>(info, std::move(files), ctx);
}

}  // namespace voxkit
