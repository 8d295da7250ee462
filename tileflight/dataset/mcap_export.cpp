#include "tileflight/dataset/mcap_export.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/dataset/exports.h"
#include "tileflight/dataset/imu_files.h"
#include "tileflight/dataset/lidar_files.h"
#include "tileflight/dataset/mcap_writer.h"
#include "tileflight/dataset/number_table.h"
#include "tileflight/dataset/ros_messages.h"

namespace tileflight::dataset {

namespace {

namespace fs = std::filesystem;

const std::string kMap = "map", kCamera = "camera", kImu = "imu", kLidar = "lidar";

/// A message to be created when it is written: images and scans are not all in memory at once.
struct PendingMessage {
  std::int64_t time_ns = 0;
  std::uint16_t channel = 0;
  std::function<std::string()> make;
};

/// All messages of a dataset, and their channels.
class MessageSequence {
 public:
  MessageSequence(const Dataset& dataset, McapWriter& writer) : dataset_(dataset), writer_(writer) {
    add_frames();
    add_truth();
    add_positions();
    add_imu();
    add_tables();
    add_scans();
    std::stable_sort(messages_.begin(), messages_.end(),
                     [](const PendingMessage& a, const PendingMessage& b) { return a.time_ns < b.time_ns; });
  }

  const std::vector<PendingMessage>& messages() const { return messages_; }
  const std::vector<std::string>& topics() const { return topics_; }

 private:
  std::uint16_t channel(const std::string& topic, const std::string& message) {
    topics_.push_back(topic);
    return writer_.add_channel(topic, "cdr", ros::schema(message));
  }

  /// `make` receives the message's time and frame.
  template <class Make>
  void add(double time_s, std::uint16_t channel, const std::string& frame_id, const Make& make) {
    const std::int64_t time_ns = std::llround(1e9 * time_s);
    messages_.push_back({time_ns, channel, [=] { return make(ros::Header{time_ns, frame_id}); }});
  }

  void add_frames() {
    const std::uint16_t images = channel("/camera/image/compressed", "sensor_msgs/msg/CompressedImage");
    const std::uint16_t infos = channel("/camera/camera_info", "sensor_msgs/msg/CameraInfo");
    const imaging::Camera& camera = dataset_.calibration.camera;
    for (const Frame& frame : dataset_.frames) {
      add(frame.time_s, infos, kCamera, [camera](const ros::Header& head) { return ros::camera_info(head, camera); });
      add(frame.time_s, images, kCamera, [image = frame.image](const ros::Header& head) {
        const char* format = image.extension() == ".png" ? "png" : "jpeg";
        return ros::compressed_image(head, format, base::read_text(image));
      });
    }
  }

  void add_truth() {
    if (!dataset_.groundtruth) return;
    const std::uint16_t transforms = channel("/tf", "tf2_msgs/msg/TFMessage");
    const geometry::SE3 T_cam_imu = dataset_.calibration.T_cam_imu;
    for (const geometry::StampedPose& pose : dataset_.groundtruth->poses) {
      add(pose.time_s, transforms, kMap,
          [T = pose.T_local_camera](const ros::Header& head) { return ros::transform(head, kCamera, T); });
      add(pose.time_s, transforms, kCamera,
          [T_cam_imu](const ros::Header& head) { return ros::transform(head, kImu, T_cam_imu); });
    }
    if (!fs::is_regular_file(dataset_.folder / "lidar" / "poses.txt")) return;
    for (const geometry::StampedPose& pose : geometry::read_tum(dataset_.folder / "lidar" / "poses.txt").poses)
      add(pose.time_s, transforms, kMap,
          [T = pose.T_local_camera](const ros::Header& head) { return ros::transform(head, kLidar, T); });
  }

  void add_positions() {
    if (dataset_.gps.empty()) return;
    const std::uint16_t fixes = channel("/gnss", "sensor_msgs/msg/NavSatFix");
    for (const GpsFix& fix : dataset_.gps)
      add(fix.time_s, fixes, kCamera, [fix](const ros::Header& head) { return ros::nav_sat_fix(head, fix); });
  }

  void add_imu() {
    if (dataset_.imu.empty()) return;
    const std::uint16_t readings = channel("/imu", "sensor_msgs/msg/Imu");
    for (const ImuReading& reading : read_imu_csv(dataset_.imu))
      add(reading.time_s, readings, kImu, [reading](const ros::Header& head) { return ros::imu(head, reading); });
  }

  /// Adds each row of a sensor's CSV file, if it exists; the first column is the time.
  template <class Make>
  void add_table(const char* name, std::size_t columns, const char* topic, const char* message, const Make& make) {
    const fs::path file = dataset_.folder / name;
    if (!fs::is_regular_file(file)) return;
    const NumberTable table = read_number_table(file);
    if (table.columns.size() < columns)
      throw InputError(file.string(), "has fewer than " + std::to_string(columns) + " columns");
    const std::uint16_t rows = channel(topic, message);
    for (const std::vector<double>& row : table.rows)
      add(row[0], rows, kImu, [row, make](const ros::Header& head) { return make(head, row); });
  }

  void add_tables() {
    add_table("barometer.csv", 2, "/barometer", "sensor_msgs/msg/FluidPressure",
              [](const ros::Header& head, const auto& row) { return ros::fluid_pressure(head, row[1]); });
    add_table("magnetometer.csv", 4, "/magnetometer", "sensor_msgs/msg/MagneticField",
              [](const ros::Header& head, const auto& row) {
                return ros::magnetic_field(head, geometry::Vec3(row[1], row[2], row[3]));
              });
    add_table("range.csv", 2, "/range", "sensor_msgs/msg/Range",
              [](const ros::Header& head, const auto& row) { return ros::range(head, row[1]); });
  }

  void add_scans() {
    const fs::path folder = dataset_.folder / "lidar";
    if (!fs::is_regular_file(folder / "poses.txt")) return;
    const std::uint16_t scans = channel("/lidar", "sensor_msgs/msg/PointCloud2");
    const std::vector<geometry::StampedPose> starts = geometry::read_tum(folder / "poses.txt").poses;
    for (std::size_t i = 0; i < starts.size(); ++i) {
      fs::path file = folder / (exports::frame_stem(i) + ".ply");
      if (!fs::is_regular_file(file)) file.replace_extension(".bin");
      add(starts[i].time_s, scans, kLidar,
          [file](const ros::Header& head) { return ros::point_cloud(head, read_scan(file)); });
    }
  }

  const Dataset& dataset_;
  McapWriter& writer_;
  std::vector<PendingMessage> messages_;
  std::vector<std::string> topics_;
};

}  // namespace

McapResult export_mcap(const Dataset& dataset, const fs::path& file, bool replace, const Progress& progress) {
  McapWriter writer(file, "ros2", replace);
  const MessageSequence recording(dataset, writer);
  const auto count = static_cast<std::int64_t>(recording.messages().size());
  std::int64_t done = 0;
  for (const PendingMessage& event : recording.messages()) {
    writer.add_message(event.channel, event.time_ns, event.make());
    report_progress(progress, ++done, count, "writing messages");
  }
  writer.finish();
  return {recording.messages().size(), recording.topics()};
}

}  // namespace tileflight::dataset
