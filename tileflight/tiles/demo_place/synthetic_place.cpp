#include "tileflight/tiles/demo_place/synthetic_place.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <mutex>
#include <string>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/demo_place/bake_charts.h"
#include "tileflight/tiles/demo_place/landscape.h"
#include "tileflight/tiles/demo_place/photogrammetry.h"
#include "tileflight/tiles/demo_place/stadium.h"
#include "tileflight/tiles/simplification/simplify.h"
#include "tileflight/tiles/tile_writer/tileset_writer.h"

namespace tileflight::demo_place {
namespace {

using imaging::TexturedMesh;

constexpr double kShadowCell_m = 0.2;

/// Layers that get separate textures: the ground of a leaf, its solid objects, and its thin ones.
enum class Layer { kGround, kSolid, kThin };
constexpr std::array<Layer, 3> kLayers{Layer::kGround, Layer::kSolid, Layer::kThin};
using LeafCharts = std::array<std::vector<const Chart*>, kLayers.size()>;

/// Charts by leaf and layer.
std::vector<LeafCharts> sorted_charts(const SyntheticPlace& place) {
  const auto leaves = static_cast<std::size_t>(std::lround(2.0 * place.half_m / SyntheticPlace::kLeaf_m));
  std::vector<LeafCharts> sorted(leaves * leaves);
  const auto cell = [&](double at_m) {
    const auto index = static_cast<int>((at_m + place.half_m) / SyntheticPlace::kLeaf_m);
    return static_cast<std::size_t>(std::clamp(index, 0, static_cast<int>(leaves) - 1));
  };
  for (std::size_t i = 0; i < place.charts.size(); ++i) {
    const Chart& chart = place.charts[i];
    geometry::Box3 box;
    for (const Vec3& vertex : chart.vertices) box.extend(vertex);
    const Layer layer = i < sorted.size() ? Layer::kGround : chart.thin ? Layer::kThin : Layer::kSolid;
    const std::size_t leaf = cell(box.center().y()) * leaves + cell(box.center().x());
    sorted[leaf][static_cast<std::size_t>(layer)].push_back(&chart);
  }
  return sorted;
}

struct BakedPlace {
  std::vector<TexturedMesh> world;  ///< everything, at the finest level
  std::vector<TexturedMesh> solid;  ///< without thin objects; textures shared with `world`
};

BakedPlace bake(const SyntheticPlace& place, double texture_scale, const Progress& progress) {
  const Sunlight sun(Vec3(-0.55, -0.45, 0.85), place.charts, kShadowCell_m);
  const auto leaves = sorted_charts(place);
  std::vector<std::array<TexturedMesh, kLayers.size()>> baked(leaves.size());
  std::mutex mutex;
  std::int64_t done = 0;
  tbb::parallel_for(std::size_t{0}, leaves.size(), [&](std::size_t i) {
    for (std::size_t layer = 0; layer < kLayers.size(); ++layer) {
      baked[i][layer] = bake_charts(leaves[i][layer], sun, texture_scale);
      simplification::drop_unused_vertices(baked[i][layer]);
    }
    const std::lock_guard lock(mutex);
    report_progress(progress, ++done, std::ssize(leaves), "painting the place");
  });
  BakedPlace result;
  for (const auto& leaf : baked) {
    for (const Layer layer : kLayers) {
      const TexturedMesh& mesh = leaf[static_cast<std::size_t>(layer)];
      if (mesh.mesh.triangles.empty()) continue;
      result.world.push_back(mesh);
      if (layer != Layer::kThin) result.solid.push_back(mesh);
    }
  }
  return result;
}

/// Progress with a prefix.
Progress named(const Progress& progress, const std::string& name) {
  if (!progress) return {};
  return [progress, name](std::int64_t done, std::int64_t total, std::string_view what) {
    progress(done, total, name + ": " + std::string(what));
  };
}

std::uint32_t folded(std::uint64_t seed) { return static_cast<std::uint32_t>(seed ^ (seed >> 32)); }

constexpr std::array<PlaceName, 7> kNames{{
    {PlaceKind::kStadium, "stadium", "the stadium at the paper's coordinates, 400 m"},
    {PlaceKind::kTown, "town", "an old town: gabled houses along narrow streets, a church; 200 m"},
    {PlaceKind::kSuburb, "suburb", "detached houses with gardens, hedges and cars; 200 m"},
    {PlaceKind::kRavine, "ravine", "a gorge of rock strata between meadows; 200 m"},
    {PlaceKind::kWorks, "works", "halls, tanks, chimneys, containers, pipes; 200 m"},
    {PlaceKind::kWoods, "woods", "the edge of a conifer forest, fields, a track; 200 m"},
    {PlaceKind::kFort, "fort", "a star fort with ditch, ramparts, towers and barracks; 200 m"},
}};

}  // namespace

void write_synthetic_place(const std::filesystem::path& folder, const SyntheticPlace& place,
                           const PlaceOptions& options, const Progress& progress) {
  const BakedPlace baked = bake(place, options.texture_scale, progress);
  tile_writer::TilesetOptions tileset;
  tileset.copyright = place.attribution;
  const geometry::Mat3 turn = Eigen::AngleAxisd(-place.heading_rad, Vec3::UnitZ()).toRotationMatrix();
  tileset.T_ecef_local = geometry::LocalFrame(place.origin).T_ecef_local() * geometry::SE3(turn, Vec3::Zero());
  tile_writer::write_tileset(folder / "world", baked.world, tileset, named(progress, "world"));
  if (!options.twin) return;
  PhotogrammetryOptions photogrammetry;
  photogrammetry.seed = folded(options.seed) + 99U;
  tile_writer::write_tileset(folder / "twin", simulate_photogrammetry(baked.solid, photogrammetry), tileset,
                             named(progress, "twin"));
}

std::span<const PlaceName> place_names() { return kNames; }

std::optional<PlaceKind> place_kind(std::string_view name) {
  const auto found = std::ranges::find(kNames, name, &PlaceName::name);
  return found == kNames.end() ? std::nullopt : std::optional(found->kind);
}

std::optional<BuiltInSource> built_in_source(const std::string& source) {
  const std::size_t colon = source.find(':');
  if (colon == std::string::npos) return std::nullopt;
  const std::string place = source.substr(0, colon);
  const std::size_t dash = place.find('-');
  const auto kind = place_kind(std::string_view(place).substr(0, dash));
  if (!kind) return std::nullopt;
  BuiltInSource result{.kind = *kind, .seed = std::nullopt, .model = source.substr(colon + 1)};
  if (result.model != "twin" && result.model != "world")
    throw InputError("built-in place", "there is no '" + source + "'; use " + place + ":twin or " + place + ":world");
  if (dash == std::string::npos) return result;
  const std::string seed = place.substr(dash + 1);
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(seed.data(), seed.data() + seed.size(), number);
  if (error != std::errc() || end != seed.data() + seed.size())
    throw InputError("built-in place", "'" + source + "' has the seed '" + seed + "', which is no whole number");
  result.seed = number;
  return result;
}

SyntheticPlace make_place(PlaceKind kind, std::uint64_t seed) {
  switch (kind) {
    case PlaceKind::kStadium:
      return make_stadium(folded(seed));
    case PlaceKind::kTown:
      return make_town(folded(seed));
    case PlaceKind::kSuburb:
      return make_suburb(folded(seed));
    case PlaceKind::kRavine:
      return make_ravine(folded(seed));
    case PlaceKind::kWorks:
      return make_works(folded(seed));
    case PlaceKind::kWoods:
      return make_woods(folded(seed));
    case PlaceKind::kFort:
      return make_fort(folded(seed));
  }
  return {};
}

void write_place(const std::filesystem::path& folder, PlaceKind kind, const PlaceOptions& options,
                 const Progress& progress) {
  write_synthetic_place(folder, make_place(kind, options.seed), options, progress);
}

}  // namespace tileflight::demo_place
