#include "tileflight/odometry/odometry_pipeline.h"

#include <algorithm>
#include <cmath>

#include "tileflight/base/input_error.h"
#include "tileflight/mapping/tracer.h"
#include "tileflight/odometry/stage_timer.h"
#include "tileflight/photometry/valid_region.h"
#include "tileflight/tracking/motion_hypotheses.h"
#include "tileflight/tracking/relocalization.h"

namespace tileflight::odometry {
namespace {

/// Images of the initialization window that become keyframes: evenly spaced in parallax, including the first and the
/// last.
std::vector<std::size_t> select_by_parallax(const std::vector<double>& parallax, int wanted) {
  std::vector<std::size_t> picks{0};
  const std::size_t last = parallax.size() - 1;
  for (int i = 1; i < wanted - 1; ++i) {
    const double target = parallax.back() * i / (wanted - 1);
    std::size_t k = picks.back() + 1;
    while (k < last && parallax[k] < target) ++k;
    if (k < last) picks.push_back(k);
  }
  picks.push_back(last);
  return picks;
}

/// Neighbouring residuals have correlated errors (texture, sampling, point distances), so standard deviations from the
/// residuals' curvature are too small by these factors: medians over 45 flights of the proving ground
/// (tests/proving_ground) against their true poses.
constexpr double kPositionSigmaInflation = 2.2, kRotationSigmaInflation = 2.7;

/// Sets the standard deviations of a pose from the covariance of its left twist.
void set_pose_sigmas(const Eigen::Matrix<double, 6, 6>& covariance, tracking::FrameQuality& quality) {
  quality.sigma_position = kPositionSigmaInflation * std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  quality.sigma_rotation_rad = kRotationSigmaInflation * std::sqrt(covariance.bottomRightCorner<3, 3>().trace());
}

/// Copies the alignment's statistics.
void fill_quality(const tracking::ImageAlignment& alignment, tracking::FrameQuality& quality) {
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

photometry::AffineBrightness compose_brightness(const photometry::AffineBrightness& reference, double a, double b) {
  return {reference.a + a, b + std::exp(a) * reference.b};
}

}  // namespace

OdometryPipeline::OdometryPipeline(const imaging::Calibration& calibration,
                                   const imaging::PhotometricCalibration* photometric,
                                   const photometry::OdometryOptions& options, const Priors& aids,
                                   KeyframeObserver observer)
    : calibration_(calibration),
      photometric_(photometric),
      options_(options),
      priors_(aids),
      observer_(std::move(observer)),
      lens_(photometry::build_lens_pyramid(
          calibration.camera,
          photometry::pyramid_levels(calibration.camera.width(), calibration.camera.height(), options))),
      initializer_(lens_, options_.initialization),
      mapper_(lens_, options_) {}

void OdometryPipeline::add(InputFrame frame) {
  ++frame_count_;
  frame_stamps_.emplace_back(frame.index, frame.time_s);
  if (frame.image.width != calibration_.camera.width() || frame.image.height != calibration_.camera.height()) {
    throw InputError("frame " + std::to_string(frame.index),
                     "is " + std::to_string(frame.image.width) + "x" + std::to_string(frame.image.height) +
                         ", the calibration is for " + std::to_string(calibration_.camera.width()) + "x" +
                         std::to_string(calibration_.camera.height()) +
                         "; use images and a calibration of the same size");
  }
  if (lost_) return;
  if (!valid_region_found_) detect_valid_region(frame.image);
  if (initialized_) {
    track(frame);
  } else {
    wait_for_initialization(std::move(frame));
  }
}

std::string OdometryPipeline::progress_text() const {
  if (!initialized_) return "waiting for parallax";
  return std::to_string(mapper_.keyframes().size()) + " keyframes, " + std::to_string(mapper_.active_points()) +
         " active points, RMSE " + std::to_string(last_rmse_).substr(0, 4);
}

std::shared_ptr<const photometry::Pyramid> OdometryPipeline::make_pyramid(const InputFrame& frame) {
  return pyramids_.make(frame.image, photometric_, static_cast<int>(lens_.lenses.size()));
}

photometry::RollingShutter OdometryPipeline::rolling_shutter_for(const InputFrame& frame) const {
  const double readout_s = calibration_.line_delay_s * calibration_.camera.height();
  return photometry::make_rolling_shutter(
      readout_s, {T_last_map_ * reference_.T_camera_map.inverse(), frame.time_s - last_time_s_, T_last_before_last_,
                  consecutive_failures_ == 0 ? last_interval_s_ : 0.0});
}

photometry::RowRectifier OdometryPipeline::rectifier(const geometry::Vec6& twist,
                                                     const tracking::ReferenceLevel& reference,
                                                     const geometry::SE3& T_target_reference) const {
  return {lens_.lenses[0], calibration_.camera.width(), calibration_.camera.height(), twist,
          photometry::transform_depth_samples(lens_.lenses[0], T_target_reference, reference.ray, reference.rho,
                                              reference.size())};
}

photometry::AffineBrightness OdometryPipeline::brightness_prior(const InputFrame& frame) const {
  return {photometric_ != nullptr && frame.exposure_ms > 0 ? std::log(frame.exposure_ms) : 0.0, 0.0};
}

mapping::KeyframeCandidate OdometryPipeline::make_keyframe_candidate(const InputFrame& frame,
                                                                     std::shared_ptr<const photometry::Pyramid> pyramid,
                                                                     const geometry::SE3& T_camera_map,
                                                                     const photometry::AffineBrightness& light) const {
  // Information of the prior on (a, b): DSO, eq. 9. Only brightness differences are observable, so the first keyframe's
  // a, b are fixed; with calibration and exposure times all are nearly known; else they are free. DSO's implementation
  // has 1e14 for both of the first keyframe, 1e12 and 1e8 with a calibration, 0 without; the values here are chosen by
  // hand.
  const Eigen::Vector2d fixed(1e14, 1e8), known(1e10, 1e6), free(1e3, 1.0);
  mapping::KeyframeCandidate source{
      frame.index, frame.time_s, std::move(pyramid), &frame.image, T_camera_map, light, {}, {}};
  source.brightness_prior = brightness_prior(frame);
  const bool calibrated = photometric_ != nullptr && frame.exposure_ms > 0;
  source.brightness_information = !initialized_ ? fixed : (calibrated ? known : free);
  return source;
}

OdometryPipeline::ReferenceKeyframe OdometryPipeline::make_reference_keyframe(int slot) const {
  const photometry::Keyframe& keyframe = mapper_.window().keyframes[slot];
  return {keyframe.id, keyframe.T_camera_map(), keyframe.brightness(),
          tracking::make_tracking_reference(lens_, *keyframe.pyramid, mapper_.reference_points(slot)), 0.0};
}

void OdometryPipeline::detect_valid_region(const imaging::RgbImage& picture) {
  photometry::mask_rays(lens_, photometry::find_valid_region(picture, priors_.mask));
  valid_region_found_ = !photometry::is_dark(picture);
}

void OdometryPipeline::notify_observer(const InputFrame& frame, int slot) const {
  if (!observer_) return;
  KeyframeView view{frame.index, frame.image, {}};
  for (const tracking::ReferencePoint& point : mapper_.reference_points(slot)) {
    view.points.push_back({point.pixel.x(), point.pixel.y(), point.rho});
  }
  observer_(view);
}

std::optional<geometry::SE3> OdometryPipeline::prior_pose(const InputFrame& frame) const {
  return priors_.poses.empty() ? std::nullopt : geometry::interpolate(priors_.poses, frame.time_s);
}

// ---- initialization ----

void OdometryPipeline::wait_for_initialization(InputFrame frame) {
  const StageTimer clock(cpu_time_.initialization);
  const auto pyramid = make_pyramid(frame);
  buffered_frames_.push_back(std::move(frame));
  const std::optional<initialization::InitializationResult> start =
      initializer_.add(pyramid, prior_pose(buffered_frames_.back()));
  if (start) {
    initialize_map(*start);
    return;
  }
  const auto limit = static_cast<std::size_t>(2 * options_.initialization.max_frames);
  while (buffered_frames_.size() > limit && first_buffered_ < initializer_.first_frame()) {
    buffered_frames_.pop_front();
    ++first_buffered_;
  }
}

/// Rectifies the images of the initialization window to a global shutter; from then on they are used as global-shutter
/// images.
void OdometryPipeline::rectify_initialization(const initialization::InitializationResult& start) {
  const double readout_s = calibration_.line_delay_s * calibration_.camera.height();
  const std::size_t offset = start.first_frame - first_buffered_, last = start.T_camera_first.size() - 1;
  if (readout_s == 0.0) return;
  tracking::ReferenceLevel corners;
  for (std::size_t i = 0; i < start.rho.size(); ++i) {
    const auto ray = lens_.lenses[0].unproject(start.pixels[i].cast<double>());
    if (ray) corners.add(start.pixels[i], ray->cast<float>(), start.rho[i], 0.0F);
  }
  for (std::size_t k = 0; k <= last; ++k) {
    const std::size_t before = k > 0 ? k - 1 : 0, after = std::min(k + 1, last);
    const double interval_s = buffered_frames_[offset + after].time_s - buffered_frames_[offset + before].time_s;
    if (interval_s == 0.0) continue;
    const geometry::SE3 motion = start.T_camera_first[after] * start.T_camera_first[before].inverse();
    imaging::RgbImage& image = buffered_frames_[offset + k].image;
    image = rectifier(readout_s / interval_s * motion.log(), corners, start.T_camera_first[k])(image);
  }
}

void OdometryPipeline::initialize_map(const initialization::InitializationResult& start) {
  rectify_initialization(start);
  const std::vector<std::size_t> picks = select_by_parallax(start.parallax_rad, options_.initialization.keyframes);
  mapper_.initialize(make_initial_keyframes(start, picks));
  initialized_ = true;
  align_earlier_frames(start.first_frame - first_buffered_);
  align_initialization_frames(start, picks);
  const std::size_t offset = start.first_frame - first_buffered_;
  for (std::size_t s = 0; s < picks.size(); ++s) {
    notify_observer(buffered_frames_[offset + picks[s]], static_cast<int>(s));
    store_loop_features(static_cast<int>(s));
  }
  initialization_end_s_ = buffered_frames_[offset + picks.back()].time_s;
  buffered_frames_.clear();
}

std::vector<photometry::Keyframe> OdometryPipeline::make_initial_keyframes(
    const initialization::InitializationResult& start, const std::vector<std::size_t>& picks) {
  const std::size_t offset = start.first_frame - first_buffered_;
  std::vector<photometry::Keyframe> keyframes;
  tracking::TrackingReference corners;
  tracking::ImageAlignmentState state;
  for (std::size_t k = 0; k < start.T_camera_first.size(); ++k) {
    const InputFrame& frame = buffered_frames_[offset + k];
    const auto pyramid = make_pyramid(frame);
    photometry::AffineBrightness light = brightness_prior(frame);
    const photometry::AffineBrightness first_light = keyframes.empty() ? light : keyframes.front().brightness();
    if (k == 0) {
      std::vector<tracking::ReferencePoint> points;
      for (std::size_t i = 0; i < start.rho.size(); ++i) points.push_back({start.pixels[i], start.rho[i], 1.0F});
      corners = tracking::make_tracking_reference(lens_, *pyramid, points);
    } else {
      state.T_target_reference = start.T_camera_first[k];
      const tracking::ImageAlignment alignment =
          tracking::align_image(lens_, corners, *pyramid, state, options_.tracking);
      if (alignment.converged) state.a = alignment.state.a, state.b = alignment.state.b;
      light = compose_brightness(first_light, state.a, state.b);
    }
    for (photometry::Keyframe& keyframe : keyframes) {
      const photometry::PairTransform pair = photometry::pair_transform(
          start.T_camera_first[k] * keyframe.T_camera_map_linear.inverse(), keyframe.brightness(), light);
      mapping::trace_points(lens_.lenses[0], pyramid->levels[0], pair, options_.tracing, options_.window.huber,
                            keyframe.immature);
    }
    if (std::find(picks.begin(), picks.end(), k) == picks.end()) continue;
    mapping::KeyframeCandidate source = make_keyframe_candidate(frame, pyramid, start.T_camera_first[k], light);
    // As `free` in make_keyframe_candidate(): only the first keyframe's brightness is fixed.
    if (!keyframes.empty()) source.brightness_information = {1e3, 1.0};
    keyframes.push_back(mapper_.make_keyframe(source));
  }
  return keyframes;
}

void OdometryPipeline::align_earlier_frames(std::size_t count) {
  if (count == 0) return;
  const ReferenceKeyframe reference = make_reference_keyframe(0);
  std::vector<std::pair<std::size_t, tracking::ImageAlignment>> found;
  tracking::ImageAlignmentState state;
  geometry::SE3 velocity;
  double velocity_s = 0.0;  // time interval of `velocity`
  for (std::size_t i = count; i-- > 0;) {
    tracking::ImageAlignmentState guess = state;
    guess.T_target_reference = velocity * state.T_target_reference;
    const auto pyramid = make_pyramid(buffered_frames_[i]);
    const double interval_s = buffered_frames_[i].time_s - buffered_frames_[i + 1].time_s;
    const photometry::RollingShutter shutter =
        photometry::make_rolling_shutter(calibration_.line_delay_s * calibration_.camera.height(),
                                         {state.T_target_reference, interval_s, velocity, velocity_s});
    tracking::ImageAlignment alignment =
        tracking::align_image(lens_, reference.pixels, *pyramid, guess, options_.tracking, {}, 0, shutter);
    if (!alignment.converged) break;
    velocity_s = interval_s;
    velocity = alignment.state.T_target_reference * state.T_target_reference.inverse();
    state = alignment.state;
    found.emplace_back(i, alignment);
  }
  std::reverse(found.begin(), found.end());
  for (const auto& [i, alignment] : found)
    record(buffered_frames_[i], reference, alignment.state.T_target_reference, alignment);
}

void OdometryPipeline::align_initialization_frames(const initialization::InitializationResult& start,
                                                   const std::vector<std::size_t>& picks) {
  const std::size_t offset = start.first_frame - first_buffered_;
  tracking::ImageAlignmentState state;
  for (std::size_t s = 0; s < picks.size(); ++s) {
    const ReferenceKeyframe reference = make_reference_keyframe(static_cast<int>(s));
    record(buffered_frames_[offset + picks[s]], reference, geometry::SE3(), {});
    const std::size_t end = s + 1 < picks.size() ? picks[s + 1] : picks[s];
    state.a = state.b = 0.0;
    for (std::size_t k = picks[s] + 1; k < end; ++k) {
      state.T_target_reference = start.T_camera_first[k] * start.T_camera_first[picks[s]].inverse();
      const auto pyramid = make_pyramid(buffered_frames_[offset + k]);
      const tracking::ImageAlignment alignment =
          tracking::align_image(lens_, reference.pixels, *pyramid, state, options_.tracking);
      if (alignment.converged) {
        state = alignment.state;
        last_rmse_ = alignment.finest_rmse();
        record(buffered_frames_[offset + k], reference, alignment.state.T_target_reference, alignment);
      }
    }
    if (s + 1 == picks.size()) reference_ = reference;
  }
  T_last_map_ = reference_.T_camera_map;
  const TrackedFrame& before = tracked_frames_[tracked_frames_.size() - 2];
  for (const photometry::Keyframe& keyframe : mapper_.window().keyframes) {
    if (keyframe.id == before.keyframe)
      T_last_before_last_ = T_last_map_ * (before.T_camera_keyframe * keyframe.T_camera_map()).inverse();
  }
  last_a_ = last_b_ = 0.0;
  last_time_s_ = tracked_frames_.back().time_s;
  last_interval_s_ = last_time_s_ - before.time_s;
}

// ---- tracking ----

tracking::ImageAlignment OdometryPipeline::best_alignment(const photometry::Pyramid& pyramid,
                                                          const photometry::RollingShutter& shutter) const {
  const geometry::SE3 T_last_reference = T_last_map_ * reference_.T_camera_map.inverse();
  const int turns = consecutive_failures_ == 0 ? 1 : 3;
  tracking::ImageAlignment best;
  bool first = true;
  for (const geometry::SE3& pose : tracking::motion_hypotheses(T_last_reference, T_last_before_last_, turns)) {
    const tracking::ImageAlignmentState start{pose, last_a_, last_b_};
    const tracking::ImageAlignment result =
        tracking::align_image(lens_, reference_.pixels, pyramid, start, options_.tracking,
                              best.converged ? best.rmse : std::vector<double>{}, 0, shutter);
    const bool better = result.finest_rmse() < best.finest_rmse() && result.converged >= best.converged;
    if (first || better) best = result;
    first = false;
    const double accepted = options_.tracking.accept_ratio * (last_rmse_ > 0 ? last_rmse_ : options_.tracking.huber);
    if (best.converged && best.finest_rmse() < accepted) break;
  }
  return best;
}

void OdometryPipeline::track(const InputFrame& frame) {
  auto pyramid = time_stage(cpu_time_.preprocessing, [&] { return make_pyramid(frame); });
  photometry::RollingShutter shutter = rolling_shutter_for(frame);
  tracking::ImageAlignment alignment =
      time_stage(cpu_time_.tracking, [&] { return best_alignment(*pyramid, shutter); });
  if (!alignment.converged) {
    const auto found = time_stage(cpu_time_.tracking, [&] { return recover(*pyramid); });
    if (!found) {
      on_failure(frame, alignment);
      return;
    }
    alignment = *found;
    shutter = {};  // no velocity is known after relocalization
  }
  recovery_references_.clear();
  const geometry::SE3 T_camera_map = alignment.state.T_target_reference * reference_.T_camera_map;
  const photometry::AffineBrightness light =
      compose_brightness(reference_.brightness, alignment.state.a, alignment.state.b);
  T_last_before_last_ = consecutive_failures_ == 0 ? T_camera_map * T_last_map_.inverse() : geometry::SE3();
  T_last_map_ = T_camera_map;
  last_interval_s_ = consecutive_failures_ == 0 ? frame.time_s - last_time_s_ : 0.0;
  last_time_s_ = frame.time_s;
  last_a_ = alignment.state.a;
  last_b_ = alignment.state.b;
  last_rmse_ = alignment.finest_rmse();
  consecutive_failures_ = 0;
  if (reference_.first_rmse <= 0) reference_.first_rmse = last_rmse_;
  const mapping::TrackingChange change{
      tracking::optical_flow(lens_, reference_.pixels, alignment.state.T_target_reference), alignment.state.a,
      last_rmse_, reference_.first_rmse};
  const bool is_keyframe =
      mapping::needs_keyframe(change, calibration_.camera.width(), calibration_.camera.height(), options_.window);
  std::optional<InputFrame> global;  // the image rectified to a global shutter
  if (!shutter.is_global()) {
    const StageTimer clock(cpu_time_.preprocessing);
    const geometry::SE3& T_target_reference = alignment.state.T_target_reference;
    const photometry::RowRectifier rectify =
        rectifier(shutter.twist(T_target_reference), reference_.pixels.levels[0], T_target_reference);
    pyramid = pyramids_.make([&](imaging::FloatImage memory) { return rectify(pyramid->levels[0], std::move(memory)); },
                             static_cast<int>(lens_.lenses.size()));
    if (is_keyframe) global = InputFrame{frame.index, frame.time_s, frame.exposure_ms, rectify(frame.image)};
  }
  if (is_keyframe) {
    make_keyframe(global ? *global : frame, pyramid, T_camera_map, light, alignment);
  } else {
    record(frame, reference_, alignment.state.T_target_reference, alignment);
    const StageTimer clock(cpu_time_.tracing);
    mapper_.trace(*pyramid, T_camera_map, light);
  }
}

/// Relocalizes on any keyframe of the window, which then becomes the reference.
std::optional<tracking::ImageAlignment> OdometryPipeline::recover(const photometry::Pyramid& pyramid) {
  constexpr double kAcceptedRmse = 2.0;                 // relative to the last image's RMSE; chosen by hand
  if (consecutive_failures_ == 0) return std::nullopt;  // a single bad image is often followed by a good one
  if (recovery_references_.empty()) {
    for (int slot = mapper_.window().size() - 1; slot >= 0; --slot)
      recovery_references_.push_back(make_reference_keyframe(slot));
  }
  std::vector<tracking::TrackingReference> pixels;
  for (const ReferenceKeyframe& reference : recovery_references_) pixels.push_back(reference.pixels);
  const double accepted = std::min(options_.tracking.lost_rmse, kAcceptedRmse * last_rmse_);
  const std::optional<tracking::Relocalization> found =
      tracking::relocalize(lens_, pixels, pyramid, accepted, options_.tracking);
  if (!found) return std::nullopt;
  ++relocalizations_;
  reference_ = recovery_references_[found->keyframe];
  return found->alignment;
}

void OdometryPipeline::make_keyframe(const InputFrame& frame, std::shared_ptr<const photometry::Pyramid> pyramid,
                                     const geometry::SE3& T_camera_map, const photometry::AffineBrightness& light,
                                     const tracking::ImageAlignment& alignment) {
  const StageTimer clock(cpu_time_.keyframes);
  const geometry::SE3 T_last_before_last = T_last_before_last_;
  mapper_.add_keyframe(make_keyframe_candidate(frame, std::move(pyramid), T_camera_map, light));
  reference_ = make_reference_keyframe(mapper_.window().size() - 1);
  // The optimisation moved the keyframe slightly; the motion between the last two images is kept.
  T_last_map_ = reference_.T_camera_map;
  T_last_before_last_ = T_last_before_last;
  last_a_ = last_b_ = 0.0;
  record(frame, reference_, geometry::SE3(), alignment);
  notify_observer(frame, mapper_.window().size() - 1);
  store_loop_features(mapper_.window().size() - 1);
}

void OdometryPipeline::store_loop_features(int slot) {
  if (!options_.loops.enabled) return;
  const StageTimer clock(cpu_time_.loops);
  const photometry::Keyframe& keyframe = mapper_.window().keyframes[slot];
  loop_keyframes_.push_back(
      {keyframe.id, keyframe.frame_index, {}, loops::find_features(*keyframe.pyramid, lens_, {})});
}

void OdometryPipeline::on_failure(const InputFrame& frame, const tracking::ImageAlignment& alignment) {
  ++consecutive_failures_;
  lost_ = consecutive_failures_ > options_.tracking.max_failed_frames;
  const std::string rmse =
      std::isfinite(alignment.finest_rmse()) ? std::to_string(alignment.finest_rmse()).substr(0, 5) : "none";
  lost_reason_ = "tracking lost at frame " + std::to_string(frame.index) + ": " +
                 std::to_string(consecutive_failures_) +
                 " consecutive frames do not align with the last keyframe (RMSE " + rmse + " grey values, " +
                 std::to_string(static_cast<int>(100 * alignment.inside_share)) + " % of its points in view)";
}

void OdometryPipeline::record(const InputFrame& frame, const ReferenceKeyframe& reference,
                              const geometry::SE3& T_camera_reference, tracking::ImageAlignment alignment) {
  tracked_frames_.push_back({frame.index, frame.time_s, reference.keyframe, T_camera_reference, std::move(alignment)});
}

// ---- result ----

/// Corrects keyframes and points for the loops found; returns the scale of each keyframe by id, empty without loops.
std::map<int, double> OdometryPipeline::close_loops(std::vector<mapping::KeyframeRecord>& keyframes,
                                                    std::vector<mapping::MapPoint>& points,
                                                    OdometryResult& result) const {
  const StageTimer clock(result.cpu_time.loops);
  std::vector<loops::LoopKeyframe> seen = loop_keyframes_;
  for (std::size_t k = 0; k < seen.size(); ++k) seen[k].T_map_camera = keyframes[k].T_map_camera;
  loops::assign_feature_depths(lens_.lenses[0], points, seen);
  const std::vector<loops::Loop> loops = loops::find_loops(seen, options_.loops);
  if (loops.empty()) return {};
  const std::vector<geometry::Sim3> poses = loops::correct_poses(seen, loops);
  std::map<int, double> scale;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    keyframes[k].T_map_camera = geometry::SE3(poses[k].rotation, poses[k].translation);
    scale[keyframes[k].id] = poses[k].scale;
  }
  loops::rescale_points(scale, points);
  for (const loops::Loop& loop : loops) {
    result.loops.push_back(
        {seen[loop.from].frame_index, seen[loop.to].frame_index, loop.T_from_to.scale, loop.inliers});
  }
  return scale;
}

std::vector<tracking::FrameQuality> OdometryPipeline::quality() const {
  const std::vector<mapping::KeyframeRecord> keyframes = mapper_.keyframes();
  const std::vector<mapping::StepUncertainty>& steps = mapper_.step_uncertainties();
  std::vector<double> log_scale_variance(steps.size(), 0.0);  // accumulated since the first keyframe
  for (std::size_t k = 1; k < steps.size(); ++k) log_scale_variance[k] = log_scale_variance[k - 1] + steps[k].log_scale;
  std::map<std::int64_t, const TrackedFrame*> tracked;
  for (const TrackedFrame& frame : tracked_frames_) tracked[frame.index] = &frame;
  std::vector<tracking::FrameQuality> quality;
  for (const auto& [index, time_s] : frame_stamps_) {
    tracking::FrameQuality q{.frame = index, .time_s = time_s};
    if (const auto found = tracked.find(index); found != tracked.end()) {
      const TrackedFrame& frame = *found->second;
      q.tracked = true;
      q.is_keyframe = keyframes[frame.keyframe].frame_index == index;
      q.keyframe = q.is_keyframe ? frame.keyframe - 1 : frame.keyframe;
      fill_quality(frame.alignment, q);
      q.sigma_log_scale = kPositionSigmaInflation * std::sqrt(log_scale_variance[frame.keyframe]);
      geometry::SE3 T_camera_keyframe = frame.T_camera_keyframe;
      if (q.is_keyframe && frame.keyframe > 0) {
        T_camera_keyframe = keyframes[frame.keyframe].T_map_camera.inverse() * keyframes[q.keyframe].T_map_camera;
        set_pose_sigmas(steps[frame.keyframe].pose, q);
      }
      q.known_points = steps[frame.keyframe].known_points;
      q.distance_to_keyframe = T_camera_keyframe.translation.norm();
    }
    quality.push_back(q);
  }
  return quality;
}

OdometryResult OdometryPipeline::result() const {
  OdometryResult result;
  result.frames = frame_count_;
  result.frames_tracked = static_cast<std::int64_t>(tracked_frames_.size());
  result.cpu_time = cpu_time_;
  result.relocalizations = relocalizations_;
  constexpr int kLostAtEnd = 5;  // images: this many failures at the end count as lost, since no later image can
                                 // recover them. Chosen by hand
  result.lost = lost_ || !initialized_ || consecutive_failures_ >= kLostAtEnd;
  if (result.lost)
    result.lost_reason =
        initialized_ ? lost_reason_ : (frame_count_ == 0 ? "no pictures" : initializer_.failure_reason());
  result.quality = quality();
  if (!initialized_) return result;
  std::vector<mapping::KeyframeRecord> keyframes = mapper_.keyframes();
  std::vector<mapping::MapPoint> points = mapper_.points();
  std::map<int, double> scale;
  if (options_.loops.enabled) scale = close_loops(keyframes, points, result);
  std::map<int, geometry::SE3> poses;
  std::vector<int> ids;
  for (const mapping::KeyframeRecord& keyframe : keyframes) {
    poses[keyframe.id] = keyframe.T_map_camera;
    result.keyframes.poses.push_back({keyframe.time_s, keyframe.T_map_camera});
    result.keyframe_frame_indices.push_back(keyframe.frame_index);
    ids.push_back(keyframe.id);
  }
  for (const TrackedFrame& frame : tracked_frames_) {
    geometry::SE3 T_keyframe_camera = frame.T_camera_keyframe.inverse();
    if (!scale.empty()) T_keyframe_camera.translation *= scale.at(frame.keyframe);
    result.trajectory.poses.push_back({frame.time_s, poses.at(frame.keyframe) * T_keyframe_camera});
  }
  result.systematic_displacement = mapper_.systematic_residuals().estimate();
  result.camera = photometry::apply_delta(calibration_.camera, mapper_.intrinsics_delta());
  result.map = mapping::make_point_cloud(points, poses, options_.map);
  result.map_point_keyframes = mapping::make_point_tracks(points, ids, options_.map);
  return result;
}

}  // namespace tileflight::odometry
