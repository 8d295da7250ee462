// Cost of `evaluate`: maps of 0.1, 1 and 10 million points over the built-in stadium's twin, then a small map in the
// middle of a place of 4 km2 (4.5 million triangles, 16 samples a square metre). Each runs in its own process; reported
// are seconds, processor seconds, peak memory, and the scores that must not depend on the size.
//
//   evaluate_benchmark [--points N]... [--place-km2 A] [--folder DIR]
//
// Generated data stays in DIR (default: a temporary folder, removed at the end) and is reused.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "tests/height_field.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/glb_writer.h"
#include "tileflight/evaluation/scoring/evaluate.h"
#include "tileflight/tiles/demo_place/stadium.h"
#include "tileflight/world/ground_truth/truth_folder.h"
#include "tileflight/world/place/extract.h"

namespace {

namespace fs = std::filesystem;
using namespace tileflight;
using geometry::Vec3;
using nlohmann::json;

struct Task {
  fs::path map, truth, dataset;
};

// --------------------------------------------------------------------------------------------------- generated data

void make_stadium_truth(const fs::path& folder) {
  if (fs::exists(folder / "truth")) return;
  demo_place::write_stadium(folder / "place", {.texture_scale = 0.1});
  const geometry::Geodetic origin{demo_place::kStadiumLatitudeDeg, demo_place::kStadiumLongitudeDeg,
                                  geometry::EllipsoidalHeight{demo_place::kStadiumHeightM}};
  geometry::Geodetic center = origin;
  center.height.m += 15.0;
  place::extract({.source = (folder / "place/twin/tileset.json").string(),
                  .load = {.center = center, .size = Vec3(250, 250, 90), .origin = origin}},
                 folder / "truth", true);
}

/// Hills with a house at the centre of every second hectare, with steep walls of one cell's width.
double height_m(double x, double y) {
  const double hills = 8.0 * std::sin(x / 170.0) + 6.0 * std::cos(y / 130.0) + 2.0 * std::sin(x / 23.0 + y / 31.0);
  const double u = x / 50.0 - std::floor(x / 50.0), v = y / 50.0 - std::floor(y / 50.0);
  return hills + (u > 0.3 && u < 0.6 && v > 0.2 && v < 0.7 ? 12.0 : 0.0);
}

void make_large_truth(const fs::path& folder, double km2) {
  if (fs::exists(folder / "truth")) return;
  const double side_m = 1000.0 * std::sqrt(km2);
  const auto cells = static_cast<std::uint32_t>(side_m * 0.75);
  fs::create_directories(folder);
  imaging::TexturedMesh mesh{.mesh = tests::height_field(cells, -side_m / 2, side_m, height_m)};
  base::write_file(folder / "t.glb", imaging::write_glb({mesh}, {}));
  const json box{0, 0, 10, side_m / 2, 0, 0, 0, side_m / 2, 0, 0, 0, 40};
  const json tileset{{"asset", {{"version", "1.1"}}},
                     {"geometricError", 100},
                     {"root",
                      {{"boundingVolume", {{"box", box}}},
                       {"geometricError", 0},
                       {"refine", "REPLACE"},
                       {"content", {{"uri", "t.glb"}}}}}};
  base::write_file(folder / "tileset.json", tileset.dump());
  place::extract({.source = (folder / "tileset.json").string(),
                  .load = {.center_local = Vec3(0, 0, 10), .size = Vec3(side_m, side_m, 80)}},
                 folder / "truth", true);
}

/// A fisheye of 155 degrees along a line of 300 m at 85 m, looking 45 degrees down.
void make_dataset(const fs::path& folder) {
  fs::create_directories(folder);
  base::write_file(folder / "camera.yaml",
                   "cam0:\n  camera_model: pinhole\n  intrinsics: [379.0, 379.0, 511.5, 287.5]\n"
                   "  distortion_model: equidistant\n  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n"
                   "  resolution: [1024, 576]\n");
  geometry::Mat3 R_local_camera;  // columns: the camera's right, down, forward
  const double half = std::sqrt(0.5);
  R_local_camera << 0, -half, half, -1, 0, 0, 0, -half, -half;
  geometry::Trajectory path;
  for (int k = 0; k < 342; ++k) {
    const double along = k / 341.0;
    path.poses.push_back(
        {0.2 * k, geometry::SE3(R_local_camera, Vec3(-150 + 300 * along, 10 * std::sin(k / 30.0), 85))});
  }
  geometry::write_tum(folder / "groundtruth.txt", path);
}

/// Points scattered around the true surface with 5 cm noise, no farther than `within_m` from the centre.
void make_map(const fs::path& file, const fs::path& truth, std::size_t points, double within_m) {
  if (fs::exists(file)) return;
  geometry::PointCloud surface = ground_truth::read_surface_samples(truth);
  std::vector<bool> near(surface.size());
  for (std::size_t i = 0; i < surface.size(); ++i)
    near[i] = surface.positions[i].head<2>().cwiseAbs().maxCoeff() < within_m;
  surface = geometry::filter_points(surface, near);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, 1.0);
  geometry::PointCloud map;
  for (std::size_t k = 0; k < points; ++k) {
    const std::size_t i = random() % surface.size();
    const Vec3 n = surface.normals[i].cast<double>(), any(normal(random), normal(random), normal(random));
    map.positions.push_back(surface.positions[i] + 0.15 * (any - any.dot(n) * n) + 0.05 * normal(random) * n);
    map.colors.push_back({128, 128, 128});
    for (const char* name : {"first_frame", "inverse_depth_variance", "last_frame", "observations"})
      map.scalars[name].push_back(1.0F);
  }
  geometry::write_cloud(file, map);
}

// ------------------------------------------------------------------------------------------------------ measurements

int evaluate(const Task& task) {
  const fs::path out = task.map.string() + ".scores";
  fs::create_directories(out);
  base::write_file(out / "transform.json",
                   R"({"matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "scale": 1, "rmse": 0, "fitness": 1,
                           "iterations": 1, "converged": true, "method": "given"})");
  scoring::MapInputs map{.map = task.map};
  map.camera = task.dataset / "camera.yaml";
  map.truth_trajectory = task.dataset / "groundtruth.txt";
  scoring::evaluate(map, task.truth, out / "transform.json", {}, out / "metrics.json");
  return 0;
}

/// Runs evaluate() in its own process, by executing this program again.
void measure(const Task& task) {
  const auto start = std::chrono::steady_clock::now();
  const pid_t child = fork();
  if (child == 0) {
    execl("/proc/self/exe", "evaluate_benchmark", "--evaluate", task.map.c_str(), task.truth.c_str(),
          task.dataset.c_str(), nullptr);
    _exit(127);
  }
  int status = 0;
  rusage used{};
  wait4(child, &status, 0, &used);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (status != 0) throw std::runtime_error(task.map.string() + ": evaluate failed");
  const json m = json::parse(base::read_text(task.map.string() + ".scores/metrics.json"));
  const double cpu_s = static_cast<double>(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                       1e-6 * static_cast<double>(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
  std::printf(
      "%9zu points: %6.1f s, %6.1f s of processors, %6.0f MB | mean %.5f median %.5f entropy %.4f (%zu asked) "
      "|cos| %.4f (%zu asked)\n",
      m["map"]["points"].get<std::size_t>(), seconds, cpu_s, static_cast<double>(used.ru_maxrss) / 1024.0,
      m["map"]["mean"].get<double>(), m["surface"]["median"].get<double>(), m["entropy"]["mean"].get<double>(),
      m["entropy"]["asked"].get<std::size_t>(), m["surface"]["normals"]["mean_abs_cos"].get<double>(),
      m["surface"]["normals"]["asked"].get<std::size_t>());
  std::fflush(stdout);
}

struct Arguments {
  std::vector<std::size_t> points;
  double place_km2 = 4.0;
  fs::path folder;
};

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    if (name == "--points") {
      arguments.points.push_back(std::stoul(value));
    } else if (name == "--place-km2") {
      arguments.place_km2 = std::stod(value);
    } else if (name == "--folder") {
      arguments.folder = value;
    } else {
      throw std::runtime_error(name + " is not known; there are --points, --place-km2 and --folder");
    }
  }
  if (arguments.points.empty()) arguments.points = {100000, 1000000, 10000000};
  return arguments;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc == 5 && std::string(argv[1]) == "--evaluate") return evaluate({argv[2], argv[3], argv[4]});
  const Arguments arguments = parse(argc, argv);
  const tests::TemporaryFolder temporary;
  const fs::path folder = arguments.folder.empty() ? temporary.path() : fs::absolute(arguments.folder);
  make_dataset(folder / "dataset");
  make_stadium_truth(folder / "stadium");
  std::printf("the stadium, 250 m x 250 m\n");
  for (const std::size_t points : arguments.points) {
    const fs::path map = folder / ("stadium/map_" + std::to_string(points) + ".ply");
    make_map(map, folder / "stadium/truth", points, 125.0);
    measure({map, folder / "stadium/truth", folder / "dataset"});
  }
  if (!(arguments.place_km2 > 0.0)) return 0;
  make_large_truth(folder / "large", arguments.place_km2);
  make_map(folder / "large/map.ply", folder / "large/truth", 60000, 150.0);
  std::printf("a place of %.3g km2\n", arguments.place_km2);
  measure({folder / "large/map.ply", folder / "large/truth", folder / "dataset"});
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "evaluate_benchmark: %s\n", error.what());
  return 1;
}
