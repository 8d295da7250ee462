#include "tileflight/world/scene/traffic.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::scene {
namespace {

using base::StrictSection;
using geometry::Box3;
using geometry::Vec2;
using geometry::Vec3;

constexpr std::size_t kMaxActors = 10'000;
/// Poses of a scene are at most so far apart in time: turning by 1 rad/s, a point two metres from the middle of a car
/// strays from its circle by 0.03 mm in between.
constexpr double kPoseStep_s = 0.01;

PathPoint point_of(const std::vector<double>& numbers, double speed_m_s) {
  PathPoint point{Vec2(numbers[0], numbers[1]), std::nullopt, speed_m_s};
  if (numbers.size() > 2) point.up_m = numbers[2];
  return point;
}

std::vector<PathPoint> read_path(StrictSection& actor, double speed_m_s) {
  std::vector<StrictSection> places = actor.sections("path");
  if (const auto position = actor.numbers("position", 2, 3)) {
    if (!places.empty()) throw actor.error("position", "and 'path' are both given; keep one of the two");
    return {point_of(*position, speed_m_s)};
  }
  std::vector<PathPoint> points;
  for (StrictSection& place : places) {
    const auto at = place.numbers("at", 2, 3);
    if (!at) throw place.error("at", "is missing; give [east, north] or [east, north, up] in metres");
    points.push_back(point_of(*at, place.number("speed_m_s", speed_m_s, 0.01, 200.0)));
    place.require_all_keys_used();
  }
  if (points.size() == 1) throw actor.error("path", "has one place; give more, or 'position' for one that stands");
  return points;
}

/// By default people walk at 1.4 m/s and cars drive at 10 m/s.
double default_speed_m_s(Model model) { return model == Model::kPerson ? 1.4 : 10.0; }

std::optional<imaging::Rgb8> read_colour(StrictSection& actor) {
  const auto values = actor.numbers("color", 3, 3);
  if (!values) return std::nullopt;
  imaging::Rgb8 colour{};
  for (std::size_t c = 0; c < 3; ++c) {
    if (!((*values)[c] >= 0.0 && (*values)[c] <= 255.0)) throw actor.error("color", "must be three numbers, 0 to 255");
    colour[c] = static_cast<std::uint8_t>(std::lround((*values)[c]));
  }
  return colour;
}

ActorPlan read_actor(StrictSection actor, std::size_t index) {
  ActorPlan plan;
  const std::string model = actor.choice("model", model_names()).value_or("car");
  plan.model = *model_named(model);
  plan.name = actor.text("name").value_or(model + "_" + std::to_string(index + 1));
  if (plan.name.empty() || plan.name.size() > 100) throw actor.error("name", "needs 1 to 100 characters");
  plan.colour = read_colour(actor);
  plan.number = static_cast<std::uint64_t>(actor.integer("number", static_cast<int>(index), 0, 1'000'000'000));
  plan.scale = actor.number("scale", 1.0, 0.01, 100.0);
  const double speed_m_s = actor.number("speed_m_s", default_speed_m_s(plan.model), 0.01, 200.0);
  plan.route.points = read_path(actor, speed_m_s);
  if (plan.route.points.empty())
    throw actor.error("path", "is missing; give places, or 'position' for one that stands");
  plan.route.yaw_deg = actor.number("yaw_deg").value_or(0.0);
  plan.route.start_s = actor.number("start_s").value_or(0.0);
  plan.route.loops = actor.boolean("loop").value_or(false);
  plan.route.follows_ground = actor.boolean("on_ground").value_or(true);
  actor.require_all_keys_used();
  return plan;
}

Box3 bounds_of_model(const scene::ScenePart& part, double scale) {
  return {scale * part.bounds().min(), scale * part.bounds().max()};
}

}  // namespace

std::vector<ActorPlan> read_actors(StrictSection& flight) {
  std::vector<ActorPlan> plans;
  std::set<std::string> names;
  for (StrictSection& actor : flight.sections("actors")) {
    plans.push_back(read_actor(actor, plans.size()));
    if (!names.insert(plans.back().name).second)
      throw actor.error("name", "'" + plans.back().name + "' is given twice");
    if (plans.size() > kMaxActors) throw flight.error("actors", "are more than " + std::to_string(kMaxActors));
  }
  return plans;
}

std::vector<ActorPlan> read_actors(const std::filesystem::path& flight_file) {
  StrictSection section = StrictSection::load(flight_file);
  return read_actors(section);
}

Traffic::Traffic(std::vector<ActorPlan> plans, const GroundHeight& ground) : plans_(std::move(plans)) {
  const scene::SceneFrame frame(Vec3::Zero());
  std::map<std::string, std::shared_ptr<const scene::ScenePart>> known;  // actors that look the same share a model
  for (ActorPlan& plan : plans_) {
    imaging::TexturedMesh mesh = make_model(plan.model, plan.number, plan.colour);
    std::string look = mesh.name;
    for (const auto& colour : mesh.colors) look.append(reinterpret_cast<const char*>(colour.data()), colour.size());
    auto& part = known[look];
    if (!part)
      part = std::make_shared<const scene::ScenePart>(std::vector<imaging::TexturedMesh>{std::move(mesh)}, frame);
    parts_.push_back(part);
    const Vec3 size = bounds_of_model(*part, plan.scale).sizes();
    plan.route.length_m = 0.6 * size.x();  // between the axles
    plan.route.width_m = 0.8 * size.y();
    paths_.emplace_back(plan.route, ground, plan.name.c_str());
  }
}

/// People stay upright on a slope.
ActorState Traffic::state(std::size_t actor, double time_s) const {
  ActorState state{paths_[actor].pose(time_s), paths_[actor].velocity(time_s)};
  if (plans_[actor].model != Model::kPerson) return state;
  const Vec3 forward = state.T_local_actor.rotation * Vec3::UnitX();
  state.T_local_actor.rotation = Eigen::AngleAxisd(std::atan2(forward.y(), forward.x()), Vec3::UnitZ());
  return state;
}

Box3 Traffic::own_box(std::size_t actor) const { return bounds_of_model(*parts_[actor], plans_[actor].scale); }

std::vector<scene::PlacedPart> Traffic::placed(double from_s, double to_s) const {
  const int steps = to_s > from_s ? static_cast<int>(std::ceil((to_s - from_s) / kPoseStep_s)) : 0;
  std::vector<scene::PlacedPart> placed;
  for (std::size_t i = 0; i < plans_.size(); ++i) {
    scene::PlacedPart& one = placed.emplace_back(scene::PlacedPart{plans_[i].name, parts_[i], {}});
    for (int k = 0; k <= steps; ++k) {
      const double time_s = steps == 0 ? from_s : from_s + (to_s - from_s) * k / steps;
      one.poses.push_back(scene::placed_at(state(i, time_s).T_local_actor, Vec3::Constant(plans_[i].scale)));
    }
  }
  return placed;
}

std::vector<Vec3> points_along(const std::vector<ActorPlan>& plans, double step_m, double default_up_m) {
  std::vector<Vec3> points;
  for (const ActorPlan& plan : plans) {
    const std::vector<PathPoint>& way = plan.route.points;
    for (std::size_t i = 0; i < way.size(); ++i) {
      const PathPoint &a = way[i], &b = way[i + 1 < way.size() || plan.route.loops ? (i + 1) % way.size() : i];
      const int steps =
          std::max(1, static_cast<int>(std::min(1e5, std::ceil((b.position - a.position).norm() / step_m))));
      for (int k = 0; k < steps; ++k) {
        const double u = static_cast<double>(k) / steps;
        const Vec2 at = a.position + u * (b.position - a.position);
        points.emplace_back(at.x(), at.y(), a.up_m.value_or(default_up_m));
      }
    }
  }
  return points;
}

}  // namespace tileflight::scene
