// From a place to what is stored there, in each of the three compressed forms.
#include <array>
#include <vector>

#include "formats/hash.h"
#include "formats/volume/builtin.h"
#include "libcolor/dag/dag_builder.h"
#include "libcolor/dag/dag_view.h"
#include "libcolor/layout.h"
#include "libcolor/terrain/terrain.h"
#include "libsvmm/walk.h"
#include "libvq/store.h"
#include "tests/bench/ceilings.h"
#include "tests/bench/kernels.h"

namespace voxkit::bench {
namespace {

constexpr size_t lookups = 1 << 18;

using Place = std::array<uint32_t, 3>;

/// Places anywhere in a box.
std::vector<Place> scattered(const Index3& dims) {
  std::vector<Place> places(lookups);
  for (size_t i = 0; i < places.size(); ++i)
    for (int a = 0; a < 3; ++a)
      places[i][static_cast<size_t>(a)] =
          static_cast<uint32_t>(random64(static_cast<uint64_t>(a), i) % static_cast<uint64_t>(dims[a]));
  return places;
}
/// Rows of places along x in the middle of it.
std::vector<Place> in_rows(const Index3& dims) {
  std::vector<Place> places(lookups);
  const auto x = static_cast<uint64_t>(dims.x), y = static_cast<uint64_t>(dims.y);
  const uint64_t first = static_cast<uint64_t>(dims.z / 2) * x * y;
  for (size_t i = 0; i < places.size(); ++i) {
    const uint64_t at = (first + i) % (x * y * static_cast<uint64_t>(dims.z));
    places[i] = {static_cast<uint32_t>(at % x), static_cast<uint32_t>(at / x % y),
                 static_cast<uint32_t>(at / (x * y))};
  }
  return places;
}

/// A load from anywhere in each of some pools. Also counts the time of these loads if each waits for the one
/// before it, as those of a single lookup do; lookups need not wait for each other.
Limit one_load_of_each(benchmark::State& state, const std::vector<uint64_t>& pools, const char* what) {
  double ns = 0, waiting = 0;
  for (const uint64_t bytes : pools) {
    ns += scattered_load_ns(bytes);
    waiting += chained_load_ns(bytes);
  }
  state.counters["ns_if_each_waits"] = waiting;
  return {ns, what};
}

struct Svmm {
  std::shared_ptr<const svmm::Volume> volume;
  std::vector<uint64_t> pools;  ///< bytes of each level
  uint64_t bytes = 0;           ///< of all
};

Result<std::shared_ptr<const Svmm>> make_svmm(std::unique_ptr<VolumeSource> source, const std::string& name) {
  auto made = std::make_shared<Svmm>();
  VOX_TRY(made->volume, lossless_svmm(std::move(source), name));
  for (const svmm::Level& level : made->volume->levels()) {
    made->pools.push_back(level.blocks * level.block_bytes);
    made->bytes += made->pools.back();
  }
  return made;
}

void add_svmm(const std::string& name, const std::shared_ptr<Lazy<Svmm>>& input) {
  for (const bool rows : {false, true})
    add("locate/svmm/" + name + (rows ? "/rows" : "/scattered"), input,
        [rows](benchmark::State& state, const Svmm& s) {
          const std::vector<Place> places =
              rows ? in_rows(s.volume->info().dims) : scattered(s.volume->info().dims);
          const svmm::MappedPools pools(*s.volume);
          svmm::Walk<svmm::MappedPools> walk(s.volume->store().view, pools);
          uint64_t entered = 0, bytes = 0;
          for (auto _ : state) {
            const uint32_t entered_before = walk.blocks_entered(), bytes_before = walk.bytes_read();
            for (const Place& p : places) benchmark::DoNotOptimize(walk.locate(p[0], p[1], p[2], -1));
            entered = walk.blocks_entered() - entered_before;
            bytes = walk.bytes_read() - bytes_before;
          }
          state.counters["blocks"] = static_cast<double>(entered) / lookups;
          state.counters["bytes"] = static_cast<double>(bytes) / lookups;
          const double volume_voxels = static_cast<double>(s.volume->info().box().voxels());
          report(state, lookups,
                 rows ? Limit{static_cast<double>(s.bytes) / volume_voxels /
                                  read_bytes_per_s(1, beyond_caches) * 1e9,
                              "reading all blocks once"}
                      : one_load_of_each(state, s.pools, "a load from each level"));
        });
}

struct Vq {
  std::shared_ptr<const vq::Volume> volume;
};

Result<std::shared_ptr<const Vq>> make_vq(std::unique_ptr<VolumeSource> source, const std::string& name) {
  VOX_TRY(const auto container, contain(name, [&](const ByteSink& sink) -> Status {
            VOX_TRY(const auto encoded, vq::encode(*source, {}, sink, context()));
            (void)encoded;
            return {};
          }));
  auto made = std::make_shared<Vq>();
  VOX_TRY(made->volume, vq::Volume::open(container));
  return made;
}

/// From a place to its codeword; nothing is decoded.
void add_vq(const std::string& name, const std::shared_ptr<Lazy<Vq>>& input) {
  for (const bool rows : {false, true})
    add("locate/vq/" + name + (rows ? "/rows" : "/scattered"), input,
        [rows](benchmark::State& state, const Vq& v) {
          const std::vector<Place> places =
              rows ? in_rows(v.volume->bricks()) : scattered(v.volume->bricks());
          const vq::MappedPools pools(*v.volume);
          const vq::Reader<vq::MappedPools> reader(v.volume->view(), pools);
          for (auto _ : state)
            for (const Place& p : places) {
              vq::Record record;
              if (!reader.find(reader.brick_id(p[0], p[1], p[2]), record))
                return give_up(state, Error{ErrorCode::input, v.volume->container().name(), "no brick"});
              benchmark::DoNotOptimize(record);
            }
          const vq::Params& params = v.volume->params();
          const double bytes = static_cast<double>(params.offset_bytes + params.codebook_bytes),
                       bricks = static_cast<double>(v.volume->bricks().x * v.volume->bricks().y *
                                                    v.volume->bricks().z);
          report(state, lookups,
                 rows ? Limit{reading_ns(bytes / bricks), "reading the file once"}
                      : one_load_of_each(state,
                                         {params.offset_bytes, params.offset_bytes, params.codebook_bytes},
                                         "loads of place, address, codeword"));
        });
}

struct Surface {
  color::Dag dag;
  std::vector<uint64_t> scattered, in_order;  ///< places of voxels
};

Result<std::shared_ptr<const Surface>> make_surface(const std::string& name) {
  VOX_TRY(const auto source, color::open_terrain(name));
  auto made = std::make_shared<Surface>();
  std::vector<uint64_t> all;
  color::DagBuilder builder(color::height_of(source->info().dims), context());
  VOX_CHECK(source->read(context(), [&](std::span<const color::SurfaceVoxel> run) -> Status {
    for (const color::SurfaceVoxel& voxel : run) all.push_back(voxel.place);
    return builder.add(run);
  }));
  VOX_TRY(made->dag, builder.finish());
  for (size_t i = 0; i < lookups; ++i) {
    made->scattered.push_back(all[random64(3, i) % all.size()]);
    made->in_order.push_back(all[i % all.size()]);
  }
  return made;
}

Limit limit_of(benchmark::State& state, const color::Dag& dag) {
  std::vector<uint64_t> pools{dag.leaves.size() * sizeof(uint64_t)};
  for (const auto& nodes : dag.nodes)
    if (!nodes.empty()) pools.push_back(nodes.size() * sizeof(uint32_t));
  return one_load_of_each(state, pools, "a load from each level");
}

/// From a voxel to the number of its colour.
void add_dag(const std::string& name, const std::shared_ptr<Lazy<Surface>>& input) {
  for (const bool ordered : {false, true})
    add("locate/dag/" + name + (ordered ? "/morton" : "/scattered"), input,
        [ordered](benchmark::State& state, const Surface& s) {
          const color::DagView view = color::view_of(s.dag);
          for (auto _ : state)
            for (const uint64_t place : ordered ? s.in_order : s.scattered)
              benchmark::DoNotOptimize(color::find_voxel(view, place).color);
          report(state, lookups, limit_of(state, s.dag));
        });
  add("locate/dag/" + name + "/morton/path_kept", input, [](benchmark::State& state, const Surface& s) {
    const color::DagView view = color::view_of(s.dag);
    for (auto _ : state) {
      color::CellFinder finder(view);
      for (const uint64_t place : s.in_order) benchmark::DoNotOptimize(finder.find(place, 0).color);
    }
    report(state, lookups, {scattered_load_ns(s.dag.leaves.size() * sizeof(uint64_t)), "a load of the leaf"});
  });
}

}  // namespace

void add_locate_kernels(bool quick) {
  const int level = quick ? 2 : 5;
  const int64_t side = quick ? 24 : 192, terrain = quick ? 64 : 1024;
  const std::string sponge = "menger:" + std::to_string(level), cells = "membrane:" + std::to_string(side),
                    hills = "terrain:" + std::to_string(terrain);
  add_svmm(sponge, std::make_shared<Lazy<Svmm>>([=] { return make_svmm(menger_source(level), sponge); }));
  const auto membrane = [=] { return membrane_source(Index3(side), 1); };
  add_svmm(cells, std::make_shared<Lazy<Svmm>>([=] { return make_svmm(membrane(), cells); }));
  add_vq(cells, std::make_shared<Lazy<Vq>>([=] { return make_vq(membrane(), cells); }));
  add_dag(hills, std::make_shared<Lazy<Surface>>([=] { return make_surface(hills); }));
}

}  // namespace voxkit::bench
