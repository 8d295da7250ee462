#include "tileflight/capture/render/auto_exposure.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>
#include <variant>

namespace tileflight::render {
namespace {

/// Logarithm of the gain that brings this light to the target, within the limits.
double log_target_gain(const AutoExposure& options, double mean_light) {
  constexpr double kDarkest = 1e-9;
  return std::clamp(std::log(options.target / std::max(kDarkest, mean_light)), std::log(options.min_gain),
                    std::log(options.max_gain));
}

double adaptation_fraction(const AutoExposure& options, double step_s) {
  return options.time_constant_s > 0.0 ? 1.0 - std::exp(-step_s / options.time_constant_s) : 1.0;
}

double linear_luminance(const LinearRgb& light) { return 0.2126 * light[0] + 0.7152 * light[1] + 0.0722 * light[2]; }

imaging::Image<std::uint8_t> valid_pixels(const imaging::Camera& camera) {
  imaging::Image<std::uint8_t> valid(camera.width(), camera.height());
  for (int y = 0; y < camera.height(); ++y) {
    for (int x = 0; x < camera.width(); ++x) valid(x, y) = camera.unproject(geometry::Vec2(x, y)).has_value() ? 1 : 0;
  }
  return valid;
}

RenderOptions cheaper(RenderOptions options) {
  options.depth = false;
  options.samples_per_pixel = 1;
  return options;
}

/// Summed row by row, so that the result does not depend on parallelism.
double mean_light(const LinearImage& light, const imaging::FloatImage& vignette,
                  const imaging::Image<std::uint8_t>& valid) {
  double sum = 0.0;
  std::int64_t count = 0;
  for (std::size_t i = 0; i < light.pixels.size(); ++i) {
    if (valid.pixels[i] == 0) continue;
    sum += linear_luminance(light.pixels[i]) * (vignette.empty() ? 1.0 : static_cast<double>(vignette.pixels[i]));
    ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

}  // namespace

std::vector<double> exposure_gains(const AutoExposure& options, std::span<const double> times_s,
                                   std::span<const double> mean_light, std::optional<AutoExposureState>& before) {
  assert(times_s.size() == mean_light.size());
  std::vector<double> gains;
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    const double wanted = log_target_gain(options, mean_light[i]);
    AutoExposureState now = before.value_or(AutoExposureState{times_s[i], wanted, wanted});
    now.log_gain += adaptation_fraction(options, times_s[i] - now.time_s) * (now.log_target_gain - now.log_gain);
    now.time_s = times_s[i];
    now.log_target_gain = wanted;
    gains.push_back(std::exp(now.log_gain));
    before = now;
  }
  return gains;
}

imaging::Camera metering_camera(const imaging::Camera& camera, int width) {
  width = std::min(width, camera.width());
  const double scale = static_cast<double>(width) / camera.width();
  const int height = std::max(1, static_cast<int>(std::lround(camera.height() * scale)));
  const double scale_y = static_cast<double>(height) / camera.height();
  const auto scaled = [&](auto lens) -> imaging::CameraModel {
    lens.fx *= scale;
    lens.fy *= scale_y;
    lens.cx = (lens.cx + 0.5) * scale - 0.5;
    lens.cy = (lens.cy + 0.5) * scale_y - 0.5;
    return lens;
  };
  return {std::visit(scaled, camera.model()), width, height};
}

std::vector<double> meter_light(const scene::Scene& scene, std::shared_ptr<const Appearance> appearance,
                                const imaging::Camera& camera, const RenderOptions& options,
                                const ImageFormation& formation, std::span<const geometry::StampedPose> frames) {
  const CameraRenderer renderer(scene, std::move(appearance), metering_camera(camera), cheaper(options));
  const imaging::FloatImage vignette = make_vignette(formation, renderer.camera().width(), renderer.camera().height());
  const imaging::Image<std::uint8_t> valid = valid_pixels(renderer.camera());
  std::vector<double> light(frames.size());
  tbb::parallel_for(std::size_t{0}, frames.size(), [&](std::size_t i) {
    light[i] = mean_light(renderer.render_light({1, 1, {frames[i].T_local_camera}}).light, vignette, valid);
  });
  return light;
}

}  // namespace tileflight::render
