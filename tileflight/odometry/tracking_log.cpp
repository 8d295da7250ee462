#include "tileflight/odometry/tracking_log.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <map>

#include "tileflight/odometry/stage_timer.h"

namespace tileflight::odometry {
namespace {

/// Neighbouring residuals have correlated errors (texture, sampling, point distances), so standard deviations from the
/// residuals' curvature are too small by these factors: medians over 45 flights of the proving ground
/// (tests/proving_ground) against their true poses.
constexpr double kPositionSigmaInflation = 2.2, kRotationSigmaInflation = 2.7;

/// Sets the standard deviations of a pose from the covariance of its left twist.
void set_pose_sigmas(const Eigen::Matrix<double, 6, 6>& covariance, FrameQuality& quality) {
  quality.sigma_position = kPositionSigmaInflation * std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  quality.sigma_rotation_rad = kRotationSigmaInflation * std::sqrt(covariance.bottomRightCorner<3, 3>().trace());
}

/// Copies the alignment's statistics.
void fill_quality(const tracking::ImageAlignment& alignment, FrameQuality& quality) {
  if (alignment.rmse.empty()) return;
  quality.rmse = alignment.finest_rmse();
  quality.inside_share = alignment.inside_share;
  quality.saturated_share = alignment.saturated_share;
  const Eigen::Matrix<double, 8, 8> H = alignment.information;
  const photometry::Vec8 scale = (H.diagonal().array() + 1e-9).sqrt().inverse();
  Eigen::Matrix<double, 8, 8> A = scale.asDiagonal() * H * scale.asDiagonal();
  A.diagonal().array() += 1e-9;
  const Eigen::Matrix<double, 8, 8> covariance =
      scale.asDiagonal() * A.ldlt().solve(Eigen::Matrix<double, 8, 8>::Identity()) * scale.asDiagonal();
  set_pose_sigmas(quality.rmse * quality.rmse * covariance.topLeftCorner<6, 6>(), quality);
}

/// Variance of the logarithm of the scale at each keyframe, accumulated since the first one.
std::vector<double> log_scale_variances(const std::vector<mapping::StepUncertainty>& steps) {
  std::vector<double> variance(steps.size(), 0.0);
  for (std::size_t k = 1; k < steps.size(); ++k) variance[k] = variance[k - 1] + steps[k].log_scale;
  return variance;
}

/// What the quality of an image needs to know of the map.
struct QualityBasis {
  const std::vector<mapping::KeyframeRecord>& keyframes;  ///< by id
  const std::vector<mapping::StepUncertainty>& steps;
  const std::vector<double>& log_scale_variance;
};

FrameQuality tracked_quality(const TrackedFrame& frame, const QualityBasis& map) {
  FrameQuality q{.frame = frame.index, .time_s = frame.time_s, .tracked = true};
  q.is_keyframe = map.keyframes[frame.keyframe].frame_index == frame.index;
  q.keyframe = q.is_keyframe ? frame.keyframe - 1 : frame.keyframe;
  fill_quality(frame.alignment, q);
  q.sigma_log_scale = kPositionSigmaInflation * std::sqrt(map.log_scale_variance[frame.keyframe]);
  geometry::SE3 T_camera_keyframe = frame.T_camera_keyframe;
  if (q.is_keyframe && frame.keyframe > 0) {
    T_camera_keyframe = map.keyframes[frame.keyframe].T_map_camera.inverse() * map.keyframes[q.keyframe].T_map_camera;
    set_pose_sigmas(map.steps[frame.keyframe].pose, q);
  }
  q.known_points = map.steps[frame.keyframe].known_points;
  q.distance_to_keyframe = T_camera_keyframe.translation.norm();
  return q;
}

/// The map's keyframes and points, corrected for loops.
struct CorrectedMap {
  std::vector<mapping::KeyframeRecord> keyframes;
  std::vector<mapping::MapPoint> points;
  std::map<int, double> scale;  ///< of each keyframe, by id; empty without loops
};

/// Corrects keyframes and points for the loops found, which are added to the result.
void close_loops(const TrackingLog& log, const photometry::Lens& lens, const photometry::LoopOptions& options,
                 CorrectedMap& map, OdometryResult& result) {
  const StageTimer clock(result.cpu_time.loops);
  std::vector<loops::LoopKeyframe> seen = log.loop_keyframes;
  for (std::size_t k = 0; k < seen.size(); ++k) seen[k].T_map_camera = map.keyframes[k].T_map_camera;
  loops::assign_feature_depths(lens, map.points, seen);
  const std::vector<loops::Loop> loops = loops::find_loops(seen, options);
  if (loops.empty()) return;
  const std::vector<geometry::Sim3> poses = loops::correct_poses(seen, loops);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    map.keyframes[k].T_map_camera = geometry::SE3(poses[k].rotation, poses[k].translation);
    map.scale[map.keyframes[k].id] = poses[k].scale;
  }
  loops::rescale_points(map.scale, map.points);
  for (const loops::Loop& loop : loops) {
    result.loops.push_back(
        {seen[loop.from].frame_index, seen[loop.to].frame_index, loop.T_from_to.scale, loop.inliers});
  }
}

std::map<int, geometry::SE3> poses_by_id(const std::vector<mapping::KeyframeRecord>& keyframes) {
  std::map<int, geometry::SE3> poses;
  for (const mapping::KeyframeRecord& keyframe : keyframes) poses[keyframe.id] = keyframe.T_map_camera;
  return poses;
}

geometry::Trajectory keyframe_trajectory(const std::vector<mapping::KeyframeRecord>& keyframes) {
  geometry::Trajectory trajectory;
  for (const mapping::KeyframeRecord& keyframe : keyframes)
    trajectory.poses.push_back({keyframe.time_s, keyframe.T_map_camera});
  return trajectory;
}

/// `scale`: see CorrectedMap.
geometry::Trajectory frame_trajectory(const std::vector<TrackedFrame>& frames,
                                      const std::map<int, geometry::SE3>& T_map_keyframe,
                                      const std::map<int, double>& scale) {
  geometry::Trajectory trajectory;
  for (const TrackedFrame& frame : frames) {
    geometry::SE3 T_keyframe_camera = frame.T_camera_keyframe.inverse();
    if (!scale.empty()) T_keyframe_camera.translation *= scale.at(frame.keyframe);
    trajectory.poses.push_back({frame.time_s, T_map_keyframe.at(frame.keyframe) * T_keyframe_camera});
  }
  return trajectory;
}

/// Keyframes as the inertial alignment takes them: with the covariances of the window, inflated as for FrameQuality.
std::vector<inertial::VisualKeyframe> visual_keyframes(const std::vector<mapping::KeyframeRecord>& keyframes,
                                                       const std::vector<mapping::StepUncertainty>& steps) {
  Eigen::Matrix<double, 6, 1> inflation;
  inflation << Eigen::Vector3d::Constant(kPositionSigmaInflation), Eigen::Vector3d::Constant(kRotationSigmaInflation);
  std::vector<inertial::VisualKeyframe> list;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    // A left twist of T_camera_before is, but for its sign, a right twist of its inverse.
    list.push_back({keyframes[k].time_s, keyframes[k].T_map_camera,
                    inflation.asDiagonal() * steps[k].pose * inflation.asDiagonal(),
                    kPositionSigmaInflation * kPositionSigmaInflation * steps[k].log_scale});
  }
  return list;
}

void rescale_qualities(const inertial::InertialAlignment& alignment, std::vector<FrameQuality>& quality) {
  for (FrameQuality& q : quality) {
    if (q.keyframe < 0) continue;
    q.sigma_position *= alignment.scale[static_cast<std::size_t>(q.keyframe)];
    q.distance_to_keyframe *= alignment.scale[static_cast<std::size_t>(q.keyframe)];
  }
}

/// Makes keyframes and points metric and level, if the readings show how.
void align_to_gravity(const TrackingLog& log, const mapping::Mapper& mapper, const inertial::InertialInput& readings,
                      CorrectedMap& map, OdometryResult& result) {
  const geometry::Trajectory images = frame_trajectory(log.tracked, poses_by_id(map.keyframes), map.scale);
  result.inertial =
      inertial::align_to_gravity(visual_keyframes(map.keyframes, mapper.step_uncertainties()), images, readings);
  const inertial::InertialAlignment& found = *result.inertial;
  if (!found.metric) return;
  std::map<int, double> change;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    map.keyframes[k].T_map_camera = found.T_world_camera[k];
    change[map.keyframes[k].id] = found.scale[k];
  }
  for (const auto& [id, factor] : change) map.scale.try_emplace(id, 1.0).first->second *= factor;
  loops::rescale_points(change, map.points);
  rescale_qualities(found, result.quality);
}

}  // namespace

std::vector<FrameQuality> frame_qualities(const TrackingLog& log, const mapping::Mapper& mapper) {
  const std::vector<mapping::KeyframeRecord> keyframes = mapper.keyframes();
  const std::vector<double> log_scale_variance = log_scale_variances(mapper.step_uncertainties());
  const QualityBasis map{keyframes, mapper.step_uncertainties(), log_scale_variance};
  std::map<std::int64_t, const TrackedFrame*> tracked;
  for (const TrackedFrame& frame : log.tracked) tracked[frame.index] = &frame;
  std::vector<FrameQuality> qualities;
  for (const auto& [index, time_s] : log.read) {
    const auto found = tracked.find(index);
    qualities.push_back(found == tracked.end() ? FrameQuality{.frame = index, .time_s = time_s}
                                               : tracked_quality(*found->second, map));
  }
  return qualities;
}

FrameQuality last_frame_quality(const TrackingLog& log, const mapping::Mapper& mapper) {
  const std::vector<mapping::KeyframeRecord> keyframes = mapper.keyframes();
  const std::vector<double> log_scale_variance = log_scale_variances(mapper.step_uncertainties());
  return tracked_quality(log.tracked.back(), {keyframes, mapper.step_uncertainties(), log_scale_variance});
}

geometry::Trajectory trajectory_so_far(const TrackingLog& log, const mapping::Mapper& mapper) {
  return frame_trajectory(log.tracked, poses_by_id(mapper.keyframes()), {});
}

geometry::Trajectory keyframes_so_far(const mapping::Mapper& mapper) { return keyframe_trajectory(mapper.keyframes()); }

geometry::PointCloud map_so_far(const mapping::Mapper& mapper, const MapOptions& options) {
  return mapping::make_point_cloud(mapper.points(), poses_by_id(mapper.keyframes()), options);
}

void set_path_and_map(const TrackingLog& log, const mapping::Mapper& mapper, const photometry::Lens& lens,
                      const OdometryOptions& options, const std::optional<inertial::InertialInput>& readings,
                      OdometryResult& result) {
  CorrectedMap map{mapper.keyframes(), mapper.points(), {}};
  if (options.loops.enabled) close_loops(log, lens, options.loops, map, result);
  if (readings) align_to_gravity(log, mapper, *readings, map, result);
  const std::map<int, geometry::SE3> poses = poses_by_id(map.keyframes);
  std::vector<int> ids;
  for (const mapping::KeyframeRecord& keyframe : map.keyframes) {
    result.keyframe_frame_indices.push_back(keyframe.frame_index);
    ids.push_back(keyframe.id);
  }
  result.keyframes = keyframe_trajectory(map.keyframes);
  result.trajectory = frame_trajectory(log.tracked, poses, map.scale);
  result.map = mapping::make_point_cloud(map.points, poses, options.map);
  result.map_point_keyframes = mapping::make_point_tracks(map.points, ids, options.map);
}

}  // namespace tileflight::odometry
