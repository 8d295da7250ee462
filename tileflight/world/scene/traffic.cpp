#include "tileflight/world/scene/traffic.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::scene {

namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

constexpr double kStep_m = 0.25;        // between samples of a way
constexpr double kMaxLength_m = 200e3;  // of a way
constexpr double kAboveRoad_m = 2.0;    // where a height is given, the road is the surface below this
constexpr double kFromAbove_m = 1e5;    // else it is the uppermost
constexpr int kSmoothed = 4;            // samples to either side whose heights are averaged: captured roads are bumpy

void check(const ActorRoute& route, const char* name) {
  if (route.points.empty()) throw InputError(name, "has no place; give 'position' or 'path'");
  for (std::size_t i = 0; i < route.points.size(); ++i) {
    const PathPoint& point = route.points[i];
    if (!point.position.allFinite() || (point.up_m && !std::isfinite(*point.up_m)))
      throw InputError(name, "a place is not finite");
    if (!(point.speed_m_s > 0.0 && point.speed_m_s <= 200.0))
      throw InputError(name, "speed_m_s must be above 0 and at most 200");
    const Vec2& next = route.points[(i + 1) % route.points.size()].position;
    const bool is_last = i + 1 == route.points.size();
    if (route.points.size() > 1 && (!is_last || route.loops) && (next - point.position).norm() < 0.1)
      throw InputError(name, "two places of its path in a row are the same");
    if (!route.follows_ground && !point.up_m)
      throw InputError(name, "does not follow the ground; give places as [east, north, up]");
  }
}

/// A point of the curve from `b` to `c`, with neighbours `a` and `d`: Hermite's, its tangents those of the parabolas
/// through three points by chord length.
struct Span {
  Vec3 b, c, tangent_b, tangent_c;  ///< tangents by the span's parameter, 0 to 1

  Vec3 at(double u) const {
    const double v = 1.0 - u;
    return v * v * (1 + 2 * u) * b + u * v * v * tangent_b + u * u * (3 - 2 * u) * c - u * u * v * tangent_c;
  }
  Vec3 slope(double u) const {
    return 6 * u * (u - 1) * (b - c) + (1 - u) * (1 - 3 * u) * tangent_b + u * (3 * u - 2) * tangent_c;
  }
};

Vec3 tangent(const Vec3& before, const Vec3& at, const Vec3& after, double span_m) {
  const double h0 = (at - before).norm(), h1 = (after - at).norm();
  const Vec3 by_metre = (h1 * (at - before) / h0 + h0 * (after - at) / h1) / (h0 + h1);
  return span_m * by_metre;
}

std::vector<Span> spans_of(const std::vector<Vec3>& points, bool loops) {
  const std::size_t n = points.size(), count = loops ? n : n - 1;
  const auto neighbour = [&](std::size_t i, int step) -> Vec3 {
    const auto at = static_cast<std::ptrdiff_t>(i) + step, last = static_cast<std::ptrdiff_t>(n) - 1;
    if (loops) return points[static_cast<std::size_t>((at + last + 1) % (last + 1))];
    if (at < 0) return 2.0 * points[0] - points[1];
    if (at > last) return 2.0 * points[n - 1] - points[n - 2];
    return points[static_cast<std::size_t>(at)];
  };
  std::vector<Span> spans;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3 b = points[i], c = neighbour(i, 1);
    const double span_m = (c - b).norm();
    spans.push_back({b, c, tangent(neighbour(i, -1), b, c, span_m), tangent(b, c, neighbour(i, 2), span_m)});
  }
  return spans;
}

/// The multiple of a turn that brings `angle` nearest to `near`.
double unwrapped(double angle, double near) {
  return angle + 2.0 * std::numbers::pi * std::round((near - angle) / (2.0 * std::numbers::pi));
}

}  // namespace

ActorPath::ActorPath(const ActorRoute& route, const GroundHeight& ground, const char* name)
    : start_s_(route.start_s), loops_(route.loops && route.points.size() > 1) {
  check(route, name);
  lay_out(route);
  if (samples_.back().distance_m > kMaxLength_m) throw InputError(name, "its path is longer than 200 km");
  if (route.follows_ground) put_on_ground(route, ground, name);
}

/// Samples the curve at even steps; heights are the points' own, linear between them, or 0.
void ActorPath::lay_out(const ActorRoute& route) {
  std::vector<Vec3> points;
  for (const PathPoint& point : route.points)
    points.emplace_back(point.position.x(), point.position.y(), point.up_m.value_or(0.0));
  if (points.size() == 1) {
    samples_.push_back({0, 0, 0, points[0], (90.0 - route.yaw_deg) * std::numbers::pi / 180.0, 0, 0});
    return;
  }
  const std::vector<Span> spans = spans_of(points, loops_);
  for (std::size_t k = 0; k < spans.size(); ++k) {
    const double from_m_s = route.points[k].speed_m_s;
    const double to_m_s = route.points[(k + 1) % route.points.size()].speed_m_s;
    const int steps = static_cast<int>(std::min(1e6, std::ceil((spans[k].c - spans[k].b).norm() / kStep_m)));
    for (int i = k == 0 ? 0 : 1; i <= steps; ++i) {
      const double u = static_cast<double>(i) / steps;
      Sample next;
      next.position = spans[k].at(u);
      next.speed_m_s = from_m_s + u * (to_m_s - from_m_s);
      const Vec3 slope = spans[k].slope(u);
      next.heading_rad = std::atan2(slope.y(), slope.x());
      if (!samples_.empty()) {
        const Sample& last = samples_.back();
        const double step_m = (next.position - last.position).norm();
        next.distance_m = last.distance_m + step_m;
        next.time_s = last.time_s + 2.0 * step_m / (last.speed_m_s + next.speed_m_s);
        next.heading_rad = unwrapped(next.heading_rad, last.heading_rad);
      }
      samples_.push_back(next);
    }
  }
}

void ActorPath::put_on_ground(const ActorRoute& route, const GroundHeight& ground, const char* name) {
  const bool has_heights = std::ranges::all_of(route.points, [](const PathPoint& p) { return p.up_m.has_value(); });
  const auto height = [&](const Sample& at, double ahead_m, double left_m) {
    const double c = std::cos(at.heading_rad), s = std::sin(at.heading_rad);
    const double below = has_heights ? at.position.z() + kAboveRoad_m : kFromAbove_m;
    return ground
               ? ground(at.position.x() + ahead_m * c - left_m * s, at.position.y() + ahead_m * s + left_m * c, below)
               : std::nullopt;
  };
  struct Footing {
    double z = 0.0, pitch = 0.0, roll = 0.0;
  };
  std::vector<std::optional<Footing>> found;
  for (const Sample& at : samples_) {
    const double l = 0.5 * route.length_m, w = 0.5 * route.width_m;
    const auto front = height(at, l, 0), back = height(at, -l, 0), left = height(at, 0, w), right = height(at, 0, -w);
    const auto middle = height(at, 0, 0);
    if (!middle) {
      found.emplace_back();
      continue;
    }
    Footing footing{*middle, 0.0, 0.0};
    if (front && back && std::abs(*front - *back) < route.length_m) footing.pitch = std::atan2(*front - *back, 2 * l);
    if (left && right && std::abs(*left - *right) < route.width_m) footing.roll = std::atan2(*left - *right, 2 * w);
    found.push_back(footing);
  }
  if (std::ranges::none_of(found, [](const auto& one) { return one.has_value(); }))
    throw InputError(name, "there is no surface below its path; is it in the place, in the local frame?");
  const auto count = static_cast<std::ptrdiff_t>(samples_.size());
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    Footing sum;
    double used = 0.0;
    // Farther and farther until there is ground: over a hole in the tiles it goes straight on.
    for (std::ptrdiff_t reach = kSmoothed; used == 0.0; reach *= 2) {
      for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
        const std::ptrdiff_t at =
            loops_ ? ((i + k) % count + count) % count : std::clamp<std::ptrdiff_t>(i + k, 0, count - 1);
        const auto& one = found[static_cast<std::size_t>(at)];
        if (!one) continue;
        sum = {sum.z + one->z, sum.pitch + one->pitch, sum.roll + one->roll};
        used += 1.0;
      }
    }
    Sample& sample = samples_[static_cast<std::size_t>(i)];
    sample.position.z() = sum.z / used;
    sample.pitch = sum.pitch / used;
    sample.roll = sum.roll / used;
  }
}

double ActorPath::along_s(double time_s) const {
  const double along_s = time_s - start_s_, duration_s = samples_.back().time_s;
  return loops_ && along_s > duration_s ? std::fmod(along_s, duration_s) : along_s;
}

/// The samples before and after a time; twice the same where it stands.
std::pair<const ActorPath::Sample*, const ActorPath::Sample*> ActorPath::around(double time_s) const {
  const auto next = std::ranges::upper_bound(samples_, along_s(time_s), {}, &Sample::time_s);
  if (next == samples_.begin()) return {&samples_.front(), &samples_.front()};
  if (next == samples_.end()) return {&samples_.back(), &samples_.back()};
  return {&*(next - 1), &*next};
}

ActorPath::Sample ActorPath::at(double time_s) const {
  const auto [from, to] = around(time_s);
  if (from == to) return *from;
  const double share = (along_s(time_s) - from->time_s) / (to->time_s - from->time_s);
  const auto between = [share](double a, double b) { return a + share * (b - a); };
  Sample at = *from;
  at.position = from->position + share * (to->position - from->position);
  at.heading_rad = between(from->heading_rad, to->heading_rad);
  at.pitch = between(from->pitch, to->pitch);
  at.roll = between(from->roll, to->roll);
  return at;
}

SE3 ActorPath::pose(double time_s) const {
  const Sample now = at(time_s);
  const Eigen::Quaterniond rotation = Eigen::AngleAxisd(now.heading_rad, Vec3::UnitZ()) *
                                      Eigen::AngleAxisd(-now.pitch, Vec3::UnitY()) *
                                      Eigen::AngleAxisd(now.roll, Vec3::UnitX());
  return {rotation, now.position};
}

Vec3 ActorPath::velocity(double time_s) const {
  const auto [from, to] = around(time_s);
  return from == to ? Vec3(Vec3::Zero()) : Vec3((to->position - from->position) / (to->time_s - from->time_s));
}

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

/// Default speed: people walk at 1.4 m/s, cars drive at 10 m/s.
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

Box3 bounds_of_model(const ScenePart& part, double scale) {
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
  const SceneFrame frame(Vec3::Zero());
  std::map<std::string, std::shared_ptr<const ScenePart>> known;  // actors that look the same share a model
  for (ActorPlan& plan : plans_) {
    imaging::TexturedMesh mesh = make_model(plan.model, plan.number, plan.colour);
    std::string look = mesh.name;
    for (const auto& colour : mesh.colors) look.append(reinterpret_cast<const char*>(colour.data()), colour.size());
    auto& part = known[look];
    if (!part) part = std::make_shared<const ScenePart>(std::vector<imaging::TexturedMesh>{std::move(mesh)}, frame);
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

std::vector<PlacedPart> Traffic::placed(double from_s, double to_s) const {
  const int steps = to_s > from_s ? static_cast<int>(std::ceil((to_s - from_s) / kPoseStep_s)) : 0;
  std::vector<PlacedPart> placed;
  for (std::size_t i = 0; i < plans_.size(); ++i) {
    PlacedPart& one = placed.emplace_back(PlacedPart{plans_[i].name, parts_[i], {}});
    for (int k = 0; k <= steps; ++k) {
      const double time_s = steps == 0 ? from_s : from_s + (to_s - from_s) * k / steps;
      one.poses.push_back(placed_at(state(i, time_s).T_local_actor, Vec3::Constant(plans_[i].scale)));
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
