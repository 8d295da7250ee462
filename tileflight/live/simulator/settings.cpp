#include "tileflight/live/simulator/settings.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/simulation_clock.h"

namespace tileflight::simulator {
namespace {

using base::StrictSection;
using geometry::SE3;
using geometry::Vec3;
using imaging::Camera;

constexpr int kMaxSide_px = 8192;
constexpr double kMaxImagePixels = 32e6;

LensDescription read_lens(StrictSection section, const CaptureSettings& capture) {
  LensDescription lens;
  lens.model =
      section.choice_in_any_case("Model", {"pinhole", "fisheye", "kannala-brandt", "panorama"}).value_or("fisheye");
  if (lens.model == "kannala-brandt") lens.model = "fisheye";
  lens.width = capture.width;
  lens.height = capture.height;
  lens.fov_degrees = static_cast<float>(section.number("FOV_Degrees", 0.0, 0.0, 360.0));
  for (const double k : section.numbers("K", 0, 4).value_or(std::vector<double>{}))
    lens.k.push_back(static_cast<float>(k));
  for (const double value : section.numbers("Intrinsics", 0, 4).value_or(std::vector<double>{}))
    lens.intrinsics.push_back(static_cast<float>(value));
  section.require_all_keys_used();
  return lens;
}

void read_capture(StrictSection& section, CaptureSettings& capture) {
  capture.width = section.integer("Width", capture.width, 1, kMaxSide_px);
  capture.height = section.integer("Height", capture.height, 1, kMaxSide_px);
  capture.fov_deg = section.number("FOV_Degrees", capture.fov_deg, 0.1, 179.9);
  if (auto lens = section.section("Lens")) capture.lens = read_lens(std::move(*lens), capture);
  if (base::to_lower(section.text("ProjectionMode").value_or("")) == "orthographic")
    throw section.error("ProjectionMode", "orthographic images are not supported: use perspective");
  make_lens(capture, section.place());
  section.ignore_with_warning({"DepthOfFieldFstop", "DepthOfFieldFocalDistance", "DepthOfFieldFocalRegion"},
                              "everything is in focus");
  section.ignore({"ImageType", "OrthoWidth", "PublishToRos", "LumenGIEnable", "LumenReflectionEnable",
                  "LumenFinalQuality", "LumenSceneDetail", "LumenSceneLightningDetail", "ForceUpdate"});
  section.ignore_with_warning({"AutoExposureSpeed", "AutoExposureBias", "AutoExposureMaxBrightness",
                               "AutoExposureMinBrightness", "AutoExposureLowPercent", "AutoExposureHighPercent",
                               "AutoExposureHistogramLogMin", "AutoExposureHistogramLogMax", "AutoExposureMethod"},
                              "images have the colours of the tiles' textures");
  if (section.number("TargetGamma").value_or(1.0) != 1.0)
    section.warn("TargetGamma", "has no effect here: images have the colours of the tiles' textures");
  section.ignore_with_warning({"MotionBlurAmount", "MotionBlurMax", "ChromaticAberrationScale"},
                              "images are sharp; for blur, use `tileflight render`");
  section.ignore_with_warning({"IgnoreMarked"}, "images show every object");
  section.require_all_keys_used();
}

double focal_px(const CaptureSettings& capture) {
  return 0.5 * std::max(capture.width, capture.height) / std::tan(0.5 * radians(capture.fov_deg));
}

Camera make_fisheye_lens(const LensDescription& lens, int width, int height, const std::string& where) {
  std::array<double, 4> k{};
  for (std::size_t i = 0; i < lens.k.size(); ++i) k[i] = lens.k[i];
  if (lens.intrinsics.empty()) {
    const double fov_deg = lens.fov_degrees > 0.0F ? lens.fov_degrees : 180.0;
    return imaging::make_fisheye(width, height, fov_deg, k);
  }
  const auto& i = lens.intrinsics;
  base::require(i.size() == 4 && i[0] > 0.0F && i[1] > 0.0F, where,
                "the intrinsics must be fx, fy, cx, cy, with fx and fy above 0");
  return {imaging::KannalaBrandt{i[0], i[1], i[2] - 0.5, i[3] - 0.5, k}, width, height};
}

Camera make_pinhole_lens(const LensDescription& lens, int width, int height, const std::string& where) {
  if (lens.intrinsics.empty())
    return imaging::make_pinhole(width, height, lens.fov_degrees > 0.0F ? lens.fov_degrees : 90.0);
  const auto& i = lens.intrinsics;
  base::require(i.size() == 4 && i[0] > 0.0F && i[1] > 0.0F, where,
                "the intrinsics must be fx, fy, cx, cy, with fx and fy above 0");
  return {imaging::PinholeRadtan{i[0], i[1], i[2] - 0.5, i[3] - 0.5, {}}, width, height};
}

void check(const LensDescription& lens, const std::string& where) {
  base::require(lens.k.size() <= 4, where, "a fisheye lens has at most four coefficients");
  for (const float value : lens.k)
    base::require(std::isfinite(value) && std::abs(value) < 1e3F, where, "a coefficient is out of range");
  for (const float value : lens.intrinsics)
    base::require(std::isfinite(value) && std::abs(value) < 1e6F, where, "the intrinsics are out of range");
  base::require(std::isfinite(lens.fov_degrees) && lens.fov_degrees >= 0.0F && lens.fov_degrees <= 360.0F, where,
                "the field of view is out of range");
}

SE3 offset(double x, double y, double pitch_deg, double yaw_deg) {
  return {rotation_from_rpy(0, radians(pitch_deg), radians(yaw_deg)), Vec3(x, y, 0.0)};
}

}  // namespace

Vec3 read_position(StrictSection& section, const Vec3& fallback) {
  constexpr double kFar_m = 1e7;
  const auto along = [&](const char* key, double value) { return section.number(key, value, -kFar_m, kFar_m); };
  return {along("X", fallback.x()), along("Y", fallback.y()), along("Z", fallback.z())};
}

Eigen::Quaterniond read_orientation(StrictSection& section) {
  const auto angle = [&](const char* key) { return radians(section.number(key, 0.0, -3600.0, 3600.0)); };
  const double roll = angle("Roll"), pitch = angle("Pitch");
  return rotation_from_rpy(roll, pitch, angle("Yaw"));
}

Camera make_lens(const CaptureSettings& capture, const std::string& where) {
  const int width = capture.width, height = capture.height;
  base::require(width >= 1 && height >= 1 && width <= kMaxSide_px && height <= kMaxSide_px &&
                    static_cast<double>(width) * height <= kMaxImagePixels,
                where, "an image must not exceed 8192 x 8192 or 32 million pixels");
  if (capture.lens) {
    check(*capture.lens, where);
    if (capture.lens->model == "panorama") return imaging::make_panorama(width, height);
    if (capture.lens->model == "pinhole") return make_pinhole_lens(*capture.lens, width, height, where);
    base::require(capture.lens->model == "fisheye", where,
                  "the lens '" + capture.lens->model + "' is unknown; use pinhole, fisheye or panorama");
    return make_fisheye_lens(*capture.lens, width, height, where);
  }
  base::require(capture.fov_deg >= 0.1 && capture.fov_deg <= 179.9, where,
                "the field of view must be from 0.1 to 179.9 degrees");
  const double f = focal_px(capture);
  return {imaging::PinholeRadtan{f, f, 0.5 * (width - 1), 0.5 * (height - 1), {}}, width, height};
}

CameraSettings read_camera(const std::string& name, StrictSection section, const CameraSettings& defaults) {
  CameraSettings camera = defaults;
  camera.name = name;
  camera.T_body_camera = SE3(read_orientation(section), read_position(section));
  for (StrictSection& entry : section.sections("CaptureSettings")) {
    const int type = entry.integer("ImageType", 0, -1, 100);
    CaptureSettings unused;
    read_capture(entry, type >= 0 && type < kImageTypeCount ? camera.captures[static_cast<std::size_t>(type)] : unused);
  }
  const bool lists_noise = section.is_list("NoiseSettings");
  for (StrictSection& noise : lists_noise ? section.sections("NoiseSettings") : std::vector<StrictSection>{}) {
    if (noise.boolean("Enabled").value_or(false))
      noise.warn("Enabled", "has no effect here: images have no noise; add it to them, or use `tileflight render`");
  }
  if (section.is_map("Gimbal"))
    section.section("Gimbal")->ignore_with_warning(
        {"Stabilization"}, "the camera turns with its vehicle; set its pose with simSetCameraPose");
  section.ignore_with_warning({"External"}, "the camera is on its vehicle; put it into ExternalCameras");
  section.ignore({"UnrealEngine", "NoiseSettings", "Gimbal", "DrawSensor", "ExternalLocal"});
  section.require_all_keys_used();
  return camera;
}

std::vector<CameraSettings> default_cameras(const CameraSettings& defaults) {
  const std::vector<std::pair<std::string, SE3>> places{{"front_center", offset(0, 0, 0, 0)},
                                                        {"front_right", offset(0, 0.125, 0, 0)},
                                                        {"front_left", offset(0, -0.125, 0, 0)},
                                                        {"bottom_center", offset(0, 0, -90, 0)},
                                                        {"back_center", offset(0, 0, 0, 180)}};
  std::vector<CameraSettings> cameras;
  for (const auto& [name, T_body_camera] : places) {
    cameras.push_back(defaults);
    cameras.back().name = name;
    cameras.back().T_body_camera = T_body_camera;
  }
  return cameras;
}

std::string resolve_camera_alias(const std::string& name) {
  static const std::vector<std::pair<std::string, std::string>> kAliases{
      {"", "front_center"}, {"fpv", "front_center"}, {"0", "front_center"}, {"1", "front_right"},
      {"2", "front_left"},  {"3", "bottom_center"},  {"4", "back_center"}};
  for (const auto& [alias, camera] : kAliases) {
    if (alias == name) return camera;
  }
  return name;
}

namespace {

constexpr double kArduPilotExpo = 0.65, kPx4Expo = 0.0;  // MOT_THST_EXPO, THR_MDL_FAC

/// AirSim's keys of PX4 for what is not here: a serial port, its offboard control, its ground station and log viewer.
const std::vector<std::string> kIgnoredOfPx4{
    "ControlIp",        "ControlPort",     "ControlPortLocal", "ControlPortRemote",
    "LocalHostIp",      "UdpIp",           "UdpPort",          "QgcHostIp",
    "QgcPort",          "SitlIp",          "SitlPort",         "SerialPort",
    "SerialBaudRate",   "LogViewerHostIp", "LogViewerPort",    "LogViewerSendPort",
    "SimSysID",         "SimCompID",       "AirControlSysID",  "AirControlCompID",
    "VehicleSysID",     "VehicleCompID",   "OffboardSysID",    "OffboardCompID",
    "ExternalSimSysID", "ExternalSimPort"};

vehicle::AirframeKind read_airframe(base::StrictSection& vehicle) {
  const std::string model =
      vehicle.choice_in_any_case("Model", {"Generic", "Quadcopter", "Hexacopter", ""}).value_or("Generic");
  return model == "Hexacopter" ? vehicle::AirframeKind::kHexaX : vehicle::AirframeKind::kQuadX;
}

VisionSettings read_vision(base::StrictSection& vehicle) {
  VisionSettings vision;
  const std::string source =
      vehicle.choice_in_any_case("VisionOdometry", {"None", "TruthWithNoise", "FromPictures", "FromPlace"})
          .value_or("None");
  vision.source = source == "TruthWithNoise" ? VisionSource::kTruth
                  : source == "FromPictures" ? VisionSource::kPictures
                  : source == "FromPlace"    ? VisionSource::kPlace
                                             : VisionSource::kNone;
  vision.place = vehicle.text("VisionPlace").value_or("");
  if (!vision.place.empty() && vision.source != VisionSource::kPlace)
    throw vehicle.error("VisionPlace", "is of VisionOdometry FromPlace only");
  vision.camera = vehicle.text("VisionCamera").value_or(vision.camera);
  vision.rate_hz = vehicle.number("VisionRate", vision.rate_hz, 1.0, 125.0);
  vision.latency_s = vehicle.number("VisionLatency", vision.latency_s, 0.0, 1.0);
  return vision;
}

AutopilotSettings read_px4(base::StrictSection& vehicle) {
  AutopilotSettings settings{.kind = AutopilotKind::kPx4};
  if (vehicle.boolean("UseSerial").value_or(false))
    throw vehicle.error("UseSerial", "PX4 is served over TCP; set it to false");
  if (!vehicle.boolean("UseTcp").value_or(true))
    throw vehicle.error("UseTcp", "PX4 is served over TCP; set it to true");
  settings.port = vehicle.integer("TcpPort", 4560, 0, 65535);
  // AirSim reads the first, its documentation has the second.
  settings.lockstep = vehicle.boolean("LockStep").value_or(vehicle.boolean("Lockstep").value_or(true));
  settings.thrust_expo = vehicle.number("ThrustExpo", kPx4Expo, 0.0, 1.0);
  settings.optical_flow = vehicle.boolean("OpticalFlow").value_or(false);
  settings.vision = read_vision(vehicle);
  vehicle.ignore(kIgnoredOfPx4);
  vehicle.ignore_with_warning({"Parameters", "params"}, "AirSim sends these to PX4; here set them in PX4 (param set)");
  vehicle.ignore_with_warning({"Logs"}, "messages of PX4 are not logged; PX4 writes a log of its own");
  return settings;
}

AutopilotSettings read_ardupilot(base::StrictSection& vehicle) {
  AutopilotSettings settings;
  settings.port = vehicle.integer("ControlPort", 9002, 0, 65535);
  settings.thrust_expo = vehicle.number("ThrustExpo", kArduPilotExpo, 0.0, 1.0);
  if (vehicle.has("VisionOdometry"))
    throw vehicle.error("VisionOdometry",
                        "ArduPilot's JSON interface has no message for it: ArduPilot takes vision over "
                        "a serial port of its own (docs/autopilots.md)");
  // The state goes back to where the servo packets come from.
  vehicle.ignore({"UdpIp", "UdpPort", "LocalHostIp", "UseSerial"});
  return settings;
}

}  // namespace

std::optional<AutopilotSettings> read_autopilot(const std::string& vehicle_type, base::StrictSection& vehicle) {
  if (vehicle_type != "ArduCopter" && vehicle_type != "PX4Multirotor") return std::nullopt;
  AutopilotSettings settings = vehicle_type == "ArduCopter" ? read_ardupilot(vehicle) : read_px4(vehicle);
  settings.airframe = read_airframe(vehicle);
  return settings;
}

namespace {

using nlohmann::json;

/// AirSim's keys for features that do not exist here: a window, a graphics card, a game.
const std::vector<std::string> kIgnoredKeys{
    "SettingsVersion", "SeeDocsAt",   "ViewMode",          "ClockType",       "LogMessagesVisible",
    "RecordUIVisible", "RpcEnabled",  "EnableRpc",         "SubWindows",      "PawnPaths",
    "CameraDirector",  "RC",          "Material",          "InitialViewMode", "SpeedUnitFactor",
    "SpeedUnitLabel",  "EngineSound", "ShowLosDebugLines", "ForegroundColor", "MoveWorldOrigin"};

geometry::Geodetic read_origin(StrictSection section) {
  const geometry::Geodetic origin{section.number("Latitude", kDefaultOrigin.latitude_deg, -90.0, 90.0),
                                  section.number("Longitude", kDefaultOrigin.longitude_deg, -180.0, 180.0),
                                  {section.number("Altitude", kDefaultOrigin.height.m, -10000.0, 100000.0)}};
  section.require_all_keys_used();
  return origin;
}

RecordingSettings read_recording(StrictSection section) {
  RecordingSettings recording;
  recording.enabled = section.boolean("Enabled").value_or(false);
  recording.on_move = section.boolean("RecordOnMove").value_or(false);
  recording.interval_s = section.clamped_number("RecordInterval", 0.05, SimulationClock::kStep_s, 3600.0);
  recording.folder = section.text("Folder").value_or("");
  recording.dataset = section.boolean("Dataset").value_or(false);
  std::vector<RecordingCamera> cameras;
  for (StrictSection& entry : section.sections("Cameras")) {
    cameras.push_back({entry.text("CameraName").value_or(""), entry.integer("ImageType", 0, 0, kImageTypeCount - 1),
                       entry.boolean("PixelsAsFloat").value_or(false), entry.boolean("Compress").value_or(true),
                       entry.text("VehicleName").value_or(""), entry.text("Annotation").value_or("")});
    entry.require_all_keys_used();
  }
  if (!cameras.empty()) recording.cameras = std::move(cameras);
  section.require_all_keys_used();
  return recording;
}

void read_segmentation(StrictSection section, Settings& settings) {
  const std::string method =
      section.choice_in_any_case("InitMethod", {"None", "CommonObjectsRandomIDs", ""}).value_or("");
  settings.random_ids = method != "None";
  section.ignore({"MeshNamingMethod", "OverrideExisting"});
  section.require_all_keys_used();
}

std::vector<simulator::AnnotationSettings> read_annotation_layers(StrictSection& root) {
  constexpr int kColours = 0, kGreyscale = 1, kTextures = 2;  // Cosys-AirSim's types
  std::vector<simulator::AnnotationSettings> layers;
  for (StrictSection& entry : root.sections("Annotation")) {
    const int type = entry.integer("Type", kColours, kColours, kTextures);
    const bool direct = entry.boolean("SetDirect").value_or(false);
    const simulator::AnnotationKind kind = type == kGreyscale  ? simulator::AnnotationKind::kGreyscale
                                           : type == kTextures ? simulator::AnnotationKind::kTexture
                                           : direct            ? simulator::AnnotationKind::kColour
                                                               : simulator::AnnotationKind::kColourIndex;
    layers.push_back({entry.required_text("Name"), kind});
    if (std::ranges::count(layers, layers.back().name, &simulator::AnnotationSettings::name) > 1)
      throw entry.error("Name", "'" + layers.back().name + "' is given twice");
    entry.ignore({"Default", "ViewDistance", "TexturePath", "TexturePrefix"});
    entry.require_all_keys_used();
  }
  return layers;
}

/// Replaces cameras of the same name, and appends the others.
void put_cameras(std::vector<CameraSettings> own, std::vector<CameraSettings>& cameras) {
  for (CameraSettings& camera : own) {
    const auto at = std::ranges::find(cameras, camera.name, &CameraSettings::name);
    if (at == cameras.end()) {
      cameras.push_back(std::move(camera));
    } else {
      *at = std::move(camera);
    }
  }
}

/// The camera of an autopilot's vision must be there. `vehicle`: with its cameras.
void check_vision(VehicleSettings& vehicle, StrictSection& section) {
  if (!vehicle.autopilot || !vehicle.autopilot->vision.uses_camera()) return;
  std::string& camera = vehicle.autopilot->vision.camera;
  camera = resolve_camera_alias(camera);
  const auto named = std::ranges::find(vehicle.cameras, camera, &CameraSettings::name);
  if (named == vehicle.cameras.end()) throw section.error("VisionCamera", "the vehicle has no camera '" + camera + "'");
  constexpr int kLeastSide_px = 64;
  const CaptureSettings& capture = named->captures[static_cast<std::size_t>(ImageType::kScene)];
  if (std::min(capture.width, capture.height) < kLeastSide_px)
    throw section.error("VisionCamera", "its images are too small; at least 64 pixels a side");
}

/// Whether a vehicle of AirSim or Cosys-AirSim is one on wheels.
bool is_car(StrictSection& vehicle) {
  static const std::vector<std::string> kCars{"physxcar", "boxcar", "ardurover", "cphusky", "pioneer"};
  return std::ranges::find(kCars, base::to_lower(vehicle.text("VehicleType").value_or(""))) != kCars.end();
}

VehicleSettings read_vehicle(const std::string& name, StrictSection section, Settings& settings,
                             const std::vector<SensorSettings>& default_sensors) {
  VehicleSettings vehicle = default_vehicle(name, !settings.computer_vision, settings.camera_defaults);
  std::string type = section
                         .choice_in_any_case("VehicleType", {"SimpleFlight", "ComputerVision", "ExternalPhysics",
                                                             "PX4Multirotor", "ArduCopter", ""})
                         .value_or("");
  if (type.empty()) type = settings.computer_vision ? "ComputerVision" : "SimpleFlight";
  vehicle.autopilot = read_autopilot(type, section);
  if (vehicle.autopilot && settings.computer_vision)
    throw section.error("VehicleType", "an autopilot flies in the mode Multirotor and with its physics only");
  vehicle.flies = (type == "SimpleFlight" || vehicle.autopilot) && !settings.computer_vision;
  vehicle.start_ned = read_position(section);
  vehicle.R_ned_body = read_orientation(section);
  const std::string state =
      section.choice_in_any_case("DefaultVehicleState", {"Armed", "Disarmed", "Inactive", ""}).value_or("");
  vehicle.armed = state.empty() || state == "Armed";
  vehicle.allow_api_always = section.boolean("AllowAPIAlways").value_or(false);
  bool passes = section.boolean("EnableCollisionPassthrogh").value_or(false);  // AirSim's spelling; Cosys-AirSim's:
  passes = section.boolean("EnableCollisionPassthrough").value_or(passes);
  vehicle.enable_collisions = section.boolean("EnableCollisions").value_or(true) && !passes;
  std::vector<CameraSettings> cameras;
  for (auto& [camera, entry] : section.named_sections("Cameras"))
    cameras.push_back(read_camera(resolve_camera_alias(camera), std::move(entry), settings.camera_defaults));
  put_cameras(std::move(cameras), vehicle.cameras);
  check_vision(vehicle, section);
  vehicle.sensors = read_sensors(section, "Sensors", vehicle.flies, default_sensors, settings.warnings);
  if (!section.boolean("AutoCreate").value_or(true))
    section.warn("AutoCreate", "has no effect here: the vehicle is created at the start; take it out of Vehicles");
  if (!vehicle.autopilot)
    section.ignore_with_warning({"Parameters", "params"}, "they are for PX4Multirotor, and set in PX4");
  section.ignore(
      {"PawnPath", "IsFpvVehicle", "EnableTrace", "DebugSymbolScale", "RC", "FollowDistance", "UseSerial", "Model"});
  section.require_all_keys_used();
  return vehicle;
}

void read_vehicles(StrictSection& root, Settings& settings) {
  const bool flies = !settings.computer_vision;
  const std::vector<SensorSettings> sensors =
      read_sensors(root, "DefaultSensors", flies, default_sensors(flies), settings.warnings);
  auto entries = root.named_sections("Vehicles");
  if (entries.size() > kMaxVehicles)
    throw root.error("Vehicles", "more than " + std::to_string(kMaxVehicles) + " vehicles");
  constexpr const char* kNoCars =
      "cars are not simulated; use SimpleFlight, ArduCopter, PX4Multirotor or ComputerVision";
  for (auto& [name, entry] : entries) {
    if (!is_car(entry)) {
      settings.vehicles.push_back(read_vehicle(name, std::move(entry), settings, sensors));
    } else if (std::ranges::all_of(entries, [](auto& one) { return is_car(one.second); })) {
      throw entry.error("VehicleType", kNoCars);
    } else {
      entry.warn("VehicleType", std::string(kNoCars) + "; the vehicle is left out");
    }
  }
  settings.clock.by_autopilots =
      std::ranges::any_of(settings.vehicles, [](const VehicleSettings& one) { return one.autopilot.has_value(); });
  if (!settings.vehicles.empty()) return;
  settings.vehicles.push_back(default_vehicle(settings.computer_vision ? "ComputerVision" : "SimpleFlight",
                                              !settings.computer_vision, settings.camera_defaults));
  settings.vehicles.back().sensors = sensors;
}

void read_mode(StrictSection& root, Settings& settings) {
  std::string mode = base::to_lower(root.text("SimMode").value_or(""));
  if (mode == "car" || mode == "skidvehicle")
    throw root.error("SimMode", "cars are not simulated; use Multirotor or ComputerVision");
  if (!mode.empty()) mode = *root.choice_in_any_case("SimMode", {"Multirotor", "ComputerVision"});
  settings.computer_vision = mode == "ComputerVision";
  const std::string physics =
      root.choice_in_any_case("PhysicsEngineName", {"", "FastPhysicsEngine", "ExternalPhysicsEngine", "PhysX"})
          .value_or("");
  if (physics == "ExternalPhysicsEngine") settings.computer_vision = true;
  settings.clock.speed = root.number("ClockSpeed", 1.0, 1e-3, 1e3);
  settings.clock.on_demand = root.boolean("StepOnDemand").value_or(false);
  if (root.has("ApiServerPort")) settings.port = root.integer("ApiServerPort", 41451, 0, 65535);
  if (root.has("LocalHostIp")) settings.address = root.text("LocalHostIp").value_or("");
}

/// Joins the warnings of keys that have no effect for the same reason, as of each kind of image, into the first of
/// them.
std::vector<std::string> folded(const std::vector<std::string>& warnings) {
  constexpr std::size_t kNamed = 4;
  std::vector<std::string> all;
  std::vector<std::pair<std::string, std::vector<std::string>>> others;  // reason, keys; by place in `all`
  for (const std::string& warning : warnings) {
    const std::size_t reason = warning.find(" has no effect here: "), key = warning.find('\'');
    const std::string why = reason == std::string::npos ? "" : warning.substr(reason);
    const auto same = std::ranges::find(others, why, [](const auto& one) { return one.first; });
    if (!why.empty() && same != others.end()) {
      same->second.push_back(warning.substr(key, reason - key));
      continue;
    }
    all.push_back(warning);
    others.emplace_back(why, std::vector<std::string>{});
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::vector<std::string>& keys = others[i].second;
    if (keys.empty()) continue;
    const std::size_t more = keys.size() > kNamed ? keys.size() - kNamed : 0;
    keys.resize(keys.size() - more);
    all[i] += " (also: " + base::joined(keys) + (more > 0 ? " and " + std::to_string(more) + " more" : "") + ")";
  }
  return all;
}

/// Replaces the numbers NaN, which AirSim's documentation has for "not given" and Python writes, by null.
std::string without_nan(std::string text) {
  const auto continues = [&text](std::size_t at) {
    return at < text.size() && (std::isalnum(static_cast<unsigned char>(text[at])) != 0 || text[at] == '_');
  };
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (in_string && text[i] == '\\') {
      ++i;
    } else if (text[i] == '"') {
      in_string = !in_string;
    } else if (!in_string && (text.compare(i, 2, "//") == 0 || text.compare(i, 2, "/*") == 0)) {
      const std::size_t end = text.find(text[i + 1] == '/' ? "\n" : "*/", i + 2);
      if (end == std::string::npos) break;
      i = end;
    } else if (!in_string && text.compare(i, 3, "NaN") == 0 && !continues(i + 3) && (i == 0 || !continues(i - 1))) {
      text.replace(i, 3, "null");
    }
  }
  return text;
}

json parse_settings_json(const std::string& text, const std::string& name) {
  if (is_blank(text)) return json::object();
  try {
    return json::parse(text.find("NaN") == std::string::npos ? text : without_nan(text), nullptr, true, true);
  } catch (const json::exception& error) {
    throw InputError(name, "is not JSON: " + std::string(error.what()));
  }
}

}  // namespace

VehicleSettings default_vehicle(const std::string& name, bool flies, const CameraSettings& camera_defaults) {
  VehicleSettings vehicle;
  vehicle.name = name;
  vehicle.flies = flies;
  vehicle.cameras = default_cameras(camera_defaults);
  vehicle.sensors = default_sensors(flies);
  return vehicle;
}

bool is_blank(const std::string& settings_text) {
  return settings_text.find_first_not_of(" \t\r\n\xEF\xBB\xBF") == std::string::npos;
}

std::string default_settings_text() {
  const Settings settings = read_settings("", "settings.json");
  nlohmann::ordered_json text{{"SettingsVersion", 1.2},
                              {"SimMode", "Multirotor"},
                              {"ClockSpeed", settings.clock.speed},
                              {"CameraDefaults", {{"CaptureSettings", nlohmann::ordered_json::array()}}},
                              {"Vehicles", nlohmann::ordered_json::object()}};
  for (std::size_t type = 0; type < settings.camera_defaults.captures.size(); ++type) {
    const CaptureSettings& capture = settings.camera_defaults.captures[type];
    text["CameraDefaults"]["CaptureSettings"].push_back(
        {{"ImageType", type}, {"Width", capture.width}, {"Height", capture.height}, {"FOV_Degrees", capture.fov_deg}});
  }
  for (const VehicleSettings& vehicle : settings.vehicles) {
    text["Vehicles"][vehicle.name] = {{"VehicleType", "SimpleFlight"},
                                      {"DefaultVehicleState", vehicle.armed ? "Armed" : "Disarmed"},
                                      {"X", vehicle.start_ned.x()},
                                      {"Y", vehicle.start_ned.y()},
                                      {"Z", vehicle.start_ned.z()}};
  }
  return text.dump(2);
}

std::map<std::string, std::filesystem::path> read_assets(StrictSection section) {
  std::map<std::string, std::filesystem::path> assets;
  for (const std::string& name : section.keys()) {
    if (const auto file = section.path(name)) assets[name] = *file;
  }
  section.require_all_keys_used();
  return assets;
}

Settings read_settings(const std::string& text, const std::string& name) {
  const json document = parse_settings_json(text, name);
  Settings settings;
  StrictSection root(document, name, "", &settings.warnings);
  read_mode(root, settings);
  if (auto origin = root.section("OriginGeopoint")) settings.origin = read_origin(std::move(*origin));
  settings.start_on_surface = root.boolean("StartOnSurface").value_or(true);
  settings.inverted_voxel_scale = root.boolean("InvertedVoxelScale").value_or(false);
  if (auto wind = root.section("Wind")) {
    settings.wind_ned_m_s = read_position(*wind);
    if (settings.wind_ned_m_s.norm() > 100.0) throw root.error("Wind", "more than 100 m/s");
    wind->require_all_keys_used();
  }
  if (auto assets = root.section("Assets")) settings.assets = read_assets(std::move(*assets));
  if (auto recording = root.section("Recording")) settings.recording = read_recording(std::move(*recording));
  if (auto segmentation = root.section("SegmentationSettings")) read_segmentation(std::move(*segmentation), settings);
  if (!root.boolean("InitialInstanceSegmentation").value_or(true)) settings.random_ids = false;  // Cosys-AirSim's
  settings.annotation_layers = read_annotation_layers(root);
  if (auto defaults = root.section("CameraDefaults")) {
    settings.camera_defaults = read_camera("", std::move(*defaults), {});
  }
  read_vehicles(root, settings);
  for (auto& [camera, entry] : root.named_sections("ExternalCameras"))
    settings.external_cameras.push_back(read_camera(camera, std::move(entry), settings.camera_defaults));
  root.ignore(kIgnoredKeys);
  root.ignore_with_warning({"PassiveEchoBeacons"}, "passive beacons are not simulated");
  root.ignore_with_warning({"MotionBlurAmount"}, "images are sharp; for blur, use `tileflight render`");
  root.ignore({"TimeOfDay"});
  if (root.is_map("TimeOfDay"))
    root.section("TimeOfDay")->ignore_with_warning({"Enabled"}, "the sun moves by the call simSetTimeOfDay");
  root.ignore_with_warning({"CaptureSettings"},
                           "it is a key of AirSim before 1.2; put it into CameraDefaults, as CaptureSettings there");
  root.ignore_with_warning({"DefaultVehicleConfig", "SimpleFlight", "PX4", "AdditionalCameras", "UsageScenario"},
                           "it is a key of AirSim before 1.2; describe vehicles and cameras in Vehicles");
  root.require_all_keys_used();
  settings.warnings = folded(settings.warnings);
  return settings;
}

}  // namespace tileflight::simulator
