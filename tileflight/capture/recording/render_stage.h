#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/capture/recording/flight_settings.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/core/jobs/balanced_ranges.h"
#include "tileflight/core/jobs/ranks.h"

namespace tileflight::recording {

/// How several processes divide a render (PartRenderer).
enum class Dealt {
  kAuto,    ///< the one that is estimated to take less processor time (tile_shares.h)
  kFrames,  ///< each renders a range of frames
  kTiles,   ///< each traces all frames against its part of the tiles
};

struct FlownPath;
struct RenderSettings;

/// Flies the autopilot of a flight plan among the tiles that the settings choose for images. Throws InputError.
using AutopilotFlyer = std::function<FlownPath(const vehicle::FlightPlan& plan, const RenderSettings& settings,
                                               const Progress& progress)>;

/// Settings for rendering a flight through tiles as a sensor dataset.
struct RenderSettings {
  std::string source;       ///< SOURCE of the contract
  tileset::LoadOptions load;  ///< region, geometric error, origin of the local frame
  RenderedFlightConfig flight;
  std::uint64_t seed = 1;  ///< for noise and the simulated receiver
  bool png = false;
  /// Load the tiles that the flight sees, with an error of at most this many pixels, instead of the region's.
  std::optional<double> error_px;
  /// Memory limit for tiles. A flight that needs more is rendered in several passes from the same tiles. Default: half
  /// of the machine's memory.
  std::optional<std::uintmax_t> max_memory_bytes;
  Dealt dealt = Dealt::kAuto;
  /// Region of the output `visibility`, local frame. Default: the region of `load`, else everything.
  std::optional<geometry::Box3> scored;
  std::vector<std::filesystem::path> inputs;  ///< all input files; none is ever replaced
  /// Store finished frames beside the dataset until it is complete, and reuse those of an earlier interrupted render
  /// (frame_store.h). Always done with several ranks, and if stored frames exist.
  bool resume = false;
  /// Render only these frames, for a later render with `resume`; no dataset is written.
  std::optional<jobs::IndexRange> part;
  /// All inputs of the images except flight and tiles, as text: stored frames with other inputs are not reused.
  nlohmann::json asked;
  AutopilotFlyer fly_autopilot;  ///< a flight with an autopilot is refused without it
};

/// The input files and folders of a rendered flight. Throws InputError.
std::vector<std::filesystem::path> render_input_files(const RenderSettings& settings);

/// Renders the flight into a dataset folder, written atomically. With video compression, the frames are encoded to
/// H.264 and decoded again, and the video is stored as video.mp4; the other outputs are unaffected. Poses are
/// groundtruth.txt; simulated receiver positions are gps.csv if the place is georeferenced. Returns a summary (frames,
/// seconds, frames a second, parts, warnings). Throws InputError. `ranks`: processes that share the frames and produce
/// the same files as a single one; all are called with the same arguments. The first writes everything except the
/// frames and returns the summary, the others return null. If one fails, all throw (CollectiveError). With a part:
/// {frames, frames_rendered, build_folder}.
nlohmann::json render_dataset(const RenderSettings& settings, const std::filesystem::path& out, bool replace,
                              const Progress& progress = {}, jobs::Ranks* ranks = nullptr);

/// Division of a render into parts.
struct FramePlan {
  std::vector<jobs::IndexRange> parts;  ///< of the flight's frames
  std::string inputs_sha256;                ///< equal inputs give equal frames
};

/// Cuts a flight's frames into `parts`, fewer if a part would have only a few frames. Throws InputError.
FramePlan plan_frame_parts(const RenderSettings& settings, int parts, const Progress& progress = {});

/// Where the finished frames of a dataset are kept until it is complete.
std::filesystem::path frame_build_folder(const std::filesystem::path& dataset);

/// The folder that render_dataset() writes. Throws InputError for a flight that cannot be read.
base::OutputFolder render_output(const RenderSettings& settings, const std::filesystem::path& out, bool replace);

}  // namespace tileflight::recording
