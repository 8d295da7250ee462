#include "tileflight/slam/odometry/tracking_log.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/slam/mapping/normal_equations.h"
#include "tileflight/slam/odometry/stage_timer.h"

namespace tileflight::odometry {
namespace {

/// Neighbouring residuals have correlated errors (texture, sampling, point distances), so standard deviations from the
/// residuals' curvature are too small by these factors: medians over 45 flights of the proving ground
/// (tests/proving_ground) against their true poses.
constexpr double kPositionSigmaInflation = 2.2, kRotationSigmaInflation = 2.7;

/// A flight shorter than this has so few keyframes that the images between them are needed, too, to know its scale.
/// Chosen by hand.
constexpr double kShort_s = 8.0;

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
  set_pose_sigmas(tracking::pose_covariance(alignment), quality);
}

/// All keyframes in order of time, those made backwards first. A keyframe's position is its id + `first`.
struct KeyframePath {
  std::vector<mapping::KeyframeRecord> keyframes;
  std::vector<mapping::StepUncertainty> steps;  ///< of each: to the keyframe before, or, if made backwards, after it
  std::vector<double> log_scale_variance;       ///< of each: of log(scale here / scale at the first one)
  int first = 0;                                ///< position of the keyframe with id 0
  bool is_metric = false;                       ///< by static stereo
};

KeyframePath keyframe_path(const TrackingLog& log, const mapping::Mapper& mapper) {
  KeyframePath path{log.earlier.keyframes,
                    log.earlier.steps,
                    {},
                    static_cast<int>(log.earlier.keyframes.size()),
                    mapper.window().has_stereo()};
  const std::vector<mapping::KeyframeRecord> later = mapper.keyframes();
  for (mapping::KeyframeRecord& keyframe : path.keyframes)
    keyframe.T_map_camera = later.front().T_map_camera * keyframe.T_map_camera;
  path.keyframes.insert(path.keyframes.end(), later.begin(), later.end());
  path.steps.insert(path.steps.end(), mapper.step_uncertainties().begin(), mapper.step_uncertainties().end());
  const auto first = static_cast<std::size_t>(path.first);
  std::vector<double>& variance = path.log_scale_variance;
  variance.assign(path.steps.size(), 0.0);
  const auto grow = [&](std::size_t from, std::size_t to) {
    variance[to] = path.steps[to].log_scale + (path.steps[to].is_metric ? 0.0 : variance[from]);
  };
  for (std::size_t k = first + 1; k < variance.size(); ++k) grow(k - 1, k);
  for (std::size_t k = first; k-- > 0;) grow(k + 1, k);
  return path;
}

/// All points, those of the keyframes made backwards last.
std::vector<mapping::MapPoint> all_points(const TrackingLog& log, const mapping::Mapper& mapper) {
  std::vector<mapping::MapPoint> points = mapper.points();
  points.insert(points.end(), log.earlier.points.begin(), log.earlier.points.end());
  return points;
}

/// The keyframe to which the one at `position` was tracked; -1: none.
int reference_of_keyframe(const KeyframePath& path, int position) {
  if (position == path.first) return -1;
  return position > path.first ? position - 1 : position + 1;
}

FrameQuality tracked_quality(const TrackedFrame& frame, const KeyframePath& path) {
  FrameQuality q{.frame = frame.index, .time_s = frame.time_s, .tracked = true};
  const int position = frame.keyframe + path.first;
  q.is_keyframe = path.keyframes[position].frame_index == frame.index;
  q.keyframe = q.is_keyframe ? reference_of_keyframe(path, position) : position;
  fill_quality(frame.alignment, q);
  q.sigma_log_scale = kPositionSigmaInflation * std::sqrt(path.log_scale_variance[position]);
  geometry::SE3 T_camera_keyframe = frame.T_camera_keyframe;
  if (q.is_keyframe && q.keyframe >= 0) {
    T_camera_keyframe = path.keyframes[position].T_map_camera.inverse() * path.keyframes[q.keyframe].T_map_camera;
    set_pose_sigmas(path.steps[position].pose, q);
  }
  q.known_points = path.steps[position].known_points;
  q.distance_to_keyframe = T_camera_keyframe.translation.norm();
  return q;
}

/// The map's keyframes and points, corrected for loops.
struct CorrectedMap {
  std::vector<mapping::KeyframeRecord> keyframes;
  std::vector<mapping::MapPoint> points;
  std::map<int, double> scale;  ///< of each keyframe, by id; empty without loops
};

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

/// Inflates a covariance in the way of the standard deviations in FrameQuality.
Eigen::Matrix<double, 6, 6> inflated(const Eigen::Matrix<double, 6, 6>& covariance) {
  Eigen::Matrix<double, 6, 1> inflation;
  inflation << Eigen::Vector3d::Constant(kPositionSigmaInflation), Eigen::Vector3d::Constant(kRotationSigmaInflation);
  return inflation.asDiagonal() * covariance * inflation.asDiagonal();
}

/// The keyframes with the poses that the steps lead to, as they were when both ends were last in the window; the last
/// pose is kept. A keyframe that stays long in the window is seen at its end by few points, from far away: the least
/// error of the lens moves it against its neighbours by many times what the step's covariance says.
std::vector<mapping::KeyframeRecord> keyframes_by_steps(const KeyframePath& path) {
  std::vector<mapping::KeyframeRecord> keyframes = path.keyframes;
  for (std::size_t k = keyframes.size(); k-- > 1;) {
    const bool is_backwards = k <= static_cast<std::size_t>(path.first);
    const geometry::SE3 T_this_before =
        is_backwards ? path.steps[k - 1].T_before_keyframe : path.steps[k].T_before_keyframe.inverse();
    keyframes[k - 1].T_map_camera = keyframes[k].T_map_camera * T_this_before;
  }
  return keyframes;
}

/// Keyframes as the inertial alignment takes them: with the covariances of the window, inflated as for FrameQuality.
/// `keyframes`: those of the path, corrected.
std::vector<inertial::VisualKeyframe> visual_keyframes(const KeyframePath& path,
                                                       const std::vector<mapping::KeyframeRecord>& keyframes) {
  std::vector<inertial::VisualKeyframe> list;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    // A left twist of T_camera_before is, but for its sign, a right twist of its inverse. A step made backwards has a
    // left twist of that inverse, which the adjoint takes to its other side.
    const bool is_backwards = k > 0 && k <= static_cast<std::size_t>(path.first);
    const mapping::StepUncertainty& step = path.steps[is_backwards ? k - 1 : k];
    Eigen::Matrix<double, 6, 6> covariance = step.pose;
    if (is_backwards) {
      const Eigen::Matrix<double, 6, 6> other_side =
          mapping::adjoint(keyframes[k].T_map_camera.inverse() * keyframes[k - 1].T_map_camera);
      covariance = other_side * covariance * other_side.transpose();
    }
    list.push_back({keyframes[k].time_s, keyframes[k].T_map_camera, inflated(covariance),
                    kPositionSigmaInflation * kPositionSigmaInflation * step.log_scale, path.is_metric});
  }
  return list;
}

/// The keyframes as loop closure takes them.
std::vector<loop_closure::LoopKeyframe> loop_keyframes(const TrackingLog& log, const KeyframePath& path) {
  std::vector<loop_closure::LoopKeyframe> keyframes = log.loop_keyframes;
  const std::vector<inertial::VisualKeyframe> steps = visual_keyframes(path, path.keyframes);
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    keyframes[k].T_map_camera = steps[k].T_map_camera;
    keyframes[k].step_covariance = steps[k].step_covariance;
    keyframes[k].step_log_scale_variance = steps[k].step_log_scale_variance;
  }
  return keyframes;
}

/// Corrects keyframes and points for the loops found, which are added to the result.
void close_loops(const TrackingLog& log, const KeyframePath& path, const keyframes::LensPyramid& lens,
                 const keyframes::LoopOptions& options, CorrectedMap& map, OdometryResult& result) {
  const StageTimer clock(result.cpu_time.loops);
  std::vector<loop_closure::LoopKeyframe> seen = loop_keyframes(log, path);
  loop_closure::assign_feature_depths(lens.lenses[0], map.points, seen);
  const std::vector<loop_closure::MeasuredLoop> loops =
      loop_closure::measure_loops(lens, map.points, seen, loop_closure::find_loops(seen, options));
  for (const auto& [loop, measured] : loops) {
    result.loops.push_back(
        {seen[loop.from].frame_index, seen[loop.to].frame_index, std::exp(measured.log_scale), loop.inliers});
  }
  const std::optional<std::vector<geometry::Sim3>> poses = loop_closure::correct_poses(seen, loops);
  result.loops_closed = poses.has_value();
  if (!poses) return;
  for (std::size_t k = 0; k < poses->size(); ++k) {
    const geometry::Sim3& pose = poses->at(k);
    map.keyframes[k].T_map_camera = geometry::SE3(pose.rotation, pose.translation);
    map.scale[map.keyframes[k].id] = pose.scale;
  }
  loop_closure::rescale_points(map.scale, map.points);
}

/// The keyframes, and between them images, at least `spacing_s` apart: more instants for a flight with few keyframes.
/// The errors of images are taken to be independent of each other, which makes them count less than they might.
struct Nodes {
  std::vector<inertial::VisualKeyframe> list;
  std::vector<std::size_t> keyframes;  ///< positions of the keyframes in `list`
};

/// Median of the residuals' root mean squares over the images tracked.
double usual_rmse(const TrackingLog& log) {
  std::vector<double> list;
  for (const TrackedFrame& frame : log.tracked)
    if (!frame.alignment.rmse.empty()) list.push_back(frame.alignment.finest_rmse());
  return list.empty() ? 0.0 : base::median(list);
}

Nodes nodes_with_images(const TrackingLog& log, const KeyframePath& path,
                        const std::vector<inertial::VisualKeyframe>& keyframes, const std::map<int, double>& scale,
                        double spacing_s) {
  Nodes nodes;
  // An image that nearly coincides with its keyframe shares the errors of sampling with it, which hold its pose at
  // whole pixels (by 0.1 pixels, several of its sigmas) and make its residuals small. Chosen by hand.
  constexpr double kCoinciding = 0.8;
  Eigen::Matrix<double, 6, 6> of_last = Eigen::Matrix<double, 6, 6>::Zero();  // of the last node, if it is an image
  const auto append = [&](inertial::VisualKeyframe node) {
    if (!nodes.list.empty()) {  // its error as a right twist of the step, in the axes of this node
      const Eigen::Matrix<double, 6, 6> carried =
          mapping::adjoint(node.T_map_camera.inverse() * nodes.list.back().T_map_camera);
      node.step_covariance += carried * of_last * carried.transpose();
    }
    nodes.list.push_back(node);
  };
  const double least_rmse = kCoinciding * usual_rmse(log);
  auto frame = log.tracked.begin();
  const auto append_images = [&](double until_s) {  // the last one is the spacing before that
    for (; frame != log.tracked.end() && frame->time_s < until_s; ++frame) {
      if (nodes.list.empty() || frame->time_s - nodes.list.back().time_s < spacing_s ||
          until_s - frame->time_s < spacing_s || frame->alignment.rmse.empty() ||
          !(frame->alignment.finest_rmse() > least_rmse))
        continue;
      const auto host = static_cast<std::size_t>(frame->keyframe + path.first);
      geometry::SE3 T_keyframe_camera = frame->T_camera_keyframe.inverse();
      if (!scale.empty()) T_keyframe_camera.translation *= scale.at(frame->keyframe);
      const Eigen::Matrix<double, 6, 6> covariance = inflated(tracking::pose_covariance(frame->alignment));
      append({frame->time_s, keyframes[host].T_map_camera * T_keyframe_camera, covariance, 0.0, path.is_metric});
      of_last = covariance;
    }
  };
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    append_images(keyframes[k].time_s);
    nodes.keyframes.push_back(nodes.list.size());
    append(keyframes[k]);
    of_last.setZero();
  }
  append_images(HUGE_VAL);
  return nodes;
}

/// The entries of the nodes that are keyframes.
inertial::InertialAlignment at_keyframes(const Nodes& nodes, inertial::InertialAlignment found) {
  const auto keep = [&](auto& list) {
    auto kept = std::remove_reference_t<decltype(list)>();
    for (const std::size_t k : nodes.keyframes) kept.push_back(list[k]);
    list = std::move(kept);
  };
  keep(found.T_world_camera);
  keep(found.scale);
  keep(found.velocity_m_s);
  keep(found.bias);
  return found;
}

void rescale_qualities(const inertial::InertialAlignment& alignment, std::vector<FrameQuality>& quality) {
  for (FrameQuality& q : quality) {
    if (q.keyframe < 0) continue;
    q.sigma_position *= alignment.scale[static_cast<std::size_t>(q.keyframe)];
    q.distance_to_keyframe *= alignment.scale[static_cast<std::size_t>(q.keyframe)];
  }
}

/// Makes keyframes and points metric and level, if the readings show how.
void align_to_gravity(const TrackingLog& log, const KeyframePath& path, const inertial::InertialInput& readings,
                      CorrectedMap& map, OdometryResult& result) {
  // Closed loops are in the latest poses only.
  const std::vector<mapping::KeyframeRecord> poses = map.scale.empty() ? keyframes_by_steps(path) : map.keyframes;
  const geometry::Trajectory images = frame_trajectory(log.tracked, poses_by_id(poses), map.scale);
  const std::vector<inertial::VisualKeyframe> keyframes = visual_keyframes(path, poses);
  result.inertial = inertial::align_to_gravity(keyframes, images, readings);
  if (!result.inertial->metric && keyframes.back().time_s - keyframes.front().time_s < kShort_s) {
    constexpr double kSpacing_s = 0.3;  // chosen by hand
    const Nodes nodes = nodes_with_images(log, path, keyframes, map.scale, kSpacing_s);
    inertial::InertialAlignment more = inertial::align_to_gravity(nodes.list, images, readings);
    result.inertial = more.metric ? at_keyframes(nodes, std::move(more)) : std::move(more);
  }
  const inertial::InertialAlignment& found = *result.inertial;
  if (!found.metric) return;
  std::map<int, double> change;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    map.keyframes[k].T_map_camera = found.T_world_camera[k];
    change[map.keyframes[k].id] = found.scale[k];
  }
  for (const auto& [id, factor] : change) map.scale.try_emplace(id, 1.0).first->second *= factor;
  loop_closure::rescale_points(change, map.points);
  rescale_qualities(found, result.quality);
}

}  // namespace

std::int64_t frames_before(double time_s, const TrackingLog& log) {
  return std::ranges::count_if(log.read, [&](const FrameStamp& frame) { return frame.time_s < time_s; });
}

std::vector<FrameQuality> frame_qualities(const TrackingLog& log, const mapping::Mapper& mapper) {
  const KeyframePath path = keyframe_path(log, mapper);
  std::map<std::int64_t, const TrackedFrame*> tracked;
  for (const TrackedFrame& frame : log.tracked) tracked[frame.index] = &frame;
  std::vector<FrameQuality> qualities;
  for (const auto& [index, time_s] : log.read) {
    const auto found = tracked.find(index);
    qualities.push_back(found == tracked.end() ? FrameQuality{.frame = index, .time_s = time_s}
                                               : tracked_quality(*found->second, path));
  }
  return qualities;
}

FrameQuality last_frame_quality(const TrackingLog& log, const mapping::Mapper& mapper) {
  return tracked_quality(log.tracked.back(), keyframe_path(log, mapper));
}

geometry::Trajectory trajectory_so_far(const TrackingLog& log, const mapping::Mapper& mapper) {
  return frame_trajectory(log.tracked, poses_by_id(keyframe_path(log, mapper).keyframes), {});
}

geometry::Trajectory keyframes_so_far(const TrackingLog& log, const mapping::Mapper& mapper) {
  return keyframe_trajectory(keyframe_path(log, mapper).keyframes);
}

std::vector<inertial::VisualKeyframe> latest_keyframes_so_far(const TrackingLog& log, const mapping::Mapper& mapper,
                                                              std::size_t count) {
  const KeyframePath path = keyframe_path(log, mapper);
  std::vector<inertial::VisualKeyframe> keyframes = visual_keyframes(path, keyframes_by_steps(path));
  const std::size_t surplus = keyframes.size() > count ? keyframes.size() - count : 0;
  keyframes.erase(keyframes.begin(), keyframes.begin() + static_cast<std::ptrdiff_t>(surplus));
  return keyframes;
}

geometry::PointCloud map_so_far(const TrackingLog& log, const mapping::Mapper& mapper, const MapOptions& options) {
  return mapping::make_point_cloud(all_points(log, mapper), poses_by_id(keyframe_path(log, mapper).keyframes), options);
}

void set_path_and_map(const TrackingLog& log, const mapping::Mapper& mapper, const keyframes::LensPyramid& lens,
                      const OdometryOptions& options, const std::optional<inertial::InertialInput>& readings,
                      OdometryResult& result) {
  const KeyframePath path = keyframe_path(log, mapper);
  CorrectedMap map{path.keyframes, all_points(log, mapper), {}};
  if (options.loops.enabled) close_loops(log, path, lens, options.loops, map, result);
  if (readings) align_to_gravity(log, path, *readings, map, result);
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
