#include "tileflight/experiment/fly.h"

#include <map>
#include <mutex>
#include <numeric>

#include "tileflight/dataset/ingest.h"
#include "tileflight/dataset/video.h"
#include "tileflight/experiment/require_surface.h"
#include "tileflight/experiment/version.h"
#include "tileflight/flight/flight_plan.h"
#include "tileflight/flight/path.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/imaging/photometric.h"
#include "tileflight/scene/scene.h"
#include "tileflight/sensors/fly.h"
#include "tileflight/sensors/gps.h"
#include "tileflight/tiles/open_source.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// One flight, ready to be filmed.
struct Mission {
  imaging::Calibration calibration;
  geometry::Trajectory frames;    ///< a pose for each picture
  sensors::PoseFunction pose_at;  ///< in between, for the shutter
  sensors::FlightOptions options;
};

Mission plan_mission(const RenderSettings& settings) {
  const RenderFlight& flight = settings.flight;
  const flight::FlightPlan plan = flight::read_flight_plan(flight.flight);
  Mission mission;
  mission.calibration = imaging::read_calibration(plan.camera);
  if (flight.width) mission.calibration.camera = mission.calibration.camera.scaled_to(*flight.width, *flight.height);
  mission.frames = flight::frame_poses(plan);
  if (flight.max_frames && mission.frames.size() > static_cast<std::size_t>(*flight.max_frames)) {
    mission.frames.poses.resize(static_cast<std::size_t>(*flight.max_frames));
  }
  const flight::Path path = plan.poses ? flight::path_through_poses(*plan.poses)
                                       : flight::path_through_waypoints(plan.waypoints, plan.limits);
  mission.pose_at = [path](double time_s) { return path.pose(time_s); };
  mission.options.render = {.depth = settings.depth, .samples_per_pixel = flight.samples_per_pixel};
  if (flight.degrade) mission.options.formation = *flight.degrade;
  mission.options.formation.seed = settings.seed;
  mission.calibration.line_delay_s = mission.options.formation.line_delay_s;
  return mission;
}

/// Of every picture, and of where the camera is a whole exposure and readout before and after it.
std::vector<tiles::Eye> eyes_of(const Mission& mission) {
  const sensors::ImageFormation& formation = mission.options.formation;
  const double open_s = formation.exposure_time_s + formation.line_delay_s * mission.calibration.camera.height();
  std::vector<geometry::SE3> poses;
  for (const geometry::StampedPose& pose : mission.frames.poses) {
    poses.push_back(pose.T_local_camera);
    if (open_s > 0.0) {
      for (const double time_s : {pose.time_s - open_s, pose.time_s + open_s}) poses.push_back(mission.pose_at(time_s));
    }
  }
  return tiles::eyes_along(mission.calibration.camera, poses);
}

/// What a receiver would have said along the path, where the place is on the earth.
std::vector<dataset::GpsFix> simulated_gps(const Mission& mission, const std::optional<geometry::LocalFrame>& frame,
                                           std::uint64_t seed) {
  if (!frame || mission.frames.size() < 2) return {};
  std::vector<dataset::GpsFix> fixes;
  for (const sensors::PositionFix& fix : sensors::simulate_gnss(mission.frames, {.seed = seed})) {
    fixes.push_back(
        {fix.time_s, frame->geodetic_from_local(fix.position), fix.horizontal_sigma_m, fix.vertical_sigma_m});
  }
  return fixes;
}

std::string joined(const std::vector<std::string>& lines) {
  return std::accumulate(lines.begin(), lines.end(), std::string(), [](std::string text, const std::string& line) {
    return text + (text.empty() ? "" : "; ") + line;
  });
}

std::map<std::string, std::string> description(const RenderSettings& settings, const tiles::LoadedTiles& tiles) {
  return {{"made_by", "tileflight render " + version()},
          {"source", tiles::shown_source(settings.source)},
          {"flight", settings.flight.flight.string()},
          {"seed", std::to_string(settings.seed)},
          {"cut_sha256", tiles.cut_hash},
          {"tiles", std::to_string(tiles.tiles_loaded)},
          {"attribution", joined(tiles.attribution)},
          {"terms_provider", tiles.terms.provider},
          {"terms_accepted", settings.load.source.terms_accepted ? "true" : "false"}};
}

/// Frames come from several threads in any order; a video wants them one after the other.
class InOrder {
 public:
  explicit InOrder(std::function<void(const imaging::RgbImage&)> take) : take_(std::move(take)) {}

  void add(std::size_t index, const imaging::RgbImage& image) {
    const std::lock_guard lock(mutex_);
    waiting_.emplace(index, image);
    for (auto next = waiting_.find(next_); next != waiting_.end(); next = waiting_.find(next_)) {
      take_(next->second);
      waiting_.erase(next);
      ++next_;
    }
  }

 private:
  std::function<void(const imaging::RgbImage&)> take_;
  std::mutex mutex_;
  std::map<std::size_t, imaging::RgbImage> waiting_;
  std::size_t next_ = 0;
};

sensors::FlightReport film_to_dataset(const scene::Scene& scene, const Mission& mission, const RenderSettings& settings,
                                      const tiles::LoadedTiles& tiles, const fs::path& out, bool replace,
                                      const Progress& progress) {
  dataset::DatasetWriter writer(out, mission.calibration,
                                {.replace = replace, .depth = settings.depth, .png = settings.png});
  const sensors::FlightReport report = sensors::render_flight(
      scene, mission.calibration.camera, mission.frames, mission.pose_at, mission.options,
      [&](std::size_t index, double time_s, double exposure_ms, const imaging::RgbImage& rgb,
          const imaging::FloatImage* depth) { writer.add_frame(index, time_s, exposure_ms, rgb, depth); },
      progress);
  writer.set_groundtruth(mission.frames);
  const std::vector<dataset::GpsFix> gps = simulated_gps(mission, tiles.local_frame, settings.seed);
  if (!gps.empty()) writer.set_gps(gps);
  for (const auto& [key, value] : description(settings, tiles)) writer.describe(key, value);
  writer.finish();
  return report;
}

double frame_rate(const geometry::Trajectory& frames) {
  if (frames.size() < 2) return 30.0;
  return (static_cast<double>(frames.size()) - 1.0) / (frames.poses.back().time_s - frames.poses.front().time_s);
}

/// The video's clock starts with its first picture.
geometry::Trajectory on_video_clock(geometry::Trajectory frames) {
  const double start_s = frames.poses.front().time_s;
  for (geometry::StampedPose& pose : frames.poses) pose.time_s -= start_s;
  return frames;
}

/// Through a video file and back, as a camera that records does: the pictures of the dataset are the decoded ones.
sensors::FlightReport film_to_video(const scene::Scene& scene, Mission mission, const RenderSettings& settings,
                                    const tiles::LoadedTiles& tiles, const fs::path& out, bool replace,
                                    const Progress& progress) {
  const fs::path folder = out.string() + ".video";
  sensors::FlightReport report;
  geometry::write_folder(folder, true, [&](const fs::path& temporary) {
    const imaging::Camera& camera = mission.calibration.camera;
    dataset::VideoWriter video(temporary / "video.mp4", camera.width(), camera.height(),
                               {.frames_per_second = frame_rate(mission.frames), .crf = *settings.flight.video_crf});
    InOrder in_order([&](const imaging::RgbImage& image) { video.add(image); });
    report = sensors::render_flight(
        scene, camera, mission.frames, mission.pose_at, mission.options,
        [&](std::size_t index, double, double, const imaging::RgbImage& rgb, const imaging::FloatImage*) {
          in_order.add(index, rgb);
        },
        progress);
    video.finish();
    imaging::write_kalibr(temporary / "camera.yaml", mission.calibration);
    mission.frames = on_video_clock(mission.frames);
    geometry::write_tum(temporary / "groundtruth.txt", mission.frames);
  });
  dataset::ingest({.video_or_images = folder / "video.mp4",
                   .calibration = folder / "camera.yaml",
                   .gps = simulated_gps(mission, tiles.local_frame, settings.seed),
                   .groundtruth = folder / "groundtruth.txt",
                   .replace = replace,
                   .description = description(settings, tiles)},
                  out, progress);
  fs::remove_all(folder);
  return report;
}

}  // namespace

nlohmann::json render_dataset(const RenderSettings& settings, const fs::path& out, bool replace,
                              const Progress& progress) {
  const Mission mission = plan_mission(settings);
  tiles::LoadOptions load = settings.load;
  load.uses = {tiles::Use::kAnalyse};
  if (settings.error_px) load.flight = {eyes_of(mission), *settings.error_px};
  const tiles::LoadedTiles tiles = tiles::load_region(settings.source, load, progress);
  require_surface(tiles.meshes, tiles.points > 0, tiles::shown_source(settings.source));
  const scene::Scene scene(tiles.meshes);
  const sensors::FlightReport report = settings.flight.video_crf
                                           ? film_to_video(scene, mission, settings, tiles, out, replace, progress)
                                           : film_to_dataset(scene, mission, settings, tiles, out, replace, progress);
  std::vector<std::string> warnings = report.warnings;
  warnings.insert(warnings.end(), tiles.warnings.begin(), tiles.warnings.end());
  return {{"frames", report.frames},
          {"seconds", report.seconds},
          {"frames_per_second", report.frames_per_second},
          {"tiles", tiles.tiles_loaded},
          {"complete", tiles.complete},
          {"triangles", tiles.triangles},
          {"path_length", geometry::path_length_m(mission.frames)},
          {"warnings", warnings}};
}

}  // namespace tileflight::experiment
