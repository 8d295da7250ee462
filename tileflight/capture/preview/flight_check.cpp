#include "tileflight/capture/preview/flight_check.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <numbers>
#include <sstream>

#include "tileflight/capture/recording/flight_faults.h"
#include "tileflight/capture/render/view_overlap.h"
#include "tileflight/core/base/order_statistics.h"

namespace tileflight::preview {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

/// A ray's intersection with a surface.
struct SurfaceHit {
  Vec2 pixel;
  Vec3 point;  ///< local frame
};

/// The grid's rays cast from one pose.
struct ViewSample {
  render::ViewStatistics view;
  std::vector<SurfaceHit> hits;
};

ViewSample sample_view(const scene::Scene& scene, const std::vector<render::GridRay>& rays, const SE3& pose) {
  ViewSample out;
  for (const render::GridRay& r : rays) {
    const scene::Ray ray{pose.translation, pose.rotation * r.direction};
    ++out.view.rays;
    const auto hit = scene.intersect(ray);
    if (!hit) continue;
    ++out.view.surfaces;
    out.view.nearest_m = std::min(out.view.nearest_m, hit->distance_m);
    out.view.back_faces += scene.normal(*hit).dot(ray.direction) > 0 ? 1 : 0;
    out.hits.push_back({r.pixel, ray.origin + hit->distance_m * ray.direction});
  }
  return out;
}

/// Projection of a point; nullopt outside the image.
std::optional<Vec2> project_into_picture(const imaging::Camera& camera, const SE3& pose, const Vec3& point) {
  const auto pixel = camera.project(pose.inverse() * point);
  return pixel && camera.contains(*pixel) ? pixel : std::nullopt;
}

double flow_share(const ViewSample& from, const imaging::Camera& camera, const SE3& next) {
  if (from.hits.empty()) return std::nan("");
  std::vector<double> ways;
  for (const SurfaceHit& seen : from.hits) {
    const auto pixel = project_into_picture(camera, next, seen.point);
    ways.push_back(pixel ? (*pixel - seen.pixel).norm() / camera.width() : INFINITY);
  }
  return base::upper_median(std::move(ways));
}

std::optional<InitializationCheck> check_initialization(const ViewSample& first,
                                                        const recording::PlannedFlight& mission,
                                                        const FlightCheckOptions& options) {
  constexpr double kStillSeen = 0.2;  // share of the points that the first frame sees
  const auto& poses = mission.frames.poses;
  if (poses.size() < 2 || first.hits.empty()) return std::nullopt;
  InitializationCheck start;
  const Vec3& from = poses[0].T_local_camera.translation;
  for (std::size_t j = 1; j < std::min(poses.size(), options.initialization_frames); ++j) {
    const SE3& pose = poses[j].T_local_camera;
    std::vector<double> angles;
    for (const SurfaceHit& seen : first.hits) {
      if (!project_into_picture(mission.calibration.camera, pose, seen.point)) continue;
      const Vec3 a = seen.point - from, b = seen.point - pose.translation;
      angles.push_back(std::atan2(a.cross(b).norm(), a.dot(b)));
    }
    if (static_cast<double>(angles.size()) < kStillSeen * static_cast<double>(first.hits.size())) continue;
    const double parallax_rad = base::upper_median(std::move(angles));
    if (parallax_rad > start.parallax_rad) start = {parallax_rad, j};
  }
  return start;
}

/// Marks at most `most` evenly spaced indices below `size`, including the first and the last.
std::vector<bool> select_evenly(std::size_t size, std::size_t most) {
  std::vector<bool> chosen(size, size <= most);
  for (std::size_t k = 0; size > most && k < most; ++k) chosen[k * (size - 1) / (most - 1)] = true;
  return chosen;
}

std::vector<Vec3> path_between(const recording::PlannedFlight& mission, std::size_t i) {
  constexpr int kSteps = 8;
  const auto &from = mission.frames.poses[i], &to = mission.frames.poses[i + 1];
  std::vector<Vec3> way{from.T_local_camera.translation};
  for (int k = 1; k < kSteps && mission.pose_at; ++k)
    way.push_back(mission.pose_at(from.time_s + (to.time_s - from.time_s) * k / kSteps).translation);
  way.push_back(to.T_local_camera.translation);
  return way;
}

std::vector<render::FlightFault> drop_empty(std::vector<render::FlightFault> faults) {
  std::erase_if(faults, [](const render::FlightFault& fault) { return fault.frames.empty(); });
  return faults;
}

template <class Found>
std::vector<std::size_t> frames_where(std::size_t count, const Found& found) {
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < count; ++i) {
    if (found(i)) frames.push_back(i);
  }
  return frames;
}

std::string percent(double share) {
  std::ostringstream text;
  text << std::lround(100 * share) << " %";
  return text.str();
}

double degrees(double rad) { return rad * 180.0 / std::numbers::pi; }

/// Pixels along the image border, in order.
std::vector<Vec2> border_pixels(const imaging::Camera& camera) {
  constexpr int kASide = 24;
  const double right = camera.width() - 1.0, bottom = camera.height() - 1.0;
  std::vector<Vec2> pixels;
  const auto add_side = [&](const Vec2& from, const Vec2& to) {
    for (int k = 0; k < kASide; ++k) pixels.emplace_back(from + (to - from) * k / kASide);
  };
  add_side({0, 0}, {right, 0});
  add_side({right, 0}, {right, bottom});
  add_side({right, bottom}, {0, bottom});
  add_side({0, bottom}, {0, 0});
  return pixels;
}

}  // namespace

FlightCheck check_flight(const scene::Scene& scene, const recording::PlannedFlight& mission,
                         const FlightCheckOptions& options, const Progress& progress) {
  const auto& poses = mission.frames.poses;
  const std::vector<render::GridRay> rays = render::grid_rays(mission.calibration.camera, options.rays_per_side);
  const std::vector<bool> is_looked_at = select_evenly(poses.size(), options.max_views);
  FlightCheck found{std::vector<render::FrameCheck>(poses.size()),
                    std::vector<ViewCheck>(poses.size()),
                    find_actor_faults(mission),
                    {}};
  scene.build_ray_tree();
  std::mutex progress_mutex;
  std::int64_t done = 0;
  tbb::parallel_for(std::size_t{0}, poses.size(), [&](std::size_t i) {
    const SE3& pose = poses[i].T_local_camera;
    render::FrameCheck& frame = found.frames[i];
    frame.surroundings = scene::find_surroundings(scene, pose.translation, options.max_clearance_m);
    frame.path_is_blocked = i + 1 < poses.size() && scene::path_hits_surface(scene, path_between(mission, i));
    if (is_looked_at[i]) {
      const ViewSample seen = sample_view(scene, rays, pose);
      frame.view = seen.view;
      found.views[i].surface_share = seen.view.surface_share();
      if (i + 1 < poses.size())
        found.views[i].flow_share = flow_share(seen, mission.calibration.camera, poses[i + 1].T_local_camera);
    }
    const std::scoped_lock lock(progress_mutex);
    report_progress(progress, ++done, static_cast<std::int64_t>(poses.size()), "frames checked");
  });
  if (!poses.empty())
    found.initialization = check_initialization(sample_view(scene, rays, poses[0].T_local_camera), mission, options);
  return found;
}

std::vector<render::FlightFault> find_faults(const FlightCheck& check, const FlightCheckOptions& options) {
  const std::vector<std::optional<render::FrameCheck>> known(check.frames.begin(), check.frames.end());
  std::vector<render::FlightFault> faults = render::find_flight_faults(known, 0, options.min_clearance_m);
  faults.insert(faults.end(), check.of_actors.begin(), check.of_actors.end());
  const std::size_t count = check.frames.size();
  const auto share = [&](std::size_t i) { return check.views[i].surface_share; };
  faults.push_back(
      {"view_nearly_empty", "less than " + percent(options.min_surface_share) + " of the image shows the place",
       frames_where(count, [&](std::size_t i) { return share(i) > 0.0 && share(i) < options.min_surface_share; })});
  // A camera that looks at a building from the side has nothing below it either. Frames without a view of their own are
  // like the last one that has one.
  std::vector<bool> sees_place;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_unknown = std::isnan(share(i));
    sees_place.push_back(is_unknown ? i > 0 && sees_place[i - 1] : share(i) >= options.min_surface_share);
  }
  faults.push_back({"nothing_below",
                    "there is no surface below the camera: it has left the place, or the place has a hole",
                    frames_where(count, [&](std::size_t i) {
                      const scene::Surroundings& around = check.frames[i].surroundings;
                      return std::isinf(around.above_ground_m) && !around.inside && !sees_place[i];
                    })});
  faults.push_back(
      {"too_fast",
       "the image moves by more than " + percent(options.max_flow_share) +
           " of its width between frames, which odometry may fail to track: fly slower or raise the frame rate",
       frames_where(count, [&](std::size_t i) { return check.views[i].flow_share > options.max_flow_share; })});
  return drop_empty(std::move(faults));
}

std::optional<std::string> initialization_warning(const FlightCheck& check, const FlightCheckOptions& options) {
  if (!check.initialization || check.initialization->parallax_rad >= options.min_initialization_parallax_rad)
    return std::nullopt;
  std::ostringstream text;
  text.precision(2);
  text << "too little parallax to initialize odometry: over the first "
       << std::min(options.initialization_frames, check.frames.size())
       << " frames the viewing angle changes by at most " << degrees(check.initialization->parallax_rad) << "°, but "
       << degrees(options.min_initialization_parallax_rad)
       << "° are needed: fly sideways, lower or faster at the start";
  return text.str();
}

std::vector<Vec2> footprint(const scene::Scene& scene, const imaging::Camera& camera, const SE3& pose, double reach_m) {
  const auto ground_at = [&](const Vec2& pixel) -> std::optional<Vec2> {
    const auto ray = camera.unproject(pixel);
    if (!ray) return std::nullopt;
    const Vec3 direction = pose.rotation * ray->normalized();
    const auto hit = scene.intersect({pose.translation, direction});
    if (!hit) return std::nullopt;
    const Vec2 way = hit->distance_m * direction.head<2>();
    if (way.norm() > reach_m) return std::nullopt;
    return Vec2(pose.translation.head<2>()) + way;
  };
  const Vec2 middle((camera.width() - 1) / 2.0, (camera.height() - 1) / 2.0);
  std::optional<Vec2> inner;  // the pixel nearest to the image centre that hits the place
  for (const render::GridRay& ray : render::grid_rays(camera, 48)) {
    if ((!inner || (ray.pixel - middle).norm() < (*inner - middle).norm()) && ground_at(ray.pixel)) inner = ray.pixel;
  }
  std::vector<Vec2> outline;
  if (!inner) return outline;
  for (const Vec2& border : border_pixels(camera)) {
    if (const auto point = ground_at(border)) {
      outline.push_back(*point);
      continue;
    }
    Vec2 sees = *inner, sees_not = border;
    for (int k = 0; k < 12; ++k) {
      const Vec2 between = (sees + sees_not) / 2;
      (ground_at(between) ? sees : sees_not) = between;
    }
    outline.push_back(*ground_at(sees));
  }
  return outline;
}

}  // namespace tileflight::preview
