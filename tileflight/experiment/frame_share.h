#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/experiment/kept_frames.h"
#include "tileflight/experiment/ranks.h"
#include "tileflight/sensors/fly.h"

namespace tileflight::experiment {

/// Which frames of a flight this process renders: those that no earlier one has left, dealt out to the ranks in turn.
class FrameShare {
 public:
  /// `kept`: where frames are kept for the other ranks and for later, the same for all; null: this process renders all
  /// frames and keeps none. Waits for the other ranks. Ranks and `kept` must outlive it.
  FrameShare(Ranks& ranks, const KeptFrames* kept, std::size_t frames);

  bool is_first() const { return ranks_.rank() == 0; }
  const KeptFrames* kept() const { return kept_; }
  /// Where DatasetWriter builds: kept()'s folder, or empty.
  std::filesystem::path build_folder() const { return kept_ == nullptr ? "" : kept_->dataset_folder(); }
  /// Where what segmentation needs of the frames is kept, or empty.
  std::filesystem::path runs_folder() const { return kept_ == nullptr ? "" : kept_->runs_folder(); }

  /// Whether this process renders every frame itself, after set_cut().
  bool is_whole() const { return ranks_.count() == 1 && taken_up_ == 0; }

  /// Frames that were rendered from another cut are rendered anew.
  void set_cut(const std::string& cut);
  bool is_mine(std::size_t index) const { return is_mine_[index]; }
  /// Its files are all written. From several threads at once.
  void add(const sensors::SensedFrame& frame);

  /// Of frames that were there when the ranks began.
  std::size_t frames_taken_up() const { return taken_up_; }
  /// Every frame, when all ranks are through. Throws InputError where one is missing or from other tiles.
  std::vector<KeptFrame> all() const;

 private:
  Ranks& ranks_;
  const KeptFrames* kept_;
  std::vector<std::string> cut_before_;  ///< of each frame that was there; empty: it was not
  std::string cut_;
  std::vector<bool> is_mine_;
  std::size_t taken_up_ = 0;
  std::vector<KeptFrame> own_;  ///< where none are kept
};

}  // namespace tileflight::experiment
