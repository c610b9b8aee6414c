#include "tests/fuzz/harness.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <vector>

#include "formats/mesh/mesh.h"
#include "formats/mesh/point_cloud.h"
#include "tests/fuzz/seeds.h"

namespace voxkit::fuzz {
namespace {

constexpr uint64_t memory_limit = uint64_t{256} << 20;
constexpr int64_t voxels_read = 1 << 20;  // of a volume; what an input can make large is read in part

/// A folder of this process, removed at its end.
class Folder {
 public:
  Folder() {
    const char* temporary = std::getenv("TMPDIR");
    path_ = fmt::format("{}/voxkit-fuzz-XXXXXX", temporary && *temporary ? temporary : "/tmp");
    if (!::mkdtemp(path_.data())) std::abort();
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// Writes the input as a file in a folder of its own and gives the file's path.
std::string put(Input input, const std::string& name) {
  static const Folder folder;
  const std::string path = folder.path() + "/" + name;
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  // A new file each time: truncating one that was just written waits for the disk on some file systems.
  ::unlink(path.c_str());
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd < 0 || ::write(fd, input.data(), input.size()) != static_cast<ssize_t>(input.size())) std::abort();
  ::close(fd);
  return path;
}

constexpr auto fault = [](std::string what) { return Verdict{false, std::move(what)}; };

Verdict judge(const Error& error) {
  if (error.code != ErrorCode::input && error.code != ErrorCode::limit)
    return fault(fmt::format("error of class {}: {}", static_cast<int>(error.code), error.what));
  if (error.what.empty()) return fault("an error without a message");
  if (error.what.find('\n') != std::string::npos) return fault("a message of several lines: " + error.what);
  return {};
}

/// Reads a box, and whether it is as uniform as the source says.
Verdict read_box(VolumeSource& source, const Box& box) {
  const VoxelFormat format = source.info().format;
  const auto bytes = static_cast<size_t>(voxel_bytes(format));
  // Exactly as much memory as the box needs, so that a sanitizer sees a byte too many.
  std::vector<std::byte> memory(static_cast<size_t>(box.voxels()) * bytes, std::byte{0xa5});
  const Status status = source.read(box, packed(memory.data(), box.size(), format));
  if (!status) return judge(status.error());
  const auto value = source.uniform(box);
  for (size_t i = 0; value && i < memory.size(); i += bytes) {
    if (std::memcmp(memory.data() + i, value->bytes.data(), bytes) != 0) return fault("uniform() is wrong");
  }
  for (size_t i = 0; format == VoxelFormat::bitmap && i < memory.size(); ++i) {
    if (memory[i] > std::byte{1}) return fault("a bit that is neither 0 nor 1");
  }
  return {true, {}};
}

Verdict read_volume(VolumeSource& source) {
  const Index3 dims = source.info().dims;
  if (!checked_voxels(dims)) return fault(fmt::format("a volume of {} x {} x {}", dims.x, dims.y, dims.z));
  const int64_t bytes = voxel_bytes(source.info().format);
  // Slabs from a stream; elsewhere boxes of a bounded size, since one slice may be a tile of 2^62 voxels.
  Index3 step = dims;
  if (!source.forward_only()) {
    step = {std::min<int64_t>(dims.x, 256), std::min<int64_t>(dims.y, 64), std::min<int64_t>(dims.z, 16)};
  } else if (dims.x > (int64_t{1} << 26) / bytes / dims.y) {
    return {true, {}};
  } else {
    step.z = std::clamp<int64_t>((1 << 16) / (dims.x * dims.y), 1, dims.z);
  }
  int64_t read = 0;
  Box box;
  for (box.lo.z = 0; box.lo.z < dims.z; box.lo.z += step.z) {
    for (box.lo.y = 0; box.lo.y < dims.y; box.lo.y += step.y) {
      for (box.lo.x = 0; box.lo.x < dims.x; box.lo.x += step.x) {
        if (read > voxels_read) {  // once more, at the far end; of a stream, what is left of it
          const int64_t z = std::max(box.lo.z, dims.z - step.z);
          return read_box(source, {{dims.x - step.x, dims.y - step.y, z}, dims});
        }
        box.hi = intersect({box.lo, box.lo + step}, {Index3(0), dims}).hi;
        if (auto verdict = read_box(source, box); !verdict.accepted) return verdict;
        read += box.voxels();
      }
    }
  }
  return {true, {}};
}

/// Opens a volume, reads it and closes it.
Verdict read_source(const std::function<SourceResult(Context&)>& open) {
  MemoryBudget memory(memory_limit);
  Context ctx;
  ctx.memory = &memory;
  Verdict verdict;
  {
    auto source = open(ctx);
    verdict = source ? read_volume(**source) : judge(source.error());
  }
  if (verdict.fault.empty() && !memory.reserve(memory_limit, "all of it"))
    return fault("reserved memory was not given back");
  return verdict;
}

/// Reads a mesh and looks at all of it.
Verdict read_mesh_file(const std::string& path) {
  MemoryBudget memory(memory_limit);
  Context ctx;
  ctx.memory = &memory;
  Verdict verdict{true, {}};
  if (const auto mesh = read_mesh(path, ctx); !mesh) {
    verdict = judge(mesh.error());
  } else {
    if (mesh->triangles.empty() && mesh->points.empty()) return fault("a mesh of nothing");
    for (const MeshPoint& point : mesh->points)
      if (point.vertex >= mesh->positions.size() || point.material >= mesh->materials.size())
        return fault("a point that is not there");
    for (const MeshTriangle& triangle : mesh->triangles)
      for (const uint32_t v : triangle.vertices)
        if (v >= mesh->positions.size() || !std::isfinite(mesh->positions[v].x + mesh->positions[v].z))
          return fault("a corner that is not there");
    for (const glm::vec4& color : mesh->colors)
      if (!(color.r >= 0 && color.b <= 1)) return fault("a colour out of range");
  }
  if (verdict.fault.empty() && !memory.reserve(memory_limit, "all of it"))
    return fault("reserved memory was not given back");
  return verdict;
}

class MemoryStream final : public InputStream {
 public:
  explicit MemoryStream(Input input) : input_(input) { name_ = "input"; }
  Result<size_t> read(std::span<std::byte> out) override {
    const size_t count = std::min(out.size(), input_.size() - static_cast<size_t>(position_));
    if (count) std::memcpy(out.data(), input_.data() + position_, count);
    position_ += count;
    return count;
  }

 private:
  Input input_;
};

/// Unpacks to the end; what fails goes on failing.
Verdict read_stream(InputStream& stream) {
  std::vector<std::byte> buffer(65521);
  for (uint64_t total = 0; total < uint64_t{1} << 26;) {
    const auto count = stream.read(buffer);
    if (!count)
      return stream.read(buffer) ? fault("an error that is gone at the next read") : judge(count.error());
    total += *count;
    if (stream.position() != total) return fault("position() is not what was read");
    if (*count < buffer.size()) {
      const auto more = stream.read(buffer);
      if (!more || *more > 0) return fault("more after the end of the data");
      return {true, {}};
    }
  }
  return {true, {}};
}

const char* image_ending(Input input) {
  if (input.empty()) return "tif";
  switch (std::to_integer<int>(input[0])) {
    case 0x89:
      return "png";
    case 0x76:
      return "exr";
    default:
      return "tif";
  }
}

bool is_gzip(Input input) {
  return input.size() > 1 && input[0] == std::byte{0x1f} && input[1] == std::byte{0x8b};
}

}  // namespace

namespace {

/// Of files of several volumes the first.
OpenOptions any_part() {
  OpenOptions options;
  options.any_part = true;
  return options;
}

}  // namespace

Verdict read_nrrd(Input input) {
  const std::string path = put(input, "in.nrrd");
  if (auto verdict = read_source([&](Context& ctx) { return open_nrrd(path, any_part(), ctx); });
      !verdict.fault.empty())
    return verdict;
  // As from a pipe: nothing is mapped.
  return read_source(
      [&](Context& ctx) { return open_nrrd(std::make_unique<MemoryStream>(input), any_part(), ctx); });
}

Verdict read_nifti(Input input) {
  const std::string path = put(input, is_gzip(input) ? "in.nii.gz" : "in.nii");
  return read_source([&](Context& ctx) { return open_nifti(path, any_part(), ctx); });
}

Verdict read_mrc(Input input) {
  const std::string path = put(input, "in.mrc");
  return read_source([&](Context& ctx) { return open_mrc(path, any_part(), ctx); });
}

Verdict read_npy(Input input) {
  const std::string path = put(input, "in.npy");
  if (auto verdict = read_source([&](Context& ctx) { return open_npy(path, any_part(), ctx); });
      !verdict.fault.empty())
    return verdict;
  return read_source(
      [&](Context& ctx) { return open_npy(std::make_unique<MemoryStream>(input), any_part(), ctx); });
}

Verdict read_meta_image(Input input) {
  const std::string path = put(input, "in.mha");
  return read_source([&](Context& ctx) { return open_meta_image(path, any_part(), ctx); });
}

Verdict read_vtk(Input input) {
  const std::string path = put(input, "in.vtk");
  return read_source([&](Context& ctx) { return open_vtk(path, any_part(), ctx); });
}
Verdict read_vti(Input input) {
  const std::string path = put(input, "in.vti");
  return read_source([&](Context& ctx) { return open_vti(path, any_part(), ctx); });
}

Verdict read_raw(Input input) {
  if (input.size() < 7) return {};
  const auto byte = [&](size_t i) { return std::to_integer<int64_t>(input[i]); };
  // Sides of 0 are errors of usage, which open_raw is right to report.
  const auto side = [&](size_t i) { return std::max<int64_t>(byte(i) | byte(i + 1) << 8, 1); };
  constexpr std::array types{"u8", "i8", "u16", "i16", "u32", "i32", "f32", "f64", "rgb8", "rgba8", "bit"};
  OpenOptions options;
  options.dims = Index3(side(0), side(2), side(4));
  options.type = types[static_cast<size_t>(byte(6) >> 1) % types.size()];
  options.big_endian = byte(6) & 1;
  const std::string path = put(input.subspan(7), "in.raw");
  return read_source([&](Context& ctx) { return open_raw(path, options, ctx); });
}

Verdict read_gunzip(Input input) {
  return read_stream(*gunzip(std::make_unique<MemoryStream>(input)));
}
Verdict read_bunzip2(Input input) {
  return read_stream(*bunzip2(std::make_unique<MemoryStream>(input)));
}

Verdict read_image(Input input) {
  const std::string path = put(input, fmt::format("in.{}", image_ending(input)));
  return read_source([&](Context& ctx) { return open_image_stack(path, {}, ctx); });
}

Verdict read_openvdb(Input input) {
  const std::string path = put(input, "in.vdb");
  return read_source([&](Context& ctx) { return open_vdb(path, {}, ctx); });
}

Verdict read_dicom(Input input) {
  const std::string path = put(input, "dicom/in.dcm");
  return read_source(
      [&](Context& ctx) { return open_dicom(std::filesystem::path(path).parent_path().string(), {}, ctx); });
}

/// Points, or a mesh where it is one.
Verdict read_points_file(const std::string& path) {
  const auto points = open_points(path);
  if (!points) return judge(points.error());
  if (!*points) return read_mesh_file(path);
  uint64_t found = 0, come = 0;
  const Status status = (*points)->read([&](std::span<const CloudPoint> run) -> Status {
    come += run.size();
    for (const CloudPoint& point : run) found += std::isfinite(point.at.x + point.at.y + point.at.z);
    return {};
  });
  if (!status) return judge(status.error());
  return found == come && come <= (*points)->size() ? Verdict{true, {}} : fault("points that are not there");
}

Verdict read_mesh_ply(Input input) {
  return read_points_file(put(input, "in.ply"));
}
Verdict read_points_pcd(Input input) {
  return read_points_file(put(input, "in.pcd"));
}
Verdict read_points_las(Input input) {
  return read_points_file(put(input, "in.las"));
}

Verdict read_mesh_stl(Input input) {
  return read_mesh_file(put(input, "in.stl"));
}
Verdict read_mesh_3ds(Input input) {
  return read_mesh_file(put(input, "in.3ds"));
}

Verdict read_mesh_gltf(Input input) {
  const bool binary = input.size() > 4 && std::memcmp(input.data(), "glTF", 4) == 0;
  return read_mesh_file(put(input, binary ? "in.glb" : "in.gltf"));
}

Verdict read_mesh_obj(Input input) {
  return read_mesh_file(put(input, "in.obj"));
}

const std::vector<Reader>& readers() {
  static const std::vector<Reader> all{
      {"nrrd", nullptr, read_nrrd, nrrd_seeds},
      {"nifti", nullptr, read_nifti, nifti_seeds},
      {"mrc", nullptr, read_mrc, mrc_seeds},
      {"npy", nullptr, read_npy, npy_seeds},
      {"meta_image", nullptr, read_meta_image, meta_image_seeds},
      {"vtk", nullptr, read_vtk, vtk_seeds},
      {"vti", nullptr, read_vti, vti_seeds},
      {"raw", nullptr, read_raw, raw_seeds},
      {"gunzip", nullptr, read_gunzip, gunzip_seeds},
      {"bunzip2", nullptr, read_bunzip2, bunzip2_seeds},
      {"image", "image_stack", read_image, image_seeds},
      {"openvdb", "openvdb", read_openvdb, openvdb_seeds},
      {"dicom", "dicom", read_dicom, dicom_seeds},
      {"mesh_ply", nullptr, read_mesh_ply, mesh_ply_seeds},
      {"mesh_gltf", nullptr, read_mesh_gltf, mesh_gltf_seeds},
      {"mesh_obj", nullptr, read_mesh_obj, mesh_obj_seeds},
      {"mesh_stl", nullptr, read_mesh_stl, mesh_stl_seeds},
      {"mesh_3ds", nullptr, read_mesh_3ds, mesh_3ds_seeds},
      {"points_pcd", nullptr, read_points_pcd, points_pcd_seeds},
      {"points_las", nullptr, read_points_las, points_las_seeds},
      {"jpeg", "jpeg", read_jpeg, jpeg_seeds},
      {"jp2", "jp2", read_jp2, jp2_seeds},
      {"png", "png", read_png, png_seeds},
  };
  return all;
}

}  // namespace voxkit::fuzz
