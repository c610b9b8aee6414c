// Faces of voxels as a Wavefront file: a polygon of four corners each, with their library of one material and
// its texture.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <unordered_map>

#include "formats/mesh/face_files.h"
#include "formats/mesh/voxel_grid.h"
#include "formats/output_file.h"
#include "formats/reservation.h"

namespace voxkit {
namespace {

/// Corners of a plane that are remembered, and bytes that two planes take.
constexpr size_t most_corners = size_t{1} << 18;
constexpr uint64_t corner_bytes = 2 * 48 * most_corners;

/// The last part of a path.
std::string name_in_folder(const std::string& path) {
  return path.substr(path.rfind('/') + 1);
}

class ObjWriter final : public FaceWriter {
 public:
  ObjWriter(const VolumeInfo& info, std::vector<std::unique_ptr<OutputFile>> files, Reservation memory,
            Context& ctx)
      : files_(std::move(files)), memory_(std::move(memory)), ctx_(ctx), info_(info) {}

  Status add(std::span<const FaceRectangle> faces) override { return spool_.add(faces); }
  Status add_enclosed(std::span<const ModelVoxel> voxels) override { return spool_.add_enclosed(voxels); }

  Status finish() override {
    VOX_CHECK(spool_.close());
    if (spool_.faces() == 0)
      return fail(ErrorCode::input, files_[0]->name(), "there are no voxels: a mesh has at least one face");
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
    return spool_.each_face([&](std::span<const FaceRectangle> faces) -> Status {
      for (const FaceRectangle& face : faces) {
        auto corners = corners_of(face);
        if (turn_about) std::reverse(corners.begin(), corners.end());
        std::array<uint64_t, 4> numbers;
        for (size_t i = 0; i < 4; ++i) numbers[i] = number_of(corners[i], face);
        add_text("f {0}/{4} {1}/{4} {2}/{4} {3}/{4}\n", numbers[0], numbers[1], numbers[2], numbers[3],
                 spool_.palette().index_of(face.color) + 1);
        VOX_CHECK(flush_if_full());
      }
      return {};
    });
  }

  Status put_points() {
    add_text("o enclosed\n");
    return spool_.each_enclosed([&](std::span<const ModelVoxel> voxels) -> Status {
      for (const ModelVoxel& voxel : voxels) {
        add_vertex({static_cast<double>(voxel.place[0]), static_cast<double>(voxel.place[1]),
                    static_cast<double>(voxel.place[2])});
        add_text("p {}/{}\n", vertices_, spool_.palette().index_of(voxel.color) + 1);
        VOX_CHECK(flush_if_full());
      }
      return {};
    });
  }

  /// The number of a vertex at a corner: one that is there already, of a face beside this one.
  uint64_t number_of(const std::array<int32_t, 3>& corner, const FaceRectangle& face) {
    Plane& plane = planes_[face.positive];
    if (plane.axis != face.axis || plane.place != face.plane || plane.numbers.size() >= most_corners) {
      plane.axis = face.axis;
      plane.place = face.plane;
      plane.numbers.clear();
    }
    const auto u = static_cast<uint32_t>(corner[(face.axis + 1) % 3]);
    const auto v = static_cast<uint32_t>(corner[(face.axis + 2) % 3]);
    const auto [at, is_new] = plane.numbers.try_emplace(uint64_t{v} << 32 | u, vertices_ + 1);
    if (is_new) add_vertex({corner[0] - 0.5, corner[1] - 0.5, corner[2] - 0.5});
    return at->second;
  }
  void add_vertex(const Affine::Vector& index) {
    ++vertices_;
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
  Reservation memory_;
  Context& ctx_;
  VolumeInfo info_;
  FaceSpool spool_;
  std::string text_;
  uint64_t vertices_ = 0;  ///< so many are written
  /// Vertices of faces that look to one side, by their places in the plane that these are in.
  struct Plane {
    int axis = -1;
    int32_t place = 0;
    std::unordered_map<uint64_t, uint64_t> numbers;
  };
  std::array<Plane, 2> planes_;
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
  VOX_TRY(Reservation memory, Reservation::take(corner_bytes, "corners of a mesh", ctx));
  return std::make_unique<ObjWriter>(info, std::move(files), std::move(memory), ctx);
}

}  // namespace voxkit
