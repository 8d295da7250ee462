#include "tileflight/slam/odometry/odometry_pipeline.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/odometry/backward_tracking.h"
#include "tileflight/slam/odometry/prior_alignment.h"
#include "tileflight/slam/odometry/stage_timer.h"
#include "tileflight/slam/odometry/stereo_input.h"

namespace tileflight::odometry {
namespace {

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
void require_one_scale(const OdometryInput& input, bool has_prior_pose) {
  if (input.inertial && (has_prior_pose || !input.poses.empty() || input.depth_m))
    throw InputError("odometry",
                     "poses or depth and an inertial unit are both given; scale and frame come from one of them");
}

/// With an inertial unit the intrinsics are held: estimated anew at each keyframe they bend the path by hundredths of a
/// degree that no covariance of a step knows, and gravity turns these into accelerations. With a rig, which decides on
/// the scale, its calibration is held as well.
OdometryOptions options_with(OdometryOptions options, const OdometryInput& input) {
  if (input.inertial) options.window.refine_intrinsics = false;
  if (input.other_cameras.empty()) return options;
  if (!input.poses.empty() || input.depth_m)
    throw InputError("odometry", "other cameras and poses or depth are given; scale and frame come from one of them");
  options.window.refine_intrinsics = false;
  return options;
}

bool is_finite(const geometry::SE3& T) { return T.translation.allFinite() && T.rotation.coeffs().allFinite(); }

}  // namespace

OdometryPipeline::OdometryPipeline(OdometryInput input, const OdometryOptions& options)
    : options_(options_with(options, input)),
      input_(std::move(input)),
      priors_given_at_once_(!input_.poses.empty()),
      preprocessor_(input_.calibration, std::move(input_.photometric), std::move(input_.mask), options_,
                    std::move(input_.other_cameras)),
      mapper_(preprocessor_.lens(), options_, preprocessor_.stereo().stereo_cameras()),
      state_(InitializationState{initialization::Initializer(preprocessor_.lens(), options_.initialization), {}, 0}) {
  require_one_scale(input_, false);
  if (input_.inertial) guide_.emplace(*input_.inertial, options_.inertial_in_window);
  if (!preprocessor_.stereo().empty() && input_.calibration.line_delay_s != 0.0)
    throw InputError(
        "odometry",
        "the camera has a rolling shutter (line_delay), which static stereo does not correct; use it alone");
  if (!preprocessor_.stereo().empty() && options_.estimate_line_delay)
    throw InputError("odometry",
                     "static stereo does not correct a rolling shutter; estimate its line delay with one "
                     "camera alone");
  if (options_.estimate_line_delay) line_delay_.emplace();
  log_.other_images.resize(preprocessor_.stereo().cameras().size());
}

FrameResult OdometryPipeline::add(InputFrame frame, const std::optional<geometry::SE3>& T_world_camera) {
  require_usable(frame, T_world_camera);
  const FrameStamp stamp{frame.index, frame.time_s};
  if (lost()) return frame_result(stamp);
  preprocessor_.find_valid_region(frame.image);
  inspect_other_images(frame);
  log_.read.push_back(stamp);
  if (auto* const tracking = std::get_if<TrackingState>(&state_)) {
    tracker().track(*tracking, frame);
  } else {
    if (T_world_camera) input_.poses.poses.push_back({frame.time_s, *T_world_camera});
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
  preprocessor_.stereo().require_usable(frame);
  if (!T_world_camera) return;
  if (!preprocessor_.stereo().empty())
    throw InputError(where, "has a prior pose, but the scale comes from the rig's cameras; give one of them");
  if (priors_given_at_once_)
    throw InputError(where, "has a prior pose, but all prior poses were given at the start; give them in one way");
  require_one_scale(input_, true);
  if (!is_finite(*T_world_camera)) throw InputError(where, "its prior pose is not finite");
}

void OdometryPipeline::inspect_other_images(const InputFrame& frame) {
  constexpr int kChecks = 3, kInterval = 10;  // images with something in them, from one check to the next
  for (std::size_t c = 0; c < log_.other_images.size(); ++c) {
    OtherImageCount& count = log_.other_images[c];
    ++count.since_last;
    if (c >= frame.others.size() || frame.others[c].image.empty()) continue;
    ++count.frames;
    count.last = frame.index;
    count.since_last = 0;
    if (is_blind(frame.others[c].image)) {
      ++count.blind;
    } else if (count.checks < kChecks && (count.frames - count.blind - 1) % kInterval == 0) {
      ++count.checks;
      check_other_image(frame, c);
    }
  }
}

void OdometryPipeline::check_other_image(const InputFrame& frame, std::size_t camera) {
  const std::vector<keyframes::StereoPicture> pictures = preprocessor_.stereo_pictures(frame);
  const auto fit = check_rig(preprocessor_.lens(), *preprocessor_.make_pyramid(frame),
                             preprocessor_.stereo().stereo_cameras()[camera], pictures[camera].pyramid->levels[0]);
  if (fit) log_.other_images[camera].fits.push_back(*fit);
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
  return input_.poses.empty() ? std::nullopt : geometry::interpolate(input_.poses, frame.time_s);
}

// ---- initializing ----

void OdometryPipeline::initialize(InitializationState& state, InputFrame frame) {
  const StageTimer clock(log_.cpu_time.initialization);
  state.frames.push_back(std::move(frame));
  std::optional<InitialMap> map = find_initial_map(state);
  if (!map) {
    state.drop_unneeded(options_.initialization.buffer_mb);
    return;
  }
  log_.tracked = std::move(map->tracked);
  if (line_delay_) line_delay_->begin(log_.tracked, mapper_);
  for (std::size_t slot = 0; slot < map->keyframes.size(); ++slot)
    tracker().report_keyframe(state.frames[map->keyframes[slot]], static_cast<int>(slot));
  track_backwards(state.frames, map->keyframes.front(), options_, preprocessor_, mapper_, input_.keyframe_observer,
                  map->tracking.far_apart, log_);
  const std::deque<InputFrame> frames = std::move(state.frames);
  TrackingState& tracking = state_.emplace<TrackingState>(std::move(map->tracking));
  for (std::size_t i = map->keyframes.back() + 1; i < frames.size(); ++i) tracker().track(tracking, frames[i]);
}

std::optional<InitialMap> OdometryPipeline::find_initial_map(InitializationState& state) {
  const auto pyramid = preprocessor_.make_pyramid(state.frames.back());
  const bool may_begin = log_.read.size() > options_.initialization.first_image;
  if (mapper_.window().has_stereo() && may_begin) {
    std::optional<InitialMap> map = make_stereo_map(state, pyramid, preprocessor_, mapper_);
    if (map) return map;
  }
  const std::optional<initialization::InitializationResult> start =
      state.initializer.add(pyramid, prior_pose(state.frames.back()));
  if (!start) return std::nullopt;
  mapper_.use_no_stereo();                                                  // the map has a scale of its own
  if (start->far_apart) options_ = options_for_images_far_apart(options_);  // all stages refer to them
  return make_initial_map(*start, state, preprocessor_, mapper_, options_);
}

// ---- result ----

StereoResult OdometryPipeline::stereo_result() const {
  StereoResult result{.metric = std::holds_alternative<TrackingState>(state_) && mapper_.window().has_stereo()};
  const std::vector<OtherCamera>& cameras = preprocessor_.stereo().cameras();
  const auto median_fit = [](std::vector<RigFit> fits) {
    std::ranges::sort(fits, {}, &RigFit::rotation_rad);
    return fits.empty() ? std::nullopt : std::optional(fits[fits.size() / 2]);
  };
  const std::vector<std::vector<RigTurnFit>> turns = log_.focal_changes.rig_turns();
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const mapping::StereoRecord& record = mapper_.stereo_records()[c];
    result.cameras.push_back(
        {.name = cameras[c].name,
         .frames = log_.other_images[c].frames,
         .frames_blind = log_.other_images[c].blind,
         .keyframes = record.keyframes,
         .keyframes_unmatched = record.unmatched,
         .matched_share =
             record.searched > 0 ? static_cast<double>(record.found) / static_cast<double>(record.searched) : 0.0,
         .last_frame = log_.other_images[c].last,
         .frames_after_last = log_.other_images[c].since_last,
         .fit = median_fit(log_.other_images[c].fits),
         .turn = c < turns.size() ? join_rig_turns(turns[c]) : std::nullopt});
  }
  return result;
}

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
            : (result.frames == 0 ? "no images" : std::get<InitializationState>(state_).initializer.failure_reason());
  if (result.lost && state != nullptr) {
    result.lost_since = state->failures.first;
    result.lost_detail = state->failures.detail;
  }
  if (!preprocessor_.stereo().empty()) result.stereo = stereo_result();
  result.quality = frame_qualities(log_, mapper_);
  if (state == nullptr) return result;
  result.frames_tracked_backwards = log_.earlier.frames_tracked;
  result.frames_before_start = frames_before(mapper_.keyframes().front().time_s, log_);
  set_path_and_map(log_, mapper_, preprocessor_.lens(), options_, input_.inertial, result);
  if (guide_) result.coupled_since_s = guide_->coupled_since_s();
  result.systematic_displacement = mapper_.systematic_residuals().estimate();
  result.focal_segments = log_.focal_changes.segments();
  if (line_delay_) result.line_delay = line_delay_->estimate(mapper_);
  result.camera = keyframes::apply_delta(preprocessor_.camera(), mapper_.intrinsics_delta());
  return result;
}

OdometryResult OdometryPipeline::result() const {
  OdometryResult result = result_in_map_frame();
  if (const auto* const state = std::get_if<TrackingState>(&state_))
    apply_priors(preprocessor_.camera(), input_, state->initialization_end_s, result);
  return result;
}

std::optional<geometry::Sim3> OdometryPipeline::T_world_map() const {
  const auto* const state = std::get_if<TrackingState>(&state_);
  if (state == nullptr) return std::nullopt;
  OdometryOptions options = options_;
  options.loops.enabled = false;
  OdometryResult now;
  set_path_and_map(log_, mapper_, preprocessor_.lens(), options, {}, now);
  return find_T_world_map(preprocessor_.camera(), input_, state->initialization_end_s, now);
}

}  // namespace tileflight::odometry
