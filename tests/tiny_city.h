#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/tiny_place.h"

namespace tileflight::tests {

/// Hills of 1.28 km x 1.28 km in a local z-up frame, coloured by vertex, as a quadtree of four levels (geometric errors
/// 8, 4, 2 and 0 m) of 85 tiles with the same number of triangles each: a place that a flight crosses.
class TinyCity {
 public:
  static constexpr double kHalf_m = 640.0;  ///< x and y from -640 to 640
  static constexpr int kLevels = 4;
  /// Across the place, around a corner, and back over the first part: seven cubes.
  static constexpr const char* kFlight = R"(camera: camera.yaml
fps: 0.5
speed_m_s: 40
acceleration_m_s2: 40
waypoints:
  - {position: [-500, -300, 160], yaw_deg: 90, pitch_deg: -40}
  - {position: [500, -280, 170], yaw_deg: 60, pitch_deg: -30}
  - {position: [300, 200, 165], yaw_deg: -60, pitch_deg: -35}
  - {position: [-500, -290, 160], yaw_deg: -120, pitch_deg: -30}
)";

  static void write(const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    const nlohmann::json tileset = {{"asset", {{"version", "1.1"}, {"copyright", "Tiny City, CC0"}}},
                                    {"geometricError", 100},
                                    {"root", write_tile(folder, "t", -kHalf_m, -kHalf_m, 2 * kHalf_m, kLevels - 1)}};
    TinyPlace::write_file(folder / "tileset.json", tileset.dump(1));
  }

 private:
  static nlohmann::json write_tile(const std::filesystem::path& folder, const std::string& name, double x, double y,
                                   double size_m, int levels_below) {
    TinyPlace::write_file(folder / (name + ".glb"), TinyPlace::glb(x, y, size_m, 16));
    const double half_m = size_m / 2;
    nlohmann::json tile = {
        {"boundingVolume", {{"box", {x + half_m, y + half_m, 100, half_m, 0, 0, 0, half_m, 0, 0, 0, 4}}}},
        {"geometricError", levels_below == 0 ? 0 : 1 << levels_below},
        {"refine", "REPLACE"},
        {"content", {{"uri", name + ".glb"}}}};
    for (int i = 0; i < 4 && levels_below > 0; ++i) {
      tile["children"].push_back(write_tile(folder, name + std::to_string(i), x + half_m * (i % 2),
                                            y + half_m * (i / 2), half_m, levels_below - 1));
    }
    return tile;
  }
};

}  // namespace tileflight::tests
