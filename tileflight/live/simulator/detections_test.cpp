#include "tileflight/live/simulator/detections.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "tileflight/live/simulator/object_names.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::simulator::detections_test {
namespace {

using namespace test_world;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

std::vector<std::string> names_of(const std::vector<DetectionInfo>& detections) {
  std::vector<std::string> names;
  for (const DetectionInfo& one : detections) names.push_back(one.name);
  return names;
}

bool matches(const std::string& wildcards, const std::string& name) {
  return simulator::NamePattern(wildcards_to_regex(wildcards), simulator::NamePattern::Case::kIgnored).matches(name);
}

TEST(Wildcards, StarsAreAnyTextAndQuestionMarksACharacter) {
  EXPECT_TRUE(matches("north*", "North wall"));
  EXPECT_TRUE(matches("*", ""));
  EXPECT_TRUE(matches("?orth wal*l", "north wall"));
  EXPECT_FALSE(matches("north", "north wall"));
  EXPECT_FALSE(matches("?north wall", "north wall"));
  EXPECT_TRUE(matches("tiles/0.glb#3 (a+b)", "tiles/0.glb#3 (a+b)"));
  EXPECT_FALSE(matches("0.glb", "0xglb")) << "a point is a point";
  EXPECT_TRUE(matches("t\xc3\xbcr*", "T\xc3\xbcr 1"));
}

/// A camera 10 m up that looks north at the wall.
class Detections : public testing::Test {
 protected:
  Detections() { world_->vehicles().set_vehicle_pose(pose(0, 0, -10), true, ""); }
  std::vector<DetectionInfo> detected() { return world_->detections().get_detections("0", 0, "", false); }
  void look_for(const std::string& name) {
    world_->detections().add_detection_filter_mesh_name("0", 0, name, "", false);
  }

  std::unique_ptr<Simulator> world_ = simulator(kComputerVision);
};

TEST_F(Detections, AreOfTheNamesThatWereAskedFor) {
  EXPECT_THAT(detected(), IsEmpty());
  look_for("NORTH*");
  EXPECT_THAT(names_of(detected()), ElementsAre("north_wall"));
  look_for("ground");
  EXPECT_THAT(names_of(detected()), ElementsAre("ground", "north_wall"));
  EXPECT_THAT(world_->detections().get_detections("0", 5, "", false), IsEmpty())
      << "each kind of picture has its own filter";
  EXPECT_THAT(world_->detections().get_detections("4", 0, "", false), IsEmpty()) << "each camera, too";
  world_->detections().clear_detection_mesh_names("0", 0, "", false);
  EXPECT_THAT(detected(), IsEmpty());
}

TEST_F(Detections, BoxesAreThoseOfThePixelsThatShowTheObject) {
  look_for("*");
  const std::vector<DetectionInfo> all = detected();
  for (const DetectionInfo& one : all) {
    world_->labels().set_segmentation_object_id(".*", 0, true);
    world_->labels().set_segmentation_object_id(one.name, 1, false);
    const ImageResponse only = world_->cameras().get_images({{"0", 5, false, false}}, "", false).at(0);
    int left = only.width, top = only.height, right = 0, bottom = 0;
    for (int y = 0; y < only.height; ++y) {
      for (int x = 0; x < only.width; ++x) {
        const std::size_t i =
            3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(only.width) + static_cast<std::size_t>(x));
        if (only.image_data_uint8[i] + only.image_data_uint8[i + 1] + only.image_data_uint8[i + 2] == 0) continue;
        left = std::min(left, x);
        top = std::min(top, y);
        right = std::max(right, x + 1);
        bottom = std::max(bottom, y + 1);
      }
    }
    EXPECT_EQ(one.box2D.min.x_val, static_cast<float>(left)) << one.name;
    EXPECT_EQ(one.box2D.min.y_val, static_cast<float>(top)) << one.name;
    EXPECT_EQ(one.box2D.max.x_val, static_cast<float>(right)) << one.name;
    EXPECT_EQ(one.box2D.max.y_val, static_cast<float>(bottom)) << one.name;
  }
  EXPECT_GE(all.size(), 2U);
}

TEST_F(Detections, AreRelativeToTheCamera) {
  look_for("north_wall");
  const DetectionInfo ahead = detected().at(0);
  EXPECT_NEAR(ahead.box3D.min.x_val, kWallNorth_m, 1e-4);
  EXPECT_NEAR(ahead.box3D.max.x_val, kWallNorth_m + 1.0, 1e-4);
  EXPECT_NEAR(ahead.box3D.min.y_val, -60.0, 1e-4);
  EXPECT_NEAR(ahead.box3D.max.y_val, 25.0, 1e-4);
  EXPECT_NEAR(ahead.box3D.min.z_val, -30.0, 1e-4) << "down: the wall's top is 40 m high, the camera 10";
  EXPECT_NEAR(ahead.box3D.max.z_val, 10.0, 1e-4);
  EXPECT_NEAR(ahead.relative_pose.position.x_val, kWallNorth_m + 0.5, 1e-4);
  EXPECT_NEAR(ahead.relative_pose.position.y_val, -17.5, 1e-4);
  EXPECT_NEAR(ahead.relative_pose.orientation.w_val, 1.0, 1e-6);
  world_->vehicles().set_vehicle_pose(pose(0, 0, -10, -std::numbers::pi / 4), true, "");
  const DetectionInfo askew = detected().at(0);
  const double north = kWallNorth_m + 0.5, east = -17.5, half = std::sqrt(0.5);
  EXPECT_NEAR(askew.relative_pose.position.x_val, half * north - half * east, 1e-4);
  EXPECT_NEAR(askew.relative_pose.position.y_val, half * north + half * east, 1e-4);
}

TEST_F(Detections, AreNoFartherThanTheRadius) {
  look_for("north_wall");
  const double away_m = std::hypot(kWallNorth_m + 0.5, 17.5, 10.0);
  world_->detections().set_detection_filter_radius("0", 0, static_cast<float>(100.0 * away_m + 1.0), "", false);
  EXPECT_THAT(names_of(detected()), ElementsAre("north_wall"));
  world_->detections().set_detection_filter_radius("0", 0, static_cast<float>(100.0 * away_m - 1.0), "", false);
  EXPECT_THAT(detected(), IsEmpty());
}

TEST_F(Detections, AreNotOfWhatIsHidden) {
  look_for("east_wall");
  world_->vehicles().set_vehicle_pose(pose(30, 0, -10, std::numbers::pi), true,
                                      "");  // behind the north wall, looking south
  EXPECT_THAT(detected(), IsEmpty());
}

TEST_F(Detections, LeaveTheFlowOfPicturesAlone) {
  look_for("*");
  const std::vector<ImageRequest> flow{{"0", 8, true, false}};
  world_->cameras().get_images(flow, "", false);
  world_->vehicles().set_vehicle_pose(pose(0, 1, -10), true, "");
  detected();
  const ImageResponse moved = world_->cameras().get_images(flow, "", false).at(0);
  EXPECT_NEAR(moved.image_data_float.at(72 * 256 + 128), -128.0 / kWallNorth_m, 1e-2);
}

TEST_F(Detections, WhatCannotBeIsRefused) {
  EXPECT_THAT([&] { world_->detections().get_detections("nobody's", 0, "", false); },
              testing::ThrowsMessage<std::runtime_error>(HasSubstr("does not exist")));
  EXPECT_THAT([&] { world_->detections().get_detections("0", 12, "", false); },
              testing::ThrowsMessage<std::runtime_error>(HasSubstr("image type 12")));
  EXPECT_THAT([&] { world_->detections().set_detection_filter_radius("0", 0, NAN, "", false); },
              ThrowsMessage<std::runtime_error>(HasSubstr("the radius must be from 0 to 1e9 centimetres")));
  EXPECT_THAT([&] { look_for(std::string(2000, 'x')); },
              ThrowsMessage<std::runtime_error>(HasSubstr("longer than 1000 characters")));
}

}  // namespace
}  // namespace tileflight::simulator::detections_test
