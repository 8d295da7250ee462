#include <nlohmann/json.hpp>
#include <numbers>

#include "command.h"
#include "number_text.h"
#include "tileflight/slam/external_systems/run_system.h"
#include "tileflight/slam/odometry/track.h"
#include "tileflight/slam/odometry/track_result.h"
#include "warnings_text.h"

namespace tileflight::app {
namespace {

struct OdometryCommandOptions {
  std::string dataset;
  std::string out;
  odometry::TrackOptions track;
  double min_parallax_deg = 0.0;
  bool active_points_only = false;
  bool deterministic = false;
  std::string mode = "mono";
  std::string system;  ///< empty: the built-in odometry, in this process
  jobs::ProcessLimits limits;
  double memory_limit_gb = 0.0;
};

constexpr double kDegreesOfRadian = 180.0 / std::numbers::pi;

void add_extras(CLI::App& command, OdometryCommandOptions& options) {
  odometry::TrackOptions& extras = options.track;
  command.add_option("--camera", extras.camera,
                     "one of a rig's cameras, by its name (default: the first); or a calibration instead of the "
                     "dataset's: Kalibr, OpenCV, COLMAP, DSO or VSLAM-LAB");
  command.add_option("--camera-id", extras.camera_id, "camera to use if the calibration holds several");
  command.add_option("--mask", extras.mask,
                     "image of the frames' size; black pixels are ignored (e.g. the drone's own body)");
  command.add_option("--init-from", extras.init_from,
                     "initialize from known poses (TUM file; map and trajectory are then in their frame and scale) or "
                     "depth (folder of 000000.exr, metres; gives the scale)");
  command.add_flag("--colmap", extras.colmap,
                   "also write keyframes, map and camera as OUT/colmap (COLMAP's text format)");
  command.add_option("--debug-pictures", extras.debug_pictures,
                     "folder for an image of each keyframe with its points, coloured from red (near) to blue (far)");
}

void add_mode_options(CLI::App& command, OdometryCommandOptions& options) {
  command
      .add_option(
          "--mode", options.mode,
          "mono: one camera, scale unknown; inertial: with the dataset's imu.csv, map and path in metres and "
          "level; stereo: with the rig's other cameras, map and path in metres; stereo-inertial: with both, in metres "
          "and level")
      ->capture_default_str();
  command.add_option("--gravity", options.track.gravity_m_s2, "gravity at the place, m/s^2, with an inertial unit")
      ->check(CLI::Range(9.7, 9.9))
      ->capture_default_str();
  command.add_flag("--tight", options.track.odometry.inertial_in_window,
                   "with an inertial unit: its readings are also residuals of the window (no more accurate on the "
                   "example flights, and slower)");
}

void add_map_filters(CLI::App& command, OdometryCommandOptions& options) {
  odometry::MapOptions& map = options.track.odometry.map;
  options.min_parallax_deg = map.min_parallax_rad * kDegreesOfRadian;
  command
      .add_option("--min-observations", map.min_observations,
                  "map: minimum number of keyframes that agree with a point")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      .add_option("--max-deviation", map.max_relative_sigma,
                  "map: maximum standard deviation of a point's inverse distance, relative to it")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      .add_option("--min-parallax", options.min_parallax_deg, "map: minimum angle between the rays of a point, degrees")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_flag("--active-points-only", options.active_points_only,
                   "map: keep only points of the joint optimisation (the most accurate)");
}

/// Options of another system; the built-in odometry's do not apply to it.
void add_system_options(CLI::App& command, OdometryCommandOptions& options) {
  CLI::Option* system =
      command.add_option("--system", options.system,
                         "run another SLAM system: a name of `tileflight systems`, or the folder of an adapter");
  command.add_option("--time-limit", options.limits.seconds, "stop the system after this time, seconds (wall clock)")
      ->check(CLI::PositiveNumber)
      ->needs(system)
      ->group("Other systems");
  command.add_option("--memory-limit", options.memory_limit_gb, "stop the system if it uses more memory, GB")
      ->check(CLI::PositiveNumber)
      ->needs(system)
      ->group("Other systems");
  for (const char* own : {"--from", "--to", "--every", "--reverse", "--camera", "--mask", "--init-from", "--colmap",
                          "--debug-pictures", "--rectify", "--fixed-intrinsics", "--estimate-line-delay",
                          "--loop-closure", "--no-check", "--mode", "--gravity"})
    system->excludes(command.get_option(own));
  system->group("Other systems");
}

Output run_other_system(const OdometryCommandOptions& options, const CommonOptions& shared, const Progress& progress) {
  external_systems::SystemRunOptions run{.seed = options.track.odometry.initialization.seed,
                                         .threads = shared.threads,
                                         .limits = options.limits,
                                         .program = {},
                                         .replace = shared.force};
  run.limits.memory_mb = 1000.0 * options.memory_limit_gb;
  const external_systems::Adapter adapter = external_systems::find_adapter(options.system);
  const nlohmann::json result = external_systems::run_system(adapter, options.dataset, options.out, run, progress);
  const nlohmann::json& system = result["system"];
  if (system["completed"] == false)
    throw std::runtime_error(adapter.title + " on " + options.dataset + ": " + system["reason"].get<std::string>());
  std::ostringstream text;
  text << options.out << ": " << adapter.title << " tracked " << result["frames_tracked"] << " of " << result["frames"]
       << " frames, " << result["points"] << " points, " << rounded(system["seconds"], 3) << " s, "
       << rounded(system["cpu_seconds"], 3) << " s of processor time, " << rounded(system["peak_memory_mb"], 0)
       << " MB\n";
  for (const auto& note : system["notes"]) text << "note: " << note.get<std::string>() << "\n";
  return {result, text.str()};
}

std::string odometry_summary(const nlohmann::json& result, const std::string& out) {
  std::ostringstream text;
  text << out << ": " << result["frames_tracked"] << " of " << result["frames"] << " frames tracked, "
       << result["keyframes"] << " keyframes, " << result["points"] << " points, "
       << rounded(result["frames_per_second"], 3) << " frames per second\n";
  if (result["scale"] == "metric" && result.contains("stereo")) text << "metric by the rig's other cameras\n";
  if (result.contains("inertial") && result["inertial"].contains("sigma_up_deg")) {
    text << "metric and level: scale to " << rounded(100.0 * result["inertial"]["sigma_log_scale"].get<double>(), 2)
         << " % (one sigma), vertical to " << rounded(result["inertial"]["sigma_up_deg"], 3) << " degrees\n";
  }
  text << warnings_text(result);
  return text.str();
}

Output run_built_in(OdometryCommandOptions& options, bool force, const Progress& progress) {
  options.track.mode = odometry::parse_odometry_mode("--mode", options.mode);
  const odometry::TrackResult result = odometry::track(options.dataset, options.out, force, options.track, progress);
  if (result.odometry.frames_tracked == 0)
    throw std::runtime_error(options.dataset + ": " + result.odometry.lost_reason);
  const nlohmann::json about = odometry::to_json(result);
  return {about, odometry_summary(about, options.out)};
}

}  // namespace

void add_odometry(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<OdometryCommandOptions>();
  CLI::App* command =
      app.add_subcommand("odometry", "images in, trajectory and map out: Direct Sparse Odometry, or another system");
  command->footer(
      "Example:\n  tileflight odometry out/stadium/simulated/dataset --out /tmp/odometry\n"
      "  tileflight odometry dataset --system colmap --out /tmp/colmap");
  command->add_option("DATASET", options->dataset, "dataset folder")->required();
  command->add_option("--out", options->out, "folder to write")->required();
  command->add_option("--from", options->track.frames.from, "first frame, by index");
  command->add_option("--to", options->track.frames.to, "end frame, by index (not included)");
  command->add_option("--every", options->track.frames.every, "use every n-th frame")->check(CLI::PositiveNumber);
  add_mode_options(*command, *options);
  command->add_flag("--reverse", options->track.frames.reverse, "process the frames in reverse order");
  add_extras(*command, *options);
  command->add_option("--rectify", options->track.rectify_fov_deg,
                      "rectify the images to a pinhole of this horizontal field of view, "
                      "degrees (for comparison; by default the lens model itself is used)");
  command->add_flag(
      "--fixed-intrinsics{false}", options->track.odometry.window.refine_intrinsics,
      "keep the calibration's focal lengths and principal point (by default they are refined, except with "
      "an inertial unit or a rig)");
  command->add_flag(
      "--estimate-line-delay", options->track.odometry.estimate_line_delay,
      "estimate a rolling shutter's time from row to row, and track again with it if it is more than three "
      "of its standard deviations");
  add_map_filters(*command, *options);
  command
      ->add_option("--seed", options->track.odometry.initialization.seed,
                   "seed of the random samples used for initialization")
      ->capture_default_str();
  command->add_flag("--loop-closure", options->track.odometry.loops.enabled,
                    "close loops: find revisited places and distribute the drift (after the last frame)");
  command->add_flag("--deterministic", options->deterministic,
                    "same result for any number of threads (always the case)");
  command->add_flag(
      "--no-check{false}", options->track.check_reversed,
      "skip the check that also tracks the frames in reverse and compares the two paths (halves the time)");
  add_system_options(*command, *options);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    options->track.odometry.map.min_parallax_rad = options->min_parallax_deg / kDegreesOfRadian;
    options->track.odometry.map.dense = !options->active_points_only;
    selection.run = [options](const CommonOptions& shared, const Progress& progress) {
      return options->system.empty() ? run_built_in(*options, shared.force, progress)
                                     : run_other_system(*options, shared, progress);
    };
  });
}

}  // namespace tileflight::app
