#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/live/foxglove/messages.h"

namespace tileflight::publishing {

// The channels of viewers, and those of their messages that ROS 2 does not have.

/// A channel of ROS 2 messages (data/dataset/ros_messages.h): "sensor_msgs/msg/Imu". Viewers decode them by the
/// definition.
foxglove::Channel ros_channel(const std::string& topic, const std::string& type, bool is_latched = false);

/// Makes a channel of foxglove.SceneUpdate as JSON, for the place, which is sent once.
foxglove::Channel scene_channel(const std::string& topic);

/// Makes a foxglove.SceneUpdate with one entity "place": a model, as a binary glTF (which viewers turn from y up to z
/// up), at the origin of a frame. `attribution` is kept as the entity's metadata.
std::string scene_update(const std::string& glb, const std::string& frame_id, std::uint64_t time_ns,
                         const std::vector<std::string>& attribution);

/// Motion of a vehicle for plots; local frame: x east, y north, z up.
struct Motion {
  geometry::SE3 T_local_body;                                      ///< body x forward, y left, z up
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();            ///< body axes
  geometry::Vec3 angular_velocity_rad_s = geometry::Vec3::Zero();  ///< body axes
};
/// Makes a channel of Motion as JSON of plain numbers.
foxglove::Channel motion_channel(const std::string& topic);
/// Writes a Motion as JSON: position, roll, pitch (nose up) and heading (clockwise from north) in degrees, velocities,
/// speed.
std::string motion_text(const Motion& motion);

}  // namespace tileflight::publishing
