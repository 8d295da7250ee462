#include "tileflight/capture/vehicle/multirotor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <tuple>

#include "tests/source_folder.h"
#include "tileflight/capture/vehicle/test_obstacles.h"

namespace tileflight::vehicle::multirotor_test {
namespace {

using geometry::Vec3;
using vehicle::kStandardGravity_m_s2;

double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

/// A plane through the origin that rises towards the east.
vehicle::ObstacleQuery slope(double degrees) {
  return vehicle::test_support::plane(Vec3(-std::sin(radians(degrees)), 0.0, std::cos(radians(degrees))), 0.0);
}

Multirotor on(const vehicle::ObstacleQuery& ground, Airframe airframe = make_airframe(AirframeKind::kQuadX)) {
  return {std::move(airframe), ground, {}, Vec3(0, 0, 0.4), 0.0};
}

double tilt_deg(const vehicle::RigidBodyState& body) {
  return std::acos(std::clamp((body.R_local_body * Vec3::UnitZ()).z(), -1.0, 1.0)) * 180.0 / std::numbers::pi;
}

const std::vector<double> kOff(4, 0.0);

/// Share of a rotor's thrust with which four of them carry the quadrotor.
double hover_share(const Airframe& frame) {
  const double most_n = frame.thrust_n_s2 * frame.max_rotor_speed_rad_s * frame.max_rotor_speed_rad_s;
  return frame.body.mass_kg * kStandardGravity_m_s2 / (most_n * static_cast<double>(frame.rotors.size()));
}

TEST(Multirotor, StandsOnItsSpringsAndFeelsGravity) {
  Multirotor quad = on(vehicle::test_support::level_ground(0.0));
  quad.step(kOff, 1.0);
  const ContactOptions& contact = quad.airframe().contact;
  const double pressed_m = kStandardGravity_m_s2 * quad.airframe().body.mass_kg / (4.0 * contact.stiffness_n_m);
  EXPECT_NEAR(quad.state().position_m.z(), kStandingHeight_m - pressed_m, 1e-6);
  EXPECT_LT((quad.inertial().accelerometer_m_s2 - Vec3(0, 0, kStandardGravity_m_s2)).norm(), 1e-4);
  EXPECT_LT(quad.inertial().gyro_rad_s.norm(), 1e-5);
}

TEST(Multirotor, LiesOnASlopeAndStaysThere) {
  Multirotor quad = on(slope(20.0));
  EXPECT_NEAR(tilt_deg(quad.state()), 20.0, 0.5);
  const Vec3 start = quad.state().position_m;
  quad.step(kOff, 30.0);
  EXPECT_LT((quad.state().position_m - start).norm(), 1e-4);
  // Facing uphill: gravity pulls towards its tail.
  const double tilt_rad = radians(tilt_deg(quad.state()));
  const Vec3 expected = kStandardGravity_m_s2 * Vec3(std::sin(tilt_rad), 0.0, std::cos(tilt_rad));
  EXPECT_LT((quad.inertial().accelerometer_m_s2 - expected).norm(), 1e-3);
}

/// a = g (sin - mu cos), the block on an inclined plane.
TEST(Multirotor, SlidesDownASlopeThatIsTooSteepForItsFriction) {
  Airframe slippery = make_airframe(AirframeKind::kQuadX);
  slippery.contact.friction = 0.2;
  Multirotor quad(slippery, slope(20.0), {}, Vec3(0, 0, 0.4), 0.0);
  quad.step(kOff, 0.5);
  const double before_m_s = quad.state().velocity_m_s.norm();
  quad.step(kOff, 1.0);
  const double expected = kStandardGravity_m_s2 * (std::sin(radians(20.0)) - 0.2 * std::cos(radians(20.0)));
  EXPECT_NEAR(quad.state().velocity_m_s.norm() - before_m_s, expected, 0.03 * expected);
}

/// In the air it is the quadrotor of the room vehicle, which has tests of its own.
TEST(Multirotor, FliesAsTheQuadrotorDoes) {
  const Airframe frame = make_airframe(AirframeKind::kQuadX);
  Multirotor quad(frame, {}, {.mean_m_s = Vec3(3, -2, 0)}, Vec3(0, 0, 50), 0.4);
  vehicle::MultirotorOptions options;
  for (std::size_t i = 0; i < 4; ++i) options.rotors[i] = frame.rotors[i];
  options.body = frame.body;
  vehicle::QuadrotorState expected{quad.state(), vehicle::RotorSpeeds::Zero()};
  const std::vector<double> shares{0.61, 0.58, 0.6, 0.59};
  vehicle::RotorSpeeds commanded;
  for (int i = 0; i < 4; ++i)
    commanded[i] = options.max_rotor_speed_rad_s * std::sqrt(shares[static_cast<std::size_t>(i)]);
  for (int i = 0; i < 2000; ++i) {
    quad.step(shares, 0.001);
    expected = vehicle::integrate(options, expected, commanded, Vec3(3, -2, 0), 0.001);
  }
  EXPECT_LT((quad.state().position_m - expected.body.position_m).norm(), 1e-9);
  EXPECT_LT(quad.state().R_local_body.angularDistance(expected.body.R_local_body), 1e-9);
}

/// The airframe's inertia against the one that vehicle::MultirotorOptions gives for the same parts.
TEST(Multirotor, HasTheQuadrotorsMassAndInertia) {
  const Airframe frame = make_airframe(AirframeKind::kQuadX);
  const vehicle::MultirotorOptions options;
  EXPECT_NEAR(frame.body.mass_kg, options.body.mass_kg, 1e-12);
  EXPECT_LT((frame.body.inertia_kg_m2 - options.body.inertia_kg_m2).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_NEAR(hover_share(make_airframe(AirframeKind::kHexaX)), hover_share(frame), 1e-9);
}

/// The parameters that users give to ArduCopter describe this vehicle.
TEST(Multirotor, IsTheOneOfTheExamplesParameters) {
  for (const auto& [name, kind, frame_class] :
       {std::tuple{"quad", AirframeKind::kQuadX, 1.0}, std::tuple{"hexa", AirframeKind::kHexaX, 2.0}}) {
    std::ifstream file(tests::source_folder() / ("examples/ardupilot-" + std::string(name) + "-x.parm"));
    std::map<std::string, double> parameters;
    for (std::string line; std::getline(file, line);) {
      std::istringstream words(line);
      std::string key;
      if (!line.empty() && line.front() != '#' && words >> key) words >> parameters[key];
    }
    EXPECT_EQ(parameters["FRAME_CLASS"], frame_class);
    EXPECT_EQ(parameters["FRAME_TYPE"], 1.0);  // X
    EXPECT_NEAR(parameters["MOT_THST_HOVER"], hover_share(make_airframe(kind)), 0.01);
  }
}

/// Where each motor lies (forward, right) and how it turns the nose when it alone speeds up: clockwise seen from above
/// for a rotor that turns counter-clockwise.
struct Motor {
  double forward, right;
  double nose_clockwise;
};

void expect_motors(AirframeKind kind, const std::vector<Motor>& motors) {
  const Airframe frame = make_airframe(kind);
  ASSERT_EQ(frame.rotors.size(), motors.size());
  for (std::size_t i = 0; i < motors.size(); ++i) {
    Multirotor one(frame, {}, {}, Vec3(0, 0, 100), 0.0);
    std::vector<double> shares(motors.size(), 0.3);
    shares[i] = 0.4;
    one.step(shares, 0.05);
    const Vec3 rate = one.inertial().gyro_rad_s;  // forward, left, up
    // More lift in front pitches up (negative about left), at the right rolls to the left (negative about forward).
    EXPECT_EQ(std::round(-rate.y() * 100) > 0, motors[i].forward > 0) << "motor " << i + 1;
    EXPECT_EQ(std::round(-rate.x() * 100) > 0, motors[i].right > 0) << "motor " << i + 1;
    EXPECT_GT(-rate.z() * motors[i].nose_clockwise, 0.0) << "motor " << i + 1;
  }
}

/// ArduPilot's AP_MotorsMatrix, QUAD X and HEXA X.
TEST(Multirotor, MotorsAreInTheAutopilotsOrder) {
  expect_motors(AirframeKind::kQuadX, {{1, 1, 1}, {-1, -1, 1}, {1, -1, -1}, {-1, 1, -1}});
  expect_motors(AirframeKind::kHexaX, {{0, 1, -1}, {0, -1, 1}, {1, -1, -1}, {-1, 1, 1}, {1, 1, 1}, {-1, -1, -1}});
}

TEST(Multirotor, FeelsItsThrustInTheAir) {
  const Airframe frame = make_airframe(AirframeKind::kHexaX);
  Multirotor hexa(frame, {}, {}, Vec3(0, 0, 100), 0.0);
  const std::vector<double> hovering(6, hover_share(frame));
  hexa.step(hovering, 0.2);
  hexa.step(hovering, 0.0025);
  EXPECT_NEAR(hexa.inertial().accelerometer_m_s2.z(), kStandardGravity_m_s2, 0.02);  // less a little drag
  hexa.step(std::vector<double>(6, 0.0), 0.1);
  hexa.step(std::vector<double>(6, 0.0), 0.0025);
  EXPECT_LT(hexa.inertial().accelerometer_m_s2.norm(), 0.2);  // falling
}

TEST(Multirotor, NoSpeedTakesItThroughAWall) {
  const auto wall = vehicle::test_support::plane(Vec3::UnitX(), 5.0);
  for (const double speed_m_s : {2.0, 15.0, 60.0}) {
    Multirotor quad(make_airframe(AirframeKind::kQuadX), wall, {}, Vec3(0, 0, 50), 0.0);
    quad.place({Vec3(0, 0, 50), Vec3(speed_m_s, 0, 0), Eigen::Quaterniond::Identity(), Vec3::Zero()});
    bool hit = false;
    for (int i = 0; i < 1200 && !hit; ++i) {
      quad.step(kOff, 1.0 / 400.0);
      hit = quad.impact().has_value();
    }
    EXPECT_TRUE(hit) << speed_m_s;
    for (int i = 0; i < 400; ++i) quad.step(kOff, 1.0 / 400.0);
    EXPECT_LT(quad.state().position_m.x(), 5.0) << speed_m_s;
    EXPECT_LT(quad.state().velocity_m_s.x(), 0.0) << speed_m_s;
  }
}

TEST(Multirotor, FallsOnItsBackAndLiesThere) {
  Multirotor quad = on(vehicle::test_support::level_ground(0.0));
  const Eigen::Quaterniond upside_down(Eigen::AngleAxisd(std::numbers::pi - 0.1, Vec3::UnitX()));
  quad.place({Vec3(0, 0, 1.5), Vec3::Zero(), upside_down, Vec3::Zero()});
  quad.step(kOff, 10.0);
  EXPECT_GT(tilt_deg(quad.state()), 120.0);
  EXPECT_LT(quad.state().velocity_m_s.norm(), 1e-3);
  EXPECT_GT(quad.state().position_m.z(), 0.0);
}

TEST(Multirotor, SameOutputsSameBytes) {
  const auto fly = [](Multirotor& quad) {
    for (int i = 0; i < 240; ++i) quad.step(std::vector<double>{0.9, 0.9, 0.89, 0.9}, 1.0 / 400.0);
    return quad.state();
  };
  Multirotor quad(make_airframe(AirframeKind::kQuadX), slope(10.0),
                  {.mean_m_s = Vec3(4, 0, 0), .turbulence = vehicle::Turbulence::kModerate}, Vec3(0, 0, 0.4), 0.0);
  const vehicle::RigidBodyState first = fly(quad);
  EXPECT_GT(first.position_m.z(), 0.4);
  quad.reset();
  const vehicle::RigidBodyState second = fly(quad);
  EXPECT_EQ(std::memcmp(first.position_m.data(), second.position_m.data(), sizeof(double) * 3), 0);
  EXPECT_EQ(first.R_local_body.coeffs(), second.R_local_body.coeffs());
}

TEST(Multirotor, WithoutGroundItStartsWhereItIs) {
  Multirotor quad(make_airframe(AirframeKind::kQuadX), vehicle::test_support::level_ground(-100.0), {}, Vec3(1, 2, 3),
                  0.0);
  EXPECT_EQ(quad.start().position_m, Vec3(1, 2, 3));
}

TEST(Airframe, ThrustFollowsTheCurveAndStopsForWhatIsNoNumber) {
  EXPECT_DOUBLE_EQ(thrust_share(0.5, 0.0), 0.5);
  EXPECT_DOUBLE_EQ(thrust_share(0.5, 0.65), 0.35 * 0.5 + 0.65 * 0.25);
  EXPECT_DOUBLE_EQ(thrust_share(7.0, 0.65), 1.0);
  EXPECT_DOUBLE_EQ(thrust_share(-INFINITY, 0.65), 0.0);
  EXPECT_DOUBLE_EQ(thrust_share(NAN, 0.65), 0.0);
}

}  // namespace
}  // namespace tileflight::vehicle::multirotor_test
