#include "tileflight/experiments/report/run_folder.h"

#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/experiments/report/key_figures.h"
#include "tileflight/world/ground_truth/truth_folder.h"

namespace tileflight::report {
using drawing::number_at;

namespace fs = std::filesystem;
namespace {

using nlohmann::json;

json read_object(const fs::path& file) {
  json value = json::parse(base::read_text(file), nullptr, false);
  if (!value.is_object()) throw InputError(file.string(), "not a JSON object; run the experiment again");
  return value;
}

/// Lines "000000 TIMESTAMP_S EXPOSURE_MS"; the image is images/ID with any extension.
std::vector<FrameFile> read_frames(const fs::path& dataset) {
  std::vector<FrameFile> frames;
  if (!fs::exists(dataset / "times.txt")) return frames;
  std::istringstream lines(base::read_text(dataset / "times.txt"));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    std::string id;
    double time_s = 0;
    if (line.starts_with("#") || !(fields >> id >> time_s)) continue;
    for (const char* ending : {".jpg", ".png"}) {
      const fs::path image = dataset / "images" / (id + ending);
      if (fs::exists(image)) frames.push_back({image, time_s});
    }
  }
  return frames;
}

/// A camera's folder as camchain.yaml names it; nothing outside of the dataset.
bool is_within(const fs::path& folder) {
  const fs::path inside = folder.lexically_normal();
  return !inside.empty() && !inside.is_absolute() && *inside.begin() != "..";
}

/// The further cameras of a rig's dataset; those without images are left out.
void read_other_cameras(const fs::path& dataset, FlightRun& flight) {
  if (!fs::exists(dataset / "camchain.yaml")) return;
  const std::vector<imaging::ChainCamera> chain = imaging::read_camchain(dataset / "camchain.yaml");
  if (chain.size() < 2) return;
  flight.camera = chain.front().name;
  for (std::size_t i = 1; i < chain.size(); ++i) {
    if (!is_within(chain[i].folder)) continue;
    CameraFrames camera{chain[i].name, read_frames(dataset / chain[i].folder)};
    for (FrameFile& frame : camera.frames)
      frame.time_s += chain[i].timeshift_cam_imu_s - chain.front().timeshift_cam_imu_s;
    if (!camera.frames.empty()) flight.other_cameras.push_back(std::move(camera));
  }
}

geometry::Sim3 read_transform(const fs::path& file) {
  const json transform = read_object(file);
  geometry::Mat4 matrix;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      const auto nested = number_at(transform, "/matrix/" + std::to_string(row) + "/" + std::to_string(column));
      const auto value = nested ? nested : number_at(transform, "/matrix/" + std::to_string(4 * row + column));
      if (!value) throw InputError(file.string(), "'matrix' must be 4 x 4 numbers, row by row");
      matrix(row, column) = *value;
    }
  }
  return geometry::Sim3::from_matrix(matrix);
}

std::optional<geometry::LocalFrame> local_frame(const json& results) {
  const auto latitude = number_at(results, "/truth/frame/origin_lat"),
             longitude = number_at(results, "/truth/frame/origin_lon"),
             height = number_at(results, "/truth/frame/origin_height");
  if (!latitude || !longitude || !height) return std::nullopt;
  return geometry::LocalFrame({*latitude, *longitude, {*height}});
}

/// Reads gps.csv: lines of t,lat,lon,height,… after a header.
std::vector<geometry::Vec3> read_telemetry(const fs::path& file, const geometry::LocalFrame& frame) {
  std::vector<geometry::Vec3> positions;
  std::istringstream lines(base::read_text(file));
  for (std::string line; std::getline(lines, line);) {
    double time_s = 0, latitude = 0, longitude = 0, height = 0;
    char comma = 0;
    std::istringstream fields(line);
    if (!(fields >> time_s >> comma >> latitude >> comma >> longitude >> comma >> height)) continue;
    positions.push_back(frame.local_from_geodetic({latitude, longitude, {height}}));
  }
  return positions;
}

/// Reads reproduction.csv: lines of time_s,real_frame,simulated_frame,overlap,ncc,ssim,… after a header. A field that
/// is not a number is an unknown value.
std::vector<ViewPair> read_view_pairs(const fs::path& file) {
  std::vector<ViewPair> pairs;
  if (!fs::exists(file)) return pairs;
  std::istringstream lines(base::read_text(file));
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    std::vector<double> values;
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');) {
      char* end = nullptr;
      const double value = std::strtod(field.c_str(), &end);
      values.push_back(end == field.c_str() ? std::nan("") : value);
    }
    if (values.size() >= 6 && std::isfinite(values[0])) pairs.push_back({values[0], values[3], values[4], values[5]});
  }
  return pairs;
}

/// Reads one part of the folder into `part` if it exists, else records it as missing.
template <class Read>
void read_part(const fs::path& folder, const fs::path& file, const std::string& purpose,
               std::vector<std::string>& missing, const Read& read) {
  if (fs::exists(folder / file)) {
    read(folder / file);
  } else {
    missing.push_back(file.string() + " is not there: " + purpose);
  }
}

void read_estimate(const fs::path& folder, FlightRun& flight, std::vector<std::string>& missing) {
  const fs::path poses = fs::path(flight.key) / "odometry/trajectory.txt",
                 transform = fs::path(flight.key) / "transform.json";
  read_part(folder, transform, "no estimated path", missing, [&](const fs::path& transform_file) {
    read_part(folder, poses, "no estimated path", missing, [&](const fs::path& poses_file) {
      flight.estimate = geometry::transformed(read_transform(transform_file), geometry::read_tum(poses_file));
    });
  });
}

FlightRun read_flight(const fs::path& folder, const std::string& key, const json& results,
                      std::vector<std::string>& missing) {
  FlightRun flight;
  flight.key = key;
  flight.values = results[key];
  flight.label = flight_label(key, flight.values);
  const fs::path dataset = folder / key / "dataset";
  flight.frames = read_frames(dataset);
  if (flight.frames.empty()) missing.push_back(key + "/dataset contains no images");
  read_other_cameras(dataset, flight);
  if (fs::exists(dataset / "groundtruth.txt")) flight.truth = geometry::read_tum(dataset / "groundtruth.txt");
  const std::optional<geometry::LocalFrame> frame = local_frame(results);
  if (frame && fs::exists(dataset / "gps.csv")) flight.telemetry = read_telemetry(dataset / "gps.csv", *frame);
  read_estimate(folder, flight, missing);
  read_part(folder, fs::path(key) / "errors.ply", "no map and no cumulative curve", missing,
            [&](const fs::path& file) { flight.errors = geometry::read_cloud(file); });
  return flight;
}

/// The meshes of the blocks around the flights' paths; of all blocks if no path is known.
std::vector<fs::path> meshes_around(const std::vector<FlightRun>& flights, const ground_truth::TruthFolder& truth) {
  constexpr double kMargin_m = 250.0;
  geometry::Box3 flown;
  for (const FlightRun& flight : flights) {
    for (const auto* path : {&flight.truth, &flight.estimate}) {
      if (!*path) continue;
      for (const geometry::StampedPose& pose : (*path)->poses) flown.extend(pose.T_local_camera.translation);
    }
  }
  const geometry::Vec3 margin = geometry::Vec3::Constant(kMargin_m);
  std::vector<fs::path> files;
  for (const std::size_t part :
       flown.isEmpty() ? truth.all_parts() : truth.parts_in({flown.min() - margin, flown.max() + margin})) {
    if (truth.has_mesh(part)) files.push_back(truth.folder_of(part) / "mesh.glb");
  }
  return files;
}

}  // namespace

RunFolder read_run_folder(const std::filesystem::path& folder) {
  if (!fs::exists(folder / "results.json")) {
    throw InputError(folder.string(), "no results.json here; make it with `tileflight run EXPERIMENT.yaml --out DIR`");
  }
  RunFolder run;
  run.results = read_object(folder / "results.json");
  refuse_earlier_key(run.results, folder / "results.json");
  run.voxel_m = number_at(run.results, "/truth/voxel_size").value_or(1.0);
  const bool in_blocks = fs::exists(folder / "truth/index.json");
  read_part(folder, in_blocks ? "truth/index.json" : "truth/voxels.ply", "no ground truth under the maps", run.missing,
            [&](const fs::path&) {
              const ground_truth::TruthFolder truth(folder / "truth");
              run.voxel_centers = truth.read_voxel_centers(truth.all_parts());
            });
  run.view_pairs = read_view_pairs(folder / "reproduction.csv");
  if (fs::exists(folder / "coverage/coverage.json")) run.coverage = read_object(folder / "coverage/coverage.json");
  if (fs::exists(folder / "truth/mesh.glb")) run.meshes = {folder / "truth/mesh.glb"};
  for (const char* key : {"simulated", "real"}) {
    if (run.results.contains(key) && run.results[key].is_object()) {
      run.flights.push_back(read_flight(folder, key, run.results, run.missing));
    } else {
      run.missing.push_back(std::string("the experiment has no ") + (key == std::string("real") ? "second" : key) +
                            " flight");
    }
  }
  if (in_blocks) run.meshes = meshes_around(run.flights, ground_truth::TruthFolder(folder / "truth"));
  return run;
}

}  // namespace tileflight::report
