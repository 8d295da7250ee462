#include <nlohmann/json.hpp>

#include "arrays.h"
#include "bindings.h"
#include "tileflight/experiments/experiment/stage_options.h"
#include "tileflight/slam/odometry/odometry.h"

namespace tileflight::python {
namespace {

using odometry::FrameResult;
using odometry::Odometry;
using odometry::OdometryResult;

const char* status_name(odometry::FrameStatus status) {
  switch (status) {
    case odometry::FrameStatus::kInitializing:
      return "initializing";
    case odometry::FrameStatus::kTracked:
      return "tracked";
    case odometry::FrameStatus::kNotAligned:
      return "not aligned";
    case odometry::FrameStatus::kLost:
      break;
  }
  return "lost";
}

odometry::OdometryOptions options_from(const py::kwargs& settings) {
  const nlohmann::json json = to_json(settings, "settings");
  base::StrictSection section(json, "Odometry");
  odometry::OdometryOptions options = experiment::read_odometry_options(section);
  section.require_all_keys_used();
  return options;
}

using OtherCameraArguments = std::vector<std::pair<imaging::Camera, InputArray<double>>>;

std::unique_ptr<Odometry> make_odometry(const imaging::Camera& camera, double line_delay_s,
                                        const OtherCameraArguments& other_cameras, const py::kwargs& settings) {
  odometry::OdometryInput input{imaging::Calibration()};
  input.calibration.camera = camera;
  input.calibration.line_delay_s = line_delay_s;
  for (const auto& [lens, T_other_reference] : other_cameras) {
    odometry::OtherCamera other;
    other.name = std::to_string(input.other_cameras.size());
    other.calibration.camera = lens;
    other.T_other_reference = rigid_motion_from(T_other_reference, "other_cameras");
    input.other_cameras.push_back(other);
  }
  return std::make_unique<Odometry>(std::move(input), options_from(settings));
}

FrameResult add(Odometry& odometry, const InputArray<std::uint8_t>& image, double time_s,
                const std::optional<InputArray<double>>& prior,
                const std::vector<std::optional<InputArray<std::uint8_t>>>& others) {
  odometry::InputFrame frame{.index = odometry.frames(), .time_s = time_s, .image = image_from_array(image)};
  for (const auto& other : others)
    frame.others.push_back({other ? image_from_array(*other) : imaging::RgbImage(), 0.0});
  std::optional<geometry::SE3> T_world_camera;
  if (prior) T_world_camera = rigid_motion_from(*prior, "prior");
  const py::gil_scoped_release unlocked;
  return odometry.add(std::move(frame), T_world_camera);
}

py::dict cloud_to_arrays(geometry::PointCloud cloud) {
  const auto count = static_cast<py::ssize_t>(cloud.size());
  py::dict arrays;
  arrays["points"] = points_to_array(std::move(cloud.positions));
  if (!cloud.colors.empty()) arrays["colors"] = move_to_array<std::uint8_t>(std::move(cloud.colors), {count, 3});
  for (auto& [name, values] : cloud.scalars) arrays[name.c_str()] = move_to_array<float>(std::move(values), {count});
  return arrays;
}

py::dict path_to_arrays(const geometry::Trajectory& trajectory) {
  py::dict arrays;
  arrays["times"] = times_of(trajectory);
  arrays["poses"] = poses_of(trajectory);
  return arrays;
}

py::dict finish(Odometry& odometry) {
  OdometryResult result;
  {
    const py::gil_scoped_release unlocked;
    result = odometry.finish();
  }
  py::dict out;
  out["trajectory"] = path_to_arrays(result.trajectory);
  out["keyframes"] = path_to_arrays(result.keyframes);
  out["map"] = cloud_to_arrays(std::move(result.map));
  out["camera"] = result.camera;
  out["frames"] = result.frames;
  out["frames_tracked"] = result.frames_tracked;
  out["frames_before_start"] = result.frames_before_start;
  out["frames_tracked_backwards"] = result.frames_tracked_backwards;
  out["metric"] = result.stereo && result.stereo->metric;
  out["lost"] = result.lost;
  out["lost_reason"] = result.lost_reason;
  return out;
}

}  // namespace

void bind_odometry(py::module_& module) {
  using py::arg;
  py::class_<FrameResult>(module, "TrackedFrame",
                          "Result for one image at the moment when it was added; later images refine it.")
      .def_property_readonly(
          "status", [](const FrameResult& f) { return status_name(f.status); },
          "'initializing', 'tracked', 'not aligned' or 'lost'.")
      .def_property_readonly(
          "pose",
          [](const FrameResult& f) { return f.T_map_camera ? std::optional(f.T_map_camera->matrix()) : std::nullopt; },
          "T_map_camera (4, 4), scale unknown (monocular); or None.")
      .def_property_readonly("is_keyframe", [](const FrameResult& f) { return f.quality.is_keyframe; })
      .def_property_readonly(
          "rmse", [](const FrameResult& f) { return f.quality.rmse; },
          "Root mean square of the photometric alignment's residuals, grey values.")
      .def_property_readonly(
          "sigma_position", [](const FrameResult& f) { return f.quality.sigma_position; },
          "Standard deviation of the position relative to the previous keyframe, map units.")
      .def_readonly("reason", &FrameResult::reason, "Why there is no pose; empty if tracked.");
  py::class_<Odometry>(module, "Odometry",
                       "Direct Sparse Odometry (Engel, Koltun, Cremers, TPAMI 2018): it takes images one "
                       "at a time and gives poses and a map. One thread at a time may use an object.")
      .def(py::init(&make_odometry), arg("camera"), arg("line_delay") = 0.0,
           arg("other_cameras") = OtherCameraArguments{},
           "camera: the lens of the images. line_delay: seconds from row to row of a rolling shutter. other_cameras: "
           "(lens, T_other_camera (4, 4), metres) of each other camera of a rig; map and poses are then in metres. "
           "Further keywords "
           "are the keys of an experiment's `odometry:` section.")
      .def(
          "add", &add, arg("image"), arg("time"), arg("prior") = py::none(),
          arg("others") = std::vector<std::optional<InputArray<std::uint8_t>>>{},
          "Processes the next image, (height, width, 3) or (height, width) uint8, at a time in seconds; prior: "
          "T_world_camera (4, 4) if it is known; others: the other cameras' images of the same instant, None where one "
          "took none. Returns a TrackedFrame.")
      .def_property_readonly("lost", &Odometry::lost)
      .def_property_readonly("frames", &Odometry::frames)
      .def_property_readonly(
          "trajectory", [](const Odometry& o) { return path_to_arrays(o.trajectory()); },
          "Current estimate: times (N) and poses T_map_camera (N, 4, 4).")
      .def_property_readonly("keyframes", [](const Odometry& o) { return path_to_arrays(o.keyframes()); })
      .def_property_readonly(
          "map", [](const Odometry& o) { return cloud_to_arrays(o.map()); },
          "Current estimate: points (N, 3) in map units, colors (N, 3), and named values (N).")
      .def("finish", &finish,
           "Ends the odometry: a dictionary with trajectory, keyframes, map, camera (refined), frames, frames_tracked, "
           "frames_before_start, frames_tracked_backwards, metric, lost, lost_reason.");
}

}  // namespace tileflight::python
