#include "tileflight/capture/recording/flown_path.h"

#include <algorithm>

#include "tileflight/capture/vehicle/vehicle_flight.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/world/place/ground_heights.h"
#include "tileflight/world/place/ground_tiles.h"
#include "tileflight/world/place/place_reader.h"
#include "tileflight/world/scene/encounters.h"

namespace tileflight::recording {
namespace {

using geometry::Vec3;
using nlohmann::json;
using vehicle::VehicleFlight;

/// Interval of the positions around which tiles are loaded for collisions.
constexpr double kLookingEvery_s = 0.5;

json vehicle_report(const VehicleFlight& flown) {
  json report = {{"outcome", vehicle::outcome_text(flown.outcome)},
                 {"duration_s", flown.path.end_s() - flown.path.start_s()},
                 {"collisions", flown.collisions}};
  if (flown.last_collision) {
    const vehicle::Collision& c = *flown.last_collision;
    report["last_collision"] = {{"time_s", c.time_s},
                                {"point", geometry::json_numbers(c.point)},
                                {"normal", geometry::json_numbers(c.normal)},
                                {"impact_m_s", c.impact_m_s}};
    if (!c.object.empty()) report["last_collision"]["actor"] = c.object;
  }
  if (flown.tracking) {
    report["tracking"] = {{"rms_m", flown.tracking->rms_m},
                          {"max_m", flown.tracking->max_m},
                          {"waypoints_m", flown.tracking->nearest_to_waypoints_m}};
  }
  for (const vehicle::MissionResult& step : flown.mission) {
    report["mission"].push_back({{"do", step.name},
                                 {"outcome", vehicle::outcome_text(step.outcome)},
                                 {"started_s", step.started_s},
                                 {"ended_s", step.ended_s}});
  }
  return report;
}

/// Samples poses along the path as planned without obstacles.
std::vector<geometry::SE3> poses_along(const flight_path::Path& path) {
  std::vector<geometry::SE3> poses;
  for (double time_s = path.start_s(); time_s < path.end_s(); time_s += kLookingEvery_s)
    poses.push_back(path.pose(time_s));
  poses.push_back(path.pose(path.end_s()));
  return poses;
}

vehicle::ObstacleQuery make_obstacle_query(std::shared_ptr<const scene::Scene> place) {
  if (!place) return {};
  return [place = std::move(place)](const Vec3& from, const Vec3& to) -> std::optional<vehicle::SurfaceHit> {
    const double length_m = (to - from).norm();
    if (length_m <= 0.0) return std::nullopt;
    const scene::Ray ray{from, (to - from) / length_m};
    const auto hit = place->intersect(ray, length_m);
    if (!hit || hit->distance_m > length_m) return std::nullopt;
    const Vec3 normal = place->normal(*hit);
    if (normal.squaredNorm() < 0.5) return std::nullopt;  // a triangle without area
    return vehicle::SurfaceHit{ray.origin + hit->distance_m * ray.direction, normal};
  };
}

/// Finds the first hit among the place's surface and the actors.
vehicle::ObstacleQuery with_actors(vehicle::ObstacleQuery place, std::shared_ptr<const scene::Traffic> traffic,
                                   std::shared_ptr<const scene::ActorSurfaces> surfaces) {
  return [place = std::move(place), traffic = std::move(traffic), surfaces = std::move(surfaces)](
             const Vec3& from, const Vec3& to) -> std::optional<vehicle::SurfaceHit> {
    const auto of_place = place ? place(from, to) : std::nullopt;
    const auto of_actor = surfaces->first_hit(from, to);
    if (!of_actor || (of_place && (of_place->point - from).norm() <= of_actor->distance_m)) return of_place;
    return vehicle::SurfaceHit{from + of_actor->distance_m * (to - from).normalized(), of_actor->normal,
                               traffic->plans()[of_actor->actor].name};
  };
}

/// The tiles that a camera at these poses would want, in all directions, if the settings have a pixel error, else those
/// of their region.
tileset::LoadOptions options_around(const RenderSettings& settings, const imaging::Camera& camera,
                                    const std::vector<geometry::SE3>& poses) {
  tileset::LoadOptions load = settings.load;
  load.uses = {fetch::Use::kAnalyse};
  load.textures = false;
  if (settings.max_memory_bytes) load.max_memory_bytes = *settings.max_memory_bytes;
  if (settings.error_px)
    load.flight = {tileset::widen_to_all_directions(tileset::view_cones_along(camera, poses)), *settings.error_px};
  return load;
}

}  // namespace

void place_mission(vehicle::FlightPlan& plan, const std::string& source, const tileset::LoadOptions& load,
                   const Progress& progress) {
  if (!plan.mission_file) return;
  place::GroundHeightsSettings settings{source, load, fetch::Use::kAnalyse};
  settings.load.flight.reset();
  settings.load.textures = false;
  settings.load.allow_large_area = true;
  const place::PlaceReader reader(source, settings.load, settings.use);
  const std::optional<geometry::LocalFrame>& frame = reader.placement().local_frame;
  if (!frame) {
    throw InputError(plan.mission_file->file.string(),
                     "has geographic positions, and the place is not georeferenced: give the origin of its frame "
                     "(--origin LAT,LON,HEIGHT)");
  }
  const auto ground = [&](const std::vector<missions::GroundPoint>& points) {
    std::vector<place::GroundQuery> queries;
    for (const missions::GroundPoint& point : points)
      queries.push_back({geometry::Geodetic{point.latitude_deg, point.longitude_deg, {0.0}}, std::nullopt});
    const json found = place::ground_heights(settings, queries, progress);
    std::vector<std::optional<double>> heights;
    for (const json& point : found["points"]) {
      const json& highest = point["highest"];
      heights.push_back(highest.is_null() ? std::nullopt : std::optional(highest["height"].get<double>()));
    }
    return heights;
  };
  vehicle::place_mission(plan, {*frame, ground});
}

std::shared_ptr<const scene::Scene> load_surroundings(const RenderSettings& settings, const imaging::Camera& camera,
                                                      const std::vector<geometry::SE3>& poses,
                                                      const Progress& progress) {
  const tileset::LoadOptions load = options_around(settings, camera, poses);
  const auto source = fetch::open_source(settings.source, settings.load.source);
  tileset::LoadedTiles tiles = tileset::load_region(*source, fetch::redact_source(settings.source), load, progress);
  if (tiles.meshes.empty()) return nullptr;
  return std::make_shared<const scene::Scene>(std::move(tiles.meshes));
}

std::shared_ptr<const scene::Traffic> plan_traffic(const RenderSettings& settings, const imaging::Camera& camera,
                                                   std::vector<geometry::SE3> poses, const Progress& progress) {
  if (missions::is_mission_file(settings.flight.flight)) return nullptr;
  std::vector<scene::ActorPlan> plans = scene::read_actors(settings.flight.flight);
  if (plans.empty()) return nullptr;
  const bool needs_ground =
      std::ranges::any_of(plans, [](const scene::ActorPlan& plan) { return plan.route.follows_ground; });
  scene::GroundHeight ground;
  if (needs_ground) {
    constexpr double kEvery_m = 10.0;
    const double camera_up_m = poses.front().translation.z();
    for (const geometry::Vec3& point : scene::points_along(plans, kEvery_m, camera_up_m))
      poses.emplace_back(Eigen::Quaterniond::Identity(), point);
    tileset::LoadOptions load = options_around(settings, camera, poses);
    if (!settings.max_memory_bytes) load.max_memory_bytes = base::default_memory_bytes();
    const auto surface = std::make_shared<place::GroundTiles>(settings.source, load, progress);
    ground = [surface](double x, double y, double below_z) { return surface->height(x, y, below_z); };
  }
  return std::make_shared<const scene::Traffic>(std::move(plans), ground);
}

FlownPath fly_plan(const vehicle::FlightPlan& plan, const RenderSettings& settings, const imaging::Camera& camera,
                   const Progress& progress) {
  if (plan.autopilot) {
    if (!settings.fly_autopilot)
      throw InputError(settings.flight.flight.string(),
                       "an autopilot flies it, and this program was built without the simulator (TILEFLIGHT_LIVE=OFF); "
                       "render it with a program that has it");
    return settings.fly_autopilot(plan, settings, progress);
  }
  if (!plan.vehicle) return {vehicle::build_path(plan), vehicle::frame_poses(plan), nullptr, nullptr};
  const bool collides = plan.vehicle->options.collision != vehicle::CollisionPolicy::kOff;
  if (!collides) {
    const VehicleFlight flown = vehicle::fly(plan);
    return {flown.path, vehicle::sample_frames(flown.path, plan), vehicle_report(flown), nullptr};
  }
  const std::vector<geometry::SE3> planned = poses_along(vehicle::build_path(plan));
  vehicle::ObstacleQuery obstacles = make_obstacle_query(load_surroundings(settings, camera, planned, progress));
  auto traffic = plan_traffic(settings, camera, planned, progress);
  vehicle::FlightClock clock;
  if (traffic) {
    const auto surfaces = std::make_shared<scene::ActorSurfaces>(traffic);
    clock = [surfaces](double time_s) { surfaces->set_time(time_s); };
    obstacles = with_actors(std::move(obstacles), traffic, surfaces);
  }
  const VehicleFlight flown = vehicle::fly(plan, obstacles, clock);
  return {flown.path, vehicle::sample_frames(flown.path, plan), vehicle_report(flown), std::move(traffic)};
}

}  // namespace tileflight::recording
