// Steers one vehicle of `tileflight serve --ros2`: flies up by /V/cmd_vel, to a goal by /V/goal_pose, and calls the
// services pause, step and reset. Prints where the vehicle is after each.
//
//   ros2 run tileflight_ros2_example steer --ros-args -p vehicle:=drone
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

#include "geometry_msgs/msg/pose_stamped.hpp"
#include "geometry_msgs/msg/twist.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "rclcpp/rclcpp.hpp"
#include "std_srvs/srv/set_bool.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace {

using geometry_msgs::msg::Point;
using geometry_msgs::msg::PoseStamped;
using geometry_msgs::msg::Twist;
using std_srvs::srv::SetBool;
using std_srvs::srv::Trigger;
using namespace std::chrono_literals;

constexpr auto kLimit = 30s;

class Steer : public rclcpp::Node {
 public:
  Steer() : Node("steer") {
    const std::string vehicle = "/" + declare_parameter<std::string>("vehicle", "drone");
    velocity_ = create_publisher<Twist>(vehicle + "/cmd_vel", 1);
    goal_ = create_publisher<PoseStamped>(vehicle + "/goal_pose", 1);
    odometry_ = create_subscription<nav_msgs::msg::Odometry>(
        vehicle + "/odometry", 10, [this](const nav_msgs::msg::Odometry::ConstSharedPtr message) {
          position_ = message->pose.pose.position;
          ++positions_;
        });
  }

  /// Throws std::runtime_error where something does not come within 30 s.
  void run() {
    wait("the vehicle", [this] { return positions_ > 0 && velocity_->get_subscription_count() > 0; });
    print("start");
    climb(2.0, 3s);
    print("cmd_vel, 2 m/s up for 3 s");
    fly_to(position_.x + 5.0, position_.y + 3.0, position_.z + 2.0);
    print("goal_pose, 5 m east, 3 m north, 2 m up");
    auto pause = std::make_shared<SetBool::Request>();
    pause->data = true;
    call<SetBool>("/tileflight/pause", pause);
    call<Trigger>("/tileflight/step", std::make_shared<Trigger::Request>());
    call<Trigger>("/tileflight/step", std::make_shared<Trigger::Request>());
    pause->data = false;
    call<SetBool>("/tileflight/pause", pause);
    call<Trigger>("/tileflight/reset", std::make_shared<Trigger::Request>());
    const int before = positions_;
    wait("odometry", [&] { return positions_ > before + 10; });
    print("after reset");
  }

 private:
  template <class Condition>
  void wait(const char* what, const Condition& is_true) {
    const auto end = std::chrono::steady_clock::now() + kLimit;
    while (!is_true()) {
      if (!rclcpp::ok() || std::chrono::steady_clock::now() > end)
        throw std::runtime_error(std::string(what) + " did not come");
      rclcpp::spin_some(shared_from_this());
      std::this_thread::sleep_for(5ms);
    }
  }

  void print(const char* when) const {
    std::printf("%s: (%.2f %.2f %.2f) m\n", when, position_.x, position_.y, position_.z);
  }

  /// A velocity holds for half a second, so it is sent again and again.
  void climb(double speed_m_s, std::chrono::seconds length) {
    Twist up;
    up.linear.z = speed_m_s;
    for (const auto end = std::chrono::steady_clock::now() + length; std::chrono::steady_clock::now() < end;) {
      velocity_->publish(up);
      rclcpp::spin_some(shared_from_this());
      std::this_thread::sleep_for(100ms);
    }
  }

  void fly_to(double x, double y, double z) {
    PoseStamped goal;
    goal.header.frame_id = "map";
    goal.pose.position.x = x;
    goal.pose.position.y = y;
    goal.pose.position.z = z;
    goal.pose.orientation.w = 1.0;
    goal_->publish(goal);
    wait("the vehicle at its goal",
         [&] { return std::hypot(position_.x - x, position_.y - y, position_.z - z) < 0.5; });
  }

  template <class Service>
  void call(const char* service, const typename Service::Request::SharedPtr& request) {
    const auto client = create_client<Service>(service);
    if (!client->wait_for_service(kLimit)) throw std::runtime_error(std::string(service) + " is not there");
    const auto begin = std::chrono::steady_clock::now();
    auto answer = client->async_send_request(request);
    if (rclcpp::spin_until_future_complete(shared_from_this(), answer, kLimit) != rclcpp::FutureReturnCode::SUCCESS)
      throw std::runtime_error(std::string(service) + " did not answer");
    const auto response = answer.get();
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
    std::printf("%s: %s, '%s', %.1f ms\n", service, response->success ? "success" : "failure",
                response->message.c_str(), took.count());
  }

  rclcpp::Publisher<Twist>::SharedPtr velocity_;
  rclcpp::Publisher<PoseStamped>::SharedPtr goal_;
  rclcpp::Subscription<nav_msgs::msg::Odometry>::SharedPtr odometry_;
  Point position_;
  int positions_ = 0;
};

}  // namespace

int main(int argc, char** argv) try {
  rclcpp::init(argc, argv);
  std::make_shared<Steer>()->run();
  rclcpp::shutdown();
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
