#include "tileflight/slam/odometry/track.h"

#include <algorithm>
#include <array>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/exports/colmap.h"
#include "tileflight/slam/odometry/debug_image.h"
#include "tileflight/slam/odometry/direction_check.h"
#include "tileflight/slam/odometry/image_examination.h"
#include "tileflight/slam/odometry/line_delay_record.h"
#include "tileflight/slam/odometry/track_inputs.h"
#include "tileflight/slam/odometry/track_result.h"
#include "tileflight/slam/odometry/tracking_warnings.h"

namespace tileflight::odometry {
namespace fs = std::filesystem;
namespace {

KeyframeObserver make_debug_observer(const fs::path& folder, const std::vector<dataset::Frame>& frames) {
  if (folder.empty()) return {};
  fs::create_directories(folder);
  return [folder, &frames](const KeyframeView& keyframe) {
    const std::string& id = frames[static_cast<std::size_t>(keyframe.index)].id;
    imaging::write_rgb(folder / (id + ".png"), draw_debug_image(keyframe));
  };
}

/// Keyframes and map as a COLMAP model.
exports::ColmapModel colmap_model(const imaging::Camera& camera, const OdometryResult& result,
                                  const std::vector<dataset::Frame>& frames) {
  exports::ColmapModel model;
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

/// Adds what the dataset's images lack: skipped ones, and those before the start without a pose.
void add_image_notes(const OdometryResult& result, const SkippedFrames& skipped, std::vector<std::string>& notes) {
  constexpr double kMany = 0.02;  // of the images
  if (static_cast<double>(skipped.repeated.frames) > kMany * static_cast<double>(result.frames)) {
    notes.push_back(std::to_string(skipped.repeated.frames) + " of " + std::to_string(result.frames) +
                    " images repeat the one before (for example " + skipped.repeated.first_reason +
                    "): the camera stands still, or the video was filled up to a higher frame rate; these images add "
                    "nothing to the map");
  }
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
}

/// Brings a run over `images` images in reverse order into the order of the dataset: times, indices and the order of
/// images, keyframes and loops.
void put_in_flight_order(OdometryResult& result, std::size_t images) {
  const std::int64_t last = static_cast<std::int64_t>(images) - 1;
  const int last_keyframe = static_cast<int>(result.keyframes.size()) - 1;
  reverse_times(result.trajectory);
  reverse_times(result.keyframes);
  std::ranges::reverse(result.quality);
  for (FrameQuality& quality : result.quality) {
    quality.frame = last - quality.frame;
    quality.time_s = -quality.time_s;
  }
  std::ranges::reverse(result.keyframe_frame_indices);
  for (std::int64_t& frame : result.keyframe_frame_indices) frame = last - frame;
  for (std::vector<int>& keyframes : result.map_point_keyframes)
    for (int& keyframe : keyframes) keyframe = last_keyframe - keyframe;
  const auto first_frames = result.map.scalars.find("first_frame"), last_frames = result.map.scalars.find("last_frame");
  if (first_frames != result.map.scalars.end() && last_frames != result.map.scalars.end()) {
    std::swap(first_frames->second, last_frames->second);
    for (std::vector<float>* frames : {&first_frames->second, &last_frames->second})
      for (float& frame : *frames) frame = static_cast<float>(last) - frame;
  }
  for (FocalSegment& segment : result.focal_segments) segment = reversed(segment, last);
  std::ranges::reverse(result.focal_segments);
  for (LoopClosure& loop : result.loops) {
    loop = {.from_frame = last - loop.to_frame,
            .to_frame = last - loop.from_frame,
            .scale_change = 1.0 / loop.scale_change,
            .inliers = loop.inliers};
  }
  if (result.stereo) {
    for (OtherCameraResult& camera : result.stereo->cameras)
      if (camera.last_frame >= 0) camera.last_frame = last - camera.last_frame;
  }
  if (result.lost_since) result.lost_since = last - *result.lost_since;
  if (result.coupled_since_s) result.coupled_since_s = -*result.coupled_since_s;
  if (result.inertial) result.inertial = inertial::reversed(std::move(*result.inertial));
  result.backwards = true;
}

/// Says where tracking was lost, in the order of the flight and by the names of its images.
void name_lost_images(const std::vector<dataset::Frame>& frames, OdometryResult& result) {
  if (!result.lost_since) return;
  const std::string& since = frames[static_cast<std::size_t>(*result.lost_since)].id;
  result.lost_reason = result.backwards
                           ? "the images at the beginning, frames " + frames.front().id + " to " + since +
                                 ", do not align with the map of the later ones, from which it was tracked backwards "
                           : "tracking lost at frame " + since +
                                 ": it and the frames after it do not align with the "
                                 "last keyframe ";
  result.lost_reason += result.lost_detail;
}

/// Whether a run left so much out that the images are examined for the cause.
bool is_incomplete(const OdometryResult& result, std::size_t images) {
  const double least = WarningThresholds{}.min_tracked_share * static_cast<double>(images);
  return result.lost || static_cast<double>(result.frames_tracked) < least;
}

/// Returns the grey image of a frame as it is tracked; nullopt if it cannot be decoded.
std::optional<imaging::GrayImage> read_tracked_grey(const dataset::Frame& frame, const TrackingCamera& view) {
  try {
    imaging::RgbImage image = imaging::read_rgb(frame.image);
    if (image.width != view.native.width() || image.height != view.native.height()) return std::nullopt;
    return imaging::to_gray(view.rectifier ? (*view.rectifier)(image) : std::move(image));
  } catch (const InputError&) {
    return std::nullopt;
  }
}

void require_one_scale(const TrackOptions& options) {
  if (options.odometry.inertial_in_window && !uses_inertial_unit(options.mode))
    throw InputError("--tight", "puts an inertial unit's readings into the window, which --mode " +
                                    to_string(options.mode) + " does not use; use it with inertial or stereo-inertial");
  if (options.mode != OdometryMode::kMono && !options.init_from.empty())
    throw InputError("--init-from",
                     "and --mode " + to_string(options.mode) + " both decide on frame and scale; use one of them");
}

void require_own_rows(const TrackOptions& options) {
  if (!options.odometry.estimate_line_delay) return;
  if (options.rectify_fov_deg)
    throw InputError("--estimate-line-delay",
                     "needs the sensor's own rows, which --rectify bends; leave one of them out");
  if (uses_other_cameras(options.mode))
    throw InputError("--estimate-line-delay", "and --mode " + to_string(options.mode) +
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
  const base::OutputFolder folder{
      .folder = pictures, .command = "odometry", .replace = out.replace, .inputs = out.inputs};
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
  DatasetTracker(const dataset::Dataset& data, const TrackingCamera& view, const TrackOptions& options,
                 std::optional<inertial::InertialInput> readings, const StereoRig* rig)
      : view_(view),
        calibration_(view.calibration),
        options_(options),
        readings_(std::move(readings)),
        rig_(rig),
        input_(view.calibration),
        reverse_(options.frames.reverse) {
    FrameRange range = options.frames;
    for (const bool reverse : {false, true}) {
      range.reverse = reverse;
      frames_[reverse] = select_frames(data, range);
    }
    input_.photometric = read_photometric_calibration(data, view);
    if (rig != nullptr) input_.other_cameras = rig->others;
    read_mask_and_priors(options, frames_[reverse_], reverse_, view, input_);
    give_readings();
  }
  DatasetTracker(const DatasetTracker&) = delete;  // depth priors refer to the frames
  DatasetTracker& operator=(const DatasetTracker&) = delete;

  const std::vector<dataset::Frame>& frames(bool reverse) const { return frames_[reverse]; }
  /// Skipped images of the chosen run.
  const SkippedFrames& skipped() const { return skipped_; }
  bool reverse() const { return reverse_; }
  /// The camera's calibration, with the line delay that was found.
  const imaging::Calibration& calibration() const { return calibration_; }
  /// The line delay that was found; none: it was not estimated.
  const std::optional<FoundLineDelay>& line_delay() const { return line_delay_; }
  /// Dispersion between both directions, in the stated sigmas of the chosen run; none without a second run.
  const std::optional<Dispersion>& dispersion() const { return dispersion_; }

  /// Tracks in the requested direction. Times of a reversed run are negative, because odometry needs increasing times.
  /// `pictures`: folder for images of keyframes; empty: none.
  OdometryResult run(const fs::path& pictures, const Progress& progress) {
    skipped_ = {};
    return track_direction(reverse_, first_image_, options_.odometry, input_, pictures, skipped_, progress);
  }

  /// Looks for what kept the images from being tracked, and tracks again without it: only the longest part between
  /// cuts, without the pixels that stand still. Replaces `result` by a run that is better. Adds what was found to
  /// `notes`.
  void remedy_images(OdometryResult& result, const fs::path& pictures, const Progress& progress, Warnings& warnings) {
    const std::size_t images = frames_[false].size();
    if (!is_incomplete(result, images)) return;
    images_ = summarize_images(images, reader());
    if (const std::vector<std::size_t> cuts = find_cuts(images_); !cuts.empty()) {
      use_longest_part(cuts, warnings);
      remove_files(pictures);
      result = run_first(pictures, progress);
      if (!is_incomplete(result, frames_[false].size())) return;
    }
    const imaging::GrayImage given = input_.mask;
    const imaging::GrayImage still = find_static_pixels(frames_[false].size(), reader(), given);
    if (still.empty()) return;
    combine_mask(still);
    const std::optional<FoundLineDelay> line_delay = line_delay_;
    const double line_delay_s = calibration_.line_delay_s;
    const auto before = result.frames_tracked;
    OdometryResult masked = run_first({}, progress);
    if (masked.frames_tracked <= before && before > 0) {
      input_.mask = given;
      line_delay_ = line_delay;
      calibration_.line_delay_s = line_delay_s;
      return;
    }
    // Where no image had a pose, nothing is lost by the mask: later starts and the other direction are tried with it.
    masked_ = still;
    given_mask_share_ = masked_share(given);
    frames_without_mask_ = before;
    remove_files(pictures);
    result = pictures.empty() ? std::move(masked) : run_first(pictures, progress);
  }

  /// Adds what remedy_images() has masked to `notes`, if that gave the result poses.
  void note_masked_edges(const OdometryResult& result, Warnings& notes) const {
    if (masked_.empty() || result.frames_tracked <= frames_without_mask_) return;
    const bool has_mask = given_mask_share_ > 0.0;
    const std::string beside =
        has_mask ? base::formatted(" outside of the mask, which covers %.1f %%,", 100.0 * given_mask_share_) : "";
    const std::string remedy = has_mask
                                   ? "enlarge the mask (--mask) by " + masked_extent() + ", where these edges are"
                                   : "record without on-screen text, or draw a mask of it with all its surroundings "
                                     "(--mask): these edges are in " +
                                         masked_extent();
    notes.push_back({"edges in " + base::formatted("%.1f %%", 100.0 * masked_share(masked_)) + " of the image" +
                         beside +
                         " stand still while the rest moves (text, a logo, or the vehicle itself): these "
                         "pixels were masked, and " +
                         std::to_string(result.frames_tracked) + " instead of " + std::to_string(frames_without_mask_) +
                         " frames have a pose",
                     "odometry", Severity::kNote, remedy});
  }

  /// Adds a warning that names the images in which nothing can be tracked, if remedy_images() examined them; where they
  /// are what was lost, `result` says so.
  void note_blank_images(OdometryResult& result, Warnings& warnings) const {
    const std::vector<BlankImages> runs = find_blank_images(images_);
    std::size_t blank = 0, lost = 0;
    const std::size_t count = images_.size();
    const auto since = static_cast<std::size_t>(result.lost_since.value_or(0));
    const std::size_t lost_first = result.backwards ? 0 : since, lost_last = result.backwards ? since : count - 1;
    for (const BlankImages& run : runs) {
      blank += run.last - run.first + 1;
      const std::size_t first = std::max(run.first, lost_first), last = std::min(run.last, lost_last);
      if (first <= last) lost += last - first + 1;
    }
    if (blank == 0 || blank == count) return;
    if (result.lost_since && 2 * lost > lost_last - lost_first + 1) {
      const std::string all = std::to_string(lost_last - lost_first + 1);
      result.lost_detail = "(" + (std::to_string(lost) == all ? "all " : std::to_string(lost) + " of these ") + all +
                           " images are " + runs.front().look + ")";
    }
    warnings.push_back({blank_text(runs, blank), "odometry", Severity::kWarning, blank_remedy(runs)});
  }

  /// Returns what is wrong with the images' grey values or order, if remedy_images() examined them.
  std::optional<ImageFault> image_fault() const {
    return find_image_fault(images_, [&](std::size_t i) { return frames_[false][i].id; });
  }

  /// Makes the first run, or all passes that it takes to find the line delay.
  OdometryResult run_first(const fs::path& pictures, const Progress& progress) {
    if (!options_.odometry.estimate_line_delay) return run(pictures, progress);
    const double order = reverse_ ? -1.0 : 1.0;
    LineDelayPasses found = track_with_line_delay(order * calibration_.line_delay_s, [&](double line_delay_s) {
      remove_files(pictures);
      calibration_.line_delay_s = order * line_delay_s;
      return run(pictures, progress);
    });
    line_delay_ =
        FoundLineDelay{.passes = found.passes, .used_s = calibration_.line_delay_s, .estimate = found.estimate};
    if (line_delay_->estimate) line_delay_->estimate->line_delay_s *= order;
    return std::move(found.result);
  }

  /// Tracks the same images in the other direction, without further inputs, and replaces `result` if that run is
  /// better (direction_check.h). Returns the agreement of both if they disagree and neither is clearly better.
  std::optional<RunAgreement> compare_reversed(OdometryResult& result, const fs::path& pictures,
                                               const Progress& progress) {
    OdometryOptions options = options_.odometry;
    options.map.dense = false;  // only the path is needed
    options.loops.enabled = options.estimate_line_delay = false;
    OdometryInput images_alone = input_;
    images_alone.poses = {};
    images_alone.depth_m = {};
    images_alone.inertial.reset();
    const auto track = [&](const RunStart& start) {
      SkippedFrames skipped;
      OdometryResult further =
          track_direction(reverse_ != start.against, start.image, options, images_alone, {}, skipped, progress);
      if (start.against) reverse_times(further.trajectory);
      return further;
    };
    DirectionCheck check = check_directions(result, frames_[reverse_].size(), options_.init_from.empty(), track);
    if (check.use.against) {
      reverse_times(check.counterpart);
      reverse_ = !reverse_;
      if (check.disagreement) check.disagreement->worst_time_s = -check.disagreement->worst_time_s;
      input_ = std::move(images_alone);
      give_readings();
    }
    if (check.use.against || check.use.image > 0) {
      first_image_ = check.use.image;
      remove_files(pictures);
      result = run(pictures, progress);
    }
    dispersion_ = estimate_dispersion(result.trajectory, result.keyframes, result.quality, check.counterpart);
    if (dispersion_) rescale_sigmas(result.quality, *dispersion_);
    return check.disagreement;
  }

 private:
  /// Puts the inertial unit's readings into the input, in the order of play.
  void give_readings() {
    input_.inertial = readings_;
    if (readings_ && reverse_) input_.inertial->samples = inertial::reversed(readings_->samples);
  }

  ImageReader reader() const {
    return [this](std::size_t i) { return read_tracked_grey(frames_[false][i], view_); };
  }

  /// The columns and rows of what remedy_images() has masked.
  std::string masked_extent() const {
    int left = masked_.width, right = 0, top = masked_.height, bottom = 0;
    for (int y = 0; y < masked_.height; ++y) {
      for (int x = 0; x < masked_.width; ++x) {
        if (masked_(x, y) != 0) continue;
        left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = std::max(bottom, y);
      }
    }
    return "columns " + std::to_string(left) + " to " + std::to_string(right) + ", rows " + std::to_string(top) +
           " to " + std::to_string(bottom);
  }

  /// "30 of 150 images are nearly black: frames 000000 to 000029".
  std::string blank_text(const std::vector<BlankImages>& runs, std::size_t blank) const {
    constexpr std::size_t kMost = 5;
    std::string text = std::to_string(blank) + " of " + std::to_string(images_.size()) + " images ";
    for (std::size_t i = 0; i < std::min(runs.size(), kMost); ++i) {
      const BlankImages& run = runs[i];
      const std::string &first = frames_[false][run.first].id, &last = frames_[false][run.last].id;
      const bool is_other = i == 0 || run.look != runs[i - 1].look;
      text += (i == 0 ? "are " : ", ") + (is_other ? run.look + ": " : "") +
              (first == last ? "frame " + first : "frames " + first + " to " + last);
    }
    if (runs.size() > kMost) text += " and " + std::to_string(runs.size() - kMost) + " more parts";
    return text + "; nothing can be tracked in them";
  }

  /// Returns the options that leave blank images out where they begin or end the flight.
  std::string blank_remedy(const std::vector<BlankImages>& runs) const {
    const std::size_t from = options_.frames.from, every = options_.frames.every;
    std::string range;
    if (runs.front().first == 0) range = "--from " + std::to_string(from + (runs.front().last + 1) * every);
    if (runs.back().last + 1 == images_.size())
      range += (range.empty() ? "--to " : " --to ") + std::to_string(from + runs.back().first * every);
    return range.empty() ? "expose these images otherwise, or track the parts before and after them one by one "
                           "(--from, --to)"
                         : "leave them out (" + range + ")";
  }

  /// Drops all images but those of the longest part between `cuts`.
  void use_longest_part(const std::vector<std::size_t>& cuts, Warnings& warnings) {
    std::vector<dataset::Frame>& frames = frames_[false];
    std::size_t begin = 0, end = 0, start = 0;
    std::string named, parts;
    for (std::size_t k = 0; k <= cuts.size(); ++k) {
      const std::size_t stop = k < cuts.size() ? cuts[k] : frames.size();
      if (stop - start > end - begin) begin = start, end = stop;
      if (k < cuts.size()) named += (k == 0 ? "" : k + 1 < cuts.size() ? ", " : " and ") + frames[stop].id;
      const std::size_t every = options_.frames.every, from = options_.frames.from;
      parts += (k == 0 ? "" : ", ") + ("--from " + std::to_string(from + start * every)) + " --to " +
               std::to_string(from + stop * every);
      start = stop;
    }
    warnings.push_back({"the video is cut at frame" + std::string(cuts.size() > 1 ? "s " : " ") + named +
                            ": these images show something else than those before; the longest part is used, frames " +
                            frames[begin].id + " to " + frames[end - 1].id,
                        "odometry", Severity::kError, "track the parts one by one: " + parts});
    frames = std::vector<dataset::Frame>(frames.begin() + static_cast<std::ptrdiff_t>(begin),
                                         frames.begin() + static_cast<std::ptrdiff_t>(end));
    images_ = std::vector<ImageSummary>(images_.begin() + static_cast<std::ptrdiff_t>(begin),
                                        images_.begin() + static_cast<std::ptrdiff_t>(end));
    frames_[true].assign(frames.rbegin(), frames.rend());
  }

  void combine_mask(const imaging::GrayImage& still) {
    if (input_.mask.empty()) {
      input_.mask = still;
      return;
    }
    for (std::size_t i = 0; i < still.pixels.size(); ++i)
      input_.mask.pixels[i] = std::min(input_.mask.pixels[i], still.pixels[i]);
  }

  /// Begins with the image `first_image` of that direction (InitializationOptions).
  OdometryResult track_direction(bool reverse, std::size_t first_image, OdometryOptions options, OdometryInput input,
                                 const fs::path& debug_pictures, SkippedFrames& skipped,
                                 const Progress& progress) const {
    options.initialization.first_image = first_image;
    const std::vector<dataset::Frame>& frames = frames_[reverse];
    const Progress counted = [&](std::int64_t done, std::int64_t, std::string_view what) {
      report_progress(progress, done, static_cast<std::int64_t>(frames.size()), "tracking: " + std::string(what));
    };
    input.calibration = playback_calibration(calibration_, reverse);
    input.keyframe_observer = make_debug_observer(debug_pictures, frames);
    return run_odometry(std::move(input), make_frame_source(frames, reverse, view_, rig_, skipped), options, counted);
  }

  const TrackingCamera& view_;
  imaging::Calibration calibration_;  ///< with the line delay that is used
  const TrackOptions& options_;
  std::optional<inertial::InertialInput> readings_;
  const StereoRig* rig_;
  OdometryInput input_;  ///< of the chosen run; track_direction() sets its calibration and observer
  std::array<std::vector<dataset::Frame>, 2> frames_;  ///< forwards, backwards
  bool reverse_;                                       ///< direction of the chosen run
  std::size_t first_image_ = 0;                        ///< at which it begins
  std::optional<FoundLineDelay> line_delay_;
  std::optional<Dispersion> dispersion_;
  std::vector<ImageSummary> images_;  ///< of the frames, forwards; empty: they were not examined
  imaging::GrayImage masked_;         ///< 0 where remedy_images() has masked; empty: nowhere
  double given_mask_share_ = 0.0;     ///< of the image, by --mask
  std::int64_t frames_without_mask_ = 0;
  SkippedFrames skipped_;
};

/// Describes the chosen run, which is in the dataset's order of images. `notes` concern the dataset; `disagreement`:
/// with the run in the other direction.
TrackResult describe(const DatasetTracker& tracking, const TrackOptions& options, OdometryResult odometry,
                     std::vector<std::string> notes, const std::optional<RunAgreement>& disagreement) {
  TrackResult result;
  const std::vector<dataset::Frame>& frames = tracking.frames(false);
  const auto name_of = [&](std::int64_t frame) { return frames[static_cast<std::size_t>(frame)].id; };
  add_image_notes(odometry, tracking.skipped(), notes);
  for (const Warning& warning : find_path_warnings(odometry, name_of, disagreement))
    result.path_warnings.push_back(warning.message);
  result.warnings = find_warnings(odometry, static_cast<std::int64_t>(frames.size()) - tracking.skipped().frames,
                                  name_of, disagreement);
  for (const dataset::Frame& frame : frames) result.frame_ids.push_back(frame.id);
  result.mode = options.mode;
  result.frames_skipped = tracking.skipped().frames;
  result.backwards = tracking.reverse();
  result.calibration = tracking.calibration();
  if (odometry.camera) result.calibration.camera = *odometry.camera;
  result.intrinsics_estimated = odometry.camera && options.odometry.window.refine_intrinsics &&
                                !uses_other_cameras(options.mode) && !odometry.inertial;
  result.line_delay = tracking.line_delay();
  result.dispersion = tracking.dispersion();
  result.loops_searched = options.odometry.loops.enabled;
  const auto add = [&](const Warnings& further) {
    result.warnings.insert(result.warnings.end(), further.begin(), further.end());
  };
  if (result.intrinsics_estimated)
    add(focal_warnings(tracking.calibration().camera, *odometry.camera, options.odometry.window.focal_sigma));
  if (odometry.inertial) add(odometry.inertial->warnings);
  add(make_notes(notes, "dataset"));
  result.odometry = std::move(odometry);
  return result;
}

}  // namespace

TrackResult track(const fs::path& dataset_folder, const fs::path& out, bool replace, const TrackOptions& options,
                  const Progress& progress) {
  require_one_scale(options);
  require_own_rows(options);
  std::vector<std::string> rig_warnings;
  std::optional<StereoRig> rig;
  if (uses_other_cameras(options.mode)) rig = read_stereo_rig(dataset_folder, options.camera.string(), rig_warnings);
  const dataset::Dataset data =
      rig ? rig->reference : dataset::read_dataset(dataset_folder, {options.camera, options.camera_id});
  const TrackingCamera view = make_tracking_camera(data.calibration, options.rectify_fov_deg);
  if (options.colmap) exports::require_colmap_lens(view.calibration.camera);
  const base::OutputFolder output{.folder = out,
                                  .command = "odometry",
                                  .replace = replace,
                                  .inputs = {dataset_folder, options.camera, options.mask, options.init_from}};
  std::vector<std::string> notes = add_rectification_note(data.warnings, data.calibration, view);
  notes.insert(notes.end(), rig_warnings.begin(), rig_warnings.end());
  std::optional<inertial::InertialInput> readings;
  if (uses_inertial_unit(options.mode)) readings = read_inertial_input(data, options.gravity_m_s2, notes);
  DatasetTracker tracking(data, view, options, std::move(readings), rig ? &*rig : nullptr);
  TrackResult found;
  const auto write = [&](const fs::path& temporary, const fs::path& pictures) {
    OdometryResult result = tracking.run_first(pictures, progress);
    Warnings about_images;
    tracking.remedy_images(result, pictures, progress, about_images);
    std::optional<RunAgreement> disagreement =
        options.check_reversed ? tracking.compare_reversed(result, pictures, progress) : std::nullopt;
    tracking.note_masked_edges(result, about_images);
    const std::vector<dataset::Frame>& frames = tracking.frames(false);
    if (tracking.reverse()) {
      put_in_flight_order(result, frames.size());
      if (disagreement) disagreement->worst_time_s = -disagreement->worst_time_s;
    }
    tracking.note_blank_images(result, about_images);
    name_lost_images(frames, result);
    if (result.frames_tracked == 0) {
      if (const std::optional<ImageFault> fault = tracking.image_fault()) {
        result.lost_reason = fault->cause;
        result.lost_remedy = fault->remedy;
      }
    }
    if (options.colmap) {
      fs::create_directory(temporary / "colmap");
      const imaging::Camera& camera = result.camera ? *result.camera : tracking.calibration().camera;
      exports::write_colmap(temporary / "colmap", colmap_model(camera, result, frames));
    }
    found = describe(tracking, options, std::move(result), notes, disagreement);
    found.warnings.insert(found.warnings.begin(), about_images.begin(), about_images.end());
    write_track_result(temporary, found, frames);
  };
  base::write_folder(output, [&](const fs::path& temporary) {
    with_pictures_folder(options.debug_pictures, output, temporary,
                         [&](const fs::path& pictures) { write(temporary, pictures); });
  });
  return found;
}

}  // namespace tileflight::odometry
