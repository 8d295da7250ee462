#include "tileflight/slam/odometry/frame_tracker.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/slam/odometry/stage_timer.h"
#include "tileflight/slam/tracking/relocalization.h"
#include "tileflight/slam/tracking/tracker.h"

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

}  // namespace

keyframes::RollingShutter FrameTracker::predict_rolling_shutter(const TrackingState& state,
                                                                const InputFrame& frame) const {
  const LastFrame& last = state.last;
  return keyframes::make_rolling_shutter(
      preprocessor_.readout_s(),
      {last.T_camera_map * state.reference.T_camera_map.inverse(), frame.time_s - last.time_s, last.T_last_before_last,
       state.failures.none() ? last.interval_s : 0.0});
}

/// Poses relative to the reference from which the alignment may begin, the best one first. What the readings of a
/// coupled unit say is better than that the motion goes on; without scale and velocity only their rotation is known.
std::vector<geometry::SE3> FrameTracker::hypotheses(const TrackingState& state, double time_s) const {
  const LastFrame& last = state.last;
  const geometry::SE3 T_last_reference = last.T_camera_map * state.reference.T_camera_map.inverse();
  const int turns = state.failures.none() ? 1 : 3;
  std::vector<geometry::SE3> poses = tracking::motion_hypotheses(T_last_reference, last.T_last_before_last, turns);
  if (guide_ == nullptr) return poses;
  if (const auto T_camera_map = guide_->predict(state, mapper_, time_s)) {
    const bool is_first = mapper_.inertial() != nullptr || !state.failures.none();
    poses.insert(poses.begin() + (is_first ? 0 : 1), *T_camera_map * state.reference.T_camera_map.inverse());
  }
  return poses;
}

tracking::ImageAlignment FrameTracker::best_alignment(const TrackingState& state, const keyframes::Pyramid& pyramid,
                                                      double time_s, const keyframes::RollingShutter& shutter) const {
  const LastFrame& last = state.last;
  const double accepted = options_.tracking.accept_ratio * (last.rmse > 0 ? last.rmse : options_.tracking.huber);
  tracking::ImageAlignment best;
  bool first = true;
  for (const geometry::SE3& pose : hypotheses(state, time_s)) {
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

void FrameTracker::track(TrackingState& state, const InputFrame& frame) {
  auto pyramid = time_stage(log_.cpu_time.preprocessing, [&] { return preprocessor_.make_pyramid(frame); });
  keyframes::RollingShutter shutter = predict_rolling_shutter(state, frame);
  const tracking::ImageAlignment alignment = time_stage(log_.cpu_time.tracking, [&] {
    tracking::ImageAlignment direct;
    if (!state.far_apart) direct = best_alignment(state, *pyramid, frame.time_s, shutter);
    if (direct.converged) return direct;
    std::optional<tracking::ImageAlignment> found = search_wide(state, *pyramid);
    if (!found) found = recover(state, *pyramid);
    if (found) shutter = {};  // no velocity is known
    return found.value_or(direct);
  });
  if (!alignment.converged) return fail(state, frame, alignment);
  follow(state, frame, std::move(pyramid), shutter, alignment);
}

/// Takes over an aligned image: as a keyframe if one is due, otherwise to trace the window's points in it.
void FrameTracker::follow(TrackingState& state, const InputFrame& frame,
                          std::shared_ptr<const keyframes::Pyramid> pyramid, const keyframes::RollingShutter& shutter,
                          const tracking::ImageAlignment& alignment) {
  state.last = next_last_frame(state, alignment, frame.time_s);
  state.failures = {};
  if (line_delay_ != nullptr) line_delay_->follow(state.last);
  if (state.reference.first_rmse <= 0) state.reference.first_rmse = state.last.rmse;
  const keyframes::AffineBrightness brightness =
      compose_brightness(state.reference.brightness, alignment.state.a, alignment.state.b);
  const bool is_keyframe = needs_keyframe(state, alignment);
  std::optional<InputFrame> global;  // the image rectified to a global shutter
  if (!shutter.is_global()) {
    const StageTimer clock(log_.cpu_time.preprocessing);
    const geometry::SE3& T_target_reference = alignment.state.T_target_reference;
    const keyframes::RowRectifier rectify = preprocessor_.make_rectifier(
        shutter.twist(T_target_reference), state.reference.pixels.levels[0], T_target_reference);
    pyramid = preprocessor_.rectify(*pyramid, rectify);
    if (is_keyframe) global = InputFrame{frame.index, frame.time_s, frame.exposure_ms, rectify(frame.image)};
  }
  time_stage(log_.cpu_time.focal_changes, [&] {
    const bool begins = log_.focal_changes.follow(frame.index, frame.time_s, pyramid, state.last.T_camera_map,
                                                  preprocessor_.lens().lenses[0], preprocessor_.lens().rays[0]);
    if (begins && !preprocessor_.stereo().empty())
      log_.focal_changes.set_other_views(
          preprocessor_.other_views(frame, *pyramid, log_.focal_changes.first_corners()));
  });
  if (is_keyframe) {
    make_keyframe(state, global ? *global : frame, std::move(pyramid), brightness, alignment);
  } else {
    log_.tracked.push_back(
        {frame.index, frame.time_s, state.reference.keyframe, alignment.state.T_target_reference, alignment});
    const StageTimer clock(log_.cpu_time.tracing);
    mapper_.trace(*pyramid, state.last.T_camera_map, brightness);
  }
}

/// Largest RMSE of an image that was searched for in a wide range, grey values.
double FrameTracker::accepted_rmse(const TrackingState& state) const {
  constexpr double kLargest = 2.0;  // relative to the last image's; chosen by hand
  const double lost = options_.tracking.lost_rmse;
  return state.last.rmse > 0.0 ? std::min(lost, kLargest * state.last.rmse) : lost;
}

/// Searches the image by features: in the reference, then in the other keyframes of the window, the newest first. The
/// one that it aligns to becomes the reference.
std::optional<tracking::ImageAlignment> FrameTracker::search_wide(TrackingState& state,
                                                                  const keyframes::Pyramid& pyramid) {
  WideSearch search(preprocessor_.lens(), pyramid);
  if (!search.shows_anything()) return std::nullopt;
  if (auto found = align_found(state, state.reference, pyramid, search)) return found;
  state.failures.motion_px = search.motion_px();
  for (int slot = mapper_.window().size() - 1; slot >= 0; --slot) {
    if (mapper_.window().keyframes[slot].id == state.reference.keyframe) continue;
    ReferenceKeyframe other = make_reference_keyframe(mapper_, preprocessor_.lens(), slot);
    const auto found = align_found(state, other, pyramid, search);
    if (!found) continue;
    state.reference = std::move(other);
    return found;
  }
  return std::nullopt;
}

/// Aligns the image to a keyframe from where its features are, if it stays there.
std::optional<tracking::ImageAlignment> FrameTracker::align_found(TrackingState& state,
                                                                  const ReferenceKeyframe& reference,
                                                                  const keyframes::Pyramid& pyramid,
                                                                  WideSearch& search) {
  const auto& window = mapper_.window().keyframes;
  const auto keyframe = std::ranges::find(window, reference.keyframe, &keyframes::Keyframe::id);
  if (keyframe == window.end()) return std::nullopt;
  const std::optional<WidePose> pose = search.find(*keyframe->pyramid, reference.pixels);
  if (!pose) return std::nullopt;
  const bool is_same = reference.keyframe == state.reference.keyframe;
  const tracking::ImageAlignmentState start{pose->T_target_reference, is_same ? state.last.a : 0.0,
                                            is_same ? state.last.b : 0.0};
  const tracking::ImageAlignment found =
      tracking::align_image(preprocessor_.lens(), reference.pixels, pyramid, start, options_.tracking);
  // Textures repeat (lines of a field, roofs): a wrong place has matches, too, but not the keyframe's grey values.
  const double accepted = std::max<double>(accepted_rmse(state), options_.tracking.huber);
  if (!found.converged || found.finest_rmse() > accepted || !search.supports(found.state.T_target_reference) ||
      tracking::correlation(preprocessor_.lens(), reference.pixels, pyramid, found.state.T_target_reference) <
          tracking::kMinCorrelation)
    return std::nullopt;
  const imaging::Camera& camera = preprocessor_.camera();
  state.far_apart = pose->motion_px > options_.window.keyframe_flow_share * (camera.width() + camera.height());
  return found;
}

/// Relocalizes on any keyframe of the window, which then becomes the reference.
std::optional<tracking::ImageAlignment> FrameTracker::recover(TrackingState& state, const keyframes::Pyramid& pyramid) {
  if (state.failures.none()) return std::nullopt;  // a single bad image is often followed by a good one
  std::vector<ReferenceKeyframe>& references = state.failures.recovery_references;
  if (references.empty()) {
    for (int slot = mapper_.window().size() - 1; slot >= 0; --slot)
      references.push_back(make_reference_keyframe(mapper_, preprocessor_.lens(), slot));
  }
  std::vector<tracking::TrackingReference> pixels;
  for (const ReferenceKeyframe& reference : references) pixels.push_back(reference.pixels);
  const std::optional<tracking::Relocalization> found =
      tracking::relocalize(preprocessor_.lens(), pixels, pyramid, accepted_rmse(state), options_.tracking);
  if (!found) return std::nullopt;
  ++log_.relocalizations;
  state.reference = references[found->keyframe];
  return found->alignment;
}

namespace {

/// Says by which measure an image does not align. One without contrast fits everything with a gain near zero, so its
/// residuals say nothing.
std::string failure_detail(const tracking::ImageAlignment& alignment, double max_log_gain) {
  if (std::abs(alignment.state.a) >= max_log_gain)
    return base::formatted("(their contrast is %.2g of the keyframe's, which leaves nothing to align)",
                           std::exp(alignment.state.a));
  const std::string rmse =
      std::isfinite(alignment.finest_rmse()) ? std::to_string(alignment.finest_rmse()).substr(0, 5) : "none";
  return "(RMSE " + rmse + " grey values, " + std::to_string(static_cast<int>(100 * alignment.inside_share)) +
         " % of its points in view)";
}

/// Returns the message for images far apart, whose features move by `motion_px`; 0: hardly any is found again.
std::string far_apart_detail(double motion_px) {
  return "(the images are too far apart: " +
         (motion_px > 0.0 ? "what is found again moves by " + base::formatted("%.0f", motion_px) + " pixels"
                          : std::string("hardly anything is found again")) +
         "; use images that overlap by 70 %, or --system colmap (in an experiment: odometry: {system: colmap}))";
}

}  // namespace

void FrameTracker::fail(TrackingState& state, const InputFrame& frame,
                        const tracking::ImageAlignment& alignment) const {
  Failures& failures = state.failures;
  if (failures.count++ == 0) failures.first = frame.index;
  failures.detail = state.far_apart ? far_apart_detail(failures.motion_px)
                                    : failure_detail(alignment, options_.tracking.max_log_gain);
  failures.reason = "tracking lost at frame " + std::to_string(frame.index) + ": " + std::to_string(failures.count) +
                    " consecutive frames do not align with the last keyframe " + failures.detail;
}

/// A map that began at one instant has the distances of static stereo alone, which may be off by a tenth where the
/// parallax between the cameras is weak: its first keyframes follow one another sooner, while the displacement by such
/// an error is still within the reach of the residuals.
bool FrameTracker::needs_keyframe(const TrackingState& state, const tracking::ImageAlignment& alignment) const {
  constexpr std::size_t kYoungMap = 4;  // keyframes
  constexpr double kSooner = 0.4;       // of the usual flow; both chosen by hand
  const mapping::TrackingChange change{
      tracking::optical_flow(preprocessor_.lens(), state.reference.pixels, alignment.state.T_target_reference),
      alignment.state.a, state.last.rmse, state.reference.first_rmse};
  const imaging::Camera& camera = preprocessor_.camera();
  if (mapper_.window().has_stereo() && mapper_.step_uncertainties().size() < kYoungMap) {
    keyframes::WindowOptions sooner = options_.window;
    sooner.keyframe_flow_share *= kSooner;
    return mapping::needs_keyframe(change, camera.width(), camera.height(), sooner);
  }
  return mapping::needs_keyframe(change, camera.width(), camera.height(), options_.window);
}

void FrameTracker::make_keyframe(TrackingState& state, const InputFrame& frame,
                                 std::shared_ptr<const keyframes::Pyramid> pyramid,
                                 const keyframes::AffineBrightness& brightness,
                                 const tracking::ImageAlignment& alignment) {
  const StageTimer clock(log_.cpu_time.keyframes);
  const auto knowledge =
      preprocessor_.is_brightness_known(frame) ? BrightnessKnowledge::kKnown : BrightnessKnowledge::kFree;
  mapping::KeyframeCandidate candidate = make_keyframe_candidate(
      frame, std::move(pyramid), state.last.T_camera_map, brightness, preprocessor_.brightness_prior(frame), knowledge);
  if (state.far_apart)
    candidate.known = known_pixels(preprocessor_.lens().lenses[0], state.reference.pixels.levels[0],
                                   alignment.state.T_target_reference);
  if (mapper_.window().has_stereo()) candidate.stereo = preprocessor_.stereo_pictures(frame);
  if (mapper_.inertial() != nullptr)
    candidate.readings = guide_->between(mapper_.window().keyframes.back().time_s, frame.time_s, mapper_);
  if (line_delay_ != nullptr) line_delay_->add_window(mapper_, preprocessor_.lens().lenses[0]);
  mapper_.add_keyframe(candidate);
  const int newest = mapper_.window().size() - 1;
  state.reference = make_reference_keyframe(mapper_, preprocessor_.lens(), newest);
  // The optimisation moved the keyframe slightly; the motion between the last two images is kept.
  state.last.T_camera_map = state.reference.T_camera_map;
  state.last.a = state.last.b = 0.0;
  log_.tracked.push_back({frame.index, frame.time_s, state.reference.keyframe, geometry::SE3(), alignment});
  if (line_delay_ != nullptr) line_delay_->add_keyframe(state.reference.keyframe);
  report_keyframe(frame, newest);
  if (guide_ != nullptr) guide_->update(log_, mapper_);
}

/// Shows a new keyframe to the observer and keeps its features for loop closure.
void FrameTracker::report_keyframe(const InputFrame& frame, int slot) {
  if (observer_) {
    KeyframeView view{frame.index, frame.image, {}};
    for (const tracking::ReferencePoint& point : mapper_.reference_points(slot))
      view.points.push_back({point.pixel.x(), point.pixel.y(), point.rho});
    observer_(view);
  }
  if (!options_.loops.enabled) return;
  const StageTimer clock(log_.cpu_time.loops);
  const keyframes::Keyframe& keyframe = mapper_.window().keyframes[slot];
  log_.loop_keyframes.push_back({.id = keyframe.id,
                                 .frame_index = keyframe.frame_index,
                                 .T_map_camera = {},
                                 .features = keyframes::find_features(*keyframe.pyramid, preprocessor_.lens(), {}),
                                 .image = loop_closure::keep_image(*keyframe.pyramid)});
}

}  // namespace tileflight::odometry
