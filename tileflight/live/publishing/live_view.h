#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/messages/ros_messages.h"
#include "tileflight/live/foxglove/messages.h"
#include "tileflight/live/publishing/message_sink.h"
#include "tileflight/live/simulator/simulator.h"

namespace tileflight::publishing {

struct LiveOptions {
  double image_rate_hz = 10.0;  ///< maximum rate of images and scans, wall-clock time
  double pose_rate_hz = 30.0;   ///< maximum rate of all else; not below image_rate_hz
  int jpeg_quality = 85;
  bool may_pause = true;  ///< whether viewers may pause the simulation
};
inline constexpr double kMaxImageRate_hz = 60.0;

/// Shows a running simulator to viewers and nodes, at the simulation's times. For each vehicle V, camera C, lidar L and
/// IMU I: /V/C/image, /V/C/image/compressed, /V/C/camera_info, /V/C/depth, /V/L/points, /V/I/data_raw, /V/odometry,
/// /V/path, /V/gnss, /V/motion (numbers for plots); and /tf, /tf_static, /clock and /place (the tiles in memory when
/// the first viewer subscribes, sent once). Frames (REP 103, 105): map, V/odom (the same: the pose is the true one),
/// V/base_link, V/C_optical, V/L, V/I.
/// Only subscribed topics are rendered, and nothing that a client of the simulator reads depends on viewers.
class LiveView {
 public:
  using Log = std::function<void(const std::string& line)>;
  /// Returns the simulator that is served at the moment, from any thread: a client may load another level.
  using CurrentSimulator = std::function<std::shared_ptr<simulator::Simulator>()>;

  LiveView(CurrentSimulator simulator, const LiveOptions& options, Log log = {});
  ~LiveView();
  LiveView(const LiveView&) = delete;
  LiveView& operator=(const LiveView&) = delete;

  /// Returns the parameters that viewers may set: `paused`, of the simulation, and `image_rate_hz`.
  foxglove::ParameterAccess parameters();

  /// Adds the channels and begins to publish, in a thread of its own, until stop(). `sink` must live until then.
  void start(MessageSink& sink);
  void stop();

 private:
  using ChannelId = MessageSink::ChannelId;
  struct CameraChannels {
    ChannelId image = 0, compressed = 0, info = 0, depth = 0;
  };
  struct VehicleChannels {
    std::map<std::string, CameraChannels> cameras;
    std::map<std::string, ChannelId> lidars, imus;
    ChannelId odometry = 0, path = 0, gnss = 0, motion = 0;
    std::optional<ChannelId> location;         ///< of a vehicle that locates itself
    std::uint64_t located_ns = 0;              ///< of the latest location that was sent
    std::vector<geometry::StampedPose> flown;  ///< T_local_body
  };

  /// Topics that are published less often than the poses.
  struct Due {
    bool images = false;  ///< and scans
    bool paths = false;
  };

  void run(const std::stop_token& stop);
  void follow_level();
  void publish(const simulator::Observation& now, const Due& due, const std::stop_token& stop);
  void add_channels(const simulator::Observation& now);
  VehicleChannels channels_of(const simulator::ObservedVehicle& vehicle);
  void remove_channels(const VehicleChannels& channels);
  void publish_transforms(const simulator::Observation& now);
  void publish_static_transforms(const simulator::Observation& now);
  void publish_state(std::uint64_t time_ns, const simulator::ObservedVehicle& vehicle, const VehicleChannels& channels);
  void publish_camera(const simulator::ObservedVehicle& vehicle, const simulator::ObservedCamera& camera,
                      const CameraChannels& channels);
  void publish_location(const simulator::ObservedVehicle& vehicle, VehicleChannels& channels);
  void publish_picture(const messages::ros::Header& head, const imaging::RgbImage& picture,
                       const CameraChannels& channels);
  void publish_imu(const simulator::ObservedVehicle& vehicle, const std::string& imu, ChannelId channel);
  void publish_scan(const simulator::ObservedVehicle& vehicle, const simulator::ObservedLidar& lidar,
                    ChannelId channel);
  void start_place();
  void publish_place();
  /// Logs each failure once and shows it to viewers: a tile that cannot be read must not end the view.
  void report(const std::string& failure);
  void set_parameter(const foxglove::Parameter& wanted);
  double image_rate_hz() const;
  bool is_wanted(ChannelId channel) const { return sink_->is_wanted(channel); }

  CurrentSimulator simulator_;
  std::weak_ptr<simulator::Simulator> shown_;  ///< the simulator that channels and place belong to
  LiveOptions options_;
  Log log_;
  mutable std::mutex mutex_;  ///< guards the next two
  double image_rate_hz_;
  std::set<std::string> reported_;
  MessageSink* sink_ = nullptr;
  std::map<std::string, VehicleChannels> vehicles_;
  ChannelId tf_ = 0, tf_static_ = 0, clock_ = 0, place_ = 0;
  std::vector<messages::ros::FrameTransform> static_transforms_;  ///< the ones sent last
  std::jthread place_thread_;                                     ///< simplifying a place takes seconds
  std::jthread thread_;
};

}  // namespace tileflight::publishing
