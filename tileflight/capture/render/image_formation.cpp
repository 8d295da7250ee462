#include "tileflight/capture/render/image_formation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/core/base/simd.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::render {

namespace {

/// The section's presence enables it.
AutoExposure read_auto_exposure(base::StrictSection& section) {
  constexpr double kMiddleGrey = 0.18;
  AutoExposure a;
  a.target = section.positive_number("target").value_or(kMiddleGrey);
  a.time_constant_s = section.number("time_constant").value_or(a.time_constant_s);
  a.min_gain = section.positive_number("min_gain").value_or(a.min_gain);
  a.max_gain = section.positive_number("max_gain").value_or(a.max_gain);
  section.require_all_keys_used();
  return a;
}

/// `light: {model: baked | sun-and-sky, time, turbidity, ground_albedo, exposure, white_balance}`.
std::optional<DaylightOptions> read_light(base::StrictSection& section) {
  const bool is_baked = section.choice("model", {"baked", "sun-and-sky"}).value_or("sun-and-sky") == "baked";
  DaylightOptions light;
  if (const auto time = section.text("time")) {
    light.utc_s = base::parse_iso_time_s(*time);
    if (!light.utc_s) throw section.error("time", "must be a valid date and time such as 2024-03-20T17:00:00Z");
  }
  light.turbidity = section.number("turbidity").value_or(light.turbidity);
  light.ground_albedo = section.number("ground_albedo").value_or(light.ground_albedo);
  light.exposure_stops = section.number("exposure").value_or(light.exposure_stops);
  if (section.choice("white_balance", {"ground", "daylight"}).value_or("ground") == "daylight")
    light.white_balance = WhiteBalance::kDaylight;
  section.require_all_keys_used();
  return is_baked ? std::nullopt : std::optional(light);
}

/// `key: [red, green, blue]`, 0 to 255.
std::optional<imaging::Rgb8> read_color(base::StrictSection& section, const std::string& key) {
  const auto values = section.numbers(key, 3, 3);
  if (!values) return std::nullopt;
  imaging::Rgb8 color;
  for (std::size_t c = 0; c < 3; ++c) {
    if (!((*values)[c] >= 0.0 && (*values)[c] <= 255.0))
      throw section.error(key, "must be three numbers from 0 to 255");
    color[c] = static_cast<std::uint8_t>(std::lround((*values)[c]));
  }
  return color;
}

}  // namespace

ImageFormation read_image_formation(base::StrictSection& section, const ImageFormation& defaults) {
  ImageFormation f = defaults;
  const auto number = [&section](const std::string& key, double& value) {
    value = section.number(key).value_or(value);
  };
  if (auto light = section.section("light")) {
    f.light = read_light(*light);
    f.light_is_chosen = true;
  }
  number("haze_visibility", f.haze_visibility_m);
  if (const auto color = read_color(section, "haze_color")) f.haze_color = color;
  number("chromatic_red", f.chromatic_red);
  number("chromatic_blue", f.chromatic_blue);
  number("exposure_time", f.exposure_time_s);
  f.exposure_samples = section.integer("exposure_samples").value_or(f.exposure_samples);
  number("line_delay", f.line_delay_s);
  number("vignetting", f.vignetting);
  if (auto automatic = section.section("auto_exposure")) f.auto_exposure = read_auto_exposure(*automatic);
  number("exposure_drift", f.exposure_drift);
  number("exposure_drift_period", f.exposure_drift_period_s);
  if (section.has("exposure_steps")) f.exposure_steps.clear();
  for (base::StrictSection& step : section.sections("exposure_steps")) {
    f.exposure_steps.push_back({step.number("time").value_or(0.0), step.number("gain").value_or(1.0)});
    step.require_all_keys_used();
  }
  number("white_electrons", f.white_electrons);
  number("read_noise_electrons", f.read_noise_electrons);
  number("gamma", f.gamma);
  number("sharpening", f.sharpening);
  number("sharpening_radius", f.sharpening_radius_px);
  section.require_all_keys_used();
  validate_image_formation(f);
  return f;
}

namespace {

constexpr std::uint64_t kSensorNoiseStream = 16;

using base::Float8;

/// Pixels that are developed together, and the numbers of their channels; a multiple of eight.
constexpr int kRunPixels = 128, kRunNumbers = 3 * kRunPixels;
using Run = std::array<float, kRunNumbers>;

/// Response G of the formation, 0..1 to 0..255, by a table over the square root of light, where both curves are nearly
/// straight.
class Response {
 public:
  explicit Response(double gamma) {
    for (std::size_t i = 0; i < values_.size(); ++i) {
      const double root = static_cast<double>(i) / kSteps, light = std::min(1.0, root * root);
      values_[i] = static_cast<float>(gamma > 0.0 ? 255.0 * std::pow(light, 1.0 / gamma) : srgb_encode(light));
    }
  }
  /// Replaces light by values, `count` rounded up to eight.
  TILEFLIGHT_WIDE_VECTORS void apply(int count, float* numbers) const {
    for (int i = 0; i < count; i += base::kLanes) {
      Float8 light;
      base::load_float8(numbers + i, light);
      light = light > 0.0F ? light : Float8{};
      light = light < 1.0F ? light : Float8{} + 1.0F;
      Float8 position;
      base::square_root(light, position);
      position *= static_cast<float>(kSteps);
      const auto below = __builtin_convertvector(position, base::Int8);
      const Float8 share = position - __builtin_convertvector(below, Float8);
      Float8 from, to;
      for (int lane = 0; lane < base::kLanes; ++lane) {
        const float* piece = &values_[static_cast<std::size_t>(below[lane])];
        from[lane] = piece[0];
        to[lane] = piece[1];
      }
      base::store_float8(from + share * (to - from), numbers + i);
    }
  }

 private:
  static constexpr int kSteps = 4096;
  std::array<float, kSteps + 2> values_{};
};

/// Values 0..255 before rounding.
using ValueImage = imaging::Image<std::array<float, 3>>;

float luma(const std::array<float, 3>& value) { return 0.299F * value[0] + 0.587F * value[1] + 0.114F * value[2]; }

/// Weights of the pixels at distance 0, 1, 2, ..., truncated; both sides together sum to 1.
std::vector<float> gaussian_weights(double sigma_px) {
  const int reach = std::max(1, static_cast<int>(std::ceil(3.0 * sigma_px)));
  std::vector<float> weights;
  double sum = 0.0;
  for (int i = 0; i <= reach; ++i) {
    const double weight = std::exp(-0.5 * i * i / (sigma_px * sigma_px));
    weights.push_back(static_cast<float>(weight));
    sum += i == 0 ? weight : 2.0 * weight;
  }
  for (float& weight : weights) weight /= static_cast<float>(sum);
  return weights;
}

/// A Gaussian blur along one direction; border pixels are repeated.
imaging::FloatImage blur_along(const imaging::FloatImage& image, const std::vector<float>& weights, int step_x,
                               int step_y) {
  imaging::FloatImage out(image.width, image.height);
  const auto at = [&](int x, int y) {
    return image(std::clamp(x, 0, image.width - 1), std::clamp(y, 0, image.height - 1));
  };
  tbb::parallel_for(0, image.height, [&](int y) {
    for (int x = 0; x < image.width; ++x) {
      float sum = weights[0] * image(x, y);
      for (int i = 1; i < static_cast<int>(weights.size()); ++i) {
        sum += weights[static_cast<std::size_t>(i)] *
               (at(x - i * step_x, y - i * step_y) + at(x + i * step_x, y + i * step_y));
      }
      out(x, y) = sum;
    }
  });
  return out;
}

/// Unsharp mask: the difference between the luma and its Gaussian blur is added to all three channels.
void sharpen(ValueImage& values, double amount, double radius_px) {
  imaging::FloatImage lumas(values.width, values.height);
  std::transform(values.pixels.begin(), values.pixels.end(), lumas.pixels.begin(), luma);
  const std::vector<float> weights = gaussian_weights(radius_px);
  const imaging::FloatImage soft = blur_along(blur_along(lumas, weights, 1, 0), weights, 0, 1);
  for (std::size_t i = 0; i < values.pixels.size(); ++i) {
    const float detail = static_cast<float>(amount) * (lumas.pixels[i] - soft.pixels[i]);
    for (float& value : values.pixels[i]) value += detail;
  }
}

/// Values as bytes, `count` rounded up to eight.
TILEFLIGHT_WIDE_VECTORS void round_values(int count, const float* values, std::uint8_t* bytes) {
  for (int i = 0; i < count; i += base::kLanes) {
    Float8 value;
    base::load_float8(values + i, value);
    value = value < 0.0F ? Float8{} : value;
    value = value > 255.0F ? Float8{} + 255.0F : value;
    const auto rounded = __builtin_convertvector(value + 0.5F, base::Int8);
    for (int lane = 0; lane < base::kLanes; ++lane) bytes[i + lane] = static_cast<std::uint8_t>(rounded[lane]);
  }
}

/// Calls `work(x, y, pixels)` for runs of at most kRunPixels pixels of a row, on all cores.
template <class Work>
void for_each_run(int width, int height, const Work& work) {
  tbb::parallel_for(0, height, [&](int y) {
    for (int x = 0; x < width; x += kRunPixels) work(x, y, std::min(kRunPixels, width - x));
  });
}

void write_pixels(int pixels, const float* values, imaging::Rgb8* to) {
  std::array<std::uint8_t, kRunNumbers> bytes;
  round_values(3 * pixels, values, bytes.data());
  std::memcpy(to, bytes.data(), 3 * static_cast<std::size_t>(pixels));
}

void check_auto_exposure(const AutoExposure& a) {
  base::require(a.target >= 0.0 && a.target <= 1.0, "image formation: auto exposure's target",
                "must lie between 0 and 1");
  base::require(a.time_constant_s >= 0.0 && a.time_constant_s < 1000.0,
                "image formation: auto exposure's time constant", "must lie between 0 and 1000 s");
  base::require(a.min_gain > 0.0 && a.min_gain <= a.max_gain && a.max_gain <= 1e6,
                "image formation: auto exposure's gains", "must be positive, the smallest not above the largest");
}

/// Normal numbers of the channels of `pixels` pixels, rounded up to eight. `first`: the first pixel's number.
TILEFLIGHT_WIDE_VECTORS void fill_normals(std::uint64_t key, std::uint64_t first, int pixels, float* normals) {
  for (int i = 0; i < pixels; i += base::kLanes) {
    std::array<Float8, 4> of_pixels;
    base::normal_variates8(key, first + static_cast<std::uint64_t>(i), of_pixels);
    for (int lane = 0; lane < base::kLanes; ++lane) {
      for (std::size_t c = 0; c < 3; ++c) *normals++ = of_pixels[c][lane];
    }
  }
}

/// Adds photon and read noise, light in units of white, `count` rounded up to eight. Photon counts are Poisson; their
/// normal approximation has the same mean and variance, and read noise hides the difference at a few electrons.
TILEFLIGHT_WIDE_VECTORS void add_noise(int count, const float* normals, float white, float read, float* numbers) {
  for (int i = 0; i < count; i += base::kLanes) {
    Float8 light, normal, spread;
    base::load_float8(numbers + i, light);
    base::load_float8(normals + i, normal);
    const Float8 electrons = (light > 0.0F ? light : Float8{}) * white;
    base::square_root(electrons + read * read, spread);
    base::store_float8((electrons + spread * normal) / white, numbers + i);
  }
}

/// From light to values.
class Sensor {
 public:
  Sensor(const ImageFormation& formation, double gain, std::uint64_t frame)
      : response_(formation.gamma),
        gain_(static_cast<float>(gain)),
        white_(static_cast<float>(formation.white_electrons)),
        read_(static_cast<float>(formation.read_noise_electrons)),
        key_(base::stream_key(base::stream_key(formation.seed, kSensorNoiseStream), frame)) {}

  /// `vignette`: of the pixels, or null; `first`: the first pixel's number, which selects its noise.
  void expose(std::span<const LinearRgb> light, const float* vignette, std::uint64_t first, Run& run) const {
    const int count = 3 * static_cast<int>(light.size());
    for (std::size_t i = 0; i < light.size(); ++i) {
      const float factor = (vignette != nullptr ? vignette[i] : 1.0F) * gain_;
      for (std::size_t c = 0; c < 3; ++c) run[3 * i + c] = factor * light[i][c];
    }
    if (white_ > 0.0F) {
      Run normals;
      fill_normals(key_, first, static_cast<int>(light.size()), normals.data());
      add_noise(count, normals.data(), white_, read_, run.data());
    }
    response_.apply(count, run.data());
  }

 private:
  Response response_;
  float gain_, white_, read_;
  std::uint64_t key_;
};

std::size_t pixel_number(const imaging::RgbImage& image, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x);
}

/// Returns the vignetting factors of the pixels from this number on; null without vignetting.
const float* vignette_at(const imaging::FloatImage& vignette, std::size_t first) {
  return vignette.empty() ? nullptr : &vignette.pixels[first];
}

}  // namespace

void validate_image_formation(const ImageFormation& f) {
  if (f.light) validate_daylight_options(*f.light);
  base::require(f.haze_visibility_m >= 0.0, "image formation: haze visibility", "must not be negative");
  base::require(std::abs(f.chromatic_red) <= 0.05 && std::abs(f.chromatic_blue) <= 0.05,
                "image formation: chromatic aberration", "must lie between -0.05 and 0.05");
  base::require(f.sharpening >= 0.0 && f.sharpening <= 10.0, "image formation: sharpening",
                "must lie between 0 and 10");
  base::require(f.sharpening_radius_px >= 0.1 && f.sharpening_radius_px <= 20.0, "image formation: sharpening radius",
                "must lie between 0.1 and 20 pixels");
  check_auto_exposure(f.auto_exposure);
  base::require(f.exposure_time_s >= 0.0 && f.exposure_time_s < 10.0, "image formation: exposure time",
                "must lie between 0 and 10 s");
  base::require(f.exposure_samples >= 1 && f.exposure_samples <= 99 && f.exposure_samples % 2 == 1,
                "image formation: exposure samples", "must be an odd number from 1 to 99");
  base::require(std::abs(f.line_delay_s) < 0.1, "image formation: line delay", "must be below 0.1 s a row");
  base::require(f.vignetting >= 0.0 && f.vignetting < 1.0, "image formation: vignetting", "must lie between 0 and 1");
  base::require(f.exposure_drift >= 0.0 && f.exposure_drift < 1.0, "image formation: exposure drift",
                "must lie between 0 and 1");
  base::require(f.exposure_drift_period_s > 0.0, "image formation: exposure drift period", "must be positive");
  base::require(f.white_electrons >= 0.0, "image formation: white electrons", "must not be negative");
  base::require(f.read_noise_electrons >= 0.0, "image formation: read noise", "must not be negative");
  base::require(f.read_noise_electrons == 0.0 || f.white_electrons > 0.0, "image formation: read noise",
                "needs white electrons above 0");
  base::require(f.gamma == 0.0 || (f.gamma >= 0.1 && f.gamma <= 10.0), "image formation: gamma",
                "must lie between 0.1 and 10, or be 0 for sRGB");
  double last_s = -std::numeric_limits<double>::infinity();
  for (const ExposureStep& step : f.exposure_steps) {
    base::require(step.gain > 0.0 && std::isfinite(step.gain), "image formation: exposure step",
                  "its gain must be positive");
    base::require(step.time_s > last_s, "image formation: exposure step", "times must increase");
    last_s = step.time_s;
  }
}

bool is_ideal(const ImageFormation& f) {
  return f.exposure_time_s == 0.0 && f.line_delay_s == 0.0 && f.vignetting == 0.0 && f.exposure_drift == 0.0 &&
         f.exposure_steps.empty() && f.white_electrons == 0.0 && f.gamma == 0.0 && f.chromatic_red == 0.0 &&
         f.chromatic_blue == 0.0 && f.auto_exposure.target == 0.0 && f.sharpening == 0.0 &&
         f.haze_visibility_m == 0.0 && !f.light;
}

void light_by_relief(bool lacks_textures, ImageFormation& formation) {
  if (lacks_textures && !formation.light && !formation.light_is_chosen) formation.light = relief_light();
}

double haze_per_m(const ImageFormation& formation) {
  constexpr double kTwoPercent = 3.912;  // -ln 0.02
  return formation.haze_visibility_m > 0.0 ? kTwoPercent / formation.haze_visibility_m : 0.0;
}

imaging::Camera scale_focal_length(const imaging::Camera& camera, double larger) {
  const auto scaled = [&](auto lens) -> imaging::CameraModel {
    lens.fx *= 1.0 + larger;
    lens.fy *= 1.0 + larger;
    return lens;
  };
  return {std::visit(scaled, camera.model()), camera.width(), camera.height()};
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

double max_exposure_gain(const ImageFormation& formation) {
  double step = 1.0;
  for (const ExposureStep& s : formation.exposure_steps) step = std::max(step, s.gain);
  const AutoExposure& automatic = formation.auto_exposure;
  return (1.0 + formation.exposure_drift) * step * (automatic.target > 0.0 ? automatic.max_gain : 1.0);
}

ShutterPoses shutter_poses(const ImageFormation& formation, const PoseFunction& pose_at, double time_s, int height,
                           double gain) {
  const double open_s = formation.exposure_time_s * gain;
  ShutterPoses poses;
  poses.moments = open_s > 0.0 ? formation.exposure_samples : 1;
  poses.rows = formation.line_delay_s != 0.0 ? height : 1;
  poses.T_local_camera.reserve(static_cast<std::size_t>(poses.moments) * static_cast<std::size_t>(poses.rows));
  for (int k = 0; k < poses.moments; ++k) {
    const double moment_s = open_s * ((k + 0.5) / poses.moments - 0.5);
    for (int y = 0; y < poses.rows; ++y) {
      const double row_s = poses.rows == 1 ? 0.0 : (y - 0.5 * (height - 1)) * formation.line_delay_s;
      poses.times_s.push_back(time_s + moment_s + row_s);
      poses.T_local_camera.push_back(pose_at(poses.times_s.back()));
    }
  }
  return poses;
}

imaging::FloatImage make_vignette(const ImageFormation& formation, int width, int height) {
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

Developer make_developer(const imaging::FloatImage& vignette, const ImageFormation& formation, double gain,
                         std::uint64_t frame) {
  assert(formation.sharpening <= 0.0);
  return [&vignette, sensor = std::make_shared<const Sensor>(formation, gain, frame)](
             int x, int y, std::span<const LinearRgb> light, imaging::RgbImage& image) {
    const std::size_t first = pixel_number(image, x, y);
    for (std::size_t i = 0; i < light.size(); i += kRunPixels) {
      const std::span<const LinearRgb> part = light.subspan(i, std::min<std::size_t>(kRunPixels, light.size() - i));
      Run run{};
      sensor->expose(part, vignette_at(vignette, first + i), first + i, run);
      write_pixels(static_cast<int>(part.size()), run.data(), &image.pixels[first + i]);
    }
  };
}

imaging::RgbImage develop(const LinearImage& light, const imaging::FloatImage& vignette,
                          const ImageFormation& formation, double gain, std::uint64_t frame) {
  assert(vignette.empty() || vignette.pixels.size() == light.pixels.size());
  imaging::RgbImage image(light.width, light.height);
  if (formation.sharpening <= 0.0) {
    const Developer develop_row = make_developer(vignette, formation, gain, frame);
    tbb::parallel_for(0, light.height, [&](int y) {
      develop_row(0, y, {light.row(y), static_cast<std::size_t>(light.width)}, image);
    });
    return image;
  }
  const Sensor sensor(formation, gain, frame);
  ValueImage values(light.width, light.height);
  for_each_run(light.width, light.height, [&](int x, int y, int pixels) {
    const std::size_t first = pixel_number(image, x, y);
    Run run{};
    sensor.expose(std::span(light.pixels).subspan(first, static_cast<std::size_t>(pixels)),
                  vignette_at(vignette, first), first, run);
    std::memcpy(values(x, y).data(), run.data(), 3 * sizeof(float) * static_cast<std::size_t>(pixels));
  });
  sharpen(values, formation.sharpening, formation.sharpening_radius_px);
  for_each_run(light.width, light.height, [&](int x, int y, int pixels) {
    Run run{};
    std::memcpy(run.data(), values(x, y).data(), 3 * sizeof(float) * static_cast<std::size_t>(pixels));
    write_pixels(pixels, run.data(), &image(x, y));
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
  calibration.vignette = make_vignette(formation, width, height);
  return calibration;
}

}  // namespace tileflight::render
