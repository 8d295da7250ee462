#include "tileflight/live/simulator/sensor_settings.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "tileflight/core/base/strict_section.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/settings.h"

namespace tileflight::simulator {
namespace {

using base::StrictSection;
using geometry::SE3;
using geometry::Vec3;

constexpr double kMaxNumber = 1e9;

SensorTiming read_timing(StrictSection& s, const SensorTiming& fallback) {
  return {s.clamped_number("UpdateLatency", fallback.latency_s, 0.0, 10.0),
          s.clamped_number("UpdateFrequency", fallback.frequency_hz, 1e-3, 1e5),
          s.clamped_number("StartupDelay", fallback.startup_delay_s, 0.0, 1e4)};
}

BarometerSettings read_barometer(StrictSection& s) {
  BarometerSettings b;
  b.timing = read_timing(s, b.timing);
  b.pressure_factor_sigma = s.clamped_number("PressureFactorSigma", b.pressure_factor_sigma, 0.0, 0.1);
  b.pressure_factor_tau_s = s.clamped_number("PressureFactorTau", b.pressure_factor_tau_s, 1e-3, kMaxNumber);
  b.noise_sigma_pa = s.clamped_number("UncorrelatedNoiseSigma", b.noise_sigma_pa, 0.0, 1e5);
  b.qnh_hpa = s.clamped_number("QNH", b.qnh_hpa, 500.0, 1500.0);
  return b;
}

ImuSettings read_imu(StrictSection& s) {
  ImuSettings i;
  i.angular_random_walk_deg_sqrt_h = s.clamped_number("AngularRandomWalk", i.angular_random_walk_deg_sqrt_h, 0.0, 1e4);
  i.gyro_bias_stability_deg_h = s.clamped_number("GyroBiasStability", i.gyro_bias_stability_deg_h, 0.0, 1e6);
  i.gyro_bias_tau_s = s.clamped_number("GyroBiasStabilityTau", i.gyro_bias_tau_s, 1e-3, kMaxNumber);
  i.velocity_random_walk_m_s_sqrt_h =
      s.clamped_number("VelocityRandomWalk", i.velocity_random_walk_m_s_sqrt_h, 0.0, 1e4);
  i.accel_bias_stability_ug = s.clamped_number("AccelBiasStability", i.accel_bias_stability_ug, 0.0, 1e6);
  i.accel_bias_tau_s = s.clamped_number("AccelBiasStabilityTau", i.accel_bias_tau_s, 1e-3, kMaxNumber);
  if (!s.boolean("GenerateNoise").value_or(true))
    s.warn("GenerateNoise",
           "has no effect here: for no noise, set AngularRandomWalk, GyroBiasStability, "
           "VelocityRandomWalk and AccelBiasStability to 0");
  return i;
}

GpsSettings read_gps(StrictSection& s) {
  GpsSettings g;
  g.timing = read_timing(s, g.timing);
  g.eph_tau_s = s.clamped_number("EPH_TimeConstant", s.clamped_number("EphTimeConstant", g.eph_tau_s, 1e-3, kMaxNumber),
                                 1e-3, kMaxNumber);
  g.epv_tau_s = s.clamped_number("EPV_TimeConstant", s.clamped_number("EpvTimeConstant", g.epv_tau_s, 1e-3, kMaxNumber),
                                 1e-3, kMaxNumber);
  g.eph_initial = s.clamped_number("EphInitial", g.eph_initial, 0.0, kMaxNumber);
  g.epv_initial = s.clamped_number("EpvInitial", g.epv_initial, 0.0, kMaxNumber);
  g.eph_final = s.clamped_number("EphFinal", g.eph_final, 0.0, kMaxNumber);
  g.epv_final = s.clamped_number("EpvFinal", g.epv_final, 0.0, kMaxNumber);
  g.eph_min_3d = s.clamped_number("EphMin3d", g.eph_min_3d, 0.0, kMaxNumber);
  g.eph_min_2d = s.clamped_number("EphMin2d", g.eph_min_2d, 0.0, kMaxNumber);
  return g;
}

MagnetometerSettings read_magnetometer(StrictSection& s) {
  MagnetometerSettings m;
  m.timing = read_timing(s, m.timing);
  m.noise_sigma_gauss = s.clamped_number("NoiseSigma", m.noise_sigma_gauss, 0.0, 100.0);
  m.scale_factor = s.clamped_number("ScaleFactor", m.scale_factor, -100.0, 100.0);
  m.bias_gauss = s.clamped_number("NoiseBias", m.bias_gauss, -100.0, 100.0);
  return m;
}

/// AirSim places sensors of vehicles that do not fly one metre above them.
Vec3 default_place(bool flies) { return {0.0, 0.0, flies ? 0.0 : -1.0}; }

DistanceSensorSettings read_distance(StrictSection& s, bool flies) {
  DistanceSensorSettings d;
  d.min_m = s.clamped_number("MinDistance", d.min_m, 0.0, 1e5);
  d.max_m = s.number("MaxDistance", d.max_m, d.min_m, 1e5);
  d.noise_sigma_m = s.clamped_number("NoiseSigma", d.noise_sigma_m, 0.0, 1e3);
  d.T_body_sensor = SE3(read_orientation(s), read_position(s, default_place(flies)));
  s.ignore({"DrawDebugPoints", "ExternalController", "DrawSensor", "ExternalLocal"});
  s.ignore_with_warning({"External"}, "a distance sensor is on its vehicle");
  return d;
}

LidarSettings default_lidar(bool flies) {
  LidarSettings l;
  if (!flies) {
    l.upper_deg = 10.0;
    l.lower_deg = -10.0;
  }
  return l;
}

/// Cosys-AirSim's defaults of its lidar on the graphics card.
LidarSettings default_gpu_lidar() {
  LidarSettings l;
  l.channels = 64;
  l.range_m = 50.0;
  l.points_per_second = 64.0 * 2048.0 * l.rotations_per_second;
  l.horizontal_to_deg = 360.0;
  l.in_sensor_frame = true;
  return l;
}

/// `l`: the defaults of its kind. Cosys-AirSim counts the columns of a revolution (MeasurementsPerCycle), AirSim the
/// points of a second.
LidarSettings read_lidar(StrictSection& s, bool flies, LidarSettings l) {
  l.channels = s.clamped_integer("NumberOfChannels", l.channels, 1, 1024);
  l.range_m = s.clamped_number("Range", l.range_m, 0.01, 1e5);
  l.rotations_per_second = s.clamped_number("RotationsPerSecond", l.rotations_per_second, 0.01, 1000.0);
  if (s.number("RotationsPerSecond").value_or(1.0) <= 0.0) throw s.error("RotationsPerSecond", "must be more than 0");
  l.points_per_second = s.clamped_number("PointsPerSecond", l.points_per_second, 1.0, 1e8);
  if (s.has("MeasurementsPerCycle"))
    l.points_per_second =
        s.clamped_integer("MeasurementsPerCycle", 512, 1, 100'000) * l.rotations_per_second * l.channels;
  l.horizontal_from_deg = s.clamped_number("HorizontalFOVStart", l.horizontal_from_deg, -360.0, 360.0);
  l.horizontal_to_deg = s.clamped_number("HorizontalFOVEnd", l.horizontal_to_deg, -360.0, 360.0);
  l.upper_deg = s.clamped_number("VerticalFOVUpper", l.upper_deg, -360.0, 360.0);
  l.lower_deg = s.clamped_number("VerticalFOVLower", l.lower_deg, -360.0, 360.0);
  if (const auto frame = s.choice_in_any_case("DataFrame", {"VehicleInertialFrame", "SensorLocalFrame", ""});
      frame && !frame->empty())
    l.in_sensor_frame = *frame == "SensorLocalFrame";
  l.T_body_sensor = SE3(read_orientation(s), read_position(s, default_place(flies)));
  constexpr double kMaxPointsPerRevolution = 4e6;
  if (l.points_per_second > kMaxPointsPerRevolution * l.rotations_per_second) {
    l.points_per_second = kMaxPointsPerRevolution * l.rotations_per_second;
    s.warn("PointsPerSecond", "is more than four million points per revolution; taken as four million");
  }
  s.ignore({"DrawDebugPoints", "ExternalController", "DrawSensor", "DrawMode", "Resolution", "GroundTruth",
            "InstanceSegmentation", "GenerateIntensity", "GenerateGroundtruth", "UpdateFrequency", "LimitPoints",
            "ExternalLocal", "MinNoiseStandardDeviation", "NoiseDistanceScale"});
  s.ignore_with_warning({"GenerateNoise"}, "readings of a lidar have no noise; add it to them");
  s.ignore_with_warning({"IgnoreMarked"}, "a lidar sees every object");
  s.ignore_with_warning({"External"}, "a lidar is on its vehicle");
  s.ignore_with_warning({"Annotation"}, "the colours are those of the segmentation");
  s.ignore_with_warning(
      {"MaterialListFile", "RangeMaxLambertianPercentage", "RainMaxIntensity", "RainConstantA", "RainConstantB",
       "rangeMaxLambertianPercentage", "rainMaxIntensity", "rainConstantA", "rainConstantB"},
      "the intensity is albedo times cosine, without rain and materials");
  return l;
}

EchoSettings read_echo(StrictSection& s, bool flies) {
  EchoSettings e;
  e.traces = s.clamped_integer("NumberOfTraces", e.traces, -100'000, 1'000'000);
  e.azimuth_from_deg = s.clamped_number("SensorLowerAzimuthLimit", e.azimuth_from_deg, -180.0, 180.0);
  e.azimuth_to_deg = s.number("SensorUpperAzimuthLimit", e.azimuth_to_deg, e.azimuth_from_deg, 180.0);
  e.elevation_from_deg = s.clamped_number("SensorLowerElevationLimit", e.elevation_from_deg, -90.0, 90.0);
  e.elevation_to_deg = s.number("SensorUpperElevationLimit", e.elevation_to_deg, e.elevation_from_deg, 90.0);
  e.opening_angle_deg = s.clamped_number("ReflectionOpeningAngle", e.opening_angle_deg, 0.0, 180.0);
  e.attenuation_db_m = s.clamped_number("AttenuationPerDistance", e.attenuation_db_m, 0.0, 1e3);
  e.attenuation_db_reflection = s.clamped_number("AttenuationPerReflection", e.attenuation_db_reflection, 0.0, 1e3);
  e.attenuation_limit_db = s.clamped_number("AttenuationLimit", e.attenuation_limit_db, -1e4, 0.0);
  e.max_distance_m = s.clamped_number("DistanceLimit", e.max_distance_m, 0.01, 1e4);
  e.max_reflections = s.clamped_integer("ReflectionLimit", e.max_reflections, 1, 100);
  e.max_reflection_distance_m = s.clamped_number("ReflectionDistanceLimit", e.max_reflection_distance_m, 0.0, 1e4);
  e.T_body_sensor = SE3(read_orientation(s), read_position(s, default_place(flies)));
  s.ignore_with_warning({"SensePassive"}, "passive beacons are not simulated");
  s.ignore_with_warning({"PauseAfterMeasurement"}, "time goes on; stop it with simPause");
  s.ignore_with_warning({"IgnoreMarked"}, "an echo sensor meets every object");
  s.ignore_with_warning({"External"}, "an echo sensor is on its vehicle");
  s.ignore({"PassiveRadius", "SenseActive", "MeasurementFrequency", "SensorDiameter", "RunParallel", "runParallel",
            "ExternalLocal", "DrawReflectedPoints", "DrawReflectedLines", "DrawReflectedPaths", "DrawInitialPoints",
            "DrawExternalPoints", "DrawBounceLines", "DrawPassiveSources", "DrawPassiveLines", "DrawSensor"});
  return e;
}

/// nullopt: one of Cosys-AirSim's that is not simulated (its template, ultra-wide band, Wi-Fi).
std::optional<SensorKind> read_kind(int type, StrictSection& section, bool flies) {
  switch (type) {
    case 1:
      return read_barometer(section);
    case 2:
      return read_imu(section);
    case 3:
      return read_gps(section);
    case 4:
      return read_magnetometer(section);
    case 5:
      return read_distance(section, flies);
    case 6:
      return read_lidar(section, flies, default_lidar(flies));
    case 7:
      return read_echo(section, flies);
    case 8:
      return read_lidar(section, flies, default_gpu_lidar());
    case 9:
    case 10:
    case 11:
      section.ignore(section.keys());
      return std::nullopt;
    default:
      throw section.error("SensorType", "must be from 1 (barometer) to 8 (GPU lidar)");
  }
}

}  // namespace

std::vector<SensorSettings> read_sensors(StrictSection& parent, const std::string& key, bool flies,
                                         std::vector<SensorSettings> sensors, std::vector<std::string>& warnings) {
  for (auto& [name, section] : parent.named_sections(key)) {
    const auto known = std::ranges::find(sensors, name, &SensorSettings::name);
    const bool enabled = section.boolean("Enabled").value_or(false);
    const bool only_switches = !section.has("SensorType") && known != sensors.end();
    const int type = section.integer("SensorType", 0, 0, 100);
    const auto kind = only_switches ? std::nullopt : read_kind(type, section, flies);
    if (!only_switches && !kind)
      warnings.emplace_back(
          section.error("SensorType", std::to_string(type) + " is not simulated: the sensor is left out").what());
    if (kind) {
      SensorSettings sensor{name, *kind};
      if (known != sensors.end()) {
        *known = std::move(sensor);
      } else if (enabled) {
        sensors.push_back(std::move(sensor));
      }
    }
    section.require_all_keys_used();
    if (!enabled)
      std::erase_if(sensors, [&, name = name](const SensorSettings& sensor) { return sensor.name == name; });
  }
  return sensors;
}

std::vector<SensorSettings> default_sensors(bool flies) {
  if (!flies) return {};
  return {{"imu", ImuSettings{}},
          {"magnetometer", MagnetometerSettings{}},
          {"gps", GpsSettings{}},
          {"barometer", BarometerSettings{}}};
}

}  // namespace tileflight::simulator
