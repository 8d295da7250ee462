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
#include "tileflight/core/jobs/balanced_ranges.h"
#include "tileflight/core/jobs/build_folder.h"

namespace tileflight::recording {

/// Record of a frame whose files are all written.
struct FrameRecord {
  double exposure_ms = 0.0;
  render::FrameCheck check;
  std::string cut;  ///< name of the tile cut from which it was rendered
};

/// Returns the checks of all frames.
std::vector<std::optional<render::FrameCheck>> frame_checks(const std::vector<FrameRecord>& frames);

/// Describes frames in words, "3, 5 to 8 and 12"; of many ranges only the first few and the number of remaining frames.
std::string describe_frame_ranges(const std::vector<std::size_t>& frames);

/// The finished frames of an incomplete render, stored beside the dataset DIR/NAME:
///   DIR/.NAME.frames/inputs.json   the inputs of the render
///                    frames/000012.json   record of a finished frame, written after its files
///                    pictures/000012.picture  its image (core/imaging/quick_picture.h), if a video is encoded first
///                    tiles/0123….json     records of the tiles that were read, for the summary; named by its content
///                    segmentation.runs/   SegmentationWriter's data of frames
///                    segmentation.runs-NAME/   SegmentationWriter's data of a rig's further cameras
///                    dataset/      becomes the dataset
///                    members/      locks of the processes that render (core/jobs/build_folder.h)
/// Several processes (on machines that share the folder) may add frames. Frames added by a process that died are kept
/// for the next render from the same inputs; those from other inputs are removed.
class FrameStore {
 public:
  static std::filesystem::path folder_for(const std::filesystem::path& dataset);
  /// Tells whether an earlier render left frames of the dataset.
  static bool exists(const std::filesystem::path& dataset);
  /// Prepares the folder for frames from `inputs`; called by one process before any opens the store. Keeps existing
  /// frames from the same inputs and removes others. Returns a message about what was removed; empty: nothing. Throws
  /// InputError if another job is rendering into it.
  static std::string prepare(const std::filesystem::path& dataset, const nlohmann::json& inputs,
                             jobs::Share share = jobs::Share::kWhole);

  /// Opens the store for all frames, or with `part` for those of one task, which has this name. Throws InputError.
  explicit FrameStore(const std::filesystem::path& dataset, const std::string& part = "");

  std::filesystem::path dataset_folder() const { return folder_.path() / "dataset"; }
  std::filesystem::path segmentation_runs_folder() const { return folder_.path() / "segmentation.runs"; }
  void add(std::size_t index, const FrameRecord& frame) const;
  void add_picture(std::size_t index, const imaging::RgbImage& picture) const;
  imaging::RgbImage read_picture(std::size_t index) const;
  /// Stores records of tiles (FlightTiles::take_new_records()), before any frame that shows these tiles is added.
  void add_tiles(const nlohmann::json& records) const;
  std::vector<nlohmann::json> read_tiles() const;
  /// Reads the records of all finished frames; unreadable ones are ignored.
  std::map<std::size_t, FrameRecord> read_frames() const;
  /// Removes the store once everything is in the dataset.
  void remove() const;

 private:
  jobs::BuildFolder folder_;
};

/// The images of a flight that this process renders, by their numbers (ImageOrder); with one camera, its frames. They
/// are all images or a range of them, without those that earlier processes finished.
class FrameAssignment {
 public:
  /// `kept`: store that shares finished frames with other tasks and later runs, which must outlive it; null: this
  /// process renders all frames and stores none. `part`: only these frames are assigned, in a job whose other parts are
  /// rendered elsewhere.
  FrameAssignment(const FrameStore* kept, std::size_t frames, const std::optional<jobs::IndexRange>& part = {});

  const FrameStore* store() const { return store_; }
  /// Build folder for DatasetWriter: the store's, or empty.
  std::filesystem::path build_folder() const { return store_ == nullptr ? "" : store_->dataset_folder(); }
  /// Folder for the segmentation data of finished frames, or empty.
  std::filesystem::path segmentation_runs_folder() const {
    return store_ == nullptr ? "" : store_->segmentation_runs_folder();
  }

  /// Sets the tile cut; frames rendered from another cut are rendered again.
  void set_cut(const std::string& cut);
  /// The range of frames, finished ones included.
  std::size_t begin() const { return range_.begin; }
  std::size_t end() const { return range_.end; }
  /// Whether the range is the whole flight, so that this process also does what is done once for it: other sensors,
  /// video, lists.
  bool has_all_frames() const { return !is_part_; }
  /// Whether this process renders every frame itself. Valid after set_cut().
  bool renders_all_frames() const { return !is_part_ && resumed_ == 0; }
  /// Whether this process renders the frame: it is in its range and not finished. Valid after set_cut().
  bool is_assigned(std::size_t index) const { return range_.contains(index) && !is_finished_[index]; }
  /// Number of assigned frames. Valid after set_cut().
  std::size_t count() const;
  /// Number of frames that were already finished at the start.
  std::size_t frames_resumed() const { return resumed_; }

  /// Reports that all files of an image, the frame of its camera, are written. Thread-safe.
  void add(std::size_t image, const render::FlightFrame& frame);
  /// Returns the records of all frames, once all have been rendered. Throws InputError if one is missing or from other
  /// tiles.
  std::vector<FrameRecord> collect_frames() const;

 private:
  const FrameStore* store_;
  bool is_part_;
  jobs::IndexRange range_;
  std::vector<std::string> previous_cuts_;  ///< cut of each frame finished earlier; empty: not finished
  std::string cut_;
  std::vector<bool> is_finished_;  ///< by an earlier run
  std::size_t resumed_ = 0;
  std::vector<FrameRecord> own_frames_;  ///< used if there is no store
};

}  // namespace tileflight::recording
