#pragma once

#include <string>

namespace tileflight::dataset {

/// The definition of a type of messages, for a file or a viewer.
struct MessageSchema {
  std::string name;      ///< "sensor_msgs/msg/Imu"
  std::string encoding;  ///< of `text`: "ros2msg"
  std::string text;
};

}  // namespace tileflight::dataset
