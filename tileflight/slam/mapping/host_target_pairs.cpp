#include "tileflight/slam/mapping/host_target_pairs.h"

#include <cmath>

namespace tileflight::mapping {

Eigen::Matrix<double, 6, 6> adjoint(const geometry::SE3& T) {
  const geometry::Mat3 R = T.rotation.toRotationMatrix();
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
  A.topLeftCorner<3, 3>() = R;
  A.bottomRightCorner<3, 3>() = R;
  A.topRightCorner<3, 3>() = geometry::skew(T.translation) * R;
  return A;
}

std::vector<HostTargetPair> make_host_target_pairs(const keyframes::Window& window) {
  const int n = window.size();
  std::vector<geometry::SE3> poses, inverses;
  for (const keyframes::Keyframe& keyframe : window.keyframes) {
    poses.push_back(keyframe.T_camera_map());
    inverses.push_back(poses.back().inverse());
  }
  std::vector<HostTargetPair> pairs(static_cast<std::size_t>(n) * n);
  for (int h = 0; h < n; ++h) {
    const keyframes::Keyframe& host = window.keyframes[h];
    for (int t = 0; t < n; ++t) {
      if (h == t) continue;
      const keyframes::Keyframe& target = window.keyframes[t];
      HostTargetPair& pair = pairs[h * n + t];
      pair.frame.current = keyframes::pair_transform(poses[t] * inverses[h], host.brightness(), target.brightness());
      // First-estimate Jacobians (DSO, section 2.3, below eq. 13): derivatives at the linearisation points. The
      // relative pose is eq. 6, the gain that of eq. 4, whose exposure times are contained in the prior means of a.
      const geometry::SE3 T_linear = target.T_camera_map_linear * host.T_camera_map_linear.inverse();
      const double gain = std::exp(target.brightness_linear.a - host.brightness_linear.a);
      pair.frame.R_linear = T_linear.rotation.toRotationMatrix().cast<float>();
      pair.frame.t_linear = T_linear.translation.cast<float>();
      pair.frame.gain_linear = static_cast<float>(gain);
      pair.frame.host_b_linear = static_cast<float>(host.brightness_linear.b);
      pair.d_relative_d_host.topLeftCorner<6, 6>() = -adjoint(T_linear);
      pair.d_relative_d_host(6, 6) = -1.0;
      pair.d_relative_d_host(7, 7) = -gain;
    }
  }
  return pairs;
}

std::vector<keyframes::HostTargetPrecalc> make_stereo_pairs(const keyframes::Window& window) {
  const std::size_t cameras = window.stereo_cameras.size();
  std::vector<keyframes::HostTargetPrecalc> pairs(cameras * window.keyframes.size());
  for (std::size_t h = 0; h < window.keyframes.size(); ++h) {
    const keyframes::Keyframe& host = window.keyframes[h];
    for (std::size_t c = 0; c < host.stereo.size(); ++c) {
      keyframes::HostTargetPrecalc& pair = pairs[h * cameras + c];
      pair.current = keyframes::stereo_transform(window, host, static_cast<int>(c));
      pair.R_linear = pair.current.R;
      pair.t_linear = pair.current.t;
      pair.gain_linear = static_cast<float>(std::exp(host.stereo[c].brightness_linear.a));
    }
  }
  return pairs;
}

}  // namespace tileflight::mapping
