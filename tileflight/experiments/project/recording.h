#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/ingest/embedded_telemetry.h"
#include "tileflight/data/flight_logs/photo_log.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/experiments/project/choice.h"

namespace tileflight::project {

/// Names the files of one flight. Empty paths are searched for beside the videos.
struct RecordingFiles {
  std::vector<std::filesystem::path> videos;  ///< the parts of one recording, or one folder of photos
  std::filesystem::path telemetry;            ///< flight log
  std::filesystem::path imu;                  ///< readings of an inertial unit
  std::optional<double> from_s, to_s;         ///< the part to use, seconds of the recording; else it is chosen
};

/// Holds what a flight's files say before any image is decoded.
struct Recording {
  std::vector<std::filesystem::path> parts;   ///< in the order of the flight
  std::vector<std::filesystem::path> images;  ///< of a folder, in the order of their names; empty for videos
  int width = 0, height = 0;                  ///< of the images, turned as a rotation flag says
  double pixel_aspect = 1.0;                  ///< width of a pixel as it is shown, divided by its height
  std::string size_reason;                    ///< video::describe_size(); empty for photos
  double frames_per_second = 0.0;             ///< of images without times: as `ingest` assumes, 30
  double duration_s = 0.0;
  double from_s = 0.0, to_s = 0.0;    ///< the part that was given, else the whole: only its images are looked at
  std::vector<double> part_starts_s;  ///< on the clock of the first part
  std::optional<ingest::EmbeddedTelemetry> own;
  flight_logs::PhotoLog photos;
  /// The log's, the video's or the photos' positions; may have no fixes. Times are on the video's clock if
  /// `has_video_clock`.
  flight_logs::Telemetry telemetry;
  std::filesystem::path telemetry_source;  ///< for messages
  bool has_video_clock = true;
  std::vector<Choice> choices;  ///< video, telemetry, imu
  std::vector<std::string> warnings;

  bool is_folder() const { return !images.empty(); }
  bool has_positions() const { return !telemetry.fixes.empty(); }
};

/// Reads what the files state: size, rate and length, embedded telemetry, photos' tags; and takes the flight log and
/// the inertial readings that lie beside the video: of its name, or the only ones in a folder with one video. Throws
/// InputError (file, cause): no video and no photos, several folders, parts of different size or rate, a log that was
/// given and cannot be read, a part that is not in the recording.
Recording examine_files(const RecordingFiles& files);

/// Returns the files beside a video that may belong to it: those of its name first, then, if the folder has no other
/// video, all others with one of the endings (lower case, with the dot), in alphabetic order.
std::vector<std::filesystem::path> files_beside(const std::filesystem::path& video,
                                                const std::vector<std::string>& endings);

}  // namespace tileflight::project
