#include "tileflight/experiment/register_flight.h"

#include <algorithm>
#include <memory>
#include <numbers>

#include "tileflight/alignment/align_globally.h"
#include "tileflight/alignment/coarse_alignment.h"
#include "tileflight/alignment/global_registration.h"
#include "tileflight/alignment/gravity.h"
#include "tileflight/alignment/register_map.h"
#include "tileflight/alignment/transform_file.h"
#include "tileflight/dataset/attitude_csv.h"
#include "tileflight/evaluation/doubts_json.h"
#include "tileflight/experiment/doubts.h"
#include "tileflight/experiment/find_pictures.h"
#include "tileflight/experiment/recognize_place.h"
#include "tileflight/experiment/up_direction.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/scene/scene.h"
#include "tileflight/tiling/mesh_source.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using alignment::AlignmentStart;
using nlohmann::json;

/// Whether a surface has colours to compare pictures with.
bool is_textured(const std::vector<imaging::TexturedMesh>& meshes) {
  return std::ranges::any_of(meshes, [](const auto& mesh) { return mesh.texture || !mesh.colors.empty(); });
}

/// The truth as a scene: rays, and the look of it.
struct Place {
  std::unique_ptr<scene::Scene> scene;
  bool textured = false;

  explicit Place(const AlignTarget& target) {
    auto meshes = tiling::read_mesh_source(target.folder / "mesh.glb", {}).meshes;
    textured = is_textured(meshes);
    scene = std::make_unique<scene::Scene>(std::move(meshes));
    scene->prepare_rays();
  }
};

alignment::ObservedPoints points_of(const MapInputs& map, const geometry::PointCloud& cloud) {
  geometry::Trajectory keyframes;
  const fs::path file = map.map / "keyframes.txt";
  if (fs::is_directory(map.map) && fs::exists(file)) keyframes = geometry::read_tum(file);
  return alignment::observed_points(cloud, keyframes);
}

std::vector<alignment::AttitudeFix> attitudes_of(const fs::path& attitude_csv) {
  constexpr double kRadiansOfDegree = std::numbers::pi / 180.0;
  std::vector<alignment::AttitudeFix> fixes;
  for (const dataset::CameraAttitude& a : dataset::read_attitude_csv(attitude_csv))
    fixes.push_back(
        {a.time_s, a.R_enu_camera, kRadiansOfDegree * a.tilt_sigma_deg, kRadiansOfDegree * a.yaw_sigma_deg});
  return fixes;
}

/// Which way is up in the map: as it was given, else by the flight's inertial unit where there is one.
std::optional<alignment::UpDirection> up_of(const std::optional<dataset::Dataset>& dataset,
                                            const geometry::Trajectory& path,
                                            const alignment::AlignMapOptions& options) {
  constexpr double kGivenSigma_rad = 0.05;
  if (options.map_up) return alignment::UpDirection{options.map_up->normalized(), kGivenSigma_rad, true};
  return dataset ? up_by_inertial_unit(*dataset, path) : std::nullopt;
}

alignment::RegistrationEvidence evidence_of(const MapInputs& map, const std::optional<dataset::Dataset>& dataset,
                                            const AlignTarget& target, const alignment::AlignMapOptions& options) {
  alignment::RegistrationEvidence evidence;
  if (!map.trajectory.empty()) evidence.path = geometry::read_tum(map.trajectory);
  if (options.start == AlignmentStart::kGiven) evidence.starts = {options.given_start};
  if (options.start == AlignmentStart::kAsItIs) evidence.starts = {geometry::Sim3()};
  if (options.start == AlignmentStart::kAuto && !map.gps.empty() && target.origin)
    evidence.positions = receiver_positions(map.gps, *target.origin);
  if (options.start == AlignmentStart::kAuto && !map.attitude.empty() && target.origin)
    evidence.attitudes = attitudes_of(map.attitude);
  if (options.start == AlignmentStart::kAuto || options.start == AlignmentStart::kGeometry)
    evidence.up = up_of(dataset, evidence.path, options);
  if (options.start == AlignmentStart::kTruePoses && !map.truth_trajectory.empty())
    evidence.positions = true_positions(map.truth_trajectory);
  if (options.start == AlignmentStart::kAuto && evidence.positions.empty()) evidence.starts = {geometry::Sim3()};
  return evidence;
}

/// Places that look like the ground that the pictures show.
std::vector<geometry::Sim3> places_by_looks(const scene::Scene& scene, const PictureFinder& finder,
                                            const dataset::Dataset& dataset,
                                            const alignment::RegistrationEvidence& evidence,
                                            const geometry::PointCloud& cloud) {
  const localization::PlaceRecognizer recognizer(scene, scene.bounds(), {}, finder.appearance());
  std::vector<geometry::Sim3> places;
  for (const auto& candidate : recognizer.find(flight_evidence(dataset, evidence.path, cloud, evidence.up)))
    places.push_back(candidate.T_local_map);
  return places;
}

/// Directions of the map that may be up, each to be tried; one that is no direction: nothing tells.
std::vector<std::optional<geometry::Vec3>> possible_ups(const alignment::RegistrationEvidence& evidence) {
  const std::optional<geometry::Vec3> carried = alignment::up_of_trajectory(evidence.path);
  if (!evidence.up) return {carried};
  if (evidence.up->given) return {evidence.up->up_map};
  return {evidence.up->up_map, carried};
}

/// Places where the shapes alone say that the map may belong.
std::vector<geometry::Sim3> places_by_shape(const geometry::PointCloud& cloud,
                                            const alignment::RegistrationEvidence& evidence, const AlignTarget& target,
                                            const alignment::AlignMapOptions& options) {
  constexpr std::size_t kSurfacePoints = 100000;
  const auto surface = alignment::even_surface_points(target.mesh, kSurfacePoints);
  std::vector<geometry::Sim3> places;
  for (const std::optional<geometry::Vec3>& up : possible_ups(evidence)) {
    alignment::GlobalOptions search;
    search.source_up = up;
    if (up) search.target_up = geometry::Vec3::UnitZ();
    if (options.icp.scale == alignment::ScaleMode::kFixed) search.least_scale = search.most_scale = 1.0;
    for (const auto& candidate : alignment::register_globally(cloud.positions, surface, search).candidates)
      places.push_back(candidate.T_target_source);
  }
  return places;
}

alignment::RayCast cast_into(const scene::Scene& scene) {
  return
      [&scene](const geometry::Vec3& origin, const geometry::Vec3& direction, double reach_m) -> std::optional<double> {
        const auto hit = scene.intersect({origin, direction}, reach_m);
        return hit ? std::optional(hit->distance_m) : std::nullopt;
      };
}

json to_json(const alignment::PictureAgreement& p) {
  return {{"tried", p.tried},
          {"located", p.located},
          {"agreeing", p.agreeing},
          {"correlation", p.correlation},
          {"residual", p.residual_m},
          {"path_error", p.path_error_m},
          {"path_length", p.path_m},
          {"worst", p.worst_m},
          {"worst_time", p.worst_time_s}};
}

json to_json(const alignment::RayAgreement& rays) {
  return {{"rays", rays.rays},
          {"score", rays.score},
          {"agreeing", rays.agreeing},
          {"blocked", rays.blocked},
          {"floating", rays.floating}};
}

json to_json(const alignment::Registration& r) {
  alignment::AlignmentResult result;
  result.T_target_source = r.T_local_map;
  result.rmse_m = r.surface.rmse_m;
  result.fitness = r.surface.fitness;
  result.correspondences = r.surface.matched;
  result.iterations = r.surface.iterations;
  result.converged = r.surface.converged;
  result.method = r.method;
  result.points = r.surface.points;
  result.constraint = r.surface.constraint;
  json object = alignment::to_json(result);
  object["uncertainty"] = {{"rms_motion_sigma", r.sigma_m}};
  object["start"] = r.start;
  object["starts_tried"] = r.starts_tried;
  object["moved_from_start"] = r.moved_from_start_m;
  object["rays"] = r.rays ? to_json(*r.rays) : json(nullptr);
  object["pictures"] = r.pictures ? to_json(*r.pictures) : json(nullptr);
  object["noise"] = r.surface.noise;
  object["agreeing"] = r.surface.agreeing;
  if (r.rival_apart_m) object["rival"] = {{"apart", *r.rival_apart_m}, {"score", r.rival_score}};
  return object;
}

}  // namespace

json register_flight(const MapInputs& map, const AlignTarget& target, const alignment::AlignMapOptions& options,
                     const Progress& progress) {
  const geometry::PointCloud cloud = read_map(map.map);
  const Place place(target);
  std::optional<dataset::Dataset> dataset;
  if (!map.dataset.empty() && !map.trajectory.empty()) dataset = dataset::read_dataset(map.dataset);
  const alignment::RegistrationEvidence evidence = evidence_of(map, dataset, target, options);
  alignment::RegistrationServices services;
  services.cast = cast_into(*place.scene);
  std::unique_ptr<PictureFinder> finder;
  if (place.textured && dataset && !evidence.path.empty()) {
    finder = std::make_unique<PictureFinder>(*place.scene, *dataset, evidence.path);
    services.locate = [&finder](const geometry::Sim3& T, std::size_t pictures, alignment::PictureDetail detail) {
      return (*finder)(T, pictures, detail);
    };
  }
  const bool may_look = options.start == AlignmentStart::kAuto || options.start == AlignmentStart::kGeometry;
  if (may_look && finder) {
    services.recognize_places = [&] { return places_by_looks(*place.scene, *finder, *dataset, evidence, cloud); };
  }
  if (may_look) services.look_for_places = [&] { return places_by_shape(cloud, evidence, target, options); };
  alignment::RegistrationOptions registration;
  registration.scale = options.icp.scale;
  registration.max_scale_change = options.icp.max_scale_change;
  registration.trajectory = options.trajectory;
  const alignment::Registration found = alignment::register_map(
      points_of(map, cloud), evidence, {*target.index, target.mesh, target.regions}, services, registration, progress);
  json result = to_json(found);
  Doubts doubts = doubts_of_odometry(map);
  append(doubts, found.doubts);
  result["doubts"] = evaluation::to_json(doubts);
  alignment::IcpOptions published = alignment::final_icp();
  published.scale = options.icp.scale;
  published.regions = options.icp.regions.empty() ? target.regions : options.icp.regions;
  published.scale_center = found.T_local_map.scale;
  result["published"] = alignment::to_json(alignment::align_step(alignment::thinned(cloud, options.most_points),
                                                                 found.T_local_map, target.view(), published));
  return result;
}

}  // namespace tileflight::experiment
