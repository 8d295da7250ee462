#include "tileflight/evaluation/scoring/align_target.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "tileflight/capture/ingest/telemetry_positions.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/world/ground_truth/surface_samples.h"
#include "tileflight/world/ground_truth/truth_folder.h"
#include "tileflight/world/place/extract.h"
#include "tileflight/world/place/extract_result.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

/// The box extended to any height: a map's points above or below the truth must be aligned as well.
geometry::Box3 column(const geometry::Box3& box) {
  geometry::Box3 tall = box;
  tall.min().z() -= 1e6;
  tall.max().z() += 1e6;
  return tall;
}

geometry::Box3 bounds_of(const geometry::Trajectory& path) {
  geometry::Box3 box;
  for (const geometry::StampedPose& pose : path.poses) box.extend(pose.T_local_camera.translation);
  return box;
}

/// Bounds of the middle 98 % of the points along each axis: wrong points of a map may lie anywhere.
geometry::Box3 bounds_without_outliers(const std::vector<geometry::Vec3>& points) {
  geometry::Vec3 low, high;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const geometry::Vec3& p : points) values.push_back(p[axis]);
    const auto at = [&](std::size_t k) {
      std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(k), values.end());
      return values[k];
    };
    low[axis] = at(values.size() / 100);
    high[axis] = at(values.size() - 1 - values.size() / 100);
  }
  return {low, high};
}

geometry::Box3 in_view(const geometry::Box3& box) {
  const geometry::Vec3 range = geometry::Vec3::Constant(ground_truth::kDefaultViewRange_m);
  return {box.min() - range, box.max() + range};
}

/// Returns the parts in reach; all if the reach is not known, or nothing is in it.
std::vector<std::size_t> parts_in_reach(const ground_truth::TruthFolder& truth, const AlignReach& reach,
                                        const std::optional<geometry::Geodetic>& origin) {
  if (truth.size() == 1 || !reach) return truth.all_parts();
  const std::optional<geometry::Box3> box = reach(origin);
  std::vector<std::size_t> parts;
  if (box && !box->isEmpty()) parts = truth.parts_in(*box);
  return parts.empty() ? truth.all_parts() : parts;
}

}  // namespace

alignment::AlignmentTarget AlignTarget::to_alignment_target() const {
  return {.cloud = &cloud, .index = index ? &*index : nullptr, .mesh = index ? &mesh : nullptr};
}

AlignTarget read_align_target(const fs::path& path, const AlignReach& reach, const Progress& progress) {
  AlignTarget target;
  if (!fs::is_directory(path)) {
    target.cloud = geometry::read_cloud(path);
    return target;
  }
  target.folder = path;
  const place::ExtractResult extracted = place::read_extract_json(path);
  target.origin = extracted.origin;
  target.regions = {column(extracted.scored_region().box)};
  const ground_truth::TruthFolder truth(path);
  const std::vector<std::size_t> parts = parts_in_reach(truth, reach, target.origin);
  target.blocks = truth.size();
  target.blocks_read = parts.size();
  if (truth.size() > 1) {
    report_progress(
        progress, 0, 0,
        "reading " + std::to_string(parts.size()) + " of the truth's " + std::to_string(truth.size()) + " blocks");
  }
  for (const std::size_t part : parts) {
    if (truth.has_mesh(part)) target.mesh_files.push_back(truth.folder_of(part) / "mesh.glb");
  }
  target.cloud = truth.read_voxel_centers(parts);
  target.mesh = truth.read_meshes(parts);
  if (!target.mesh.triangles.empty()) target.index.emplace(target.mesh);
  return target;
}

std::optional<geometry::Box3> reach_of_map(const MapInputs& map, const geometry::PointCloud& cloud,
                                           const alignment::AlignMapOptions& options,
                                           const std::optional<geometry::Geodetic>& origin) {
  using alignment::AlignmentStart;
  // The regions are chosen among those that other flights' maps share.
  if (options.find_regions || options.start == AlignmentStart::kGeometry) return std::nullopt;
  if (options.start == AlignmentStart::kGiven || options.start == AlignmentStart::kAsItIs) {
    const geometry::Sim3 T = options.start == AlignmentStart::kGiven ? options.given_start : geometry::Sim3();
    return in_view(map.trajectory.empty() ? bounds_without_outliers(geometry::transformed(T, cloud).positions)
                                          : bounds_of(geometry::transformed(T, geometry::read_tum(map.trajectory))));
  }
  const bool by_true_poses = options.start == AlignmentStart::kTruePoses && !map.truth_trajectory.empty();
  const bool by_receiver = options.start == AlignmentStart::kAuto && !map.gps.empty() && origin;
  if (map.trajectory.empty() || (!by_true_poses && !by_receiver)) return std::nullopt;
  geometry::Box3 flown;
  for (const alignment::PositionFix& fix :
       by_receiver ? read_receiver_positions(map.gps, *origin) : read_true_positions(map.truth_trajectory))
    flown.extend(fix.position);
  return in_view(flown);
}

void require_overlap(const geometry::PointCloud& cloud, const geometry::Sim3& T_local_map, const AlignTarget& target,
                     const alignment::AlignMapOptions& options) {
  constexpr double kLeastShare = 0.01;  // of the points; chosen by hand
  const std::vector<geometry::Vec3> points = geometry::transformed(T_local_map, cloud).positions;
  geometry::Box3 held;
  for (const geometry::Vec3& p : target.index ? target.mesh.vertices : target.cloud.positions) held.extend(p);
  if (points.empty() || held.isEmpty()) return;
  double reach_m = options.icp.radius_m;
  for (const double radius_m : options.coarse_radii_m) reach_m = std::max(reach_m, radius_m);
  const geometry::Vec3 margin = geometry::Vec3::Constant(reach_m);
  const geometry::Box3 near(held.min() - margin, held.max() + margin), map = bounds_without_outliers(points);
  const auto inside = std::ranges::count_if(points, [&](const geometry::Vec3& p) { return near.contains(p); });
  const std::string remedy =
      ": its coordinates or units are others; search with --start geometry, or give a transform.json";
  if (static_cast<double>(inside) < kLeastShare * static_cast<double>(points.size()))
    throw InputError("map",
                     base::formatted("%td of its %zu points lie within %.3g m of the ground truth: they extend "
                                     "over %.3g m around a place %.3g m away from it, which extends over %.3g m",
                                     inside, points.size(), reach_m, map.sizes().norm(),
                                     std::sqrt(held.squaredExteriorDistance(map.center())), held.sizes().norm()) +
                         remedy);
  if (map.sizes().norm() < options.icp.radius_m)
    throw InputError("map", base::formatted("it extends over %.3g m, less than the distance of a correspondence (%.3g "
                                            "m, --radius)",
                                            map.sizes().norm(), options.icp.radius_m) +
                                remedy);
}

std::vector<alignment::PositionFix> read_receiver_positions(const fs::path& gps_csv, const geometry::Geodetic& origin) {
  const std::vector<dataset::GpsFix> gps = dataset::read_gps_csv(gps_csv);
  const std::vector<geometry::Vec3> positions = ingest::to_local_positions(gps, geometry::LocalFrame(origin));
  std::vector<alignment::PositionFix> fixes;
  for (std::size_t i = 0; i < gps.size(); ++i) {
    fixes.push_back({gps[i].time_s, positions[i], gps[i].horizontal_sigma_m, gps[i].vertical_sigma_m});
  }
  return fixes;
}

std::vector<alignment::PositionFix> read_true_positions(const fs::path& trajectory) {
  std::vector<alignment::PositionFix> fixes;
  for (const geometry::StampedPose& pose : read_true_poses(trajectory).poses) {
    fixes.push_back({pose.time_s, pose.T_local_camera.translation, 0.0, 0.0});
  }
  return fixes;
}

TexturedPlace read_textured_place(const std::vector<std::filesystem::path>& mesh_files, bool with_textures) {
  std::vector<imaging::TexturedMesh> meshes;
  const mesh_files::MeshSourceOptions options{.textures = with_textures, .defer_textures = true};
  for (const std::filesystem::path& file : mesh_files) {
    auto part = mesh_files::read_mesh_source(file, options).meshes;
    std::move(part.begin(), part.end(), std::back_inserter(meshes));
  }
  TexturedPlace place;
  place.textured = std::ranges::any_of(meshes, [](const auto& mesh) { return mesh.texture || !mesh.colors.empty(); });
  place.scene = std::make_unique<scene::Scene>(std::move(meshes));
  place.scene->build_ray_tree();
  return place;
}

}  // namespace tileflight::scoring
