// The TUM RGB-D benchmark (Sturm et al., IROS 2012; https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats):
// rgb.txt and depth.txt "seconds file", depth registered to the colour images and scaled by 5000, groundtruth.txt of
// the colour camera. VSLAM-LAB's sequences before 2025-09 have the same files and a calibration.yaml.
#include <algorithm>
#include <array>
#include <cmath>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/dataset/layouts.h"

namespace tileflight::dataset::layouts {

namespace {

namespace fs = std::filesystem;

constexpr double kTumDepthUnitsPerM = 5000.0;

/// Colour and depth images are taken one after the other; the benchmark's own tool pairs those up to this far apart.
constexpr double kMaxDepthDelay_s = 0.02;

struct TimedFile {
  double time_s = 0.0;
  fs::path file;
};

std::vector<TimedFile> read_file_list(const fs::path& folder, const fs::path& list) {
  std::vector<TimedFile> files;
  base::for_each_row(base::read_text(list), list.string(), " \t", [&](const base::TextRow& row) {
    const auto time_s = base::parse_number<double>(row.fields.front());
    if (!time_s || !std::isfinite(*time_s) || row.fields.size() != 2)
      throw InputError(row.where, "expected \"seconds file\"");
    files.push_back({*time_s, file_within(folder, row.fields[1], row.where)});
  });
  return files;
}

/// Gives each frame the depth image nearest in time, if there is one.
void add_depth_images(std::vector<TimedFile> depth, std::vector<Frame>& frames) {
  std::erase_if(depth, [](const TimedFile& d) { return !fs::is_regular_file(d.file); });
  std::ranges::sort(depth, {}, &TimedFile::time_s);
  for (Frame& frame : frames) {
    const auto after = std::ranges::lower_bound(depth, frame.time_s, {}, &TimedFile::time_s);
    double nearest_s = kMaxDepthDelay_s;
    for (auto candidate = after == depth.begin() ? after : after - 1; candidate != depth.end() && candidate <= after;
         ++candidate) {
      const double delay_s = std::abs(candidate->time_s - frame.time_s);
      if (delay_s > nearest_s) continue;
      nearest_s = delay_s;
      frame.depth = candidate->file;
    }
  }
}

/// Intrinsics of the colour cameras as published on the page named above: fx fy cx cy and k1 k2 p1 p2 k3.
struct Freiburg {
  const char* name;
  std::array<double, 4> intrinsics;
  std::array<double, 5> distortion;
};
constexpr std::array<Freiburg, 3> kFreiburg{
    {{"freiburg1", {517.3, 516.5, 318.6, 255.3}, {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}},
     {"freiburg2", {520.9, 521.0, 325.1, 249.7}, {0.2312, -0.7849, -0.0033, -0.0001, 0.9172}},
     {"freiburg3", {535.4, 539.2, 320.1, 247.6}, {}}}};

imaging::Calibration published_calibration(const fs::path& folder) {
  // "x/." and "x/" name the same folder as "x".
  const std::string name = fs::absolute(folder / ".").lexically_normal().parent_path().filename().string();
  for (const Freiburg& known : kFreiburg) {
    if (name.find(known.name) == std::string::npos) continue;
    const auto& f = known.intrinsics;
    const auto& d = known.distortion;
    imaging::CameraModel model = imaging::PinholeRadtan{f[0], f[1], f[2], f[3], {}};
    if (d != std::array<double, 5>{})
      model = imaging::PinholeRational{f[0], f[1], f[2], f[3], {d[0], d[1], d[2], d[3], d[4]}};
    return {.camera = imaging::Camera(model, 640, 480), .T_cam_imu = {}};
  }
  throw InputError(folder.string(),
                   "has no calibration, and its name is not of freiburg1, 2 or 3: name a calibration (--camera)");
}

/// The lens, and the units of the depth images where the folder states them.
imaging::Calibration own_calibration(const fs::path& folder, Dataset& dataset) {
  if (const fs::path file = folder / "calibration.yaml"; fs::is_regular_file(file)) {
    const imaging::VslamLabCamera camera = imaging::read_vslam_lab_camera(file);
    if (camera.depth_units_per_m > 0.0) dataset.depth_units_per_m = camera.depth_units_per_m;
    return camera.calibration;
  }
  for (const char* name : {"camera.yaml", "camera.txt"})
    if (fs::is_regular_file(folder / name)) return imaging::read_calibration(folder / name);
  return published_calibration(folder);
}

}  // namespace

bool is_tum_rgbd(const fs::path& folder) { return fs::is_regular_file(folder / "rgb.txt"); }

Dataset read_tum_rgbd(const fs::path& folder, const CameraChoice& camera) {
  Dataset dataset;
  dataset.folder = folder;
  dataset.depth_units_per_m = kTumDepthUnitsPerM;
  std::vector<Frame> named;
  for (const TimedFile& image : read_file_list(folder, folder / "rgb.txt"))
    named.push_back({image.file.stem().string(), image.file, image.time_s, 0.0});
  dataset.frames = existing_frames(std::move(named), folder / "rgb.txt", dataset.warnings);
  if (const fs::path list = folder / "depth.txt"; fs::is_regular_file(list))
    add_depth_images(read_file_list(folder, list), dataset.frames);
  dataset.calibration =
      camera.calibration.empty() ? own_calibration(folder, dataset) : read_chosen_camera(camera, dataset);
  if (const fs::path file = folder / "groundtruth.txt"; fs::is_regular_file(file))
    dataset.groundtruth = geometry::read_tum(file);
  return dataset;
}

}  // namespace tileflight::dataset::layouts
