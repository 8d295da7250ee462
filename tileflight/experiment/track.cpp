#include "tileflight/experiment/track.h"

#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <sstream>

#include "tileflight/dataset/colmap.h"
#include "tileflight/dataset/dataset.h"
#include "tileflight/evaluation/doubts_json.h"
#include "tileflight/geometry/cloud_files.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/output_folder.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/imaging/photometric.h"
#include "tileflight/imaging/rectify.h"
#include "tileflight/odometry/debug_picture.h"
#include "tileflight/odometry/second_opinion.h"
#include "tileflight/odometry/tracking_doubts.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// How the pictures are looked at: as they are, or rectified.
struct View {
  imaging::Camera native;
  imaging::Calibration calibration;  ///< of what is tracked
  std::optional<imaging::Rectifier> rectify;
};

View view_of(const imaging::Calibration& calibration, std::optional<double> rectify_fov_deg) {
  View view{calibration.camera, calibration, std::nullopt};
  if (!rectify_fov_deg) return view;
  view.calibration.camera = imaging::make_pinhole(view.native.width(), view.native.height(), *rectify_fov_deg);
  view.calibration.line_delay_s = 0.0;  // a rectified picture's rows are not the sensor's
  view.rectify.emplace(view.native, view.calibration.camera);
  return view;
}

void require_size(const fs::path& file, int width, int height, const imaging::Camera& camera) {
  if (width == camera.width() && height == camera.height()) return;
  throw InputError(file.string(), "is " + std::to_string(width) + "x" + std::to_string(height) +
                                      ", the calibration is for " + std::to_string(camera.width()) + "x" +
                                      std::to_string(camera.height()) + "; use pictures and calibration of one size");
}

/// The frames of the range. Played backwards, time runs from the last frame's: odometry needs it to increase.
std::vector<dataset::Frame> chosen_frames(const dataset::Dataset& data, const FrameRange& range) {
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

/// Pictures that could not be decoded.
struct Skipped {
  std::int64_t frames = 0;
  std::string first_reason;
};

/// nullopt, and counted, where the file is broken or gone.
std::optional<imaging::RgbImage> read_or_skip(const dataset::Frame& frame, Skipped& skipped) {
  try {
    return imaging::read_rgb(frame.image);
  } catch (const InputError& error) {
    if (skipped.frames++ == 0) skipped.first_reason = error.what();
    return std::nullopt;
  }
}

/// Reads the chosen images one by one. Time is negated while they are played backwards; restore_times() undoes it.
odometry::FrameSource source_of(const std::vector<dataset::Frame>& frames, bool reverse, const View& view,
                                Skipped& skipped) {
  return [&, reverse, at = std::size_t{0}]() mutable -> std::optional<odometry::InputFrame> {
    for (; at < frames.size(); ++at) {
      const dataset::Frame& frame = frames[at];
      auto image = read_or_skip(frame, skipped);
      if (!image) continue;
      require_size(frame.image, image->width, image->height, view.native);
      return odometry::InputFrame{.index = static_cast<std::int64_t>(at++),
                                  .time_s = reverse ? -frame.time_s : frame.time_s,
                                  .exposure_ms = frame.exposure_ms,
                                  .image = view.rectify ? (*view.rectify)(*image) : std::move(*image)};
    }
    return std::nullopt;
  };
}

void restore_times(geometry::Trajectory& trajectory) {
  for (geometry::StampedPose& pose : trajectory.poses) pose.time_s = -pose.time_s;
  std::reverse(trajectory.poses.begin(), trajectory.poses.end());
}

std::optional<imaging::PhotometricCalibration> photometric_of(const dataset::Dataset& data, const View& view) {
  if (data.pcalib.empty() && data.vignette.empty()) return std::nullopt;
  imaging::PhotometricCalibration photometric = imaging::read_photometric(data.pcalib, data.vignette);
  if (photometric.vignette.empty()) return photometric;
  require_size(data.vignette, photometric.vignette.width, photometric.vignette.height, view.native);
  if (!view.rectify) return photometric;
  photometric.vignette = (*view.rectify)(photometric.vignette);
  // Where the lens does not see, the pictures are black whatever they are divided by.
  for (float& value : photometric.vignette.pixels) value = value > 0.0F ? value : 1.0F;
  return photometric;
}

odometry::Aids aids_of(const TrackExtras& extras, const std::vector<dataset::Frame>& frames, bool reverse,
                       const View& view) {
  odometry::Aids aids;
  if (!extras.mask.empty()) {
    aids.mask = imaging::read_gray(extras.mask);
    require_size(extras.mask, aids.mask.width, aids.mask.height, view.native);
    if (view.rectify) aids.mask = (*view.rectify)(aids.mask);
  }
  if (extras.init_from.empty()) return aids;
  if (!fs::is_directory(extras.init_from)) {
    aids.poses = geometry::read_tum(extras.init_from);
    if (aids.poses.empty()) throw InputError(extras.init_from.string(), "has no poses to start from");
    if (reverse) restore_times(aids.poses);
    return aids;
  }
  aids.depth_m = [&frames, &view, folder = extras.init_from](std::int64_t index) -> std::optional<imaging::FloatImage> {
    const fs::path file = folder / (frames[static_cast<std::size_t>(index)].id + ".exr");
    if (!fs::exists(file)) return std::nullopt;
    const imaging::FloatImage depth_m = imaging::read_exr(file);
    require_size(file, depth_m.width, depth_m.height, view.native);
    return view.rectify ? (*view.rectify)(depth_m) : depth_m;
  };
  return aids;
}

odometry::KeyframeObserver debug_pictures_into(const fs::path& folder, const std::vector<dataset::Frame>& frames) {
  if (folder.empty()) return {};
  fs::create_directories(folder);
  return [folder, &frames](const odometry::KeyframeView& keyframe) {
    const std::string& id = frames[static_cast<std::size_t>(keyframe.index)].id;
    imaging::write_rgb(folder / (id + ".png"), odometry::debug_picture(keyframe));
  };
}

/// Keyframes and map as COLMAP's model.
dataset::ColmapModel colmap_model(const imaging::Camera& camera, const odometry::OdometryResult& result,
                                  const std::vector<dataset::Frame>& frames) {
  dataset::ColmapModel model;
  model.camera = camera;
  for (std::size_t k = 0; k < result.keyframe_frames.size(); ++k) {
    const dataset::Frame& frame = frames[static_cast<std::size_t>(result.keyframe_frames[k])];
    model.pictures.push_back({frame.image.filename().string(), result.keyframes.poses[k].T_local_camera});
  }
  for (std::size_t i = 0; i < result.map.size(); ++i)
    model.points.push_back({result.map.positions[i], result.map.colors[i], result.map_keyframes[i]});
  return model;
}

/// The lens with the rows' times as the pictures are played.
imaging::Calibration as_played(imaging::Calibration calibration, bool reverse) {
  if (reverse) calibration.line_delay_s = -calibration.line_delay_s;
  return calibration;
}

/// What it means that a rolling shutter's pictures are rectified.
std::vector<std::string> with_notes(std::vector<std::string> warnings, const imaging::Calibration& native,
                                    const View& view) {
  if (view.rectify && native.line_delay_s > 0.0)
    warnings.push_back("rectified pictures have lost their rows' times: the rolling shutter is not corrected");
  return warnings;
}

json describe_loops(const std::vector<odometry::LoopFound>& found, const std::vector<dataset::Frame>& frames) {
  json loops = json::array();
  for (const odometry::LoopFound& loop : found) {
    loops.push_back({{"from", frames[static_cast<std::size_t>(loop.from_frame)].id},
                     {"to", frames[static_cast<std::size_t>(loop.to_frame)].id},
                     {"scale_change", loop.scale_change},
                     {"inliers", loop.inliers}});
  }
  return loops;
}

/// Focal lengths and principal point, pixels.
json intrinsics_of(const imaging::Camera& camera, bool estimated) {
  return std::visit(
      [estimated](const auto& model) {
        return json{{"fx", model.fx}, {"fy", model.fy}, {"cx", model.cx}, {"cy", model.cy}, {"estimated", estimated}};
      },
      camera.model());
}

/// A line a picture that was given, in the order of time.
std::string quality_table(std::vector<odometry::FrameQuality> quality, const std::vector<dataset::Frame>& frames,
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
          << q.known_points << ',' << q.step << ',' << q.sigma_position << ',' << q.sigma_rotation_rad << ','
          << q.sigma_log_scale << '\n';
  }
  return table.str();
}

json describe(const odometry::OdometryResult& result, const Skipped& skipped, std::vector<std::string> warnings) {
  if (skipped.frames > 0) {
    warnings.push_back(std::to_string(skipped.frames) +
                       " pictures could not be decoded and were left out; the first: " + skipped.first_reason);
  }
  return {{"frames", result.frames},
          {"frames_tracked", result.frames_tracked},
          {"frames_skipped", skipped.frames},
          {"warnings", warnings},
          {"lost", result.lost},
          {"lost_reason", result.lost_reason},
          {"keyframes", result.keyframes.size()},
          {"points", result.map.size()},
          {"seconds", result.seconds},
          {"frames_per_second", result.seconds > 0 ? static_cast<double>(result.frames) / result.seconds : 0.0}};
}

std::string quoted(const fs::path& path) {
  std::string result = "'";
  for (const char c : fs::absolute(path).string()) result += c == '\'' ? "'\\''" : std::string(1, c);
  return result + "'";
}

std::string filled_in(std::string command, const std::string& name, const std::string& value) {
  for (std::size_t at = command.find(name); at != std::string::npos; at = command.find(name, at + value.size())) {
    command.replace(at, name.size(), value);
  }
  return command;
}

void run_command(const std::string& command, const fs::path& folder, const fs::path& log) {
  const std::string whole = "cd " + quoted(folder) + " && ( " + command + "\n) > " + quoted(log) + " 2>&1 < /dev/null";
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

json describe_outside_result(const fs::path& out, std::size_t frames) {
  const geometry::Trajectory trajectory = geometry::read_tum(out / "trajectory.txt");
  const geometry::PointCloud map = geometry::read_cloud(out / "map.ply");
  return {
      {"frames", frames},           {"frames_tracked", trajectory.size()},
      {"lost", trajectory.empty()}, {"lost_reason", trajectory.empty() ? "the outside program tracked no frame" : ""},
      {"keyframes", nullptr},       {"points", map.size()},
      {"seconds", nullptr},         {"frames_per_second", nullptr}};
}

geometry::OutputFolder odometry_folder(const fs::path& out, bool replace, std::vector<fs::path> inputs) {
  return {.folder = out,
          .command = "odometry",
          .replace = replace,
          .inputs = std::move(inputs),
          .unmarked = {
              .key_file = "odometry.json",
              .key_text = "frames_tracked",
              .files = {"trajectory.txt", "keyframes.txt", "map.ply", "quality.csv", "camera.yaml", "odometry.json",
                        "command.log", "colmap/cameras.txt", "colmap/images.txt", "colmap/points3D.txt"}}};
}

/// Calls `work` with the folder that pictures go to while `out` is made in `temporary`: below it where they are to be
/// below `out`, else one of their own, which is put in its place afterwards; empty where none are wanted.
void with_pictures_folder(const fs::path& pictures, const geometry::OutputFolder& out, const fs::path& temporary,
                          const std::function<void(const fs::path& folder)>& work) {
  if (pictures.empty()) return work({});
  const fs::path inside = geometry::resolved_folder(pictures).lexically_relative(geometry::resolved_folder(out.folder));
  if (!inside.empty() && *inside.begin() != "..") return work(temporary / inside);
  const geometry::OutputFolder folder{.folder = pictures,
                                      .command = "odometry",
                                      .replace = out.replace,
                                      .inputs = out.inputs,
                                      .unmarked = {.files = {"######.png"}}};
  geometry::write_folder(folder, work);
}

/// Of a run that is not gone by after all.
void remove_files(const fs::path& folder) {
  if (folder.empty() || !fs::is_directory(folder)) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) fs::remove(entry.path());
}

/// One dataset's pictures, tracked in either direction.
class Tracking {
 public:
  Tracking(const dataset::Dataset& data, const View& view, const odometry::OdometryOptions& options, FrameRange range,
           const TrackExtras& extras)
      : view_(view),
        options_(options),
        extras_(extras),
        photometric_(photometric_of(data, view)),
        reverse_(range.reverse) {
    for (const bool reverse : {false, true}) {
      range.reverse = reverse;
      frames_[reverse] = chosen_frames(data, range);
    }
    aids_ = aids_of(extras, frames_[reverse_], reverse_, view);
  }
  Tracking(const Tracking&) = delete;  // what is known of depth refers to the frames
  Tracking& operator=(const Tracking&) = delete;

  const std::vector<dataset::Frame>& frames(bool reverse) const { return frames_[reverse]; }
  /// Of the run that is gone by.
  const Skipped& skipped() const { return skipped_; }
  bool reverse() const { return reverse_; }
  /// Of the two directions, in the stated sigmas of the run that is gone by; none without a second one.
  const std::optional<odometry::Dispersion>& dispersion() const { return dispersion_; }

  /// In the direction that was asked for. Times of a reversed run are negative: odometry needs them to increase.
  /// `pictures`: folder of pictures of keyframes; empty: none.
  odometry::OdometryResult run(const fs::path& pictures, const Progress& progress) {
    skipped_ = {};
    return track(reverse_, options_, aids_, pictures, skipped_, progress);
  }

  /// Tracks the same pictures in the other direction, from the pictures alone, and puts that run into `result` where it
  /// is the better one. How far both agree where they do not and neither is better.
  std::optional<odometry::Agreement> check(odometry::OdometryResult& result, const fs::path& pictures,
                                           const Progress& progress) {
    odometry::OdometryOptions options = options_;
    options.map.dense = false;  // only the path is looked at
    options.loops.enabled = false;
    odometry::Aids pictures_alone;
    pictures_alone.mask = aids_.mask;
    Skipped skipped;
    const odometry::OdometryResult other = track(!reverse_, options, pictures_alone, {}, skipped, progress);
    geometry::Trajectory same_times = other.trajectory;
    restore_times(same_times);
    const auto agreement = odometry::agreement(result.trajectory, same_times);
    const odometry::Belief belief = odometry::belief(result, other, agreement);
    if (belief == odometry::Belief::kSecond && extras_.init_from.empty()) {
      same_times = result.trajectory;
      restore_times(same_times);
      reverse_ = !reverse_;
      aids_ = pictures_alone;
      remove_files(pictures);
      result = run(pictures, progress);
    }
    dispersion_ = odometry::dispersion(result.trajectory, result.keyframes, result.quality, same_times);
    if (dispersion_) odometry::calibrate(result.quality, *dispersion_);
    if (belief == odometry::Belief::kOpen) return agreement;
    return std::nullopt;
  }

 private:
  odometry::OdometryResult track(bool reverse, const odometry::OdometryOptions& options, const odometry::Aids& aids,
                                 const fs::path& debug_pictures, Skipped& skipped, const Progress& progress) const {
    const std::vector<dataset::Frame>& frames = frames_[reverse];
    const Progress counted = [&](std::int64_t done, std::int64_t, std::string_view what) {
      report_progress(progress, done, static_cast<std::int64_t>(frames.size()), "tracking: " + std::string(what));
    };
    return odometry::run_odometry(as_played(view_.calibration, reverse), photometric_ ? &*photometric_ : nullptr,
                                  source_of(frames, reverse, view_, skipped), options, counted, aids,
                                  debug_pictures_into(debug_pictures, frames));
  }

  const View& view_;
  const odometry::OdometryOptions& options_;
  const TrackExtras& extras_;
  std::optional<imaging::PhotometricCalibration> photometric_;
  std::array<std::vector<dataset::Frame>, 2> frames_;  ///< forwards, backwards
  odometry::Aids aids_;
  bool reverse_;  ///< direction of the run that is gone by
  std::optional<odometry::Dispersion> dispersion_;
  Skipped skipped_;
};

}  // namespace

nlohmann::json track(const fs::path& dataset_folder, const fs::path& out, bool replace,
                     const odometry::OdometryOptions& options, const FrameRange& range, const Progress& progress,
                     const TrackExtras& extras) {
  const dataset::Dataset data = dataset::read_dataset(dataset_folder, {extras.camera, extras.camera_id});
  const View view = view_of(data.calibration, extras.rectify_fov_deg);
  if (extras.colmap) dataset::require_colmap_lens(view.calibration.camera);
  json about;
  const geometry::OutputFolder output =
      odometry_folder(out, replace, {dataset_folder, extras.camera, extras.mask, extras.init_from});
  Tracking tracking(data, view, options, range, extras);
  const auto write = [&](const fs::path& temporary, const fs::path& pictures) {
    odometry::OdometryResult result = tracking.run(pictures, progress);
    const std::optional<odometry::Agreement> second =
        extras.second_opinion ? tracking.check(result, pictures, progress) : std::nullopt;
    const bool reverse = tracking.reverse();
    const std::vector<dataset::Frame>& frames = tracking.frames(reverse);
    imaging::Calibration calibration = view.calibration;
    if (result.camera) calibration.camera = *result.camera;
    if (extras.colmap) {
      fs::create_directory(temporary / "colmap");
      dataset::write_colmap(temporary / "colmap", colmap_model(calibration.camera, result, frames));
    }
    about = describe(result, tracking.skipped(), with_notes(data.warnings, data.calibration, view));
    about["doubts"] = evaluation::to_json(odometry::doubts_of(
        result, static_cast<std::int64_t>(frames.size()) - tracking.skipped().frames,
        [&](std::int64_t frame) { return frames[static_cast<std::size_t>(frame)].id; }, second));
    about["backwards"] = reverse;
    about["dispersion"] = tracking.dispersion() ? json{{"pictures", tracking.dispersion()->pictures},
                                                       {"position", tracking.dispersion()->position},
                                                       {"rotation", tracking.dispersion()->rotation}}
                                                : json(nullptr);
    about["residual_pattern_px"] = result.pattern ? json(result.pattern->rms_px) : json(nullptr);
    if (reverse) {
      restore_times(result.trajectory);
      restore_times(result.keyframes);
    }
    geometry::write_file(temporary / "quality.csv", quality_table(result.quality, frames, reverse));
    geometry::write_tum(temporary / "trajectory.txt", result.trajectory);
    geometry::write_tum(temporary / "keyframes.txt", result.keyframes);
    geometry::write_cloud(temporary / "map.ply", result.map);
    imaging::write_kalibr(temporary / "camera.yaml", calibration);
    if (options.loops.enabled) about["loops"] = describe_loops(result.loops, frames);
    about["intrinsics"] = intrinsics_of(calibration.camera, result.camera && options.window.refine_intrinsics);
    geometry::write_file(temporary / "odometry.json", about.dump(2) + "\n");
  };
  geometry::write_folder(output, [&](const fs::path& temporary) {
    with_pictures_folder(extras.debug_pictures, output, temporary,
                         [&](const fs::path& pictures) { write(temporary, pictures); });
  });
  return about;
}

nlohmann::json track_with_command(const fs::path& dataset_folder, const fs::path& out, bool replace,
                                  const std::string& command, const fs::path& folder) {
  const dataset::Dataset data = dataset::read_dataset(dataset_folder);
  json about;
  geometry::write_folder(odometry_folder(out, replace, {dataset_folder}), [&](const fs::path& temporary) {
    run_command(filled_in(filled_in(command, "{dataset}", quoted(dataset_folder)), "{out}", quoted(temporary)), folder,
                temporary / "command.log");
    for (const char* name : {"trajectory.txt", "map.ply"}) {
      if (!fs::exists(temporary / name))
        throw InputError("odometry.command", std::string("left no ") + name + " in {out}");
    }
    about = describe_outside_result(temporary, data.frames.size());
    if (!fs::exists(temporary / "odometry.json"))
      geometry::write_file(temporary / "odometry.json", about.dump(2) + "\n");
  });
  return about;
}

}  // namespace tileflight::experiment
