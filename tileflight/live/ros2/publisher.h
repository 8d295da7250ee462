#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

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

  /// Whether anyone reads it.
  bool has_readers() const;
  /// Sends a message (CDR with its header). Never waits for a reader: one that is slower than the messages misses some.
  void publish(std::string cdr);
  /// Waits until all reliable readers have got what was sent, for this time at most.
  void wait_until_acknowledged(std::chrono::milliseconds limit) const;
  std::uint64_t sent() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::ros2
