#include "tileflight/photometry/keyframe.h"

#include <cmath>

namespace tileflight::photometry {

PairTransform pair_transform(const SE3& T_target_host, const AffineBrightness& host, const AffineBrightness& target) {
  const double gain = std::exp(target.a - host.a);
  PairTransform pair;
  pair.R = T_target_host.rotation.toRotationMatrix().cast<float>();
  pair.t = T_target_host.translation.cast<float>();
  pair.gain = static_cast<float>(gain);
  pair.offset = static_cast<float>(target.b - gain * host.b);
  return pair;
}

}  // namespace tileflight::photometry
