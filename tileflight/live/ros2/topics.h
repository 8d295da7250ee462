#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "tileflight/live/ros2/entities.h"
#include "tileflight/live/ros2/participant.h"

namespace tileflight::ros2 {

/// Publishes messages of one topic. Thread-safe.
class Publisher {
 public:
  /// `topic` and `type` as in ROS 2 ("/drone/imu", "sensor_msgs/msg/Imu"); the topic's name is made valid. Throws
  /// InputError.
  Publisher(Participant& participant, const std::string& topic, const std::string& type,
            const QualityOfService& quality);
  ~Publisher();
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

  /// Returns whether anyone reads the topic.
  bool has_readers() const;
  /// Sends a message (CDR with its header). It never waits for a reader: a slow one misses messages.
  void publish(std::string cdr);
  /// Waits until all reliable readers have received everything, for `limit` at most.
  void wait_until_acknowledged(std::chrono::milliseconds limit) const;
  std::uint64_t sent() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Receives the messages of one topic.
class Subscription {
 public:
  /// Takes each message (CDR with its header, perhaps with padding after its end) in DDS's own thread, which it must
  /// not block. An exception is reported once (Participant::Log) and ends nothing.
  using Handler = std::function<void(std::string_view cdr)>;

  /// `topic` and `type` as in ROS 2 ("/drone/cmd_vel", "geometry_msgs/msg/Twist"); the topic's name is made valid.
  /// Messages of more than `max_bytes` are reported and left out. Throws InputError.
  Subscription(Participant& participant, const std::string& topic, const std::string& type,
               const QualityOfService& quality, Handler handler, std::size_t max_bytes = std::size_t{64} << 10U);
  ~Subscription();
  Subscription(const Subscription&) = delete;
  Subscription& operator=(const Subscription&) = delete;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::ros2
