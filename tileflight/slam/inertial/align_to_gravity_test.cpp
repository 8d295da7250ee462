#include "tileflight/slam/inertial/align_to_gravity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/inertial/inertial_start.h"
#include "tileflight/slam/inertial/test_smooth_motion.h"

namespace tileflight::inertial::align_to_gravity_test {
namespace {

using geometry::kRadiansPerDegree;
using geometry::SE3;
using geometry::Vec3;
using test_support::lively_motion;
using test_support::SmoothMotion;
using test_support::steady_motion;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

const SE3 kT_imu_camera(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), Vec3(0.1, 0.03, -0.05));
const geometry::ImuBias kBias{{0.01, -0.02, 0.015}, {0.1, -0.06, 0.08}};

/// A flight as both instruments see it. The map's frame is turned, and a metre is 1 / `scale` units of it.
struct Flight {
  SmoothMotion motion = lively_motion();
  double seconds = 20.0, scale = 2.5, clock_offset_s = 0.0, rate_hz = 200.0;
  SE3 T_map_world{Eigen::Quaterniond(0.8, 0.3, -0.4, 0.3), Vec3(1.0, 2.0, 3.0)};

  SE3 T_map_camera(double t) const {
    SE3 T = T_map_world * (motion.pose(t) * kT_imu_camera);
    T.translation /= scale;
    return T;
  }
  std::vector<VisualKeyframe> keyframes(double interval_s = 0.5, double sigma_m = 0.0, unsigned seed = 1) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::vector<VisualKeyframe> list;
    SE3 error;
    for (double t = 0.2; t < seconds - 0.2; t += interval_s) {
      geometry::Vec6 sigma;
      sigma << Vec3::Constant(std::max(sigma_m, 1e-4) / scale), Vec3::Constant(std::max(0.01 * sigma_m, 1e-5));
      geometry::Vec6 twist = geometry::Vec6::Zero();
      if (sigma_m > 0.0)
        for (int i = 0; i < 6; ++i) twist[i] = sigma[i] * normal(random);
      if (list.empty()) {
        list.push_back({t, T_map_camera(t), sigma.cwiseAbs2().asDiagonal().toDenseMatrix(), 1e-8});
      } else {
        const SE3 step = T_map_camera(list.back().time_s).inverse() * T_map_camera(t) * SE3::exp(twist);
        list.push_back({t, list.back().T_map_camera * step, sigma.cwiseAbs2().asDiagonal().toDenseMatrix(), 1e-8});
      }
    }
    return list;
  }
  geometry::Trajectory images() const {
    geometry::Trajectory path;
    for (double t = 0.2; t < seconds - 0.2; t += 0.1) path.poses.push_back({t, T_map_camera(t)});
    return path;
  }
  InertialInput input(unsigned seed = 1) const {
    InertialInput given;
    given.samples = motion.readings(-0.5, seconds + 0.5, rate_hz, kBias);
    test_support::add_noise(given.model.noise, rate_hz, seed, given.samples);
    for (geometry::ImuSample& sample : given.samples) sample.time_s += clock_offset_s;
    given.model.T_imu_camera = kT_imu_camera;
    return given;
  }
};

/// Largest distance from the truth once heading and place are taken from the first keyframe, metres.
double largest_error_m(const Flight& flight, const std::vector<VisualKeyframe>& keyframes,
                       const InertialAlignment& found) {
  const SE3 first = flight.motion.pose(keyframes.front().time_s) * kT_imu_camera;
  const Eigen::Quaterniond turn = first.rotation * found.T_world_camera.front().rotation.conjugate();
  const double yaw = 2.0 * std::atan2(turn.z(), turn.w());
  const SE3 T_truth_found(Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Vec3::UnitZ())), first.translation);
  double largest = 0.0;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    const SE3 truth = flight.motion.pose(keyframes[k].time_s) * kT_imu_camera;
    largest = std::max(largest, (T_truth_found * found.T_world_camera[k].translation - truth.translation).norm());
  }
  return largest;
}

/// Angle between the vertical found and the true one at the first keyframe.
double up_error_rad(const Flight& flight, const std::vector<VisualKeyframe>& keyframes,
                    const InertialAlignment& found) {
  const Vec3 truth =
      (flight.motion.pose(keyframes.front().time_s) * kT_imu_camera).rotation.conjugate() * Vec3::UnitZ();
  const Vec3 ours = found.T_world_camera.front().rotation.conjugate() * Vec3::UnitZ();
  return std::acos(std::min(1.0, truth.dot(ours)));
}

TEST(AlignToGravity, AnExactPathBecomesMetricAndLevel) {
  const Flight flight;
  const auto keyframes = flight.keyframes();
  const InertialAlignment found = align_to_gravity(keyframes, flight.images(), flight.input());
  ASSERT_TRUE(found.metric) << found.reason;
  EXPECT_NEAR(found.mean_scale / 2.5, 1.0, 1e-3);
  EXPECT_LT(std::abs(std::log(found.mean_scale / 2.5)), 4.0 * found.sigma_log_scale);
  EXPECT_LT(found.sigma_log_scale, 2e-3);
  EXPECT_LT(up_error_rad(flight, keyframes, found), 0.1 * kRadiansPerDegree);
  EXPECT_LT(largest_error_m(flight, keyframes, found), 0.05);
  EXPECT_LT((found.bias.front().gyroscope_rad_s - kBias.gyroscope_rad_s).norm(), 5e-4);
  EXPECT_LT((found.bias.front().accelerometer_m_s2 - kBias.accelerometer_m_s2).norm(), 0.03);
  EXPECT_NEAR(found.time_offset_s, 0.0, 1e-3);
  EXPECT_LT(found.residual_ratio, 1.3);
  EXPECT_TRUE(found.warnings.empty());
  const double t = keyframes[10].time_s;
  EXPECT_NEAR(found.velocity_m_s[10].norm(), flight.motion.velocity(t).norm(), 0.02);
}

// The state of the latest keyframe as a prior: the squared normalised error of all but the accelerometer's bias, nine
// numbers, is 9 in the mean.
TEST(AlignToGravity, TheLatestStatesCovarianceIsThatOfManyFlights) {
  const Flight flight;
  double squares = 0.0;
  constexpr int kFlights = 24;
  for (unsigned seed = 1; seed <= kFlights; ++seed) {
    const auto keyframes = flight.keyframes(0.5, 0.02, seed);
    const InertialInput input = flight.input(seed);
    const InertialAlignment found = align_to_gravity(keyframes, flight.images(), input);
    ASSERT_TRUE(found.metric) << seed << ": " << found.reason;
    const double t = keyframes.back().time_s;
    const Eigen::Quaterniond R = found.T_world_camera.back().rotation * found.T_imu_camera.rotation.conjugate();
    const Vec3 up_error = R * (flight.motion.rotation(t).conjugate() * Vec3::UnitZ());
    Eigen::Matrix<double, 9, 1> error;  // the biases have wandered by an unknown amount at the end
    error << up_error.y(), -up_error.x(), std::log(found.scale.back() / flight.scale),
        R.conjugate() * found.velocity_m_s.back() - flight.motion.rotation(t).conjugate() * flight.motion.velocity(t),
        found.bias.back().gyroscope_rad_s - kBias.gyroscope_rad_s;
    // A rotation e about the world's axes takes the true vertical to (e_y, -e_x): the tilt found is the opposite one.
    error.head<2>() *= -1.0;
    const Eigen::Matrix<double, 9, 9> covariance = found.latest_covariance.topLeftCorner<9, 9>();
    squares += error.dot(covariance.ldlt().solve(error)) / kFlights;
  }
  EXPECT_GT(squares, 0.4 * 9.0);
  EXPECT_LT(squares, 2.0 * 9.0);
}

TEST(AlignToGravity, AMapInMetresKeepsItsScaleAndBecomesLevel) {
  Flight flight;
  flight.scale = 1.0;
  flight.motion = steady_motion();  // of which the readings alone do not know the scale
  auto keyframes = flight.keyframes(0.5, 0.01);
  for (VisualKeyframe& keyframe : keyframes) keyframe.is_metric = true, keyframe.step_log_scale_variance = 1e-6;
  const InertialAlignment found = align_to_gravity(keyframes, flight.images(), flight.input());
  ASSERT_TRUE(found.metric) << found.reason;
  EXPECT_TRUE(found.was_metric);
  EXPECT_NEAR(found.mean_scale, 1.0, 4e-3);
  EXPECT_LT(found.sigma_log_scale, 2e-3);
  EXPECT_LT(up_error_rad(flight, keyframes, found), 3.0 * found.sigma_up_rad);
}

// The square of an error over its sigma is 1 in the mean of many flights; 24 of them give that to a third.
TEST(AlignToGravity, TheSigmaIsThatOfManyFlights) {
  const Flight flight;
  double squares = 0.0;
  constexpr int kFlights = 24;
  for (unsigned seed = 1; seed <= kFlights; ++seed) {
    const auto keyframes = flight.keyframes(0.5, 0.02, seed);
    const InertialAlignment found = align_to_gravity(keyframes, flight.images(), flight.input(seed));
    ASSERT_TRUE(found.metric) << seed << ": " << found.reason;
    squares += std::pow(std::log(found.mean_scale / 2.5) / found.sigma_log_scale, 2) / kFlights;
    EXPECT_NEAR(found.mean_scale / 2.5, 1.0, 0.01) << seed;
  }
  EXPECT_GT(squares, 0.3);
  EXPECT_LT(squares, 2.0);
}

/// A drone that flies gently and hardly turns.
SmoothMotion gentle_motion() {
  return {
      [](double t) { return Vec3(12.0 * std::sin(0.3 * t), 8.0 * std::cos(0.25 * t + 0.3), 10.0 + std::sin(0.3 * t)); },
      [](double t) {
        return Eigen::Quaterniond(Eigen::AngleAxisd(0.3 * std::sin(0.15 * t), Vec3::UnitZ()) *
                                  Eigen::AngleAxisd(0.4, Vec3::UnitY()));
      }};
}

// As for the scale. On a gentle flight a shift of the clocks changes what the readings add up to by little more than
// their noise does, which must not count as if it told the offset.
TEST(AlignToGravity, TheOffsetsSigmaIsThatOfManyFlights) {
  Flight flight;
  flight.motion = gentle_motion();
  double squares = 0.0;
  constexpr int kFlights = 12;
  for (unsigned seed = 1; seed <= kFlights; ++seed) {
    const auto keyframes = flight.keyframes(0.3, 0.005, seed);
    const InertialAlignment found = align_to_gravity(keyframes, flight.images(), flight.input(seed));
    ASSERT_TRUE(found.metric) << seed << ": " << found.reason;
    squares += std::pow(found.time_offset_s / found.sigma_time_offset_s, 2) / kFlights;
  }
  EXPECT_GT(squares, 0.3);
  EXPECT_LT(squares, 2.0);
}

// Played backwards, the flight has the same scale and vertical.
TEST(AlignToGravity, PlayedBackwardsItIsTheSame) {
  Flight flight;
  flight.clock_offset_s = 0.05;
  auto keyframes = flight.keyframes();
  geometry::Trajectory images = flight.images();
  const InertialInput input = flight.input();
  const InertialAlignment forwards = align_to_gravity(keyframes, images, input);
  InertialInput backwards = input;
  backwards.samples = reversed(input.samples);
  const auto turn = [](auto& list) {
    std::reverse(list.begin(), list.end());
    for (auto& pose : list) pose.time_s = -pose.time_s;
  };
  turn(keyframes);
  turn(images.poses);
  const InertialAlignment found = reversed(align_to_gravity(keyframes, images, backwards));
  ASSERT_TRUE(forwards.metric && found.metric);
  EXPECT_NEAR(found.mean_scale / forwards.mean_scale, 1.0, 2e-4);
  EXPECT_NEAR(found.time_offset_s, forwards.time_offset_s, 2e-4);
  EXPECT_LT((found.bias[5].gyroscope_rad_s - forwards.bias[5].gyroscope_rad_s).norm(), 1e-4);
  const auto turned = [](const InertialAlignment& a) {  // free of the heading
    return Vec3(a.T_world_camera[5].rotation.conjugate() * a.velocity_m_s[5]);
  };
  EXPECT_LT((turned(found) - turned(forwards)).norm(), 5e-3);
}

TEST(AlignToGravity, ClocksThatDifferAreFound) {
  for (const double offset_s : {0.1, -0.1, 0.37}) {
    Flight flight;
    flight.clock_offset_s = offset_s;
    const auto keyframes = flight.keyframes();
    const InertialAlignment found = align_to_gravity(keyframes, flight.images(), flight.input());
    ASSERT_TRUE(found.metric) << found.reason;
    EXPECT_NEAR(found.time_offset_s, offset_s, 2e-3);
    EXPECT_LT(found.sigma_time_offset_s, 2e-3);
    EXPECT_NEAR(found.mean_scale / 2.5, 1.0, 2e-3);
  }
}

// A flight that hardly turns, whose images' rotations lag behind by chance: the clocks' offset that they show is no
// more than a hint.
TEST(AlignToGravity, AnOffsetThatRotationsHardlyShowIsNotBelieved) {
  Flight flight;
  const auto turn = [](double t) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(0.03 * std::sin(0.9 * t), Vec3::UnitY()) *
                              Eigen::AngleAxisd(0.02 * std::cos(0.7 * t), Vec3::UnitX()));
  };
  flight.motion.rotation = turn;
  Flight late = flight;
  late.motion.rotation = [turn](double t) { return turn(t - 0.14); };
  geometry::Trajectory images = late.images();
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0.0, 1e-4);
  for (geometry::StampedPose& pose : images.poses)
    pose.T_local_camera.rotation =
        pose.T_local_camera.rotation * geometry::so3_exp(Vec3(normal(random), normal(random), normal(random)));
  for (unsigned seed = 1; seed < 6; ++seed) {
    const auto keyframes = flight.keyframes(0.5, 0.02, seed);
    const InertialAlignment found = align_to_gravity(keyframes, images, flight.input(seed));
    ASSERT_TRUE(found.metric) << seed << ": " << found.reason;
    EXPECT_NEAR(found.mean_scale / flight.scale, 1.0, 0.015) << seed;
    EXPECT_LT(std::abs(found.time_offset_s), 0.03) << seed;
  }
}

TEST(InertialStart, IsForTheGivenOffsetOfTheClocks) {
  Flight flight;
  flight.clock_offset_s = 0.3;
  const auto keyframes = flight.keyframes();
  const InertialInput input = flight.input();
  const ImuCheck check = check_readings(input.samples, input.model.noise, "imu.csv");
  const VisualInertialProblem problem(keyframes, input.samples, check, input.model, 0.0, 0.1);
  const auto error = [&](double offset_s) {
    const VisualInertialState start = inertial_start(problem, offset_s).value();
    EXPECT_EQ(start.time_offset_s, offset_s);
    return std::abs(start.log_scale[0] - std::log(flight.scale));
  };
  EXPECT_LT(error(0.3), 0.5 * error(0.0));
  EXPECT_LT(error(0.3), 0.02);
}

TEST(AlignToGravity, ASlightlyTurnedUnitIsCorrected) {
  const Flight flight;
  InertialInput input = flight.input();
  input.model.T_imu_camera.rotation *= Eigen::Quaterniond(Eigen::AngleAxisd(0.01, Vec3(1, -1, 1).normalized()));
  const auto keyframes = flight.keyframes();
  const InertialAlignment found = align_to_gravity(keyframes, flight.images(), input);
  ASSERT_TRUE(found.metric) << found.reason;
  EXPECT_NEAR(found.mounting_correction_rad, 0.01, 1e-3);
  EXPECT_LT(up_error_rad(flight, keyframes, found), 0.2 * kRadiansPerDegree);
}

// The scale wanders by a tenth over the flight; the samples bring it back.
TEST(AlignToGravity, AWanderingScaleIsBroughtBack) {
  const Flight flight;
  auto keyframes = flight.keyframes();
  const auto exact = keyframes;
  for (std::size_t k = 1; k < keyframes.size(); ++k) {
    SE3 step = exact[k - 1].T_map_camera.inverse() * exact[k].T_map_camera;
    step.translation *= std::exp(0.1 * static_cast<double>(k) / static_cast<double>(keyframes.size()));
    keyframes[k].T_map_camera = keyframes[k - 1].T_map_camera * step;
    keyframes[k].step_log_scale_variance = 1e-4;
  }
  const InertialAlignment found = align_to_gravity(keyframes, flight.images(), flight.input());
  ASSERT_TRUE(found.metric) << found.reason;
  EXPECT_NEAR(std::log(found.scale.front() / found.scale.back()), 0.1, 0.02);
  EXPECT_LT(largest_error_m(flight, keyframes, found), 0.15);
}

// The first step after an initialisation is off by a tenth of a metre, ten times its sigma.
TEST(AlignToGravity, AStepThatIsOffCountsLess) {
  const Flight flight;
  auto keyframes = flight.keyframes(0.5, 0.01);
  const SE3 wrong(Eigen::Quaterniond::Identity(), Vec3(0.1, 0.0, 0.0) / flight.scale);
  keyframes.front().T_map_camera = keyframes.front().T_map_camera * wrong;
  const InertialAlignment found = align_to_gravity(keyframes, flight.images(), flight.input());
  ASSERT_TRUE(found.metric) << found.reason;
  EXPECT_NEAR(found.mean_scale / 2.5, 1.0, 4e-3);
  const SE3 step = found.T_world_camera[0].inverse() * found.T_world_camera[1];
  const SE3 truth = (flight.motion.pose(0.2) * kT_imu_camera).inverse() * (flight.motion.pose(0.7) * kT_imu_camera);
  EXPECT_LT((step.translation - truth.translation).norm(), 0.03);
}

// Tracking that went wrong for three steps.
TEST(AlignToGravity, StepsThatTheReadingsContradictAreNamed) {
  const Flight flight;
  auto keyframes = flight.keyframes(0.5, 0.01);
  EXPECT_TRUE(align_to_gravity(keyframes, flight.images(), flight.input()).warnings.empty());
  for (std::size_t k = 10; k < keyframes.size(); ++k) {
    const double steps = std::min(static_cast<double>(k) - 9.0, 3.0);
    keyframes[k].T_map_camera.translation += steps * Vec3(0.3, 0.1, 0.0) / flight.scale;
  }
  const InertialAlignment found = align_to_gravity(keyframes, flight.images(), flight.input());
  ASSERT_TRUE(found.metric) << found.reason;
  ASSERT_EQ(found.warnings.size(), 1U);
  EXPECT_THAT(found.warnings[0].message, HasSubstr("contradict the camera's motion in 3 of 39 steps"));
  EXPECT_THAT(found.warnings[0].message, HasSubstr("between 4.7 and 6.2 s"));
  EXPECT_EQ(found.warnings[0].severity, Severity::kWarning);
}

// Samples that begin and end with the images lose neither step, though the clocks' offset moves.
TEST(AlignToGravity, TheFirstAndLastStepAreUsed) {
  const Flight flight;
  InertialInput input = flight.input();
  const auto keyframes = flight.keyframes();
  std::erase_if(input.samples, [&](const geometry::ImuSample& sample) {
    return sample.time_s < keyframes.front().time_s - 1e-6 || sample.time_s > keyframes.back().time_s + 1e-6;
  });
  const InertialAlignment found = align_to_gravity(keyframes, flight.images(), input);
  ASSERT_TRUE(found.metric) << found.reason;
  EXPECT_DOUBLE_EQ(found.covered_share, 1.0);
  EXPECT_NE(found.time_offset_s, 0.0);
  EXPECT_NEAR(found.mean_scale / 2.5, 1.0, 2e-3);
}

// Noise lets some scale fit, or none.
TEST(AlignToGravity, AtConstantVelocityTheScaleStaysUnknown) {
  Flight flight;
  flight.motion = steady_motion();
  flight.seconds = 8.0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const InertialAlignment found = align_to_gravity(flight.keyframes(), flight.images(), flight.input(seed));
    EXPECT_FALSE(found.metric) << "seed " << seed;
    EXPECT_TRUE(found.T_world_camera.empty());
    ASSERT_EQ(found.warnings.size(), 1U);
    EXPECT_EQ(found.warnings[0].severity, Severity::kNote);  // the map is as good as a monocular one
    EXPECT_THAT(found.warnings[0].message, HasSubstr("scale is not known"));
  }
}

/// Unknown directions that the measurements leave open.
int open_directions(const Flight& flight) {
  const auto keyframes = flight.keyframes(3.0);
  const InertialInput input = flight.input();
  const ImuCheck check = check_readings(input.samples, input.model.noise, "imu.csv");
  const VisualInertialProblem problem(keyframes, input.samples, check, input.model, 0.0, 0.1);
  VisualInertialState truth;
  truth.T_imu_camera = kT_imu_camera;
  for (const VisualKeyframe& keyframe : keyframes) {
    truth.states.push_back(flight.motion.state(keyframe.time_s, kBias));
    truth.log_scale.push_back(std::log(flight.scale));
  }
  const Eigen::MatrixXd H(problem.measurements(truth).information());
  const Eigen::VectorXd size = H.diagonal().cwiseMax(1e-12).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(size.asDiagonal() * H * size.asDiagonal());
  return static_cast<int>((eigen.eigenvalues().array() < 1e-10).count());
}

// Position and heading: the four directions that no camera with an inertial unit can observe (Martinelli, "Vision and
// IMU Data Fusion: Closed-Form Solutions", IEEE TRO 28(1), 2012). At constant velocity without turning there are more.
TEST(AlignToGravity, FourDirectionsAreOpenAndMoreWithoutMotion) {
  Flight flight;
  EXPECT_EQ(open_directions(flight), 4);
  flight.motion = steady_motion();
  EXPECT_GT(open_directions(flight), 4);
}

TEST(AlignToGravity, AGapIsBridgedAndNamed) {
  const Flight flight;
  InertialInput input = flight.input();
  std::erase_if(input.samples,
                [](const geometry::ImuSample& sample) { return sample.time_s > 8.0 && sample.time_s < 10.0; });
  const auto keyframes = flight.keyframes();
  const InertialAlignment found = align_to_gravity(keyframes, flight.images(), input);
  ASSERT_TRUE(found.metric) << found.reason;
  ASSERT_EQ(found.warnings.size(), 1U);
  EXPECT_THAT(found.warnings[0].message, HasSubstr("readings stop 1 times"));
  EXPECT_NEAR(found.mean_scale / 2.5, 1.0, 5e-3);
  std::erase_if(input.samples,
                [](const geometry::ImuSample& sample) { return sample.time_s > 4.0 && sample.time_s < 18.0; });
  const InertialAlignment too_few = align_to_gravity(keyframes, flight.images(), input);
  EXPECT_FALSE(too_few.metric);
  EXPECT_THAT(too_few.reason, HasSubstr("% of the flight"));
}

TEST(AlignToGravity, DegreesAndWrongAxesAreNamed) {
  const Flight flight;
  InertialInput degrees = flight.input(), axes = flight.input();
  for (geometry::ImuSample& sample : degrees.samples) sample.angular_rate_rad_s /= kRadiansPerDegree;
  const InertialAlignment in_degrees = align_to_gravity(flight.keyframes(), flight.images(), degrees);
  EXPECT_FALSE(in_degrees.metric);
  EXPECT_THAT(in_degrees.reason, HasSubstr("they are in degrees a second"));
  for (geometry::ImuSample& sample : axes.samples) {
    sample.angular_rate_rad_s = {sample.angular_rate_rad_s.y(), -sample.angular_rate_rad_s.x(),
                                 sample.angular_rate_rad_s.z()};
    sample.specific_force_m_s2 = {sample.specific_force_m_s2.y(), -sample.specific_force_m_s2.x(),
                                  sample.specific_force_m_s2.z()};
  }
  const InertialAlignment turned = align_to_gravity(flight.keyframes(), flight.images(), axes);
  EXPECT_FALSE(turned.metric);
  EXPECT_THAT(turned.reason, HasSubstr("mounted otherwise than the calibration's T_cam_imu says"));
}

TEST(AlignToGravity, OtherClocksAndTooFewKeyframesAreRefused) {
  const Flight flight;
  InertialInput input = flight.input();
  for (geometry::ImuSample& sample : input.samples) sample.time_s += 1000.0;
  EXPECT_THAT([&] { align_to_gravity(flight.keyframes(), flight.images(), input); },
              ThrowsMessage<InputError>(HasSubstr("have nothing in common; give both in the same clock")));
  auto two = flight.keyframes();
  two.resize(2);
  EXPECT_THAT(align_to_gravity(two, flight.images(), flight.input()).reason, HasSubstr("only 2 keyframes"));
}

}  // namespace
}  // namespace tileflight::inertial::align_to_gravity_test
