#include "tileflight/experiment/flown_path.h"

#include <algorithm>
#include <memory>

#include "tileflight/flight/vehicle_flight.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/scene/scene.h"
#include "tileflight/tiles/open_source.h"

namespace tileflight::experiment {
namespace {

using flight::VehicleFlight;
using geometry::Vec3;
using nlohmann::json;

/// Between the places around which tiles are read for collisions.
constexpr double kLookingEvery_s = 0.5;

json numbers(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

json report_of(const VehicleFlight& flown) {
  json report = {{"outcome", flight::outcome_text(flown.outcome)},
                 {"duration_s", flown.path.end_s() - flown.path.start_s()},
                 {"collisions", flown.collisions}};
  if (flown.last_collision) {
    const flight::Collision& c = *flown.last_collision;
    report["last_collision"] = {
        {"time_s", c.time_s}, {"point", numbers(c.point)}, {"normal", numbers(c.normal)}, {"impact_m_s", c.impact_m_s}};
  }
  if (flown.tracking) {
    report["tracking"] = {{"rms_m", flown.tracking->rms_m},
                          {"max_m", flown.tracking->max_m},
                          {"waypoints_m", flown.tracking->waypoints_m}};
  }
  for (const flight::MissionResult& step : flown.mission) {
    report["mission"].push_back({{"do", step.name},
                                 {"outcome", flight::outcome_text(step.outcome)},
                                 {"started_s", step.started_s},
                                 {"ended_s", step.ended_s}});
  }
  return report;
}

/// All around the path as it would be without obstacles.
std::vector<tiles::Eye> eyes_around(const flight::Path& path, const imaging::Camera& camera) {
  std::vector<geometry::SE3> poses;
  for (double time_s = path.start_s(); time_s < path.end_s(); time_s += kLookingEvery_s)
    poses.push_back(path.pose(time_s));
  poses.push_back(path.pose(path.end_s()));
  return tiles::all_around(tiles::eyes_along(camera, poses));
}

std::shared_ptr<const scene::Scene> place_of(const flight::FlightPlan& plan, const RenderSettings& settings,
                                             const imaging::Camera& camera, const Progress& progress) {
  tiles::LoadOptions load = settings.load;
  load.uses = {tiles::Use::kAnalyse};
  load.textures = false;
  if (settings.max_memory_bytes) load.max_memory_bytes = *settings.max_memory_bytes;
  if (settings.error_px) load.flight = {eyes_around(flight::path_of(plan), camera), *settings.error_px, {}};
  const auto source = tiles::open_source(settings.source, settings.load.source);
  tiles::LoadedTiles tiles = tiles::load_region(*source, tiles::shown_source(settings.source), load, progress);
  if (tiles.meshes.empty()) return nullptr;
  return std::make_shared<const scene::Scene>(std::move(tiles.meshes));
}

flight::Obstacles obstacles_of(std::shared_ptr<const scene::Scene> place) {
  if (!place) return {};
  return [place = std::move(place)](const Vec3& from, const Vec3& to) -> std::optional<flight::SurfaceHit> {
    const double length_m = (to - from).norm();
    if (length_m <= 0.0) return std::nullopt;
    const scene::Ray ray{from, (to - from) / length_m};
    const auto hit = place->intersect(ray, length_m);
    if (!hit || hit->distance_m > length_m) return std::nullopt;
    const Vec3 normal = place->normal(*hit);
    if (normal.squaredNorm() < 0.5) return std::nullopt;  // a triangle without area
    return flight::SurfaceHit{ray.origin + hit->distance_m * ray.direction, normal};
  };
}

}  // namespace

FlownPath fly_plan(const flight::FlightPlan& plan, const RenderSettings& settings, const imaging::Camera& camera,
                   const Progress& progress) {
  if (!plan.vehicle) return {flight::path_of(plan), flight::frame_poses(plan), nullptr};
  const bool collides = plan.vehicle->options.collision != flight::CollisionPolicy::kOff;
  const flight::Obstacles obstacles = collides ? obstacles_of(place_of(plan, settings, camera, progress)) : nullptr;
  const VehicleFlight flown = flight::fly(plan, obstacles);
  return {flown.path, flight::frames_along(flown.path, plan), report_of(flown)};
}

}  // namespace tileflight::experiment
