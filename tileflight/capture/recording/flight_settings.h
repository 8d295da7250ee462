#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/flight_path/smooth_path.h"
#include "tileflight/capture/recording/render_outputs.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/data/dataset/video.h"

namespace tileflight::recording {

/// Section `render:`: a flight rendered from the place's tiles. Keys: flight | follow, smooth, camera, source,
/// resolution, samples_per_pixel, max_frames, pixel_error, memory, outputs, degrade.
struct RenderedFlightConfig {
  std::filesystem::path flight;  ///< FLIGHT file; empty if another flight is followed
  bool follows_real = false;     ///< follow: real: uses the estimated path of the second flight, with its lens
  /// smooth: smoothing of the followed path ("auto", "none", seconds between knots); nullopt: interpolate every pose.
  std::optional<flight_path::SmoothingOptions> smoothing = flight_path::SmoothingOptions{};
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

}  // namespace tileflight::recording
