#include "tileflight/evaluation/scoring/register_flight.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
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
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/evaluation/localization/flight_localizer.h"
#include "tileflight/evaluation/localization/picture_localizer.h"
#include "tileflight/evaluation/registration/register_map.h"
#include "tileflight/evaluation/scoring/flight_evidence.h"
#include "tileflight/evaluation/scoring/warnings.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::scoring {

namespace fs = std::filesystem;
namespace {

using geometry::SE3;
using geometry::Sim3;

/// Localizes a flight's images in the textured place.
class PictureFinder {
 public:
  /// `scene` and `dataset` must outlive it. `path`: T_map_camera with the images' times.
  PictureFinder(const scene::Scene& scene, const dataset::Dataset& dataset, geometry::Trajectory path,
                localization::FlightImages flight)
      : dataset_(dataset),
        path_(std::move(path)),
        flight_(std::move(flight)),
        fine_(scene, dataset_.calibration.camera, {.narrow_window = kWideWindow}),
        coarse_(scene, fine_.appearance(), dataset_.calibration.camera,
                {.width = kCoarseWidth, .narrow_window = kWideWindow}),
        along_path_(scene, fine_.appearance(), dataset_.calibration.camera, {.width = kWidthAlongPath}) {
    geometry::Trajectory times;
    for (const dataset::Frame& frame : dataset_.frames) times.poses.push_back({frame.time_s, SE3()});
    constexpr double kSameTime_s = 1e-3;
    pairs_ = geometry::associate(path_, times, kSameTime_s);
  }

  /// Localizes `pictures` images, evenly chosen along the path, each starting from its pose by the transform. Those
  /// that are not found are tried again from where a neighbour in time was found, so that the drift or breaks of a path
  /// show. kFine: those tell how much the images resemble the place; their poses are those of ten times as many images,
  /// each from where its neighbour was found, fused with the path between them, as by `localize`.
  registration::LocatedPictures operator()(const Sim3& T_local_map, std::size_t pictures,
                                           registration::PictureDetail detail) const {
    if (detail == registration::PictureDetail::kCoarse) return locate_each(coarse_, T_local_map, pictures);
    registration::LocatedPictures each = locate_each(fine_, T_local_map, pictures);
    registration::LocatedPictures along = locate_along_path(T_local_map, kImagesEach * pictures);
    constexpr double kNearlyAsMany = 0.8;
    if (share_found(along) <= kNearlyAsMany * share_found(each)) return each;
    const double correlation = mean_correlation(each);
    for (registration::LocatedPicture& picture : along.found) picture.correlation = correlation;
    return along;
  }

  /// Appearance of the scene; shared because it holds a copy of all textures.
  std::shared_ptr<const render::Appearance> appearance() const { return fine_.appearance(); }

 private:
  static constexpr int kCoarseWidth = 400;  // pixels: sufficient to recognize the place, at a sixth of the cost
  static constexpr int kWidthAlongPath = 640;
  static constexpr double kWideWindow = localization::LocalizerOptions{}.wide_window;
  static constexpr std::size_t kImagesEach = 10;

  static double share_found(const registration::LocatedPictures& located) {
    return static_cast<double>(located.found.size()) / std::max<double>(1.0, static_cast<double>(located.tried));
  }
  static double mean_correlation(const registration::LocatedPictures& located) {
    double sum = 0.0;
    for (const registration::LocatedPicture& picture : located.found) sum += picture.correlation;
    return sum / std::max<double>(1.0, static_cast<double>(located.found.size()));
  }

  /// Indices into pairs_, evenly spread.
  std::vector<std::size_t> choose(std::size_t count) const {
    const std::size_t n = std::min(count, pairs_.size());
    std::vector<std::size_t> chosen;
    for (std::size_t k = 0; k < n; ++k) chosen.push_back((2 * k + 1) * pairs_.size() / (2 * n));
    return chosen;
  }
  const SE3& path_pose(std::size_t pair) const { return path_.poses[pairs_[pair].first].T_local_camera; }
  std::optional<imaging::RgbImage> image(std::size_t pair) const { return flight_.read(pairs_[pair].second); }

  registration::LocatedPictures locate_each(const localization::PictureLocalizer& localizer, const Sim3& T,
                                            std::size_t pictures) const {
    const std::vector<std::size_t> chosen = choose(pictures);
    const std::size_t n = chosen.size();
    std::vector<std::optional<registration::LocatedPicture>> found(n);
    const auto locate = [&](std::size_t k, const SE3& guess) {
      const std::optional<imaging::RgbImage> picture = image(chosen[k]);
      const auto located = picture ? localizer.locate(*picture, guess) : std::nullopt;
      if (!located) return;
      found[k] = registration::LocatedPicture{pairs_[chosen[k]].first,
                                              {path_pose(chosen[k]), located->T_local_camera, located->information},
                                              located->correlation};
    };
    for (std::size_t k = 0; k < n; ++k) locate(k, T * path_pose(chosen[k]));
    const auto from_neighbor = [&](std::size_t k, std::size_t neighbor) {
      if (found[k] || !found[neighbor]) return;
      SE3 motion = found[neighbor]->found.T_map_camera.inverse() * path_pose(chosen[k]);
      motion.translation *= T.scale;
      locate(k, found[neighbor]->found.T_local_camera * motion);
    };
    for (std::size_t k = 1; k < n; ++k) from_neighbor(k, k - 1);
    for (std::size_t k = n; k-- > 1;) from_neighbor(k - 1, k);
    registration::LocatedPictures result{.tried = n};
    for (const auto& picture : found)
      if (picture) result.found.push_back(*picture);
    return result;
  }

  registration::LocatedPictures locate_along_path(const Sim3& T, std::size_t images) const {
    const std::vector<std::size_t> chosen = choose(images);
    localization::FlightImages flight{.has_scale = flight_.has_scale};
    for (const std::size_t pair : chosen) flight.images.push_back(flight_.images[pairs_[pair].second]);
    flight.read = [&](std::size_t k) { return image(chosen[k]); };
    registration::LocatedPictures result{.tried = chosen.size(), .along_path = true};
    localization::LocatedFlight located;
    try {
      located = localization::locate_flight(along_path_, flight, T);
    } catch (const InputError&) {  // none was found
      return result;
    }
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const localization::LocatedImage& image = located.images[k];
      if (image.source != localization::PoseSource::kPlace) continue;
      result.found.push_back(
          {pairs_[chosen[k]].first,
           {path_pose(chosen[k]), image.pose.T_local_camera, image.pose.covariance.inverse(), image.parts},
           image.correlation});
    }
    return result;
  }

  const dataset::Dataset& dataset_;
  geometry::Trajectory path_;
  localization::FlightImages flight_;
  std::vector<std::pair<std::size_t, std::size_t>> pairs_;  ///< pose of the path, frame of the dataset
  localization::PictureLocalizer fine_, coarse_, along_path_;
};

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
    finder = std::make_unique<PictureFinder>(*place.scene, *dataset, evidence.path, flight_images(*dataset, map));
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
