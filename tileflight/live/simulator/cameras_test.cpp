#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "tests/refusal.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/live/simulator/image_renderer.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::simulator::cameras_test {
namespace {

using namespace test_world;
using std::numbers::pi;
using testing::HasSubstr;

constexpr int kDepth = 1, kRange = 2, kDepthVis = 3, kDisparity = 4, kSegmentation = 5, kNormals = 6, kInfrared = 7,
              kFlow = 8, kLighting = 10, kAnnotation = 11;

ImageResponse take(Simulator& world, int type, bool as_float, const std::string& camera = "0") {
  return world.cameras().get_images({{camera, type, as_float, false}}, "", false).at(0);
}

float at(const ImageResponse& image, int x, int y) {
  return image.image_data_float.at(static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                                   static_cast<std::size_t>(x));
}

std::array<int, 3> bgr_at(const ImageResponse& image, int x, int y) {
  const std::size_t i =
      3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x));
  return {image.image_data_uint8.at(i), image.image_data_uint8.at(i + 1), image.image_data_uint8.at(i + 2)};
}

TEST(ApiImages, DepthOfAWallAheadIsItsDistanceAndItsRangeThatOverTheCosine) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  const auto images =
      world->cameras().get_images({{"0", kDepth, true, false}, {"front_center", kRange, true, true}}, "", false);
  const ImageResponse &depth = images[0], &range = images[1];
  ASSERT_EQ(depth.image_data_float.size(), 256U * 144U);
  EXPECT_TRUE(depth.image_data_uint8.empty());
  for (const int x : {20, 127, 128, 200}) {
    for (const int y : {20, 71, 72, 100}) {
      EXPECT_NEAR(at(depth, x, y), 20.0, 1e-4);
      const double across = (x + 0.5 - 128) / 128, down = (y + 0.5 - 72) / 128;
      EXPECT_NEAR(at(range, x, y), 20.0 * std::sqrt(1 + across * across + down * down), 1e-4);
    }
  }
}

TEST(ApiImages, MovingNorthInNedComesNearerToTheWall) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(12.5F, 0, -10), true, "");
  const ImageResponse depth = take(*world, kDepth, true);
  EXPECT_NEAR(at(depth, 128, 72), 7.5, 1e-4);
  EXPECT_FLOAT_EQ(depth.camera_position.x_val, 12.5F);
  EXPECT_FLOAT_EQ(depth.camera_position.z_val, -10.0F);
}

TEST(ApiImages, YawTurnsClockwiseFromNorthToEast) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10, pi / 2), true, "");
  EXPECT_NEAR(at(take(*world, kDepth, true), 100, 60), kWallEast_m, 1e-4);
  EXPECT_NEAR(at(take(*world, kDepth, true, "bottom_center"), 128, 72), 10.0, 1e-4);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10, pi), true, "");
  EXPECT_NEAR(at(take(*world, kDepth, true, "4"), 128, 72), kWallNorth_m, 1e-4) << "the camera behind looks back";
}

TEST(ApiImages, SkyIsALargeFiniteDistance) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -100), true, "");
  for (const int type : {kDepth, kRange}) EXPECT_FLOAT_EQ(at(take(*world, type, true), 128, 5), 65504.0F);
  EXPECT_FLOAT_EQ(at(take(*world, kDepthVis, true), 128, 5), 1.0F);
  EXPECT_FLOAT_EQ(at(take(*world, kDisparity, true), 128, 5), 0.0F);
}

TEST(ApiImages, DepthVisAndDisparityFollowFromDepth) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  EXPECT_NEAR(at(take(*world, kDepthVis, true), 128, 72), 0.2, 1e-5);
  EXPECT_NEAR(at(take(*world, kDisparity, true), 128, 72), 128 * 0.25 / 20 / 256, 1e-6);
  EXPECT_EQ(bgr_at(take(*world, kDepth, false), 128, 72)[0], 255) << "metres as a share of white saturate";
}

TEST(ApiImages, RawPixelsAreBlueGreenRedAndPngHasTheSameColoursWithAlpha) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  const ImageResponse raw = take(*world, 0, false);
  ASSERT_EQ(raw.image_data_uint8.size(), 3U * 256 * 144);
  EXPECT_EQ(bgr_at(raw, 128, 72), (std::array<int, 3>{kWallColour[2], kWallColour[1], kWallColour[0]}));
  const std::vector<std::uint8_t> png = world->cameras().get_image("0", 0, "", false);
  ASSERT_GT(png.size(), 26U);
  EXPECT_EQ(png[24], 8) << "bits";
  EXPECT_EQ(png[25], 6) << "RGBA";
  const imaging::RgbImage decoded = imaging::decode_rgb(std::as_bytes(std::span(png)), "answer");
  ASSERT_EQ(decoded.width, 256);
  for (int y = 0; y < decoded.height; ++y) {
    for (int x = 0; x < decoded.width; ++x) {
      const auto [b, g, r] = bgr_at(raw, x, y);
      ASSERT_EQ(decoded(x, y), (imaging::Rgb8{static_cast<std::uint8_t>(r), static_cast<std::uint8_t>(g),
                                              static_cast<std::uint8_t>(b)}));
    }
  }
  EXPECT_NEAR(at(take(*world, 0, true), 128, 72), kWallColour[0] / 255.0, 1e-6) << "as numbers: red";
}

TEST(ApiImages, TheFirstRowIsTheTop) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(-100, 0, -5), true, "");
  const ImageResponse depth = take(*world, kDepth, true);
  EXPECT_FLOAT_EQ(at(depth, 128, 0), 65504.0F);
  EXPECT_LT(at(depth, 128, 143), 20.0F);
}

TEST(ApiImages, SegmentationColoursAndInfraredFollowTheIds) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  EXPECT_TRUE(world->labels().set_segmentation_object_id("NORTH.*", 7, true)) << "patterns have no case";
  EXPECT_EQ(world->labels().get_segmentation_object_id("north_wall"), 7);
  EXPECT_EQ(bgr_at(take(*world, kSegmentation, false), 128, 72), (std::array<int, 3>{195, 176, 115}));
  EXPECT_EQ(bgr_at(take(*world, kInfrared, false), 128, 72), (std::array<int, 3>{7, 7, 7}));
  EXPECT_FALSE(world->labels().set_segmentation_object_id("North_wall", 8, false)) << "plain names have";
  EXPECT_TRUE(world->labels().set_segmentation_object_id("north_wall", -1, false));
  EXPECT_EQ(bgr_at(take(*world, kSegmentation, false), 128, 72), (std::array<int, 3>{0, 0, 0})) << "hidden";
  EXPECT_EQ(world->labels().get_segmentation_object_id("no such"), -1);
  EXPECT_THAT(world->objects().list_scene_objects(".*_wall"), testing::ElementsAre("east_wall", "north_wall"));
}

TEST(ApiImages, IdsBeyondAByteHaveColoursOfTheirOwn) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  EXPECT_TRUE(world->labels().set_segmentation_object_id("north_wall", 1'000'000, false))
      << "as scripts of Cosys-AirSim do";
  const imaging::Rgb8 colour = simulator::segmentation_colour(1'000'000);
  EXPECT_EQ(bgr_at(take(*world, kSegmentation, false), 128, 72), (std::array<int, 3>{colour[2], colour[1], colour[0]}));
  EXPECT_EQ(bgr_at(take(*world, kInfrared, false), 128, 72), (std::array<int, 3>{255, 255, 255})) << "the brightest";
}

TEST(ApiImages, LightingIsWhiteSurfacesSinceTilesHoldTheirLight) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(-100, 0, -5), true, "");
  const ImageResponse light = take(*world, kLighting, false);
  EXPECT_EQ(bgr_at(light, 128, 143), (std::array<int, 3>{255, 255, 255}));
  EXPECT_EQ(bgr_at(light, 128, 0), (std::array<int, 3>{0, 0, 0})) << "the sky";
  EXPECT_FLOAT_EQ(at(take(*world, kLighting, true), 128, 143), 1.0F);
}

TEST(ApiImages, AnnotationLayersShowTheLabelsOfClients) {
  const auto world = simulator(R"({"SimMode": "ComputerVision", "Annotation": [
    {"Name": "Direct", "Type": 0, "SetDirect": true}, {"Name": "Index", "Type": 0}, {"Name": "Grey", "Type": 1}]})");
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  const auto seen = [&](const std::string& layer) {
    return bgr_at(world->cameras().get_images({{"0", kAnnotation, false, false, layer}}, "", false).at(0), 128, 72);
  };
  EXPECT_EQ(seen("Direct"), (std::array<int, 3>{0, 0, 0})) << "nothing is labelled yet";
  EXPECT_TRUE(world->labels().set_annotation_object_color("Direct", "north.*", 10, 20, 30, true));
  EXPECT_EQ(seen("Direct"), (std::array<int, 3>{30, 20, 10}));
  EXPECT_EQ(world->labels().get_annotation_object_color("Direct", "north_wall"), "10,20,30");
  EXPECT_TRUE(world->labels().set_annotation_object_id("Index", "north_wall", 7, false));
  EXPECT_EQ(seen("Index"), (std::array<int, 3>{195, 176, 115})) << "the palette's colour of 7";
  EXPECT_EQ(world->labels().get_annotation_object_id("Index", "north_wall"), 7);
  EXPECT_TRUE(world->labels().set_annotation_object_value("Grey", "north_wall", 0.4F, false));
  EXPECT_EQ(seen("Grey"), (std::array<int, 3>{102, 102, 102}));
  EXPECT_FLOAT_EQ(world->labels().get_annotation_object_value("Grey", "north_wall"), 0.4F);
  EXPECT_EQ(seen("Direct"), (std::array<int, 3>{30, 20, 10})) << "layers do not touch each other";
  EXPECT_THAT(world->cameras().get_image("0", kAnnotation, "", false, "Direct"), testing::SizeIs(testing::Gt(100U)));
  EXPECT_THAT(tests::message_of([&] { seen("Nothing"); }), HasSubstr("Direct, Grey, Index"));
}

TEST(ApiImages, LabelsThatDoNotFitTheirLayerAnswerFalse) {
  const auto world = simulator(R"({"SimMode": "ComputerVision", "Annotation": [
    {"Name": "Direct", "Type": 0, "SetDirect": true}, {"Name": "Grey", "Type": 1}]})");
  EXPECT_FALSE(world->labels().set_annotation_object_color("Nothing", "north_wall", 1, 2, 3, false));
  EXPECT_FALSE(world->labels().set_annotation_object_color("Grey", "north_wall", 1, 2, 3, false));
  EXPECT_FALSE(world->labels().set_annotation_object_color("Direct", "north_wall", 1, 2, 256, false));
  EXPECT_FALSE(world->labels().set_annotation_object_color("Direct", "nobody", 1, 2, 3, false));
  EXPECT_FALSE(world->labels().set_annotation_object_id("Direct", "north_wall", 7, false)) << "a layer of colours";
  EXPECT_FALSE(world->labels().set_annotation_object_value("Grey", "north_wall", NAN, false));
  EXPECT_EQ(world->labels().get_annotation_object_color("Direct", "north_wall"), "");
  EXPECT_EQ(world->labels().get_annotation_object_id("Direct", "north_wall"), -1);
  EXPECT_EQ(world->labels().get_annotation_object_value("Direct", "north_wall"), 0.0F);
  EXPECT_THAT(world->labels().list_annotation_objects("Direct"),
              testing::ElementsAre("east_wall", "ground", "north_wall"));
  EXPECT_THAT(world->labels().list_annotation_poses("Direct", true, false), testing::SizeIs(3));
  EXPECT_THAT(world->labels().list_annotation_objects("Nothing"), testing::IsEmpty());
}

TEST(ApiImages, NormalsAreUnrealsWorldAxes) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  EXPECT_EQ(bgr_at(take(*world, kNormals, false), 128, 72), (std::array<int, 3>{128, 128, 0})) << "faces south";
  EXPECT_EQ(bgr_at(take(*world, kNormals, false, "3"), 128, 72), (std::array<int, 3>{255, 128, 128})) << "faces up";
}

TEST(ApiImages, FlowIsFromThePictureBefore) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  EXPECT_FLOAT_EQ(at(take(*world, kFlow, true), 128, 72), 0.0F);
  world->vehicles().set_vehicle_pose(pose(0, 1, -10), true, "");
  EXPECT_NEAR(at(take(*world, kFlow, true), 128, 72), -128.0 / 20, 1e-3)
      << "the wall moves left as the camera goes right";
}

TEST(ApiImages, FieldOfViewChangesAtOnceAndCameraInfoTellsIt) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  world->cameras().set_camera_fov("0", 60.0F, "", false);
  const double f = 128 / std::tan(pi / 6);
  const double across = (200.5 - 128) / f, down = 0.5 / f;
  EXPECT_NEAR(at(take(*world, kRange, true), 200, 72), 20 * std::sqrt(1 + across * across + down * down), 1e-4);
  EXPECT_FLOAT_EQ(world->cameras().get_camera_info("0", "", false).fov, 60.0F);
}

TEST(ApiImages, FocalLengthAndFieldOfViewAreThoseOfTheLens) {
  const auto world = simulator(kComputerVision);
  EXPECT_NEAR(world->cameras().get_focal_length("0", "", false), 18.0, 1e-3) << "36 mm across 90 degrees";
  EXPECT_THAT(world->cameras().get_current_field_of_view("0", "", false),
              testing::MatchesRegex("Current Field Of View:\n\tHorizontal Field Of View: 90;\n\t Vertical Field Of "
                                    "View: 58[.]71.*"));
  EXPECT_EQ(world->cameras().get_filmback_settings("0", "", false),
            "Name: Custom;\n\t Sensor Width: 36; \t Sensor Height: 20.25\n\t Sensor Aspect Ratio: 1.77778");
  world->cameras().set_camera_fov("0", 60.0F, "", false);
  EXPECT_NEAR(world->cameras().get_focal_length("0", "", false), 18.0 / std::tan(pi / 6), 1e-3);
  world->cameras().set_lens("0", {.model = "fisheye", .fov_degrees = 190.0F}, "", false);
  EXPECT_NEAR(world->cameras().get_camera_info("0", "", false).fov, 190.0, 0.01);
  EXPECT_THAT(world->cameras().get_current_field_of_view("0", "", false),
              testing::HasSubstr("Horizontal Field Of View: 190"));
}

TEST(ApiImages, CameraPosesAreRelativeToTheBody) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10, pi / 2), true, "");
  world->cameras().set_camera_pose("0", pose(3, 0, 0, -pi / 2), "", false);
  const CameraInfo info = world->cameras().get_camera_info("0", "", false);
  EXPECT_NEAR(info.pose.position.y_val, 3.0, 1e-5) << "three metres forward of a body that looks east";
  EXPECT_NEAR(info.pose.orientation.w_val, 1.0, 1e-6) << "turned back to north";
  EXPECT_NEAR(at(take(*world, kDepth, true), 128, 72), 20.0, 1e-4);
}

TEST(ApiImages, DistortionIsEachCamerasOwn) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  world->cameras().set_distortion_param("0", "K1", -0.2F, "", false);
  world->cameras().set_distortion_param("0", "K3", 0.05F, "", false);
  EXPECT_THAT(world->cameras().get_distortion_params("0", "", false),
              testing::ElementsAre(-0.2F, 0.0F, 0.05F, 0.0F, 0.0F));
  imaging::PinholeRational model{128, 128, 127.5, 71.5, {}};
  model.d[0] = -0.2F;
  model.d[4] = 0.05F;
  const geometry::Vec3 ray = *imaging::Camera(model, 256, 144).unproject({200, 100});
  EXPECT_NEAR(at(take(*world, kRange, true), 200, 100), 20.0 / ray.z(), 1e-3);
  const double across = 72.5 / 128, down = 28.5 / 128;
  EXPECT_NEAR(at(take(*world, kRange, true, "1"), 200, 100), 20 * std::sqrt(1 + across * across + down * down), 1e-3);
  EXPECT_THAT(tests::message_of([&] { world->cameras().set_distortion_param("0", "K9", 0, "", false); }),
              HasSubstr("K1, K2"));
}

TEST(ApiImages, AFisheyeSeesBehindItself) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  world->cameras().set_lens("0", {"fisheye", 300, 300, 220.0F, {}, {}}, "", false);
  const ImageResponse depth = take(*world, kDepth, true);
  ASSERT_EQ(depth.width, 300);
  EXPECT_NEAR(at(depth, 150, 150), 20.0, 0.01);
  EXPECT_LT(at(depth, 150, 297), 0.0F) << "the ground below and behind";
}

TEST(ApiImages, ImageAndPoseAreOfTheSameMomentOfTheSimulation) {
  const auto world = simulator(kComputerVision);
  const std::uint64_t start = take(*world, 0, false).time_stamp;
  EXPECT_EQ(take(*world, 0, false).time_stamp, start) << "on demand, time stands still";
  world->clock().continue_for_time(0.3);
  EXPECT_EQ(take(*world, 0, false).time_stamp, start + 300'000'000U);
  EXPECT_TRUE(world->clock().is_paused());
}

TEST(ApiImages, AllCamerasOfAVehicleAreOfOneInstant) {
  const auto world = simulator(kComputerVision);
  for (int step = 0; step < 3; ++step) {
    world->clock().continue_for_time(0.017);
    const std::vector<ImageResponse> images = world->cameras().get_images(
        {{"front_left", 0, false, false}, {"front_right", kDepth, true, false}, {"bottom_center", 0, false, false}}, "",
        false);
    ASSERT_EQ(images.size(), 3U);
    for (const ImageResponse& image : images) EXPECT_EQ(image.time_stamp, images.front().time_stamp);
  }
}

TEST(ApiImages, ExternalCamerasStandInTheWorld) {
  const auto world = simulator(R"({"SimMode": "ComputerVision", "ExternalCameras": {"tower": {"X": 5, "Z": -10}}})");
  const ImageResponse depth = world->cameras().get_images({{"tower", kDepth, true, false}}, "", true).at(0);
  EXPECT_NEAR(at(depth, 128, 72), 15.0, 1e-4);
}

TEST(ApiImages, WhatIsNotThereOrBeyondReasonIsRefusedInOneLine) {
  const auto world = simulator(kComputerVision);
  const auto images = [&](const std::string& camera, int type, const std::string& vehicle) {
    return tests::message_of([&] { world->cameras().get_images({{camera, type, false, true}}, vehicle, false); });
  };
  EXPECT_THAT(images("none", 0, ""), HasSubstr("front_center"));
  EXPECT_THAT(images("0", 12, ""), HasSubstr("image type 12"));
  EXPECT_THAT(images("0", 0, "Drone9"), testing::StartsWith("Vehicle API for 'Drone9' is not available"));
  const std::vector<ImageRequest> many(257, ImageRequest{"0", 0, false, true});
  EXPECT_THAT(tests::message_of([&] { world->cameras().get_images(many, "", false); }), HasSubstr("256"));
  EXPECT_THAT(tests::message_of([&] { world->cameras().set_camera_fov("0", NAN, "", false); }),
              HasSubstr("field of view"));
  EXPECT_THAT(tests::message_of([&] { world->vehicles().set_vehicle_pose(pose(INFINITY, 0, 0), true, ""); }),
              HasSubstr("finite"));
  EXPECT_THAT(tests::message_of([&] {
                world->cameras().set_lens("0", {"fisheye", 1 << 30, 1 << 30, 90, {}, {}}, "", false);
              }),
              HasSubstr("8192"));
}

TEST(ApiImages, NotANumberLeavesAPoseAsItIs) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(1, 2, -3, 0.5), true, "");
  world->vehicles().set_vehicle_pose({{NAN, 7, NAN}, {NAN, NAN, NAN, NAN}}, true, "");
  const Pose now = world->vehicles().get_vehicle_pose("");
  EXPECT_FLOAT_EQ(now.position.x_val, 1.0F);
  EXPECT_FLOAT_EQ(now.position.y_val, 7.0F);
  EXPECT_NEAR(now.orientation.z_val, std::sin(0.25), 1e-6);
}

TEST(ApiImages, ASweptMoveStopsAtTheFirstThingInItsWay) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  EXPECT_FALSE(world->vehicles().get_collision_info("").has_collided);
  world->vehicles().set_vehicle_pose(pose(50, 0, -10), false, "");
  EXPECT_NEAR(world->vehicles().get_vehicle_pose("").position.x_val, kWallNorth_m - 0.35, 1e-3);
  const CollisionInfo collision = world->vehicles().get_collision_info("");
  EXPECT_TRUE(collision.has_collided);
  EXPECT_NEAR(collision.impact_point.x_val, kWallNorth_m, 1e-4);
  EXPECT_NEAR(collision.normal.x_val, -1.0, 1e-6);
  EXPECT_FALSE(world->vehicles().get_collision_info("").has_collided) << "asking forgets";
}

/// Rows of AirSim's projection matrix for a wide and a tall image: the field of view is that of the longer side.
TEST(ApiCameras, ProjectionMatrixGivesThePixelsOfThePicture) {
  for (const auto& [width, height] : {std::pair(640, 480), std::pair(300, 500)}) {
    const std::string settings = R"({"SimMode": "ComputerVision", "StepOnDemand": true, "CameraDefaults": {
      "CaptureSettings": [{"ImageType": 0, "FOV_Degrees": 70, "Width": )" +
                                 std::to_string(width) + R"(, "Height": )" + std::to_string(height) + "}]}}";
    const auto world = simulator(settings);
    const CameraInfo info = world->cameras().get_camera_info("0", "", false);
    EXPECT_NEAR(info.fov, 70.0, 1e-4);
    const auto& m = info.proj_mat.matrix;
    const double focal_px = std::max(width, height) / 2.0 / std::tan(pi * 35 / 180);
    const std::array<double, 4> point{12.0, 2.5, -1.5, 1.0};  // forward, right, down
    std::array<double, 4> clip{};
    for (std::size_t row = 0; row < 4; ++row) {
      for (std::size_t column = 0; column < 4; ++column) clip[row] += m[row][column] * point[column];
    }
    EXPECT_NEAR(width / 2.0 * (1.0 - clip[0] / clip[3]), width / 2.0 + focal_px * 2.5 / 12.0, 1e-3);
    EXPECT_NEAR(height / 2.0 * (1.0 + clip[1] / clip[3]), height / 2.0 - focal_px * 1.5 / 12.0, 1e-3);
    EXPECT_EQ(clip[3], -12.0) << "it looks along its negative axis";
    EXPECT_EQ(clip[2], 10.0) << "the near plane in centimetres, no far one";
  }
}

}  // namespace
}  // namespace tileflight::simulator::cameras_test
