// The volumes that vox-render draws: how they are read, and what draws them.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "formats/volume/readers.h"
#include "librender/device/device_dvr.h"
#include "librender/device/device_grid.h"
#include "librender/dvr/dvr.h"
#include "tools/common/main.h"

namespace voxkit::cli {

/// What is asked of a volume.
struct SceneOptions {
  OpenOptions open;
  std::optional<ValueRange> range;  ///< sample values
  bool dvr = false;
  color::AttributeSet needs = {};                  ///< of surfaces, for layers
  bool level_of_detail = false;                    ///< as CastOptions
  std::shared_ptr<const render::Backend> backend;  ///< that draws; null: this machine, its own way
};

/// A volume that is ready to be drawn.
struct Scene {
  VolumeInfo info;
  // Surfaces: one of the first five; some on the GPU.
  std::optional<render::SvmmGrid> compressed;
  std::optional<render::DagGrid> dag;
  std::optional<render::MaskGrid> masks;
  std::optional<render::PackedGrid> packed;
  std::shared_ptr<const render::DenseGrid> dense;
  std::unique_ptr<const render::DeviceGrid> device;
  ValueRange range{0, 255};  ///< stored values
  // Direct volume rendering.
  std::shared_ptr<const render::DvrVolume> volume;
  std::optional<render::DvrScene> dvr;
  std::unique_ptr<const render::DeviceDvr> device_dvr;  ///< of `dvr`, which must not be moved then

  /// With a transfer function, before direct volume rendering.
  Status classify(const render::TransferFunction& transfer, const SceneOptions& options, Run& run);
  /// What a frame has to hold of which `wanted` is wanted.
  render::FrameJob job(render::FrameJob wanted) const;
  Status draw(const render::Camera& camera, render::CastOptions options,
              const render::DvrOptions& dvr_options, render::Frame& frame, Context& ctx) const;
};

Result<Scene> open_scene(const std::string& name, const SceneOptions& options, Run& run);

/// A transfer function by the name of a file or a preset, in sample values; presets span `range` of
/// `measured`. Errors: those of files; ErrorCode::usage where it is neither.
Result<render::TransferFunction> find_transfer(const std::string& name, const SceneOptions& options,
                                               const Scene& measured);
/// Whether `find_transfer` may find something, without looking at a volume or a file.
Status check_transfer(const std::string& name);

}  // namespace voxkit::cli
