#include "libcolor/attributes/attribute_selection.h"

#include <algorithm>

namespace voxkit::color {
namespace {

class Selection final : public SurfaceSource {
 public:
  Selection(std::unique_ptr<SurfaceSource> source, AttributeSet set) : source_(std::move(source)) {
    info_ = source_->info();
    notes_ = source_->notes();
    emits_ = source_->emits();
    attributes_ = set;
  }
  Status read(Context& ctx, const Sink& sink) override {
    const AttributeSet all = source_->attributes();
    std::vector<std::byte> values;
    return source_->read(ctx, [&](const VoxelRun& run) {
      values.resize(run.voxels.size() * attributes_.bytes());
      for (size_t i = 0; i < attribute_kinds.size(); ++i) {
        const auto attribute = static_cast<Attribute>(i);
        if (!attributes_.has(attribute)) continue;
        const size_t bytes = kind_of(attribute).bytes;
        for (size_t v = 0; v < run.voxels.size(); ++v)
          std::copy_n(&run.attributes[v * all.bytes() + all.offset(attribute)], bytes,
                      &values[v * attributes_.bytes() + attributes_.offset(attribute)]);
      }
      return sink({run.voxels, values});
    });
  }

 private:
  std::unique_ptr<SurfaceSource> source_;
};

}  // namespace

std::unique_ptr<SurfaceSource> with_attributes(std::unique_ptr<SurfaceSource> source, AttributeSet set) {
  if (set == source->attributes()) return source;
  return std::make_unique<Selection>(std::move(source), set);
}

}  // namespace voxkit::color
