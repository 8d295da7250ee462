#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/data/dataset/dataset.h"
#include "tileflight/live/simulator/airsim_types.h"
#include "tileflight/live/simulator/settings.h"

namespace tileflight::simulator {

/// A recorded image, with the data needed for a dataset.
struct RecordedImage {
  RecordingCamera camera;
  ImageResponse image;
  imaging::Camera lens;
  geometry::SE3 T_local_camera;  ///< image axes
};

/// One line of the recording: a vehicle at one time.
struct RecordingFrame {
  std::string vehicle;
  std::uint64_t time_ns = 0;
  Pose pose;  ///< local NED, at the time of the images
  std::vector<RecordedImage> images;
};

/// Writes a recording in AirSim's layout: a folder named by date and time with airsim_rec.txt and images/, and
/// optionally a dataset folder of each vehicle's and camera's colour images (docs/formats.md). Not thread-safe.
class Recorder {
 public:
  /// Creates `parent` if necessary. Throws InputError.
  Recorder(const std::filesystem::path& parent, const RecordingSettings& settings);
  /// Finishes the datasets as far as possible.
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  const std::filesystem::path& folder() const { return folder_; }
  /// Throws InputError if a file cannot be written.
  void add(const RecordingFrame& moment);
  /// Completes the datasets. Throws InputError.
  void finish();

 private:
  struct DatasetOutput;

  std::string write_image(const std::string& vehicle, const RecordedImage& picture);
  void add_to_dataset(const RecordingFrame& moment, const RecordedImage& picture);

  RecordingSettings settings_;
  std::filesystem::path folder_;
  std::ofstream lines_;
  std::map<std::string, Pose> last_pose_;  ///< by vehicle
  std::map<std::pair<std::string, std::string>, std::unique_ptr<DatasetOutput>> datasets_;
};

}  // namespace tileflight::simulator
