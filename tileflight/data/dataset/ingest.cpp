#include "tileflight/data/dataset/ingest.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <mutex>

#include "tileflight/core/base/file_kind.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/encode_queue.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/dataset/layouts.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/flight_logs/inertial_logs.h"

namespace tileflight::dataset {

namespace {

namespace fs = std::filesystem;

/// Rounding error of times that were moved to another clock.
constexpr double kRounding_s = 1e-9;

struct TimeSpan {
  double first = 0.0, last = 0.0;
};

std::string format_seconds(double time_s) { return base::rounded_text(time_s, 2) + " s"; }

/// Range of items whose times are within the span, plus one on each side so that values at its ends can be
/// interpolated.
template <class Thing, class TimeOf>
std::vector<Thing> crop_to_span(const std::vector<Thing>& things, const TimeSpan& span, const TimeOf& time_of) {
  std::vector<Thing> kept;
  for (std::size_t i = 0; i < things.size(); ++i) {
    const bool next_is_inside = i + 1 < things.size() && time_of(things[i + 1]) > span.first;
    const bool previous_is_inside = i > 0 && time_of(things[i - 1]) < span.last;
    const double time = time_of(things[i]);
    const bool inside = time >= span.first && time <= span.last;
    if (inside || (time < span.first && next_is_inside) || (time > span.last && previous_is_inside))
      kept.push_back(things[i]);
  }
  return kept;
}

/// Throws InputError unless the time spans of the items and the frames overlap.
void require_overlap(const std::string& what, const TimeSpan& things, const TimeSpan& frames) {
  if (things.first <= frames.last && things.last >= frames.first) return;
  throw InputError(what, "covers " + format_seconds(things.first) + " to " + format_seconds(things.last) +
                             ", the frames " + format_seconds(frames.first) + " to " + format_seconds(frames.last) +
                             ": the two do not overlap in time; check the time offset");
}

/// Returns whether what a video holds itself overlaps the frames; a note says if not.
bool overlaps(const std::string& what, const TimeSpan& things, const TimeSpan& frames, IngestResult& result) {
  if (things.first <= frames.last && things.last >= frames.first) return true;
  result.notes.push_back("the video's own " + what + " (" + format_seconds(things.first) + " to " +
                         format_seconds(things.last) + ") lies outside the frames (" + format_seconds(frames.first) +
                         " to " + format_seconds(frames.last) + ") and is left out");
  return false;
}

void add_gps(DatasetWriter& writer, const IngestOptions& options, const TimeSpan& frames, IngestResult& result) {
  if (options.gps.empty()) return;
  std::vector<GpsFix> fixes = options.gps;
  for (GpsFix& fix : fixes) fix.time_s += options.gps_time_offset_s;
  const TimeSpan covered{fixes.front().time_s, fixes.back().time_s};
  if (options.has_own_positions) {
    if (!overlaps("telemetry", covered, frames, result)) return;
  } else {
    require_overlap("telemetry", covered, frames);
  }
  fixes = crop_to_span(fixes, frames, [](const GpsFix& fix) { return fix.time_s; });
  result.gps_fixes = fixes.size();
  writer.set_gps(std::move(fixes));
}

/// Writes attitude.csv if the log has attitudes during the frames.
void add_attitudes(DatasetWriter& writer, const IngestOptions& options, const TimeSpan& frames) {
  std::vector<CameraAttitude> attitudes = options.attitudes;
  for (CameraAttitude& attitude : attitudes) attitude.time_s += options.gps_time_offset_s;
  attitudes = crop_to_span(attitudes, frames, [](const CameraAttitude& a) { return a.time_s; });
  if (!attitudes.empty()) write_attitude_csv(writer.temporary_folder() / "attitude.csv", attitudes);
}

/// Writes range.csv if the log has ranges during the frames.
void add_ranges(DatasetWriter& writer, const IngestOptions& options, const TimeSpan& frames) {
  std::vector<RangeReading> ranges = options.ranges;
  for (RangeReading& range : ranges) range.time_s += options.gps_time_offset_s;
  NumberTable table{{"t [s]", "range [m]"}, {}};
  for (const RangeReading& range : crop_to_span(ranges, frames, [](const RangeReading& r) { return r.time_s; }))
    table.rows.push_back({range.time_s, range.range_m});
  if (!table.rows.empty()) write_number_table(writer.temporary_folder() / "range.csv", table);
}

/// Ground truth and readings. They are read before the images, so that faults in them are found at once.
struct Companions {
  geometry::Trajectory groundtruth;           ///< of the camera, on the video's clock
  std::vector<geometry::ImuSample> readings;  ///< on the video's clock
  std::optional<ImuCalibration> noise;
};

/// The file's poses as those of the camera; none without a file.
geometry::Trajectory read_groundtruth(const IngestOptions& options) {
  if (options.groundtruth.empty()) return {};
  geometry::Trajectory trajectory = geometry::read_tum(options.groundtruth);
  for (geometry::StampedPose& pose : trajectory.poses) {
    pose.time_s += options.groundtruth_offset_s;
    pose.T_local_camera = pose.T_local_camera * options.T_truth_camera;
  }
  return trajectory;
}

/// Reads a table, or a log of Gyroflow or Betaflight.
std::vector<geometry::ImuSample> read_imu(const std::filesystem::path& file, std::vector<std::string>& notes) {
  if (!flight_logs::is_inertial_log(base::read_head(file))) return read_imu_csv(file, notes);
  flight_logs::InertialLog log = flight_logs::read_inertial_log(file);
  notes.insert(notes.end(), log.notes.begin(), log.notes.end());
  return std::move(log.readings);
}

Companions read_companions(const IngestOptions& options, std::vector<std::string>& notes) {
  Companions given;
  given.groundtruth = read_groundtruth(options);
  given.readings = options.imu.empty() ? options.camera_imu : read_imu(options.imu, notes);
  if (given.readings.empty()) {
    if (!options.imu_noise.empty() || options.imu_time_offset_s != 0.0)
      throw InputError(options.video_or_images.string(),
                       "has no readings of an inertial unit, but their noise or time offset is given; give the "
                       "readings: --imu (imu in an experiment)");
    return given;
  }
  for (geometry::ImuSample& reading : given.readings) reading.time_s += options.imu_time_offset_s;
  if (!options.imu_noise.empty()) given.noise = read_imu_noise(options.imu_noise);
  return given;
}

/// A unit's clock is rarely the video's: odometry that finds the rest of the offset needs readings beyond the frames.
void add_imu(DatasetWriter& writer, const Companions& given, const IngestOptions& options, const TimeSpan& frames,
             IngestResult& result) {
  constexpr double kBeyond_s = 1.0;
  if (given.readings.empty()) return;
  const TimeSpan covered{given.readings.front().time_s, given.readings.back().time_s};
  if (!options.imu.empty()) {
    require_overlap(options.imu.string(), covered, frames);
  } else if (!overlaps("record of its inertial unit", covered, frames, result)) {
    return;
  }
  const std::vector<geometry::ImuSample> readings =
      crop_to_span(given.readings, {frames.first - kBeyond_s, frames.last + kBeyond_s},
                   [](const geometry::ImuSample& reading) { return reading.time_s; });
  result.imu_readings = readings.size();
  write_imu_csv(writer.temporary_folder() / "imu.csv", readings);
  if (given.noise) write_imu_yaml(writer.temporary_folder() / "imu.yaml", *given.noise);
}

void add_groundtruth(DatasetWriter& writer, const geometry::Trajectory& all, const IngestOptions& options,
                     const TimeSpan& frames, IngestResult& result) {
  if (all.empty()) return;
  require_overlap(options.groundtruth.string(), {all.poses.front().time_s, all.poses.back().time_s}, frames);
  geometry::Trajectory trajectory;
  trajectory.poses = crop_to_span(all.poses, frames, [](const geometry::StampedPose& pose) { return pose.time_s; });
  result.groundtruth_poses = trajectory.size();
  writer.set_groundtruth(std::move(trajectory));
}

void describe(DatasetWriter& writer, const IngestOptions& options, const ScaledCalibration& fitted) {
  writer.describe("source", options.video_or_images.filename().string());
  for (std::size_t i = 0; i < options.further_parts.size(); ++i)
    writer.describe("source_part_" + std::to_string(i + 2), options.further_parts[i].filename().string());
  writer.describe("calibration.file", options.calibration.filename().string());
  if (!options.camera_id.empty()) writer.describe("calibration.camera", options.camera_id);
  if (!fitted.scaled_from.empty()) writer.describe("calibration.scaled_from", fitted.scaled_from);
  writer.describe("excerpt.from_s", base::fixed_text(options.excerpt.from_s));
  if (options.excerpt.to_s) writer.describe("excerpt.to_s", base::fixed_text(*options.excerpt.to_s));
  writer.describe("excerpt.every", std::to_string(options.excerpt.every));
  if (!options.gps.empty()) writer.describe("gps_time_offset_s", base::fixed_text(options.gps_time_offset_s));
  if (!options.imu.empty() || !options.camera_imu.empty())
    writer.describe("imu_time_offset_s", base::fixed_text(options.imu_time_offset_s));
  for (const auto& [key, value] : options.description) writer.describe(key, value);
}

/// Adds log, readings and ground truth of the frames' time span, and describes where everything came from.
void finish(DatasetWriter& writer, const IngestOptions& options, const ScaledCalibration& fitted,
            const Companions& given, IngestResult& result) {
  const TimeSpan frames{result.times_s.front(), result.times_s.back()};
  const TimeSpan on_body{frames.first + options.timeshift_s, frames.last + options.timeshift_s};
  add_gps(writer, options, on_body, result);
  add_attitudes(writer, options, on_body);
  add_ranges(writer, options, on_body);
  add_imu(writer, given, options, on_body, result);
  add_groundtruth(writer, given.groundtruth, options, frames, result);
  describe(writer, options, fitted);
  writer.finish();
}

/// Throws InputError if frames are missing at the end of the excerpt: frames are `period_s` apart and the video ends at
/// `end_s`.
void require_covers_excerpt(const IngestOptions& options, double end_s, double period_s) {
  if (!options.excerpt.to_s || end_s >= *options.excerpt.to_s - 0.5 * period_s) return;
  throw InputError(options.video_or_images.string(), "ends at " + format_seconds(end_s) +
                                                         ", before the end of the excerpt at " +
                                                         format_seconds(*options.excerpt.to_s));
}

void require_some(const IngestOptions& options, std::size_t frames) {
  if (frames == 0) throw InputError(options.video_or_images.string(), "no image lies within the excerpt");
}

DatasetWriter::Options writer_options(const IngestOptions& options) {
  DatasetWriter::Options out;
  out.replace = options.replace;
  out.command = "ingest";
  out.inputs = options.inputs;
  out.inputs.insert(out.inputs.end(), options.further_parts.begin(), options.further_parts.end());
  for (const fs::path& input :
       {options.video_or_images, options.calibration, options.imu, options.imu_noise, options.groundtruth})
    out.inputs.push_back(input);
  out.jpeg_quality = options.jpeg_quality;
  out.build_folder = options.part_folder;
  out.is_part = !options.part_folder.empty();
  return out;
}

ScaledCalibration fitted_calibration(const IngestOptions& options, IngestResult& result) {
  const int width = result.width, height = result.height;
  ScaledCalibration fitted =
      options.lens ? scaled_calibration(options.calibration.string(), *options.lens, width, height, result.notes)
                   : read_scaled_calibration(options.calibration, options.camera_id, width, height, result.notes);
  result.calibration = fitted.calibration;
  if (!options.imu.empty() && fitted.calibration.assumes_T_cam_imu)
    result.notes.push_back(unstated_mount_text(options.calibration.string()));
  return fitted;
}

/// Does the same for a video: a refusal names its rotation flag, or that its pixels are not square.
ScaledCalibration fitted_calibration(const IngestOptions& options, const video::VideoInfo& info, IngestResult& result) {
  const std::string size = video::describe_size(info);
  if (size.empty()) return fitted_calibration(options, result);
  try {
    return fitted_calibration(options, result);
  } catch (const InputError& fault) {
    throw InputError(options.video_or_images.string(), size + "; " + fault.what());
  }
}

/// Mounts a camera's own inertial unit, whose readings are in the camera's axes: as the calibration says if it says
/// that it is hardly turned, else at the camera's centre. Leaves the readings out where the calibration contradicts.
void mount_camera_imu(const IngestOptions& options, imaging::Calibration& calibration, Companions& given,
                      IngestResult& result) {
  constexpr double kHardly_rad = 10.0 * geometry::kRadiansPerDegree;
  if (!options.imu.empty() || given.readings.empty()) return;
  if (calibration.assumes_T_cam_imu) {
    calibration.T_cam_imu = geometry::SE3();
    calibration.assumes_T_cam_imu = false;
    result.notes.emplace_back(
        "where the inertial unit is in the camera is not recorded: it is taken to be at the camera's centre");
    return;
  }
  const double turned_rad = geometry::so3_log(calibration.T_cam_imu.rotation).norm();
  if (turned_rad <= kHardly_rad) return;
  given.readings.clear();
  given.noise.reset();
  result.notes.push_back(base::formatted(
      "the readings of the camera's inertial unit are left out: they are in the camera's axes, but T_cam_imu of %s is "
      "turned by %.0f degrees; leave it out of the file, or give the readings that it is for (--imu)",
      options.calibration.filename().c_str(), turned_rad / geometry::kRadiansPerDegree));
}

/// A video, or several that a camera cut one recording into.
class Recording {
 public:
  explicit Recording(const IngestOptions& options) {
    std::vector<fs::path> files{options.video_or_images};
    files.insert(files.end(), options.further_parts.begin(), options.further_parts.end());
    parts_ = open_parts(files);
    for (const Part& part : parts_) require_same(parts_.front(), part);
  }

  struct Part {
    fs::path file;
    video::VideoInfo info;
    double start_s = 0.0;  ///< on the clock of the first part
  };

  static std::vector<Part> open_parts(const std::vector<fs::path>& files) {
    std::vector<Part> parts;
    for (const fs::path& file : files) {
      double start_s = 0.0;
      if (!parts.empty()) {
        const Part& before = parts.back();
        if (!(before.info.duration_s > 0.0))
          throw InputError(before.file.string(),
                           "does not say how long it is, so nothing can be read after it; join the "
                           "parts first (ffmpeg -f concat)");
        start_s = before.start_s + before.info.duration_s;
      }
      parts.push_back({file, video::probe_video(file), start_s});
    }
    return parts;
  }

  const video::VideoInfo& info() const { return parts_.front().info; }
  /// Adds what is unusual about the images of the parts.
  void add_notes(std::vector<std::string>& notes) const {
    for (const Part& part : parts_) base::add_distinct(part.info.notes, notes);
  }
  double duration_s() const {
    return parts_.back().info.duration_s > 0.0 ? parts_.back().start_s + parts_.back().info.duration_s : 0.0;
  }

  /// Reads the excerpt as read_video() does, on the clock of the first part.
  std::vector<std::string> read(const video::VideoExcerpt& excerpt,
                                const std::function<bool(std::int64_t, double, const imaging::RgbImage&)>& on_frame) {
    if (parts_.size() == 1) return video::read_video(parts_.front().file, excerpt, on_frame);
    std::vector<std::string> notes;
    std::int64_t in_excerpt = 0;
    for (const Part& part : parts_) {
      if (excerpt.to_s && part.start_s >= *excerpt.to_s) break;
      if (part.start_s + part.info.duration_s <= excerpt.from_s + kRounding_s) continue;
      video::VideoExcerpt own{.from_s = std::max(0.0, excerpt.from_s - part.start_s), .to_s = {}, .every = 1};
      if (excerpt.to_s) own.to_s = *excerpt.to_s - part.start_s;
      base::add_distinct(video::read_video(part.file, own,
                                           [&](std::int64_t, double time_s, const imaging::RgbImage& image) {
                                             const std::int64_t at = in_excerpt++;
                                             return at % excerpt.every != 0 ||
                                                    on_frame(at / excerpt.every, part.start_s + time_s, image);
                                           }),
                         notes);
    }
    return notes;
  }

 private:
  static void require_same(const Part& first, const Part& other) {
    constexpr double kSameRate = 0.01;
    const double rate = first.info.frames_per_second;
    if (other.info.width == first.info.width && other.info.height == first.info.height &&
        std::abs(other.info.frames_per_second - rate) <= kSameRate * rate)
      return;
    throw InputError(other.file.string(), "has " + size_text(other.info.width, other.info.height) + " pixels at " +
                                              base::rounded_text(other.info.frames_per_second, 2) +
                                              " frames per second, " + first.file.filename().string() + " " +
                                              size_text(first.info.width, first.info.height) + " at " +
                                              base::rounded_text(rate, 2) +
                                              ": they are no parts of one recording; ingest each alone");
  }

  std::vector<Part> parts_;
};

/// The exposure nearest in time to a frame, at most half a period away; 0 without one. `exposures` increase in time.
double exposure_ms_at(const std::vector<ImageTime>& exposures, double time_s, double period_s) {
  auto later = std::ranges::lower_bound(exposures, time_s, {}, &ImageTime::time_s);
  if (later != exposures.begin() &&
      (later == exposures.end() || time_s - std::prev(later)->time_s < later->time_s - time_s))
    --later;
  const bool is_near = later != exposures.end() && std::abs(later->time_s - time_s) <= 0.5 * period_s;
  return is_near ? later->exposure_ms : 0.0;
}

void ingest_video(const IngestOptions& options, const fs::path& folder, Companions given, const Progress& progress,
                  IngestResult& result) {
  Recording recording(options);
  const video::VideoInfo& info = recording.info();
  const double duration_s = recording.duration_s();
  const double period_s = info.frames_per_second > 0.0 ? 1.0 / info.frames_per_second : kDefaultFramePeriod_s;
  const double shift_s = options.timeshift_s;
  if (duration_s > 0.0) require_covers_excerpt(options, duration_s + shift_s, period_s);
  result.width = info.width;
  result.height = info.height;
  recording.add_notes(result.notes);
  ScaledCalibration fitted = fitted_calibration(options, info, result);
  mount_camera_imu(options, fitted.calibration, given, result);
  result.calibration = fitted.calibration;
  DatasetWriter writer(folder, fitted.calibration, writer_options(options));

  const double end_s = options.excerpt.to_s.value_or(duration_s);
  const auto expected =
      static_cast<std::int64_t>((end_s - options.excerpt.from_s) / (period_s * options.excerpt.every));
  EncodeQueue queue(writer);
  double last_time_s = 0.0;
  const auto on_frame = [&](std::int64_t index, double time_s, const imaging::RgbImage& image) {
    last_time_s = time_s;
    if (!options.is_wanted || options.is_wanted(time_s, period_s)) {
      queue.add(result.times_s.size(), time_s, exposure_ms_at(options.exposures, time_s, period_s), image);
      result.times_s.push_back(time_s);
    }
    report_progress(progress, index + 1, std::max(expected, index + 1), "decoding video");
    return true;
  };
  video::VideoExcerpt own_clock = options.excerpt;
  own_clock.from_s = std::max(0.0, own_clock.from_s - shift_s);
  if (own_clock.to_s) *own_clock.to_s -= shift_s;
  base::add_distinct(recording.read(own_clock, on_frame), result.notes);
  queue.finish();
  require_some(options, result.times_s.size());
  // The container's duration may be wrong, so the frames decide.
  require_covers_excerpt(options, last_time_s + shift_s + period_s * options.excerpt.every, period_s);

  finish(writer, options, fitted, given, result);
}

/// Images in time order.
std::vector<Frame> timed_frames(const std::vector<fs::path>& images, const std::map<std::string, ImageTime>& times,
                                std::vector<std::string>& notes) {
  std::vector<Frame> frames;
  for (const fs::path& image : images) {
    if (const auto found = times.find(image.filename().string()); found != times.end())
      frames.push_back({{}, image, found->second.time_s, found->second.exposure_ms});
  }
  if (frames.size() < images.size())
    notes.push_back(std::to_string(images.size() - frames.size()) + " images skipped: they have no capture time");
  std::stable_sort(frames.begin(), frames.end(), [](const Frame& a, const Frame& b) { return a.time_s < b.time_s; });
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i].id = frame_id(i);
  warn_of_order(frames, "capture times of the photos", notes);
  return frames;
}

std::vector<Frame> image_frames(const IngestOptions& options, std::vector<std::string>& notes) {
  const fs::path& given = options.video_or_images;
  const fs::path folder = fs::is_directory(given / "images") ? given / "images" : given;
  const std::vector<fs::path> images = list_images(folder);
  for (const fs::path& times :
       {folder / "times.txt", fs::absolute(folder).lexically_normal().parent_path() / "times.txt"})
    if (fs::is_regular_file(times)) return read_timed_frames(images, times, notes);
  if (!options.image_times.empty()) return timed_frames(images, options.image_times, notes);
  constexpr double kUsualRate_hz = 30.0;
  const double rate_hz = options.image_rate_hz.value_or(kUsualRate_hz);
  if (!(rate_hz > 0.0)) throw InputError(given.string(), "the frame rate of the images must be above 0");
  if (!options.image_rate_hz)
    notes.push_back(given.string() + ": no times.txt; a frame rate of " + base::rounded_text(rate_hz, 3) +
                    " frames per second is assumed");
  note_order_by_numbers(images, notes);
  return make_uniform_frames(images, 1.0 / rate_hz);
}

std::vector<Frame> select_excerpt(const std::vector<Frame>& frames, const IngestOptions& options) {
  const video::VideoExcerpt& excerpt = options.excerpt;
  if (excerpt.every < 1)
    throw InputError(options.video_or_images.string(), "the step of the excerpt must be 1 or more frames");
  const double period_s =
      frames.size() > 1 ? (frames.back().time_s - frames.front().time_s) / static_cast<double>(frames.size() - 1) : 0.0;
  require_covers_excerpt(options, frames.back().time_s + options.timeshift_s + period_s, period_s);
  std::vector<Frame> inside;
  for (const Frame& frame : frames) {
    const double time_s = frame.time_s + options.timeshift_s + (options.timeshift_s == 0.0 ? 0.0 : kRounding_s);
    if (time_s >= excerpt.from_s && (!excerpt.to_s || time_s < *excerpt.to_s)) inside.push_back(frame);
  }
  std::vector<Frame> kept;
  for (std::size_t i = 0; i < inside.size(); i += static_cast<std::size_t>(excerpt.every)) {
    if (!options.is_wanted || options.is_wanted(inside[i].time_s, period_s)) kept.push_back(inside[i]);
  }
  require_some(options, kept.size());
  return kept;
}

/// Copies a JPEG or PNG file (after decoding it once to detect damage and to get its size); WebP is re-encoded as a
/// video's frames are, other formats without loss.
void add_image(DatasetWriter& writer, std::size_t index, const Frame& frame, int width, int height) {
  const std::vector<std::byte> bytes = base::read_bytes(frame.image);
  const imaging::RgbImage image = imaging::decode_rgb(bytes, frame.image.string());
  if (image.width != width || image.height != height)
    throw InputError(frame.image.string(), "has " + size_text(image.width, image.height) + " pixels, the first image " +
                                               size_text(width, height));
  if (bytes[0] == std::byte{0xFF})
    return writer.add_encoded_frame(index, frame.time_s, frame.exposure_ms, bytes, ".jpg");
  if (bytes[0] == std::byte{0x89})
    return writer.add_encoded_frame(index, frame.time_s, frame.exposure_ms, bytes, ".png");
  if (bytes[0] == std::byte{'R'}) return writer.add_frame(index, frame.time_s, frame.exposure_ms, image);
  writer.add_encoded_frame(index, frame.time_s, frame.exposure_ms, imaging::recode_png(bytes, frame.image.string()),
                           ".png");
}

void ingest_images(const IngestOptions& options, const fs::path& folder, const Companions& given,
                   const Progress& progress, IngestResult& result) {
  const std::vector<Frame> frames = select_excerpt(image_frames(options, result.notes), options);
  const imaging::RgbImage first = imaging::read_rgb(frames.front().image);
  result.width = first.width;
  result.height = first.height;
  for (const Frame& frame : frames) result.times_s.push_back(frame.time_s);
  const ScaledCalibration fitted = fitted_calibration(options, result);
  DatasetWriter writer(folder, fitted.calibration, writer_options(options));
  std::mutex mutex;
  std::int64_t done = 0;
  tbb::parallel_for(std::size_t{0}, frames.size(), [&](std::size_t i) {
    add_image(writer, i, frames[i], first.width, first.height);
    const std::lock_guard lock(mutex);
    report_progress(progress, ++done, static_cast<std::int64_t>(frames.size()), "copying images");
  });
  finish(writer, options, fitted, given, result);
}

}  // namespace

std::vector<double> part_starts_s(const std::vector<fs::path>& parts) {
  std::vector<double> starts_s;
  for (const Recording::Part& part : Recording::open_parts(parts)) starts_s.push_back(part.start_s);
  return starts_s;
}

IngestResult ingest(const IngestOptions& options, const fs::path& dataset_folder, const Progress& progress) {
  if (options.jpeg_quality < 1 || options.jpeg_quality > 100) throw InputError("jpeg_quality", "must be from 1 to 100");
  if (!fs::exists(options.video_or_images))
    throw InputError(options.video_or_images.string(), "no such video file or image folder");
  for (const fs::path& part : options.further_parts) {
    if (fs::is_directory(part) || fs::is_directory(options.video_or_images))
      throw InputError(part.string(), "folders of images are not joined; copy the images into one folder");
  }
  IngestResult result;
  Companions given = read_companions(options, result.notes);
  if (fs::is_directory(options.video_or_images))
    ingest_images(options, dataset_folder, given, progress, result);
  else
    ingest_video(options, dataset_folder, std::move(given), progress, result);
  result.frames = result.times_s.size();
  return result;
}

}  // namespace tileflight::dataset
