#include "tileflight/slam/odometry/track.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/colmap.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/slam/odometry/debug_image.h"
#include "tileflight/slam/odometry/line_delay_record.h"
#include "tileflight/slam/odometry/run_comparison.h"
#include "tileflight/slam/odometry/track_inputs.h"
#include "tileflight/slam/odometry/tracking_warnings.h"

namespace tileflight::odometry {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

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
std::vector<std::string> add_rectification_note(std::vector<std::string> notes, const imaging::Calibration& native,
                                                const TrackingCamera& view) {
  if (view.rectifier && native.line_delay_s != 0.0)
    notes.push_back("the rolling shutter is not corrected: rectified images no longer have a time for each row");
  return notes;
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

json describe(const odometry::OdometryResult& result, const SkippedFrames& skipped, std::vector<std::string>& notes) {
  if (skipped.frames > 0) {
    notes.push_back(std::to_string(skipped.frames) +
                    " images could not be decoded and were left out; the first: " + skipped.first_reason);
  }
  if (skipped.of_others.frames > 0) {
    notes.push_back(std::to_string(skipped.of_others.frames) +
                    " images of the other cameras could not be decoded and were left out; the first: " +
                    skipped.of_others.first_reason);
  }
  if (const std::int64_t without_pose = result.frames_before_start - result.frames_tracked_backwards; without_pose > 0)
    notes.push_back(std::to_string(without_pose) + " of " + std::to_string(result.frames_before_start) +
                    " images before the start have no pose: they do not align with the map when tracked backwards, "
                    "or are more than are kept");
  return {
      {"frames", result.frames},
      {"frames_tracked", result.frames_tracked},
      {"frames_before_start", result.frames_before_start},
      {"frames_tracked_backwards", result.frames_tracked_backwards},
      {"frames_skipped", skipped.frames},
      {"lost", result.lost},
      {"lost_reason", result.lost_reason},
      {"keyframes", result.keyframes.size()},
      {"points", result.map.size()},
      {"seconds", result.wall_time_s},
      {"frames_per_second", result.wall_time_s > 0 ? static_cast<double>(result.frames) / result.wall_time_s : 0.0}};
}

/// Mode, and whether lengths are in metres; what the rig's other cameras showed, as `stereo`; with an inertial unit
/// what it showed, as `inertial` and inertial.csv.
void describe_scale(OdometryMode mode, const odometry::OdometryResult& result, const fs::path& folder,
                    Warnings& warnings, json& about) {
  const bool is_metric = result.inertial && result.inertial->metric;
  const bool is_metric_by_stereo = result.stereo && result.stereo->metric;
  about["mode"] = to_string(mode);
  about["scale"] = is_metric || is_metric_by_stereo ? "metric" : "unknown";
  if (result.stereo) about["stereo"] = stereo_json(*result.stereo);
  if (!result.inertial) return;
  about["inertial"] = inertial_json(*result.inertial, result.coupled_since_s);
  warnings.insert(warnings.end(), result.inertial->warnings.begin(), result.inertial->warnings.end());
  if (is_metric) base::write_file(folder / "inertial.csv", inertial_csv(*result.inertial, result.keyframes));
}

json dispersion_json(const std::optional<odometry::Dispersion>& dispersion) {
  if (!dispersion) return nullptr;
  return {{"pictures", dispersion->pictures}, {"position", dispersion->position}, {"rotation", dispersion->rotation}};
}

/// Of a run in reverse order, to the order of the dataset.
void restore_times(odometry::OdometryResult& result) {
  reverse_times(result.trajectory);
  reverse_times(result.keyframes);
  if (result.inertial) result.inertial = inertial::reversed(std::move(*result.inertial));
}

/// Sets `path_warnings` and returns the warnings of the whole run. `second`: the run in the other direction, if it
/// disagrees.
Warnings describe_warnings(const odometry::OdometryResult& result, const std::vector<dataset::Frame>& frames,
                           std::int64_t skipped, const std::optional<odometry::RunAgreement>& second, json& about) {
  const auto name_of = [&](std::int64_t frame) { return frames[static_cast<std::size_t>(frame)].id; };
  about["path_warnings"] = json::array();
  for (const Warning& warning : odometry::find_path_warnings(result, name_of, second))
    about["path_warnings"].push_back(warning.message);
  return odometry::find_warnings(result, static_cast<std::int64_t>(frames.size()) - skipped, name_of, second);
}

/// Writes poses, map, camera and the table of images, in the order of the dataset.
void write_result(const fs::path& folder, const odometry::OdometryResult& result,
                  const std::vector<dataset::Frame>& frames, bool reverse, const imaging::Calibration& calibration) {
  base::write_file(folder / "quality.csv", quality_csv(result.quality, frames, reverse));
  geometry::write_tum(folder / "trajectory.txt", result.trajectory);
  geometry::write_tum(folder / "keyframes.txt", result.keyframes);
  geometry::write_cloud(folder / "map.ply", result.map);
  imaging::write_kalibr(folder / "camera.yaml", calibration);
}

void require_one_scale(const TrackOptions& extras) {
  if (extras.inertial_in_window && !uses_inertial_unit(extras.mode))
    throw InputError("--tight", "puts an inertial unit's readings into the window, which --mode " +
                                    to_string(extras.mode) + " does not use; use it with inertial or stereo-inertial");
  if (extras.mode != OdometryMode::kMono && !extras.init_from.empty())
    throw InputError("--init-from",
                     "and --mode " + to_string(extras.mode) + " both decide on frame and scale; use one of them");
}

void require_own_rows(const TrackOptions& extras, bool estimate_line_delay) {
  if (!estimate_line_delay) return;
  if (extras.rectify_fov_deg)
    throw InputError("--estimate-line-delay",
                     "needs the sensor's own rows, which --rectify bends; leave one of them out");
  if (uses_other_cameras(extras.mode))
    throw InputError("--estimate-line-delay", "and --mode " + to_string(extras.mode) +
                                                  ", which does not correct a rolling shutter, exclude each "
                                                  "other: use --mode mono, then its line_delay in camera.yaml");
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
        calibration_(view.calibration),
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
  /// The camera's, with the line delay that was found.
  const imaging::Calibration& calibration() const { return calibration_; }
  /// What was found of the line delay; null: it was not estimated.
  const json& line_delay() const { return line_delay_; }
  /// Dispersion between both directions, in the stated sigmas of the chosen run; none without a second run.
  const std::optional<odometry::Dispersion>& dispersion() const { return dispersion_; }

  /// Tracks in the requested direction. Times of a reversed run are negative, because odometry needs increasing times.
  /// `pictures`: folder for images of keyframes; empty: none.
  odometry::OdometryResult run(const fs::path& pictures, const Progress& progress) {
    skipped_ = {};
    return track_direction(reverse_, first_image_, options_, priors_, pictures, skipped_, progress);
  }

  /// The first run: the same, or all passes that it takes to find the line delay.
  odometry::OdometryResult run_first(const fs::path& pictures, const Progress& progress) {
    if (!options_.estimate_line_delay) return run(pictures, progress);
    const double order = reverse_ ? -1.0 : 1.0;
    odometry::LineDelayPasses found =
        odometry::track_with_line_delay(order * calibration_.line_delay_s, [&](double line_delay_s) {
          remove_files(pictures);
          calibration_.line_delay_s = order * line_delay_s;
          return run(pictures, progress);
        });
    line_delay_ = {{"passes", found.passes}, {"used_s", calibration_.line_delay_s}};
    line_delay_["estimate_s"] = found.estimate ? json(order * found.estimate->line_delay_s) : json(nullptr);
    line_delay_["sigma_s"] = found.estimate ? json(found.estimate->sigma_s) : json(nullptr);
    return std::move(found.result);
  }

  /// Tracks the same images in the other direction, without further inputs, and replaces `result` if that run is
  /// better (run_comparison.h). Returns the agreement of both if they disagree and neither is clearly better.
  std::optional<odometry::RunAgreement> compare_reversed(odometry::OdometryResult& result, const fs::path& pictures,
                                                         const Progress& progress) {
    odometry::OdometryOptions options = options_;
    options.map.dense = false;  // only the path is needed
    options.loops.enabled = options.estimate_line_delay = false;
    odometry::Priors pictures_alone;
    pictures_alone.mask = priors_.mask;
    const auto track = [&](const odometry::RunStart& start) {
      SkippedFrames skipped;
      odometry::OdometryResult further =
          track_direction(reverse_ != start.against, start.image, options, pictures_alone, {}, skipped, progress);
      if (start.against) reverse_times(further.trajectory);
      return further;
    };
    odometry::DirectionCheck check =
        odometry::check_directions(result, frames_[reverse_].size(), extras_.init_from.empty(), track);
    if (check.use.against) {
      reverse_times(check.counterpart);
      reverse_ = !reverse_;
      if (check.disagreement) check.disagreement->worst_time_s = -check.disagreement->worst_time_s;
      priors_ = pictures_alone;
      give_readings();
    }
    if (check.use.against || check.use.image > 0) {
      first_image_ = check.use.image;
      remove_files(pictures);
      result = run(pictures, progress);
    }
    dispersion_ = odometry::estimate_dispersion(result.trajectory, result.keyframes, result.quality, check.counterpart);
    if (dispersion_) odometry::rescale_sigmas(result.quality, *dispersion_);
    return check.disagreement;
  }

 private:
  /// The inertial unit's readings in the order of play.
  void give_readings() {
    priors_.inertial = readings_;
    priors_.inertial_in_window = extras_.inertial_in_window;
    if (readings_ && reverse_) priors_.inertial->samples = inertial::reversed(readings_->samples);
  }

  /// Begins with the image `first_image` of that direction (InitializationOptions).
  odometry::OdometryResult track_direction(bool reverse, std::size_t first_image, odometry::OdometryOptions options,
                                           const odometry::Priors& aids, const fs::path& debug_pictures,
                                           SkippedFrames& skipped, const Progress& progress) const {
    options.initialization.first_image = first_image;
    const std::vector<dataset::Frame>& frames = frames_[reverse];
    const Progress counted = [&](std::int64_t done, std::int64_t, std::string_view what) {
      report_progress(progress, done, static_cast<std::int64_t>(frames.size()), "tracking: " + std::string(what));
    };
    return odometry::run_odometry(playback_calibration(calibration_, reverse), photometric_ ? &*photometric_ : nullptr,
                                  make_frame_source(frames, reverse, view_, rig_, skipped), options, counted, aids,
                                  make_debug_observer(debug_pictures, frames),
                                  rig_ != nullptr ? rig_->others : std::vector<odometry::OtherCamera>{});
  }

  const TrackingCamera& view_;
  imaging::Calibration calibration_;  ///< with the line delay that is used
  const odometry::OdometryOptions& options_;
  const TrackOptions& extras_;
  std::optional<imaging::PhotometricCalibration> photometric_;
  std::optional<inertial::InertialInput> readings_;
  const StereoRig* rig_;
  std::array<std::vector<dataset::Frame>, 2> frames_;  ///< forwards, backwards
  odometry::Priors priors_;
  bool reverse_;                 ///< direction of the chosen run
  std::size_t first_image_ = 0;  ///< at which it begins
  json line_delay_;
  std::optional<odometry::Dispersion> dispersion_;
  SkippedFrames skipped_;
};

}  // namespace

nlohmann::json track(const fs::path& dataset_folder, const fs::path& out, bool replace,
                     const odometry::OdometryOptions& options, const FrameRange& range, const Progress& progress,
                     const TrackOptions& extras) {
  require_one_scale(extras);
  require_own_rows(extras, options.estimate_line_delay);
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
  std::vector<std::string> notes = add_rectification_note(data.warnings, data.calibration, view);
  notes.insert(notes.end(), rig_warnings.begin(), rig_warnings.end());
  std::optional<inertial::InertialInput> readings;
  if (uses_inertial_unit(extras.mode)) readings = read_inertial_input(data, extras.gravity_m_s2, notes);
  DatasetTracker tracking(data, view, options, range, extras, std::move(readings), rig ? &*rig : nullptr);
  const auto write = [&](const fs::path& temporary, const fs::path& pictures) {
    odometry::OdometryResult result = tracking.run_first(pictures, progress);
    const std::optional<odometry::RunAgreement> second =
        extras.check_reversed ? tracking.compare_reversed(result, pictures, progress) : std::nullopt;
    const bool reverse = tracking.reverse();
    const std::vector<dataset::Frame>& frames = tracking.frames(reverse);
    imaging::Calibration calibration = tracking.calibration();
    if (result.camera) calibration.camera = *result.camera;
    if (extras.colmap) {
      fs::create_directory(temporary / "colmap");
      dataset::write_colmap(temporary / "colmap", colmap_model(calibration.camera, result, frames));
    }
    std::vector<std::string> dataset_notes = notes;
    about = describe(result, tracking.skipped(), dataset_notes);
    Warnings warnings = describe_warnings(result, frames, tracking.skipped().frames, second, about);
    about["backwards"] = reverse;
    about["dispersion"] = dispersion_json(tracking.dispersion());
    about["residual_pattern_px"] =
        result.systematic_displacement ? json(result.systematic_displacement->rms_px) : json(nullptr);
    if (reverse) restore_times(result);
    describe_scale(extras.mode, result, temporary, warnings, about);
    const Warnings of_dataset = make_notes(dataset_notes, "dataset");
    warnings.insert(warnings.end(), of_dataset.begin(), of_dataset.end());
    about["warnings"] = to_json(warnings);
    write_result(temporary, result, frames, reverse, calibration);
    if (options.estimate_line_delay) about["line_delay"] = tracking.line_delay();
    if (options.loops.enabled) {
      about["loops"] = describe_loops(result.loops, frames);
      about["loops_closed"] = result.loops_closed;
    }
    about["intrinsics"] = intrinsics_json(
        calibration.camera, result.camera && options.window.refine_intrinsics && !rig && !result.inertial);
    base::write_file(temporary / "odometry.json", about.dump(2) + "\n");
  };
  base::write_folder(output, [&](const fs::path& temporary) {
    with_pictures_folder(extras.debug_pictures, output, temporary,
                         [&](const fs::path& pictures) { write(temporary, pictures); });
  });
  return about;
}

}  // namespace tileflight::odometry
