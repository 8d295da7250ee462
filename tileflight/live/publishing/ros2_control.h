#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>

#include "tileflight/live/ros2/participant.h"
#include "tileflight/live/ros2/service.h"
#include "tileflight/live/ros2/topics.h"
#include "tileflight/live/simulator/simulator.h"

namespace tileflight::publishing {

/// Takes commands of ROS 2's nodes to a simulator. For each vehicle V these are /V/cmd_vel (geometry_msgs/Twist:
/// forward, left, up and the turn about the vertical; only for vehicles that fly), which holds for half a second of the
/// simulation, and /V/goal_pose (geometry_msgs/PoseStamped in the frame `map`). Services: /tileflight/reset and
/// /tileflight/step (std_srvs/Trigger; a step of the clock, after which it is paused), /tileflight/pause
/// (std_srvs/SetBool).
class Ros2Control {
 public:
  /// Returns the simulator that is served at the moment, from any thread.
  using CurrentSimulator = std::function<std::shared_ptr<simulator::Simulator>()>;

  /// `participant` must outlive this. Throws InputError.
  Ros2Control(ros2::Participant& participant, CurrentSimulator simulator);
  ~Ros2Control();
  Ros2Control(const Ros2Control&) = delete;
  Ros2Control& operator=(const Ros2Control&) = delete;

 private:
  struct Inputs {
    std::unique_ptr<ros2::Subscription> velocity, goal;
  };

  void follow_vehicles(const std::stop_token& stop);
  void match_vehicles(const simulator::Observation& now);
  Inputs inputs_of(const simulator::ObservedVehicle& vehicle);

  ros2::Participant& participant_;
  CurrentSimulator simulator_;
  std::unique_ptr<ros2::Service> reset_, pause_, step_;
  std::map<std::string, Inputs> vehicles_;
  std::jthread thread_;
};

}  // namespace tileflight::publishing
