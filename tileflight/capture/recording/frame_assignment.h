#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/render/render_flight.h"
#include "tileflight/capture/recording/frame_store.h"
#include "tileflight/core/jobs/balanced_ranges.h"
#include "tileflight/core/jobs/ranks.h"

namespace tileflight::recording {

/// The images of a flight that this process renders, by their numbers (ImageOrder); with one camera, its frames. Each
/// rank has a range of consecutive frames, so that it needs the tiles of its part of the flight only; frames that
/// earlier runs have not finished are divided evenly.
class FrameAssignment {
 public:
  /// `kept`: store that shares finished frames with other ranks and later runs, the same for all ranks; null: this
  /// process renders all frames and stores none. Waits for the other ranks. Ranks and `kept` must outlive it.
  /// `part`: only these frames are assigned, in a job whose other parts are rendered elsewhere.
  FrameAssignment(jobs::Ranks& ranks, const FrameStore* kept, std::size_t frames,
                  const std::optional<jobs::IndexRange>& part = {});

  /// Whether this process does what is done once for the flight: other sensors, video, lists.
  bool is_first_rank() const { return ranks_.rank() == 0 && !part_; }
  const FrameStore* store() const { return store_; }
  /// Build folder for DatasetWriter: the store's, or empty.
  std::filesystem::path build_folder() const { return store_ == nullptr ? "" : store_->dataset_folder(); }
  /// Folder for the segmentation data of finished frames, or empty.
  std::filesystem::path segmentation_runs_folder() const {
    return store_ == nullptr ? "" : store_->segmentation_runs_folder();
  }

  /// Whether this process renders every frame itself. Valid after set_cut().
  bool renders_all_frames() const { return ranks_.count() == 1 && resumed_ == 0 && !part_; }

  /// Sets the tile cut; frames rendered from another cut are rendered again.
  void set_cut(const std::string& cut);
  /// Has all ranks render every frame together: each rank's range is all frames then, and each finishes some.
  void render_together();
  /// This rank's range of frames, finished ones included. The ranges of all ranks follow each other and cover all
  /// frames, or those of the part. Valid after set_cut().
  std::size_t begin() const { return begin_; }
  std::size_t end() const { return end_; }
  /// The first frame whose light this process meters for an automatic exposure.
  std::size_t metered_begin() const { return part_ ? 0 : begin_; }
  bool has_all_frames() const { return ranks_.count() == 1 && !part_; }  ///< whether its range is the whole flight
  /// Whether this process renders the frame: it is in its range and not finished.
  bool is_assigned(std::size_t index) const { return index >= begin_ && index < end_ && !is_finished_[index]; }
  /// Reports that all files of an image, the frame of its camera, are written. Thread-safe.
  void add(std::size_t image, const render::FlightFrame& frame);

  /// Number of frames that were already finished at the start.
  std::size_t frames_resumed() const { return resumed_; }
  /// The records of all frames, after all ranks have finished. Throws InputError if one is missing or from other tiles.
  std::vector<FrameRecord> collect_frames() const;

 private:
  jobs::Ranks& ranks_;
  const FrameStore* store_;
  std::optional<jobs::IndexRange> part_;
  std::vector<std::string> previous_cuts_;  ///< cut of each frame finished earlier; empty: not finished
  std::string cut_;
  std::vector<bool> is_finished_;  ///< by an earlier run
  std::size_t begin_ = 0, end_;
  std::size_t resumed_ = 0;
  std::vector<FrameRecord> own_frames_;  ///< used if there is no store
};

}  // namespace tileflight::recording
