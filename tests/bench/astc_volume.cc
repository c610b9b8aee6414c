// bench_astc_volume: rate and distortion of ASTC with 3D blocks, a texture format that is decoded by
// hardware.
#include <astcenc.h>
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "formats/copy.h"
#include "formats/full_scale.h"
#include "formats/little_endian.h"
#include "formats/parallel.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"
#include "tools/common/parse.h"

namespace voxkit::bench {
namespace {

using cli::Json;

struct Options {
  std::string input;
  OpenOptions open;
  int64_t quality = static_cast<int64_t>(ASTCENC_PRE_MEDIUM);
  std::string profile = "ldr";
  std::vector<int64_t> blocks = {3, 4, 5, 6};
};

void declare(cli::CommandLine& line, Options& o) {
  line.argument("INPUT", "Volume of whole numbers: a file, or a built-in such as sphere:64", o.input);
  line.option("--quality", "Q", "Effort of the encoder, 0 to 100 (60, its \"medium\")",
              cli::integer(o.quality, 0, 100));
  line.option("--profile", "ldr|hdr", "Of 8 bits, or of half floats (ldr)",
              cli::one_of(o.profile, {"ldr", "hdr"}));
  line.option("--block", "N[,N]", "Edges of blocks, 3 to 6 (3,4,5,6)",
              [&o](const std::string& text) -> Status {
                VOX_TRY(o.blocks, cli::read_integers(text, 3, 6));
                return {};
              });
  cli::declare_input_options(line, o.open);
}

Status check(astcenc_error error) {
  if (error == ASTCENC_SUCCESS) return {};
  return fail(ErrorCode::internal, {}, fmt::format("astcenc: {}", astcenc_get_error_string(error)));
}

/// A volume as whole numbers, and as an image of four floats a voxel, for the encoder to read and the decoder
/// to write.
struct Texture {
  Index3 dims;
  double peak = 0;
  std::vector<uint16_t> values;
  std::vector<float> image;
  std::vector<void*> slices;

  astcenc_image view() {
    const auto side = [&](int axis) { return static_cast<unsigned>(dims[axis]); };
    return {side(0), side(1), side(2), ASTCENC_TYPE_F32, slices.data()};
  }
};

Result<std::unique_ptr<Texture>> load(const Options& o, Context& ctx) {
  VOX_TRY(const cli::Input input, cli::open_input(o.input, o.open, ctx));
  const VolumeInfo& info = input.source->info();
  if (info.format != VoxelFormat::density8 && info.format != VoxelFormat::density16)
    return bad_input(o.input, fmt::format("{} voxels: expected DENSITY8 or DENSITY16", name(info.format)));
  auto texture = std::make_unique<Texture>();
  texture->dims = info.dims;
  std::vector<std::byte> bytes(raw_bytes(info));
  VOX_CHECK(read_slab(*input.source, info.box(), packed(bytes.data(), info.dims, info.format), ctx));
  const auto voxels = static_cast<size_t>(info.box().voxels());
  texture->values.resize(voxels);
  for (size_t i = 0; i < voxels; ++i)
    texture->values[i] = info.format == VoxelFormat::density8 ? std::to_integer<uint16_t>(bytes[i])
                                                              : load_le<uint16_t>(&bytes[2 * i]);
  const auto [lo, hi] = std::minmax_element(texture->values.begin(), texture->values.end());
  texture->peak = full_scale(info, {static_cast<double>(*lo), static_cast<double>(*hi)});
  texture->image.resize(4 * voxels);
  const auto slice = static_cast<size_t>(4 * info.dims.x * info.dims.y);
  for (size_t z = 0; z < static_cast<size_t>(info.dims.z); ++z)
    texture->slices.push_back(&texture->image[z * slice]);
  return texture;
}

struct ContextCloser {
  void operator()(astcenc_context* context) const { astcenc_context_free(context); }
};

/// Compresses and decompresses with cubic blocks, and compares.
Result<Json> measure(Texture& texture, unsigned edge, const Options& o, cli::Run& run) {
  Context& ctx = run.ctx;
  const astcenc_profile profile = o.profile == "ldr" ? ASTCENC_PRF_LDR : ASTCENC_PRF_HDR_RGB_LDR_A;
  astcenc_config config{};
  VOX_CHECK(check(astcenc_config_init(profile, edge, edge, edge, static_cast<float>(o.quality),
                                      ASTCENC_FLG_SELF_DECOMPRESS_ONLY, &config)));
  // Only one channel counts. The presets stop where a block is good enough for pictures: here it never is.
  config.cw_g_weight = config.cw_b_weight = config.cw_a_weight = 0;
  config.tune_db_limit = 999;
  astcenc_context* raw = nullptr;
  VOX_CHECK(check(astcenc_context_alloc(&config, static_cast<unsigned>(ctx.threads), &raw)));
  const std::unique_ptr<astcenc_context, ContextCloser> context(raw);

  for (size_t i = 0; i < texture.values.size(); ++i) {
    const auto value = static_cast<float>(texture.values[i] / texture.peak);
    float* const voxel = &texture.image[4 * i];
    voxel[0] = voxel[1] = voxel[2] = value;
    voxel[3] = 1;
  }
  const Index3 grid = (texture.dims + Index3(edge - 1)) / Index3(edge);
  const auto blocks = static_cast<uint64_t>(grid.x * grid.y * grid.z);
  std::vector<uint8_t> file(blocks * 16);
  astcenc_image image = texture.view();
  const astcenc_swizzle grey{ASTCENC_SWZ_R, ASTCENC_SWZ_R, ASTCENC_SWZ_R, ASTCENC_SWZ_1};
  const double start = run.seconds();
  VOX_CHECK(parallel_for(ctx, ctx.threads, [&](int64_t thread) {
    return check(
        astcenc_compress_image(raw, &image, &grey, file.data(), file.size(), static_cast<unsigned>(thread)));
  }));
  const double middle = run.seconds();
  VOX_CHECK(parallel_for(ctx, ctx.threads, [&](int64_t thread) {
    return check(astcenc_decompress_image(raw, file.data(), file.size(), &image, &grey,
                                          static_cast<unsigned>(thread)));
  }));

  const double end = run.seconds();

  double squares = 0, greatest = 0;
  for (size_t i = 0; i < texture.values.size(); ++i) {
    const double value = std::round(texture.image[4 * i] * texture.peak);
    const double error = std::abs(std::clamp(value, 0.0, texture.peak) - texture.values[i]);
    squares += error * error;
    greatest = std::max(greatest, error);
  }
  const auto voxels = static_cast<double>(texture.values.size());
  Json json = Json::object();
  json.set("block", static_cast<int64_t>(edge));
  json.set("file_bytes", file.size());
  json.set("bits_per_voxel", 8 * static_cast<double>(file.size()) / voxels);
  json.set("psnr_db", 10 * std::log10(texture.peak * texture.peak * voxels / squares));
  json.set("max_abs_error", greatest);
  json.set("encode_seconds", middle - start).set("decode_seconds", end - middle);
  return json;
}

Result<int> work(const Options& o, cli::Run& run) {
  VOX_TRY(const auto texture, load(o, run.ctx));
  Json json = Json::result();
  json.set("tool", run.tool).set("version", cli::version_text()).set("input", o.input);
  json.set("dims", texture->dims)
      .set("peak", texture->peak)
      .set("quality", o.quality)
      .set("profile", o.profile);
  Json results = Json::array();
  for (const int64_t edge : o.blocks) {
    VOX_TRY(Json result, measure(*texture, static_cast<unsigned>(edge), o, run));
    results.push(std::move(result));
  }
  json.set("results", std::move(results));
  VOX_CHECK(cli::print(json.text()));
  return 0;
}

}  // namespace
}  // namespace voxkit::bench

int main(int argc, char** argv) {
  using namespace voxkit;
  bench::Options options;
  return cli::run_tool(
      argc, argv, "bench_astc_volume",
      "Compresses a volume with ASTC in blocks of 3^3 to 6^3 voxels and says how far off it is then.",
      "  bench_astc_volume scan.nii.gz\n", [&](cli::CommandLine& line) { bench::declare(line, options); },
      [&](cli::Run& run) { return bench::work(options, run); });
}
