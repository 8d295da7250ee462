#include "tileflight/capture/preview/pixel_counts.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "tileflight/capture/recording/flight_cameras.h"
#include "tileflight/capture/recording/flown_path.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::preview {

FrameSampling sample_frames(const CoverageSettings& settings) {
  vehicle::FlightPlan plan = vehicle::read_flight_plan(settings.flight);
  recording::place_mission(plan, settings.source, settings.load, {});
  recording::RenderedFlightConfig flight;
  flight.flight = settings.flight;
  const recording::MountedCamera camera = recording::read_flight_cameras(flight).front();  // of a rig, the first
  FrameSampling watch{camera.calibration.camera, vehicle::frame_poses(plan), {}, plan.notes};
  if (missions::is_mission_file(settings.flight)) base::add_distinct(camera.calibration.notes, watch.notes);
  for (geometry::StampedPose& pose : watch.trajectory.poses)
    pose.T_local_camera = pose.T_local_camera * camera.T_body_camera;
  const std::size_t all = watch.trajectory.size();
  if (all == 0) throw InputError(settings.flight.string(), "has no frames");
  const std::size_t count = std::min<std::size_t>(all, static_cast<std::size_t>(settings.frames));
  for (std::size_t i = 0; i < count; ++i)
    watch.frames.push_back(count == 1 ? 0 : (i * (all - 1) + (count - 1) / 2) / (count - 1));
  return watch;
}

imaging::Camera scale_to_width(const imaging::Camera& camera, int width) {
  if (width >= camera.width()) return camera;
  const double scale = static_cast<double>(width) / camera.width();
  return camera.scaled_to(width, std::max(1, static_cast<int>(std::lround(scale * camera.height()))));
}

namespace {

enum class PixelQuality { kRight, kCoarser, kMissing };

PixelQuality classify_pixel(const PixelHit& pixel, const std::vector<Substitute>& substitutes,
                            const std::vector<bool>& node_in_memory, double pixels_per_rad, double error_px) {
  for (const Substitute& substitute : substitutes) {
    if (!node_in_memory[substitute.node]) continue;
    const bool own = substitute.node == substitutes.front().node;
    const bool fine = substitute.geometric_error_m * pixels_per_rad <= error_px * pixel.distance_m;
    return own || fine ? PixelQuality::kRight : PixelQuality::kCoarser;
  }
  return PixelQuality::kMissing;
}

}  // namespace

std::vector<std::optional<geometry::Vec3>> pixel_rays(const imaging::Camera& camera) {
  std::vector<std::optional<geometry::Vec3>> rays;
  for (int y = 0; y < camera.height(); ++y) {
    for (int x = 0; x < camera.width(); ++x)
      rays.push_back(camera.unproject({static_cast<double>(x), static_cast<double>(y)}));
  }
  return rays;
}

void trace_pixels(const scene::Scene& part, const std::vector<std::uint32_t>& content_of_mesh,
                  const std::vector<std::optional<geometry::Vec3>>& rays, const geometry::SE3& T_local_camera,
                  std::vector<PixelHit>& nearest) {
  constexpr double kNowhere_m = 1e9;
  nearest.resize(rays.size());
  tbb::parallel_for(std::size_t{0}, rays.size(), [&](std::size_t i) {
    if (!rays[i]) return;
    PixelHit& known = nearest[i];
    const bool is_hit = known.content != PixelHit::kNoContent;
    // The tree's distances are floats: a surface as far away as the known one must still be found.
    const double farthest_m = is_hit ? known.distance_m * (1.0 + 1e-5) + 1e-3 : kNowhere_m;
    const auto hit = part.intersect({T_local_camera.translation, T_local_camera.rotation * *rays[i]}, farthest_m);
    if (!hit) return;
    const PixelHit found{content_of_mesh[hit->mesh], hit->distance_m};
    if (!is_hit || std::tie(found.distance_m, found.content) < std::tie(known.distance_m, known.content)) known = found;
  });
}

std::vector<Substitute> find_substitutes(const tileset::TilesetTree& tree, const tileset::CutContent& content) {
  std::vector<Substitute> substitutes{{content.node, tree.geometric_error_m(content.node)}};
  for (auto above = tree.node(content.node).parent; above; above = tree.node(*above).parent) {
    if (tree.node(*above).refine == tileset::Refine::kAdd) break;
    substitutes.push_back({*above, tree.geometric_error_m(*above)});
  }
  return substitutes;
}

PixelCounts count_pixels(const std::vector<PixelHit>& frame, const std::vector<std::vector<Substitute>>& substitutes,
                         const std::vector<bool>& node_in_memory, double pixels_per_rad, double error_px) {
  PixelCounts shares;
  for (const PixelHit& pixel : frame) {
    if (pixel.content == PixelHit::kNoContent) continue;
    ++shares.pixels;
    switch (classify_pixel(pixel, substitutes[pixel.content], node_in_memory, pixels_per_rad, error_px)) {
      case PixelQuality::kRight:
        ++shares.right;
        break;
      case PixelQuality::kCoarser:
        ++shares.coarser;
        break;
      case PixelQuality::kMissing:
        ++shares.missing;
        break;
    }
  }
  return shares;
}

}  // namespace tileflight::preview
