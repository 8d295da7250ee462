#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::report {

/// A picture of a flight.
struct FrameFile {
  std::filesystem::path image;
  double time_s = 0.0;
};

/// What a run folder holds of one flight; everything in the local frame.
struct FlightRun {
  std::string key;        ///< "simulated" or "real"
  std::string label;      ///< "Simulated", "Surrogate", …
  nlohmann::json values;  ///< its part of results.json
  std::vector<FrameFile> frames;
  std::optional<geometry::Trajectory> estimate;  ///< odometry's poses, aligned
  std::optional<geometry::Trajectory> truth;     ///< true poses
  std::vector<geometry::Vec3> telemetry;         ///< positions from gps.csv
  std::optional<geometry::PointCloud> errors;    ///< aligned map with voxel_distance and surface_distance
};

/// A pair of pictures of a flight and of the one that follows it (reproduction.csv); NaN where a value is not known.
struct ViewPair {
  double time_s = 0, overlap = 0, ncc = 0, ssim = 0;
};

struct RunFolder {
  nlohmann::json results;
  std::optional<geometry::PointCloud> voxel_centers;
  double voxel_m = 1.0;
  std::optional<std::filesystem::path> mesh;  ///< truth/mesh.glb, the place under its textures
  std::vector<FlightRun> flights;             ///< those that results.json names, simulated first
  std::vector<ViewPair> view_pairs;           ///< where the simulated flight follows the other one
  nlohmann::json coverage;           ///< coverage/coverage.json, what each way of loading tiles shows; null without
  std::vector<std::string> missing;  ///< one line for each part that a page could show and that is not there
};

/// Throws InputError: no results.json, not JSON, or a part that is there is malformed.
RunFolder read_run_folder(const std::filesystem::path& folder);

}  // namespace tileflight::report
