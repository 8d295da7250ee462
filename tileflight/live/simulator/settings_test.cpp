#include "tileflight/live/simulator/settings.h"

#include <gmock/gmock.h>

#include <fstream>
#include <numbers>
#include <regex>
#include <sstream>
#include <string_view>

#include "tests/refusal.h"
#include "tests/source_folder.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::simulator::settings_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string refusal_of(const std::string& text) {
  try {
    read_settings(text, "settings.json");
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

const CameraSettings& camera_named(const VehicleSettings& vehicle, std::string_view name) {
  return *std::ranges::find(vehicle.cameras, name, &CameraSettings::name);
}

std::vector<std::string> names_of(const std::vector<SensorSettings>& sensors) {
  std::vector<std::string> names;
  for (const SensorSettings& sensor : sensors) names.push_back(sensor.name);
  return names;
}

TEST(Settings, NothingGivesAirSimsDefaults) {
  const Settings settings = read_settings("", "settings.json");
  EXPECT_FALSE(settings.computer_vision);
  ASSERT_EQ(settings.vehicles.size(), 1U);
  const VehicleSettings& vehicle = settings.vehicles[0];
  EXPECT_EQ(vehicle.name, "SimpleFlight");
  EXPECT_TRUE(vehicle.flies);
  ASSERT_EQ(vehicle.cameras.size(), 5U);
  EXPECT_EQ(vehicle.cameras[0].captures[0].width, 256);
  EXPECT_EQ(vehicle.cameras[0].captures[5].height, 144);
  EXPECT_THAT(names_of(vehicle.sensors), ElementsAre("imu", "magnetometer", "gps", "barometer"));
  EXPECT_NEAR(camera_named(vehicle, "front_right").T_body_camera.translation.y(), 0.125, 1e-12);
  const geometry::Vec3 down = camera_named(vehicle, "bottom_center").T_body_camera.rotation * geometry::Vec3::UnitX();
  EXPECT_NEAR(down.z(), 1.0, 1e-12);
  EXPECT_THAT(settings.warnings, IsEmpty());
}

/// AirSim's ROS wrapper reads mode and vehicles of what getSettingsString answers.
TEST(Settings, WhereNoneAreGivenTheTextIsThatOfTheDefaults) {
  const Settings given = read_settings(default_settings_text(), "settings.json");
  const Settings none = read_settings("", "settings.json");
  EXPECT_THAT(given.warnings, IsEmpty());
  ASSERT_EQ(given.vehicles.size(), 1U);
  EXPECT_EQ(given.vehicles[0].name, none.vehicles[0].name);
  EXPECT_EQ(given.vehicles[0].armed, none.vehicles[0].armed);
  EXPECT_EQ(names_of(given.vehicles[0].sensors), names_of(none.vehicles[0].sensors));
  EXPECT_EQ(given.vehicles[0].cameras.size(), none.vehicles[0].cameras.size());
  EXPECT_EQ(given.vehicles[0].cameras[0].captures[0].width, none.vehicles[0].cameras[0].captures[0].width);
  EXPECT_THAT(default_settings_text(), HasSubstr("\"SettingsVersion\": 1.2"));
  EXPECT_THAT(default_settings_text(), HasSubstr("\"SimMode\": \"Multirotor\""));
}

TEST(Settings, ComputerVisionHasItsOwnVehicleAndNoSensors) {
  const Settings settings = read_settings(R"({"SimMode": "ComputerVision"})", "settings.json");
  EXPECT_EQ(settings.vehicles[0].name, "ComputerVision");
  EXPECT_FALSE(settings.vehicles[0].flies);
  EXPECT_THAT(settings.vehicles[0].sensors, IsEmpty());
}

TEST(Settings, TheReferencesExampleIsReadWithoutAWarning) {
  const Settings settings = read_settings(R"({"SettingsVersion":1.2,"SimMode":"Multirotor","ViewMode":"NoDisplay",
    "ClockSpeed":1, // a comment
    "OriginGeopoint":{"Latitude":47.641468,"Longitude":-122.140165,"Altitude":122},
    "CameraDefaults":{"CaptureSettings":[{"ImageType":0,"Width":640,"Height":480,"FOV_Degrees":90},
      {"ImageType":1,"Width":320,"Height":240,"FOV_Degrees":60}]},
    "Vehicles":{"Drone1":{"VehicleType":"SimpleFlight","X":4,"Y":5,"Z":-6,"Yaw":90,
      "Cameras":{"0":{"X":0.3,"Pitch":-45,"CaptureSettings":[{"ImageType":0,"Width":100}]}, "mine":{"Y":1}},
      "Sensors":{"Lidar1":{"SensorType":6,"Enabled":true,"NumberOfChannels":32,"DataFrame":"SensorLocalFrame"},
        "Distance1":{"SensorType":5,"Enabled":true,"Pitch":-90},"gps":{"SensorType":3,"Enabled":false}}}}})",
                                          "settings.json");
  EXPECT_THAT(settings.warnings, IsEmpty());
  ASSERT_EQ(settings.vehicles.size(), 1U);
  const VehicleSettings& drone = settings.vehicles[0];
  EXPECT_EQ(drone.start_ned, geometry::Vec3(4, 5, -6));
  EXPECT_NEAR((drone.R_ned_body * geometry::Vec3::UnitX()).y(), 1.0, 1e-12);
  ASSERT_EQ(drone.cameras.size(), 6U) << "a name of AirSim's stands for the camera, another one is a sixth";
  const CameraSettings& front = camera_named(drone, "front_center");
  EXPECT_NEAR(front.T_body_camera.translation.x(), 0.3, 1e-12);
  EXPECT_EQ(front.captures[0].width, 100);
  EXPECT_EQ(front.captures[0].height, 480) << "what an entry does not say is the default's";
  EXPECT_EQ(front.captures[1].width, 320) << "each kind of picture has its own entry";
  EXPECT_NEAR(front.captures[1].fov_deg, 60.0, 1e-12);
  EXPECT_EQ(front.captures[5].width, 256);
  EXPECT_THAT(names_of(drone.sensors), ElementsAre("imu", "magnetometer", "barometer", "Distance1", "Lidar1"));
  const auto& lidar = std::get<LidarSettings>(drone.sensors.back().kind);
  EXPECT_EQ(lidar.channels, 32);
  EXPECT_TRUE(lidar.in_sensor_frame);
  EXPECT_NEAR(settings.origin->height.m, 122.0, 1e-12);
}

TEST(Settings, UnknownKeysAreNamedWithTheNearest) {
  const Settings settings = read_settings(R"({"SimMod": 1, "Vehicles": {"A": {"Camera": {}}}})", "settings.json");
  ASSERT_EQ(settings.warnings.size(), 2U);
  EXPECT_THAT(settings.warnings[0],
              testing::AllOf(HasSubstr("settings.json: 'Vehicles.A.Camera'"), HasSubstr("'Cameras'")));
  EXPECT_THAT(settings.warnings[1], testing::AllOf(HasSubstr("'SimMod'"), HasSubstr("'SimMode'")));
}

TEST(Settings, WrongValuesAreRefusedInOneLineThatNamesThePlace) {
  EXPECT_THAT(refusal_of("{"), HasSubstr("settings.json"));
  EXPECT_THAT(refusal_of(R"({"SimMode": "Car"})"), HasSubstr("settings.json: 'SimMode'"));
  EXPECT_THAT(refusal_of(R"({"ClockSpeed": "fast"})"), HasSubstr("settings.json: 'ClockSpeed' must be a number"));
  EXPECT_THAT(refusal_of(R"({"ClockSpeed": 0})"), HasSubstr("out of range"));
  EXPECT_THAT(refusal_of(R"({"Vehicles": []})"), HasSubstr("settings.json: 'Vehicles'"));
  EXPECT_THAT(refusal_of(R"({"Vehicles": {"A": {"X": 1e300}}})"), HasSubstr("settings.json: 'Vehicles.A.X'"));
  EXPECT_THAT(refusal_of(R"({"CameraDefaults": {"CaptureSettings": [{"Width": 1000000}]}})"),
              HasSubstr("CameraDefaults.CaptureSettings[0].Width"));
  EXPECT_THAT(refusal_of(R"({"Vehicles": {"A": {"Sensors": {"L": {"SensorType": 12}}}}})"), HasSubstr("Sensors.L"));
  for (const char* text : {"{", R"({"ClockSpeed": "fast"})", R"({"Vehicles": 3})"})
    EXPECT_EQ(refusal_of(text).find('\n'), std::string::npos);
}

TEST(Settings, WhatIsUnusualIsClampedOrLeftOutWithAWarning) {
  const Settings settings = read_settings(R"({"Recording": {"RecordInterval": 0.001}, "Vehicles": {
    "Car": {"VehicleType": "PhysXCar", "RC": {}},
    "A": {"VehicleType": "SimpleFlight", "Sensors": {
      "down": {"SensorType": 6, "Enabled": true, "VerticalFOVUpper": -80, "VerticalFOVLower": -100},
      "fast": {"SensorType": 6, "Enabled": true, "VerticalFOVUpper": 0, "VerticalFOVLower": 360,
               "RotationsPerSecond": 100000, "NumberOfChannels": 5000, "HorizontalFOVEnd": 400}}}}})",
                                          "settings.json");
  EXPECT_THAT(settings.warnings, testing::UnorderedElementsAre(
                                     HasSubstr("'Recording.RecordInterval' is 0.001"),
                                     HasSubstr("'Vehicles.Car.VehicleType' cars are not simulated"),
                                     HasSubstr("fast.RotationsPerSecond' is"), HasSubstr("fast.NumberOfChannels'"),
                                     HasSubstr("fast.HorizontalFOVEnd' is 400")));
  EXPECT_EQ(settings.recording.interval_s, 0.003);
  ASSERT_EQ(settings.vehicles.size(), 1U);
  const std::vector<SensorSettings>& sensors = settings.vehicles[0].sensors;
  EXPECT_EQ(std::get<LidarSettings>(sensors[4].kind).lower_deg, -100.0);
  EXPECT_EQ(std::get<LidarSettings>(sensors[5].kind).lower_deg, 360.0);
  EXPECT_EQ(std::get<LidarSettings>(sensors[5].kind).rotations_per_second, 1000.0);
  EXPECT_EQ(std::get<LidarSettings>(sensors[5].kind).channels, 1024);
}

/// A settings file with the example of a row of the table in docs/server.md.
std::string example_file(const std::string& where, const std::string& keys) {
  if (where == "top level") return "{" + keys + "}";
  if (where == "segmentation") return R"({"SegmentationSettings": {)" + keys + "}}";
  if (where == "vehicle") return R"({"Vehicles": {"A": {)" + keys + "}}}";
  if (where == "ArduCopter") return R"({"Vehicles": {"A": {"VehicleType": "ArduCopter", )" + keys + "}}}";
  if (where == "PX4") return R"({"Vehicles": {"A": {"VehicleType": "PX4Multirotor", )" + keys + "}}}";
  if (where == "camera") return R"({"CameraDefaults": {)" + keys + "}}";
  if (where == "image") return R"({"CameraDefaults": {"CaptureSettings": [{)" + keys + "}]}}";
  return R"({"Vehicles": {"A": {"Sensors": {"S": {"Enabled": true, "SensorType": )" + where.substr(7) + ", " + keys +
         "}}}}}";
}

/// Every key in the settings documentation of AirSim (13448700, docs/settings.md) and of Cosys-AirSim (bb15e2cf,
/// docs/settings.md and those of its sensors), but for the names of sections that the examples stand in.
constexpr const char* kDocumentedKeys =
    "AccelBiasStability AccelBiasStabilityTau AllowAPIAlways AllowAPIWhenDisconnected Altitude AngularRandomWalk "
    "Annotation ApiServerPort AttenuationLimit AttenuationPerDistance AttenuationPerReflection AutoCreate "
    "AutoExposureBias AutoExposureMaxBrightness AutoExposureMinBrightness AutoExposureSpeed CameraDirector CameraName "
    "Cameras CaptureSettings CelestialClockSpeed ChromaticAberrationScale ClockSpeed ClockType Compress ControlIp "
    "ControlPortLocal ControlPortRemote Default DefaultSensors DefaultVehicleState DistanceLimit DrawBounceLines "
    "DrawDebugAllLines DrawDebugAllPoints DrawDebugDuration DrawDebugLocation DrawDebugPoints DrawExternalPoints "
    "DrawInitialPoints DrawMode DrawPassiveLines DrawPassiveSources DrawReflectedLines DrawReflectedPaths "
    "DrawReflectedPoints DrawSensor Enable EnableCollisionPassthrogh EnableCollisionPassthrough EnableCollisions "
    "EnableTrace Enabled EngineSound EphFinal EphInitial EphMin2d EphMin3d EphTimeConstant EpvFinal EpvInitial "
    "EpvTimeConstant External ExternalCameras ExternalController ExternalLocal FOV_Degrees Folder FollowDistance "
    "ForceUpdate GenerateIntensity GenerateNoise Gimbal GroundTruth GyroBiasStability GyroBiasStabilityTau Height "
    "HorizontalFOVEnd HorizontalFOVStart HorzDistortionContrib HorzDistortionStrength HorzNoiseLinesContrib "
    "HorzNoiseLinesDensityXY HorzNoiseLinesDensityY HorzWaveContrib HorzWaveScreenSize HorzWaveStrength "
    "HorzWaveVertSize IgnoreMarked ImageType InitMethod InitialDirections InitialInstanceSegmentation "
    "InstanceSegmentation Latitude LensDistortionAreaFalloff LensDistortionAreaRadius LensDistortionEnable "
    "LensDistortionInvert LimitPoints LocalHostIp Lockstep LogMessagesVisible LogViewerHostIp LogViewerPort "
    "LogViewerSendPort Logs Longitude LumenFinalQuality LumenGIEnable LumenReflectionEnable LumenSceneDetail "
    "LumenSceneLightningDetail MaxDistance MeasurementFrequency MeasurementsPerCycle MeshNamingMethod MinDistance "
    "MinNoiseStandardDeviation Model MotionBlurAmount MotionBlurMax MoveWorldOrigin Name NoiseBias NoiseDistanceScale "
    "NoiseSettings NoiseSigma NumberOfChannels NumberOfTraces OffboardCompID OffboardSysID OriginGeopoint OrthoWidth "
    "OverrideExisting Parameters PassiveEchoBeacons PassiveRadius PauseAfterMeasurement PawnBP PawnPath PawnPaths "
    "PhysicsEngineName Pitch PixelFormat PixelFormatOverride PixelsAsFloat PointsPerSecond PressureFactorSigma "
    "PressureFactorTau ProjectionMode QgcHostIp QgcPort RC RandContrib RandDensity RandSize RandSpeed Range "
    "RecordInterval RecordOnMove RecordUIVisible Recording ReflectionDistanceLimit ReflectionLimit ReflectionOnlyFinal "
    "ReflectionOpeningAngle RemoteControlID Resolution Roll RotationsPerSecond RpcEnabled RunParallel ScaleFactor "
    "SeeDocsAt SenseActive SensePassive SensorDiameter SensorLowerAzimuthLimit SensorLowerElevationLimit "
    "SensorUpperAzimuthLimit SensorUpperElevationLimit Sensors SerialBaudRate SerialPort SetDirect SettingsVersion "
    "ShowLosDebugLines SimCompID SimMode SimSysID SitlIp SitlPort SpeedUnitFactor SpeedUnitLabel Stabilization "
    "StartDateTime StartDateTimeDst StartupDelay SubWindows TargetGamma TcpPort TexturePath TexturePrefix TimeOfDay "
    "Type UdpIp UdpPort UncorrelatedNoiseSigma UnrealEngine UpdateFrequency UpdateIntervalSecs UpdateLatency UseSerial "
    "UseTcp VehicleCompID VehicleName VehicleSysID VehicleType Vehicles VelocityRandomWalk VerticalFOVLower "
    "VerticalFOVUpper ViewDistance ViewMode Visible Width Wind WindowID X Y Yaw Z rainConstantA rainConstantB "
    "rainMaxIntensity rangeMaxLambertianPercentage runParallel";

TEST(Settings, KeysOfAirSimDoWhatTheTableSays) {
  std::ifstream page(tests::source_folder() / "docs/server.md");
  const std::regex row(R"(\| ([a-zA-Z0-9 ]+) \| `(".*)` \| (works|silent|warned|refused) \| (.*) ?\|)");
  std::size_t rows = 0;
  std::string examples;
  for (std::string line; std::getline(page, line);) {
    std::smatch cells;
    if (!std::regex_match(line, cells, row)) continue;
    ++rows;
    examples += cells[2];
    const std::string file = example_file(cells[1], cells[2]), kind = cells[3];
    std::string said = cells[4];
    said.erase(said.find_last_not_of(' ') + 1);
    if (kind == "refused") {
      EXPECT_THAT(refusal_of(file), HasSubstr(said)) << file;
    } else {
      const std::vector<std::string> warnings = read_settings(file, "settings.json").warnings;
      if (kind == "silent" || kind == "works") {
        EXPECT_THAT(warnings, IsEmpty()) << file;
      } else {
        EXPECT_THAT(warnings, ElementsAre(HasSubstr("has no effect here: " + said))) << file;
      }
    }
  }
  EXPECT_GT(rows, 80U);
  std::istringstream documented(kDocumentedKeys);
  for (std::string key; documented >> key;) EXPECT_THAT(examples, HasSubstr('"' + key + "\":")) << "has no row";
}

/// Keys that the documentation spells differently from AirSim's source, and choices that are an empty text.
TEST(Settings, BothSpellingsAndEmptyChoicesWork) {
  const auto vehicle = [](const std::string& keys) {
    const Settings settings = read_settings(R"({"Vehicles": {"A": {)" + keys + "}}}", "settings.json");
    EXPECT_THAT(settings.warnings, IsEmpty()) << keys;
    return settings.vehicles[0];
  };
  for (const char* key : {"LockStep", "Lockstep"})
    EXPECT_FALSE(vehicle(R"("VehicleType": "PX4Multirotor", ")" + std::string(key) + "\": false").autopilot->lockstep);
  for (const char* key : {"EnableCollisionPassthrogh", "EnableCollisionPassthrough"})
    EXPECT_FALSE(vehicle('"' + std::string(key) + "\": true").enable_collisions);
  EXPECT_TRUE(vehicle(R"("VehicleType": "")").flies);
  const VehicleSettings unset = vehicle(R"("X": NaN, "Yaw": NaN, "Cameras": {"NaN": {"X":NaN, // NaN "NaN
    "Y": 2, /* NaN " */ "Z": NaN}})");
  EXPECT_EQ(unset.start_ned.x(), 0.0) << "as the documentation's default file has it";
  EXPECT_EQ(camera_named(unset, "NaN").T_body_camera.translation, geometry::Vec3(0, 2, 0));
  EXPECT_THAT(refusal_of(R"({"SegmentationSettings": {"InitMethod": "x"}})"),
              testing::EndsWith("must be one of: None, CommonObjectsRandomIDs"));
  const auto has_random_ids = [](const std::string& text) { return read_settings(text, "settings.json").random_ids; };
  EXPECT_TRUE(has_random_ids(R"({"SegmentationSettings": {"InitMethod": ""}})"));
  EXPECT_FALSE(has_random_ids(R"({"SegmentationSettings": {"InitMethod": "None"}})"));
  EXPECT_FALSE(has_random_ids(R"({"InitialInstanceSegmentation": false})"));
}

TEST(Settings, KeysWithoutEffectForTheSameReasonAreOneWarning) {
  const std::string image =
      R"({"AutoExposureSpeed": 100, "AutoExposureBias": 1, "MotionBlurAmount": 0, "TargetGamma": 1})";
  const std::string file = R"({"CameraDefaults": {"CaptureSettings": [)" + image + "," + image + "," + image + "]}}";
  EXPECT_THAT(
      read_settings(file, "s.json").warnings,
      ElementsAre("s.json: 'CameraDefaults.CaptureSettings[0].AutoExposureSpeed' has no effect here: images have "
                  "the colours of the tiles' textures (also: 'CameraDefaults.CaptureSettings[0].AutoExposureBias', "
                  "'CameraDefaults.CaptureSettings[1].AutoExposureSpeed', "
                  "'CameraDefaults.CaptureSettings[1].AutoExposureBias', "
                  "'CameraDefaults.CaptureSettings[2].AutoExposureSpeed' and 1 more)"));
}

TEST(Settings, WhatCannotMeanAnythingIsRefused) {
  const auto lidar = [](const std::string& keys) {
    return refusal_of(R"({"Vehicles": {"A": {"Sensors": {"L": {"SensorType": 6, )" + keys + "}}}}}");
  };
  EXPECT_THAT(lidar(R"("RotationsPerSecond": 0)"), HasSubstr("must be more than 0"));
  EXPECT_THAT(lidar(R"("Range": -1)"), HasSubstr("'Vehicles.A.Sensors.L.Range' is -1, out of range"));
  EXPECT_THAT(refusal_of(R"({"Recording": {"RecordInterval": -1}})"), HasSubstr("out of range"));
  EXPECT_THAT(refusal_of(R"({"Vehicles": {"A": {"VehicleType": "PhysXCar"}}})"), HasSubstr("cars are not simulated"));
  EXPECT_THAT(refusal_of(R"({"SimMode": "Drone"})"), testing::EndsWith("one of: Multirotor, ComputerVision"));
}

TEST(Settings, CosysSensorsAreReadAndThoseOfOtherKindsAreLeftOutWithAWarning) {
  const Settings settings = read_settings(R"({"SettingsVersion": 2.0, "Vehicles": {"A": {"Sensors": {
    "echo": {"SensorType": 7, "Enabled": true, "NumberOfTraces": -90, "SensorLowerAzimuthLimit": -45, "SenseActive": true,
             "MeasurementFrequency": 5, "AttenuationPerDistance": 0.5, "DrawSensor": false, "Z": -0.5},
    "gpulidar": {"SensorType": 8, "Enabled": true, "NumberOfChannels": 32, "MeasurementsPerCycle": 512, "Resolution": 1024,
                 "GroundTruth": true, "InstanceSegmentation": true},
    "lidar": {"SensorType": 6, "Enabled": true, "MeasurementsPerCycle": 100},
    "uwb": {"SensorType": 10, "Enabled": true, "anything": 1}}}}})",
                                          "settings.json");
  EXPECT_THAT(settings.warnings, ElementsAre(HasSubstr("'Vehicles.A.Sensors.uwb.SensorType' 10 is not simulated")));
  const std::vector<SensorSettings>& sensors = settings.vehicles[0].sensors;
  EXPECT_THAT(names_of(sensors), ElementsAre("imu", "magnetometer", "gps", "barometer", "echo", "gpulidar", "lidar"));
  const auto& echo = std::get<EchoSettings>(sensors[4].kind);
  EXPECT_EQ(echo.traces, -90);
  EXPECT_EQ(echo.azimuth_from_deg, -45.0);
  EXPECT_EQ(echo.max_distance_m, 10.0);
  EXPECT_NEAR(echo.T_body_sensor.translation.z(), -0.5, 1e-12);
  const auto& gpu = std::get<LidarSettings>(sensors[5].kind);
  EXPECT_NEAR(gpu.points_per_second, 32 * 512 * 10.0, 1e-6);
  EXPECT_EQ(gpu.range_m, 50.0);
  EXPECT_TRUE(gpu.in_sensor_frame);
  EXPECT_NEAR(std::get<LidarSettings>(sensors[6].kind).points_per_second, 16 * 100 * 10.0, 1e-6);
}

TEST(Settings, AnnotationLayersAreThoseOfCosys) {
  const Settings settings = read_settings(R"({"Annotation": [
    {"Name": "Direct", "Type": 0, "Default": true, "SetDirect": true, "ViewDistance": 10},
    {"Name": "Index", "Type": 0, "Default": true, "SetDirect": false}, {"Name": "Grey", "Type": 1},
    {"Name": "Texture", "Type": 2, "SetDirect": false, "TexturePath": "/Game/A", "TexturePrefix": "T"}]})",
                                          "settings.json");
  EXPECT_THAT(settings.warnings, IsEmpty());
  ASSERT_EQ(settings.annotation_layers.size(), 4U);
  EXPECT_EQ(settings.annotation_layers[0].name, "Direct");
  EXPECT_EQ(settings.annotation_layers[0].kind, simulator::AnnotationKind::kColour);
  EXPECT_EQ(settings.annotation_layers[1].kind, simulator::AnnotationKind::kColourIndex);
  EXPECT_EQ(settings.annotation_layers[2].kind, simulator::AnnotationKind::kGreyscale);
  EXPECT_EQ(settings.annotation_layers[3].kind, simulator::AnnotationKind::kTexture);
  EXPECT_THAT(refusal_of(R"({"Annotation": [{"Type": 0}]})"), HasSubstr("Name"));
  EXPECT_THAT(refusal_of(R"({"Annotation": [{"Name": "a", "Type": 3}]})"), HasSubstr("Type"));
  EXPECT_THAT(refusal_of(R"({"Annotation": [{"Name": "a"}, {"Name": "a", "Type": 1}]})"),
              HasSubstr("'Annotation[1].Name' 'a' is given twice"));
}

TEST(Settings, LensesBeyondThePinhole) {
  const Settings settings = read_settings(R"({"CameraDefaults": {"CaptureSettings": [{"ImageType": 0, "Width": 400,
    "Height": 400, "Lens": {"Model": "fisheye", "FOV_Degrees": 190}}, {"ImageType": 1, "Width": 100, "Height": 100,
    "Lens": {"Model": "Kannala-Brandt", "Intrinsics": [30, 31, 50, 49], "K": [0.1, 0.01, 0, 0]}}]}})",
                                          "settings.json");
  EXPECT_THAT(settings.warnings, IsEmpty());
  const auto& captures = settings.vehicles[0].cameras[0].captures;
  const imaging::Camera wide = make_lens(captures[0], "camera");
  EXPECT_NEAR(wide.horizontal_fov_deg(), 190.0, 0.5);
  const auto model = std::get<imaging::KannalaBrandt>(make_lens(captures[1], "camera").model());
  EXPECT_NEAR(model.cx, 49.5, 1e-6) << "AirSim's pixel centres lie at +0.5, ours at integers";
  EXPECT_NEAR(model.k[0], 0.1, 1e-6);
}

TEST(Settings, TheLongerSideHasTheFieldOfView) {
  CaptureSettings portrait{100, 200, 90.0, {}};
  EXPECT_NEAR(std::get<imaging::PinholeRadtan>(make_lens(portrait, "camera").model()).fx, 100.0, 1e-9);
  CaptureSettings landscape{200, 100, 90.0, {}};
  const auto model = std::get<imaging::PinholeRadtan>(make_lens(landscape, "camera").model());
  EXPECT_NEAR(model.fy, 100.0, 1e-9);
  EXPECT_NEAR(model.cx, 99.5, 1e-12);
}

}  // namespace
}  // namespace tileflight::simulator::settings_test
