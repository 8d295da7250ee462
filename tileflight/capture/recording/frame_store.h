#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/render/render_flight.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/core/jobs/build_folder.h"

namespace tileflight::recording {

/// Record of a frame whose files are all written.
struct FrameRecord {
  double exposure_ms = 0.0;
  render::FrameCheck check;
  std::string cut;  ///< name of the tile cut from which it was rendered
};

/// The path checks of a whole flight's frames.
std::vector<std::optional<render::FrameCheck>> frame_checks(const std::vector<FrameRecord>& frames);

/// "3, 5 to 8 and 12"; for many ranges the first few and the number of remaining frames.
std::string describe_frame_ranges(const std::vector<std::size_t>& frames);

/// The finished frames of an incomplete render, stored beside the dataset DIR/NAME:
///   DIR/.NAME.frames/inputs.json   the inputs of the render
///                    frames/000012.json   record of a finished frame, written after its files
///                    pictures/000012.picture  its image (core/imaging/quick_picture.cpp), if a video is encoded first
///                    tiles/0123….json     what tiles were found to hold, for the summary; named by its content
///                    segmentation.runs/   SegmentationWriter's data of frames
///                    segmentation.runs-NAME/   the same of a rig's further cameras
///                    dataset/      becomes the dataset
///                    members/      locks of the processes that render (core/jobs/build_folder.h)
/// Several processes (on machines that share the folder) may add frames. Frames added by a process that died are kept
/// for the next render from the same inputs; those from other inputs are removed.
class FrameStore {
 public:
  static std::filesystem::path folder_for(const std::filesystem::path& dataset);
  /// Whether an earlier render left frames of the dataset.
  static bool exists(const std::filesystem::path& dataset);
  /// Prepares the folder for frames from `inputs`; called by one process before any opens the store. Keeps existing
  /// frames from the same inputs and removes others. Returns a message about what was removed; empty: nothing. Throws
  /// InputError if another job is rendering into it.
  static std::string prepare(const std::filesystem::path& dataset, const nlohmann::json& inputs,
                             jobs::Share share = jobs::Share::kWhole);

  /// Opens the store as rank `rank` of `ranks`. Throws InputError.
  FrameStore(const std::filesystem::path& dataset, int rank, int ranks);
  /// Opens it for a part of the frames, of this name. Throws InputError.
  FrameStore(const std::filesystem::path& dataset, const std::string& part);

  std::filesystem::path dataset_folder() const { return folder_.path() / "dataset"; }
  std::filesystem::path segmentation_runs_folder() const { return folder_.path() / "segmentation.runs"; }
  void add(std::size_t index, const FrameRecord& frame) const;
  void add_picture(std::size_t index, const imaging::RgbImage& picture) const;
  imaging::RgbImage read_picture(std::size_t index) const;
  /// Stores what tiles hold (FlightTiles::take_new_records), before any frame that shows them is added.
  void add_tiles(const nlohmann::json& records) const;
  std::vector<nlohmann::json> read_tiles() const;
  /// All finished frames; unreadable records are ignored.
  std::map<std::size_t, FrameRecord> read_frames() const;
  /// Why a render of `frames` frames is incomplete: which ranks have ended, which frames are missing. Empty if a lower
  /// rank, which then reports it, is alive.
  std::string describe_state(std::size_t frames) const;
  /// Removes the store once everything is in the dataset.
  void remove() const;

 private:
  jobs::BuildFolder folder_;
  int rank_ = 0, ranks_ = 1;
};

}  // namespace tileflight::recording
