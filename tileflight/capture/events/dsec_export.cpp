#include "tileflight/capture/events/dsec_export.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/capture/events/hdf5_handle.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/exports/layout_writers.h"

namespace tileflight::events {
namespace {

namespace fs = std::filesystem;

using dataset::RigCamera;
using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

fs::path events_of(const RigCamera& camera) { return camera.dataset.folder / "events.h5"; }

/// The cameras with events, in their order.
std::vector<const RigCamera*> event_cameras(const dataset::Rig& rig) {
  std::vector<const RigCamera*> cameras;
  for (const RigCamera& camera : rig.cameras) {
    if (fs::is_regular_file(events_of(camera))) cameras.push_back(&camera);
  }
  if (cameras.empty())
    throw InputError(rig.cameras.front().dataset.folder.string(),
                     "has no events.h5; render the flight with 'events' (docs/events.md)");
  return cameras;
}

/// One list of two numbers a pixel.
void write_rectify_map(const fs::path& file, const imaging::Image<std::array<float, 2>>& map) {
  const QuietHdf5 quiet;
  const std::string place = file.string();
  const Hdf5Handle open(H5Fcreate(file.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose, place);
  const std::array<hsize_t, 3> shape{static_cast<hsize_t>(map.height), static_cast<hsize_t>(map.width), 2};
  const Hdf5Handle space(H5Screate_simple(3, shape.data(), nullptr), H5Sclose, place);
  const Hdf5Handle options(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, place);
  require_hdf5(H5Pset_obj_track_times(options, false), place);
  const Hdf5Handle list(H5Dcreate2(open, "rectify_map", H5T_NATIVE_FLOAT, space, H5P_DEFAULT, options, H5P_DEFAULT),
                        H5Dclose, place);
  require_hdf5(H5Dwrite(list, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, map.pixels.data()), place);
}

std::string timestamps_text(const dataset::Dataset& dataset) {
  std::string text;
  for (const dataset::Frame& frame : dataset.frames) text += std::to_string(std::llround(frame.time_s * 1e6)) + "\n";
  return text;
}

/// A sequence of one or two cameras.
void write_sequence(const std::vector<const RigCamera*>& cameras, const fs::path& folder, const Progress& progress) {
  const std::array<const char*, 2> sides{"left", "right"};
  const imaging::Camera rectified = rectified_camera(cameras.front()->dataset.calibration.camera);
  std::array<Mat3, 2> rotations{Mat3::Identity(), Mat3::Identity()};
  if (cameras.size() > 1)
    rotations = rectifying_rotations(cameras[0]->T_body_camera.inverse() * cameras[1]->T_body_camera);
  base::make_folder(folder / "calibration");
  for (std::size_t side = 0; side < cameras.size(); ++side) {
    const dataset::Dataset& of_side = cameras[side]->dataset;
    const fs::path events = folder / "events" / sides[side];
    base::make_folder(events);
    fs::copy_file(events_of(*cameras[side]), events / "events.h5");
    write_rectify_map(events / "rectify_map.h5", rectify_map(of_side.calibration.camera, rectified, rotations[side]));
    imaging::write_kalibr(folder / "calibration" / (std::string(sides[side]) + ".yaml"), of_side.calibration);
    exports::write_png_frames(of_side, folder / "images" / sides[side] / "distorted", dataset::frame_id, progress);
  }
  base::write_file(folder / "images" / "timestamps.txt", timestamps_text(cameras.front()->dataset));
}

}  // namespace

imaging::Camera rectified_camera(const imaging::Camera& left) {
  Eigen::Matrix<double, 2, 3> d_pixel_d_point;
  const auto middle = left.project(Vec3::UnitZ(), d_pixel_d_point);
  if (!middle) throw InputError("camera", "sees nothing along its optical axis, so that it cannot be rectified");
  return {imaging::PinholeRadtan{.fx = std::abs(d_pixel_d_point(0, 0)),
                                 .fy = std::abs(d_pixel_d_point(1, 1)),
                                 .cx = middle->x(),
                                 .cy = middle->y(),
                                 .d = {}},
          left.width(), left.height()};
}

std::array<Mat3, 2> rectifying_rotations(const SE3& T_left_right) {
  const Vec3 along = T_left_right.translation;
  if (!(along.norm() > 0.0)) return {Mat3::Identity(), T_left_right.rotation.toRotationMatrix()};
  const Vec3 axes = Vec3::UnitZ() + T_left_right.rotation * Vec3::UnitZ();
  Mat3 R_left_rectified;
  const Vec3 x = (along.x() < 0.0 ? Vec3(-along) : along).normalized();
  const Vec3 y = axes.cross(x).normalized();
  R_left_rectified << x, y, x.cross(y);
  return {R_left_rectified.transpose(), R_left_rectified.transpose() * T_left_right.rotation.toRotationMatrix()};
}

imaging::Image<std::array<float, 2>> rectify_map(const imaging::Camera& camera, const imaging::Camera& rectified,
                                                 const Mat3& R_rectified_camera) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  imaging::Image<std::array<float, 2>> map(camera.width(), camera.height(), {kNone, kNone});
  for (int y = 0; y < camera.height(); ++y) {
    for (int x = 0; x < camera.width(); ++x) {
      const auto ray = camera.unproject(geometry::Vec2(x, y));
      if (!ray) continue;
      const auto pixel = rectified.project(R_rectified_camera * *ray);
      if (pixel) map(x, y) = {static_cast<float>(pixel->x()), static_cast<float>(pixel->y())};
    }
  }
  return map;
}

exports::ExportResult export_dsec(const dataset::Rig& rig, const fs::path& folder, bool replace,
                                  const Progress& progress, std::vector<fs::path> inputs) {
  std::vector<const RigCamera*> cameras = event_cameras(rig);
  for (const RigCamera& camera : rig.cameras) inputs.push_back(camera.dataset.folder);
  exports::ExportResult result{cameras.front()->dataset.frames.size(), {}};
  if (rig.cameras.size() > std::min<std::size_t>(2, cameras.size()))
    result.notes.emplace_back("DSEC's sequences have two event cameras at most: the first two with events are written");
  cameras.resize(std::min<std::size_t>(2, cameras.size()));
  result.notes.emplace_back("DSEC's layout has no place for true poses, IMU, positions and depth: they are left out");
  const base::OutputFolder output{
      .folder = folder, .command = "export", .replace = replace, .inputs = std::move(inputs)};
  base::write_folder(output, [&](const fs::path& temporary) { write_sequence(cameras, temporary, progress); });
  return result;
}

}  // namespace tileflight::events
