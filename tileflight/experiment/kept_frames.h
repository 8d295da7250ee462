#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/imaging/image.h"
#include "tileflight/sensors/fly.h"

namespace tileflight::experiment {

/// What is noted of a frame whose files are all there.
struct KeptFrame {
  double exposure_ms = 0.0;
  sensors::FrameCheck check;
  std::string cut;  ///< name of the tiles that it was rendered from
};

/// What the frames of a whole flight tell of its path.
std::vector<std::optional<sensors::FrameCheck>> checks_of(const std::vector<KeptFrame>& frames);

/// "3, 5 to 8 and 12"; of many runs the first few and how many frames more.
std::string frame_ranges(const std::vector<std::size_t>& frames);

/// The finished frames of a render that is not whole, beside the dataset DIR/NAME that they are for:
///   DIR/.NAME.frames/inputs.json   what they were rendered from
///                    frames/000012.json   a frame is there, and what is noted of it; written after its files
///                    pictures/000012.png  its picture, where a video comes first
///                    segmentation.runs/   what SegmentationWriter keeps of frames
///                    dataset/      what becomes the dataset
///                    ranks/0       locked as long as the process lives that renders as this rank
/// Several processes (on machines that share the folder) may add frames. What a process that died has added stays, for
/// the next render from the same inputs; what comes from other inputs is removed.
class KeptFrames {
 public:
  static std::filesystem::path folder_of(const std::filesystem::path& dataset);
  /// Whether an earlier render left frames for the dataset.
  static bool are_there(const std::filesystem::path& dataset);
  /// Makes the folder ready for frames from `inputs`, by one process, before any opens it: keeps what is there from the
  /// same ones and removes what is not. Returns a line on what was removed; empty: nothing. Throws InputError where a
  /// process renders into it.
  static std::string prepare(const std::filesystem::path& dataset, const nlohmann::json& inputs);

  /// As rank `rank` of `ranks`. Throws InputError.
  KeptFrames(const std::filesystem::path& dataset, int rank, int ranks);
  ~KeptFrames();
  KeptFrames(const KeptFrames&) = delete;
  KeptFrames& operator=(const KeptFrames&) = delete;

  std::filesystem::path dataset_folder() const { return folder_ / "dataset"; }
  std::filesystem::path runs_folder() const { return folder_ / "segmentation.runs"; }
  void add(std::size_t index, const KeptFrame& frame) const;
  void add_picture(std::size_t index, const imaging::RgbImage& picture) const;
  imaging::RgbImage picture(std::size_t index) const;
  /// All that are there; a note that cannot be read is none.
  std::map<std::size_t, KeptFrame> all() const;
  /// Why a render of `frames` frames is not whole: which ranks have ended, which frames are missing. Empty where a
  /// lower rank lives, which says it.
  std::string state(std::size_t frames) const;
  /// Everything is in the dataset.
  void remove() const;

 private:
  std::filesystem::path folder_;
  int rank_ = 0, ranks_ = 1;
  int lock_ = -1;  ///< file descriptor
};

}  // namespace tileflight::experiment
