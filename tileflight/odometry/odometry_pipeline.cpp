#include "tileflight/odometry/odometry_pipeline.h"

#include <algorithm>
#include <cmath>

#include "tileflight/base/input_error.h"
#include "tileflight/odometry/prior_alignment.h"
#include "tileflight/odometry/stage_timer.h"
#include "tileflight/tracking/motion_hypotheses.h"
#include "tileflight/tracking/relocalization.h"

namespace tileflight::odometry {
namespace {

/// The image that was just aligned, with the state still that of the image before.
LastFrame next_last_frame(const TrackingState& state, const tracking::ImageAlignment& alignment, double time_s) {
  const geometry::SE3 T_camera_map = alignment.state.T_target_reference * state.reference.T_camera_map;
  const bool follows = state.failures.none();  // no image in between, so that the motion is that of one interval
  return {.T_camera_map = T_camera_map,
          .T_last_before_last = follows ? T_camera_map * state.last.T_camera_map.inverse() : geometry::SE3(),
          .time_s = time_s,
          .interval_s = follows ? time_s - state.last.time_s : 0.0,
          .a = alignment.state.a,
          .b = alignment.state.b,
          .rmse = alignment.finest_rmse()};
}

void require_later(const FrameStamp& before, const InputFrame& frame) {
  const std::string where = "frame " + std::to_string(frame.index);
  if (!(frame.time_s > before.time_s))
    throw InputError(where, "its time, " + std::to_string(frame.time_s) +
                                " s, is not after that of the frame before, " + std::to_string(before.time_s) +
                                " s; add the frames in order of time");
  if (frame.index <= before.index)
    throw InputError(where, "its index is not greater than that of the frame before, " + std::to_string(before.index));
}

/// The samples decide on frame and scale, and so would poses or depth.
void require_one_scale(const Priors& priors, bool has_prior_pose) {
  if (priors.inertial && (has_prior_pose || !priors.poses.empty() || priors.depth_m))
    throw InputError("odometry",
                     "poses or depth and an inertial unit are both given; scale and frame come from one of them");
}

bool is_finite(const geometry::SE3& T) { return T.translation.allFinite() && T.rotation.coeffs().allFinite(); }

}  // namespace

OdometryPipeline::OdometryPipeline(const imaging::Calibration& calibration, const OdometryOptions& options,
                                   OdometryExtras extras)
    : options_(options),
      priors_(std::move(extras.priors)),
      priors_given_at_once_(!priors_.poses.empty()),
      observer_(std::move(extras.keyframe_observer)),
      preprocessor_(calibration, std::move(extras.photometric), std::move(priors_.mask), options_),
      mapper_(preprocessor_.lens(), options_),
      state_(InitializationState{initialization::Initializer(preprocessor_.lens(), options_.initialization), {}, 0}) {
  require_one_scale(priors_, false);
}

FrameResult OdometryPipeline::add(InputFrame frame, const std::optional<geometry::SE3>& T_world_camera) {
  require_usable(frame, T_world_camera);
  const FrameStamp stamp{frame.index, frame.time_s};
  if (lost()) return frame_result(stamp);
  preprocessor_.find_valid_region(frame.image);
  log_.read.push_back(stamp);
  if (auto* const tracking = std::get_if<TrackingState>(&state_)) {
    track(*tracking, frame);
  } else {
    if (T_world_camera) priors_.poses.poses.push_back({frame.time_s, *T_world_camera});
    initialize(std::get<InitializationState>(state_), std::move(frame));
  }
  return frame_result(stamp);
}

void OdometryPipeline::require_usable(const InputFrame& frame,
                                      const std::optional<geometry::SE3>& T_world_camera) const {
  const std::string where = "frame " + std::to_string(frame.index);
  const imaging::Camera& camera = preprocessor_.camera();
  if (frame.image.width != camera.width() || frame.image.height != camera.height()) {
    throw InputError(where, "is " + std::to_string(frame.image.width) + "x" + std::to_string(frame.image.height) +
                                ", the calibration is for " + std::to_string(camera.width()) + "x" +
                                std::to_string(camera.height()) + "; use images and a calibration of the same size");
  }
  if (!std::isfinite(frame.time_s)) throw InputError(where, "its time is not a finite number of seconds");
  if (!log_.read.empty()) require_later(log_.read.back(), frame);
  if (!T_world_camera) return;
  if (priors_given_at_once_)
    throw InputError(where, "has a prior pose, but all prior poses were given at the start; give them in one way");
  require_one_scale(priors_, true);
  if (!is_finite(*T_world_camera)) throw InputError(where, "its prior pose is not finite");
}

bool OdometryPipeline::lost() const {
  const auto* const state = std::get_if<TrackingState>(&state_);
  return state != nullptr && state->failures.count > options_.tracking.max_failed_frames;
}

FrameResult OdometryPipeline::frame_result(const FrameStamp& frame) const {
  FrameResult result;
  result.quality = {.frame = frame.index, .time_s = frame.time_s};
  if (const auto* const state = std::get_if<InitializationState>(&state_)) {
    result.status = FrameStatus::kInitializing;
    result.reason = state->initializer.failure_reason();
    return result;
  }
  const auto& state = std::get<TrackingState>(state_);
  if (!state.failures.none()) {
    result.status = lost() ? FrameStatus::kLost : FrameStatus::kNotAligned;
    result.reason = state.failures.reason;
    return result;
  }
  result.status = FrameStatus::kTracked;
  result.T_map_camera = state.last.T_camera_map.inverse();
  result.quality = last_frame_quality(log_, mapper_);
  return result;
}

std::string OdometryPipeline::progress_text() const {
  const auto* const state = std::get_if<TrackingState>(&state_);
  if (state == nullptr) return "waiting for parallax";
  return std::to_string(mapper_.step_uncertainties().size()) + " keyframes, " +
         std::to_string(mapper_.active_points()) + " active points, RMSE " +
         std::to_string(state->last.rmse).substr(0, 4);
}

std::optional<geometry::SE3> OdometryPipeline::prior_pose(const InputFrame& frame) const {
  return priors_.poses.empty() ? std::nullopt : geometry::interpolate(priors_.poses, frame.time_s);
}

// ---- initializing ----

void OdometryPipeline::initialize(InitializationState& state, InputFrame frame) {
  const StageTimer clock(log_.cpu_time.initialization);
  const auto pyramid = preprocessor_.make_pyramid(frame);
  state.frames.push_back(std::move(frame));
  const std::optional<initialization::InitializationResult> start =
      state.initializer.add(pyramid, prior_pose(state.frames.back()));
  if (!start) {
    state.drop_unneeded(static_cast<std::size_t>(2 * options_.initialization.max_frames));
    return;
  }
  InitialMap map = make_initial_map(*start, state, preprocessor_, mapper_, options_);
  log_.tracked = std::move(map.tracked);
  for (std::size_t slot = 0; slot < map.keyframes.size(); ++slot)
    report_keyframe(state.frames[map.keyframes[slot]], static_cast<int>(slot));
  state_ = std::move(map.tracking);
}

// ---- tracking and recovering ----

photometry::RollingShutter OdometryPipeline::predict_rolling_shutter(const TrackingState& state,
                                                                     const InputFrame& frame) const {
  const LastFrame& last = state.last;
  return photometry::make_rolling_shutter(
      preprocessor_.readout_s(),
      {last.T_camera_map * state.reference.T_camera_map.inverse(), frame.time_s - last.time_s, last.T_last_before_last,
       state.failures.none() ? last.interval_s : 0.0});
}

tracking::ImageAlignment OdometryPipeline::best_alignment(const TrackingState& state,
                                                          const photometry::Pyramid& pyramid,
                                                          const photometry::RollingShutter& shutter) const {
  const LastFrame& last = state.last;
  const geometry::SE3 T_last_reference = last.T_camera_map * state.reference.T_camera_map.inverse();
  const int turns = state.failures.none() ? 1 : 3;
  const double accepted = options_.tracking.accept_ratio * (last.rmse > 0 ? last.rmse : options_.tracking.huber);
  tracking::ImageAlignment best;
  bool first = true;
  for (const geometry::SE3& pose : tracking::motion_hypotheses(T_last_reference, last.T_last_before_last, turns)) {
    const tracking::ImageAlignmentState start{pose, last.a, last.b};
    const tracking::ImageAlignment result =
        tracking::align_image(preprocessor_.lens(), state.reference.pixels, pyramid, start, options_.tracking,
                              best.converged ? best.rmse : std::vector<double>{}, 0, shutter);
    const bool better = result.finest_rmse() < best.finest_rmse() && result.converged >= best.converged;
    if (first || better) best = result;
    first = false;
    if (best.converged && best.finest_rmse() < accepted) break;
  }
  return best;
}

void OdometryPipeline::track(TrackingState& state, const InputFrame& frame) {
  auto pyramid = time_stage(log_.cpu_time.preprocessing, [&] { return preprocessor_.make_pyramid(frame); });
  photometry::RollingShutter shutter = predict_rolling_shutter(state, frame);
  tracking::ImageAlignment alignment =
      time_stage(log_.cpu_time.tracking, [&] { return best_alignment(state, *pyramid, shutter); });
  if (!alignment.converged) {
    const auto found = time_stage(log_.cpu_time.tracking, [&] { return recover(state, *pyramid); });
    if (!found) {
      fail(state.failures, frame, alignment);
      return;
    }
    alignment = *found;
    shutter = {};  // no velocity is known after relocalization
  }
  follow(state, frame, std::move(pyramid), shutter, alignment);
}

/// Takes over an aligned image: as a keyframe if one is due, otherwise to trace the window's points in it.
void OdometryPipeline::follow(TrackingState& state, const InputFrame& frame,
                              std::shared_ptr<const photometry::Pyramid> pyramid,
                              const photometry::RollingShutter& shutter, const tracking::ImageAlignment& alignment) {
  state.last = next_last_frame(state, alignment, frame.time_s);
  state.failures = {};
  if (state.reference.first_rmse <= 0) state.reference.first_rmse = state.last.rmse;
  const photometry::AffineBrightness brightness =
      compose_brightness(state.reference.brightness, alignment.state.a, alignment.state.b);
  const bool is_keyframe = needs_keyframe(state, alignment);
  std::optional<InputFrame> global;  // the image rectified to a global shutter
  if (!shutter.is_global()) {
    const StageTimer clock(log_.cpu_time.preprocessing);
    const geometry::SE3& T_target_reference = alignment.state.T_target_reference;
    const photometry::RowRectifier rectify = preprocessor_.make_rectifier(
        shutter.twist(T_target_reference), state.reference.pixels.levels[0], T_target_reference);
    pyramid = preprocessor_.rectify(*pyramid, rectify);
    if (is_keyframe) global = InputFrame{frame.index, frame.time_s, frame.exposure_ms, rectify(frame.image)};
  }
  if (is_keyframe) {
    make_keyframe(state, global ? *global : frame, std::move(pyramid), brightness, alignment);
  } else {
    log_.tracked.push_back(
        {frame.index, frame.time_s, state.reference.keyframe, alignment.state.T_target_reference, alignment});
    const StageTimer clock(log_.cpu_time.tracing);
    mapper_.trace(*pyramid, state.last.T_camera_map, brightness);
  }
}

/// Relocalizes on any keyframe of the window, which then becomes the reference.
std::optional<tracking::ImageAlignment> OdometryPipeline::recover(TrackingState& state,
                                                                  const photometry::Pyramid& pyramid) {
  constexpr double kAcceptedRmse = 2.0;            // relative to the last image's RMSE; chosen by hand
  if (state.failures.none()) return std::nullopt;  // a single bad image is often followed by a good one
  std::vector<ReferenceKeyframe>& references = state.failures.recovery_references;
  if (references.empty()) {
    for (int slot = mapper_.window().size() - 1; slot >= 0; --slot)
      references.push_back(make_reference_keyframe(mapper_, preprocessor_.lens(), slot));
  }
  std::vector<tracking::TrackingReference> pixels;
  for (const ReferenceKeyframe& reference : references) pixels.push_back(reference.pixels);
  const double accepted = std::min(options_.tracking.lost_rmse, kAcceptedRmse * state.last.rmse);
  const std::optional<tracking::Relocalization> found =
      tracking::relocalize(preprocessor_.lens(), pixels, pyramid, accepted, options_.tracking);
  if (!found) return std::nullopt;
  ++log_.relocalizations;
  state.reference = references[found->keyframe];
  return found->alignment;
}

void OdometryPipeline::fail(Failures& failures, const InputFrame& frame,
                            const tracking::ImageAlignment& alignment) const {
  ++failures.count;
  const std::string rmse =
      std::isfinite(alignment.finest_rmse()) ? std::to_string(alignment.finest_rmse()).substr(0, 5) : "none";
  failures.reason = "tracking lost at frame " + std::to_string(frame.index) + ": " + std::to_string(failures.count) +
                    " consecutive frames do not align with the last keyframe (RMSE " + rmse + " grey values, " +
                    std::to_string(static_cast<int>(100 * alignment.inside_share)) + " % of its points in view)";
}

bool OdometryPipeline::needs_keyframe(const TrackingState& state, const tracking::ImageAlignment& alignment) const {
  const mapping::TrackingChange change{
      tracking::optical_flow(preprocessor_.lens(), state.reference.pixels, alignment.state.T_target_reference),
      alignment.state.a, state.last.rmse, state.reference.first_rmse};
  const imaging::Camera& camera = preprocessor_.camera();
  return mapping::needs_keyframe(change, camera.width(), camera.height(), options_.window);
}

void OdometryPipeline::make_keyframe(TrackingState& state, const InputFrame& frame,
                                     std::shared_ptr<const photometry::Pyramid> pyramid,
                                     const photometry::AffineBrightness& brightness,
                                     const tracking::ImageAlignment& alignment) {
  const StageTimer clock(log_.cpu_time.keyframes);
  const auto knowledge =
      preprocessor_.is_brightness_known(frame) ? BrightnessKnowledge::kKnown : BrightnessKnowledge::kFree;
  mapper_.add_keyframe(make_keyframe_candidate(frame, std::move(pyramid), state.last.T_camera_map, brightness,
                                               preprocessor_.brightness_prior(frame), knowledge));
  const int newest = mapper_.window().size() - 1;
  state.reference = make_reference_keyframe(mapper_, preprocessor_.lens(), newest);
  // The optimisation moved the keyframe slightly; the motion between the last two images is kept.
  state.last.T_camera_map = state.reference.T_camera_map;
  state.last.a = state.last.b = 0.0;
  log_.tracked.push_back({frame.index, frame.time_s, state.reference.keyframe, geometry::SE3(), alignment});
  report_keyframe(frame, newest);
}

/// Shows a new keyframe to the observer and keeps its features for loop closure.
void OdometryPipeline::report_keyframe(const InputFrame& frame, int slot) {
  if (observer_) {
    KeyframeView view{frame.index, frame.image, {}};
    for (const tracking::ReferencePoint& point : mapper_.reference_points(slot))
      view.points.push_back({point.pixel.x(), point.pixel.y(), point.rho});
    observer_(view);
  }
  if (!options_.loops.enabled) return;
  const StageTimer clock(log_.cpu_time.loops);
  const photometry::Keyframe& keyframe = mapper_.window().keyframes[slot];
  log_.loop_keyframes.push_back(
      {keyframe.id, keyframe.frame_index, {}, loops::find_features(*keyframe.pyramid, preprocessor_.lens(), {})});
}

// ---- result ----

OdometryResult OdometryPipeline::result_in_map_frame() const {
  const auto* const state = std::get_if<TrackingState>(&state_);
  OdometryResult result;
  result.frames = frames();
  result.frames_tracked = static_cast<std::int64_t>(log_.tracked.size());
  result.cpu_time = log_.cpu_time;
  result.relocalizations = log_.relocalizations;
  constexpr int kLostAtEnd = 5;  // images: this many failures at the end count as lost, since no later image can
                                 // recover them. Chosen by hand
  result.lost = lost() || state == nullptr || state->failures.count >= kLostAtEnd;
  if (result.lost)
    result.lost_reason =
        state != nullptr
            ? state->failures.reason
            : (result.frames == 0 ? "no pictures" : std::get<InitializationState>(state_).initializer.failure_reason());
  result.quality = frame_qualities(log_, mapper_);
  if (state == nullptr) return result;
  set_path_and_map(log_, mapper_, preprocessor_.lens().lenses[0], options_, priors_.inertial, result);
  result.systematic_displacement = mapper_.systematic_residuals().estimate();
  result.camera = photometry::apply_delta(preprocessor_.camera(), mapper_.intrinsics_delta());
  return result;
}

OdometryResult OdometryPipeline::result() const {
  OdometryResult result = result_in_map_frame();
  if (const auto* const state = std::get_if<TrackingState>(&state_))
    apply_priors(preprocessor_.camera(), priors_, state->initialization_end_s, result);
  return result;
}

std::optional<geometry::Sim3> OdometryPipeline::T_world_map() const {
  const auto* const state = std::get_if<TrackingState>(&state_);
  if (state == nullptr) return std::nullopt;
  OdometryOptions options = options_;
  options.loops.enabled = false;
  OdometryResult now;
  set_path_and_map(log_, mapper_, preprocessor_.lens().lenses[0], options, {}, now);
  return find_T_world_map(preprocessor_.camera(), priors_, state->initialization_end_s, now);
}

}  // namespace tileflight::odometry
