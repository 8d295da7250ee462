#include "tileflight/evaluation/scoring/register_flight.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>

#include "tileflight/core/alignment/align_globally.h"
#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/alignment/align_trajectory.h"
#include "tileflight/core/alignment/global_registration.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/evaluation/localization/picture_localizer.h"
#include "tileflight/evaluation/registration/register_map.h"
#include "tileflight/evaluation/scoring/flight_evidence.h"
#include "tileflight/evaluation/scoring/textured_place.h"
#include "tileflight/evaluation/scoring/warnings.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::scoring {

namespace fs = std::filesystem;
namespace {

/// Localizes a flight's images in the textured place.
class PictureFinder {
 public:
  /// `scene` must outlive it. `path`: T_map_camera with the images' times.
  PictureFinder(const scene::Scene& scene, dataset::Dataset dataset, geometry::Trajectory path);
  ~PictureFinder();
  PictureFinder(const PictureFinder&) = delete;
  PictureFinder& operator=(const PictureFinder&) = delete;

  /// Localizes `pictures` images, evenly chosen along the path, each starting from its pose by the transform. Those
  /// that are not found are tried again from where a neighbour in time was found, so that the drift or breaks of a path
  /// show.
  registration::LocatedPictures operator()(const geometry::Sim3& T_local_map, std::size_t pictures,
                                           registration::PictureDetail detail) const;

  /// Appearance of the scene; shared because it holds a copy of all textures.
  std::shared_ptr<const render::Appearance> appearance() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

using geometry::SE3;
using geometry::Sim3;

// The narrow window's errors are smaller, but the registration's warnings are calibrated on the wide one.
constexpr double kWideWindow = localization::LocalizerOptions{}.wide_window;
constexpr int kCoarseWidth = 400;  // pixels: sufficient to recognize the place, at a sixth of the cost

struct PictureFinder::Impl {
  dataset::Dataset dataset;
  geometry::Trajectory path;
  std::vector<std::pair<std::size_t, std::size_t>> pairs;  ///< pose of the path, frame of the dataset
  localization::PictureLocalizer fine, coarse;

  Impl(const scene::Scene& scene, dataset::Dataset d, geometry::Trajectory p)
      : dataset(std::move(d)),
        path(std::move(p)),
        fine(scene, dataset.calibration.camera, {.narrow_window = kWideWindow}),
        coarse(scene, fine.appearance(), dataset.calibration.camera,
               {.width = kCoarseWidth, .narrow_window = kWideWindow}) {
    geometry::Trajectory times;
    for (const dataset::Frame& frame : dataset.frames) times.poses.push_back({frame.time_s, SE3()});
    constexpr double kSameTime_s = 1e-3;
    pairs = geometry::associate(path, times, kSameTime_s);
  }

  std::optional<registration::LocatedPicture> locate(std::size_t pair, const SE3& guess,
                                                     registration::PictureDetail detail) const {
    const auto [pose, frame] = pairs[pair];
    const auto& localizer = detail == registration::PictureDetail::kFine ? fine : coarse;
    const auto found = localizer.locate(imaging::read_rgb(dataset.frames[frame].image), guess);
    if (!found) return std::nullopt;
    return registration::LocatedPicture{
        pose, {path.poses[pose].T_local_camera, found->T_local_camera, found->information}, found->correlation};
  }

  /// Predicts a pose from a localized neighbour and the path's own motion between them.
  SE3 predict_pose(const registration::LocatedPicture& neighbor, std::size_t pose, double scale) const {
    SE3 motion = neighbor.found.T_map_camera.inverse() * path.poses[pose].T_local_camera;
    motion.translation *= scale;
    return neighbor.found.T_local_camera * motion;
  }
};

PictureFinder::PictureFinder(const scene::Scene& scene, dataset::Dataset dataset, geometry::Trajectory path)
    : impl_(std::make_unique<Impl>(scene, std::move(dataset), std::move(path))) {}

PictureFinder::~PictureFinder() = default;

std::shared_ptr<const render::Appearance> PictureFinder::appearance() const { return impl_->fine.appearance(); }

registration::LocatedPictures PictureFinder::operator()(const Sim3& T, std::size_t pictures,
                                                        registration::PictureDetail detail) const {
  const Impl& my = *impl_;
  const std::size_t n = std::min(pictures, my.pairs.size());
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < n; ++k) chosen.push_back((2 * k + 1) * my.pairs.size() / (2 * n));
  std::vector<std::optional<registration::LocatedPicture>> found(n);
  for (std::size_t k = 0; k < n; ++k)
    found[k] = my.locate(chosen[k], T * my.path.poses[my.pairs[chosen[k]].first].T_local_camera, detail);
  const auto from_neighbor = [&](std::size_t k, std::size_t neighbor) {
    if (found[k] || !found[neighbor]) return;
    found[k] = my.locate(chosen[k], my.predict_pose(*found[neighbor], my.pairs[chosen[k]].first, T.scale), detail);
  };
  for (std::size_t k = 1; k < n; ++k) from_neighbor(k, k - 1);
  for (std::size_t k = n; k-- > 1;) from_neighbor(k - 1, k);
  registration::LocatedPictures result{.tried = n};
  for (const auto& picture : found)
    if (picture) result.found.push_back(*picture);
  return result;
}

using alignment::AlignmentStart;

registration::ObservedPoints read_observed_points(const MapInputs& map, const geometry::PointCloud& cloud) {
  geometry::Trajectory keyframes;
  const fs::path file = map.map / "keyframes.txt";
  if (fs::is_directory(map.map) && fs::exists(file)) keyframes = geometry::read_tum(file);
  return registration::make_observed_points(cloud, keyframes);
}

std::vector<registration::AttitudeFix> read_attitudes(const fs::path& attitude_csv) {
  constexpr double kRadiansOfDegree = std::numbers::pi / 180.0;
  std::vector<registration::AttitudeFix> fixes;
  for (const dataset::CameraAttitude& a : dataset::read_attitude_csv(attitude_csv))
    fixes.push_back(
        {a.time_s, a.R_enu_camera, kRadiansOfDegree * a.tilt_sigma_deg, kRadiansOfDegree * a.yaw_sigma_deg});
  return fixes;
}

/// The map's up direction: as given, else from the flight's IMU if there is one.
std::optional<registration::UpDirection> find_up_direction(const std::optional<dataset::Dataset>& dataset,
                                                           const geometry::Trajectory& path,
                                                           const alignment::AlignMapOptions& options) {
  constexpr double kGivenSigma_rad = 0.05;
  if (options.map_up) return registration::UpDirection{options.map_up->normalized(), kGivenSigma_rad, true};
  return dataset ? up_from_imu(*dataset, path) : std::nullopt;
}

registration::RegistrationEvidence gather_evidence(const MapInputs& map, const std::optional<dataset::Dataset>& dataset,
                                                   const AlignTarget& target,
                                                   const alignment::AlignMapOptions& options) {
  registration::RegistrationEvidence evidence;
  if (!map.trajectory.empty()) evidence.path = geometry::read_tum(map.trajectory);
  if (options.start == AlignmentStart::kGiven) evidence.starts = {options.given_start};
  if (options.start == AlignmentStart::kAsItIs) evidence.starts = {geometry::Sim3()};
  if (options.start == AlignmentStart::kAuto && !map.gps.empty() && target.origin)
    evidence.positions = read_receiver_positions(map.gps, *target.origin);
  if (options.start == AlignmentStart::kAuto && !map.attitude.empty() && target.origin)
    evidence.attitudes = read_attitudes(map.attitude);
  if (options.start == AlignmentStart::kAuto || options.start == AlignmentStart::kGeometry)
    evidence.up = find_up_direction(dataset, evidence.path, options);
  if (options.start == AlignmentStart::kTruePoses && !map.truth_trajectory.empty())
    evidence.positions = read_true_positions(map.truth_trajectory);
  if (options.start == AlignmentStart::kAuto && evidence.positions.empty()) evidence.starts = {geometry::Sim3()};
  return evidence;
}

/// The placement without its change of scale, about the map's middle.
geometry::Sim3 with_unit_scale(const geometry::Sim3& T, const geometry::PointCloud& cloud) {
  geometry::Vec3 middle = geometry::Vec3::Zero();
  for (const geometry::Vec3& p : cloud.positions) middle += p / static_cast<double>(cloud.size());
  return {1.0, T.rotation, T * middle - T.rotation * middle};
}

/// Candidate poses whose ground looks like that in the images.
std::vector<geometry::Sim3> candidates_by_appearance(const scene::Scene& scene, const PictureFinder& finder,
                                                     const dataset::Dataset& dataset,
                                                     const registration::RegistrationEvidence& evidence,
                                                     const geometry::PointCloud& cloud, alignment::ScaleMode scale) {
  const localization::PlaceRecognizer recognizer(scene, scene.bounds(), {}, finder.appearance());
  std::vector<geometry::Sim3> places;
  for (const auto& candidate : recognizer.find(make_flight_evidence(dataset, evidence.path, cloud, evidence.up)))
    places.push_back(scale == alignment::ScaleMode::kFixed ? with_unit_scale(candidate.T_local_map, cloud)
                                                           : candidate.T_local_map);
  return places;
}

/// Candidate up directions of the map, each to be tried; nullopt: unknown.
std::vector<std::optional<geometry::Vec3>> up_candidates(const registration::RegistrationEvidence& evidence) {
  const std::optional<geometry::Vec3> carried = alignment::estimate_up_from_trajectory(evidence.path);
  if (!evidence.up) return {carried};
  if (evidence.up->given) return {evidence.up->up_map};
  return {evidence.up->up_map, carried};
}

/// Candidate poses from the shapes alone.
std::vector<geometry::Sim3> candidates_by_geometry(const geometry::PointCloud& cloud,
                                                   const registration::RegistrationEvidence& evidence,
                                                   const AlignTarget& target,
                                                   const alignment::AlignMapOptions& options) {
  constexpr std::size_t kSurfacePoints = 100000;
  const auto surface = alignment::sample_surface_evenly(target.mesh, kSurfacePoints);
  std::vector<geometry::Sim3> places;
  for (const std::optional<geometry::Vec3>& up : up_candidates(evidence)) {
    alignment::GlobalRegistrationOptions search;
    search.source_up = up;
    if (up) search.target_up = geometry::Vec3::UnitZ();
    if (options.icp.scale == alignment::ScaleMode::kFixed) search.min_scale = search.max_scale = 1.0;
    for (const auto& candidate : alignment::register_globally(cloud.positions, surface, search).candidates)
      places.push_back(candidate.T_target_source);
  }
  return places;
}

registration::RayCast make_ray_cast(const scene::Scene& scene) {
  return
      [&scene](const geometry::Vec3& origin, const geometry::Vec3& direction, double reach_m) -> std::optional<double> {
        const auto hit = scene.intersect({origin, direction}, reach_m);
        return hit ? std::optional(hit->distance_m) : std::nullopt;
      };
}

}  // namespace

RegisteredFlight register_flight(const MapInputs& map, const AlignTarget& target,
                                 const alignment::AlignMapOptions& options, const Progress& progress) {
  const geometry::PointCloud cloud = read_map(map.map);
  std::optional<dataset::Dataset> dataset;
  if (!map.dataset.empty() && !map.trajectory.empty()) dataset = dataset::read_dataset(map.dataset);
  const registration::RegistrationEvidence evidence = gather_evidence(map, dataset, target, options);
  const bool has_images = dataset && !evidence.path.empty();
  const TexturedPlace place = read_textured_place(target.mesh_files, has_images);
  registration::RegistrationServices services;
  services.cast_ray = make_ray_cast(*place.scene);
  std::unique_ptr<PictureFinder> finder;
  if (place.textured && has_images) {
    finder = std::make_unique<PictureFinder>(*place.scene, *dataset, evidence.path);
    services.locate_pictures = [&finder](const geometry::Sim3& T, std::size_t pictures,
                                         registration::PictureDetail detail) { return (*finder)(T, pictures, detail); };
  }
  const bool may_look = options.start == AlignmentStart::kAuto || options.start == AlignmentStart::kGeometry;
  if (may_look && finder) {
    services.find_places_by_appearance = [&] {
      return candidates_by_appearance(*place.scene, *finder, *dataset, evidence, cloud, options.icp.scale);
    };
  }
  if (may_look)
    services.find_places_by_shape = [&] { return candidates_by_geometry(cloud, evidence, target, options); };
  registration::RegistrationOptions registration;
  registration.scale = options.icp.scale;
  registration.max_scale_change = options.icp.max_scale_change;
  registration.trajectory = options.trajectory;
  registration::RegistrationResult found =
      registration::register_map(read_observed_points(map, cloud), evidence,
                                 {*target.index, target.mesh, target.regions}, services, registration, progress);
  Warnings warnings = odometry_warnings(map);
  if (found.method == "pictures" && !warnings.empty()) answer_path_warnings(map, *found.pictures, warnings);
  append_distinct(warnings, found.warnings);
  found.warnings = std::move(warnings);
  alignment::IcpOptions published = alignment::final_icp_options();
  published.scale = options.icp.scale;
  published.regions = options.icp.regions.empty() ? target.regions : options.icp.regions;
  published.scale_center = found.T_local_map.scale;
  constexpr double kHopelessFitness = 0.1;  // of the map's points; without surface near them, ICP wanders
  constexpr int kFewIterations = 100;
  if (found.surface.fitness < kHopelessFitness) published.max_iterations = kFewIterations;
  alignment::IcpResult last_step = alignment::align_step(alignment::subsample(cloud, options.max_points),
                                                         found.T_local_map, target.to_alignment_target(), published);
  return {std::move(found), std::move(last_step)};
}

}  // namespace tileflight::scoring
