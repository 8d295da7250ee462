#include "tileflight/evaluation/localization/localizer.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::localization {
namespace {

using geometry::SE3;
using geometry::Vec3;
using geometry::Vec6;
using imaging::RgbImage;
using Mat12 = Eigen::Matrix<double, 12, 12>;
using Mat12x6 = Eigen::Matrix<double, 12, 6>;
using Vec12 = Eigen::Matrix<double, 12, 1>;

/// The change of a small motion's axes from the camera before a motion to the camera after it.
Mat6 adjoint_of_inverse(const SE3& motion) {
  const geometry::Mat3 R = motion.rotation.conjugate().toRotationMatrix();
  Mat6 adjoint = Mat6::Zero();
  adjoint.topLeftCorner<3, 3>() = R;
  adjoint.topRightCorner<3, 3>() = -R * geometry::skew(motion.translation);
  adjoint.bottomRightCorner<3, 3>() = R;
  return adjoint;
}

double position_sigma_m(const Mat6& covariance) {
  return std::sqrt(std::max(0.0, covariance.topLeftCorner<3, 3>().trace()));
}

}  // namespace

double LivePose::sigma_position_m() const { return position_sigma_m(covariance); }
double LivePose::sigma_rotation_rad() const {
  return std::sqrt(std::max(0.0, covariance.bottomRightCorner<3, 3>().trace()));
}

/// An extended Kalman filter of pose and velocity (twist in the camera's axes).
struct Localizer::Impl {
  LiveOptions options;
  PictureLocalizer localizer;
  std::optional<double> time_s;
  SE3 pose;
  Vec6 velocity = Vec6::Zero();
  Mat12 covariance = Mat12::Identity();
  Mat6 measured = Mat6::Zero();  ///< covariance of the last located image
  std::shared_ptr<const RenderedView> view;
  double usual_correlation = 0.0;  ///< of the latest located images
  std::size_t missed = 0;          ///< images since the last located one

  Impl(const scene::Scene& scene, const imaging::Camera& camera, const LiveOptions& o)
      : options(o), localizer(scene, camera, o.pictures) {}

  void predict(double dt_s, const std::optional<SE3>& known_motion) {
    const SE3 motion = known_motion.value_or(SE3::exp(dt_s * velocity));
    pose = pose * motion;
    Mat12 transition = Mat12::Identity();
    transition.topLeftCorner<6, 6>() = adjoint_of_inverse(motion);
    Mat12 noise = Mat12::Zero();
    Vec6 spread;
    if (known_motion) {
      constexpr double kLeast_m = 0.01, kLeast_rad = 0.1 * geometry::kRadiansPerDegree;
      const double turn_rad = geometry::so3_log(motion.rotation).norm();
      spread << Vec3::Constant(kLeast_m + options.motion_sigma * motion.translation.norm()),
          Vec3::Constant(kLeast_rad + options.motion_sigma * turn_rad);
      noise.topLeftCorner<6, 6>() = spread.cwiseAbs2().asDiagonal();
      velocity = motion.log() / dt_s;
    } else {
      transition.topRightCorner<6, 6>() = dt_s * Mat6::Identity();
      spread << Vec3::Constant(options.acceleration_m_s2), Vec3::Constant(options.turn_acceleration_rad_s2);
      Mat12x6 by_acceleration;
      by_acceleration << 0.5 * dt_s * dt_s * Mat6::Identity(), dt_s * Mat6::Identity();
      noise = by_acceleration * spread.cwiseAbs2().asDiagonal() * by_acceleration.transpose();
    }
    covariance = transition * covariance * transition.transpose() + noise;
  }

  void update(const LocalizationResult& found) {
    const SE3 apart = pose.inverse() * found.T_local_camera;
    Vec6 innovation;
    innovation << apart.translation, geometry::so3_log(apart.rotation);
    const Mat6 sum = covariance.topLeftCorner<6, 6>() + found.covariance;
    const Mat12x6 gain = sum.ldlt().solve(Mat12x6(covariance.leftCols<6>()).transpose()).transpose();
    const Vec12 change = gain * innovation;
    pose = pose * SE3(geometry::so3_exp(change.segment<3>(3)), change.head<3>());
    velocity += change.tail<6>();
    Mat12 left = Mat12::Identity();
    left.leftCols<6>() -= gain;
    covariance = left * covariance * left.transpose() + gain * found.covariance * gain.transpose();
    measured = found.covariance;
    constexpr double kNew = 0.2;
    usual_correlation =
        usual_correlation > 0.0 ? (1.0 - kNew) * usual_correlation + kNew * found.correlation : found.correlation;
    missed = 0;
  }

  /// Tells whether a result can be the camera's: near what is expected, and as similar as the images before.
  bool is_plausible(const LocalizationResult& found) const {
    constexpr double kAlike = 0.7, kSigmas = 5.0;
    if (found.correlation < kAlike * usual_correlation) return false;
    const SE3 apart = pose.inverse() * found.T_local_camera;
    Vec6 innovation;
    innovation << apart.translation, geometry::so3_log(apart.rotation);
    const Mat6 sum = covariance.topLeftCorner<6, 6>() + found.covariance;
    return innovation.dot(sum.ldlt().solve(innovation)) < 6.0 * kSigmas * kSigmas;
  }

  std::optional<LocalizationResult> find(const RgbImage& image) {
    if (view && localizer.image_motion(*view, view->T_local_camera, pose) < options.view_motion) {
      const auto found = localizer.align(image, *view, pose);
      if (found && is_plausible(*found)) return found;
    }
    if (auto found = find_near(image, pose)) return found;
    // Around the expected pose, ever further from it: on a spiral across the line of sight, and turned.
    for (int k = 0; missed > 0 && k < options.guesses; ++k) {
      const auto turn = static_cast<double>((missed - 1) * static_cast<std::size_t>(options.guesses) +
                                            static_cast<std::size_t>(k) + 1);
      constexpr double kGoldenAngle_rad = 2.39996;
      const double reach = position_sigma_m(covariance.topLeftCorner<6, 6>()) * std::min(1.5, 0.25 * std::sqrt(turn));
      const double angle = kGoldenAngle_rad * turn;
      const SE3 guess = pose * SE3(Eigen::Quaterniond::Identity(), reach * Vec3(std::cos(angle), std::sin(angle), 0.0));
      if (auto found = find_near(image, guess)) return found;
    }
    return std::nullopt;
  }

  /// Renders near the guess, and keeps the view if the image is found by it.
  std::optional<LocalizationResult> find_near(const RgbImage& image, const SE3& guess) {
    for (const double window : {options.pictures.narrow_window, options.pictures.wide_window}) {
      const auto rendered = localizer.render_view(guess, window);
      if (!rendered) return std::nullopt;
      auto found = localizer.align(image, *rendered, guess);
      if (!found || !is_plausible(*found)) continue;
      view = rendered;
      if (localizer.image_motion(*view, guess, found->T_local_camera) < 0.5 * options.view_motion) return found;
      // Far from the guess: again from there, where the rendering shows what the image shows.
      const auto nearer = localizer.render_view(found->T_local_camera, options.pictures.narrow_window);
      if (!nearer) return found;
      const auto refined = localizer.align(image, *nearer, found->T_local_camera);
      if (!refined || !is_plausible(*refined)) return found;
      view = nearer;
      return refined;
    }
    return std::nullopt;
  }
};

Localizer::Localizer(const scene::Scene& scene, const imaging::Camera& camera, const LiveOptions& options)
    : impl_(std::make_unique<Impl>(scene, camera, options)) {}

Localizer::~Localizer() = default;

void Localizer::start(const SE3& T_local_camera, double time_s, double sigma_m, double sigma_rad) {
  constexpr double kSpeed_m_s = 10.0, kTurnRate_rad_s = 1.0;
  Impl& my = *impl_;
  my.time_s = time_s;
  my.pose = T_local_camera;
  my.velocity.setZero();
  Vec12 sigmas;
  sigmas << Vec3::Constant(sigma_m), Vec3::Constant(sigma_rad), Vec3::Constant(kSpeed_m_s),
      Vec3::Constant(kTurnRate_rad_s);
  my.covariance = sigmas.cwiseAbs2().asDiagonal();
  my.measured.setZero();
  my.view.reset();
  my.usual_correlation = 0.0;
  my.missed = 0;
}

LivePose Localizer::add(const RgbImage& image, double time_s, const std::optional<SE3>& T_last_this) {
  Impl& my = *impl_;
  if (!my.time_s) throw InputError("localizer", "has no start: say where the camera is before the first image");
  if (!(time_s >= *my.time_s)) throw InputError("image", "is older than the one before it");
  if (time_s > *my.time_s) my.predict(time_s - *my.time_s, T_last_this);
  my.time_s = time_s;
  LivePose live;
  if (const auto found = my.find(image)) {
    my.update(*found);
    live.located = true;
    live.correlation = found->correlation;
  } else {
    ++my.missed;
  }
  live.T_local_camera = my.pose;
  // Errors of successive images are alike, since they show the same ground: the filter's own covariance, which takes
  // them as independent, would be too small.
  live.covariance = live.located ? my.measured : Mat6(my.covariance.topLeftCorner<6, 6>() + my.measured);
  live.lost = live.sigma_position_m() > my.options.lost_sigma_m;
  return live;
}

}  // namespace tileflight::localization
