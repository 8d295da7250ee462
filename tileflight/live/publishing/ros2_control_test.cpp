#include "tileflight/live/publishing/ros2_control.h"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <condition_variable>
#include <mutex>

#include "tileflight/data/messages/cdr.h"
#include "tileflight/live/publishing/message_sink.h"
#include "tileflight/live/ros2/test_domain.h"
#include "tileflight/live/ros2/topics.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::publishing::ros2_control_test {
namespace {

using messages::CdrWriter;
using simulator::test_world::pose;
using testing::Contains;
using testing::HasSubstr;

const char* const kFlying = R"({"SimMode": "Multirotor", "StepOnDemand": true,
  "Vehicles": {"drone": {"VehicleType": "SimpleFlight"}}})";
const char* const kCamera = R"({"SimMode": "ComputerVision", "StepOnDemand": true,
  "Vehicles": {"eye": {"VehicleType": "ComputerVision"}}})";

/// Messages are delivered before publish() returns, as publisher and subscription are of one process.
class Ros2ControlTest : public testing::Test {
 protected:
  void start(const char* settings) {
    world_ = simulator::test_world::simulator(settings);
    control_.emplace(participant_, [this] { return world_; });
  }
  void send(const std::string& topic, const std::string& type, const std::string& cdr) {
    ros2::Publisher(participant_, topic, type, {}).publish(cdr);
  }
  void send_twist(const std::array<double, 6>& numbers) {
    send("/drone/cmd_vel", "geometry_msgs/msg/Twist", CdrWriter().array(numbers).bytes());
  }
  void send_goal(const std::string& topic, const std::string& frame, const std::array<double, 7>& numbers) {
    const std::string cdr =
        CdrWriter().number(std::int32_t{0}).number(std::uint32_t{0}).text(frame).array(numbers).bytes();
    send(topic, "geometry_msgs/msg/PoseStamped", cdr);
  }
  geometry::SE3 body() const { return world_->viewer().observe().vehicles.at(0).T_local_body; }
  std::vector<std::string> lines() {
    const std::lock_guard lock(mutex_);
    return lines_;
  }

  std::mutex mutex_;  ///< guards the next one
  std::vector<std::string> lines_;
  ros2::Participant participant_{{.domain = ros2::test_domain()}, [this](const std::string& line) {
                                   const std::lock_guard lock(mutex_);
                                   lines_.push_back(line);
                                 }};
  std::shared_ptr<simulator::Simulator> world_;
  std::optional<Ros2Control> control_;
};

/// REP 103: x forward, y left, z up; a positive turn is to the left. The vehicle looks north.
TEST_F(Ros2ControlTest, AVelocityIsOfTheBodyAndEndsByItself) {
  start(kFlying);
  world_->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "drone");
  const geometry::Vec3 before = body().translation;
  for (int i = 0; i < 10; ++i) {
    send_twist({2.0, 1.0, 0.5, 0.0, 0.0, 0.0});
    world_->clock().continue_for_time(0.2);
  }
  const geometry::Vec3 way = body().translation - before;
  EXPECT_GT(way.y(), 1.5) << "forward is north";
  EXPECT_LT(way.x(), -0.7) << "left is west";
  EXPECT_GT(way.z(), 0.3);
  world_->clock().continue_for_time(3.0);
  const geometry::Vec3 stopped = body().translation;
  world_->clock().continue_for_time(2.0);
  EXPECT_LT((body().translation - stopped).norm(), 0.1) << "half a second after the last order it hovers";
  for (int i = 0; i < 10; ++i) {
    send_twist({0.0, 0.0, 0.0, 0.0, 0.0, 0.5});
    world_->clock().continue_for_time(0.2);
  }
  const geometry::Vec3 forward = body().rotation * geometry::Vec3::UnitX();
  EXPECT_LT(forward.x(), -0.3) << "from north to the west";
}

TEST_F(Ros2ControlTest, AVehicleFliesToAGoal) {
  start(kFlying);
  world_->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "drone");
  const double half = std::sqrt(0.5);
  send_goal("/drone/goal_pose", "map", {4.0, 3.0, 12.0, 0.0, 0.0, half, -half});  // looks south
  world_->clock().continue_for_time(15.0);
  EXPECT_LT((body().translation - geometry::Vec3(4, 3, 12)).norm(), 0.6);
  EXPECT_LT((body().rotation * geometry::Vec3::UnitX()).y(), -0.95);
}

TEST_F(Ros2ControlTest, ACameraByItselfIsThereAtOnce) {
  start(kCamera);
  send_goal("/eye/goal_pose", "map", {4.0, 3.0, 12.0, 0.0, 0.0, 0.0, 1.0});
  EXPECT_LT((body().translation - geometry::Vec3(4, 3, 12)).norm(), 1e-4);
  EXPECT_LT((body().rotation * geometry::Vec3::UnitX() - geometry::Vec3::UnitX()).norm(), 1e-4) << "looks east";
}

TEST_F(Ros2ControlTest, WhatCannotBeDoneIsSaidOnceAndChangesNothing) {
  start(kFlying);
  const geometry::Vec3 before = body().translation;
  for (int i = 0; i < 3; ++i) {
    send_twist({std::nan(""), 0, 0, 0, 0, 0});
    send_twist({1e9, 0, 0, 0, 0, 0});
    send("/drone/cmd_vel", "geometry_msgs/msg/Twist", std::string("\0\1\0\0\0\0\0\0", 8));
    send_goal("/drone/goal_pose", "base_link", {0, 0, 0, 0, 0, 0, 1});
    send_goal("/drone/goal_pose", "map", {0, 0, 0, 0, 0, 0, 0});
    send_goal("/drone/goal_pose", "map", {1e9, 0, 0, 0, 0, 0, 1});
  }
  const std::vector<std::string> said = lines();
  EXPECT_EQ(said.size(), 6U) << testing::PrintToString(said);
  for (const char* why : {"not finite", "more than 1000 m/s", "cut off", "'map', not 'base_link'", "quaternion",
                          "more than 1000 km away"})
    EXPECT_THAT(said, Contains(HasSubstr(why)));
  world_->clock().continue_for_time(0.5);
  EXPECT_LT((body().translation - before).norm(), 0.01);
}

}  // namespace
}  // namespace tileflight::publishing::ros2_control_test
