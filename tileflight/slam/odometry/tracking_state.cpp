#include "tileflight/slam/odometry/tracking_state.h"

#include <cmath>

namespace tileflight::odometry {
namespace {

/// Information of the prior on (a, b): DSO, eq. 9. Only brightness differences are observable, so the first keyframe's
/// a, b are fixed; with calibration and exposure times all are nearly known; else they are free. DSO's implementation
/// has 1e14 for both of the first keyframe, 1e12 and 1e8 with a calibration, 0 without; the values here are chosen by
/// hand.
Eigen::Vector2d brightness_information(BrightnessKnowledge knowledge) {
  switch (knowledge) {
    case BrightnessKnowledge::kFixed:
      return {1e14, 1e8};
    case BrightnessKnowledge::kKnown:
      return {1e10, 1e6};
    case BrightnessKnowledge::kFree:
      break;
  }
  return {1e3, 1.0};
}

}  // namespace

ReferenceKeyframe make_reference_keyframe(const mapping::Mapper& mapper, const keyframes::LensPyramid& lens, int slot) {
  const keyframes::Keyframe& keyframe = mapper.window().keyframes[slot];
  return {keyframe.id, keyframe.T_camera_map(), keyframe.brightness(),
          tracking::make_tracking_reference(lens, *keyframe.pyramid, mapper.reference_points(slot)), 0.0};
}

std::vector<tracking::ReferencePoint> known_pixels(const keyframes::Lens& lens,
                                                   const tracking::ReferenceLevel& reference,
                                                   const geometry::SE3& T_target_reference) {
  const Eigen::Matrix3f R = T_target_reference.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f t = T_target_reference.translation.cast<float>();
  std::vector<tracking::ReferencePoint> known;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    const Eigen::Vector3f X = R * reference.ray_of(i) + reference.rho[i] * t;
    Eigen::Vector2f pixel;
    if (lens.project<float>(X, pixel)) known.push_back({pixel, reference.rho[i] / X.norm()});
  }
  return known;
}

mapping::KeyframeCandidate make_keyframe_candidate(const InputFrame& frame,
                                                   std::shared_ptr<const keyframes::Pyramid> pyramid,
                                                   const geometry::SE3& T_camera_map,
                                                   const keyframes::AffineBrightness& brightness,
                                                   const keyframes::AffineBrightness& brightness_prior,
                                                   BrightnessKnowledge knowledge) {
  return {frame.index,  frame.time_s, std::move(pyramid), &frame.image,
          T_camera_map, brightness,   brightness_prior,   brightness_information(knowledge)};
}

keyframes::AffineBrightness compose_brightness(const keyframes::AffineBrightness& reference, double a, double b) {
  return {reference.a + a, b + std::exp(a) * reference.b};
}

}  // namespace tileflight::odometry
