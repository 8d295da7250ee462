#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/imu_sample.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/video/video.h"

namespace tileflight::dataset {

/// Capture time of an image.
struct ImageTime {
  double time_s = 0.0;
  double exposure_ms = 0.0;  ///< 0: unknown
};

/// A reading of a downward-looking range finder.
struct RangeReading {
  double time_s = 0.0;
  double range_m = 0.0;
};

/// Inputs of a real flight: camera files and log.
struct IngestOptions {
  std::filesystem::path video_or_images;  ///< a video file, or a folder of images (with times.txt in it or beside it,
                                          ///< else `image_rate_hz`)
  std::vector<std::filesystem::path> further_parts;  ///< videos that continue `video_or_images`, in order: the parts
                                                     ///< into which a camera splits a recording
  std::filesystem::path calibration;                 ///< any format of imaging::read_calibration
  std::string camera_id;                ///< camera to use of a calibration with several; empty: it has only one
  video::VideoExcerpt excerpt;          ///< on the video's clock (first frame at 0; images: times of times.txt)
  std::optional<double> image_rate_hz;  ///< frame rate of an image folder without times.txt; none: 30, with a note
  /// Capture times for a folder without times.txt, by file name; empty: unknown. Images that are not in the map are
  /// left out (with a note).
  std::map<std::string, ImageTime> image_times;
  std::vector<GpsFix> gps;                ///< from the flight's log, on the log's clock
  std::vector<CameraAttitude> attitudes;  ///< camera attitudes of the same log
  std::vector<RangeReading> ranges;       ///< range finder of the same log
  double gps_time_offset_s = 0.0;         ///< video time = log time + this
  std::filesystem::path imu;              ///< readings, for read_imu_csv(); may be empty
  std::filesystem::path imu_noise;        ///< of the unit, for read_imu_noise(); may be empty
  double imu_time_offset_s = 0.0;         ///< video time = the unit's time + this
  /// Readings in the axes of the camera as its frames are shown, in place of those of `imu`; may be empty. They are
  /// left out, with a note, if they lie outside the excerpt or the calibration states that the unit is turned against
  /// the camera.
  std::vector<geometry::ImuSample> camera_imu;
  std::vector<ImageTime> exposures;   ///< of a video's frames, on its clock, increasing; may be empty
  bool has_own_positions = false;     ///< `gps` is what the video holds itself: if it lies outside the excerpt, a note
                                      ///< says so
  std::filesystem::path groundtruth;  ///< TUM poses on the video's clock; may be empty
  int jpeg_quality = 95;              ///< for a video's frames; image files are copied
  bool replace = false;               ///< replaces an existing dataset folder
  std::vector<std::filesystem::path> inputs{};  ///< files the caller has read besides those named here
  std::optional<imaging::Calibration> lens{};   ///< in place of the one in the file `calibration`
  double timeshift_s = 0.0;  ///< of a rig's camera (rig.h): the excerpt and the log are on the body's clock
  /// Poses of the camera, on its clock: those of `groundtruth`, later by `groundtruth_offset_s`, times this.
  geometry::SE3 T_truth_camera{};
  double groundtruth_offset_s = 0.0;
  /// Selects the frames of the excerpt that are taken, by their time and the time between two frames; empty: all.
  std::function<bool(double time_s, double period_s)> is_wanted{};
  /// Folder in which a camera's part of a rig's dataset is built, and left (ingest_rig.h). Empty: a dataset of its own.
  std::filesystem::path part_folder{};
  std::map<std::string, std::string> description;  ///< additional keys of dataset.yaml, "a.b" nests
};

/// Returns the times at which the parts of one recording begin, on the clock of the first. Throws InputError (file,
/// cause) for a part that is no video, and for one before the last that does not say how long it is.
std::vector<double> part_starts_s(const std::vector<std::filesystem::path>& parts);

/// Result of ingest().
struct IngestResult {
  std::size_t frames = 0;
  std::vector<double> times_s;  ///< of the frames, on the video's clock, which is the dataset's
  int width = 0, height = 0;
  imaging::Calibration calibration;   ///< for images of this size
  std::size_t gps_fixes = 0;          ///< within the excerpt, plus one on either side
  std::size_t imu_readings = 0;       ///< within the excerpt and a second on either side
  std::size_t groundtruth_poses = 0;  ///< within the excerpt, plus one on either side
  std::vector<std::string> notes;     ///< e.g. that the calibration was scaled
};

/// Writes the flight as a dataset folder, atomically; the bytes do not depend on the number of threads. A calibration
/// for another size of the same aspect ratio is scaled (with a note). Throws InputError (file, cause, remedy): an
/// excerpt that the video does not cover, a calibration for another aspect ratio, telemetry, readings or ground truth
/// that do not overlap the frames in time, and errors of read_video, read_calibration, read_imu_csv, read_imu_noise and
/// DatasetWriter.
IngestResult ingest(const IngestOptions& options, const std::filesystem::path& dataset_folder,
                    const Progress& progress = {});

}  // namespace tileflight::dataset
