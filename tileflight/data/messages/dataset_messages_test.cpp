#include "tileflight/data/messages/dataset_messages.h"

#include <gmock/gmock.h>

#include <cstring>

#include "tests/moving_picture.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/data/dataset/frame_layers.h"
#include "tileflight/data/messages/ros_messages.h"

namespace tileflight::messages::dataset_messages_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;

/// Three frames at 0.5 s, which turn left by 0.1 rad each while they move 2 m east; the second has a depth.
dataset::Dataset small_dataset(const fs::path& folder) {
  dataset::DatasetWriter writer(folder, {imaging::make_pinhole(4, 3, 90.0), {}, 0.0}, {.png = true});
  geometry::Trajectory truth;
  for (int i = 0; i < 3; ++i) {
    writer.add_frame(static_cast<std::size_t>(i), 0.5 * i, 0.0, imaging::RgbImage(4, 3, {9, 9, 9}));
    const Eigen::Quaterniond R(Eigen::AngleAxisd(0.1 * i, Vec3::UnitZ()));
    truth.poses.push_back({0.5 * i, {R, {2.0 * i, 0, 0}}});
  }
  writer.set_groundtruth(truth);
  imaging::FloatImage depth_m(4, 3, 7.0F);
  depth_m(3, 2) = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < 3; ++i) dataset::write_frame_layers(writer.temporary_folder(), i, {.depth_m = &depth_m});
  writer.finish();
  return dataset::read_dataset(folder);
}

std::vector<std::string> names(const DatasetMessages& listed) {
  std::vector<std::string> all;
  for (const MessageTopic& topic : listed.topics) all.push_back(topic.name);
  return all;
}

std::vector<DatasetMessage> of_topic(const DatasetMessages& listed, const std::string& name) {
  std::vector<DatasetMessage> found;
  for (const DatasetMessage& message : listed.messages) {
    if (listed.topics[message.topic].name == name) found.push_back(message);
  }
  return found;
}

template <class Number>
Number number_at(const std::string& bytes, std::size_t offset) {
  Number value{};
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

TEST(DatasetMessages, DepthAndOdometryAreListedWhenWanted) {
  const tests::TemporaryFolder folder;
  const dataset::Rig rig = dataset::rig_of(small_dataset(folder / "flight"));
  EXPECT_THAT(names(list_messages(rig)),
              testing::ElementsAre("/camera/image/compressed", "/camera/camera_info", "/tf"));
  EXPECT_THAT(
      names(list_messages(rig, {.depth = true, .odometry = true})),
      testing::ElementsAre("/camera/image/compressed", "/camera/camera_info", "/camera/depth", "/tf", "/odometry"));
}

TEST(DatasetMessages, TimesDoNotDecrease) {
  const tests::TemporaryFolder folder;
  const dataset::Rig rig = dataset::rig_of(small_dataset(folder / "flight"));
  const DatasetMessages listed = list_messages(rig, {.depth = true, .odometry = true});
  EXPECT_TRUE(std::ranges::is_sorted(listed.messages, {}, &DatasetMessage::time_ns));
  EXPECT_EQ(listed.messages.size(), 3U * 3U + 6U + 3U);
}

TEST(DatasetMessages, DepthIsMetresInRows) {
  const tests::TemporaryFolder folder;
  const dataset::Rig rig = dataset::rig_of(small_dataset(folder / "flight"));
  const std::string bytes = of_topic(list_messages(rig, {.depth = true}), "/camera/depth")[1].make();
  const std::size_t begin = bytes.size() - 4 * 3 * sizeof(float);
  EXPECT_EQ(number_at<std::uint32_t>(bytes, begin - 4), 48U) << "uint8[]'s length";
  EXPECT_EQ(number_at<std::uint32_t>(bytes, begin - 8), 16U) << "step";
  EXPECT_EQ(number_at<float>(bytes, begin), 7.0F);
  EXPECT_EQ(number_at<float>(bytes, bytes.size() - 4), std::numeric_limits<float>::infinity());
}

TEST(DatasetMessages, OdometryHasTheVelocitiesInTheCamerasAxes) {
  const tests::TemporaryFolder folder;
  const dataset::Rig rig = dataset::rig_of(small_dataset(folder / "flight"));
  const std::string bytes = of_topic(list_messages(rig, {.odometry = true}), "/odometry")[1].make();
  // The last fields: velocity, angular velocity, 36 covariances, all float64.
  const auto field = [&](std::size_t i) { return number_at<double>(bytes, bytes.size() - (42 - i) * sizeof(double)); };
  EXPECT_NEAR(field(0), 4.0 * std::cos(0.1), 1e-9) << "4 m/s east, seen by a camera turned left by 0.1 rad";
  EXPECT_NEAR(field(1), -4.0 * std::sin(0.1), 1e-9);
  EXPECT_NEAR(field(2), 0.0, 1e-9);
  EXPECT_NEAR(field(5), 0.2, 1e-9) << "rad/s about z";
}

TEST(DatasetMessages, OdometryHasTheCovariancesThatAreKnown) {
  ros::OdometryCovariances covariances;
  covariances.pose(0, 0) = 0.5;
  covariances.pose(1, 2) = covariances.pose(2, 1) = 0.25;
  covariances.velocity(5, 5) = 2.0;
  const std::string bytes = ros::odometry({0, "map"}, "body", geometry::SE3(), {}, covariances);
  // The last fields: 36 covariances of the pose, velocity, angular velocity, 36 covariances, all float64.
  const auto field = [&](std::size_t i) { return number_at<double>(bytes, bytes.size() - (78 - i) * sizeof(double)); };
  EXPECT_EQ(field(0), 0.5);
  EXPECT_EQ(field(8), 0.25);
  EXPECT_EQ(field(13), 0.25);
  EXPECT_EQ(field(77), 2.0);
}

}  // namespace
}  // namespace tileflight::messages::dataset_messages_test
