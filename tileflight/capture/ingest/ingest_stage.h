#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/ingest/telemetry_offset.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/data/dataset/ingest_rig.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::ingest {

/// The images that one camera of a rig took.
struct CameraVideo {
  std::string camera;           ///< its name in the rig's file; empty: by the order there
  std::filesystem::path video;  ///< video file or folder of images
};

/// Settings of a filmed flight, section `ingest:`. Keys: video, camera, camera_id, telemetry, telemetry_height,
/// takeoff_height, telemetry_offset, groundtruth, from, to, every, fps, sync_tolerance.
struct IngestedFlightConfig {
  std::filesystem::path video;      ///< video file or folder of images; empty if there are `videos`
  std::vector<CameraVideo> videos;  ///< video: {NAME: PATH, ...}, of a rig's cameras
  std::filesystem::path camera;     ///< calibration; of a rig: what read_rig_cameras reads; empty: the photos' own
  std::string
      camera_id;  ///< which of several cameras in the file: COLMAP's CAMERA_ID, Kalibr's cam0; empty: the only one
  std::filesystem::path telemetry;           ///< read_flight_log(); empty: none
  std::string telemetry_height;              ///< ellipsoid | sea-level | takeoff; height reference (datum) of the log
  std::optional<double> takeoff_height_m;    ///< of the take-off point above the ellipsoid, for heights above it
  std::optional<double> telemetry_offset_s;  ///< added to the log's times; none: estimated during alignment
  bool estimates_telemetry_offset = false;   ///< telemetry_offset: auto; estimated from the motion seen by both
  std::filesystem::path imu;                 ///< readings of an inertial unit (dataset::read_imu_csv); empty: none
  std::filesystem::path imu_noise;           ///< dataset::read_imu_noise; empty: not known
  double imu_time_offset_s = 0.0;            ///< added to the unit's times to get the video's
  std::filesystem::path groundtruth;         ///< TUM poses for scoring; empty: none
  double from_s = 0.0;
  std::optional<double> to_s;
  int every = 1;
  std::optional<double> fps;       ///< frame rate of an image folder without times
  double sync_tolerance_s = 1e-3;  ///< of a rig: images that differ by no more are of one instant
};

/// The flight that a log's positions describe, by which a wrong unit, order or degree shows.
struct LoggedFlight {
  double duration_s = 0.0;
  double length_m = 0.0;
  double largest_speed_m_s = 0.0;          ///< mean over at least a second, so that a receiver's noise does not count
  double lowest_m = 0.0, highest_m = 0.0;  ///< above the ellipsoid
};

/// Result of ingesting a flight.
struct IngestResult {
  std::string embedded;                                     ///< describe(EmbeddedTelemetry) of the video; empty: none
  dataset::IngestResult dataset;                            ///< of the camera, or a rig's first one
  std::optional<LoggedFlight> flight;                       ///< set if there are positions
  std::optional<TelemetryOffset> time_offset;               ///< set if it was estimated
  std::optional<dataset::Synchronisation> synchronisation;  ///< set for a rig
  std::vector<std::string> warnings;
};

/// The result as `tileflight ingest --json` prints it.
nlohmann::json to_json(const IngestResult& result);

/// Reads a flight log as flight_logs::read_telemetry() does, or the positions that a video holds
/// (read_embedded_telemetry). Throws InputError as these do, and for a video without positions.
flight_logs::Telemetry read_flight_log(const std::filesystem::path& file);

/// Converts a filmed flight to a dataset folder of the same layout, written atomically. Log positions become gps.csv
/// (ellipsoidal heights); without a log those that the video holds itself, as its inertial readings without `imu`, and
/// its exposures. `truth`: a folder written by extract(), from whose surface the height of the take-off point
/// is determined if it is needed and not given; empty: none. With `videos`, it writes the dataset of a rig; a camera
/// whose images do not match the others' causes a warning. Throws InputError.
IngestResult ingest_dataset(const IngestedFlightConfig& flight, const std::filesystem::path& truth,
                            const std::filesystem::path& out, bool replace, const Progress& progress = {});

}  // namespace tileflight::ingest
