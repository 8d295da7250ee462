#include "tileflight/survey/track.h"

#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/output_folder.h"
#include "tileflight/base/shell_word.h"
#include "tileflight/dataset/colmap.h"
#include "tileflight/dataset/dataset.h"
#include "tileflight/evaluation/doubts_json.h"
#include "tileflight/geometry/cloud_files.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/imaging/photometric.h"
#include "tileflight/imaging/rectify.h"
#include "tileflight/odometry/debug_image.h"
#include "tileflight/odometry/run_comparison.h"
#include "tileflight/odometry/tracking_doubts.h"
#include "tileflight/survey/track_inputs.h"

namespace tileflight::survey {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// How the images are used: unchanged, or rectified.
struct TrackingCamera {
  imaging::Camera native;
  imaging::Calibration calibration;  ///< of the images as tracked
  std::optional<imaging::Rectifier> rectifier;
};

TrackingCamera make_tracking_camera(const imaging::Calibration& calibration, std::optional<double> rectify_fov_deg) {
  TrackingCamera view{calibration.camera, calibration, std::nullopt};
  if (!rectify_fov_deg) return view;
  view.calibration.camera = imaging::make_pinhole(view.native.width(), view.native.height(), *rectify_fov_deg);
  view.calibration.line_delay_s = 0.0;  // a rectified image's rows are not the sensor's
  view.rectifier.emplace(view.native, view.calibration.camera);
  return view;
}

void require_size(const fs::path& file, int width, int height, const imaging::Camera& camera) {
  if (width == camera.width() && height == camera.height()) return;
  throw InputError(file.string(), "is " + std::to_string(width) + "x" + std::to_string(height) +
                                      ", the calibration is for " + std::to_string(camera.width()) + "x" +
                                      std::to_string(camera.height()) +
                                      "; use images and a calibration of the same size");
}

/// The frames of the range. In reverse order, times are relative to the last frame, because odometry needs increasing
/// times.
std::vector<dataset::Frame> select_frames(const dataset::Dataset& data, const FrameRange& range) {
  const std::size_t end = std::min(range.to.value_or(data.frames.size()), data.frames.size());
  if (range.from >= end) {
    throw InputError(data.folder.string(), "no frames from " + std::to_string(range.from) + " to " +
                                               std::to_string(end) + " (the dataset has " +
                                               std::to_string(data.frames.size()) + ")");
  }
  std::vector<dataset::Frame> frames;
  for (std::size_t i = range.from; i < end; i += range.every) frames.push_back(data.frames[i]);
  if (range.reverse) std::reverse(frames.begin(), frames.end());
  return frames;
}

/// Images that could not be decoded.
struct SkippedImages {
  std::int64_t frames = 0;
  std::string first_reason;
};

struct SkippedFrames : SkippedImages {
  SkippedImages of_others;  ///< of a rig's other cameras
};

/// nullopt if the file is broken or missing, which is counted.
std::optional<imaging::RgbImage> read_or_skip(const dataset::Frame& frame, SkippedImages& skipped) {
  try {
    return imaging::read_rgb(frame.image);
  } catch (const InputError& error) {
    if (skipped.frames++ == 0) skipped.first_reason = error.what();
    return std::nullopt;
  }
}

/// What the other cameras took at a frame's instant.
std::vector<odometry::OtherImage> read_others(const StereoRig* rig, const dataset::Frame& frame,
                                              SkippedFrames& skipped) {
  std::vector<odometry::OtherImage> others;
  if (rig == nullptr) return others;
  const auto taken = rig->other_frames.find(frame.time_s);
  if (taken == rig->other_frames.end()) return others;
  for (const std::optional<dataset::Frame>& other : taken->second) {
    others.emplace_back();
    if (!other) continue;
    others.back().image = read_or_skip(*other, skipped.of_others).value_or(imaging::RgbImage());
    others.back().exposure_ms = other->exposure_ms;
  }
  return others;
}

/// Reads the chosen images one by one. Times are negated in reverse order; reverse_times() restores them.
/// `rig`: whose other cameras' images are read, too; null: none.
odometry::FrameSource make_frame_source(const std::vector<dataset::Frame>& frames, bool reverse,
                                        const TrackingCamera& view, const StereoRig* rig, SkippedFrames& skipped) {
  return [&, rig, reverse, at = std::size_t{0}]() mutable -> std::optional<odometry::InputFrame> {
    for (; at < frames.size(); ++at) {
      const dataset::Frame& frame = frames[at];
      auto image = read_or_skip(frame, skipped);
      if (!image) continue;
      require_size(frame.image, image->width, image->height, view.native);
      return odometry::InputFrame{.index = static_cast<std::int64_t>(at++),
                                  .time_s = reverse ? -frame.time_s : frame.time_s,
                                  .exposure_ms = frame.exposure_ms,
                                  .image = view.rectifier ? (*view.rectifier)(*image) : std::move(*image),
                                  .others = read_others(rig, frame, skipped)};
    }
    return std::nullopt;
  };
}

void reverse_times(geometry::Trajectory& trajectory) {
  for (geometry::StampedPose& pose : trajectory.poses) pose.time_s = -pose.time_s;
  std::reverse(trajectory.poses.begin(), trajectory.poses.end());
}

std::optional<imaging::PhotometricCalibration> read_photometric_calibration(const dataset::Dataset& data,
                                                                            const TrackingCamera& view) {
  if (data.pcalib.empty() && data.vignette.empty()) return std::nullopt;
  imaging::PhotometricCalibration photometric = imaging::read_photometric(data.pcalib, data.vignette);
  if (photometric.vignette.empty()) return photometric;
  require_size(data.vignette, photometric.vignette.width, photometric.vignette.height, view.native);
  if (!view.rectifier) return photometric;
  photometric.vignette = (*view.rectifier)(photometric.vignette);
  // Outside the lens's image circle the images are black, whatever they are divided by.
  for (float& value : photometric.vignette.pixels) value = value > 0.0F ? value : 1.0F;
  return photometric;
}

odometry::Priors make_priors(const TrackOptions& extras, const std::vector<dataset::Frame>& frames, bool reverse,
                             const TrackingCamera& view) {
  odometry::Priors aids;
  if (!extras.mask.empty()) {
    aids.mask = imaging::read_gray(extras.mask);
    require_size(extras.mask, aids.mask.width, aids.mask.height, view.native);
    if (view.rectifier) aids.mask = (*view.rectifier)(aids.mask);
  }
  if (extras.init_from.empty()) return aids;
  if (!fs::is_directory(extras.init_from)) {
    aids.poses = geometry::read_tum(extras.init_from);
    if (aids.poses.empty()) throw InputError(extras.init_from.string(), "has no poses to initialize from");
    if (reverse) reverse_times(aids.poses);
    return aids;
  }
  aids.depth_m = [&frames, &view, folder = extras.init_from](std::int64_t index) -> std::optional<imaging::FloatImage> {
    const fs::path file = folder / (frames[static_cast<std::size_t>(index)].id + ".exr");
    if (!fs::exists(file)) return std::nullopt;
    const imaging::FloatImage depth_m = imaging::read_exr(file);
    require_size(file, depth_m.width, depth_m.height, view.native);
    return view.rectifier ? (*view.rectifier)(depth_m) : depth_m;
  };
  return aids;
}

odometry::KeyframeObserver make_debug_observer(const fs::path& folder, const std::vector<dataset::Frame>& frames) {
  if (folder.empty()) return {};
  fs::create_directories(folder);
  return [folder, &frames](const odometry::KeyframeView& keyframe) {
    const std::string& id = frames[static_cast<std::size_t>(keyframe.index)].id;
    imaging::write_rgb(folder / (id + ".png"), odometry::draw_debug_image(keyframe));
  };
}

/// Keyframes and map as a COLMAP model.
dataset::ColmapModel colmap_model(const imaging::Camera& camera, const odometry::OdometryResult& result,
                                  const std::vector<dataset::Frame>& frames) {
  dataset::ColmapModel model;
  model.camera = camera;
  for (std::size_t k = 0; k < result.keyframe_frame_indices.size(); ++k) {
    const dataset::Frame& frame = frames[static_cast<std::size_t>(result.keyframe_frame_indices[k])];
    model.images.push_back({frame.image.filename().string(), result.keyframes.poses[k].T_local_camera});
  }
  for (std::size_t i = 0; i < result.map.size(); ++i)
    model.points.push_back({result.map.positions[i], result.map.colors[i], result.map_point_keyframes[i]});
  return model;
}

/// The calibration with the row delay for the order of play.
imaging::Calibration playback_calibration(imaging::Calibration calibration, bool reverse) {
  if (reverse) calibration.line_delay_s = -calibration.line_delay_s;
  return calibration;
}

/// Warns that rectification conflicts with a rolling shutter.
std::vector<std::string> add_rectification_warning(std::vector<std::string> warnings,
                                                   const imaging::Calibration& native, const TrackingCamera& view) {
  if (view.rectifier && native.line_delay_s > 0.0)
    warnings.push_back("the rolling shutter is not corrected: rectified images no longer have a time for each row");
  return warnings;
}

json describe_loops(const std::vector<odometry::LoopClosure>& found, const std::vector<dataset::Frame>& frames) {
  json loops = json::array();
  for (const odometry::LoopClosure& loop : found) {
    loops.push_back({{"from", frames[static_cast<std::size_t>(loop.from_frame)].id},
                     {"to", frames[static_cast<std::size_t>(loop.to_frame)].id},
                     {"scale_change", loop.scale_change},
                     {"inliers", loop.inliers}});
  }
  return loops;
}

/// Focal lengths and principal point, pixels.
json intrinsics_json(const imaging::Camera& camera, bool estimated) {
  return std::visit(
      [estimated](const auto& model) {
        return json{{"fx", model.fx}, {"fy", model.fy}, {"cx", model.cx}, {"cy", model.cy}, {"estimated", estimated}};
      },
      camera.model());
}

/// One line per given image, in time order.
std::string quality_csv(std::vector<odometry::FrameQuality> quality, const std::vector<dataset::Frame>& frames,
                        bool reverse) {
  if (reverse) std::reverse(quality.begin(), quality.end());
  std::ostringstream table;
  table << std::setprecision(6)
        << "frame,time_s,tracked,keyframe,rmse,inside_share,saturated_share,known_points,step,"
           "sigma_position,sigma_rotation_rad,sigma_log_scale\n";
  for (const odometry::FrameQuality& q : quality) {
    const dataset::Frame& frame = frames[static_cast<std::size_t>(q.frame)];
    table << frame.id << ',' << std::setprecision(17) << frame.time_s << std::setprecision(6) << ',' << q.tracked << ','
          << q.is_keyframe << ',' << q.rmse << ',' << q.inside_share << ',' << q.saturated_share << ','
          << q.known_points << ',' << q.distance_to_keyframe << ',' << q.sigma_position << ',' << q.sigma_rotation_rad
          << ',' << q.sigma_log_scale << '\n';
  }
  return table.str();
}

json describe(const odometry::OdometryResult& result, const SkippedFrames& skipped, std::vector<std::string> warnings) {
  if (skipped.frames > 0) {
    warnings.push_back(std::to_string(skipped.frames) +
                       " images could not be decoded and were left out; the first: " + skipped.first_reason);
  }
  if (skipped.of_others.frames > 0) {
    warnings.push_back(std::to_string(skipped.of_others.frames) +
                       " images of the other cameras could not be decoded and were left out; the first: " +
                       skipped.of_others.first_reason);
  }
  if (const std::int64_t without_pose = result.frames_before_start - result.frames_tracked_backwards; without_pose > 0)
    warnings.push_back(std::to_string(without_pose) + " of " + std::to_string(result.frames_before_start) +
                       " images before the start have no pose: they do not align with the map when tracked backwards, "
                       "or are more than are kept");
  return {
      {"frames", result.frames},
      {"frames_tracked", result.frames_tracked},
      {"frames_before_start", result.frames_before_start},
      {"frames_tracked_backwards", result.frames_tracked_backwards},
      {"frames_skipped", skipped.frames},
      {"warnings", warnings},
      {"lost", result.lost},
      {"lost_reason", result.lost_reason},
      {"keyframes", result.keyframes.size()},
      {"points", result.map.size()},
      {"seconds", result.wall_time_s},
      {"frames_per_second", result.wall_time_s > 0 ? static_cast<double>(result.frames) / result.wall_time_s : 0.0}};
}

/// Mode, and whether lengths are in metres; what the rig's other cameras showed, as `stereo`; with an inertial unit
/// what it showed, as `inertial` and inertial.csv.
void describe_scale(OdometryMode mode, const odometry::OdometryResult& result, const fs::path& folder, Doubts& doubts,
                    json& about) {
  const bool is_metric = result.inertial && result.inertial->metric;
  const bool is_metric_by_stereo = result.stereo && result.stereo->metric;
  about["mode"] = to_string(mode);
  about["scale"] = is_metric || is_metric_by_stereo ? "metric" : "unknown";
  if (result.stereo) about["stereo"] = stereo_json(*result.stereo);
  if (!result.inertial) return;
  about["inertial"] = inertial_json(*result.inertial, result.coupled_since_s);
  doubts.insert(doubts.end(), result.inertial->doubts.begin(), result.inertial->doubts.end());
  if (is_metric) base::write_file(folder / "inertial.csv", inertial_csv(*result.inertial, result.keyframes));
}

void require_one_scale(const TrackOptions& extras) {
  if (extras.inertial_in_window && !uses_inertial_unit(extras.mode))
    throw InputError("--tight", "puts an inertial unit's readings into the window, which --mode " +
                                    to_string(extras.mode) + " does not use; use it with inertial or stereo-inertial");
  if (extras.mode != OdometryMode::kMono && !extras.init_from.empty())
    throw InputError("--init-from",
                     "and --mode " + to_string(extras.mode) + " both decide on frame and scale; use one of them");
}

std::string shell_path(const fs::path& path) { return base::shell_word(fs::absolute(path).string()); }

std::string replace_placeholder(std::string command, const std::string& name, const std::string& value) {
  for (std::size_t at = command.find(name); at != std::string::npos; at = command.find(name, at + value.size())) {
    command.replace(at, name.size(), value);
  }
  return command;
}

void run_command(const std::string& command, const fs::path& folder, const fs::path& log) {
  const std::string whole =
      "cd " + shell_path(folder) + " && ( " + command + "\n) > " + shell_path(log) + " 2>&1 < /dev/null";
  const int status = std::system(whole.c_str());
  if (status == 0) return;
  const std::string how =
      WIFEXITED(status) ? "exit status " + std::to_string(WEXITSTATUS(status)) : "killed by a signal";
  std::string last_line;
  std::ifstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) last_line = line;
  }
  throw InputError("odometry.command", how + ": " + last_line);
}

json describe_command_result(const fs::path& out, std::size_t frames) {
  const geometry::Trajectory trajectory = geometry::read_tum(out / "trajectory.txt");
  const geometry::PointCloud map = geometry::read_cloud(out / "map.ply");
  return {
      {"frames", frames},           {"frames_tracked", trajectory.size()},
      {"lost", trajectory.empty()}, {"lost_reason", trajectory.empty() ? "the external program tracked no frame" : ""},
      {"keyframes", nullptr},       {"points", map.size()},
      {"seconds", nullptr},         {"frames_per_second", nullptr}};
}

base::OutputFolder odometry_output_folder(const fs::path& out, bool replace, std::vector<fs::path> inputs) {
  return {
      .folder = out,
      .command = "odometry",
      .replace = replace,
      .inputs = std::move(inputs),
      .legacy = {.key_file = "odometry.json",
                 .key_text = "frames_tracked",
                 .files = {"trajectory.txt", "keyframes.txt", "map.ply", "quality.csv", "camera.yaml", "odometry.json",
                           "command.log", "colmap/cameras.txt", "colmap/images.txt", "colmap/points3D.txt"}}};
}

/// Calls `work` with the folder for debug images while `out` is built in `temporary`: below it if the images are to be
/// inside `out`, else a separate folder, which is moved to its place afterwards; empty if no images are wanted.
void with_pictures_folder(const fs::path& pictures, const base::OutputFolder& out, const fs::path& temporary,
                          const std::function<void(const fs::path& folder)>& work) {
  if (pictures.empty()) return work({});
  const fs::path inside = base::resolve_folder(pictures).lexically_relative(base::resolve_folder(out.folder));
  if (!inside.empty() && *inside.begin() != "..") return work(temporary / inside);
  const base::OutputFolder folder{.folder = pictures,
                                  .command = "odometry",
                                  .replace = out.replace,
                                  .inputs = out.inputs,
                                  .legacy = {.files = {"######.png"}}};
  base::write_folder(folder, work);
}

/// Removes the images of a run that was discarded.
void remove_files(const fs::path& folder) {
  if (folder.empty() || !fs::is_directory(folder)) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) fs::remove(entry.path());
}

/// Tracks one dataset's images in either direction.
class DatasetTracker {
 public:
  /// `readings`: of the dataset's inertial unit, if the mode uses it. `rig`: whose other cameras are used, too; null:
  /// none.
  DatasetTracker(const dataset::Dataset& data, const TrackingCamera& view, const odometry::OdometryOptions& options,
                 FrameRange range, const TrackOptions& extras, std::optional<inertial::InertialInput> readings,
                 const StereoRig* rig)
      : view_(view),
        options_(options),
        extras_(extras),
        photometric_(read_photometric_calibration(data, view)),
        readings_(std::move(readings)),
        rig_(rig),
        reverse_(range.reverse) {
    for (const bool reverse : {false, true}) {
      range.reverse = reverse;
      frames_[reverse] = select_frames(data, range);
    }
    priors_ = make_priors(extras, frames_[reverse_], reverse_, view);
    give_readings();
  }
  DatasetTracker(const DatasetTracker&) = delete;  // depth priors refer to the frames
  DatasetTracker& operator=(const DatasetTracker&) = delete;

  const std::vector<dataset::Frame>& frames(bool reverse) const { return frames_[reverse]; }
  /// Skipped images of the chosen run.
  const SkippedFrames& skipped() const { return skipped_; }
  bool reverse() const { return reverse_; }
  /// Dispersion between both directions, in the stated sigmas of the chosen run; none without a second run.
  const std::optional<odometry::Dispersion>& dispersion() const { return dispersion_; }

  /// Tracks in the requested direction. Times of a reversed run are negative, because odometry needs increasing times.
  /// `pictures`: folder for images of keyframes; empty: none.
  odometry::OdometryResult run(const fs::path& pictures, const Progress& progress) {
    skipped_ = {};
    return track_direction(reverse_, options_, priors_, pictures, skipped_, progress);
  }

  /// Tracks the same images in the other direction, without further inputs, and replaces `result` if that run is
  /// better. Returns the agreement of both if they disagree and neither is better.
  std::optional<odometry::RunAgreement> compare_reversed(odometry::OdometryResult& result, const fs::path& pictures,
                                                         const Progress& progress) {
    odometry::OdometryOptions options = options_;
    options.map.dense = false;  // only the path is needed
    options.loops.enabled = false;
    odometry::Priors pictures_alone;
    pictures_alone.mask = priors_.mask;
    SkippedFrames skipped;
    const odometry::OdometryResult other = track_direction(!reverse_, options, pictures_alone, {}, skipped, progress);
    geometry::Trajectory same_times = other.trajectory;
    reverse_times(same_times);
    const auto agreement = odometry::measure_agreement(result.trajectory, same_times);
    const odometry::RunChoice belief = odometry::choose_run(result, other, agreement);
    if (belief == odometry::RunChoice::kSecond && extras_.init_from.empty()) {
      same_times = result.trajectory;
      reverse_times(same_times);
      reverse_ = !reverse_;
      priors_ = pictures_alone;
      give_readings();
      remove_files(pictures);
      result = run(pictures, progress);
    }
    dispersion_ = odometry::estimate_dispersion(result.trajectory, result.keyframes, result.quality, same_times);
    if (dispersion_) odometry::rescale_sigmas(result.quality, *dispersion_);
    if (belief == odometry::RunChoice::kOpen) return agreement;
    return std::nullopt;
  }

 private:
  /// The inertial unit's readings in the order of play.
  void give_readings() {
    priors_.inertial = readings_;
    priors_.inertial_in_window = extras_.inertial_in_window;
    if (readings_ && reverse_) priors_.inertial->samples = inertial::reversed(readings_->samples);
  }

  odometry::OdometryResult track_direction(bool reverse, const odometry::OdometryOptions& options,
                                           const odometry::Priors& aids, const fs::path& debug_pictures,
                                           SkippedFrames& skipped, const Progress& progress) const {
    const std::vector<dataset::Frame>& frames = frames_[reverse];
    const Progress counted = [&](std::int64_t done, std::int64_t, std::string_view what) {
      report_progress(progress, done, static_cast<std::int64_t>(frames.size()), "tracking: " + std::string(what));
    };
    return odometry::run_odometry(playback_calibration(view_.calibration, reverse),
                                  photometric_ ? &*photometric_ : nullptr,
                                  make_frame_source(frames, reverse, view_, rig_, skipped), options, counted, aids,
                                  make_debug_observer(debug_pictures, frames),
                                  rig_ != nullptr ? rig_->others : std::vector<odometry::OtherCamera>{});
  }

  const TrackingCamera& view_;
  const odometry::OdometryOptions& options_;
  const TrackOptions& extras_;
  std::optional<imaging::PhotometricCalibration> photometric_;
  std::optional<inertial::InertialInput> readings_;
  const StereoRig* rig_;
  std::array<std::vector<dataset::Frame>, 2> frames_;  ///< forwards, backwards
  odometry::Priors priors_;
  bool reverse_;  ///< direction of the chosen run
  std::optional<odometry::Dispersion> dispersion_;
  SkippedFrames skipped_;
};

}  // namespace

nlohmann::json track(const fs::path& dataset_folder, const fs::path& out, bool replace,
                     const odometry::OdometryOptions& options, const FrameRange& range, const Progress& progress,
                     const TrackOptions& extras) {
  require_one_scale(extras);
  std::vector<std::string> rig_warnings;
  std::optional<StereoRig> rig;
  if (uses_other_cameras(extras.mode)) rig = read_stereo_rig(dataset_folder, extras.camera.string(), rig_warnings);
  const dataset::Dataset data =
      rig ? rig->reference : dataset::read_dataset(dataset_folder, {extras.camera, extras.camera_id});
  const TrackingCamera view = make_tracking_camera(data.calibration, extras.rectify_fov_deg);
  if (extras.colmap) dataset::require_colmap_lens(view.calibration.camera);
  json about;
  const base::OutputFolder output =
      odometry_output_folder(out, replace, {dataset_folder, extras.camera, extras.mask, extras.init_from});
  std::vector<std::string> warnings = add_rectification_warning(data.warnings, data.calibration, view);
  warnings.insert(warnings.end(), rig_warnings.begin(), rig_warnings.end());
  std::optional<inertial::InertialInput> readings;
  if (uses_inertial_unit(extras.mode)) readings = read_inertial_input(data, extras.gravity_m_s2, warnings);
  DatasetTracker tracking(data, view, options, range, extras, std::move(readings), rig ? &*rig : nullptr);
  const auto write = [&](const fs::path& temporary, const fs::path& pictures) {
    odometry::OdometryResult result = tracking.run(pictures, progress);
    const std::optional<odometry::RunAgreement> second =
        extras.check_reversed ? tracking.compare_reversed(result, pictures, progress) : std::nullopt;
    const bool reverse = tracking.reverse();
    const std::vector<dataset::Frame>& frames = tracking.frames(reverse);
    imaging::Calibration calibration = view.calibration;
    if (result.camera) calibration.camera = *result.camera;
    if (extras.colmap) {
      fs::create_directory(temporary / "colmap");
      dataset::write_colmap(temporary / "colmap", colmap_model(calibration.camera, result, frames));
    }
    about = describe(result, tracking.skipped(), warnings);
    const auto name_of = [&](std::int64_t frame) { return frames[static_cast<std::size_t>(frame)].id; };
    Doubts doubts = odometry::find_doubts(result, static_cast<std::int64_t>(frames.size()) - tracking.skipped().frames,
                                          name_of, second);
    about["path_doubts"] = json::array();
    for (const Doubt& doubt : odometry::find_path_doubts(result, name_of, second))
      about["path_doubts"].push_back(doubt.what);
    about["backwards"] = reverse;
    about["dispersion"] = tracking.dispersion() ? json{{"pictures", tracking.dispersion()->pictures},
                                                       {"position", tracking.dispersion()->position},
                                                       {"rotation", tracking.dispersion()->rotation}}
                                                : json(nullptr);
    about["residual_pattern_px"] =
        result.systematic_displacement ? json(result.systematic_displacement->rms_px) : json(nullptr);
    if (reverse) {
      reverse_times(result.trajectory);
      reverse_times(result.keyframes);
      if (result.inertial) result.inertial = inertial::reversed(std::move(*result.inertial));
    }
    describe_scale(extras.mode, result, temporary, doubts, about);
    about["doubts"] = evaluation::to_json(doubts);
    base::write_file(temporary / "quality.csv", quality_csv(result.quality, frames, reverse));
    geometry::write_tum(temporary / "trajectory.txt", result.trajectory);
    geometry::write_tum(temporary / "keyframes.txt", result.keyframes);
    geometry::write_cloud(temporary / "map.ply", result.map);
    imaging::write_kalibr(temporary / "camera.yaml", calibration);
    if (options.loops.enabled) about["loops"] = describe_loops(result.loops, frames);
    about["intrinsics"] =
        intrinsics_json(calibration.camera, result.camera && options.window.refine_intrinsics && !rig);
    base::write_file(temporary / "odometry.json", about.dump(2) + "\n");
  };
  base::write_folder(output, [&](const fs::path& temporary) {
    with_pictures_folder(extras.debug_pictures, output, temporary,
                         [&](const fs::path& pictures) { write(temporary, pictures); });
  });
  return about;
}

nlohmann::json track_with_command(const fs::path& dataset_folder, const fs::path& out, bool replace,
                                  const std::string& command, const fs::path& folder) {
  const dataset::Dataset data = dataset::read_dataset(dataset_folder);
  json about;
  base::write_folder(odometry_output_folder(out, replace, {dataset_folder}), [&](const fs::path& temporary) {
    run_command(replace_placeholder(replace_placeholder(command, "{dataset}", shell_path(dataset_folder)), "{out}",
                                    shell_path(temporary)),
                folder, temporary / "command.log");
    for (const char* name : {"trajectory.txt", "map.ply"}) {
      if (!fs::exists(temporary / name))
        throw InputError("odometry.command", std::string("did not write ") + name + " to {out}");
    }
    about = describe_command_result(temporary, data.frames.size());
    if (!fs::exists(temporary / "odometry.json")) base::write_file(temporary / "odometry.json", about.dump(2) + "\n");
  });
  return about;
}

}  // namespace tileflight::survey
