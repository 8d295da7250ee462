#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tileflight/dataset/attitude_csv.h"
#include "tileflight/dataset/dataset.h"
#include "tileflight/dataset/video.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::dataset {

struct ImageTime {
  double time_s = 0.0;
  double exposure_ms = 0.0;  ///< 0: unknown
};

/// What a range finder that looks down said.
struct GroundRange {
  double time_s = 0.0;
  double range_m = 0.0;
};

/// A real flight, as it comes from the camera and the log.
struct IngestOptions {
  std::filesystem::path video_or_images;  ///< a video file, or a folder of images (with times.txt in it or beside it,
                                          ///< else `image_rate_hz`)
  std::filesystem::path calibration;      ///< of any form that imaging::read_calibration knows
  std::string camera_id;                  ///< of a calibration that holds several cameras; empty: it holds one
  VideoExcerpt excerpt;                   ///< on the video's clock (first frame at 0; images: the times of times.txt)
  double image_rate_hz = 30.0;            ///< of an image folder without times.txt
  /// When the images of a folder without times.txt were taken, by file name; empty: not known. Images that are not
  /// named here are left out (and noted).
  std::map<std::string, ImageTime> image_times;
  std::vector<GpsFix> gps;                         ///< of the flight's log, on the log's clock
  std::vector<CameraAttitude> attitudes;           ///< the same log's, of the camera
  std::vector<GroundRange> ranges;                 ///< the same log's
  double gps_time_offset_s = 0.0;                  ///< video time = log time + this
  std::filesystem::path groundtruth;               ///< TUM poses on the video's clock; may be empty
  int jpeg_quality = 95;                           ///< of a video's frames; image files are copied as they are
  bool replace = false;                            ///< an existing dataset folder
  std::vector<std::filesystem::path> inputs{};     ///< what the caller has read beside what is named here
  std::map<std::string, std::string> description;  ///< further lines of dataset.yaml, "a.b" nests
};

struct IngestResult {
  std::size_t frames = 0;
  double first_time_s = 0.0, last_time_s = 0.0;  ///< on the video's clock, which is the dataset's
  int width = 0, height = 0;
  std::size_t gps_fixes = 0;          ///< within the excerpt (and one either side)
  std::size_t groundtruth_poses = 0;  ///< the same
  std::vector<std::string> notes;     ///< e.g. that the calibration was scaled
};

/// Writes the flight as a dataset folder, whole or not at all; the bytes do not depend on the number of threads. A
/// calibration for another size of the same aspect ratio is scaled (and noted). Throws InputError (file, cause, cure):
/// an excerpt that the video does not cover, a calibration for another shape, telemetry or ground truth without a
/// moment in common with the frames, and what read_video, read_calibration and DatasetWriter say.
IngestResult ingest(const IngestOptions& options, const std::filesystem::path& dataset_folder,
                    const Progress& progress = {});

}  // namespace tileflight::dataset
