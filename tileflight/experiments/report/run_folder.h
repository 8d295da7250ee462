#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::report {

/// An image of a flight.
struct FrameFile {
  std::filesystem::path image;
  double time_s = 0.0;
};

/// The images of a rig's camera.
struct CameraFrames {
  std::string name;
  std::vector<FrameFile> frames;  ///< times on the clock of the rig's first camera
};

/// The data of one flight in a run folder, in the local frame.
struct FlightRun {
  std::string key;                               ///< "simulated" or "real"
  std::string label;                             ///< "Simulated", "Surrogate", …
  nlohmann::json values;                         ///< the flight's part of results.json
  std::vector<FrameFile> frames;                 ///< of the only camera, or of a rig's first
  std::string camera;                            ///< its name; empty: the only one
  std::vector<CameraFrames> other_cameras;       ///< of a rig, in its order
  std::optional<geometry::Trajectory> estimate;  ///< odometry's poses, aligned
  std::optional<geometry::Trajectory> truth;     ///< true poses
  std::vector<geometry::Vec3> telemetry;         ///< positions from gps.csv
  std::optional<geometry::PointCloud> errors;    ///< aligned map with scalars voxel_distance and surface_distance
};

/// A pair of images of a flight and of the one that follows it (reproduction.csv); NaN for unknown values.
struct ViewPair {
  double time_s = 0, overlap = 0, ncc = 0, ssim = 0;
};

/// The contents of a run folder that the report uses.
struct RunFolder {
  nlohmann::json results;
  std::optional<geometry::PointCloud> voxel_centers;
  double voxel_m = 1.0;
  /// The textured place: truth/mesh.glb, or those of the truth's blocks around the flights.
  std::vector<std::filesystem::path> meshes;
  std::vector<FlightRun> flights;    ///< flights in results.json, simulated first
  std::vector<ViewPair> view_pairs;  ///< empty unless the simulated flight follows the other one
  nlohmann::json coverage;           ///< coverage/coverage.json, results of the tile strategies; may be null
  std::vector<std::string> missing;  ///< one line for each missing part that a page could show
};

/// Reads a run folder. Throws InputError if results.json is missing or not JSON, or an existing part is malformed.
RunFolder read_run_folder(const std::filesystem::path& folder);

}  // namespace tileflight::report
