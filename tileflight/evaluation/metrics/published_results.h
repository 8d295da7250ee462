#pragma once

#include <array>
#include <cstddef>
#include <nlohmann/json_fwd.hpp>

namespace tileflight::metrics {

/// One flight of the paper's tables I and II (Beam et al., "Cesium Tiles for High-realism Simulation and Comparing SLAM
/// Results in Corresponding Virtual and Real-world Environments").
struct PublishedRun {
  std::size_t points = 0;           ///< points of the map
  std::size_t correspondences = 0;  ///< points with a voxel centre within 1 m
  double mean_m = 0, std_m = 0;
  double fov_deg = 0;
  std::array<int, 2> resolution_px{};
  double fps = 0;
  int frames = 0;
};

inline constexpr PublishedRun kPublishedSimulated{84029, 36178, 0.5548, 0.1885, 155, {2688, 1512}, 5, 342};
inline constexpr PublishedRun kPublishedReal{71918, 27820, 0.5733, 0.1998, 155, {2688, 1512}, 30, 1000};
inline constexpr std::size_t kPublishedVoxels = 158446;  ///< of 1 m, 250 m x 250 m

/// Returns {simulated, real}, each with points, correspondences, mean, std, fov_deg, resolution [w, h], fps, frames;
/// voxels.
nlohmann::json published_table();

}  // namespace tileflight::metrics
