#include "tileflight/sensors/image_formation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>
#include <string>

#include "tileflight/geometry/input_error.h"
#include "tileflight/sensors/random_numbers.h"

namespace tileflight::sensors {
namespace {

constexpr std::uint64_t kSensorNoiseStream = 16;

void require(bool holds, const char* option, const char* what) {
  if (!holds) throw InputError(std::string("image formation: ") + option, what);
}

/// Response G of the formation, 0..1 to 0..255, by table where it is a power.
class Response {
 public:
  explicit Response(double gamma) : gamma_(gamma) {
    for (std::size_t i = 0; gamma > 0.0 && i < power_.size(); ++i) {
      const double root = static_cast<double>(i) / kSteps;
      power_[i] = static_cast<float>(255.0 * std::pow(std::min(1.0, root * root), 1.0 / gamma));
    }
  }
  float value(float light) const {
    if (gamma_ <= 0.0) return SrgbTables::get().encode(light);
    const float position = std::sqrt(std::clamp(light, 0.0F, 1.0F)) * kSteps;
    const auto below = static_cast<std::size_t>(position);
    return power_[below] + (position - static_cast<float>(below)) * (power_[below + 1] - power_[below]);
  }

 private:
  static constexpr int kSteps = 4096;
  double gamma_;
  std::array<float, kSteps + 2> power_{};
};

/// Photon and read noise of one channel, in units of white. Photon counts are Poisson; their normal approximation has
/// the same mean and variance, and read noise blurs what differs at a few electrons.
float with_noise(float light, float normal, const ImageFormation& formation) {
  const auto white = static_cast<float>(formation.white_electrons);
  const auto read = static_cast<float>(formation.read_noise_electrons);
  const float electrons = std::max(0.0F, light) * white;
  return (electrons + std::sqrt(electrons + read * read) * normal) / white;
}

}  // namespace

void check(const ImageFormation& f) {
  require(f.exposure_time_s >= 0.0 && f.exposure_time_s < 10.0, "exposure time", "must lie between 0 and 10 s");
  require(f.exposure_samples >= 1 && f.exposure_samples <= 99 && f.exposure_samples % 2 == 1, "exposure samples",
          "must be an odd number from 1 to 99");
  require(std::abs(f.line_delay_s) < 0.1, "line delay", "must be below 0.1 s a row");
  require(f.vignetting >= 0.0 && f.vignetting < 1.0, "vignetting", "must lie between 0 and 1");
  require(f.exposure_drift >= 0.0 && f.exposure_drift < 1.0, "exposure drift", "must lie between 0 and 1");
  require(f.exposure_drift_period_s > 0.0, "exposure drift period", "must be positive");
  require(f.white_electrons >= 0.0, "white electrons", "must not be negative");
  require(f.read_noise_electrons >= 0.0, "read noise", "must not be negative");
  require(f.read_noise_electrons == 0.0 || f.white_electrons > 0.0, "read noise", "needs the electrons of white");
  require(f.gamma == 0.0 || (f.gamma >= 0.1 && f.gamma <= 10.0), "gamma",
          "must lie between 0.1 and 10, or be 0 for sRGB");
  double last_s = -std::numeric_limits<double>::infinity();
  for (const ExposureStep& step : f.exposure_steps) {
    require(step.gain > 0.0 && std::isfinite(step.gain), "exposure step", "its gain must be positive");
    require(step.time_s > last_s, "exposure step", "times must increase");
    last_s = step.time_s;
  }
}

bool is_ideal(const ImageFormation& f) {
  return f.exposure_time_s == 0.0 && f.line_delay_s == 0.0 && f.vignetting == 0.0 && f.exposure_drift == 0.0 &&
         f.exposure_steps.empty() && f.white_electrons == 0.0 && f.gamma == 0.0;
}

double exposure_gain(const ImageFormation& formation, double time_s) {
  const double phase = 2.0 * std::numbers::pi * time_s / formation.exposure_drift_period_s;
  double gain = 1.0 + formation.exposure_drift * std::sin(phase);
  double step_gain = 1.0;
  for (const ExposureStep& step : formation.exposure_steps) {
    if (time_s >= step.time_s) step_gain = step.gain;
  }
  return gain * step_gain;
}

ShutterPoses shutter_poses(const ImageFormation& formation, const PoseFunction& pose_at, double time_s, int height) {
  const double open_s = formation.exposure_time_s * exposure_gain(formation, time_s);
  ShutterPoses poses;
  poses.times = open_s > 0.0 ? formation.exposure_samples : 1;
  poses.rows = formation.line_delay_s != 0.0 ? height : 1;
  poses.T_local_camera.reserve(static_cast<std::size_t>(poses.times) * static_cast<std::size_t>(poses.rows));
  for (int k = 0; k < poses.times; ++k) {
    const double moment_s = open_s * ((k + 0.5) / poses.times - 0.5);
    for (int y = 0; y < poses.rows; ++y) {
      const double row_s = poses.rows == 1 ? 0.0 : (y - 0.5 * (height - 1)) * formation.line_delay_s;
      poses.T_local_camera.push_back(pose_at(time_s + moment_s + row_s));
    }
  }
  return poses;
}

imaging::FloatImage vignette_of(const ImageFormation& formation, int width, int height) {
  if (formation.vignetting == 0.0) return {};
  imaging::FloatImage vignette(width, height);
  const double cx = 0.5 * (width - 1);
  const double cy = 0.5 * (height - 1);
  const double corner_squared = std::max(1e-12, cx * cx + cy * cy);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double squared = ((x - cx) * (x - cx) + (y - cy) * (y - cy)) / corner_squared;
      vignette(x, y) = static_cast<float>(1.0 - formation.vignetting * squared);
    }
  }
  return vignette;
}

imaging::RgbImage develop(const LightImage& light, const imaging::FloatImage& vignette, const ImageFormation& formation,
                          double gain, std::uint64_t frame) {
  assert(vignette.empty() || vignette.pixels.size() == light.pixels.size());
  imaging::RgbImage image(light.width, light.height);
  const Response response(formation.gamma);
  const std::uint64_t key = stream_key(stream_key(formation.seed, kSensorNoiseStream), frame);
  const bool noisy = formation.white_electrons > 0.0;
  tbb::parallel_for(0, light.height, [&](int y) {
    for (int x = 0; x < light.width; ++x) {
      const float falloff = vignette.empty() ? 1.0F : vignette(x, y);
      const float factor = falloff * static_cast<float>(gain);
      const auto index =
          static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(light.width) + static_cast<std::uint64_t>(x);
      const std::array<float, 4> normal = noisy ? normal_numbers(key, index) : std::array<float, 4>{};
      for (std::size_t c = 0; c < 3; ++c) {
        const float exposed = factor * light(x, y)[c];
        const float signal = noisy ? with_noise(exposed, normal[c], formation) : exposed;
        image(x, y)[c] = static_cast<std::uint8_t>(response.value(signal) + 0.5F);
      }
    }
  });
  return image;
}

imaging::PhotometricCalibration photometric_calibration(const ImageFormation& formation, int width, int height) {
  imaging::PhotometricCalibration calibration;
  for (std::size_t i = 0; i < calibration.inverse_response.size(); ++i) {
    const auto value = static_cast<double>(i);
    const double light = formation.gamma > 0.0 ? std::pow(value / 255.0, formation.gamma) : srgb_decode(value);
    calibration.inverse_response[i] = static_cast<float>(255.0 * light);
  }
  calibration.vignette = vignette_of(formation, width, height);
  return calibration;
}

}  // namespace tileflight::sensors
