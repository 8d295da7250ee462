#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/dataset/video.h"
#include "tileflight/flight/smoothing.h"
#include "tileflight/render/image_formation.h"
#include "tileflight/survey/render_outputs.h"

namespace tileflight::survey {

/// Section `render:`: a flight rendered from the place's tiles. Keys: flight | follow, smooth, camera, source,
/// resolution, samples_per_pixel, max_frames, pixel_error, memory, outputs, degrade.
struct RenderedFlightConfig {
  std::filesystem::path flight;  ///< FLIGHT file; empty if another flight is followed
  bool follows_real = false;     ///< follow: real: uses the estimated path of the second flight, with its lens
  /// smooth: smoothing of the followed path ("auto", "none", seconds between knots); nullopt: interpolate every pose.
  std::optional<flight::SmoothingOptions> smoothing = flight::SmoothingOptions{};
  std::filesystem::path camera;      ///< calibration that replaces the flight's; empty: the flight's
  std::string source;                ///< another model of the same place; empty: the place's source
  std::optional<int> width, height;  ///< image size that replaces the camera's; both or neither
  int samples_per_pixel = 1;
  std::optional<int> max_frames;
  std::optional<double> error_px;   ///< pixel_error: RenderSettings::error_px; nullopt: the tiles of the region
  std::optional<double> memory_gb;  ///< memory: limit for tiles; nullopt: half of the machine's memory
  RenderOutputs outputs;            ///< outputs: a list of names, "depth, flow"
  std::optional<render::ImageFormation> degrade;  ///< imperfections of the second flight's camera
  std::optional<dataset::VideoCompression>
      video;  ///< video_crf, video_bitrate: H.264 compression of the frames; nullopt: none
};

/// What one camera of a rig took.
struct CameraVideo {
  std::string camera;           ///< its name in the rig's file; empty: by the order there
  std::filesystem::path video;  ///< video file or folder of images
};

/// Section `ingest:`: a filmed flight. Keys: video, camera, camera_id, telemetry, telemetry_height, takeoff_height,
/// telemetry_offset, groundtruth, from, to, every, fps, sync_tolerance.
struct IngestedFlightConfig {
  std::filesystem::path video;      ///< video file or folder of images; empty if there are `videos`
  std::vector<CameraVideo> videos;  ///< video: {NAME: PATH, ...}, of a rig's cameras
  std::filesystem::path camera;     ///< calibration; of a rig: what read_rig_cameras reads
  std::string
      camera_id;  ///< which of several cameras in the file: COLMAP's CAMERA_ID, Kalibr's cam0; empty: the only one
  std::filesystem::path telemetry;           ///< flight_logs::read_telemetry; empty: none
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

}  // namespace tileflight::survey
