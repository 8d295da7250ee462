#include "tileflight/slam/odometry/initial_map.h"

#include <algorithm>

#include "tileflight/slam/mapping/tracer.h"

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

/// The steps from an initialization to a map, over what they share.
class InitialMapBuilder {
 public:
  InitialMapBuilder(const initialization::InitializationResult& start, InitializationState& state,
                    Preprocessor& preprocessor, mapping::Mapper& mapper, const keyframes::OdometryOptions& options)
      : start_(start),
        frames_(state.frames),
        offset_(state.reference_position(start)),
        picks_(select_by_parallax(start.parallax_rad, options.initialization.keyframes)),
        preprocessor_(preprocessor),
        mapper_(mapper),
        options_(options) {}

  InitialMap build() {
    rectify_frames();
    mapper_.initialize(make_keyframes());
    align_frames();
    set_last_frame();
    for (const std::size_t pick : picks_) map_.keyframes.push_back(offset_ + pick);
    map_.tracking.initialization_end_s = frames_[map_.keyframes.back()].time_s;
    map_.tracking.far_apart = start_.far_apart;
    return std::move(map_);
  }

 private:
  tracking::ReferenceLevel corners() const;
  void rectify_frames();
  std::vector<keyframes::Keyframe> make_keyframes();
  void align_frames();
  void set_last_frame();

  const InputFrame& frame(std::size_t k) const { return frames_[offset_ + k]; }
  ReferenceKeyframe reference_keyframe(std::size_t slot) const {
    return make_reference_keyframe(mapper_, preprocessor_.lens(), static_cast<int>(slot));
  }
  void record(const InputFrame& frame, const ReferenceKeyframe& reference, const geometry::SE3& T_camera_reference,
              const tracking::ImageAlignment& alignment) {
    map_.tracked.push_back({frame.index, frame.time_s, reference.keyframe, T_camera_reference, alignment});
  }

  const initialization::InitializationResult& start_;
  std::deque<InputFrame>& frames_;
  std::size_t offset_;              ///< of the initialization's reference image in frames_
  std::vector<std::size_t> picks_;  ///< images that become keyframes, counted from the reference image
  Preprocessor& preprocessor_;
  mapping::Mapper& mapper_;
  const keyframes::OdometryOptions& options_;
  InitialMap map_;
};

/// The corners of the first image with their inverse distances.
tracking::ReferenceLevel InitialMapBuilder::corners() const {
  tracking::ReferenceLevel corners;
  for (std::size_t i = 0; i < start_.rho.size(); ++i) {
    const auto ray = preprocessor_.lens().lenses[0].unproject(start_.pixels[i].cast<double>());
    if (ray) corners.add(start_.pixels[i], ray->cast<float>(), start_.rho[i], 0.0F);
  }
  return corners;
}

/// Rectifies the images of the initialization window to a global shutter; from then on they are used as global-shutter
/// images.
void InitialMapBuilder::rectify_frames() {
  if (preprocessor_.readout_s() == 0.0) return;
  const std::size_t last = start_.T_camera_first.size() - 1;
  const tracking::ReferenceLevel corners = this->corners();
  for (std::size_t k = 0; k <= last; ++k) {
    const std::size_t before = k > 0 ? k - 1 : 0, after = std::min(k + 1, last);
    const double interval_s = frame(after).time_s - frame(before).time_s;
    if (interval_s == 0.0) continue;
    const geometry::SE3 motion = start_.T_camera_first[after] * start_.T_camera_first[before].inverse();
    imaging::RgbImage& image = frames_[offset_ + k].image;
    image = preprocessor_.make_rectifier(preprocessor_.readout_s() / interval_s * motion.log(), corners,
                                         start_.T_camera_first[k])(image);
  }
}

/// The picked images as keyframes whose points are traced through all images of the initialization window.
std::vector<keyframes::Keyframe> InitialMapBuilder::make_keyframes() {
  const keyframes::LensPyramid& lens = preprocessor_.lens();
  std::vector<keyframes::Keyframe> keyframes;
  tracking::TrackingReference corners;
  tracking::ImageAlignmentState state;
  for (std::size_t k = 0; k < start_.T_camera_first.size(); ++k) {
    const auto pyramid = preprocessor_.make_pyramid(frame(k));
    const keyframes::AffineBrightness prior = preprocessor_.brightness_prior(frame(k));
    keyframes::AffineBrightness brightness = prior;
    if (k == 0) {
      std::vector<tracking::ReferencePoint> points;
      for (std::size_t i = 0; i < start_.rho.size(); ++i) points.push_back({start_.pixels[i], start_.rho[i], 1.0F});
      corners = tracking::make_tracking_reference(lens, *pyramid, points);
    } else {
      state.T_target_reference = start_.T_camera_first[k];
      const tracking::ImageAlignment alignment =
          tracking::align_image(lens, corners, *pyramid, state, options_.tracking);
      if (alignment.converged) state.a = alignment.state.a, state.b = alignment.state.b;
      brightness = compose_brightness(keyframes.front().brightness(), state.a, state.b);
    }
    for (keyframes::Keyframe& keyframe : keyframes) {
      const keyframes::PairTransform pair = keyframes::pair_transform(
          start_.T_camera_first[k] * keyframe.T_camera_map_linear.inverse(), keyframe.brightness(), brightness);
      mapping::trace_points(lens.lenses[0], pyramid->levels[0], pair, options_.tracing, options_.window.huber,
                            keyframe.immature);
    }
    if (std::find(picks_.begin(), picks_.end(), k) == picks_.end()) continue;
    const auto knowledge = keyframes.empty() ? BrightnessKnowledge::kFixed : BrightnessKnowledge::kFree;
    mapping::KeyframeCandidate candidate =
        make_keyframe_candidate(frame(k), pyramid, start_.T_camera_first[k], brightness, prior, knowledge);
    if (start_.far_apart) candidate.known = known_pixels(lens.lenses[0], this->corners(), start_.T_camera_first[k]);
    keyframes.push_back(mapper_.make_keyframe(candidate));
  }
  return keyframes;
}

/// Aligns the images of the initialization window to the keyframe before each.
void InitialMapBuilder::align_frames() {
  tracking::ImageAlignmentState state;
  for (std::size_t s = 0; s < picks_.size(); ++s) {
    ReferenceKeyframe reference = reference_keyframe(s);
    record(frame(picks_[s]), reference, geometry::SE3(), {});
    const std::size_t end = s + 1 < picks_.size() ? picks_[s + 1] : picks_[s];
    state.a = state.b = 0.0;
    for (std::size_t k = picks_[s] + 1; k < end; ++k) {
      state.T_target_reference = start_.T_camera_first[k] * start_.T_camera_first[picks_[s]].inverse();
      const auto pyramid = preprocessor_.make_pyramid(frame(k));
      const tracking::ImageAlignment alignment =
          tracking::align_image(preprocessor_.lens(), reference.pixels, *pyramid, state, options_.tracking);
      if (alignment.converged) {
        state = alignment.state;
        map_.tracking.last.rmse = alignment.finest_rmse();
        record(frame(k), reference, alignment.state.T_target_reference, alignment);
      }
    }
    if (s + 1 == picks_.size()) map_.tracking.reference = std::move(reference);
  }
}

/// The last image is the newest keyframe.
void InitialMapBuilder::set_last_frame() {
  LastFrame& last = map_.tracking.last;
  last.T_camera_map = map_.tracking.reference.T_camera_map;
  last.time_s = map_.tracked.back().time_s;
  const TrackedFrame& before = map_.tracked[map_.tracked.size() - 2];
  for (const keyframes::Keyframe& keyframe : mapper_.window().keyframes) {
    if (keyframe.id == before.keyframe)
      last.T_last_before_last = last.T_camera_map * (before.T_camera_keyframe * keyframe.T_camera_map()).inverse();
  }
  last.interval_s = last.time_s - before.time_s;
}

}  // namespace

void InitializationState::drop_unneeded(double limit_mb) {
  const auto kept_mb = [&] {  // all have one size
    std::size_t pixels = frames.front().image.pixels.size();
    for (const OtherImage& other : frames.front().others) pixels += other.image.pixels.size();
    return 1e-6 * static_cast<double>(frames.size() * pixels * sizeof(imaging::Rgb8));
  };
  while (first < initializer.first_frame() && kept_mb() > limit_mb) {
    frames.pop_front();
    ++first;
  }
}

std::optional<InitialMap> make_stereo_map(const InitializationState& state,
                                          const std::shared_ptr<const keyframes::Pyramid>& pyramid,
                                          Preprocessor& preprocessor, mapping::Mapper& mapper) {
  const InputFrame& frame = state.frames.back();
  const keyframes::AffineBrightness prior = preprocessor.brightness_prior(frame);
  mapping::KeyframeCandidate candidate =
      make_keyframe_candidate(frame, pyramid, geometry::SE3(), prior, prior, BrightnessKnowledge::kFixed);
  candidate.stereo = preprocessor.stereo_pictures(frame);
  const bool sees = std::ranges::any_of(candidate.stereo, [](const auto& p) { return p.pyramid != nullptr; });
  if (!sees || !mapper.start(candidate)) return std::nullopt;
  InitialMap map;
  map.keyframes = {state.frames.size() - 1};
  map.tracking.initialization_end_s = frame.time_s;
  map.tracking.reference = make_reference_keyframe(mapper, preprocessor.lens(), 0);
  map.tracking.last.T_camera_map = map.tracking.reference.T_camera_map;
  map.tracking.last.time_s = frame.time_s;
  map.tracked.push_back({frame.index, frame.time_s, map.tracking.reference.keyframe, geometry::SE3(), {}});
  return map;
}

InitialMap make_initial_map(const initialization::InitializationResult& start, InitializationState& state,
                            Preprocessor& preprocessor, mapping::Mapper& mapper,
                            const keyframes::OdometryOptions& options) {
  return InitialMapBuilder(start, state, preprocessor, mapper, options).build();
}

}  // namespace tileflight::odometry
