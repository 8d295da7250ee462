#pragma once

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/height_field.h"
#include "tests/run_program.h"
#include "tests/shared_result.h"
#include "tileflight/core/geometry/cloud_files.h"

namespace tileflight::tests {

/// Heights of rolling ground of 96 m with blocks of different sizes, metres.
inline double rolling_height_m(double x, double y) {
  double z = 2.0 * std::sin(0.06 * x + 0.4) + 1.5 * std::cos(0.08 * y + 0.03 * x);
  for (const auto& [east, north, half, up] : {std::array{-30.0, -32.0, 5.0, 9.0},
                                              {28.0, -20.0, 4.0, 6.0},
                                              {-8.0, 6.0, 6.0, 12.0},
                                              {-34.0, 26.0, 4.0, 5.0},
                                              {31.0, 31.0, 5.0, 8.0},
                                              {8.0, -37.0, 3.0, 7.0},
                                              {10.0, 37.0, 4.0, 10.0}}) {
    if (std::abs(x - east) < half && std::abs(y - north) < half) z += up;
  }
  return z;
}

/// T_local_map of the map of rolling_ground().
inline const geometry::Sim3 kTrueOfRollingGround(12.5, geometry::so3_exp({0.4, -2.1, 1.3}), {200.0, -40.0, 15.0});

/// Its tiles in "place", its truth in "truth", and a map of some 4000 samples of its surface, in a frame that nobody
/// knows, in "map.ply".
inline SharedResult rolling_ground() {
  return {
      "rolling-ground", [](const std::filesystem::path& folder) {
        std::filesystem::create_directories(folder);
        const geometry::TriangleMesh mesh = height_field(192, -48.0, 96.0, rolling_height_m);
        std::ofstream obj(folder / "ground.obj");
        for (const geometry::Vec3& v : mesh.vertices) obj << "v " << v.x() << " " << v.y() << " " << v.z() << "\n";
        for (const auto& t : mesh.triangles) obj << "f " << t[0] + 1 << " " << t[1] + 1 << " " << t[2] + 1 << "\n";
        obj.close();
        for (const std::vector<std::string>& call :
             {std::vector<std::string>{"tile", (folder / "ground.obj").string(), "--out", (folder / "place").string()},
              {"extract", (folder / "place").string(), "--out", (folder / "truth").string()}}) {
          const ProgramResult result = run_tileflight(call);
          if (result.exit_code != 0) throw std::runtime_error("tileflight " + call.front() + ": " + result.err);
        }
        const geometry::PointCloud surface = geometry::read_cloud(folder / "truth/surface.ply");
        geometry::PointCloud map;
        for (std::size_t i = 0; i < surface.size(); i += 1 + surface.size() / 4000)
          map.positions.push_back(surface.positions[i]);
        geometry::write_cloud(folder / "map.ply", transformed(kTrueOfRollingGround.inverse(), map));
      }};
}

}  // namespace tileflight::tests
