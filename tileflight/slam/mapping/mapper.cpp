#include "tileflight/slam/mapping/mapper.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/keyframes/pixel_selector.h"
#include "tileflight/slam/mapping/activation.h"
#include "tileflight/slam/mapping/depth_bounds.h"
#include "tileflight/slam/mapping/normal_equations.h"
#include "tileflight/slam/mapping/residual_states.h"
#include "tileflight/slam/mapping/static_stereo.h"
#include "tileflight/slam/mapping/tracer.h"

namespace tileflight::mapping {

namespace {

/// Whether a search found an unambiguous depth that no later search rejected.
bool has_clear_depth(const keyframes::ImmaturePoint& point, const keyframes::TracingOptions& options) {
  return point.has_depth() && point.rho() > 0 && point.failed_searches == 0 && point.quality > options.min_quality;
}

/// Angle at the point between the host's centre and a target's.
float parallax_rad(const keyframes::ActivePoint& point, const geometry::SE3& T_host_target) {
  const Eigen::Vector3d at = point.patch.ray.cast<double>() / point.rho;
  const Eigen::Vector3d from_target = at - T_host_target.translation;
  return static_cast<float>(std::atan2(at.cross(from_target).norm(), at.dot(from_target)));
}

void fill_statistics(const keyframes::Window& window, int host, keyframes::ActivePoint& point) {
  const geometry::SE3 T_host_map = window.keyframes[host].T_camera_map();
  point.good_observations = static_cast<int>(point.observations.size());
  for (const keyframes::Observation& observation : point.observations) {
    const keyframes::Keyframe& target = window.keyframes[observation.target];
    point.first_frame = std::min(point.first_frame, target.frame_index);
    point.last_frame = std::max(point.last_frame, target.frame_index);
    point.parallax_rad =
        std::max(point.parallax_rad, parallax_rad(point, T_host_map * target.T_camera_map().inverse()));
  }
}

/// Refines the immature points of `host` that have a depth by Gauss-Newton on the inverse distance over all other
/// keyframes (as activation does), with poses and brightness fixed. Returns only points with at least
/// `options.map.min_observations` good residuals. The window is not changed, so trajectory and active points are not
/// affected.
std::vector<keyframes::ActivePoint> densify_keyframe(const keyframes::Window& window, const keyframes::Lens& lens,
                                                     int host, const keyframes::OdometryOptions& options) {
  const keyframes::Keyframe& keyframe = window.keyframes[host];
  std::vector<const keyframes::ImmaturePoint*> candidates;
  for (const auto* points : {&keyframe.out_of_view, &keyframe.immature}) {
    for (const keyframes::ImmaturePoint& point : *points) {
      if (has_clear_depth(point, options.tracing)) candidates.push_back(&point);
    }
  }
  const std::vector<keyframes::PairTransform> pairs = pair_transforms_from(window, host);
  std::vector<std::optional<keyframes::ActivePoint>> fitted(candidates.size());
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t i) {
    fitted[i] = try_activation(window, lens, host, pairs, *candidates[i], options.window, options.map.min_observations);
    if (fitted[i]) fill_statistics(window, host, *fitted[i]);
  });
  std::vector<keyframes::ActivePoint> points;
  for (std::optional<keyframes::ActivePoint>& point : fitted) {
    if (point) points.push_back(std::move(*point));
  }
  return points;
}

/// Prior information of the intrinsics, in units of the residuals' information. Neighbouring residuals have correlated
/// errors (lens model, sampling, brightness); kAlike residuals count as one (chosen by hand).
IntrinsicsInformation intrinsics_information(const keyframes::WindowOptions& options, double residual_variance) {
  constexpr double kAlike = 25.0;
  const auto of = [&](double deviation) { return kAlike * residual_variance / (deviation * deviation); };
  return {of(options.focal_sigma), of(options.aspect_sigma), of(options.principal_point_sigma)};
}

}  // namespace

Mapper::Mapper(keyframes::LensPyramid& lens, const keyframes::OdometryOptions& options,
               std::vector<keyframes::StereoCamera> stereo_cameras)
    : lens_(lens), options_(options), stereo_records_(stereo_cameras.size()) {
  window_.stereo_cameras = std::move(stereo_cameras);
}

Mapper::Mapper(const Mapper& other, keyframes::LensPyramid& lens)
    : lens_(lens),
      applied_delta_(other.applied_delta_),
      options_(other.options_),
      window_(other.window_),
      spacing_(other.spacing_),
      selection_block_px_(other.selection_block_px_),
      next_id_(other.next_id_),
      residual_variance_(other.residual_variance_),
      step_uncertainties_(other.step_uncertainties_),
      systematic_residuals_(other.systematic_residuals_),
      retired_points_(other.retired_points_),
      retired_keyframes_(other.retired_keyframes_),
      stereo_records_(other.stereo_records_) {}

WindowResult Mapper::initialize(std::vector<keyframes::Keyframe> keyframes) {
  constexpr int kRounds = 3;
  constexpr int kIterations = 8;
  if (options_.window.refine_intrinsics) {
    add_intrinsics_unknowns(window_, intrinsics_information(options_.window, residual_variance_));
  }
  for (keyframes::Keyframe& keyframe : keyframes) mapping::add_keyframe(window_, std::move(keyframe));
  spacing_.pixels = 0.5;
  activate_points(window_, lens_.lenses[0], options_, spacing_);
  WindowResult result;
  for (int i = 0; i < kRounds; ++i) {
    result = optimize_window(window_, lens_.lenses[0], options_.window, kIterations);
    for (int slot = 0; slot < window_.size(); ++slot) {
      update_energy_threshold(window_, slot);
      relinearize(window_, slot);
    }
    relinearize_intrinsics(window_);
  }
  update_lens();
  remove_bad_residuals(window_);
  update_noise(result);
  for (int slot = 0; slot < window_.size(); ++slot) add_step(slot);
  update_steps();
  return result;
}

bool Mapper::start(const KeyframeCandidate& source) {
  const std::vector<keyframes::StereoCamera> cameras = window_.stereo_cameras;
  mapping::add_keyframe(window_, make_keyframe(source));
  if (start_from_stereo(window_, lens_.lenses[0], options_) > 0) {
    add_step(0);
    return true;
  }
  window_ = {};
  window_.stereo_cameras = cameras;
  stereo_records_.assign(cameras.size(), {});
  selection_block_px_ = next_id_ = 0;
  return false;
}

keyframes::Keyframe Mapper::make_keyframe(const KeyframeCandidate& source) {
  keyframes::Keyframe keyframe;
  keyframe.id = next_id_++;
  keyframe.frame_index = source.frame_index;
  keyframe.time_s = source.time_s;
  keyframe.pyramid = source.pyramid;
  keyframe.T_camera_map_linear = source.T_camera_map;
  keyframe.brightness_linear = source.brightness;
  keyframe.brightness_prior = source.brightness_prior;
  keyframe.brightness_information = source.brightness_information;
  const keyframes::PyramidLevel& level = source.pyramid->levels[0];
  const keyframes::Lens lens_linear = lens_.lenses[0].apply_delta(window_.intrinsics.linear);
  for (const keyframes::SelectedPixel& pixel :
       keyframes::select_pixels(*source.pyramid, lens_.rays[0], options_.selection.points_per_keyframe,
                                options_.selection, selection_block_px_)) {
    auto patch = keyframes::make_patch(level, lens_.lenses[0], Eigen::Vector2f(pixel.x, pixel.y),
                                       options_.window.gradient_weight);
    if (!patch) continue;
    keyframes::ImmaturePoint point;
    point.patch = *patch;
    if (window_.intrinsics.estimated) {
      const auto ray = lens_linear.unproject(geometry::Vec2(pixel.x, pixel.y));
      if (!ray) continue;
      point.patch.ray_linear = ray->cast<float>();
    }
    point.scale = pixel.scale;
    if (source.image != nullptr) point.color = (*source.image)(pixel.x, pixel.y);
    keyframe.immature.push_back(point);
  }
  bound_by_neighbours(source.known, keyframe.immature);
  if (window_.has_stereo()) trace_stereo_pictures(source, keyframe);
  return keyframe;
}

/// Gives the keyframe its stereo pictures, with the brightness of the keyframe before, and traces its points in them.
void Mapper::trace_stereo_pictures(const KeyframeCandidate& source, keyframes::Keyframe& keyframe) {
  keyframe.stereo = source.stereo;
  keyframe.stereo.resize(window_.stereo_cameras.size());
  if (!window_.keyframes.empty()) {
    const keyframes::Keyframe& before = window_.keyframes.back();
    for (std::size_t c = 0; c < keyframe.stereo.size(); ++c)
      keyframe.stereo[c].brightness_linear = before.stereo_brightness(static_cast<int>(c));
  }
  const std::vector<keyframes::StereoPicture> given = keyframe.stereo;
  const std::vector<StereoMatches> matches = trace_stereo(window_, lens_.lenses[0], options_, keyframe);
  for (std::size_t c = 0; c < matches.size(); ++c) {
    StereoRecord& record = stereo_records_[c];
    record.keyframes += given[c].pyramid != nullptr;
    record.unmatched += given[c].pyramid != nullptr && keyframe.stereo[c].pyramid == nullptr;
    record.searched += matches[c].searched;
    record.found += matches[c].found;
  }
}

void Mapper::trace(const keyframes::Pyramid& picture, const geometry::SE3& T_camera_map,
                   const keyframes::AffineBrightness& light) {
  for (keyframes::Keyframe& keyframe : window_.keyframes) {
    const keyframes::PairTransform pair =
        keyframes::pair_transform(T_camera_map * keyframe.T_camera_map().inverse(), keyframe.brightness(), light);
    trace_points(lens_.lenses[0], picture.levels[0], pair, options_.tracing, options_.window.huber, keyframe.immature);
  }
}

WindowResult Mapper::add_keyframe(const KeyframeCandidate& source) {
  trace(*source.pyramid, source.T_camera_map, source.brightness);
  mapping::add_keyframe(window_, make_keyframe(source));
  take_readings(source);
  flag_for_marginalization(window_, lens_.lenses[0], options_.window);
  observe_in_newest();
  activate_points(window_, lens_.lenses[0], options_, spacing_);
  const WindowResult result = optimize_window(window_, lens_.lenses[0], options_.window, options_.window.iterations,
                                              inertial_ ? &*inertial_ : nullptr);
  relinearize_newest();
  systematic_residuals_.add(window_, window_.size() - 1, lens_.lenses[0]);
  update_lens();
  remove_bad_residuals(window_);
  update_noise(result);
  add_step(window_.size() - 1);
  update_steps();
  retire_keyframes();
  return result;
}

void Mapper::couple(const InertialStart& start, const InertialCalibration& calibration) {
  // The readings are used again by the smoothing over all keyframes, which takes the window's steps for the images'
  // alone: here they count half. With ten times as much the scale of example flights is known half as well.
  constexpr double kShare = 0.5;
  inertial_.emplace(window_, start, calibration, kShare * residual_variance_);
}

void Mapper::take_readings(const KeyframeCandidate& source) {
  if (!inertial_) return;
  if (source.readings) {
    inertial_->add_keyframe(window_, *source.readings);
  } else {
    uncouple();
  }
}

void Mapper::add_step(int slot) {
  step_uncertainties_.push_back(step_uncertainty(window_, slot, residual_variance_));
  if (slot > 0) step_uncertainties_.back().before = window_.keyframes[slot - 1].id;
}

/// Steps between keyframes that are in the window have its latest poses.
void Mapper::update_steps() {
  for (int slot = 1; slot < window_.size(); ++slot) {
    const keyframes::Keyframe &before = window_.keyframes[slot - 1], &keyframe = window_.keyframes[slot];
    StepUncertainty& step = step_uncertainties_[static_cast<std::size_t>(keyframe.id)];
    if (step.before == before.id) step.T_before_keyframe = before.T_camera_map() * keyframe.T_camera_map().inverse();
  }
}

void Mapper::relinearize_newest() {
  const int newest = window_.size() - 1;
  const Eigen::VectorXd before = stacked_delta(window_);
  relinearize(window_, newest);
  if (inertial_) inertial_->relinearize_newest(before - stacked_delta(window_));
}

void Mapper::observe_in_newest() {
  const int newest = window_.size() - 1;
  for (int h = 0; h < newest; ++h) {
    for (keyframes::ActivePoint& point : window_.keyframes[h].points) {
      keyframes::Observation observation;
      observation.target = newest;
      point.observations.push_back(observation);
    }
  }
}

/// Updates everything derived from the lens, if the last optimisation moved any pixel by more than kNothing_px.
void Mapper::update_lens() {
  constexpr double kNothing_px = 0.01;
  const keyframes::IntrinsicsDelta delta = window_.intrinsics.value();
  if (!window_.intrinsics.estimated ||
      (delta - applied_delta_).cwiseAbs().maxCoeff() * lens_.lenses[0].focal_px() < kNothing_px) {
    return;
  }
  applied_delta_ = delta;
  keyframes::set_intrinsics_delta(lens_, delta);
  for (keyframes::Keyframe& keyframe : window_.keyframes) {
    for (auto* points : {&keyframe.immature, &keyframe.out_of_view}) {
      tbb::parallel_for(std::size_t{0}, points->size(),
                        [&](std::size_t i) { keyframes::update_ray(lens_.lenses[0], (*points)[i].patch); });
    }
  }
}

void Mapper::retire_keyframes() {
  std::vector<RetiredPoint> left;
  const Eigen::MatrixXd H_before = window_.H_prior;
  const Eigen::VectorXd b_before = window_.b_prior;
  retire_points(window_, options_.window, left);
  if (inertial_) inertial_->add_to_prior(window_.H_prior - H_before, window_.b_prior - b_before);
  for (const RetiredPoint& point : left) {
    if (point.point.good_observations > 0) retired_points_.push_back(window_point(point.point, point.host));
  }
  for (int slot = window_.size() - 1; slot >= 0; --slot) {
    const keyframes::Keyframe& keyframe = window_.keyframes[slot];
    if (!keyframe.to_marginalize) continue;
    archive_dense_points(slot);
    retired_keyframes_.push_back(
        {keyframe.id, keyframe.frame_index, keyframe.time_s, keyframe.T_camera_map().inverse()});
    if (inertial_) inertial_->remove_keyframe(window_, slot);
    remove_keyframe(window_, slot);
  }
}

MapPoint Mapper::window_point(const keyframes::ActivePoint& point, int host) const {
  MapPoint out = make_map_point(point, window_.keyframes[host].id, residual_variance_);
  out.observing_keyframes = find_observing_keyframes(point, window_);
  return out;
}

void Mapper::archive_dense_points(int host) {
  if (!options_.map.dense) return;
  for (const keyframes::ActivePoint& point : densify_keyframe(window_, lens_.lenses[0], host, options_)) {
    const MapPoint out = window_point(point, host);
    if (passes_filters(out, options_.map)) retired_points_.push_back(out);
  }
}

void Mapper::update_noise(const WindowResult& result) {
  if (result.good_residuals > 0) residual_variance_ = std::max(0.25, result.rmse * result.rmse);
}

Eigen::Matrix4d Mapper::given_intrinsics_information() const {
  keyframes::Window empty;
  add_intrinsics_unknowns(empty, intrinsics_information(options_.window, residual_variance_));
  return empty.H_prior;
}

std::vector<tracking::ReferencePoint> Mapper::reference_points(int slot) const {
  std::vector<tracking::ReferencePoint> seen;
  const std::vector<HostTargetPair> pairs = make_host_target_pairs(window_);
  const keyframes::Lens& lens = lens_.lenses[0];
  for (int h = 0; h < window_.size(); ++h) {
    for (const keyframes::ActivePoint& point : window_.keyframes[h].points) {
      if (h == slot) {
        seen.push_back({point.patch.pixel, point.rho, std::sqrt(point.information)});
        continue;
      }
      const bool good =
          std::any_of(point.observations.begin(), point.observations.end(), [slot](const keyframes::Observation& o) {
            return o.target == slot && o.state == keyframes::ResidualState::kGood;
          });
      if (!good) continue;
      const keyframes::PairTransform& T = pairs[h * window_.size() + slot].frame.current;
      const Eigen::Vector3f X = T.R * point.patch.ray + point.rho * T.t;
      Eigen::Vector2f pixel;
      if (!lens.project<float>(X, pixel)) continue;
      seen.push_back({pixel, point.rho / X.norm(), std::sqrt(point.information)});
    }
  }
  return seen;
}

std::vector<KeyframeRecord> Mapper::keyframes() const {
  std::vector<KeyframeRecord> all = retired_keyframes_;
  for (const keyframes::Keyframe& keyframe : window_.keyframes) {
    all.push_back({keyframe.id, keyframe.frame_index, keyframe.time_s, keyframe.T_camera_map().inverse()});
  }
  std::sort(all.begin(), all.end(), [](const KeyframeRecord& a, const KeyframeRecord& b) { return a.id < b.id; });
  return all;
}

std::vector<MapPoint> Mapper::points() const {
  std::vector<MapPoint> all = retired_points_;
  for (int host = 0; host < window_.size(); ++host) {
    for (const keyframes::ActivePoint& point : window_.keyframes[host].points) all.push_back(window_point(point, host));
  }
  return all;
}

std::size_t Mapper::active_points() const {
  std::size_t count = 0;
  for (const keyframes::Keyframe& keyframe : window_.keyframes) count += keyframe.points.size();
  return count;
}

}  // namespace tileflight::mapping
