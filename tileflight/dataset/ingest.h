#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tileflight/base/progress.h"
#include "tileflight/dataset/attitude_csv.h"
#include "tileflight/dataset/dataset.h"
#include "tileflight/dataset/video.h"

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
  std::filesystem::path calibration;      ///< any format of imaging::read_calibration
  std::string camera_id;                  ///< camera to use of a calibration with several; empty: it has only one
  VideoExcerpt excerpt;                   ///< on the video's clock (first frame at 0; images: times of times.txt)
  double image_rate_hz = 30.0;            ///< frame rate of an image folder without times.txt
  /// Capture times for a folder without times.txt, by file name; empty: unknown. Images that are not in the map are
  /// left out (with a note).
  std::map<std::string, ImageTime> image_times;
  std::vector<GpsFix> gps;                         ///< from the flight's log, on the log's clock
  std::vector<CameraAttitude> attitudes;           ///< camera attitudes of the same log
  std::vector<RangeReading> ranges;                ///< range finder of the same log
  double gps_time_offset_s = 0.0;                  ///< video time = log time + this
  std::filesystem::path groundtruth;               ///< TUM poses on the video's clock; may be empty
  int jpeg_quality = 95;                           ///< for a video's frames; image files are copied
  bool replace = false;                            ///< replaces an existing dataset folder
  std::vector<std::filesystem::path> inputs{};     ///< files the caller has read besides those named here
  std::map<std::string, std::string> description;  ///< additional keys of dataset.yaml, "a.b" nests
};

/// Result of ingest().
struct IngestResult {
  std::size_t frames = 0;
  double first_time_s = 0.0, last_time_s = 0.0;  ///< on the video's clock, which is the dataset's
  int width = 0, height = 0;
  std::size_t gps_fixes = 0;          ///< within the excerpt, plus one on either side
  std::size_t groundtruth_poses = 0;  ///< within the excerpt, plus one on either side
  std::vector<std::string> notes;     ///< e.g. that the calibration was scaled
};

/// Writes the flight as a dataset folder, atomically; the bytes do not depend on the number of threads. A calibration
/// for another size of the same aspect ratio is scaled (with a note). Throws InputError (file, cause, remedy): an
/// excerpt that the video does not cover, a calibration for another aspect ratio, telemetry or ground truth that does
/// not overlap the frames in time, and errors of read_video, read_calibration and DatasetWriter.
IngestResult ingest(const IngestOptions& options, const std::filesystem::path& dataset_folder,
                    const Progress& progress = {});

}  // namespace tileflight::dataset
