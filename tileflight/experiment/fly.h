#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/experiment/experiment_file.h"
#include "tileflight/experiment/ranks.h"
#include "tileflight/geometry/progress.h"
#include "tileflight/tiles/load.h"

namespace tileflight::experiment {

/// A flight through tiles as a sensor dataset: what is loaded, how it is flown, with which camera.
struct RenderSettings {
  std::string source;       ///< SOURCE of the contract
  tiles::LoadOptions load;  ///< region, geometric error, origin of the local frame
  RenderFlight flight;
  std::uint64_t seed = 1;  ///< of noise and of the simulated receiver
  bool png = false;
  /// Load what the flight looks at, erring by at most so many pixels, instead of what the region holds.
  std::optional<double> error_px;
  /// Tiles that may be in memory at once. A flight that looks at more is rendered in parts, from the same tiles; none
  /// given: half of what the machine has.
  std::optional<std::uintmax_t> max_memory_bytes;
  /// What the output `visibility` is about, local frame. None: the region that `load` names, else everything.
  std::optional<geometry::Box3> scored;
  std::vector<std::filesystem::path> inputs;  ///< files that were read for all this; none is ever replaced
  /// Keep finished frames beside the dataset until it is whole, and take up those that an earlier render left there
  /// (kept_frames.h). Several ranks do so, and whoever finds some there.
  bool resume = false;
  /// Everything that the pictures are made from but flight and tiles, as text: frames that were made with another are
  /// not taken up.
  nlohmann::json asked;
};

/// The files and folders that a flight is rendered from. Throws InputError.
std::vector<std::filesystem::path> files_read(const RenderSettings& settings);

/// Renders the flight into a dataset folder, written whole. With a video rate factor the frames go through H.264 and
/// back, and the video stands in the folder as video.mp4; other outputs are of what the camera saw before. Poses are
/// groundtruth.txt; positions as a receiver would give them are gps.csv, where the place is georeferenced. Returns a
/// summary (frames, seconds, frames a second, parts, warnings). Throws InputError.
/// `ranks`: the processes that share the frames out among them, to the same files as one alone; each gives the same
/// arguments, the first one writes what is not a frame's and returns the summary, the others null. Then what one fails
/// at all throw (FailedTogether).
nlohmann::json render_dataset(const RenderSettings& settings, const std::filesystem::path& out, bool replace,
                              const Progress& progress = {}, Ranks* ranks = nullptr);

/// A filmed flight as a dataset folder of the same layout, written whole. Log positions become gps.csv (ellipsoidal
/// heights). `truth`: a folder that extract() wrote, on whose surface the take-off place's height is found where it is
/// needed and not given; empty: none. Throws InputError.
nlohmann::json ingest_dataset(const IngestFlight& flight, const std::filesystem::path& truth,
                              const std::filesystem::path& out, bool replace, const Progress& progress = {});

}  // namespace tileflight::experiment
