#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/flight_path/smooth_path.h"
#include "tileflight/capture/recording/render_outputs.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/jobs/balanced_ranges.h"
#include "tileflight/data/video/video.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::recording {

/// Settings of a rendered flight, section `render:`. Keys: flight | follow, smooth, camera, source,
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
  std::optional<video::VideoCompression>
      video;  ///< video_crf, video_bitrate: H.264 compression of the frames; nullopt: none
};

struct FlownPath;
struct RenderSettings;

/// Flies the autopilot of a flight plan among the tiles that the settings choose for images. Throws InputError.
using AutopilotFlyer =
    std::function<FlownPath(const vehicle::FlightPlan& plan, const RenderSettings& settings, const Progress& progress)>;

/// Settings for rendering a flight through tiles as a sensor dataset.
struct RenderSettings {
  std::string source;         ///< SOURCE of the contract
  tileset::LoadOptions load;  ///< region, geometric error, origin of the local frame
  RenderedFlightConfig flight;
  std::uint64_t seed = 1;  ///< for noise and the simulated receiver
  bool png = false;
  /// Load the tiles that the flight sees, with an error of at most this many pixels, instead of the region's.
  std::optional<double> error_px;
  /// Memory limit for tiles. A flight that needs more is rendered in several passes from the same tiles. Default: half
  /// of the machine's memory.
  std::optional<std::uintmax_t> max_memory_bytes;
  /// Region of the output `visibility`, local frame. Default: the region of `load`, else everything.
  std::optional<geometry::Box3> scored;
  std::vector<std::filesystem::path> inputs;  ///< all input files; none is ever replaced
  /// Store finished frames beside the dataset until it is complete, and reuse those of an earlier interrupted render
  /// (frame_store.h). Always done if stored frames exist.
  bool resume = false;
  /// All inputs of the images except flight and tiles, as text: stored frames with other inputs are not reused.
  nlohmann::json asked;
  AutopilotFlyer fly_autopilot;  ///< a flight with an autopilot is refused without it
};

/// Lists the input files and folders of a rendered flight. Throws InputError.
std::vector<std::filesystem::path> render_input_files(const RenderSettings& settings);

/// Result of rendering a flight.
struct RenderResult {
  std::size_t frames = 0;         ///< number of images of all cameras
  std::size_t frames_reused = 0;  ///< images that an earlier, interrupted render finished
  std::size_t cameras = 1;
  std::uint64_t events = 0;     ///< number of events of all event cameras
  double seconds = 0.0;         ///< time spent rendering
  std::int64_t tiles = 0;       ///< tiles of the flight
  std::int64_t tiles_read = 0;  ///< how often tiles were read; more than `tiles` if some were read again
  std::int64_t parts = 0;       ///< scenes that were built, because of memory or of groups of frames
  std::int64_t triangles = 0;   ///< number of triangles in the largest scene
  bool is_complete = true;      ///< whether all tiles could be read
  double path_length_m = 0.0;
  std::vector<std::string> warnings;

  double frames_per_second() const { return seconds > 0.0 ? static_cast<double>(frames) / seconds : 0.0; }
};

/// The result as `tileflight render --json` prints it.
nlohmann::json to_json(const RenderResult& result);

/// Renders the flight into a dataset folder, written atomically. With video compression, the frames are encoded to
/// H.264 and decoded again, and the video is stored as video.mp4; the other outputs are unaffected. Poses are
/// groundtruth.txt; simulated receiver positions are gps.csv if the place is georeferenced. Throws InputError.
RenderResult render_dataset(const RenderSettings& settings, const std::filesystem::path& out, bool replace,
                            const Progress& progress = {});

/// Result of rendering some of a flight's frames.
struct RenderedPart {
  std::size_t frames = 0;           ///< number of images in the range
  std::size_t frames_rendered = 0;  ///< those that were not finished before
  std::filesystem::path build_folder;
};

/// The result as `tileflight render --frames --json` prints it.
nlohmann::json to_json(const RenderedPart& part);

/// Renders only these frames and stores them beside the dataset `out`; render_dataset() with `resume` then reuses them.
/// Frames that are stored already, rendered from the same tiles, are kept. Throws InputError.
RenderedPart render_part(const RenderSettings& settings, const jobs::IndexRange& frames,
                         const std::filesystem::path& out, const Progress& progress = {});

/// Division of a render into parts.
struct FramePlan {
  std::vector<jobs::IndexRange> parts;  ///< of the flight's frames
  std::string inputs_sha256;            ///< equal inputs give equal frames
};

/// Cuts a flight's frames into `parts`, fewer if a part would have only a few frames. Throws InputError.
FramePlan plan_frame_parts(const RenderSettings& settings, int parts, const Progress& progress = {});

/// Returns the folder in which the finished frames of a dataset are kept until it is complete.
std::filesystem::path frame_build_folder(const std::filesystem::path& dataset);

/// Describes the folder that render_dataset() writes. Throws InputError for a flight that cannot be read.
base::OutputFolder render_output(const RenderSettings& settings, const std::filesystem::path& out, bool replace);

}  // namespace tileflight::recording
