#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/rig.h"

namespace tileflight::messages {

// Frames of the messages: kMapFrame is the dataset's local frame (east, north, up), kCameraFrame a camera's (x right,
// y down, z forward).
inline const std::string kMapFrame = "map", kCameraFrame = "camera";

/// Messages of one type under one topic.
struct MessageTopic {
  std::string name;         ///< "/camera/image/compressed"
  std::string type;         ///< "sensor_msgs/msg/CompressedImage"
  bool is_latched = false;  ///< sent once and kept for later subscribers
};

/// A message that is encoded when it is wanted, so that images and scans are not all in memory at once.
struct DatasetMessage {
  std::int64_t time_ns = 0;
  std::size_t topic = 0;              ///< index into DatasetMessages::topics
  std::function<std::string()> make;  ///< its bytes (CDR). Throws InputError for a file that cannot be read.
};

/// The content of a dataset as ROS 2 messages in the order of their times.
struct DatasetMessages {
  std::vector<MessageTopic> topics;
  std::vector<DatasetMessage> messages;
  std::int64_t epoch_ns = 0;       ///< added to all times of the dataset
  std::vector<std::string> notes;  ///< what was chosen for the user
};

/// Selects what is listed besides the images, their calibration, the transforms and the sensors' readings.
struct MessageSelection {
  bool depth = false;     ///< /camera/depth: images in metres (32FC1), infinite where there is no surface
  bool odometry = false;  ///< /odometry: the true poses of the camera with their velocities
  /// /tf_static: camera to IMU once, at the begin, instead of at each pose in /tf
  bool static_transforms = false;
  /// Seconds from 1970 to the dataset's time 0, from 0. nullopt: 0; or if a message's time would be 0 or before, whole
  /// seconds after which the first message lies between 1 and 2 s, because ROS takes the time 0 for none (a note).
  std::optional<double> epoch_s = 0.0;
  /// Names of the cameras of a rig whose images are listed; empty: all. Nothing else depends on it.
  std::vector<std::string> cameras{};
};

/// Lists the messages of a rig, in the order of their times on the body's clock.
///   each camera       /NAME/image/compressed, /NAME/camera_info and, if selected, /NAME/depth; its frame has its name.
///                     The only camera of a dataset, which has no name, is called `camera`.
///   /tf               map to the first camera, to IMU and lidar, if the true poses are known
///   /tf_static        the first camera to the others
///   other sensors     /imu, /gnss, /barometer, /magnetometer, /range and /lidar, if present
/// `rig` must outlive the messages. Throws InputError (file, cause).
DatasetMessages list_messages(const dataset::Rig& rig, const MessageSelection& selection = {});

}  // namespace tileflight::messages
