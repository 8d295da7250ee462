#include "tileflight/data/messages/dataset_messages.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <span>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/frame_layers.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/dataset/lidar_files.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/messages/ros_messages.h"

namespace tileflight::messages {

namespace {

namespace fs = std::filesystem;

const std::string kImu = "imu", kLidar = "lidar";

/// Velocities between the poses before and after, in the camera's frame; zero for a single pose.
ros::Velocity velocity_at(const std::vector<geometry::StampedPose>& poses, std::size_t i) {
  const geometry::StampedPose& before = poses[i == 0 ? 0 : i - 1];
  const geometry::StampedPose& after = poses[std::min(i + 1, poses.size() - 1)];
  const double seconds = after.time_s - before.time_s;
  if (seconds <= 0.0) return {};
  const geometry::SE3 T = before.T_local_camera.inverse() * after.T_local_camera;
  const Eigen::Quaterniond R_camera_local = poses[i].T_local_camera.rotation.conjugate();
  const geometry::Vec3 way_m = after.T_local_camera.translation - before.T_local_camera.translation;
  return {R_camera_local * (way_m / seconds), geometry::so3_log(T.rotation) / seconds};
}

/// A camera whose messages are listed.
struct ListedCamera {
  std::string frame_id;          ///< also the begin of its topics
  geometry::SE3 T_first_camera;  ///< on the first camera
  double timeshift_s = 0.0;      ///< added to its times
  const dataset::Dataset* dataset = nullptr;
};

std::vector<ListedCamera> cameras_of(const dataset::Rig& rig) {
  std::vector<ListedCamera> cameras;
  const geometry::SE3 T_first_body = rig.cameras.front().T_body_camera.inverse();
  for (const dataset::RigCamera& camera : rig.cameras)
    cameras.push_back({camera.name.empty() ? kCameraFrame : camera.name, T_first_body * camera.T_body_camera,
                       camera.timeshift_s, &camera.dataset});
  return cameras;
}

/// Lists the messages. Sensors and poses are those of the first camera's dataset.
class MessageLister {
 public:
  MessageLister(std::vector<ListedCamera> cameras, const MessageSelection& selection, std::int64_t epoch_ns)
      : cameras_(std::move(cameras)),
        dataset_(*cameras_.front().dataset),
        first_frame_(cameras_.front().frame_id),
        shift_s_(cameras_.front().timeshift_s),
        epoch_ns_(epoch_ns) {
    listed_.epoch_ns = epoch_ns;
    const auto is_shown = [&wanted = selection.cameras](const ListedCamera& camera) {
      return wanted.empty() || std::ranges::find(wanted, camera.frame_id) != wanted.end();
    };
    for (const ListedCamera& camera : cameras_) {
      if (is_shown(camera)) add_frames(camera);
    }
    for (const ListedCamera& camera : cameras_) {
      if (selection.depth && is_shown(camera)) add_depth(camera);
    }
    add_truth(selection.static_transforms);
    if (selection.odometry) add_odometry();
    add_positions();
    add_imu();
    add_tables();
    add_scans();
    std::ranges::stable_sort(listed_.messages, {}, &DatasetMessage::time_ns);
  }

  DatasetMessages take() && { return std::move(listed_); }

 private:
  std::size_t topic(const std::string& name, const std::string& type) {
    listed_.topics.push_back({name, type, false});
    return listed_.topics.size() - 1;
  }

  /// `make` receives the message's time and frame.
  template <class Make>
  void add(double time_s, std::size_t topic, const std::string& frame_id, const Make& make) {
    const std::int64_t time_ns = std::llround(1e9 * time_s) + epoch_ns_;
    listed_.messages.push_back({time_ns, topic, [=] { return make(ros::Header{time_ns, frame_id}); }});
  }

  void add_frames(const ListedCamera& listed) {
    const std::size_t images = topic("/" + listed.frame_id + "/image/compressed", "sensor_msgs/msg/CompressedImage");
    const std::size_t infos = topic("/" + listed.frame_id + "/camera_info", "sensor_msgs/msg/CameraInfo");
    const imaging::Camera& camera = listed.dataset->calibration.camera;
    for (const dataset::Frame& frame : listed.dataset->frames) {
      const double time_s = frame.time_s + listed.timeshift_s;
      add(time_s, infos, listed.frame_id, [camera](const ros::Header& head) { return ros::camera_info(head, camera); });
      add(time_s, images, listed.frame_id, [image = frame.image](const ros::Header& head) {
        const std::string bytes = base::read_raw(image);
        if (bytes.starts_with("\x89PNG")) return ros::compressed_image(head, "png", bytes);
        if (bytes.starts_with("\xFF\xD8")) return ros::compressed_image(head, "jpeg", bytes);
        const std::vector<std::byte> png = imaging::recode_png(std::as_bytes(std::span(bytes)), image.string());
        return ros::compressed_image(head, "png", std::string(base::as_text(png)));
      });
    }
  }

  void add_depth(const ListedCamera& listed) {
    const std::vector<dataset::Frame>& frames = listed.dataset->frames;
    if (std::ranges::all_of(frames, [](const dataset::Frame& one) { return one.depth.empty(); })) return;
    const std::size_t images = topic("/" + listed.frame_id + "/depth", "sensor_msgs/msg/Image");
    for (const dataset::Frame& frame : frames) {
      if (frame.depth.empty()) continue;
      add(frame.time_s + listed.timeshift_s, images, listed.frame_id,
          [dataset = listed.dataset, frame](const ros::Header& head) {
            return ros::depth_image(head, *dataset::read_depth(*dataset, frame));
          });
    }
  }

  void add_odometry() {
    if (!dataset_.groundtruth) return;
    const std::size_t topic_index = topic("/odometry", "nav_msgs/msg/Odometry");
    const std::vector<geometry::StampedPose>& poses = dataset_.groundtruth->poses;
    for (std::size_t i = 0; i < poses.size(); ++i)
      add(poses[i].time_s + shift_s_, topic_index, kMapFrame,
          [T = poses[i].T_local_camera, v = velocity_at(poses, i), frame = first_frame_](const ros::Header& head) {
            return ros::odometry(head, frame, T, v);
          });
  }

  void add_truth(bool static_transforms) {
    if (static_transforms || cameras_.size() > 1) add_static_transforms(static_transforms);
    if (!dataset_.groundtruth) return;
    const std::size_t transforms = topic("/tf", "tf2_msgs/msg/TFMessage");
    for (const geometry::StampedPose& pose : dataset_.groundtruth->poses) {
      add(pose.time_s + shift_s_, transforms, kMapFrame,
          [T = pose.T_local_camera, frame = first_frame_](const ros::Header& head) {
            return ros::transform(head, frame, T);
          });
      if (!static_transforms) add_imu_transform(pose.time_s + shift_s_, transforms);
    }
    if (!fs::is_regular_file(dataset_.folder / "lidar" / "poses.txt")) return;
    for (const geometry::StampedPose& pose : geometry::read_tum(dataset_.folder / "lidar" / "poses.txt").poses)
      add(pose.time_s, transforms, kMapFrame,
          [T = pose.T_local_camera](const ros::Header& head) { return ros::transform(head, kLidar, T); });
  }

  void add_imu_transform(double time_s, std::size_t topic_index) {
    add(time_s, topic_index, first_frame_, [T_cam_imu = dataset_.calibration.T_cam_imu](const ros::Header& head) {
      return ros::transform(head, kImu, T_cam_imu);
    });
  }

  /// One message of all: a node that comes later gets the last one only.
  void add_static_transforms(bool with_imu) {
    if (dataset_.frames.empty()) return;
    const std::size_t transforms = topic("/tf_static", "tf2_msgs/msg/TFMessage");
    listed_.topics[transforms].is_latched = true;
    std::vector<std::pair<std::string, geometry::SE3>> fixed;
    if (with_imu) fixed.emplace_back(kImu, dataset_.calibration.T_cam_imu);
    for (std::size_t c = 1; c < cameras_.size(); ++c)
      fixed.emplace_back(cameras_[c].frame_id, cameras_[c].T_first_camera);
    add(dataset_.frames.front().time_s + shift_s_, transforms, first_frame_, [fixed](const ros::Header& head) {
      std::vector<ros::FrameTransform> all;
      for (const auto& [frame, T] : fixed) all.push_back({head, frame, T});
      return ros::transforms(all);
    });
  }

  void add_positions() {
    if (dataset_.gps.empty()) return;
    const std::size_t fixes = topic("/gnss", "sensor_msgs/msg/NavSatFix");
    for (const dataset::GpsFix& fix : dataset_.gps)
      add(fix.time_s, fixes, first_frame_, [fix](const ros::Header& head) { return ros::nav_sat_fix(head, fix); });
  }

  void add_imu() {
    if (dataset_.imu.empty()) return;
    const std::size_t readings = topic("/imu", "sensor_msgs/msg/Imu");
    for (const geometry::ImuSample& reading : dataset::read_imu_csv(dataset_.imu))
      add(reading.time_s, readings, kImu, [reading](const ros::Header& head) { return ros::imu(head, reading); });
  }

  /// Adds each row of a sensor's CSV file, if it exists; the first column is the time.
  template <class Make>
  void add_table(const char* name, std::size_t columns, const char* name_of_topic, const char* type, const Make& make) {
    const fs::path file = dataset_.folder / name;
    if (!fs::is_regular_file(file)) return;
    const dataset::NumberTable table = dataset::read_number_table(file);
    if (table.columns.size() < columns)
      throw InputError(file.string(), "has fewer than " + std::to_string(columns) + " columns");
    const std::size_t rows = topic(name_of_topic, type);
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
    const std::size_t scans = topic("/lidar", "sensor_msgs/msg/PointCloud2");
    const std::vector<geometry::StampedPose> starts = geometry::read_tum(folder / "poses.txt").poses;
    for (std::size_t i = 0; i < starts.size(); ++i) {
      fs::path file = folder / (dataset::frame_id(i) + ".ply");
      if (!fs::is_regular_file(file)) file.replace_extension(".bin");
      add(starts[i].time_s, scans, kLidar,
          [file](const ros::Header& head) { return ros::point_cloud(head, dataset::read_scan(file)); });
    }
  }

  std::vector<ListedCamera> cameras_;
  const dataset::Dataset& dataset_;  ///< the first camera's
  std::string first_frame_;
  double shift_s_;
  std::int64_t epoch_ns_;
  DatasetMessages listed_;
};

constexpr std::int64_t kSecond_ns = 1'000'000'000;

/// ROS's stamps have seconds of 32 bits; a day is left for the flight.
std::int64_t epoch_in_ns(double epoch_s) {
  constexpr double kLast_s = 2147483647.0 - 86400.0;
  if (!(epoch_s >= 0.0 && epoch_s <= kLast_s))
    throw InputError("--epoch", "must be seconds since 1970, from 0 to 2147397247, the last that ROS can store");
  return std::llround(1e9 * epoch_s);
}

/// The shift by which a time that is not after 0 comes to lie between 1 and 2 s.
std::int64_t whole_seconds_after_0(std::int64_t time_ns) {
  return (1 - time_ns / kSecond_ns + (time_ns % kSecond_ns != 0)) * kSecond_ns;
}

}  // namespace

DatasetMessages list_messages(const dataset::Rig& rig, const MessageSelection& selection) {
  const auto list = [&](std::int64_t epoch_ns) { return MessageLister(cameras_of(rig), selection, epoch_ns).take(); };
  DatasetMessages listed = list(epoch_in_ns(selection.epoch_s.value_or(0.0)));
  if (selection.epoch_s || listed.messages.empty() || listed.messages.front().time_ns > 0) return listed;
  listed = list(whole_seconds_after_0(listed.messages.front().time_ns));
  listed.notes.push_back("times are " + std::to_string(listed.epoch_ns / kSecond_ns) +
                         " s later than the dataset's: ROS takes the time 0 for none (--epoch sets another shift)");
  return listed;
}

}  // namespace tileflight::messages
