#include "tileflight/odometry/mapper.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "tileflight/odometry/densify.h"
#include "tileflight/odometry/marginalization.h"
#include "tileflight/odometry/normal_equations.h"
#include "tileflight/odometry/pixel_selector.h"
#include "tileflight/odometry/tracer.h"

namespace tileflight::odometry {
namespace {

/// What is known of the lens beforehand, on the scale of the residuals' information. Neighbouring residuals share their
/// errors (of the lens model, of sampling, of the light), so that many say as much as one.
LensInformation lens_information(const WindowOptions& options, double residual_variance) {
  constexpr double kAlike = 25.0;
  const auto of = [&](double deviation) { return kAlike * residual_variance / (deviation * deviation); };
  return {of(options.focal_deviation), of(options.aspect_deviation), of(options.principal_point_deviation)};
}

}  // namespace

WindowResult Mapper::begin(std::vector<Keyframe> keyframes) {
  constexpr int kRounds = 3;
  constexpr int kIterations = 8;
  if (options_.window.refine_intrinsics) {
    estimate_lens(window_, lens_information(options_.window, residual_variance_));
  }
  for (Keyframe& keyframe : keyframes) odometry::add_keyframe(window_, std::move(keyframe));
  spacing_.pixels = 0.5;
  activate_points(window_, lens_.lenses[0], options_, spacing_);
  WindowResult result;
  for (int i = 0; i < kRounds; ++i) {
    result = optimize_window(window_, lens_.lenses[0], options_.window, kIterations);
    for (int slot = 0; slot < window_.size(); ++slot) {
      update_energy_threshold(window_, slot);
      relinearize(window_, slot);
    }
    relinearize_lens(window_);
  }
  follow_lens();
  remove_bad_residuals(window_);
  update_noise(result);
  for (int slot = 0; slot < window_.size(); ++slot)
    steps_.push_back(step_uncertainty(window_, slot, residual_variance_));
  return result;
}

Keyframe Mapper::make_keyframe(const KeyframeSource& source) {
  Keyframe keyframe;
  keyframe.id = next_id_++;
  keyframe.frame_index = source.frame_index;
  keyframe.time_s = source.time_s;
  keyframe.pyramid = source.pyramid;
  keyframe.T_camera_map_linear = source.T_camera_map;
  keyframe.light_linear = source.light;
  keyframe.light_prior = source.light_prior;
  keyframe.light_information = source.light_information;
  const PyramidLevel& level = source.pyramid->levels[0];
  const Lens lens_linear = lens_.lenses[0].moved(window_.lens.linear);
  for (const SelectedPixel& pixel :
       select_pixels(*source.pyramid, lens_.rays[0], options_.selection.points_per_keyframe, options_.selection,
                     selection_block_px_)) {
    auto patch = make_patch(level, lens_.lenses[0], Eigen::Vector2f(pixel.x, pixel.y), options_.window.gradient_weight);
    if (!patch) continue;
    ImmaturePoint point;
    point.patch = *patch;
    if (window_.lens.estimated) {
      const auto ray = lens_linear.unproject(geometry::Vec2(pixel.x, pixel.y));
      if (!ray) continue;
      point.patch.ray_linear = ray->cast<float>();
    }
    point.scale = pixel.scale;
    if (source.image != nullptr) point.color = (*source.image)(pixel.x, pixel.y);
    keyframe.immature.push_back(point);
  }
  return keyframe;
}

void Mapper::trace(const Pyramid& picture, const SE3& T_camera_map, const AffineLight& light) {
  for (Keyframe& keyframe : window_.keyframes) {
    const PairTransform pair =
        pair_transform(T_camera_map * keyframe.T_camera_map().inverse(), keyframe.light(), light);
    trace_points(lens_.lenses[0], picture.levels[0], pair, options_.tracing, options_.window.huber, keyframe.immature);
  }
}

WindowResult Mapper::add_keyframe(const KeyframeSource& source) {
  trace(*source.pyramid, source.T_camera_map, source.light);
  odometry::add_keyframe(window_, make_keyframe(source));
  mark_keyframes(window_, lens_.lenses[0], options_.window);
  observe_in_newest();
  activate_points(window_, lens_.lenses[0], options_, spacing_);
  const WindowResult result = optimize_window(window_, lens_.lenses[0], options_.window, options_.window.iterations);
  relinearize(window_, window_.size() - 1);
  pattern_.add(window_, window_.size() - 1, lens_.lenses[0]);
  follow_lens();
  remove_bad_residuals(window_);
  update_noise(result);
  steps_.push_back(step_uncertainty(window_, window_.size() - 1, residual_variance_));
  retire();
  return result;
}

void Mapper::observe_in_newest() {
  const int newest = window_.size() - 1;
  for (int h = 0; h < newest; ++h) {
    for (ActivePoint& point : window_.keyframes[h].points) {
      Observation observation;
      observation.target = newest;
      point.observations.push_back(observation);
    }
  }
}

/// Everything that is drawn from the lens, where the last optimisation moved it by more than nothing in any pixel.
void Mapper::follow_lens() {
  constexpr double kNothing_px = 0.01;
  const LensDelta delta = window_.lens.value();
  if (!window_.lens.estimated || (delta - followed_).cwiseAbs().maxCoeff() * lens_.lenses[0].focal_px() < kNothing_px) {
    return;
  }
  followed_ = delta;
  move_lens(lens_, delta);
  for (Keyframe& keyframe : window_.keyframes) {
    for (auto* points : {&keyframe.immature, &keyframe.out_of_view}) {
      tbb::parallel_for(std::size_t{0}, points->size(),
                        [&](std::size_t i) { set_ray(lens_.lenses[0], (*points)[i].patch); });
    }
  }
}

void Mapper::retire() {
  std::vector<LeftPoint> left;
  retire_points(window_, options_.window, left);
  for (const LeftPoint& point : left) {
    if (point.point.good_observations > 0) left_.push_back(window_point(point.point, point.host));
  }
  for (int slot = window_.size() - 1; slot >= 0; --slot) {
    const Keyframe& keyframe = window_.keyframes[slot];
    if (!keyframe.to_marginalize) continue;
    keep_further_points(slot);
    archived_.push_back({keyframe.id, keyframe.frame_index, keyframe.time_s, keyframe.T_camera_map().inverse()});
    remove_keyframe(window_, slot);
  }
}

MapPoint Mapper::window_point(const ActivePoint& point, int host) const {
  MapPoint out = map_point(point, window_.keyframes[host].id, residual_variance_);
  out.seen_by = keyframes_seeing(point, window_);
  return out;
}

void Mapper::keep_further_points(int host) {
  if (!options_.map.dense) return;
  for (const ActivePoint& point : further_points(window_, lens_.lenses[0], host, options_)) {
    const MapPoint out = window_point(point, host);
    if (is_clean(out, options_.map)) left_.push_back(out);
  }
}

void Mapper::update_noise(const WindowResult& result) {
  if (result.good_residuals > 0) residual_variance_ = std::max(0.25, result.rmse * result.rmse);
}

std::vector<ReferencePoint> Mapper::points_seen_by(int slot) const {
  std::vector<ReferencePoint> seen;
  const std::vector<Pair> pairs = make_pairs(window_);
  const Lens& lens = lens_.lenses[0];
  for (int h = 0; h < window_.size(); ++h) {
    for (const ActivePoint& point : window_.keyframes[h].points) {
      if (h == slot) {
        seen.push_back({point.patch.pixel, point.rho, std::sqrt(point.information)});
        continue;
      }
      const bool good = std::any_of(point.observations.begin(), point.observations.end(), [slot](const Observation& o) {
        return o.target == slot && o.state == ResidualState::kGood;
      });
      if (!good) continue;
      const PairTransform& T = pairs[h * window_.size() + slot].frame.current;
      const Eigen::Vector3f X = T.R * point.patch.ray + point.rho * T.t;
      Eigen::Vector2f pixel;
      if (!lens.project<float>(X, pixel)) continue;
      seen.push_back({pixel, point.rho / X.norm(), std::sqrt(point.information)});
    }
  }
  return seen;
}

std::vector<KeyframeRecord> Mapper::keyframes() const {
  std::vector<KeyframeRecord> all = archived_;
  for (const Keyframe& keyframe : window_.keyframes) {
    all.push_back({keyframe.id, keyframe.frame_index, keyframe.time_s, keyframe.T_camera_map().inverse()});
  }
  std::sort(all.begin(), all.end(), [](const KeyframeRecord& a, const KeyframeRecord& b) { return a.id < b.id; });
  return all;
}

std::vector<MapPoint> Mapper::points() const {
  std::vector<MapPoint> all = left_;
  for (int host = 0; host < window_.size(); ++host) {
    for (const ActivePoint& point : window_.keyframes[host].points) all.push_back(window_point(point, host));
  }
  return all;
}

std::size_t Mapper::active_points() const {
  std::size_t count = 0;
  for (const Keyframe& keyframe : window_.keyframes) count += keyframe.points.size();
  return count;
}

}  // namespace tileflight::odometry
