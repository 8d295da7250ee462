#include "tileflight/world/scene/encounters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "tileflight/world/scene/scene.h"

namespace tileflight::scene {
namespace {

using geometry::Box3;
using geometry::Vec3;

/// Whether a segment has a point in the box: Kay and Kajiya's slabs (1986).
bool meets(const Box3& box, const Vec3& from, const Vec3& to) {
  double enter = 0.0, leave = 1.0;
  const Vec3 way = to - from;
  for (int axis = 0; axis < 3; ++axis) {
    if (way[axis] == 0.0) {
      if (from[axis] < box.min()[axis] || from[axis] > box.max()[axis]) return false;
      continue;
    }
    double first = (box.min()[axis] - from[axis]) / way[axis], last = (box.max()[axis] - from[axis]) / way[axis];
    if (first > last) std::swap(first, last);
    enter = std::max(enter, first);
    leave = std::min(leave, last);
  }
  return enter <= leave;
}

void note(std::size_t frame, const std::string& name, std::vector<std::size_t>& frames,
          std::vector<std::string>& names) {
  if (frames.empty() || frames.back() != frame) frames.push_back(frame);
  if (std::ranges::find(names, name) == names.end()) names.push_back(name);
}

/// Times and camera positions from a frame to the next.
using Way = std::vector<std::pair<double, Vec3>>;

Way way_after(const geometry::Trajectory& frames, std::size_t index,
              const std::function<geometry::SE3(double)>& pose_at) {
  constexpr int kSteps = 8;
  const geometry::StampedPose &from = frames.poses[index], &to = frames.poses[index + 1];
  const Vec3 &start = from.T_local_camera.translation, &end = to.T_local_camera.translation;
  Way way{{from.time_s, start}};
  for (int k = 1; k < kSteps; ++k) {
    const double share = static_cast<double>(k) / kSteps, time_s = from.time_s + share * (to.time_s - from.time_s);
    way.emplace_back(time_s, pose_at ? pose_at(time_s).translation : Vec3(start + share * (end - start)));
  }
  way.emplace_back(to.time_s, end);
  return way;
}

bool meets_on_way(const Traffic& traffic, std::size_t actor, const Box3& box, const Way& way) {
  Vec3 before = Vec3::Zero();
  for (std::size_t k = 0; k < way.size(); ++k) {
    const Vec3 own = traffic.state(actor, way[k].first).T_local_actor.inverse() * way[k].second;
    if (k > 0 && meets(box, before, own)) return true;
    before = own;
  }
  return false;
}

}  // namespace

Encounters find_encounters(const Traffic& traffic, const geometry::Trajectory& frames,
                           const std::function<geometry::SE3(double time_s)>& pose_at) {
  Encounters found;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Vec3& camera = frames.poses[i].T_local_camera.translation;
    const Way way = i + 1 < frames.size() ? way_after(frames, i, pose_at) : Way{};
    for (std::size_t actor = 0; actor < traffic.plans().size(); ++actor) {
      const Box3 box = traffic.own_box(actor);
      const std::string& name = traffic.plans()[actor].name;
      if (box.contains(traffic.state(actor, frames.poses[i].time_s).T_local_actor.inverse() * camera))
        note(i, name, found.inside, found.inside_of);
      if (meets_on_way(traffic, actor, box, way)) note(i, name, found.through, found.through_what);
    }
  }
  return found;
}

ActorSurfaces::ActorSurfaces(std::shared_ptr<const Traffic> traffic) : traffic_(std::move(traffic)) {
  std::map<const ScenePart*, std::shared_ptr<const Scene>> known;  // actors that look the same share it
  for (const PlacedPart& one : traffic_->placed(0.0, 0.0)) {
    auto& model = known[one.part.get()];
    if (!model) model = std::make_shared<const Scene>(std::vector<std::shared_ptr<const ScenePart>>{one.part});
    models_.push_back(model);
  }
  placed_.resize(models_.size());
  set_time(0.0);
}

ActorSurfaces::~ActorSurfaces() = default;

void ActorSurfaces::set_time(double time_s) {
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    const geometry::SE3 T_local_actor = traffic_->state(i, time_s).T_local_actor;
    const Box3 box = traffic_->own_box(i);
    const Eigen::Affine3d pose = placed_at(T_local_actor, Vec3::Constant(traffic_->plans()[i].scale));
    placed_[i] = {pose.inverse(), T_local_actor * box.center(), 0.5 * box.sizes().norm()};
  }
}

std::optional<ActorHit> ActorSurfaces::first_hit(const Vec3& from, const Vec3& to) const {
  const Vec3 way = to - from;
  const double length_m = way.norm();
  if (!(length_m > 0.0)) return std::nullopt;
  std::optional<ActorHit> first;
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    const Placed& one = placed_[i];
    const double along = std::clamp((one.center - from).dot(way) / (length_m * length_m), 0.0, 1.0);
    if ((from + along * way - one.center).squaredNorm() > one.radius_m * one.radius_m) continue;
    const Vec3 start = one.own_local * from, own_way = one.own_local.linear() * way;
    const double own_length = own_way.norm();
    const auto hit = models_[i]->intersect({start, own_way / own_length}, own_length);
    if (!hit || hit->distance_m > own_length) continue;
    const double distance_m = hit->distance_m / own_length * length_m;
    if (first && first->distance_m <= distance_m) continue;
    const Vec3 normal = one.own_local.linear().transpose() * models_[i]->normal(*hit);
    if (!(normal.squaredNorm() > 0.0)) continue;  // a triangle without area
    first = {i, distance_m, normal.normalized()};
  }
  return first;
}

}  // namespace tileflight::scene
