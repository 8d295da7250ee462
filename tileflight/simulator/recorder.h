#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/dataset/dataset.h"
#include "tileflight/simulator/airsim_types.h"
#include "tileflight/simulator/settings.h"

namespace tileflight::simulator {

/// A picture of a recording, and what our own dataset wants to know of it.
struct RecordedPicture {
  RecordedCamera camera;
  ImageResponse image;
  imaging::Camera lens;
  geometry::SE3 T_local_camera;  ///< of pictures' axes
};

/// A line of the recording: one vehicle at one moment.
struct RecordedMoment {
  std::string vehicle;
  std::uint64_t time_ns = 0;
  Pose pose;  ///< local NED, of the pictures' moment
  std::vector<RecordedPicture> pictures;
};

/// Writes a recording as AirSim lays it out: a folder named by the time of day with airsim_rec.txt and images/, and, if
/// wanted, dataset folders of ours of each vehicle's and camera's colour pictures (docs/formats.md). Not thread-safe.
class Recorder {
 public:
  /// `parent` is made if it is not there. Throws InputError.
  Recorder(const std::filesystem::path& parent, const RecordingSettings& settings);
  /// Finishes what can be finished.
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  const std::filesystem::path& folder() const { return folder_; }
  /// Throws InputError where a file cannot be written.
  void add(const RecordedMoment& moment);
  /// Puts the datasets into their places. Throws InputError.
  void finish();

 private:
  struct OwnDataset;

  std::string write_image(const std::string& vehicle, const RecordedPicture& picture);
  void add_to_dataset(const RecordedMoment& moment, const RecordedPicture& picture);

  RecordingSettings settings_;
  std::filesystem::path folder_;
  std::ofstream lines_;
  std::map<std::string, Pose> last_pose_;  ///< of each vehicle
  std::map<std::pair<std::string, std::string>, std::unique_ptr<OwnDataset>> datasets_;
};

}  // namespace tileflight::simulator
