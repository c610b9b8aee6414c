// Where a volume is, from any format to any other: every place of a table, through every pair.
//
// A format that can say a place gives it back: the same numbers, or those numbers as floats of 32 bits, in
// the world and the unit that the format has. One that cannot says so in a note.
#include <cmath>
#include <filesystem>

#include "formats/container.h"
#include "formats/module.h"
#include "formats/volume/facts.h"
#include "libsvmm/svmm.h"
#include "libvq/vq.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

struct Place {
  const char* name;
  Affine affine;
  World world = World::ras;
  Unit unit = Unit::millimetre;
  int space_code = 0;
};

std::vector<Place> places() {
  const double c = std::cos(0.5), s = std::sin(0.5);
  std::vector<Place> all = {
      {"nothing known", Affine{}, World::unknown, Unit::unknown},
      {"spacing alone", Affine::plain({0.5, 2, 3}, {0, 0, 0}), World::unknown, Unit::unknown},
      {"identity", Affine{}},
      {"along the axes", Affine::plain({0.5, 2, 3}, {-10, 20, 5.25})},
      {"in no known world", Affine::plain({0.5, 2, 3}, {-10, 20, 5.25}), World::unknown},
      {"no float holds it", Affine::plain({0.1, 0.7, 1.0 / 3}, {0.3, -0.1, 1e-3}), World::lps},
      {"oblique", {{{{c, s, 0}, {-s, c, 0}, {0, 0, 2.5}}}, {1, -2, 3}}},
      {"oblique, mirrored", {{{{c, 0, s}, {0, -1, 0}, {-s, 0, c}}}, {1, -2, 3}}, World::lps},
      {"a sheared cell", {{{{2, 0, 0}, {0.5, 2, 0}, {-0.25, 0.125, 3}}}, {4, 5, 6}}},
      {"sheared",
       {{{{1, 0.25, 0}, {0, 1.5, 0}, {0.5, 0, -2}}}, {-10, 0.125, 7}},
       World::las,
       Unit::micrometre},
      {"another handedness", Affine::plain({1, 2, 3}, {4, 5, 6}), World::left_handed, Unit::metre},
  };
  for (int flips = 1; flips < 8; ++flips) {
    Affine affine = Affine::plain({0.5, 2, 3}, {-10, 20, 5.25});
    for (size_t k = 0; k < 3; ++k)
      if ((flips >> k & 1) != 0) affine.axes[k][k] = -affine.axes[k][k];
    all.push_back({"flipped", affine, flips % 2 != 0 ? World::ras : World::lps});
  }
  std::array<size_t, 3> order{0, 1, 2};
  while (std::next_permutation(order.begin(), order.end())) {
    Affine affine;
    affine.axes = {};
    for (size_t k = 0; k < 3; ++k) affine.axes[k][order[k]] = 0.5 * static_cast<double>(k + 1);
    affine.origin = {7, 8, 9};
    all.push_back({"permuted", affine});
  }
  return all;
}

enum class Format { nrrd, nhdr, nii, nii_gz, mrc, raw, svmm, vqv, vdb, tif };
constexpr const char* endings[] = {"nrrd", "nhdr", "nii", "nii.gz", "mrc",
                                   "raw",  "svmm", "vqv", "vdb",    "tif"};
constexpr size_t format_count = std::size(endings);

/// Without the module of a format there is nothing to ask it.
bool is_there(Format format) {
  const char* const module = format == Format::vdb   ? "openvdb"
                             : format == Format::tif ? "image_stack"
                                                     : nullptr;
  return !module || std::filesystem::exists(module_folder() + "/" + module + ".so");
}

class PlaceTable : public FileFormatTest, public testing::WithParamInterface<Format> {
 protected:
  const Index3 dims_{3, 4, 5};

  /// Writes a volume of this place; notes_ has what was said.
  std::string written(const std::string& stem, Format format, VolumeSource& source) {
    notes_.clear();
    const std::string name =
        path(stem + (format == Format::tif ? "-%d." : ".") + endings[static_cast<size_t>(format)]);
    if (format == Format::svmm || format == Format::vqv) {
      std::string bytes;
      const ByteSink sink = [&](std::span<const std::byte> part) -> Status {
        bytes.append(reinterpret_cast<const char*>(part.data()), part.size());
        return {};
      };
      if (format == Format::svmm) {
        svmm::Params params;
        params.quality = 100;
        params.delta = 0;
        EXPECT_TRUE(svmm::encode(source, params, sink, ctx_));
      } else {
        EXPECT_TRUE(vq::encode(source, {}, sink, ctx_));
      }
      std::filesystem::remove(name);
      std::ofstream(name, std::ios::binary) << bytes;
      return name;
    }
    auto sink = create_volume(name, source.info(), true, ctx_);
    EXPECT_TRUE(sink) << sink.error().what;
    if (!sink) return name;
    EXPECT_TRUE(write(**sink, source.info(), *read(source)));
    return name;
  }
  std::unique_ptr<VolumeSource> opened(const std::string& name, Format format) {
    notes_.clear();
    if (format == Format::svmm || format == Format::vqv) {
      auto file = MappedFile::open(name);
      EXPECT_TRUE(file);
      auto container = Container::open((*file)->bytes(), name, *file, &memory_);
      EXPECT_TRUE(container) << container.error().what;
      if (format == Format::vqv) return vq::open_source(*vq::Volume::open(*container));
      return std::move(*svmm::open_source(*svmm::Volume::open(*container), 0));
    }
    OpenOptions options;
    if (format == Format::raw) options.dims = dims_, options.type = "u8";
    auto source = open_volume(name, options, ctx_);
    EXPECT_TRUE(source) << source.error().what;
    return source ? std::move(*source) : nullptr;
  }
};

/// What a format makes of a place; `lost`: not all of it is there, and a note says so.
struct Expected {
  Place place;
  double rounding = 0;  ///< relative to the greatest number
  bool lost = false;
};

Expected through(Format format, Place place) {
  Affine& affine = place.affine;
  const bool default_place = affine == Affine{};
  const auto in = [&](Unit unit) {
    if (place.unit != unit) affine = in_unit(affine, place.unit, unit);
    place.unit = unit;
  };
  switch (format) {
    case Format::raw: {
      const bool known = place.world != World::unknown || place.unit != Unit::unknown;
      return {{place.name, Affine{}, World::unknown, Unit::unknown}, 0, known || !default_place};
    }
    case Format::nii:
    case Format::nii_gz: {
      if (place.unit != Unit::unknown && place.unit != Unit::metre && place.unit != Unit::micrometre)
        in(place.unit == Unit::angstrom ? Unit::micrometre : Unit::millimetre);
      const bool anatomical = is_anatomical(place.world);
      if (anatomical) affine = in_world(affine, place.world, World::ras);
      const bool only_spacing =
          place.world == World::unknown && affine == Affine::plain(affine.spacing(), {});
      if (!only_spacing) place.world = World::ras;
      return {place, 6e-8, !anatomical && !only_spacing};
    }
    case Format::mrc: {
      const bool unit_unknown = place.unit == Unit::unknown;
      if (unit_unknown) place.unit = Unit::angstrom;
      in(Unit::angstrom);
      const auto& [a, b, c] = affine.axes;
      const bool cell = a[0] > 0 && a[1] == 0 && a[2] == 0 && b[1] > 0 && b[2] == 0 && c[2] > 0;
      if (!cell) affine = Affine::plain(affine.spacing(), affine.origin);
      const bool world_lost = place.world != World::unknown;
      place.world = World::unknown;
      return {place, 3e-7, world_lost || !cell || (unit_unknown && !default_place)};
    }
    case Format::tif: {
      // Spacing, origin and world; of other axes the lengths only.
      const bool plain = affine.is_plain();
      if (!plain) {
        affine = Affine::plain(affine.spacing(), {0, 0, 0});
        place.world = World::unknown;
      }
      return {place, 0, !plain || place.space_code != 0};
    }
    default:
      return {place};
  }
}

bool holds_floats(const Affine& affine) {
  const auto holds = [](double x) { return static_cast<double>(static_cast<float>(x)) == x; };
  for (const Affine::Vector& axis : affine.axes)
    if (!std::all_of(axis.begin(), axis.end(), holds)) return false;
  return std::all_of(affine.origin.begin(), affine.origin.end(), holds);
}

void expect_place(const VolumeInfo& info, const Expected& expected) {
  EXPECT_EQ(info.world, expected.place.world) << name(info.world) << ", not " << name(expected.place.world);
  EXPECT_EQ(info.unit, expected.place.unit) << name(info.unit) << ", not " << name(expected.place.unit);
  const Affine& affine = expected.place.affine;
  double greatest = 0;
  for (size_t b = 0; b < 3; ++b) {
    greatest = std::max(greatest, std::abs(affine.origin[b]));
    for (size_t a = 0; a < 3; ++a) greatest = std::max(greatest, std::abs(affine.axes[a][b]));
  }
  const bool exact = expected.rounding == 0 || (expected.rounding < 1e-7 && holds_floats(affine));
  for (size_t b = 0; b < 3; ++b) {
    const double within = exact ? 0 : expected.rounding * greatest;
    EXPECT_NEAR(info.affine.origin[b], affine.origin[b], within) << "origin " << b;
    for (size_t a = 0; a < 3; ++a)
      EXPECT_NEAR(info.affine.axes[a][b], affine.axes[a][b], within) << "axis " << a << b;
  }
}

TEST_P(PlaceTable, FromThisFormatToEachOther) {
  const Format first = GetParam();
  if (!is_there(first)) GTEST_SKIP() << "built without its module";
  VolumeInfo info = make_info(dims_, VoxelFormat::density8);
  const Bytes voxels = random_voxels(info);
  for (const Place& place : places()) {
    info.affine = place.affine;
    info.world = place.world;
    info.unit = place.unit;
    // In memory, as a container has it.
    class Memory final : public VolumeSource {
     public:
      Memory(const VolumeInfo& of, const Bytes& bytes) : bytes_(bytes) { info_ = of; }
      Status read(const Box& box, VoxelSpan out) override {
        const ConstVoxelSpan all = packed(bytes_.data(), info_.dims, info_.format);
        copy({all.row(box.lo.y, box.lo.z) + box.lo.x, all.row_stride, all.slice_stride}, out, box.size(),
             info_.format);
        return {};
      }

     private:
      const Bytes& bytes_;
    } memory(info, voxels);
    SCOPED_TRACE(testing::Message() << place.name << ", written as " << endings[static_cast<size_t>(first)]);
    const std::string from = written("from", first, memory);
    const Expected once = through(first, place);
    EXPECT_EQ(!notes_.empty(), once.lost) << all_notes();
    auto source = opened(from, first);
    ASSERT_TRUE(source);
    EXPECT_TRUE(notes_.empty()) << all_notes();
    expect_place(source->info(), once);
    for (size_t f = 0; f < format_count; ++f) {
      const auto second = static_cast<Format>(f);
      if (!is_there(second)) continue;
      SCOPED_TRACE(testing::Message() << "then as " << endings[static_cast<size_t>(second)]);
      if (source->forward_only()) source = opened(from, first);
      const VolumeInfo& now = source->info();
      const Expected twice = through(second, {place.name, now.affine, now.world, now.unit, now.space_code});
      const std::string to = written("to", second, *source);
      EXPECT_EQ(!notes_.empty(), twice.lost) << all_notes();
      auto back = opened(to, second);
      ASSERT_TRUE(back);
      EXPECT_TRUE(notes_.empty()) << all_notes();
      expect_place(back->info(), twice);
      // OpenVDB has no integers of 8 bits: there voxels are floats.
      if (back->info().format == VoxelFormat::density8) {
        EXPECT_EQ(*read(*back), voxels);
      }
      if (HasFailure()) return;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, PlaceTable,
                         testing::Values(Format::nrrd, Format::nhdr, Format::nii, Format::nii_gz, Format::mrc,
                                         Format::raw, Format::svmm, Format::vqv, Format::tif),
                         [](const auto& format) {
                           std::string name = endings[static_cast<size_t>(format.param)];
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

}  // namespace
}  // namespace voxkit
