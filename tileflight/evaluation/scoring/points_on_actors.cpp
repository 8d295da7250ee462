#include "tileflight/evaluation/scoring/points_on_actors.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "tileflight/capture/recording/actor_labels.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/nearest.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/scoring/truth_surface.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

using geometry::Vec3;
using recording::ActorBox;

constexpr const char* kKeyframeScalar = "keyframe";

fs::path keyframes_file(const MapInputs& map) { return map.map / "keyframes.txt"; }

/// For each point of the map the index of the frame in which it was chosen; nullopt if the map does not say.
std::optional<std::vector<std::size_t>> frames_of_points(const MapInputs& map, const geometry::PointCloud& cloud,
                                                         const std::vector<dataset::Frame>& frames) {
  const auto keyframe = cloud.scalars.find(kKeyframeScalar);
  if (keyframe == cloud.scalars.end() || !fs::is_directory(map.map) || !fs::exists(keyframes_file(map)))
    return std::nullopt;
  const geometry::Trajectory keyframes = geometry::read_tum(keyframes_file(map));
  geometry::Trajectory times;
  for (const dataset::Frame& frame : frames) times.poses.push_back({frame.time_s, geometry::SE3()});
  constexpr double kSameTime_s = 1e-3;
  std::map<std::size_t, std::size_t> frame_of;
  for (const auto& [k, frame] : geometry::associate(keyframes, times, kSameTime_s)) frame_of[k] = frame;
  std::vector<std::size_t> result(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const double k = std::round(static_cast<double>(keyframe->second[i]));
    const auto found = k >= 0.0 && k < 1e9 ? frame_of.find(static_cast<std::size_t>(k)) : frame_of.end();
    if (found == frame_of.end()) {
      throw InputError(keyframes_file(map).string(), "the keyframe of point " + std::to_string(i) + " is no image of " +
                                                         map.dataset.string() +
                                                         "; give the dataset from which the map was made");
    }
    result[i] = found->second;
  }
  return result;
}

bool is_on(const ActorBox& box, const Vec3& point, const metrics::BoxMargins& margins) {
  return metrics::is_on({box.T_local_box, box.size_m}, point, margins);
}

/// Each point against the boxes in the picture in which it was chosen.
void mark_by_keyframe(const MapInputs& map, const std::vector<dataset::Frame>& frames, const std::vector<Vec3>& points,
                      const std::vector<std::size_t>& frame_of, PointsOnActors& found) {
  std::map<std::size_t, std::vector<std::size_t>> points_of;
  for (std::size_t i = 0; i < points.size(); ++i) points_of[frame_of[i]].push_back(i);
  for (const auto& [frame, numbers] : points_of) {
    const std::vector<ActorBox> boxes = recording::read_actor_boxes(map.dataset, frames[frame].id);
    found.actors = std::max(found.actors, boxes.size());
    for (const std::size_t i : numbers) {
      found.is_on[i] =
          std::ranges::any_of(boxes, [&](const ActorBox& box) { return is_on(box, points[i], found.margins); });
    }
  }
}

/// Each point against the boxes of all frames. A box is looked at again only where its actor has moved.
void mark_at_any_time(const MapInputs& map, const std::vector<dataset::Frame>& frames, const std::vector<Vec3>& points,
                      PointsOnActors& found) {
  const geometry::NearestIndex index(points);
  std::map<std::string, ActorBox> last;
  for (const dataset::Frame& frame : frames) {
    for (const ActorBox& box : recording::read_actor_boxes(map.dataset, frame.id)) {
      const auto [known, is_new] = last.try_emplace(box.actor, box);
      if (!is_new && known->second.has_same_place(box)) continue;
      known->second = box;
      const double reach_m = 0.5 * box.size_m.norm() + std::sqrt(3.0) * found.margins.grown_m;
      for (const geometry::Neighbor& near : index.within(box.T_local_box.translation, reach_m))
        if (is_on(box, points[near.index], found.margins)) found.is_on[near.index] = true;
    }
  }
  found.actors = last.size();
}

}  // namespace

std::size_t PointsOnActors::count() const { return static_cast<std::size_t>(std::ranges::count(is_on, true)); }

bool has_actor_boxes(const MapInputs& map) { return !map.dataset.empty() && recording::has_actor_boxes(map.dataset); }

std::optional<PointsOnActors> find_points_on_actors(const MapInputs& map, const geometry::PointCloud& cloud,
                                                    const geometry::Sim3& T_local_map) {
  if (!has_actor_boxes(map)) return std::nullopt;
  const std::vector<dataset::Frame> frames = dataset::read_dataset(map.dataset).frames;
  std::vector<Vec3> points;
  for (const Vec3& p : cloud.positions) points.push_back(T_local_map * p);
  PointsOnActors found{.is_on = std::vector<bool>(cloud.size()), .margins = {}};
  const auto frame_of = frames_of_points(map, cloud, frames);
  found.by_keyframe = frame_of.has_value();
  if (frame_of) {
    mark_by_keyframe(map, frames, points, *frame_of, found);
  } else {
    mark_at_any_time(map, frames, points, found);
  }
  return found;
}

geometry::PointCloud take_points_on_actors(const PointsOnActors& found, const MapInputs& map,
                                           geometry::PointCloud& cloud) {
  std::vector<bool> is_off = found.is_on;
  is_off.flip();
  geometry::PointCloud apart = geometry::filter_points(cloud, found.is_on);
  cloud = geometry::filter_points(cloud, is_off);
  if (cloud.empty())
    throw InputError(map.map.string(), "all of its points are on moving objects; the static place has none to score");
  return apart;
}

ApartPoints measure_apart(geometry::PointCloud apart, const geometry::Sim3& T_published_map,
                          const geometry::Sim3& T_surface_map, const ground_truth::TruthFolder& truth,
                          const place::TruthRegion& region) {
  ApartPoints measured;
  const geometry::PointCloud on_surface = geometry::transformed(T_surface_map, {apart.positions, {}, {}, {}});
  geometry::PointCloud& aligned = measured.errors.aligned_map;
  aligned = geometry::transformed(T_published_map, std::move(apart));
  measured.errors.voxel_m = VoxelCenters(truth).distances(aligned, "points on moving objects");
  if (!truth.has_mesh()) return measured;
  measured.errors.surface_m = TruthSurface(truth).match(on_surface, {}, 0.0).distances_m;
  for (std::size_t i = 0; i < on_surface.size(); ++i) {
    const bool is_over = region.contains_horizontally(on_surface.positions[i]);
    measured.errors.over_region.push_back(is_over);
    if (is_over) measured.over_region_m.push_back(measured.errors.surface_m[i]);
  }
  return measured;
}

metrics::MovingPoints score_apart(const PointsOnActors& found, const ApartPoints& apart, std::vector<double> voxel_m,
                                  std::optional<std::vector<double>> over_region_m, double cutoff_m) {
  std::optional<std::vector<double>> apart_m;
  if (over_region_m) {
    apart_m = apart.over_region_m;
    over_region_m->insert(over_region_m->end(), apart_m->begin(), apart_m->end());
  }
  const std::vector<double>& apart_voxel_m = apart.errors.voxel_m;
  voxel_m.insert(voxel_m.end(), apart_voxel_m.begin(), apart_voxel_m.end());
  return {.objects = found.actors,
          .by_keyframe = found.by_keyframe,
          .margins = found.margins,
          .apart = metrics::score_points(apart_voxel_m, apart_m, cutoff_m),
          .with_them = metrics::score_points(voxel_m, over_region_m, cutoff_m)};
}

void write_apart_points(const fs::path& ply, const ApartPoints& apart, double cutoff_m) {
  if (apart.errors.aligned_map.empty()) {
    fs::remove(ply);
  } else {
    metrics::write_point_errors(ply, apart.errors, cutoff_m);
  }
}

}  // namespace tileflight::scoring
