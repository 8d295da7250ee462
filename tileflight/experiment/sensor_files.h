#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/flight/path.h"
#include "tileflight/geometry/geodesy.h"
#include "tileflight/scene/scene.h"
#include "tileflight/sensors/sensor_suite.h"

namespace tileflight::experiment {

/// The sensors beside the camera on a flight that is rendered: records what they say from the first frame's time to the
/// last one's, on one clock with the frames, and writes it beside the images (docs/formats.md, "A dataset folder").
class SensorFiles {
 public:
  SensorFiles(sensors::SensorSuite suite, flight::Path path, geometry::Trajectory frames);

  const sensors::SensorSuite& suite() const { return suite_; }

  /// Lidar scans and ranges that begin from frame `begin`'s time on, before frame `end`'s, written into the dataset's
  /// folder at once. Flights may be recorded in parts, in order; the files are the same. Throws InputError where a
  /// sensor needs a place on the earth and there is none.
  void record(const scene::Scene& scene, const std::optional<geometry::LocalFrame>& frame, std::size_t begin,
              std::size_t end, const std::filesystem::path& folder);

  /// Everything else, and the lists of what record() wrote. `first_frame_s`: what the dataset calls the first frame's
  /// time.
  void write(const std::optional<geometry::LocalFrame>& frame, double first_frame_s,
             const std::filesystem::path& folder) const;

  /// Lines of dataset.yaml.
  std::map<std::string, std::string> description() const;

 private:
  double start_s() const { return frames_.poses.front().time_s; }
  double end_s() const { return frames_.poses.back().time_s; }
  void scan(const scene::Scene& scene, double from_s, double to_s, const std::filesystem::path& folder);
  void write_imu(double shift_s, const std::filesystem::path& folder) const;
  void write_barometer(const std::optional<geometry::LocalFrame>& frame, double shift_s,
                       const std::filesystem::path& folder) const;
  void write_magnetometer(const std::optional<geometry::LocalFrame>& frame, double shift_s,
                          const std::filesystem::path& folder) const;
  void write_scan_lists(double shift_s, const std::filesystem::path& folder) const;

  sensors::SensorSuite suite_;
  flight::Path path_;
  geometry::Trajectory frames_;
  std::vector<sensors::RangeSample> ranges_;
  geometry::Trajectory scans_;  ///< T_local_lidar at the start of each
};

}  // namespace tileflight::experiment
