#include "tileflight/slam/keyframes/keyframe.h"

#include <cmath>

namespace tileflight::keyframes {

PairTransform pair_transform(const SE3& T_target_host, const AffineBrightness& host, const AffineBrightness& target) {
  const double gain = std::exp(target.a - host.a);
  PairTransform pair;
  pair.R = T_target_host.rotation.toRotationMatrix().cast<float>();
  pair.t = T_target_host.translation.cast<float>();
  pair.gain = static_cast<float>(gain);
  pair.offset = static_cast<float>(target.b - gain * host.b);
  return pair;
}

PairTransform stereo_transform(const Window& window, const Keyframe& keyframe, int camera) {
  return pair_transform(window.stereo_cameras[static_cast<std::size_t>(camera)].T_stereo_reference, {},
                        keyframe.stereo_brightness(camera));
}

}  // namespace tileflight::keyframes
