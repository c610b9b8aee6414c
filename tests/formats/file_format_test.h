// What the tests of file formats share: a folder, volumes to write, and hostile files.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "formats/volume/readers.h"

namespace voxkit {

using Bytes = std::vector<std::byte>;

class FileFormatTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
    std::replace(name.begin(), name.end(), '/', '-');  // of a test with parameters
    folder_ = testing::TempDir() + "voxkit-" + name + "-" + std::to_string(getpid());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directory(folder_);
    ctx_.memory = &memory_;
    ctx_.note = [this](const std::string& line) { notes_.push_back(line); };
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  std::string put(const std::string& name, const std::string& content) const {
    std::filesystem::remove(path(name));  // cutting a file short may wait for the disk, a new one does not
    std::ofstream(path(name), std::ios::binary) << content;
    return path(name);
  }
  static std::string get(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  static VolumeInfo make_info(Index3 dims, VoxelFormat format, SampleType type = SampleType::u8) {
    VolumeInfo info;
    info.dims = dims;
    info.format = format;
    info.sample_type = type;
    return info;
  }
  /// Random bytes, but 0 and 1 for BITMAP and numbers that are not NaN for FLOAT32.
  Bytes random_voxels(const VolumeInfo& info) {
    Bytes voxels(static_cast<size_t>(info.box().voxels() * voxel_bytes(info.format)));
    for (std::byte& b : voxels)
      b = static_cast<std::byte>(random_() & (info.format == VoxelFormat::bitmap ? 1 : 255));
    for (size_t i = 3; info.format == VoxelFormat::float32 && i < voxels.size(); i += 4)
      voxels[i] &= std::byte{0xbf};
    return voxels;
  }

  /// Writes slabs of 1, 2, 1, 2 … slices, the odd ones from memory with gaps.
  static Status write(VolumeSink& sink, const VolumeInfo& info, const Bytes& voxels) {
    const int64_t row = info.dims.x * voxel_bytes(info.format), slice = row * info.dims.y;
    bool odd = true;
    for (int64_t z = 0; z < info.dims.z; odd = !odd) {
      const int64_t n = std::min<int64_t>(odd ? 1 : 2, info.dims.z - z);
      const ConstVoxelSpan whole{voxels.data() + z * slice, row, slice};
      Bytes spaced(static_cast<size_t>(n * (slice + info.dims.y * 5 + 3)));
      const VoxelSpan gaps{spaced.data(), row + 5, (row + 5) * info.dims.y + 3};
      copy(whole, gaps, {info.dims.x, info.dims.y, n}, info.format);
      VOX_CHECK(
          sink.write(z, z + n, odd ? ConstVoxelSpan{gaps.data, gaps.row_stride, gaps.slice_stride} : whole));
      z += n;
    }
    return sink.finish();
  }
  static Result<Bytes> read(VolumeSource& source) {
    const Index3 dims = source.info().dims;
    const int64_t slice = dims.x * dims.y * voxel_bytes(source.info().format);
    Bytes voxels(static_cast<size_t>(slice * dims.z));
    for (int64_t z = 0, n = 1; z < dims.z; z += n, n = 3) {
      n = std::min(n, dims.z - z);
      VOX_CHECK(source.read({{0, 0, z}, {dims.x, dims.y, z + n}},
                            packed(voxels.data() + z * slice, {dims.x, dims.y, n}, source.info().format)));
    }
    return voxels;
  }

  /// Writes a random volume as `name` and reads it again.
  void round_trip(const std::string& name, const VolumeInfo& info, const OpenOptions& options = {}) {
    SCOPED_TRACE(testing::Message() << name << " " << info.dims.x << "x" << info.dims.y << "x" << info.dims.z
                                    << " " << voxkit::name(info.format) << " type "
                                    << static_cast<int>(info.sample_type));
    const Bytes voxels = random_voxels(info);
    auto sink = create_volume(path(name), info, true, ctx_);
    ASSERT_TRUE(sink) << sink.error().what;
    const Status written = write(**sink, info, voxels);
    ASSERT_TRUE(written) << written.error().what;
    auto source = open_volume(path(name), options, ctx_);
    ASSERT_TRUE(source) << source.error().what;
    EXPECT_EQ((*source)->info().dims, info.dims);
    EXPECT_EQ((*source)->info().affine.spacing(), info.affine.spacing());
    EXPECT_EQ((*source)->info().affine.origin, info.affine.origin);
    EXPECT_EQ((*source)->info().slope, info.slope);
    EXPECT_EQ((*source)->info().intercept, info.intercept);
    const auto back = read(**source);
    ASSERT_TRUE(back) << back.error().what;
    read_info_ = (*source)->info();
    EXPECT_EQ(*back, voxels);
  }

  /// That it opens, and its voxels are these bytes.
  void expect_voxels(SourceResult source, const std::string& expected) {
    ASSERT_TRUE(source) << source.error().what;
    const auto voxels = read(**source);
    ASSERT_TRUE(voxels) << voxels.error().what;
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(voxels->data()), voxels->size()), expected);
    read_info_ = (*source)->info();
  }

  /// Opens and, if the header is accepted and small, reads. What fails must be an error of the input.
  Status try_file(const std::string& file) {
    auto source = open_volume(file, {}, ctx_);
    if (!source) return tl::unexpected<Error>(source.error());
    if (const auto voxels = checked_voxels((*source)->info().dims); !voxels || *voxels > 100000) return {};
    const auto voxels = read(**source);
    if (!voxels) return tl::unexpected<Error>(voxels.error());
    return {};
  }
  void expect_error(const std::string& file, const std::string& part) {
    const Status status = try_file(file);
    ASSERT_FALSE(status) << "accepted; expected an error with: " << part;
    EXPECT_EQ(status.error().code, ErrorCode::input);
    EXPECT_NE(status.error().what.find(part), std::string::npos) << status.error().what;
    EXPECT_EQ(status.error().what.find('\n'), std::string::npos) << status.error().what;
  }
  /// Every shorter file is refused; changed bytes never do more than that.
  void hostile(const std::string& name, const std::string& valid, int mutations = 2000) {
    ASSERT_TRUE(try_file(put(name, valid)));
    for (size_t length = 0; length < valid.size(); ++length) {
      const Status status = try_file(put(name, valid.substr(0, length)));
      ASSERT_FALSE(status) << "accepted a file cut to " << length << " of " << valid.size() << " bytes";
      EXPECT_EQ(status.error().code, ErrorCode::input) << status.error().what;
    }
    for (int i = 0; i < mutations; ++i) {
      std::string changed = valid;
      for (auto n = 1 + random_() % 3; n > 0; --n)
        changed[random_() % changed.size()] = static_cast<char>(random_());
      const Status status = try_file(put(name, changed));
      EXPECT_TRUE(status || status.error().code == ErrorCode::input) << status.error().what;
    }
  }

  /// Whether a note has these words; it is one line.
  bool noted(const std::string& part) const {
    return std::any_of(notes_.begin(), notes_.end(), [&](const std::string& note) {
      EXPECT_EQ(note.find('\n'), std::string::npos) << note;
      return note.find(part) != std::string::npos;
    });
  }
  std::string all_notes() const {
    std::string text;
    for (const std::string& note : notes_) text += note + "\n";
    return text;
  }

  std::string folder_;
  std::vector<std::string> notes_;  ///< in the order in which they came
  MemoryBudget memory_;
  Context ctx_;
  VolumeInfo read_info_;  ///< of what was read last
  std::mt19937 random_{7};
};

/// The bytes of numbers, in either order.
template <class T>
std::string sample_text(const std::vector<T>& values, bool big_endian) {
  std::string text;
  for (T value : values) {
    std::string bytes(reinterpret_cast<const char*>(&value), sizeof(T));
    if (big_endian) bytes = {bytes.rbegin(), bytes.rend()};
    text += bytes;
  }
  return text;
}

}  // namespace voxkit
