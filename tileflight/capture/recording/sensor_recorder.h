#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/capture/sensors/sensor_suite.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::recording {

/// Simulates the sensors besides the cameras on a rendered flight: records them from its first to its last instant, on
/// the flight's clock, and writes them beside the images (docs/formats.md, "A dataset folder").
class SensorRecorder {
 public:
  SensorRecorder(sensors::SensorSuite suite, flight_path::Path path, geometry::Trajectory frames);

  const sensors::SensorSuite& suite() const { return suite_; }

  /// Sets the things that move in the scenes of record(); empty: nothing. Range finders do not see them.
  void set_placed(render::PlacedParts placed) { placed_ = std::move(placed); }

  /// Simulates lidar scans and ranges that start from one time up to, not including, another, and writes scans into the
  /// dataset's folder immediately. A flight may be recorded in several parts, in order, from -infinity to infinity; the
  /// files are the same. Throws InputError if a sensor needs a georeferenced place and it is
  /// not.
  void record(const scene::Scene& scene, const std::optional<geometry::LocalFrame>& frame, double from_s, double to_s,
              const std::filesystem::path& folder);

  /// Writes all other sensors, and the lists of what record() wrote. `first_frame_s`: the first frame's time in the
  /// dataset.
  void write(const std::optional<geometry::LocalFrame>& frame, double first_frame_s,
             const std::filesystem::path& folder) const;

  /// Entries of dataset.yaml.
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
  render::PlacedParts placed_;
  flight_path::Path path_;
  geometry::Trajectory frames_;
  std::vector<sensors::RangeSample> ranges_;
  geometry::Trajectory scans_;  ///< T_local_lidar at the start of each scan
};

}  // namespace tileflight::recording
