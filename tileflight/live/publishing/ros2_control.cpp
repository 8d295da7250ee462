#include "tileflight/live/publishing/ros2_control.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/data/messages/dataset_messages.h"
#include "tileflight/live/ros2/command_messages.h"

namespace tileflight::publishing {
namespace {

constexpr std::chrono::milliseconds kLookForVehicles{500};
constexpr double kVelocityHolds_s = 0.5;
constexpr ros2::QualityOfService kCommands{.depth = 1};

/// "bad orders end nothing": a service's failure is its answer.
template <class Work>
std::string answer_of(const Work& work) try {
  return ros2::service_response(true, work());
} catch (const std::exception& error) {
  return ros2::service_response(false, error.what());
}

std::string time_text(const simulator::Simulator& simulator) {
  return "simulation time " + std::to_string(simulator.viewer().observe().time_ns) + " ns";
}

geometry::SE3 goal_pose(std::string_view cdr, const std::string& topic) {
  const ros2::PoseStamped goal = ros2::read_pose_stamped(cdr, topic);
  if (goal.frame_id != messages::kMapFrame)
    throw InputError(topic, "a goal must be in the frame 'map', not '" + goal.frame_id.substr(0, 100) + "'");
  const auto& [x, y, z] = goal.position_m;
  const auto& q = goal.orientation_xyzw;
  return {Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized(), geometry::Vec3(x, y, z)};
}

}  // namespace

Ros2Control::Ros2Control(ros2::Participant& participant, CurrentSimulator simulator)
    : participant_(participant), simulator_(std::move(simulator)) {
  const auto trigger = [this](const auto& work) {
    return [this, work](std::string_view /*request*/) {
      return answer_of([&] {
        const auto current = simulator_();
        work(*current);
        return time_text(*current);
      });
    };
  };
  reset_ = std::make_unique<ros2::Service>(participant, "/tileflight/reset", "std_srvs/srv/Trigger",
                                           trigger([](simulator::Simulator& world) { world.reset(); }));
  step_ = std::make_unique<ros2::Service>(
      participant, "/tileflight/step", "std_srvs/srv/Trigger",
      trigger([](simulator::Simulator& world) { world.clock().continue_for_frames(1); }));
  pause_ = std::make_unique<ros2::Service>(participant, "/tileflight/pause", "std_srvs/srv/SetBool",
                                           [this](std::string_view request) {
                                             const bool is_paused = ros2::read_set_bool(request, "/tileflight/pause");
                                             return answer_of([&] {
                                               simulator_()->clock().pause(is_paused);
                                               return std::string(is_paused ? "paused" : "running");
                                             });
                                           });
  match_vehicles(simulator_()->viewer().observe());
  thread_ = std::jthread([this](const std::stop_token& stop) { follow_vehicles(stop); });
}

Ros2Control::~Ros2Control() { thread_ = {}; }

/// Vehicles come and go, by clients' calls and with levels.
void Ros2Control::follow_vehicles(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any wake;
  std::unique_lock lock(mutex);
  while (!stop.stop_requested()) {
    wake.wait_for(lock, stop, kLookForVehicles, [] { return false; });
    try {
      match_vehicles(simulator_()->viewer().observe());
    } catch (const std::exception& error) {
      participant_.report(error.what());
    }
  }
}

void Ros2Control::match_vehicles(const simulator::Observation& now) {
  std::erase_if(vehicles_, [&](const auto& known) {
    return std::ranges::find(now.vehicles, known.first, &simulator::ObservedVehicle::name) == now.vehicles.end();
  });
  for (const simulator::ObservedVehicle& vehicle : now.vehicles) {
    if (!vehicles_.contains(vehicle.name)) vehicles_.emplace(vehicle.name, inputs_of(vehicle));
  }
}

Ros2Control::Inputs Ros2Control::inputs_of(const simulator::ObservedVehicle& vehicle) {
  Inputs inputs;
  const std::string root = "/" + vehicle.name;
  if (vehicle.flies) {
    inputs.velocity = std::make_unique<ros2::Subscription>(
        participant_, root + "/cmd_vel", "geometry_msgs/msg/Twist", kCommands,
        [this, name = vehicle.name, topic = root + "/cmd_vel"](std::string_view cdr) {
          const ros2::Twist twist = ros2::read_twist(cdr, topic);
          const auto& [forward, left, up] = twist.linear_m_s;
          simulator_()->flight().start_velocity({forward, left, up}, twist.angular_rad_s[2], kVelocityHolds_s, name);
        });
  }
  inputs.goal = std::make_unique<ros2::Subscription>(
      participant_, root + "/goal_pose", "geometry_msgs/msg/PoseStamped", kCommands,
      [this, name = vehicle.name, topic = root + "/goal_pose"](std::string_view cdr) {
        simulator_()->flight().start_pose(goal_pose(cdr, topic), name);
      });
  return inputs;
}

}  // namespace tileflight::publishing
