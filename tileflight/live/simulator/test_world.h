#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/live/simulator/simulator.h"

// A test world with known answers: level ground at z = 0 of the local frame, a wall whose southern face is 20 m north
// of the origin, and one whose western face is 30 m east of it, both 40 m high.
namespace tileflight::simulator::test_world {

inline constexpr double kWallNorth_m = 20.0;
inline constexpr double kWallEast_m = 30.0;
inline constexpr imaging::Rgb8 kWallColour{200, 100, 50};

/// A box of one colour with outward-facing triangles.
inline imaging::TexturedMesh box(const std::string& name, const geometry::Box3& bounds, const imaging::Rgb8& colour) {
  imaging::TexturedMesh mesh;
  mesh.name = name;
  for (int i = 0; i < 8; ++i) mesh.mesh.vertices.push_back(bounds.corner(static_cast<geometry::Box3::CornerType>(i)));
  mesh.mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                         {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  mesh.uv.assign(8, {0.5F, 0.5F});
  mesh.texture = std::make_shared<const imaging::RgbImage>(2, 2, colour);
  return mesh;
}

inline std::vector<imaging::TexturedMesh> meshes() {
  using geometry::Box3;
  using geometry::Vec3;
  return {box("ground", Box3(Vec3(-200, -200, -1), Vec3(200, 200, 0)), {90, 140, 60}),
          box("north-wall", Box3(Vec3(-60, kWallNorth_m, 0), Vec3(25, kWallNorth_m + 1, 40)), kWallColour),
          box("east-wall", Box3(Vec3(kWallEast_m, -60, 0), Vec3(kWallEast_m + 1, 15, 40)), {60, 60, 200})};
}

inline constexpr const char* kComputerVision = R"({"SimMode": "ComputerVision", "StepOnDemand": true})";
inline constexpr const char* kMultirotor = R"({"SimMode": "Multirotor", "StepOnDemand": true})";

inline std::unique_ptr<Simulator> simulator(const std::string& settings, SimulatorOptions options = {},
                                            const SimulatorLog& log = {}) {
  options.settings = settings;
  return std::make_unique<Simulator>(options, meshes(), log);
}

/// A pose at north, east and down, with a yaw clockwise from north.
inline Pose pose(float north, float east, float down, double yaw_rad = 0.0) {
  const auto half = static_cast<float>(yaw_rad / 2);
  return {{north, east, down}, {std::cos(half), 0.0F, 0.0F, std::sin(half)}};
}

/// Lines that the simulator has logged.
struct LoggedLines {
  std::mutex mutex;
  std::vector<std::string> lines;

  SimulatorLog log() {
    return [this](const std::string& line) {
      const std::lock_guard lock(mutex);
      lines.push_back(line);
    };
  }
  std::size_t count(const std::string& part) {
    const std::lock_guard lock(mutex);
    return static_cast<std::size_t>(
        std::ranges::count_if(lines, [&](const std::string& line) { return line.find(part) != std::string::npos; }));
  }
};

inline std::unique_ptr<Simulator> world(const std::string& settings, LoggedLines* lines = nullptr) {
  return simulator(settings, {}, lines != nullptr ? lines->log() : SimulatorLog());
}

}  // namespace tileflight::simulator::test_world
