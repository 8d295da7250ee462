#include "tileflight/slam/odometry/track_inputs.h"

#include <tbb/task_group.h>

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/rig.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/slam/inertial/imu_check.h"
#include "tileflight/slam/keyframes/valid_region.h"

namespace tileflight::odometry {
namespace fs = std::filesystem;
namespace {

inertial::ImuNoise read_noise(const dataset::Dataset& data, const std::vector<geometry::ImuSample>& samples,
                              std::vector<std::string>& warnings) {
  if (data.imu_noise.empty()) {
    const inertial::ImuNoise noise = inertial::at_least_scatter({}, samples);
    warnings.push_back(
        base::formatted("the inertial unit's noise is not stated (imu.yaml); that of an ADIS16448 is assumed, and at "
                        "least what its readings scatter by: %.2g m/s^2/sqrt(Hz) and %.2g rad/s/sqrt(Hz)",
                        noise.accelerometer_noise_density, noise.gyroscope_noise_density));
    return noise;
  }
  const dataset::ImuCalibration noise = dataset::read_imu_noise(data.imu_noise);
  return {.accelerometer_noise_density = noise.accelerometer_noise_density,
          .accelerometer_random_walk = noise.accelerometer_random_walk,
          .gyroscope_noise_density = noise.gyroscope_noise_density,
          .gyroscope_random_walk = noise.gyroscope_random_walk};
}

std::size_t reference_camera(const dataset::Rig& rig, const std::string& name) {
  if (name.empty()) return 0;
  std::string names;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (rig.cameras[c].name == name) return c;
    names += (names.empty() ? "" : ", ") + rig.cameras[c].name;
  }
  throw InputError("--camera", "\"" + name + "\" is none of the rig's cameras (" + names +
                                   "), whose own calibrations --mode stereo takes");
}

/// Smallest difference of a frame's time to one of the reference camera, seconds.
double smallest_offset_s(const dataset::RigCamera& reference, const dataset::RigCamera& other) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const dataset::Frame& frame : other.dataset.frames) {
    const double time_s = frame.time_s + other.timeshift_s - reference.timeshift_s;
    const auto& frames = reference.dataset.frames;
    const auto next = std::ranges::lower_bound(frames, time_s, {}, &dataset::Frame::time_s);
    if (next != frames.end()) smallest = std::min(smallest, next->time_s - time_s);
    if (next != frames.begin()) smallest = std::min(smallest, time_s - std::prev(next)->time_s);
  }
  return smallest;
}

odometry::OtherCamera other_camera(const dataset::RigCamera& reference, const dataset::RigCamera& camera) {
  odometry::OtherCamera other{.name = camera.name,
                              .calibration = camera.dataset.calibration,
                              .photometric = {},
                              .T_other_reference = camera.T_body_camera.inverse() * reference.T_body_camera};
  if (!camera.dataset.pcalib.empty() || !camera.dataset.vignette.empty())
    other.photometric = imaging::read_photometric(camera.dataset.pcalib, camera.dataset.vignette);
  return other;
}

void require_size(const fs::path& file, int width, int height, const imaging::Camera& camera) {
  if (width == camera.width() && height == camera.height()) return;
  throw InputError(file.string(), "is " + std::to_string(width) + "x" + std::to_string(height) +
                                      ", the calibration is for " + std::to_string(camera.width()) + "x" +
                                      std::to_string(camera.height()) +
                                      "; use images and a calibration of the same size");
}

/// nullopt if the file is broken or missing, which is counted.
std::optional<imaging::RgbImage> read_or_skip(const dataset::Frame& frame, SkippedImages& skipped) {
  try {
    return imaging::read_rgb(frame.image);
  } catch (const InputError& error) {
    if (skipped.frames++ == 0) skipped.first_reason = error.what();
    return std::nullopt;
  }
}

/// Reads the images that the other cameras took at a frame's instant.
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

/// Reads images one by one, each on another core while the one before it is tracked. What is broken counts only once
/// the image after it is asked for.
class ReadAhead {
 public:
  /// Arguments: see make_frame_source().
  ReadAhead(const std::vector<dataset::Frame>& frames, bool reverse, const TrackingCamera& view, const StereoRig* rig)
      : frames_(frames), reverse_(reverse), view_(view), rig_(rig) {}
  ~ReadAhead() { task_.wait(); }
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  /// nullopt after the last one.
  std::optional<odometry::InputFrame> next(SkippedFrames& skipped) {
    if (!has_begun_) read();
    has_begun_ = true;
    task_.wait();
    if (failure_) std::rethrow_exception(failure_);
    std::optional<odometry::InputFrame> frame = std::exchange(frame_, std::nullopt);
    skipped = skipped_;
    if (frame) task_.run([this] { read(); });
    return frame;
  }

 private:
  void read() {
    try {
      frame_ = read_next();
    } catch (...) {
      failure_ = std::current_exception();
    }
  }

  std::optional<odometry::InputFrame> read_next() {
    for (; at_ < frames_.size(); ++at_) {
      const dataset::Frame& frame = frames_[at_];
      auto image = read_or_skip(frame, skipped_);
      if (!image) continue;
      require_size(frame.image, image->width, image->height, view_.native);
      count_repeated(frame, *image);
      return odometry::InputFrame{.index = static_cast<std::int64_t>(at_++),
                                  .time_s = reverse_ ? -frame.time_s : frame.time_s,
                                  .exposure_ms = frame.exposure_ms,
                                  .image = view_.rectifier ? (*view_.rectifier)(*image) : std::move(*image),
                                  .others = read_others(rig_, frame, skipped_)};
    }
    return std::nullopt;
  }

  /// Counts an image that shows the same as the one before, but for what a video's compression changes, and shows
  /// something: black images have causes of their own.
  void count_repeated(const dataset::Frame& frame, const imaging::RgbImage& image) {
    constexpr std::size_t kStride = 31;
    constexpr double kSame = 0.3;  // mean difference, grey values; the noise of a camera that stands still is larger
    const std::vector<std::uint8_t> before = std::exchange(sample_, {});
    std::int64_t difference = 0;
    for (std::size_t i = 0; i < image.pixels.size(); i += kStride) {
      sample_.push_back(image.pixels[i][1]);
      if (sample_.size() <= before.size()) difference += std::abs(sample_.back() - before[sample_.size() - 1]);
    }
    if (before.size() != sample_.size() ||
        static_cast<double>(difference) >= kSame * static_cast<double>(sample_.size()) || keyframes::is_dark(image))
      return;
    if (skipped_.repeated.frames++ == 0) skipped_.repeated.first_reason = frame.id;
  }

  const std::vector<dataset::Frame>& frames_;
  bool reverse_;
  const TrackingCamera& view_;
  const StereoRig* rig_;
  bool has_begun_ = false;
  std::size_t at_ = 0;  ///< this and what follows: the task's, while it runs
  SkippedFrames skipped_;
  std::vector<std::uint8_t> sample_;  ///< of the image before
  std::optional<odometry::InputFrame> frame_;
  std::exception_ptr failure_;
  tbb::task_group task_;
};

}  // namespace

OdometryMode parse_odometry_mode(const std::string& where, const std::string& word) {
  if (word == "mono") return OdometryMode::kMono;
  if (word == "inertial") return OdometryMode::kInertial;
  if (word == "stereo") return OdometryMode::kStereo;
  if (word == "stereo-inertial") return OdometryMode::kStereoInertial;
  throw InputError(where, "\"" + word + "\" is no mode; use mono, inertial, stereo or stereo-inertial");
}

std::string to_string(OdometryMode mode) {
  switch (mode) {
    case OdometryMode::kInertial:
      return "inertial";
    case OdometryMode::kStereo:
      return "stereo";
    case OdometryMode::kStereoInertial:
      return "stereo-inertial";
    case OdometryMode::kMono:
      break;
  }
  return "mono";
}

StereoRig read_stereo_rig(const std::filesystem::path& folder, const std::string& camera,
                          std::vector<std::string>& warnings) {
  dataset::Rig rig = dataset::read_rig(folder);
  if (rig.cameras.size() < 2)
    throw InputError(folder.string(), "has one camera; --mode stereo needs several on one body: use --mode mono");
  const std::size_t first = reference_camera(rig, camera);
  const std::vector<dataset::RigInstant> instants = dataset::rig_instants(rig, kSameInstant_s);
  StereoRig stereo;
  std::vector<std::size_t> used;
  std::string nearest;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (c == first) continue;
    if (std::ranges::any_of(instants, [&](const auto& at) { return at.frames[first] && at.frames[c]; })) {
      used.push_back(c);
      stereo.others.push_back(other_camera(rig.cameras[first], rig.cameras[c]));
      continue;
    }
    const double offset_s = smallest_offset_s(rig.cameras[first], rig.cameras[c]);
    nearest = "camera " + rig.cameras[c].name + " has no image within " +
              base::formatted("%.1f", 1e3 * kSameInstant_s) + " ms of one of camera " + rig.cameras[first].name +
              " (the nearest: " + base::formatted("%.3g", 1e3 * offset_s) + " ms)";
    warnings.push_back(nearest + ": it is not used");
  }
  if (used.empty())
    throw InputError(folder.string(), nearest + "; --mode stereo needs images of one instant: use --mode mono");
  for (const dataset::RigInstant& instant : instants) {
    if (!instant.frames[first]) continue;
    auto& frames = stereo.other_frames[rig.cameras[first].dataset.frames[*instant.frames[first]].time_s];
    for (const std::size_t c : used)
      frames.push_back(instant.frames[c] ? std::optional(rig.cameras[c].dataset.frames[*instant.frames[c]])
                                         : std::nullopt);
  }
  stereo.reference = std::move(rig.cameras[first].dataset);
  return stereo;
}

inertial::InertialInput read_inertial_input(const dataset::Dataset& data, double gravity_m_s2,
                                            std::vector<std::string>& warnings) {
  if (data.imu.empty())
    throw InputError(data.folder.string(),
                     "has no readings of an inertial unit (imu.csv), which --mode inertial needs; use --mode mono");
  inertial::InertialInput input;
  input.where = data.imu.string();
  input.samples = dataset::read_imu_csv(data.imu);
  input.model.noise = read_noise(data, input.samples, warnings);
  input.model.T_imu_camera = data.calibration.T_cam_imu.inverse();
  input.model.gravity_m_s2 = gravity_m_s2;
  inertial::check_readings(input.samples, input.model.noise, input.where);
  return input;
}

TrackingCamera make_tracking_camera(const imaging::Calibration& calibration, std::optional<double> rectify_fov_deg) {
  TrackingCamera view{calibration.camera, calibration, std::nullopt};
  if (!rectify_fov_deg) return view;
  view.calibration.camera = imaging::make_pinhole(view.native.width(), view.native.height(), *rectify_fov_deg);
  view.calibration.line_delay_s = 0.0;  // a rectified image's rows are not the sensor's
  view.rectifier.emplace(view.native, view.calibration.camera);
  return view;
}

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

odometry::FrameSource make_frame_source(const std::vector<dataset::Frame>& frames, bool reverse,
                                        const TrackingCamera& view, const StereoRig* rig, SkippedFrames& skipped) {
  const auto reader = std::make_shared<ReadAhead>(frames, reverse, view, rig);
  return [reader, &skipped] { return reader->next(skipped); };
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

void read_mask_and_priors(const TrackOptions& extras, const std::vector<dataset::Frame>& frames, bool reverse,
                          const TrackingCamera& view, OdometryInput& input) {
  if (!extras.mask.empty()) {
    input.mask = imaging::read_gray(extras.mask);
    require_size(extras.mask, input.mask.width, input.mask.height, view.native);
    if (view.rectifier) input.mask = (*view.rectifier)(input.mask);
  }
  if (extras.init_from.empty()) return;
  if (!fs::is_directory(extras.init_from)) {
    input.poses = geometry::read_tum(extras.init_from);
    if (input.poses.empty()) throw InputError(extras.init_from.string(), "has no poses to initialize from");
    if (reverse) reverse_times(input.poses);
    return;
  }
  input.depth_m = [&frames, &view,
                   folder = extras.init_from](std::int64_t index) -> std::optional<imaging::FloatImage> {
    const fs::path file = folder / (frames[static_cast<std::size_t>(index)].id + ".exr");
    if (!fs::exists(file)) return std::nullopt;
    const imaging::FloatImage depth_m = imaging::read_exr(file);
    require_size(file, depth_m.width, depth_m.height, view.native);
    return view.rectifier ? (*view.rectifier)(depth_m) : depth_m;
  };
}

}  // namespace tileflight::odometry
