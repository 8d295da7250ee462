#include "tileflight/tiles/demo_place/stadium.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <mutex>
#include <numbers>

#include "tileflight/tiles/demo_place/bake_charts.h"
#include "tileflight/tiles/demo_place/photogrammetry.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"
#include "tileflight/tiles/simplification/simplify.h"
#include "tileflight/tiles/tile_writer/tileset_writer.h"

namespace tileflight::demo_place {
namespace {

using imaging::TexturedMesh;

constexpr double kLeaf_m = 50.0;
constexpr int kLeaves = 8;  ///< along each side of the site
constexpr double kShadowCell_m = 0.2;
constexpr const char* kAttribution = "tileflight built-in stadium, CC0";

/// Heading of the field's long axis, clockwise from north. Not aligned with the world's axes, so that no wall lies
/// along a row of voxels.
constexpr double kHeading_rad = 17.0 * std::numbers::pi / 180.0;

std::vector<Chart> make_charts(const SitePlan& plan, const Terrain& terrain) {
  std::vector<Chart> charts = make_ground(plan, terrain, kLeaf_m);
  for (auto* make : {&make_stands, &make_buildings, &make_trees, &make_cars, &make_furniture})
    for (Chart& chart : (*make)(plan, terrain)) charts.push_back(std::move(chart));
  return charts;
}

/// Layers that get separate textures: the ground of a leaf, its solid objects, and its thin ones.
enum class Layer { kGround, kSolid, kThin };
constexpr std::array<Layer, 3> kLayers{Layer::kGround, Layer::kSolid, Layer::kThin};

std::size_t leaf_of(const Chart& chart) {
  geometry::Box3 box;
  for (const Vec3& vertex : chart.vertices) box.extend(vertex);
  const auto cell = [](double place_m) {
    return static_cast<std::size_t>(std::clamp(static_cast<int>((place_m + kSiteHalf_m) / kLeaf_m), 0, kLeaves - 1));
  };
  return cell(box.center().y()) * kLeaves + cell(box.center().x());
}

/// Charts by leaf and layer; the ground's charts come first in the list.
std::vector<std::array<std::vector<const Chart*>, kLayers.size()>> sorted_charts(const std::vector<Chart>& charts) {
  std::vector<std::array<std::vector<const Chart*>, kLayers.size()>> leaves(kLeaves * kLeaves);
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const Layer layer = i < leaves.size() ? Layer::kGround : charts[i].thin ? Layer::kThin : Layer::kSolid;
    leaves[leaf_of(charts[i])][static_cast<std::size_t>(layer)].push_back(&charts[i]);
  }
  return leaves;
}

struct BakedStadium {
  std::vector<TexturedMesh> world;  ///< everything, at the finest level
  std::vector<TexturedMesh> solid;  ///< without thin objects; textures shared with `world`
};

BakedStadium bake_stadium(const std::vector<Chart>& charts, double texture_scale, const Progress& progress) {
  const Sunlight sun(Vec3(-0.55, -0.45, 0.85), charts, kShadowCell_m);
  const auto leaves = sorted_charts(charts);
  std::vector<std::array<TexturedMesh, kLayers.size()>> baked(leaves.size());
  std::mutex mutex;
  std::int64_t done = 0;
  tbb::parallel_for(std::size_t{0}, leaves.size(), [&](std::size_t i) {
    for (std::size_t layer = 0; layer < kLayers.size(); ++layer) {
      baked[i][layer] = bake_charts(leaves[i][layer], sun, texture_scale);
      simplification::drop_unused_vertices(baked[i][layer]);
    }
    const std::lock_guard lock(mutex);
    report_progress(progress, ++done, std::ssize(leaves), "painting the stadium");
  });
  BakedStadium place;
  for (const auto& leaf : baked) {
    for (const Layer layer : kLayers) {
      const TexturedMesh& mesh = leaf[static_cast<std::size_t>(layer)];
      if (mesh.mesh.triangles.empty()) continue;
      place.world.push_back(mesh);
      if (layer != Layer::kThin) place.solid.push_back(mesh);
    }
  }
  return place;
}

geometry::SE3 T_ecef_site() {
  const geometry::LocalFrame frame({kStadiumLatitudeDeg, kStadiumLongitudeDeg, {kStadiumHeightM}});
  const geometry::Mat3 turn = Eigen::AngleAxisd(-kHeading_rad, Vec3::UnitZ()).toRotationMatrix();
  return frame.T_ecef_local() * geometry::SE3(turn, Vec3::Zero());
}

/// Progress with a prefix.
Progress named(const Progress& progress, const std::string& name) {
  if (!progress) return {};
  return [progress, name](std::int64_t done, std::int64_t total, std::string_view what) {
    progress(done, total, name + ": " + std::string(what));
  };
}

}  // namespace

void write_stadium(const std::filesystem::path& folder, const StadiumOptions& options, const Progress& progress) {
  const auto seed = static_cast<std::uint32_t>(options.seed ^ (options.seed >> 32));
  const SitePlan plan = make_site_plan(seed);
  const Terrain terrain(plan);
  const std::vector<Chart> charts = make_charts(plan, terrain);
  const BakedStadium place = bake_stadium(charts, options.texture_scale, progress);
  tile_writer::TilesetOptions tileset;
  tileset.copyright = kAttribution;
  tileset.T_ecef_local = T_ecef_site();
  tile_writer::write_tileset(folder / "world", place.world, tileset, named(progress, "world"));
  if (!options.twin) return;
  PhotogrammetryOptions photogrammetry;
  photogrammetry.seed = seed + 99U;
  tile_writer::write_tileset(folder / "twin", simulate_photogrammetry(place.solid, photogrammetry), tileset,
                             named(progress, "twin"));
}

}  // namespace tileflight::demo_place
