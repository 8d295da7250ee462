#include "tileflight/evaluation/registration/start_refiner.h"

#include <algorithm>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/evaluation/registration/located_poses.h"
#include "tileflight/evaluation/registration/registration_warnings.h"

namespace tileflight::registration {

using geometry::Sim3;
using geometry::Vec3;

StartRefiner::StartRefiner(const ObservedPoints& points, const RegistrationEvidence& evidence,
                           const GroundTruthSurface& surface, const RegistrationServices& services,
                           const RegistrationOptions& options)
    : coarse_points_(subsample(points, options.coarse_points)),
      evidence_(evidence),
      surface_(surface),
      services_(services),
      options_(options) {}

SurfaceFitOptions StartRefiner::fit_options(const Start& start, std::vector<double> radii_m) const {
  SurfaceFitOptions fit;
  fit.radii_m = std::move(radii_m);
  fit.max_scale_change = options_.max_scale_change;
  fit.scale_center = start.T.scale;
  fit.scale = options_.scale;
  fit.regions = surface_.regions;
  fit.prior = start.known;
  return fit;
}

std::optional<RayAgreement> StartRefiner::rays(const Sim3& T) const {
  if (!services_.cast_ray) return std::nullopt;
  return compute_ray_agreement(coarse_points_, T, services_.cast_ray, {.regions = surface_.regions});
}

Candidate StartRefiner::refine(const Start& start) const {
  Candidate candidate{.start = start, .T = start.T};
  candidate.fit = fit_to_surface(coarse_points_, surface_.index, surface_.mesh, start.T,
                                 fit_options(start, options_.coarse_radii_m));
  candidate.T = candidate.fit.T_target_source;
  candidate.rays = rays(candidate.T);
  return candidate;
}

namespace {

std::vector<LocatedPose> extract_poses(const LocatedPictures& pictures) {
  std::vector<LocatedPose> poses;
  for (const LocatedPicture& picture : pictures.found) poses.push_back(picture.found);
  return poses;
}

std::vector<LocatedPose> select_poses(const std::vector<LocatedPose>& poses, const std::vector<bool>& selected) {
  std::vector<LocatedPose> some;
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (selected[i]) some.push_back(poses[i]);
  return some;
}

double rms_position_error_m(const std::vector<LocatedPose>& poses, const Sim3& T, const std::vector<bool>& counted) {
  double sum = 0.0, n = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!counted[i]) continue;
    sum += (T * poses[i].T_map_camera.translation - poses[i].T_local_camera.translation).squaredNorm();
    n += 1.0;
  }
  return n > 0.0 ? std::sqrt(sum / n) : 0.0;
}

PictureAgreement picture_agreement(const LocatedPictures& pictures, const std::vector<bool>& agrees, const Sim3& T,
                                   const geometry::Trajectory& path) {
  const std::vector<LocatedPose> poses = extract_poses(pictures);
  PictureAgreement agreement{.tried = pictures.tried, .located = poses.size()};
  std::vector<Vec3> in_map, found;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    in_map.push_back(poses[i].T_map_camera.translation);
    found.push_back(poses[i].T_local_camera.translation);
    const double apart_m = (T * in_map.back() - found.back()).norm();
    if (apart_m > agreement.worst_m) {
      agreement.worst_m = apart_m;
      agreement.worst_time_s = path.poses[pictures.found[i].pose].time_s;
    }
    if (i > 0) agreement.path_length_m += (found[i] - found[i - 1]).norm();
    if (!agrees[i]) continue;
    ++agreement.inliers;
    agreement.correlation += pictures.found[i].correlation;
  }
  if (agreement.inliers > 0) agreement.correlation /= static_cast<double>(agreement.inliers);
  agreement.inlier_rms_m = rms_position_error_m(poses, T, agrees);
  if (poses.size() >= 3) {
    const Sim3 of_all = alignment::umeyama(in_map, found).T_target_source;
    agreement.path_error_m = rms_position_error_m(poses, of_all, std::vector<bool>(poses.size(), true));
  }
  return agreement;
}

/// Consecutive outliers that lie near the path are unlikely to be independent localization errors: the path itself is
/// slightly bent there, and the transform must fit all of it, so they become inliers again. Single outliers and more
/// distant ones stay out; the latter are reported as a warning about the path.
std::vector<bool> readmit_bent_segments(const std::vector<LocatedPose>& poses, const LocatedPosesFit& fit) {
  double path_m = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i)
    path_m += (poses[i].T_local_camera.translation - poses[i - 1].T_local_camera.translation).norm();
  const double near_m = std::max(kMinSegmentError_m, kSegmentErrorShare * path_m);
  const auto bends = [&](std::size_t i) { return !fit.is_inlier[i] && fit.distances_m[i] < near_m; };
  std::vector<bool> used = fit.is_inlier;
  for (std::size_t i = 0; i < used.size(); ++i) {
    const bool beside = (i > 0 && bends(i - 1)) || (i + 1 < used.size() && bends(i + 1));
    if (bends(i) && beside) used[i] = true;
  }
  return used;
}

}  // namespace

std::optional<PictureAgreement> StartRefiner::check_pictures(Sim3& T, std::size_t pictures,
                                                             PictureDetail detail) const {
  if (!services_.locate_pictures) return std::nullopt;
  constexpr int kRounds = 2;  // the first round improves the initial poses of the second
  std::optional<PictureAgreement> agreement;
  for (int round = 0; round < kRounds; ++round) {
    const LocatedPictures located = services_.locate_pictures(T, pictures, detail);
    const std::vector<LocatedPose> poses = extract_poses(located);
    constexpr std::size_t kFewest = 3;
    if (poses.size() < kFewest) return PictureAgreement{.tried = located.tried, .located = poses.size()};
    const LocatedPosesFit fit = fit_located_poses(poses, T);
    if (fit.inliers < kFewest) return picture_agreement(located, fit.is_inlier, T, evidence_.path);
    const std::vector<bool> used = detail == PictureDetail::kFine ? readmit_bent_segments(poses, fit) : fit.is_inlier;
    const std::vector<LocatedPose> inliers = select_poses(poses, used);
    const Sim3 carried = similarity_of(inliers);
    agreement = picture_agreement(located, fit.is_inlier, carried, evidence_.path);
    T = carried;
    agreement->along_path = located.along_path;
    agreement->estimate =
        estimate_similarity(inliers, alignment::compute_spread(coarse_points_.positions),
                            10 * inliers.size() >= 9 * located.tried ? PathCoverage::kWhole : PathCoverage::kParts);
    if (agreement->located == agreement->tried || located.along_path) break;
  }
  return agreement;
}

double StartRefiner::viewing_distance_m(const Sim3& T) const {
  if (!coarse_points_.has_viewpoints()) return 0.0;
  std::vector<double> distances;
  for (std::size_t i = 0; i < coarse_points_.size(); ++i)
    distances.push_back((coarse_points_.positions[i] - coarse_points_.viewpoints[i]).norm());
  const auto half = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), half, distances.end());
  return T.scale * *half;
}

}  // namespace tileflight::registration
