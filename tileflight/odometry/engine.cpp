#include "tileflight/odometry/engine.h"

#include <algorithm>
#include <cmath>

#include "tileflight/geometry/input_error.h"
#include "tileflight/odometry/motion_hypotheses.h"
#include "tileflight/odometry/relocalization.h"
#include "tileflight/odometry/stage_clock.h"
#include "tileflight/odometry/tracer.h"
#include "tileflight/odometry/valid_region.h"

namespace tileflight::odometry {
namespace {

/// Pictures of the start window that become keyframes: evenly in parallax, the first and the last among them.
std::vector<std::size_t> spread_over_parallax(const std::vector<double>& parallax, int wanted) {
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

/// Neighbouring residuals share their errors (of texture, sampling and known distances), so that many say less than
/// their number: standard deviations by the residuals' own curvature are too small by these factors. Medians over 45
/// flights of the proving ground (tests/proving_ground) against their true poses.
constexpr double kSharedInPosition = 2.2, kSharedInRotation = 2.7;

/// Standard deviations of a pose, by the covariance of a left twist.
void set_deviations(const Eigen::Matrix<double, 6, 6>& covariance, FrameQuality& quality) {
  quality.sigma_position = kSharedInPosition * std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  quality.sigma_rotation_rad = kSharedInRotation * std::sqrt(covariance.bottomRightCorner<3, 3>().trace());
}

/// What an alignment says of its picture.
void describe(const AlignmentResult& alignment, FrameQuality& quality) {
  if (alignment.rmse.empty()) return;
  quality.rmse = alignment.finest_rmse();
  quality.inside_share = alignment.inside_share;
  quality.saturated_share = alignment.saturated_share;
  const Eigen::Matrix<double, 8, 8> H = alignment.information;
  const Vec8 scale = (H.diagonal().array() + 1e-9).sqrt().inverse();
  Eigen::Matrix<double, 8, 8> A = scale.asDiagonal() * H * scale.asDiagonal();
  A.diagonal().array() += 1e-9;
  const Eigen::Matrix<double, 8, 8> covariance =
      scale.asDiagonal() * A.ldlt().solve(Eigen::Matrix<double, 8, 8>::Identity()) * scale.asDiagonal();
  set_deviations(quality.rmse * quality.rmse * covariance.topLeftCorner<6, 6>(), quality);
}

AffineLight composed(const AffineLight& reference, double a, double b) {
  return {reference.a + a, b + std::exp(a) * reference.b};
}

}  // namespace

Engine::Engine(const imaging::Calibration& calibration, const imaging::PhotometricCalibration* photometric,
               const OdometryOptions& options, const Aids& aids, KeyframeObserver observer)
    : calibration_(calibration),
      photometric_(photometric),
      options_(options),
      aids_(aids),
      observer_(std::move(observer)),
      lens_(build_lens_pyramid(calibration.camera,
                               pyramid_levels(calibration.camera.width(), calibration.camera.height(), options))),
      initializer_(lens_, options_.start),
      mapper_(lens_, options_) {}

void Engine::add(InputFrame frame) {
  ++frames_;
  given_.emplace_back(frame.index, frame.time_s);
  if (frame.image.width != calibration_.camera.width() || frame.image.height != calibration_.camera.height()) {
    throw InputError("frame " + std::to_string(frame.index),
                     "is " + std::to_string(frame.image.width) + "x" + std::to_string(frame.image.height) +
                         ", the calibration is for " + std::to_string(calibration_.camera.width()) + "x" +
                         std::to_string(calibration_.camera.height()) + "; use pictures and calibration of one size");
  }
  if (lost_) return;
  if (!region_found_) look_for_region(frame.image);
  if (started_) {
    track(frame);
  } else {
    wait_for_start(std::move(frame));
  }
}

std::string Engine::state() const {
  if (!started_) return "waiting for parallax";
  return std::to_string(mapper_.keyframes().size()) + " keyframes, " + std::to_string(mapper_.active_points()) +
         " active points, RMSE " + std::to_string(last_rmse_).substr(0, 4);
}

std::shared_ptr<const Pyramid> Engine::pyramid_of(const InputFrame& frame) {
  return pyramids_.make(frame.image, photometric_, static_cast<int>(lens_.lenses.size()));
}

RollingShutter Engine::shutter_of(const InputFrame& frame) const {
  const double readout_s = calibration_.line_delay_s * calibration_.camera.height();
  return rolling_shutter(readout_s, {T_last_map_ * reference_.T_camera_map.inverse(), frame.time_s - last_time_s_,
                                     T_last_before_last_, failures_ == 0 ? last_interval_s_ : 0.0});
}

RowRectifier Engine::rectifier(const geometry::Vec6& twist, const ReferenceLevel& reference,
                               const SE3& T_target_reference) const {
  return {lens_.lenses[0], calibration_.camera.width(), calibration_.camera.height(), twist,
          seen_from(lens_.lenses[0], T_target_reference, reference.ray, reference.rho, reference.size())};
}

AffineLight Engine::light_prior(const InputFrame& frame) const {
  return {photometric_ != nullptr && frame.exposure_ms > 0 ? std::log(frame.exposure_ms) : 0.0, 0.0};
}

KeyframeSource Engine::source_of(const InputFrame& frame, std::shared_ptr<const Pyramid> pyramid,
                                 const SE3& T_camera_map, const AffineLight& light) const {
  // Only differences of light are seen: the first keyframe's is fixed. With calibration and exposure, every one is
  // nearly known.
  const Eigen::Vector2d fixed(1e14, 1e8), known(1e10, 1e6), free(1e3, 1.0);
  KeyframeSource source{frame.index, frame.time_s, std::move(pyramid), &frame.image, T_camera_map, light, {}, {}};
  source.light_prior = light_prior(frame);
  const bool calibrated = photometric_ != nullptr && frame.exposure_ms > 0;
  source.light_information = !started_ ? fixed : (calibrated ? known : free);
  return source;
}

Engine::Reference Engine::reference_of(int slot) const {
  const Keyframe& keyframe = mapper_.window().keyframes[slot];
  return {keyframe.id, keyframe.T_camera_map(), keyframe.light(),
          make_reference(lens_, *keyframe.pyramid, mapper_.points_seen_by(slot)), 0.0};
}

void Engine::look_for_region(const imaging::RgbImage& picture) {
  keep_region(lens_, valid_region(picture, aids_.mask));
  region_found_ = !is_dark(picture);
}

void Engine::show(const InputFrame& frame, int slot) const {
  if (!observer_) return;
  KeyframeView view{frame.index, frame.image, {}};
  for (const ReferencePoint& point : mapper_.points_seen_by(slot)) {
    view.points.push_back({point.pixel.x(), point.pixel.y(), point.rho});
  }
  observer_(view);
}

std::optional<SE3> Engine::known_pose(const InputFrame& frame) const {
  return aids_.poses.empty() ? std::nullopt : geometry::interpolate(aids_.poses, frame.time_s);
}

// ---- start ----

void Engine::wait_for_start(InputFrame frame) {
  const StageClock clock(processor_time_.start);
  const auto pyramid = pyramid_of(frame);
  waiting_.push_back(std::move(frame));
  const std::optional<Start> start = initializer_.add(pyramid, known_pose(waiting_.back()));
  if (start) {
    begin(*start);
    return;
  }
  const auto limit = static_cast<std::size_t>(2 * options_.start.max_frames);
  while (waiting_.size() > limit && waiting_first_ < initializer_.first()) {
    waiting_.pop_front();
    ++waiting_first_;
  }
}

/// The pictures of a start as a global shutter would have taken them: from then on they are used as such.
void Engine::rectify_start(const Start& start) {
  const double readout_s = calibration_.line_delay_s * calibration_.camera.height();
  const std::size_t offset = start.first - waiting_first_, last = start.T_camera_first.size() - 1;
  if (readout_s == 0.0) return;
  ReferenceLevel corners;
  for (std::size_t i = 0; i < start.rho.size(); ++i) {
    const auto ray = lens_.lenses[0].unproject(start.pixels[i].cast<double>());
    if (ray) corners.add(start.pixels[i], ray->cast<float>(), start.rho[i], 0.0F);
  }
  for (std::size_t k = 0; k <= last; ++k) {
    const std::size_t before = k > 0 ? k - 1 : 0, after = std::min(k + 1, last);
    const double interval_s = waiting_[offset + after].time_s - waiting_[offset + before].time_s;
    if (interval_s == 0.0) continue;
    const SE3 motion = start.T_camera_first[after] * start.T_camera_first[before].inverse();
    imaging::RgbImage& image = waiting_[offset + k].image;
    image = rectifier(readout_s / interval_s * motion.log(), corners, start.T_camera_first[k])(image);
  }
}

void Engine::begin(const Start& start) {
  rectify_start(start);
  const std::vector<std::size_t> picks = spread_over_parallax(start.parallax_rad, options_.start.keyframes);
  mapper_.begin(keyframes_of_start(start, picks));
  started_ = true;
  align_earlier_frames(start.first - waiting_first_);
  align_start_frames(start, picks);
  const std::size_t offset = start.first - waiting_first_;
  for (std::size_t s = 0; s < picks.size(); ++s) {
    show(waiting_[offset + picks[s]], static_cast<int>(s));
    remember_corners(static_cast<int>(s));
  }
  start_time_s_ = waiting_[offset + picks.back()].time_s;
  waiting_.clear();
}

std::vector<Keyframe> Engine::keyframes_of_start(const Start& start, const std::vector<std::size_t>& picks) {
  const std::size_t offset = start.first - waiting_first_;
  std::vector<Keyframe> keyframes;
  TrackingReference corners;
  AlignmentState state;
  for (std::size_t k = 0; k < start.T_camera_first.size(); ++k) {
    const InputFrame& frame = waiting_[offset + k];
    const auto pyramid = pyramid_of(frame);
    AffineLight light = light_prior(frame);
    const AffineLight first_light = keyframes.empty() ? light : keyframes.front().light();
    if (k == 0) {
      std::vector<ReferencePoint> points;
      for (std::size_t i = 0; i < start.rho.size(); ++i) points.push_back({start.pixels[i], start.rho[i], 1.0F});
      corners = make_reference(lens_, *pyramid, points);
    } else {
      state.T_target_reference = start.T_camera_first[k];
      const AlignmentResult alignment = align(lens_, corners, *pyramid, state, options_.tracking);
      if (alignment.converged) state.a = alignment.state.a, state.b = alignment.state.b;
      light = composed(first_light, state.a, state.b);
    }
    for (Keyframe& keyframe : keyframes) {
      const PairTransform pair =
          pair_transform(start.T_camera_first[k] * keyframe.T_camera_map_linear.inverse(), keyframe.light(), light);
      trace_points(lens_.lenses[0], pyramid->levels[0], pair, options_.tracing, options_.window.huber,
                   keyframe.immature);
    }
    if (std::find(picks.begin(), picks.end(), k) == picks.end()) continue;
    KeyframeSource source = source_of(frame, pyramid, start.T_camera_first[k], light);
    if (!keyframes.empty()) source.light_information = {1e3, 1.0};
    keyframes.push_back(mapper_.make_keyframe(source));
  }
  return keyframes;
}

void Engine::align_earlier_frames(std::size_t count) {
  if (count == 0) return;
  const Reference reference = reference_of(0);
  std::vector<std::pair<std::size_t, AlignmentResult>> found;
  AlignmentState state;
  SE3 velocity;
  double velocity_s = 0.0;  // its interval
  for (std::size_t i = count; i-- > 0;) {
    AlignmentState guess = state;
    guess.T_target_reference = velocity * state.T_target_reference;
    const auto pyramid = pyramid_of(waiting_[i]);
    const double interval_s = waiting_[i].time_s - waiting_[i + 1].time_s;
    const RollingShutter shutter = rolling_shutter(calibration_.line_delay_s * calibration_.camera.height(),
                                                   {state.T_target_reference, interval_s, velocity, velocity_s});
    AlignmentResult alignment = align(lens_, reference.pixels, *pyramid, guess, options_.tracking, {}, 0, shutter);
    if (!alignment.converged) break;
    velocity_s = interval_s;
    velocity = alignment.state.T_target_reference * state.T_target_reference.inverse();
    state = alignment.state;
    found.emplace_back(i, alignment);
  }
  std::reverse(found.begin(), found.end());
  for (const auto& [i, alignment] : found)
    record(waiting_[i], reference, alignment.state.T_target_reference, alignment);
}

void Engine::align_start_frames(const Start& start, const std::vector<std::size_t>& picks) {
  const std::size_t offset = start.first - waiting_first_;
  AlignmentState state;
  for (std::size_t s = 0; s < picks.size(); ++s) {
    const Reference reference = reference_of(static_cast<int>(s));
    record(waiting_[offset + picks[s]], reference, SE3(), {});
    const std::size_t end = s + 1 < picks.size() ? picks[s + 1] : picks[s];
    state.a = state.b = 0.0;
    for (std::size_t k = picks[s] + 1; k < end; ++k) {
      state.T_target_reference = start.T_camera_first[k] * start.T_camera_first[picks[s]].inverse();
      const auto pyramid = pyramid_of(waiting_[offset + k]);
      const AlignmentResult alignment = align(lens_, reference.pixels, *pyramid, state, options_.tracking);
      if (alignment.converged) {
        state = alignment.state;
        last_rmse_ = alignment.finest_rmse();
        record(waiting_[offset + k], reference, alignment.state.T_target_reference, alignment);
      }
    }
    if (s + 1 == picks.size()) reference_ = reference;
  }
  T_last_map_ = reference_.T_camera_map;
  const TrackedFrame& before = tracked_[tracked_.size() - 2];
  for (const Keyframe& keyframe : mapper_.window().keyframes) {
    if (keyframe.id == before.keyframe)
      T_last_before_last_ = T_last_map_ * (before.T_camera_keyframe * keyframe.T_camera_map()).inverse();
  }
  last_a_ = last_b_ = 0.0;
  last_time_s_ = tracked_.back().time_s;
  last_interval_s_ = last_time_s_ - before.time_s;
}

// ---- tracking ----

AlignmentResult Engine::best_alignment(const Pyramid& pyramid, const RollingShutter& shutter) const {
  const SE3 T_last_reference = T_last_map_ * reference_.T_camera_map.inverse();
  const int turns = failures_ == 0 ? 1 : 3;
  AlignmentResult best;
  bool first = true;
  for (const SE3& pose : motion_hypotheses(T_last_reference, T_last_before_last_, turns)) {
    const AlignmentState start{pose, last_a_, last_b_};
    const AlignmentResult result = align(lens_, reference_.pixels, pyramid, start, options_.tracking,
                                         best.converged ? best.rmse : std::vector<double>{}, 0, shutter);
    const bool better = result.finest_rmse() < best.finest_rmse() && result.converged >= best.converged;
    if (first || better) best = result;
    first = false;
    const double accepted = options_.tracking.accept_ratio * (last_rmse_ > 0 ? last_rmse_ : options_.tracking.huber);
    if (best.converged && best.finest_rmse() < accepted) break;
  }
  return best;
}

void Engine::track(const InputFrame& frame) {
  auto pyramid = timed(processor_time_.pictures, [&] { return pyramid_of(frame); });
  RollingShutter shutter = shutter_of(frame);
  AlignmentResult alignment = timed(processor_time_.tracking, [&] { return best_alignment(*pyramid, shutter); });
  if (!alignment.converged) {
    const auto found = timed(processor_time_.tracking, [&] { return recover(*pyramid); });
    if (!found) {
      on_failure(frame, alignment);
      return;
    }
    alignment = *found;
    shutter = {};  // relocalisation knows no velocity
  }
  recovery_.clear();
  const SE3 T_camera_map = alignment.state.T_target_reference * reference_.T_camera_map;
  const AffineLight light = composed(reference_.light, alignment.state.a, alignment.state.b);
  T_last_before_last_ = failures_ == 0 ? T_camera_map * T_last_map_.inverse() : SE3();
  T_last_map_ = T_camera_map;
  last_interval_s_ = failures_ == 0 ? frame.time_s - last_time_s_ : 0.0;
  last_time_s_ = frame.time_s;
  last_a_ = alignment.state.a;
  last_b_ = alignment.state.b;
  last_rmse_ = alignment.finest_rmse();
  failures_ = 0;
  if (reference_.first_rmse <= 0) reference_.first_rmse = last_rmse_;
  const TrackingChange change{optical_flow(lens_, reference_.pixels, alignment.state.T_target_reference),
                              alignment.state.a, last_rmse_, reference_.first_rmse};
  const bool is_keyframe =
      needs_keyframe(change, calibration_.camera.width(), calibration_.camera.height(), options_.window);
  std::optional<InputFrame> global;  // as a global shutter would have taken it
  if (!shutter.is_global()) {
    const StageClock clock(processor_time_.pictures);
    const SE3& T_target_reference = alignment.state.T_target_reference;
    const RowRectifier rectify =
        rectifier(shutter.twist(T_target_reference), reference_.pixels.levels[0], T_target_reference);
    pyramid = pyramids_.make([&](imaging::FloatImage memory) { return rectify(pyramid->levels[0], std::move(memory)); },
                             static_cast<int>(lens_.lenses.size()));
    if (is_keyframe) global = InputFrame{frame.index, frame.time_s, frame.exposure_ms, rectify(frame.image)};
  }
  if (is_keyframe) {
    make_keyframe(global ? *global : frame, pyramid, T_camera_map, light, alignment);
  } else {
    record(frame, reference_, alignment.state.T_target_reference, alignment);
    const StageClock clock(processor_time_.tracing);
    mapper_.trace(*pyramid, T_camera_map, light);
  }
}

/// On any keyframe of the window, which then becomes the reference.
std::optional<AlignmentResult> Engine::recover(const Pyramid& pyramid) {
  constexpr double kAcceptedRmse = 2.0;     // of the last picture's
  if (failures_ == 0) return std::nullopt;  // one bad picture is often followed by a good one
  if (recovery_.empty()) {
    for (int slot = mapper_.window().size() - 1; slot >= 0; --slot) recovery_.push_back(reference_of(slot));
  }
  std::vector<TrackingReference> pixels;
  for (const Reference& reference : recovery_) pixels.push_back(reference.pixels);
  const double accepted = std::min(options_.tracking.lost_rmse, kAcceptedRmse * last_rmse_);
  const std::optional<Relocalization> found = relocalize(lens_, pixels, pyramid, accepted, options_.tracking);
  if (!found) return std::nullopt;
  ++recoveries_;
  reference_ = recovery_[found->keyframe];
  return found->alignment;
}

void Engine::make_keyframe(const InputFrame& frame, std::shared_ptr<const Pyramid> pyramid, const SE3& T_camera_map,
                           const AffineLight& light, const AlignmentResult& alignment) {
  const StageClock clock(processor_time_.keyframes);
  const SE3 T_last_before_last = T_last_before_last_;
  mapper_.add_keyframe(source_of(frame, std::move(pyramid), T_camera_map, light));
  reference_ = reference_of(mapper_.window().size() - 1);
  // The optimisation moved the keyframe a little; the motion between the last two pictures stays.
  T_last_map_ = reference_.T_camera_map;
  T_last_before_last_ = T_last_before_last;
  last_a_ = last_b_ = 0.0;
  record(frame, reference_, SE3(), alignment);
  show(frame, mapper_.window().size() - 1);
  remember_corners(mapper_.window().size() - 1);
}

void Engine::remember_corners(int slot) {
  if (!options_.loops.enabled) return;
  const StageClock clock(processor_time_.loops);
  const Keyframe& keyframe = mapper_.window().keyframes[slot];
  corners_.push_back({keyframe.id, keyframe.frame_index, {}, find_features(*keyframe.pyramid, lens_, {})});
}

void Engine::on_failure(const InputFrame& frame, const AlignmentResult& alignment) {
  ++failures_;
  lost_ = failures_ > options_.tracking.patience_frames;
  const std::string rmse =
      std::isfinite(alignment.finest_rmse()) ? std::to_string(alignment.finest_rmse()).substr(0, 5) : "none";
  lost_reason_ = "tracking lost at frame " + std::to_string(frame.index) + ": " + std::to_string(failures_) +
                 " pictures in a row do not align with the last keyframe (RMSE " + rmse + " grey values, " +
                 std::to_string(static_cast<int>(100 * alignment.inside_share)) + " % of its points in view)";
}

void Engine::record(const InputFrame& frame, const Reference& reference, const SE3& T_camera_reference,
                    AlignmentResult alignment) {
  tracked_.push_back({frame.index, frame.time_s, reference.keyframe, T_camera_reference, std::move(alignment)});
}

// ---- result ----

/// Moves keyframes and points; the scale of each keyframe, by id (empty where nothing was found).
std::map<int, double> Engine::close_loops(std::vector<KeyframeRecord>& keyframes, std::vector<MapPoint>& points,
                                          OdometryResult& result) const {
  const StageClock clock(result.processor_time.loops);
  std::vector<LoopKeyframe> seen = corners_;
  for (std::size_t k = 0; k < seen.size(); ++k) seen[k].T_map_camera = keyframes[k].T_map_camera;
  give_distances(lens_.lenses[0], points, seen);
  const std::vector<Loop> loops = find_loops(seen, options_.loops);
  if (loops.empty()) return {};
  const std::vector<geometry::Sim3> poses = closed_poses(seen, loops);
  std::map<int, double> scale;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    keyframes[k].T_map_camera = SE3(poses[k].rotation, poses[k].translation);
    scale[keyframes[k].id] = poses[k].scale;
  }
  rescale(scale, points);
  for (const Loop& loop : loops) {
    result.loops.push_back(
        {seen[loop.from].frame_index, seen[loop.to].frame_index, loop.T_from_to.scale, loop.inliers});
  }
  return scale;
}

std::vector<FrameQuality> Engine::quality() const {
  const std::vector<KeyframeRecord> keyframes = mapper_.keyframes();
  const std::vector<StepUncertainty>& steps = mapper_.steps();
  std::vector<double> log_scale_variance(steps.size(), 0.0);  // since the start
  for (std::size_t k = 1; k < steps.size(); ++k) log_scale_variance[k] = log_scale_variance[k - 1] + steps[k].log_scale;
  std::map<std::int64_t, const TrackedFrame*> tracked;
  for (const TrackedFrame& frame : tracked_) tracked[frame.index] = &frame;
  std::vector<FrameQuality> quality;
  for (const auto& [index, time_s] : given_) {
    FrameQuality q{.frame = index, .time_s = time_s};
    if (const auto found = tracked.find(index); found != tracked.end()) {
      const TrackedFrame& frame = *found->second;
      q.tracked = true;
      q.is_keyframe = keyframes[frame.keyframe].frame_index == index;
      q.keyframe = q.is_keyframe ? frame.keyframe - 1 : frame.keyframe;
      describe(frame.alignment, q);
      q.sigma_log_scale = kSharedInPosition * std::sqrt(log_scale_variance[frame.keyframe]);
      SE3 T_camera_keyframe = frame.T_camera_keyframe;
      if (q.is_keyframe && frame.keyframe > 0) {
        T_camera_keyframe = keyframes[frame.keyframe].T_map_camera.inverse() * keyframes[q.keyframe].T_map_camera;
        set_deviations(steps[frame.keyframe].pose, q);
      }
      q.known_points = steps[frame.keyframe].known_points;
      q.step = T_camera_keyframe.translation.norm();
    }
    quality.push_back(q);
  }
  return quality;
}

OdometryResult Engine::result() const {
  OdometryResult result;
  result.frames = frames_;
  result.frames_tracked = static_cast<std::int64_t>(tracked_.size());
  result.processor_time = processor_time_;
  result.recoveries = recoveries_;
  constexpr int kLostAtEnd = 5;  // pictures: the last ones failed, and none came after that could have been found again
  result.lost = lost_ || !started_ || failures_ >= kLostAtEnd;
  if (result.lost)
    result.lost_reason = started_ ? lost_reason_ : (frames_ == 0 ? "no pictures" : initializer_.reason());
  result.quality = quality();
  if (!started_) return result;
  std::vector<KeyframeRecord> keyframes = mapper_.keyframes();
  std::vector<MapPoint> points = mapper_.points();
  std::map<int, double> scale;
  if (options_.loops.enabled) scale = close_loops(keyframes, points, result);
  std::map<int, SE3> poses;
  std::vector<int> ids;
  for (const KeyframeRecord& keyframe : keyframes) {
    poses[keyframe.id] = keyframe.T_map_camera;
    result.keyframes.poses.push_back({keyframe.time_s, keyframe.T_map_camera});
    result.keyframe_frames.push_back(keyframe.frame_index);
    ids.push_back(keyframe.id);
  }
  for (const TrackedFrame& frame : tracked_) {
    SE3 T_keyframe_camera = frame.T_camera_keyframe.inverse();
    if (!scale.empty()) T_keyframe_camera.translation *= scale.at(frame.keyframe);
    result.trajectory.poses.push_back({frame.time_s, poses.at(frame.keyframe) * T_keyframe_camera});
  }
  result.pattern = mapper_.pattern().common();
  result.camera = moved(calibration_.camera, mapper_.lens_delta());
  result.map = make_cloud(points, poses, options_.map);
  result.map_keyframes = make_tracks(points, ids, options_.map);
  return result;
}

}  // namespace tileflight::odometry
