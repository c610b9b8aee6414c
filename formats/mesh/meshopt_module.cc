// Buffers of EXT_meshopt_compression, by meshoptimizer, whose decoders are safe on any bytes: meshopt.so.
#include <meshoptimizer.h>

#include "formats/mesh/mesh_module.h"

namespace voxkit {
namespace {

bool decode(const MeshoptView& view, std::span<const std::byte> bytes, std::span<std::byte> out) {
  using enum MeshoptView::Mode;
  const auto* in = reinterpret_cast<const unsigned char*>(bytes.data());
  const size_t count = view.count, stride = view.stride;
  const bool index = stride == 2 || stride == 4;
  switch (view.mode) {
    case triangles:
      return index && count % 3 == 0 &&
             meshopt_decodeIndexBuffer(out.data(), count, stride, in, bytes.size()) == 0;
    case indices:
      return index && meshopt_decodeIndexSequence(out.data(), count, stride, in, bytes.size()) == 0;
    case attributes:
      break;
  }
  if (stride == 0 || stride > 256 || stride % 4 != 0 ||
      meshopt_decodeVertexBuffer(out.data(), count, stride, in, bytes.size()) != 0)
    return false;
  switch (view.filter) {
    case MeshoptView::Filter::none:
      break;
    case MeshoptView::Filter::octahedral:
      if (stride != 4 && stride != 8) return false;
      meshopt_decodeFilterOct(out.data(), count, stride);
      break;
    case MeshoptView::Filter::quaternion:
      if (stride != 8) return false;
      meshopt_decodeFilterQuat(out.data(), count, stride);
      break;
    case MeshoptView::Filter::exponential:
      meshopt_decodeFilterExp(out.data(), count, stride);
      break;
  }
  return true;
}

const MeshModule meshopt{.decode_meshopt = decode};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.mesh = &voxkit::meshopt)
