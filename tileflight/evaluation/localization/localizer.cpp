#include "tileflight/evaluation/localization/localizer.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/inertial/preintegration.h"

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

  std::vector<geometry::ImuSample> readings;  ///< since the last image, and the one before it
  bool is_at_rest = false;                    ///< since the start
  double noise2 = 1.0;                        ///< squared error of located poses over what their covariances state
  double nearest_chi2 = 0.0;                  ///< of the present image's results, the one that deviates least; 0: none
  bool is_trusted = false;                    ///< images of late confirm each other
  bool was_trusted = false;                   ///< at any time since the start
  std::optional<Vec3> last_offset;            ///< of the image found last from the prediction, where it is not trusted
  double last_sigma_m = 0.0;                  ///< of it
  int confirmations = 0;                      ///< images in a row with that offset

  Impl(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance, const imaging::Camera& camera,
       const LiveOptions& o)
      : options(o), localizer(scene, std::move(appearance), camera, o.pictures) {}

  /// Tells whether the latest readings are those of a unit that stands still.
  bool stands_still() const {
    constexpr double kForce_m_s2 = 0.4, kTurnRate_rad_s = 0.05;
    return std::ranges::all_of(readings, [&](const geometry::ImuSample& reading) {
      return std::abs(reading.specific_force_m_s2.norm() - options.imu->gravity_m_s2) < kForce_m_s2 &&
             reading.angular_rate_rad_s.norm() < kTurnRate_rad_s;
    });
  }

  /// Returns the velocity of the unit, local frame, which turns with the camera at the end of an arm.
  Vec3 unit_velocity() const {
    const Vec3 arm = options.imu->T_imu_camera.inverse().translation;  // in the camera's axes
    return pose.rotation * (velocity.head<3>() + velocity.tail<3>().cross(arm));
  }

  /// Predicts pose and velocity at `to_s` by the inertial unit. Returns false where its readings leave a gap.
  bool predict_by_readings(double to_s) {
    if (!options.imu) return false;
    const inertial::ImuModel& imu = *options.imu;
    std::vector<geometry::ImuSample> samples = readings;
    // The last reading before the image holds until the image, if it is not long before.
    constexpr double kHeld_s = 0.02;
    if (!samples.empty() && samples.back().time_s < to_s && to_s - samples.back().time_s < kHeld_s) {
      samples.push_back(samples.back());
      samples.back().time_s = to_s;
    }
    const auto increment = inertial::preintegrate(samples, *time_s, to_s, {}, imu.noise);
    if (!increment) return false;
    const double dt = to_s - *time_s;
    if (is_at_rest) return true;
    const Vec3 gravity(0.0, 0.0, -imu.gravity_m_s2);
    const SE3 unit = pose * imu.T_imu_camera.inverse();
    const Vec3 v = unit_velocity();
    const SE3 unit_then(
        unit.rotation * increment->increment.rotation,
        unit.translation + dt * v + 0.5 * dt * dt * gravity + unit.rotation * increment->increment.position);
    const Vec3 v_then = v + dt * gravity + unit.rotation * increment->increment.velocity;
    const SE3 then = unit_then * imu.T_imu_camera, motion = pose.inverse() * then;
    pose = then;
    const Vec3 rate = imu.T_imu_camera.rotation.conjugate() * readings.back().angular_rate_rad_s;
    velocity << pose.rotation.conjugate() * v_then - rate.cross(imu.T_imu_camera.inverse().translation), rate;
    // Errors of the attitude let gravity appear as acceleration.
    const double tilt_rad = std::sqrt(std::max(0.0, covariance.block<3, 3>(3, 3).trace()));
    const double acceleration = imu.accelerometer_bias_sigma + tilt_rad * imu.gravity_m_s2;
    Mat12 transition = Mat12::Identity();
    transition.topLeftCorner<6, 6>() = adjoint_of_inverse(motion);
    transition.block<3, 3>(0, 6) = dt * motion.rotation.conjugate().toRotationMatrix();
    transition.block<3, 3>(6, 6) = motion.rotation.conjugate().toRotationMatrix();
    transition.block<3, 3>(9, 9).setZero();  // the readings tell the rate
    Vec12 spread;
    spread << Vec3::Constant(0.5 * dt * dt * acceleration), Vec3::Constant(dt * imu.gyroscope_bias_sigma),
        Vec3::Constant(dt * acceleration), Vec3::Constant(imu.gyroscope_bias_sigma);
    Mat12 noise = spread.cwiseAbs2().asDiagonal();
    noise.block<3, 3>(0, 0) += increment->covariance.block<3, 3>(6, 6).trace() * geometry::Mat3::Identity();
    noise.block<3, 3>(3, 3) += increment->covariance.block<3, 3>(0, 0).trace() * geometry::Mat3::Identity();
    noise.block<3, 3>(6, 6) += increment->covariance.block<3, 3>(3, 3).trace() * geometry::Mat3::Identity();
    covariance = transition * covariance * transition.transpose() + noise;
    return true;
  }

  /// Forgets the readings before the last two up to the image's: the next interval begins between them.
  void forget_readings() {
    const auto next = std::ranges::find_if(readings, [&](const geometry::ImuSample& r) { return r.time_s > *time_s; });
    if (next - readings.begin() > 1) readings.erase(readings.begin(), next - 1);
  }

  void predict(double to_s, const std::optional<SE3>& known_motion) {
    if (!known_motion && predict_by_readings(to_s)) return;
    const double dt_s = to_s - *time_s;
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
    const Mat6 sum = covariance.topLeftCorner<6, 6>() + noise2 * found.covariance;
    const Mat12x6 gain = sum.ldlt().solve(Mat12x6(covariance.leftCols<6>()).transpose()).transpose();
    const Vec12 change = gain * innovation;
    pose = pose * SE3(geometry::so3_exp(change.segment<3>(3)), change.head<3>());
    velocity += change.tail<6>();
    Mat12 left = Mat12::Identity();
    left.leftCols<6>() -= gain;
    covariance = left * covariance * left.transpose() + gain * noise2 * found.covariance * gain.transpose();
    measured = noise2 * found.covariance;
    constexpr double kNew = 0.2;
    usual_correlation =
        usual_correlation > 0.0 ? (1.0 - kNew) * usual_correlation + kNew * found.correlation : found.correlation;
    missed = 0;
  }

  /// Returns the covariance of the expected pose. A pose that images no longer confirm may have been wrong from the
  /// beginning: the longer they do not, the farther from it the camera is searched.
  Mat6 expected_covariance() const {
    Mat6 expected = covariance.topLeftCorner<6, 6>();
    if (is_trusted || !was_trusted || !options.imu) return expected;
    constexpr double kMeters = 0.1, kRadians = 0.01;  // for each image
    const auto n = static_cast<double>(missed);
    Vec6 spread;
    spread << Vec3::Constant(n * kMeters), Vec3::Constant(n * kRadians);
    expected += spread.cwiseAbs2().asDiagonal();
    return expected;
  }

  /// Tells whether a result can be the camera's: near what is expected, and as similar as the images before.
  bool is_plausible(const LocalizationResult& found) {
    // By readings the pose is known well: of right ones, one in a thousand is farther away. An assumed velocity is not.
    constexpr double kAlike = 0.7, kSigmas = 5.0, kKnown = 22.5;
    if (found.correlation < kAlike * usual_correlation) return false;
    const SE3 apart = pose.inverse() * found.T_local_camera;
    Vec6 innovation;
    innovation << apart.translation, geometry::so3_log(apart.rotation);
    const Mat6 sum = expected_covariance() + noise2 * found.covariance;
    const double chi2 = innovation.dot(sum.ldlt().solve(innovation));
    if (nearest_chi2 == 0.0 || chi2 < nearest_chi2) nearest_chi2 = chi2;
    return chi2 < (options.imu ? kKnown : 6.0 * kSigmas * kSigmas);
  }

  /// Takes a result, or waits until others confirm it. An image that shows little, as above the ground, may be found in
  /// a wrong place; then the next ones are found elsewhere, relative to the motion that the readings tell.
  bool accept(const LocalizationResult& found, double dt_s) {
    constexpr int kConfirmations = 4;
    if (is_trusted || !options.imu) {
      update(found);
      return true;
    }
    const Vec3 offset = found.T_local_camera.translation - pose.translation;
    const double sigma_m = position_sigma_m(noise2 * found.covariance);
    const double velocity_m_s = std::sqrt(std::max(0.0, covariance.block<3, 3>(6, 6).trace()));
    constexpr double kSigmas = 3.0, kLeast_m = 0.01;
    const double tolerance_m = kLeast_m + kSigmas * std::hypot(sigma_m, last_sigma_m, dt_s * velocity_m_s);
    const bool confirms = last_offset && (offset - *last_offset).norm() < tolerance_m;
    confirmations = confirms ? confirmations + 1 : 0;
    last_offset = offset;
    last_sigma_m = sigma_m;
    if (confirmations < kConfirmations) return false;
    if (was_trusted) {  // what was believed before may have been wrong, the velocity, too
      constexpr double kVelocity_m_s = 0.5;
      covariance.topLeftCorner<6, 6>() = expected_covariance();
      covariance.topRightCorner<6, 6>().setZero();
      covariance.bottomLeftCorner<6, 6>().setZero();
      covariance.block<3, 3>(6, 6) += kVelocity_m_s * kVelocity_m_s * geometry::Mat3::Identity();
    }
    update(found);
    is_trusted = was_trusted = true;
    return true;
  }

  /// Learns from an image how far located poses are off, beyond what their covariances state: tiles that are not as the
  /// place is pull images in ways that an image does not show.
  void adapt_noise() {
    constexpr double kNew = 0.2, kMost = 9.0, kLargest = 400.0;
    if (nearest_chi2 > 0.0)
      noise2 = std::clamp(noise2 * (1.0 - kNew + kNew * std::min(kMost, nearest_chi2 / 6.0)), 1.0, kLargest);
    nearest_chi2 = 0.0;
  }

  /// Counts an image that was not found, or not confirmed.
  void miss() {
    constexpr std::size_t kMost = 8;
    if (++missed < kMost) return;
    is_trusted = false;
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
      const double reach = position_sigma_m(expected_covariance()) * std::min(1.5, 0.25 * std::sqrt(turn));
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
    : Localizer(scene, std::make_shared<const render::Appearance>(scene), camera, options) {}

Localizer::Localizer(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance,
                     const imaging::Camera& camera, const LiveOptions& options)
    : impl_(std::make_unique<Impl>(scene, std::move(appearance), camera, options)) {}

Localizer::~Localizer() = default;

void Localizer::use(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance) {
  impl_->localizer.use(scene, std::move(appearance));
}

void Localizer::add_reading(const geometry::ImuSample& reading) {
  std::vector<geometry::ImuSample>& readings = impl_->readings;
  if (readings.empty() || reading.time_s > readings.back().time_s) readings.push_back(reading);
}

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
  my.noise2 = 1.0;
  my.nearest_chi2 = 0.0;
  my.last_offset.reset();
  my.confirmations = 0;
  my.is_at_rest = my.options.imu && my.options.starts_at_rest;
  my.is_trusted = my.was_trusted = !my.is_at_rest;
  if (my.is_at_rest) {
    constexpr double kStill = 0.05;  // m/s, rad/s
    my.covariance.bottomRightCorner<6, 6>() = kStill * kStill * Mat6::Identity();
  }
}

LivePose Localizer::add(const RgbImage& image, double time_s, const std::optional<SE3>& T_last_this) {
  Impl& my = *impl_;
  if (!my.time_s) throw InputError("localizer", "has no start: say where the camera is before the first image");
  if (!(time_s >= *my.time_s)) throw InputError("image", "is older than the one before it");
  my.is_at_rest = my.is_at_rest && my.stands_still();
  const double dt_s = time_s - *my.time_s;
  if (dt_s > 0.0) my.predict(time_s, T_last_this);
  my.time_s = time_s;
  my.forget_readings();
  LivePose live;
  if (!my.is_at_rest) {
    const auto found = my.find(image);
    live.located = found && my.accept(*found, dt_s);
    if (live.located)
      live.correlation = found->correlation;
    else
      my.miss();
    if (!found) my.last_offset.reset();
    if (my.options.imu) my.adapt_noise();
  }
  live.T_local_camera = my.pose;
  live.velocity_m_s = my.pose.rotation * my.velocity.head<3>();
  live.sigma_velocity_m_s = std::sqrt(std::max(0.0, my.covariance.block<3, 3>(6, 6).trace() / 3.0));
  // Errors of successive images are alike, since they show the same ground: the filter's own covariance, which takes
  // them as independent, would be too small.
  live.covariance = live.located ? my.measured : Mat6(my.covariance.topLeftCorner<6, 6>() + my.measured);
  live.lost = live.sigma_position_m() > my.options.lost_sigma_m;
  return live;
}

}  // namespace tileflight::localization
