// Counts how often a flight's place is found without telemetry, over the existing flights of a proving ground: by the
// looks alone (which candidate is the first right one), or with --align by the whole alignment.
//   build/release/bin/place_recall out/proving-ground
// Flights whose odometry is off by more than a hundredth of the path are left out.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "outcome.h"
#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/scoring/align_stage.h"
#include "tileflight/evaluation/scoring/align_target.h"
#include "tileflight/evaluation/scoring/flight_evidence.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::proving_ground {
namespace {

namespace fs = std::filesystem;
using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

struct Options {
  fs::path out;
  std::vector<std::string> only;
  bool align = false, list = false;
};

/// "0012-town1-arc-…": what it flew over.
std::string place_of(const std::string& name) {
  const auto first = name.find('-') + 1;
  return name.substr(first, name.find('-', first) - first);
}

struct Flight {
  scoring::MapInputs inputs;  ///< without telemetry
  geometry::PointCloud map;
  geometry::Trajectory path, truth;
  Sim3 T_true;
  TrueErrors errors;  ///< of the odometry

  explicit Flight(const fs::path& folder)
      : inputs(scoring::find_map_inputs(folder / "odometry", folder / "dataset")),
        map(scoring::read_map(inputs.map)),
        path(geometry::read_tum(inputs.trajectory)),
        truth(geometry::read_tum(folder / "dataset/groundtruth.txt")) {
    inputs.truth_trajectory.clear();
    inputs.attitude.clear();
    inputs.gps.clear();
    std::vector<SE3> in_map, in_truth;
    for (const auto& [i, j] : geometry::associate(path, truth)) {
      in_map.push_back(path.poses[i].T_local_camera);
      in_truth.push_back(truth.poses[j].T_local_camera);
    }
    T_true = alignment::fit_poses(in_map, in_truth);
    errors = true_errors(map, path, truth, T_true);
  }
  bool is_tracked() const { return errors.ate_m <= 0.01 * errors.path_m; }
};

/// Distance of a candidate from the right place; it tells whether the fit to the surface can start there.
struct Miss {
  double scale = 0.0, turn_deg = 0.0, offset = 0.0;  ///< offset: of the points, over their distance from the path

  bool is_near() const { return scale < 0.05 && turn_deg < 5.0 && offset < 0.05; }
};

Miss miss_of(const Sim3& T, const Flight& flight) {
  Miss miss{std::abs(std::log(T.scale / flight.T_true.scale)),
            T.rotation.angularDistance(flight.T_true.rotation) * 180.0 / std::numbers::pi};
  double sum = 0.0, n = 0.0;
  for (std::size_t i = 0; i < flight.map.size(); i += 7) {
    const Vec3 p = flight.map.positions[i];
    double distance = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < flight.path.size(); k += 5)
      distance = std::min(distance, (p - flight.path.poses[k].T_local_camera.translation).norm());
    sum += (T * p - flight.T_true * p).squaredNorm() / std::pow(distance * flight.T_true.scale, 2);
    n += 1.0;
  }
  miss.offset = std::sqrt(sum / n);
  return miss;
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

class Recall {
 public:
  explicit Recall(const Options& options) : options_(options) {}

  int run() {
    for (const std::string& name : names()) {
      try {
        const Flight flight(options_.out / "flights" / name);
        if (!flight.is_tracked()) continue;
        if (options_.align) {
          align(name, flight);
        } else {
          recognize(name, flight);
        }
      } catch (const InputError& error) {
        std::printf("%-66s %s\n", name.c_str(), error.what());
      }
      std::fflush(stdout);
    }
    std::printf("found %d of %d\n", found_, flights_);
    return 0;
  }

 private:
  std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(options_.out / "flights")) {
      const std::string name = entry.path().filename();
      const auto is_part = [&](const std::string& part) { return name.find(part) != std::string::npos; };
      if (options_.only.empty() || std::ranges::any_of(options_.only, is_part)) names.push_back(name);
    }
    std::ranges::sort(names, {}, [](const std::string& name) { return std::pair(place_of(name), name); });
    return names;
  }

  void load(const std::string& place) {
    if (place == place_) return;
    place_ = place;
    recognizer_.reset();
    const auto target = scoring::read_align_target(options_.out / "places" / place);
    const scene::Scene scene(mesh_files::read_mesh_source(target.folder / "mesh.glb", {}).meshes);
    const auto begin = std::chrono::steady_clock::now();
    recognizer_ = std::make_unique<localization::PlaceRecognizer>(scene, scene.bounds());
    std::printf("# %s: %.1f s\n", place.c_str(), seconds_since(begin));
  }

  void recognize(const std::string& name, const Flight& flight) {
    load(place_of(name));
    const auto begin = std::chrono::steady_clock::now();
    const auto candidates = recognizer_->find(
        scoring::make_flight_evidence(dataset::read_dataset(flight.inputs.dataset), flight.path, flight.map));
    const double seconds = seconds_since(begin);
    int rank = 0;
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      const Miss miss = miss_of(candidates[k].T_local_map, flight);
      if (rank == 0 && miss.is_near()) rank = static_cast<int>(k) + 1;
      if (options_.list)
        std::printf("   %zu inliers %zu correlation %.3f heights %.2f share %.2f, off %.3f %.1f deg %.3f\n", k + 1,
                    candidates[k].inliers, candidates[k].correlation, candidates[k].height_agreement,
                    candidates[k].overlap, miss.scale, miss.turn_deg, miss.offset);
    }
    ++flights_;
    found_ += rank >= 1 && rank <= 8 ? 1 : 0;
    std::printf("%-66s rank %2d of %2zu  %.1f s\n", name.c_str(), rank, candidates.size(), seconds);
  }

  void align(const std::string& name, const Flight& flight) {
    const auto begin = std::chrono::steady_clock::now();
    const auto transform = scoring::align(flight.inputs, options_.out / "places" / place_of(name), {},
                                          fs::temp_directory_path() / ("place-recall-" + name + ".json"));
    const double seconds = seconds_since(begin);
    const TrueErrors errors = true_errors(flight.map, flight.path, flight.truth, transform.T_local_map());
    const bool right = errors.offset_m <= std::max(0.1, 3.0 * errors.ate_m);
    ++flights_;
    found_ += right ? 1 : 0;
    std::printf("%-66s %s  offset %.3f m  warnings %zu  %.1f s\n", name.c_str(), right ? "right" : "wrong",
                errors.offset_m, transform.warnings.size(), seconds);
  }

  Options options_;
  std::string place_;
  std::unique_ptr<localization::PlaceRecognizer> recognizer_;
  int flights_ = 0, found_ = 0;
};

}  // namespace
}  // namespace tileflight::proving_ground

int main(int argc, char** argv) {
  tileflight::proving_ground::Options options;
  CLI::App app{"How often a flight's place is found without telemetry."};
  app.add_option("out", options.out, "a proving ground's folder")->required();
  app.add_option("--only", options.only, "flights whose names hold one of these");
  app.add_flag("--align", options.align, "by the whole alignment");
  app.add_flag("--list", options.list, "every candidate");
  CLI11_PARSE(app, argc, argv);
  return tileflight::proving_ground::Recall(options).run();
}
