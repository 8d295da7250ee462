#include "tileflight/capture/recording/dataset_metadata.h"

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/capture/recording/flight_faults.h"
#include "tileflight/capture/sensors/gnss.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/core/imaging/photometric.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::recording {
namespace fs = std::filesystem;
namespace {

/// Simulated receiver positions along the path, if the place is georeferenced.
std::vector<dataset::GpsFix> simulate_gps(const PlannedFlight& mission,
                                          const std::optional<geometry::LocalFrame>& frame, std::uint64_t seed) {
  if (!frame || mission.body.size() < 2) return {};
  std::vector<dataset::GpsFix> fixes;
  const sensors::GnssOptions options =
      mission.sensor_recorder->suite().gnss.value_or(sensors::GnssOptions{.seed = seed});
  for (const sensors::GnssFix& fix : sensors::simulate_gnss(mission.body, options)) {
    fixes.push_back(
        {fix.time_s, frame->geodetic_from_local(fix.position), fix.horizontal_sigma_m, fix.vertical_sigma_m});
  }
  return fixes;
}

/// Simulated gimbal measurements of the first camera's attitude, if the place is georeferenced.
std::vector<dataset::CameraAttitude> simulate_camera_attitude(const PlannedFlight& mission,
                                                              const std::optional<geometry::LocalFrame>& frame,
                                                              std::uint64_t seed) {
  if (!frame || mission.frames.size() < 2) return {};
  const sensors::AttitudeOptions options =
      mission.sensor_recorder->suite().attitude.value_or(sensors::AttitudeOptions{.seed = seed});
  const auto times = flight_path::make_sample_times("attitude", mission.frames.poses.front().time_s,
                                                    mission.frames.poses.back().time_s, options.rate_hz);
  const auto pose_at = [&](double time_s) { return *geometry::interpolate(mission.frames, time_s); };
  std::vector<dataset::CameraAttitude> attitudes;
  for (const sensors::AttitudeSample& sample : sensors::simulate_attitude(pose_at, times, options))
    attitudes.push_back(
        {sample.time_s, sample.R_local_camera, sensors::tilt_sigma_deg(options), sensors::yaw_sigma_deg(options)});
  return attitudes;
}

std::map<std::string, std::string> description(const RenderSettings& settings, const tileset::LoadedTiles& tiles) {
  return {{"made_by", "tileflight render " + base::version()},
          {"source", fetch::redact_source(settings.source)},
          {"flight", settings.flight.flight.string()},
          {"seed", std::to_string(settings.seed)},
          {"cut_sha256", tiles.cut_hash},
          {"tiles", std::to_string(tiles.cut_size - tiles.tiles_failed)},
          {"attribution", base::joined(tiles.attribution, "; ")},
          {"terms_provider", tiles.terms.provider},
          {"terms_accepted", settings.load.source.terms_accepted ? "true" : "false"}};
}

/// Writes the inverse of the camera's response, and its vignetting.
void write_photometric(const PlannedCamera& planned, const fs::path& folder) {
  const imaging::Camera& camera = planned.calibration.camera;
  const imaging::PhotometricCalibration calibration =
      render::photometric_calibration(planned.options.formation, camera.width(), camera.height());
  imaging::write_pcalib(folder / "pcalib.txt", calibration.inverse_response);
  if (!calibration.vignette.empty()) imaging::write_vignette(folder / "vignette.png", calibration.vignette);
}

/// The names of a rig's cameras; none if the flight has a `camera`.
std::vector<std::string> camera_names(const PlannedFlight& mission) {
  std::vector<std::string> names;
  for (std::size_t c = 0; c < mission.camera_count() && !mission.name.empty(); ++c)
    names.push_back(mission.camera(c).name);
  return names;
}

void write_rig(const PlannedFlight& mission, const fs::path& folder) {
  std::vector<imaging::ChainCamera> chain;
  for (std::size_t c = 0; c < mission.camera_count(); ++c) {
    const PlannedCamera& camera = mission.camera(c);
    chain.push_back(
        {camera.name, camera_folder(mission, c), camera.calibration, camera.T_body_camera, camera.timeshift_s});
  }
  imaging::write_camchain(folder / "camchain.yaml", chain);
}

}  // namespace

fs::path camera_folder(const PlannedFlight& mission, std::size_t camera) {
  return camera == 0 ? fs::path(".") : fs::path("cameras") / mission.camera(camera).name;
}

void write_camera_metadata(dataset::DatasetWriter& writer, const PlannedFlight& mission, std::size_t number,
                           const RenderSettings& settings, const RenderSummary& summary,
                           const std::vector<FrameRecord>& frames) {
  const PlannedCamera& camera = mission.camera(number);
  if (settings.flight.outputs.photometric) write_photometric(camera, writer.temporary_folder());
  writer.set_groundtruth(camera.frames);
  for (const auto& [key, value] : description(settings, summary.tiles)) writer.describe(key, value);
  const std::optional<geometry::LocalFrame>& frame = summary.tiles.local_frame;
  for (const auto& [key, value] : place::describe_frame(frame ? std::optional(frame->origin()) : std::nullopt))
    writer.describe(key, value);
  const auto faults = render::find_flight_faults(frame_checks(frames), 0, camera.options.clearance_m);
  for (const auto& [key, value] : faults_to_metadata(faults)) writer.describe(key, value);
  for (const auto& [key, value] : faults_to_metadata(find_actor_faults(mission, number))) writer.describe(key, value);
  if (const auto& light = camera.options.formation.light)
    writer.describe("light", describe_sun_position(make_daylight(*light, summary.tiles.local_frame->origin())->sun()));
  if (const auto& weather = camera.options.render.weather) writer.describe("weather", describe_weather(*weather));
  const std::vector<std::string> names = camera_names(mission);
  if (names.empty()) return;
  writer.describe("camera", camera.name);
  writer.describe("cameras", base::joined(names));
}

void write_flight_metadata(dataset::DatasetWriter& writer, const PlannedFlight& mission, const RenderSettings& settings,
                           const RenderSummary& summary) {
  const std::vector<dataset::GpsFix> gps = simulate_gps(mission, summary.tiles.local_frame, settings.seed);
  if (!gps.empty()) writer.set_gps(gps);
  const auto attitudes = simulate_camera_attitude(mission, summary.tiles.local_frame, settings.seed);
  if (!attitudes.empty()) dataset::write_attitude_csv(writer.temporary_folder() / "attitude.csv", attitudes);
  mission.sensor_recorder->write(summary.tiles.local_frame, mission.body.poses.front().time_s,
                                 writer.temporary_folder());
  for (const auto& [key, value] : mission.sensor_recorder->description()) writer.describe(key, value);
  if (!mission.name.empty()) write_rig(mission, writer.temporary_folder());
  if (!mission.vehicle.is_null()) {
    base::write_file(writer.temporary_folder() / "vehicle.json", mission.vehicle.dump(2) + "\n");
  }
}

}  // namespace tileflight::recording
