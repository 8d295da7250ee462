#include "arrays.h"
#include "bindings.h"
#include "tileflight/evaluation/localization/localizer.h"

namespace tileflight::python {
namespace {

using localization::LivePose;

/// Locates images in a scene, which it keeps.
class SceneLocalizer {
 public:
  SceneLocalizer(SceneHandle scene, const imaging::Camera& camera, int width,
                 const std::optional<InputArray<double>>& T_imu_camera, bool starts_at_rest)
      : scene_(std::move(scene)) {
    if (width < 160 || width > 4096) throw py::value_error("width must be from 160 to 4096 pixels");
    localization::LiveOptions options;
    options.pictures.width = width;
    options.starts_at_rest = starts_at_rest;
    if (T_imu_camera)
      options.imu = inertial::ImuModel{.T_imu_camera = rigid_motion_from(*T_imu_camera, "T_imu_camera")};
    const py::gil_scoped_release unlocked;
    localizer_ = std::make_unique<localization::Localizer>(scene_->scene, camera, options);
  }

  void start(const InputArray<double>& T_local_camera, double time_s, double sigma_m, double sigma_deg) {
    localizer_->start(rigid_motion_from(T_local_camera, "T_local_camera"), time_s, sigma_m,
                      sigma_deg * geometry::kRadiansPerDegree);
  }

  void add_reading(double time_s, const std::array<double, 3>& rate, const std::array<double, 3>& force) {
    localizer_->add_reading({time_s, geometry::Vec3(rate.data()), geometry::Vec3(force.data())});
  }

  LivePose add(const InputArray<std::uint8_t>& image, double time_s, const std::optional<InputArray<double>>& motion) {
    const imaging::RgbImage picture = image_from_array(image);
    std::optional<geometry::SE3> T_last_this;
    if (motion) T_last_this = rigid_motion_from(*motion, "motion");
    const py::gil_scoped_release unlocked;
    return localizer_->add(picture, time_s, T_last_this);
  }

 private:
  SceneHandle scene_;
  std::unique_ptr<localization::Localizer> localizer_;
};

}  // namespace

void bind_localizer(py::module_& module) {
  using py::arg;
  py::class_<LivePose>(module, "LocatedPose", "Pose of the camera after an image, with its uncertainty.")
      .def_property_readonly(
          "pose", [](const LivePose& p) { return p.T_local_camera.matrix(); }, "T_local_camera (4, 4).")
      .def_property_readonly(
          "covariance", [](const LivePose& p) { return p.covariance; },
          "(6, 6), of a small motion of the camera in its own axes: translation (m), rotation (rad).")
      .def_property_readonly("sigma_position", &LivePose::sigma_position_m,
                             "Standard deviation of the position, three axes together, metres.")
      .def_property_readonly("sigma_rotation", &LivePose::sigma_rotation_rad,
                             "Standard deviation of the rotation, three axes together, radians.")
      .def_property_readonly(
          "velocity", [](const LivePose& p) { return p.velocity_m_s; }, "(3,), of the camera, local frame, m/s.")
      .def_readonly("sigma_velocity", &LivePose::sigma_velocity_m_s,
                    "Standard deviation of the velocity for each axis, m/s.")
      .def_readonly("located", &LivePose::located, "Found in this image; else the pose is predicted.")
      .def_readonly("lost", &LivePose::lost, "The pose is too uncertain to be used.")
      .def_readonly("correlation", &LivePose::correlation, "Of rendered and observed grey values; 0: not located.");
  py::class_<SceneLocalizer>(module, "Localizer",
                             "Locates the images of a camera in a scene one by one, as they come, by its textures. One "
                             "thread at a time may use an object.")
      .def(py::init<SceneHandle, const imaging::Camera&, int, const std::optional<InputArray<double>>&, bool>(),
           arg("scene"), arg("camera"), arg("width") = 640, arg("T_imu_camera") = py::none(),
           arg("starts_at_rest") = false,
           "width: images are compared with the scene at this width at most, pixels. T_imu_camera: (4, 4), mounting of "
           "an inertial unit, for add_reading(). starts_at_rest: with the unit, the camera stands where it is started "
           "until the readings say that it moves.")
      .def("start", &SceneLocalizer::start, arg("T_local_camera"), arg("time"), arg("sigma_position") = 0.5,
           arg("sigma_rotation_deg") = 1.0,
           "Sets where the camera is at a time, seconds; sigmas for each axis, metres and degrees.")
      .def("add_reading", &SceneLocalizer::add_reading, arg("time"), arg("angular_rate"), arg("specific_force"),
           "Adds a reading of the inertial unit, seconds, rad/s and m/s^2, in its axes; those up to an image's time "
           "come before the image.")
      .def("add", &SceneLocalizer::add, arg("image"), arg("time"), arg("motion") = py::none(),
           "Locates the next image, (height, width, 3) or (height, width) uint8, at a time in seconds; motion: "
           "T_last_this (4, 4), metres, if it is known. Returns a LocatedPose.");
}

}  // namespace tileflight::python
