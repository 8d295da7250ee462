#include "tileflight/live/airsim/airsim_methods.h"

#include <gmock/gmock.h>

#include "tileflight/live/airsim/test_null_simulator_caller.h"

namespace tileflight::airsim::airsim_methods_test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

rpc::MethodTable make_table() {
  rpc::MethodTable table;
  MethodBinder<NullSimulatorCaller> bind(table, {});
  add_airsim_methods(bind);
  add_extension_methods(bind, [] { return rpc::ServerStatistics{}; });
  return table;
}

rpc::Response call(const std::string& message) {
  static const rpc::MethodTable table = make_table();
  return table.call(rpc::Request(message));
}

template <class... Arguments>
rpc::Response ask(const std::string& method, const Arguments&... arguments) {
  msgpack::sbuffer buffer;
  msgpack::pack(buffer, std::make_tuple(0, 1, method, std::make_tuple(arguments...)));
  return call({buffer.data(), buffer.size()});
}

/// An answer, decoded: the result is its fourth value.
msgpack::object_handle result_of(const rpc::Response& answer) {
  return msgpack::unpack(answer.bytes.data(), answer.bytes.size());
}

std::vector<std::string> keys(const msgpack::object& map) {
  std::vector<std::string> result;
  for (std::uint32_t i = 0; i < map.via.map.size; ++i) result.push_back(map.via.map.ptr[i].key.as<std::string>());
  return result;
}

using Map = std::map<std::string, double>;

/// The number of arguments that AirSim's clients send with each method; `-1`: any number, accepted without effect or
/// refused.
const std::map<std::string, int> kArguments{{"ping", 0},
                                            {"getServerVersion", 0},
                                            {"getMinRequiredClientVersion", 0},
                                            {"reset", 0},
                                            {"enableApiControl", 2},
                                            {"isApiControlEnabled", 1},
                                            {"armDisarm", 2},
                                            {"simPause", 1},
                                            {"simIsPaused", 0},
                                            {"simContinueForTime", 1},
                                            {"simContinueForFrames", 1},
                                            {"getHomeGeoPoint", 1},
                                            {"listVehicles", 0},
                                            {"getSettingsString", 0},
                                            {"simGetImages", 3},
                                            {"simGetImage", 4},
                                            {"simSetVehiclePose", 3},
                                            {"simGetVehiclePose", 1},
                                            {"simGetCameraInfo", 3},
                                            {"simSetCameraPose", 4},
                                            {"simSetCameraFov", 4},
                                            {"simGetDistortionParams", 3},
                                            {"simSetDistortionParam", 5},
                                            {"simGetGroundTruthKinematics", 1},
                                            {"simSetKinematics", 3},
                                            {"simGetGroundTruthEnvironment", 1},
                                            {"simGetCollisionInfo", 1},
                                            {"simListSceneObjects", 1},
                                            {"simSetSegmentationObjectID", 3},
                                            {"simGetSegmentationObjectID", 1},
                                            {"simGetMeshPositionVertexBuffers", 0},
                                            {"simGetObjectPose", 1},
                                            {"simSetObjectPose", 3},
                                            {"simGetObjectScale", 1},
                                            {"simSetObjectScale", 2},
                                            {"simSpawnObject", 6},
                                            {"simDestroyObject", 1},
                                            {"simListAssets", 0},
                                            {"simCreateVoxelGrid", 6},
                                            {"getLidarData", 2},
                                            {"getImuData", 2},
                                            {"getBarometerData", 2},
                                            {"getMagnetometerData", 2},
                                            {"getGpsData", 2},
                                            {"getDistanceSensorData", 2},
                                            {"getMultirotorState", 1},
                                            {"getRotorStates", 1},
                                            {"cancelLastTask", 1},
                                            {"takeoff", 2},
                                            {"land", 2},
                                            {"goHome", 2},
                                            {"hover", 1},
                                            {"moveToPosition", 10},
                                            {"moveOnPath", 8},
                                            {"moveByVelocity", 7},
                                            {"moveByVelocityZ", 7},
                                            {"moveByVelocityBodyFrame", 7},
                                            {"moveByVelocityZBodyFrame", 7},
                                            {"moveToZ", 7},
                                            {"moveToGPS", 10},
                                            {"rotateToYaw", 4},
                                            {"rotateByYawRate", 3},
                                            {"startRecording", 0},
                                            {"stopRecording", 0},
                                            {"isRecording", 0},
                                            {"simEnableWeather", 1},
                                            {"simSetWeatherParameter", 2},
                                            {"simSetTimeOfDay", 6},
                                            {"simSetWind", 1},
                                            {"simFlushPersistentMarkers", -1},
                                            {"simPlotPoints", -1},
                                            {"simPlotLineStrip", -1},
                                            {"simPlotLineList", -1},
                                            {"simPlotArrows", -1},
                                            {"simPlotStrings", -1},
                                            {"simPlotTransforms", -1},
                                            {"simPlotTransformsWithNames", -1},
                                            {"simPrintLogMessage", 3},
                                            {"simSetTraceLine", -1},
                                            {"simRunConsoleCommand", 1},
                                            {"simAddVehicle", 4},
                                            {"simLoadLevel", 1},
                                            {"simGetWorldExtents", 0},
                                            {"simTestLineOfSightToPoint", 2},
                                            {"simTestLineOfSightBetweenPoints", 2},
                                            {"simAddDetectionFilterMeshName", 5},
                                            {"simSetDetectionFilterRadius", 5},
                                            {"simClearDetectionMeshNames", 4},
                                            {"simGetDetections", 4},
                                            {"setAngleRateControllerGains", -1},
                                            {"setAngleLevelControllerGains", -1},
                                            {"setVelocityControllerGains", -1},
                                            {"setPositionControllerGains", -1},
                                            {"moveByRC", -1},
                                            {"moveByMotorPWMs", -1},
                                            {"moveByRollPitchYawZ", 6},
                                            {"moveByRollPitchYawThrottle", 6},
                                            {"moveByRollPitchYawrateThrottle", 6},
                                            {"moveByRollPitchYawrateZ", 6},
                                            {"moveByAngleRatesZ", 6},
                                            {"moveByAngleRatesThrottle", 6},
                                            {"simGetFocalLength", 3},
                                            {"simGetCurrentFieldOfView", 3},
                                            {"tfLoadRegion", 3},
                                            {"tfCoverage", 3},
                                            {"tfGroundTruth", 5},
                                            {"tfGeodeticPose", 1},
                                            {"tfStatistics", 0},
                                            {"tfCreateVoxelGrid", 3},
                                            {"tfLidarScan", 2},
                                            {"tfSetLens", 4},
                                            {"tfAuthenticate", 1}};

TEST(AirSimMethods, AreAllThereWithTheirArguments) {
  for (const auto& [name, arguments] : kArguments) {
    const rpc::Response answer = ask(name, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1);
    if (arguments < 0) {
      EXPECT_THAT(answer.error, IsEmpty()) << name;
    } else {
      EXPECT_EQ(answer.error, "rpclib: client error C0002: Function '" + name +
                                  "' was called with an invalid number of arguments. Expected: " +
                                  std::to_string(arguments) + ", got: 12");
    }
  }
}

TEST(AirSimMethods, TakeWhatThePythonClientSends) {
  const Map at{{"x_val", 1.0}, {"y_val", 2.0}, {"z_val", 3.0}};
  const Map yaw{{"is_rate", 0.0}, {"yaw_or_rate", 0.0}};
  EXPECT_THAT(ask("moveToPosition", 1, 2.5, -3, 5, 3e38, 0, std::map<std::string, int>{}, -1, 1, "").error, IsEmpty());
  EXPECT_THAT(ask("moveToPosition", 1, 2.5, -3, 5, 3e38, 0, yaw, -1, 1, "").error,
              HasSubstr("argument 7: is_rate: expected a boolean, got "));
  EXPECT_THAT(ask("moveOnPath", std::vector<Map>{at, at}, 5, 3e38, 1, Map{}, -1, 1, "").error, IsEmpty());
  EXPECT_THAT(ask("simSetVehiclePose", std::map<std::string, Map>{{"position", at}}, true, "").error, IsEmpty());
  EXPECT_THAT(ask("simCreateVoxelGrid", at, 10, 10, 10, 0.5, "a.binvox").error, IsEmpty());
  EXPECT_THAT(ask("simCreateVoxelGrid", at, 10.5, 10, 10, 0.5, "a.binvox").error,
              HasSubstr("argument 2: expected an integer, got a float"));
}

TEST(AirSimMethods, TakeTimeOfDayAndWeatherAsThePythonClientSendsThem) {
  EXPECT_THAT(ask("simSetTimeOfDay", true, "2018-02-12 15:20:00", true, 1, 60, true).error, IsEmpty());
  EXPECT_THAT(ask("simSetTimeOfDay", false, "", false, 1, 60, true).error, IsEmpty());
  EXPECT_THAT(ask("simSetTimeOfDay", true, "", false, 0.5, 0.1, true).error, IsEmpty());
  EXPECT_THAT(ask("simEnableWeather", true).error, IsEmpty());
  EXPECT_THAT(ask("simSetWeatherParameter", 7, 0.25).error, IsEmpty());
  EXPECT_THAT(ask("simSetWeatherParameter", 0, 1).error, IsEmpty());
  EXPECT_THAT(ask("simSetWeatherParameter", "Fog", 1).error, HasSubstr("argument 1: expected an integer"));
}

TEST(AirSimMethods, TakeWhatClientsOfVersionFourSend) {
  const std::vector<std::map<std::string, std::string>> requests{{{"camera_name", "0"}, {"annotation_name", ""}}};
  EXPECT_THAT(ask("simGetImages", requests, "").error, IsEmpty());
  EXPECT_THAT(ask("simGetImage", "0", 0, "", "").error, IsEmpty());
  EXPECT_THAT(ask("simGetImage", "0", 0, "", false).error, IsEmpty());
  EXPECT_THAT(ask("simGetImage", "0", 0, "", 1).error, HasSubstr("argument 4: expected a boolean"));
  EXPECT_THAT(ask("simGetCameraInfo", "0", "").error, IsEmpty());
  EXPECT_THAT(ask("simSetCameraFov", "0", 60, "").error, IsEmpty());
  EXPECT_THAT(ask("simGetDistortionParams", "0", "").error, IsEmpty());
  EXPECT_THAT(ask("simGetObjectPose", "wall", true).error, IsEmpty());
  EXPECT_THAT(ask("simGetObjectPose", "wall").error, IsEmpty()) << "AirSim's client sends no frame";
}

TEST(AirSimMethods, TakeTheCallsThatCosysAdds) {
  const std::map<std::string, int> methods{{"simListSceneObjectsTags", 1},
                                           {"simListInstanceSegmentationObjects", 0},
                                           {"simListInstanceSegmentationPoses", 2},
                                           {"simGetInstanceSegmentationColorMap", 0},
                                           {"simListAnnotationObjects", 1},
                                           {"simListAnnotationPoses", 3},
                                           {"simSetAnnotationObjectID", 4},
                                           {"simGetAnnotationObjectID", 2},
                                           {"simSetAnnotationObjectColor", 6},
                                           {"simGetAnnotationObjectColor", 2},
                                           {"simSetAnnotationObjectValue", 4},
                                           {"simGetAnnotationObjectValue", 2},
                                           {"simGetAnnotationObjectTexturePath", 2},
                                           {"getGPULidarData", 2},
                                           {"getEchoData", 2},
                                           {"getComputerVisionState", 1},
                                           {"simGetPhysicsRawKinematics", 1}};
  for (const auto& [name, arguments] : methods)
    EXPECT_THAT(ask(name, 1, 1, 1, 1, 1, 1, 1, 1).error,
                HasSubstr("Expected: " + std::to_string(arguments) + ", got: 8"))
        << name;
  EXPECT_THAT(ask("simSetAnnotationObjectColor", "layer", "wall.*", 1, 2, 3, true).error, IsEmpty());
  EXPECT_THAT(ask("simListAnnotationPoses", "layer", true, false).error, IsEmpty());
}

TEST(AirSimMethods, AnswerCosysInTheLayoutThatItsClientDecodes) {
  const auto gpu = result_of(ask("getGPULidarData", "", ""));
  EXPECT_THAT(keys(gpu.get().via.array.ptr[3]), testing::ElementsAre("time_stamp", "point_cloud", "pose"));
  const auto echo = result_of(ask("getEchoData", "", ""));
  EXPECT_THAT(keys(echo.get().via.array.ptr[3]),
              testing::ElementsAre("time_stamp", "point_cloud", "groundtruth", "pose", "passive_beacons_point_cloud",
                                   "passive_beacons_groundtruth"));
  const auto state = result_of(ask("getComputerVisionState", ""));
  EXPECT_THAT(keys(state.get().via.array.ptr[3]), testing::ElementsAre("kinematics_estimated", "timestamp"));
}

TEST(AirSimMethods, AnswerWithAllFieldsInTheirOrder) {
  const auto state = result_of(ask("getMultirotorState", ""));
  const msgpack::object& map = state.get().via.array.ptr[3];
  EXPECT_THAT(keys(map), testing::ElementsAre("collision", "kinematics_estimated", "gps_location", "timestamp",
                                              "landed_state", "rc_data"));
  EXPECT_THAT(keys(map.via.map.ptr[0].val),
              testing::ElementsAre("has_collided", "penetration_depth", "time_stamp", "normal", "impact_point",
                                   "position", "object_name", "object_id"));
  const auto camera = result_of(ask("simGetCameraInfo", "0", "", false));
  EXPECT_THAT(keys(camera.get().via.array.ptr[3]), testing::ElementsAre("pose", "fov", "proj_mat"));
  const auto all = result_of(ask("tfStatistics"));
  EXPECT_THAT(keys(all.get().via.array.ptr[3]), testing::ElementsAre("simulator", "server"));
}

TEST(AirSimFields, AnImageByteForByte) {
  simulator::ImageResponse image;
  image.image_data_uint8 = {1, 2, 3};
  image.image_data_float = {0.5F};
  image.camera_name = "0";
  image.time_stamp = 258;
  image.width = 1;
  image.height = 1;
  image.image_type = 5;
  rpc::Encoder out;
  rpc::encode(out, image);
  const std::string zero("\xca\0\0\0\0", 5);
  const std::string one("\xca\x3f\x80\0\0", 5);
  EXPECT_EQ(out.take(), "\x8c\xb0image_data_uint8\xc4\x03\x01\x02\x03\xb0image_data_float\x91\xca\x3f" +
                            std::string(3, '\0') +
                            "\xaf"
                            "camera_position\x83\xa5x_val" +
                            zero + "\xa5y_val" + zero + "\xa5z_val" + zero +
                            "\xab"
                            "camera_name\xa1"
                            "0\xb2"
                            "camera_orientation\x84\xa5w_val" +
                            one + "\xa5x_val" + zero + "\xa5y_val" + zero + "\xa5z_val" + zero +
                            "\xaatime_stamp\xcd\x01\x02\xa7message\xa0" +
                            "\xafpixels_as_float\xc2\xa8"
                            "compress\xc3\xa5width\x01\xa6height\x01\xaaimage_type\x05");
}

}  // namespace
}  // namespace tileflight::airsim::airsim_methods_test
