#include "tools/render_scene.h"

#include <fmt/core.h>

#include "formats/copy.h"
#include "librender/cast/surface_traits.h"
#include "tools/common/input.h"

namespace voxkit::cli {

using namespace voxkit::render;

namespace {

/// The volume's file, if the error is about voxels and names none.
tl::unexpected<Error> named(Error error, const std::string& name) {
  if (error.code == ErrorCode::input && error.file.empty()) error.file = name;
  return tl::unexpected<Error>(std::move(error));
}

/// For direct volume rendering: from the compressed form where there is one.
Result<std::shared_ptr<const DvrVolume>> open_volume(Input& input, bool device, Run& run) {
  if (is_color(input.source->info().format))
    return bad_input({}, fmt::format("voxels are {}: expected a scalar volume for --mode dvr",
                                     voxkit::name(input.source->info().format)));
  const auto opened = [&]() -> Result<DvrVolume> {
    if (input.svmm && !device) {  // which has no code for it: it gets the voxels
      run.stage("measure");
      return DvrVolume::open(input.svmm, run.ctx);
    }
    if (input.vq) return DvrVolume::open(input.vq, run.ctx);
    if (input.packed && !device) {
      run.stage("measure");
      return DvrVolume::open(input.packed, run.ctx);
    }
    run.stage("read");
    VOX_TRY(auto grid, DenseGrid::read(*input.source, run.ctx));
    return DvrVolume::open(std::move(grid), run.ctx);
  };
  VOX_TRY(DvrVolume volume, opened());
  return std::make_shared<const DvrVolume>(std::move(volume));
}

/// That a surface, or what is none, has the attributes that layers need.
Status check_needs(const color::AttributeSet has, const std::string& name, color::AttributeSet needs) {
  std::string all = "depth, normal, position, steps";
  for (size_t i = 0; i < color::attribute_kinds.size(); ++i)
    if (const auto a = static_cast<color::Attribute>(i); has.has(a) && a != color::Attribute::normal)
      all += fmt::format(", {}", color::kind_of(a).name);
  for (size_t i = 0; i < color::attribute_kinds.size(); ++i)
    if (const auto a = static_cast<color::Attribute>(i); needs.has(a) && !has.has(a))
      return fail(ErrorCode::usage, name,
                  fmt::format("--aov {}: it has no such attribute: expected some of {}",
                              color::kind_of(a).name, all));
  return {};
}

}  // namespace

Status Scene::classify(const TransferFunction& transfer, const SceneOptions& options, Run& run) {
  VOX_TRY(dvr, DvrScene::create(volume, transfer, run.ctx));
  if (options.backend) {
    run.stage("upload");
    VOX_TRY(device_dvr, DeviceDvr::upload(*dvr, options.backend, run.ctx));
  }
  return {};
}

FrameJob Scene::job(FrameJob wanted) const {
  wanted.traits = dag ? traits_of(dag->volume(), wanted.traits) : color::AttributeSet();
  wanted.details |= dag || masks || device || device_dvr;  // where to look colours up, what was hit
  wanted.costs = device || device_dvr;
  return wanted;
}

Status Scene::draw(const Camera& camera, CastOptions options, const DvrOptions& dvr_options, Frame& frame,
                   Context& ctx) const {
  if (device_dvr) return device_dvr->draw(camera, dvr_options, frame, ctx);
  if (dvr) return dvr->draw(camera, dvr_options, frame, ctx);
  options.range = range;
  if (device) return device->cast(camera, options, frame, ctx);
  if (dag) return cast(*dag, camera, options, frame, ctx);
  if (masks) return cast(*masks, camera, options, frame, ctx);
  if (packed) return cast(*packed, camera, options, frame, ctx);
  return compressed ? cast(*compressed, camera, options, frame, ctx)
                    : cast(*dense, camera, options, frame, ctx);
}

Result<Scene> open_scene(const std::string& name, const SceneOptions& o, Run& run) {
  VOX_TRY(Input input, open_input(name, o.open, run.ctx));
  VOX_CHECK(
      check_needs(input.color ? input.color->params().attributes : color::AttributeSet(), name, o.needs));
  Scene scene;
  scene.info = input.source->info();
  if (o.dvr) {
    auto volume = open_volume(input, o.backend != nullptr, run);
    if (!volume) return named(std::move(volume).error(), name);
    scene.volume = std::move(*volume);
    return scene;
  }
  const VoxelFormat format = scene.info.format;
  if (o.range) {
    scene.range = {scene.info.stored(o.range->lo), scene.info.stored(o.range->hi)};
  } else if (format == VoxelFormat::density16 || format == VoxelFormat::float32) {
    if (name == "-")
      return bad_usage(
          "the values of a stream cannot be looked at twice: give their range with --range LO,HI");
    run.stage("measure");
    VOX_TRY(const Input again, open_input(name, o.open, run.ctx));
    VOX_TRY(scene.range, measure_range(*again.source, run.ctx));
  }
  if (input.svmm) {
    scene.compressed.emplace(input.svmm);
  } else if (input.color) {
    if (o.level_of_detail && input.color->params().colors != color::Colors::all)
      run.say(name +
              ": --lod on: voxels alone have colors: all of them are drawn (dagcolor-pack --colors all "
              "gives coarser ones theirs)");
    scene.dag.emplace(input.color);
  } else if (input.packed && !o.backend && !o.level_of_detail && render::MaskGrid::fits(*input.packed)) {
    run.stage("read");
    VOX_TRY(scene.masks, render::MaskGrid::open(input.packed, run.ctx));
  } else if (input.packed && !o.backend) {
    scene.packed.emplace(input.packed);
  } else {
    run.stage("read");
    VOX_TRY(scene.dense, DenseGrid::read(*input.source, run.ctx));
  }
  if (o.backend) {
    run.stage("upload");
    const auto upload = [&](const auto& grid) { return DeviceGrid::upload(grid, o.backend, run.ctx); };
    VOX_TRY(scene.device, scene.compressed ? upload(*scene.compressed)
                          : scene.dag      ? upload(*scene.dag)
                                           : upload(*scene.dense));
  }
  return scene;
}

Status check_transfer(const std::string& name) {
  if (is_transfer_preset(name) || name.ends_with(".json")) return {};
  return bad_usage(
      fmt::format("--tf: \"{}\": expected a file, FILE.json, or one of {}", name, transfer_presets()));
}

Result<TransferFunction> find_transfer(const std::string& name, const SceneOptions& o,
                                       const Scene& measured) {
  if (!is_transfer_preset(name)) {
    VOX_TRY(std::vector<TransferPoint> points, read_transfer_file(name));
    for (TransferPoint& point : points) point.value = measured.info.stored(point.value);
    return TransferFunction(std::move(points));
  }
  ValueRange range{0, 255};
  if (o.range)
    range = {measured.info.stored(o.range->lo), measured.info.stored(o.range->hi)};
  else if (measured.info.format == VoxelFormat::bitmap)
    range = {0, 1};
  else if (measured.info.format != VoxelFormat::density8)
    range = measured.volume->ranges().all();
  return *transfer_preset(name, range);
}

}  // namespace voxkit::cli
