#include "tileflight/scoring/align_target.h"

#include <nlohmann/json.hpp>

#include "tileflight/dataset/dataset.h"
#include "tileflight/geometry/cloud_files.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/ground_truth/ground_truth.h"
#include "tileflight/place/extract.h"
#include "tileflight/place/truth_region.h"
#include "tileflight/scoring/map_inputs.h"
#include "tileflight/survey/telemetry_positions.h"

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

}  // namespace

alignment::AlignmentTarget AlignTarget::to_alignment_target() const {
  return {.cloud = &cloud, .index = index ? &*index : nullptr, .mesh = index ? &mesh : nullptr};
}

AlignTarget read_align_target(const fs::path& path) {
  AlignTarget target;
  if (!fs::is_directory(path)) {
    target.cloud = geometry::read_cloud(path);
    return target;
  }
  target.folder = path;
  const nlohmann::json about = place::read_extract_json(path);
  ground_truth::GroundTruth truth = ground_truth::read_ground_truth(path);
  target.cloud = std::move(truth.voxel_centers);
  target.mesh = std::move(truth.mesh);
  if (!target.mesh.triangles.empty()) target.index.emplace(target.mesh);
  target.origin = place::origin_from_json(about);
  target.regions = {column(place::region_from_json(about).box)};
  return target;
}

std::vector<alignment::PositionFix> read_receiver_positions(const fs::path& gps_csv, const geometry::Geodetic& origin) {
  const std::vector<dataset::GpsFix> gps = dataset::read_gps_csv(gps_csv);
  const std::vector<geometry::Vec3> positions = survey::to_local_positions(gps, geometry::LocalFrame(origin));
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

}  // namespace tileflight::scoring
