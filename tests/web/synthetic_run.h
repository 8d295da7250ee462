#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/core/imaging/glb_writer.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/evaluation/metrics/published_results.h"

namespace tileflight::tests {

/// A run folder as an experiment leaves it, of a bowl with a wall around, made by formulas: for tests of the report
/// only.
class SyntheticRun {
 public:
  struct Options {
    std::string name = "A bowl with a wall";
    std::string kind = "surrogate";
    bool second_flight = true;
    std::size_t map_points = 20000;
    bool rig = false;  ///< the simulated flight has the cameras left, right (0.1 s later) and down (half the rate)
  };

  SyntheticRun(std::filesystem::path folder, Options options)
      : folder_(std::move(folder)), options_(std::move(options)) {}

  void write() const {
    nlohmann::json results{{"name", options_.name},
                           {"paper", metrics::published_table()},
                           {"truth", truth()},
                           {"provenance", provenance()}};
    write_truth();
    results["simulated"] = write_flight("simulated", 0.15, 1);
    if (options_.second_flight) results["real"] = write_flight("real", 0.25, 2);
    if (options_.second_flight) results["comparison"] = comparison();
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ / "results.json") << results.dump(2);
  }

  /// Height of the place.
  static double height_m(double east, double north) {
    const double radius = std::hypot(east / 1.3, north);
    if (radius > 55 && radius < 58) return 14;
    if (radius > 30 && radius <= 55) return (radius - 30) * 0.4;
    return 0.3 * std::sin(east / 7) * std::cos(north / 9);
  }

 private:
  using Vec3 = geometry::Vec3;

  static nlohmann::json truth() {
    return {{"voxel_size", 1.0},
            {"region", {{"center", {0, 0, 10}}, {"size", {170, 136, 40}}}},
            {"frame", {{"origin_lat", 35.310344}, {"origin_lon", -80.740007}, {"origin_height", 200.0}}}};
  }
  static nlohmann::json comparison() {
    return {{"mean_difference", -0.02},     {"std_difference", -0.0117}, {"points_ratio", 1.0},
            {"ks_statistic", 0.061},        {"wasserstein_m", 0.0191},   {"mean_difference_ci95", {-0.0271, -0.0102}},
            {"equivalence_margin_m", 0.05}, {"verdict", "equivalent"},   {"equivalent_within_m", 0.0271}};
  }
  nlohmann::json provenance() const {
    return {{"version", "0.1.0"},
            {"commit", "0123456789ab"},
            {"seed", 7},
            {"command", "tileflight run " + options_.name + ".yaml --out out"},
            {"cut_sha256", std::string(64, 'c')},
            {"inputs", {{{"path", options_.name + ".yaml"}, {"sha256", std::string(64, 'a')}}}},
            {"seconds", {{"truth", 1.25}, {"simulated/odometry", 12.5}}},
            {"attribution", {"Synthetic data", options_.name}}};
  }

  static std::vector<Vec3> surface_points(std::size_t count, std::mt19937& random) {
    std::uniform_real_distribution<double> east(-85, 85), north(-68, 68);
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < count; ++i) {
      const double x = east(random), y = north(random);
      points.emplace_back(x, y, height_m(x, y));
    }
    return points;
  }

  void write_truth() const {
    geometry::PointCloud centers;
    for (int x = -85; x < 85; ++x) {
      for (int y = -68; y < 68; ++y) {
        const double z = height_m(x + 0.5, y + 0.5);
        for (double level = std::floor(z); level >= std::max(-1.0, std::floor(z) - 3); --level) {
          centers.positions.emplace_back(x + 0.5, y + 0.5, level + 0.5);
        }
      }
    }
    std::filesystem::create_directories(folder_ / "truth");
    geometry::write_cloud(folder_ / "truth/voxels.ply", centers);
    base::write_file(folder_ / "truth/mesh.glb", imaging::write_glb({textured_place()}, {}));
  }

  /// Stripes across and along, brighter to the north.
  static imaging::RgbImage paint() {
    imaging::RgbImage image(256, 256);
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const bool light = (x / 16 + y / 16) % 2 == 0;
        const auto shade = static_cast<std::uint8_t>((light ? 190 : 110) - y / 6);
        image(x, y) = {shade, static_cast<std::uint8_t>(shade - 30), static_cast<std::uint8_t>(shade / 2)};
      }
    }
    return image;
  }

  /// The surface as triangles two metres wide.
  static imaging::TexturedMesh textured_place() {
    constexpr int kColumns = 85, kRows = 68;
    imaging::TexturedMesh place;
    place.texture = std::make_shared<imaging::RgbImage>(paint());
    for (int row = 0; row <= kRows; ++row) {
      for (int column = 0; column <= kColumns; ++column) {
        const double east = -85.0 + 2 * column, north = 68.0 - 2 * row;
        place.mesh.vertices.emplace_back(east, north, height_m(east, north));
        place.uv.emplace_back(static_cast<float>(column) / kColumns, static_cast<float>(row) / kRows);
      }
    }
    for (std::uint32_t row = 0; row < kRows; ++row) {
      for (std::uint32_t column = 0; column < kColumns; ++column) {
        const std::uint32_t a = row * (kColumns + 1) + column, b = a + kColumns + 1;
        place.mesh.triangles.push_back({a, b, b + 1});
        place.mesh.triangles.push_back({a, b + 1, a + 1});
      }
    }
    return place;
  }

  static double voxel_distance(const Vec3& p) {
    const Vec3 center(std::floor(p.x()) + 0.5, std::floor(p.y()) + 0.5, std::floor(height_m(p.x(), p.y())) + 0.5);
    return (p - center).norm();
  }

  geometry::PointCloud map_of(double noise_m, unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, noise_m);
    geometry::PointCloud map;
    for (const Vec3& p : surface_points(options_.map_points, random)) {
      const Vec3 moved = p + (1 + std::abs(p.x()) / 40) * Vec3(noise(random), noise(random), noise(random));
      map.positions.push_back(moved);
      map.scalars["surface_distance"].push_back(
          static_cast<float>(std::abs(moved.z() - height_m(moved.x(), moved.y()))));
      map.scalars["voxel_distance"].push_back(static_cast<float>(voxel_distance(moved)));
    }
    return map;
  }

  static nlohmann::json metrics_of(const geometry::PointCloud& map) {
    std::vector<double> kept, edges(51);
    std::vector<std::size_t> counts(50, 0);
    for (std::size_t i = 0; i < edges.size(); ++i) edges[i] = 0.02 * static_cast<double>(i);
    for (const float d : map.scalars.at("voxel_distance")) {
      if (d < 1.0F) {
        kept.push_back(d);
        ++counts[static_cast<std::size_t>(d * 50)];
      }
    }
    double mean = 0, square = 0;
    for (const double d : kept) mean += d / static_cast<double>(kept.size());
    for (const double d : kept) square += (d - mean) * (d - mean);
    const auto within = [&](float limit) {
      const std::vector<float>& all = map.scalars.at("surface_distance");
      return static_cast<double>(std::count_if(all.begin(), all.end(), [&](float d) { return d <= limit; })) /
             static_cast<double>(all.size());
    };
    nlohmann::json accuracy;
    for (const char* t : {"0.1", "0.2", "0.5", "1"}) accuracy[t] = within(std::stof(t));
    return {{"map",
             {{"points", map.size()},
              {"correspondences", kept.size()},
              {"mean", mean},
              {"std", std::sqrt(square / (static_cast<double>(kept.size()) - 1))},
              {"cutoff", 1.0},
              {"truth", "voxel-centres"},
              {"histogram", {{"edges", edges}, {"counts", counts}}},
              {"quantization_floor", {{"mean", 0.481}, {"std", 0.139}}}}},
            {"surface", {{"median", 0.12}, {"accuracy", accuracy}, {"completeness", accuracy}, {"f_score", accuracy}}},
            {"trajectory",
             {{"ate_rmse", 0.21},
              {"ate_mean", 0.18},
              {"ate_max", 0.6},
              {"path_length", 312.5},
              {"scale", 1.01},
              {"rpe", {{{"delta_m", 10}, {"translation_rmse_m", 0.05}, {"rotation_rmse_deg", 0.1}}}}}}};
  }

  static geometry::Trajectory flight_path(double side, double wobble_m) {
    geometry::Trajectory trajectory;
    for (int i = 0; i <= 120; ++i) {
      const double angle = 0.045 * i;
      const Vec3 position((48 + side) * std::cos(angle) + wobble_m * std::sin(3 * angle), (38 + side) * std::sin(angle),
                          40 + 5 * std::sin(angle));
      const Vec3 forward = (-position).normalized(), right = forward.cross(Vec3::UnitZ()).normalized();
      geometry::Mat3 axes;
      axes << right, forward.cross(right), forward;
      trajectory.poses.push_back({0.2 * i, geometry::SE3(axes, position)});
    }
    return trajectory;
  }

  static imaging::RgbImage picture(int index, bool second) {
    imaging::RgbImage image(320, 180);
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const double wave = std::sin(0.05 * x + 0.3 * index) * std::cos(0.07 * y);
        const auto shade = static_cast<std::uint8_t>((second ? 105 : 135) + 70 * wave);
        image(x, y) = {static_cast<std::uint8_t>(shade / 2 + y / 3), shade, static_cast<std::uint8_t>(200 - y / 2)};
      }
    }
    return image;
  }

  void write_dataset(const std::filesystem::path& dataset, const geometry::Trajectory& path, bool second) const {
    std::filesystem::create_directories(dataset / "images");
    std::ofstream times(dataset / "times.txt"), gps(dataset / "gps.csv");
    gps << "t,lat,lon,height,horizontal_sigma,vertical_sigma\n";
    gps.precision(12);
    const geometry::LocalFrame frame({35.310344, -80.740007, {200.0}});
    for (std::size_t i = 0; i < path.size(); i += 6) {
      std::string id = std::to_string(i / 6);
      id.insert(0, 6 - id.size(), '0');
      imaging::write_rgb(dataset / "images" / (id + ".jpg"), picture(static_cast<int>(i), second));
      times << id << ' ' << path.poses[i].time_s << " 5\n";
      const geometry::Geodetic place =
          frame.geodetic_from_local(path.poses[i].T_local_camera.translation + Vec3(0.8, -0.6, 0));
      gps << path.poses[i].time_s << ',' << place.latitude_deg << ',' << place.longitude_deg << ',' << place.height.m
          << ",1,2\n";
    }
    geometry::write_tum(dataset / "groundtruth.txt", path);
  }

  /// The pictures of further cameras, which are those of the first in other colours.
  static void write_other_cameras(const std::filesystem::path& dataset) {
    imaging::Calibration calibration;
    calibration.camera = imaging::make_pinhole(320, 180, 90.0);
    const geometry::SE3 beside(Eigen::Quaterniond::Identity(), Vec3(0.3, 0, 0));
    imaging::Calibration of_others = calibration;
    of_others.T_cam_imu = beside.inverse();
    imaging::write_camchain(dataset / "camchain.yaml", {{"left", ".", calibration, {}, 0.0},
                                                        {"right", "cameras/right", of_others, beside, -0.1},
                                                        {"down", "cameras/down", of_others, beside, 0.0}});
    for (const std::string name : {"right", "down"}) {
      const std::filesystem::path folder = dataset / "cameras" / name;
      std::filesystem::create_directories(folder / "images");
      std::ofstream times(folder / "times.txt");
      for (int i = 0; i < 21; i += name == "down" ? 2 : 1) {
        std::string id = std::to_string(i);
        id.insert(0, 6 - id.size(), '0');
        imaging::RgbImage image = picture(6 * i, false);
        for (auto& pixel : image.pixels) std::swap(pixel[0], pixel[name == "down" ? 1 : 2]);
        imaging::write_rgb(folder / "images" / (id + ".jpg"), image);
        times << id << ' ' << 1.2 * i + (name == "right" ? 0.1 : 0.0) << " 5\n";
      }
    }
  }

  /// Writes the flight's folder and returns its part of results.json.
  nlohmann::json write_flight(const std::string& key, double noise_m, unsigned seed) const {
    const bool second = key == "real";
    const std::filesystem::path flight = folder_ / key;
    const geometry::Trajectory path = flight_path(second ? 6 : 0, 0);
    write_dataset(flight / "dataset", path, second);
    if (options_.rig && !second) write_other_cameras(flight / "dataset");
    std::filesystem::create_directories(flight / "odometry");
    const geometry::Sim3 T_local_map(2.5, Eigen::Quaterniond(0.8, 0.1, -0.3, 0.5), Vec3(5, -7, 40));
    geometry::write_tum(flight / "odometry/trajectory.txt",
                        geometry::transformed(T_local_map.inverse(), flight_path(second ? 6 : 0, 1.2)));
    nlohmann::json matrix = nlohmann::json::array();
    for (int r = 0; r < 4; ++r) {
      matrix.push_back({T_local_map.matrix()(r, 0), T_local_map.matrix()(r, 1), T_local_map.matrix()(r, 2),
                        T_local_map.matrix()(r, 3)});
    }
    std::ofstream(flight / "transform.json") << nlohmann::json{{"matrix", matrix}}.dump();
    const geometry::PointCloud map = map_of(noise_m, seed);
    geometry::write_cloud(flight / "errors.ply", map);
    nlohmann::json values = metrics_of(map);
    values.update({{"frames", 121},
                   {"fov_deg", 155.0},
                   {"resolution", {320, 180}},
                   {"fps", 5.0},
                   {"duration_s", 24.0},
                   {"kind", second ? options_.kind : "simulated"},
                   {"odometry",
                    {{"frames", 121},
                     {"frames_tracked", 121},
                     {"lost", false},
                     {"keyframes", 30},
                     {"points", map.size()},
                     {"seconds", 6.0},
                     {"frames_per_second", 20.2}}},
                   {"alignment",
                    {{"method", "point-to-point"},
                     {"converged", true},
                     {"iterations", 42},
                     {"scale", 2.5},
                     {"rmse", 0.41},
                     {"fitness", 0.7}}}});
    return values;
  }

  std::filesystem::path folder_;
  Options options_;
};

}  // namespace tileflight::tests
