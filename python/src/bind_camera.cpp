#include <limits>
#include <variant>

#include "arrays.h"
#include "bindings.h"
#include "tileflight/core/imaging/camera.h"

namespace tileflight::python {
namespace {

using imaging::Calibration;
using imaging::Camera;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct ModelName {
  const char* operator()(const imaging::PinholeRadtan& m) const {
    return m.d == decltype(m.d){} ? "pinhole" : "pinhole-radtan";
  }
  const char* operator()(const imaging::PinholeRational&) const { return "pinhole-rational"; }
  const char* operator()(const imaging::KannalaBrandt&) const { return "pinhole-equi"; }
  const char* operator()(const imaging::FovModel&) const { return "fov"; }
  const char* operator()(const imaging::DoubleSphere&) const { return "double-sphere"; }
  const char* operator()(const imaging::UnifiedModel&) const { return "omni"; }
  const char* operator()(const imaging::ExtendedUnifiedModel&) const { return "eucm"; }
  const char* operator()(const imaging::Equirectangular&) const { return "equirectangular"; }
};

struct Distortion {
  template <std::size_t N>
  static std::vector<double> list(const std::array<double, N>& numbers) {
    return {numbers.begin(), numbers.end()};
  }
  std::vector<double> operator()(const imaging::PinholeRadtan& m) const { return list(m.d); }
  std::vector<double> operator()(const imaging::PinholeRational& m) const { return list(m.d); }
  std::vector<double> operator()(const imaging::KannalaBrandt& m) const { return list(m.k); }
  std::vector<double> operator()(const imaging::FovModel& m) const { return {m.w}; }
  std::vector<double> operator()(const imaging::DoubleSphere& m) const { return {m.xi, m.alpha}; }
  std::vector<double> operator()(const imaging::UnifiedModel& m) const {
    return {m.xi, m.d[0], m.d[1], m.d[2], m.d[3]};
  }
  std::vector<double> operator()(const imaging::ExtendedUnifiedModel& m) const { return {m.alpha, m.beta}; }
  std::vector<double> operator()(const imaging::Equirectangular&) const { return {}; }
};

/// Makes the lens model of this name. `f`: fx, fy, cx, cy in pixels; `d`: the further numbers in the order of
/// Distortion. Throws ValueError for an unknown name or a wrong count.
imaging::CameraModel make_model(const std::string& name, const std::array<double, 4>& f, std::vector<double> d) {
  const auto require_count = [&](std::size_t least, std::size_t most) {
    if (d.size() < least || d.size() > most)
      throw py::value_error("distortion of " + name + " has " + std::to_string(least) +
                            (most == least ? "" : " to " + std::to_string(most)) + " numbers, not " +
                            std::to_string(d.size()));
    d.resize(most, 0.0);
  };
  if (name == "pinhole") return require_count(0, 0), imaging::PinholeRadtan{f[0], f[1], f[2], f[3], {}};
  if (name == "pinhole-radtan")
    return require_count(0, 4), imaging::PinholeRadtan{f[0], f[1], f[2], f[3], {d[0], d[1], d[2], d[3]}};
  if (name == "pinhole-equi")
    return require_count(0, 4), imaging::KannalaBrandt{f[0], f[1], f[2], f[3], {d[0], d[1], d[2], d[3]}};
  if (name == "pinhole-rational") {
    require_count(4, 12);
    imaging::PinholeRational model{f[0], f[1], f[2], f[3], {}};
    std::copy(d.begin(), d.end(), model.d.begin());
    return model;
  }
  if (name == "fov") return require_count(1, 1), imaging::FovModel{f[0], f[1], f[2], f[3], d[0]};
  if (name == "double-sphere") return require_count(2, 2), imaging::DoubleSphere{f[0], f[1], f[2], f[3], d[0], d[1]};
  if (name == "omni")
    return require_count(1, 5), imaging::UnifiedModel{f[0], f[1], f[2], f[3], d[0], {d[1], d[2], d[3], d[4]}};
  if (name == "eucm") return require_count(2, 2), imaging::ExtendedUnifiedModel{f[0], f[1], f[2], f[3], d[0], d[1]};
  if (name == "equirectangular") return require_count(0, 0), imaging::Equirectangular{f[0], f[1], f[2], f[3]};
  throw py::value_error("unknown lens model '" + name +
                        "'; known: pinhole, pinhole-radtan, pinhole-rational, pinhole-equi, fov, double-sphere, omni, "
                        "eucm, equirectangular");
}

void require_size(int width, int height) {
  if (width < 1 || height < 1 || width > 65536 || height > 65536)
    throw py::value_error("an image has 1 to 65536 columns and rows, not " + std::to_string(width) + " x " +
                          std::to_string(height));
}

Camera make_camera(const std::string& model, int width, int height, double fx, double fy, double cx, double cy,
                   std::vector<double> distortion) {
  require_size(width, height);
  if (!(fx > 0.0) || !(fy > 0.0)) throw py::value_error("fx and fy must be positive");
  return {make_model(model, {fx, fy, cx, cy}, std::move(distortion)), width, height};
}

Camera make_by_field_of_view(Camera (*make)(int, int, double), int width, int height, double fov_deg) {
  require_size(width, height);
  if (!(fov_deg > 0.0 && fov_deg < 360.0)) throw py::value_error("fov_deg must be between 0 and 360");
  return make(width, height, fov_deg);
}

/// Applies `map` (Vec to optional Vec) to each row; rows without a value are NaN.
template <int From, int To, class Map>
py::array_t<double> map_rows(const InputArray<double>& rows, const char* name, Map map) {
  require_columns(rows, From, name);
  const py::ssize_t count = rows.shape(0);
  std::vector<double> out(static_cast<std::size_t>(count) * To, kNaN);
  {
    const double* in = rows.data();
    const py::gil_scoped_release unlocked;
    for (py::ssize_t i = 0; i < count; ++i) {
      if (const auto value = map(Eigen::Map<const Eigen::Matrix<double, From, 1>>(in + From * i)))
        Eigen::Map<Eigen::Matrix<double, To, 1>>(out.data() + To * i) = *value;
    }
  }
  return move_to_array<double>(std::move(out), {count, To});
}

/// Returns fx, fy, cx, cy in pixels.
std::array<double, 4> focal_lengths_and_center(const Camera& camera) {
  return std::visit([](const auto& m) { return std::array{m.fx, m.fy, m.cx, m.cy}; }, camera.model());
}

std::string describe(const Camera& camera) {
  return std::string("<Camera ") + std::visit(ModelName{}, camera.model()) + " " + std::to_string(camera.width()) +
         "x" + std::to_string(camera.height()) + ">";
}

void bind_constructors(py::class_<Camera>& camera) {
  using py::arg;
  camera
      .def(py::init(&make_camera), arg("model"), arg("width"), arg("height"), arg("fx"), arg("fy"), arg("cx"),
           arg("cy"), arg("distortion") = std::vector<double>{},
           "model: pinhole, pinhole-radtan (k1 k2 p1 p2), pinhole-rational (OpenCV's 4 to 12), pinhole-equi "
           "(Kannala-Brandt k1 to k4), fov (w), double-sphere (xi alpha), omni (xi k1 k2 p1 p2), eucm (alpha beta), "
           "equirectangular; fx, fy, cx, cy in pixels; `distortion`: the numbers in brackets.")
      .def_static(
          "pinhole",
          [](int width, int height, double fov_deg) {
            if (fov_deg >= 180.0) throw py::value_error("a pinhole's fov_deg must be below 180");
            return make_by_field_of_view(&imaging::make_pinhole, width, height, fov_deg);
          },
          arg("width"), arg("height"), arg("fov_deg"), "A pinhole of this horizontal field of view, degrees.")
      .def_static(
          "fisheye",
          [](int width, int height, double fov_deg) {
            return make_by_field_of_view([](int w, int h, double fov) { return imaging::make_fisheye(w, h, fov); },
                                         width, height, fov_deg);
          },
          arg("width"), arg("height"), arg("fov_deg"),
          "An equidistant fisheye (pinhole-equi) of this horizontal field of view, degrees.")
      .def_static(
          "panorama",
          [](int width, int height) {
            require_size(width, height);
            return imaging::make_panorama(width, height);
          },
          arg("width"), arg("height"), "An equirectangular panorama of the full sphere.")
      .def_static(
          "read", [](const std::filesystem::path& file) { return imaging::read_calibration(file).camera; }, arg("file"),
          "The lens of a calibration file (Kalibr, OpenCV, COLMAP, DSO, VSLAM-LAB), told from its content.");
}

void bind_parameters(py::class_<Camera>& camera) {
  camera.def_property_readonly("model", [](const Camera& c) { return std::visit(ModelName{}, c.model()); })
      .def_property_readonly("width", &Camera::width)
      .def_property_readonly("height", &Camera::height)
      .def_property_readonly(
          "fx", [](const Camera& c) { return focal_lengths_and_center(c)[0]; }, "Focal length in x, pixels.")
      .def_property_readonly(
          "fy", [](const Camera& c) { return focal_lengths_and_center(c)[1]; }, "Focal length in y, pixels.")
      .def_property_readonly(
          "cx", [](const Camera& c) { return focal_lengths_and_center(c)[2]; }, "Principal point, pixels.")
      .def_property_readonly(
          "cy", [](const Camera& c) { return focal_lengths_and_center(c)[3]; }, "Principal point, pixels.")
      .def_property_readonly(
          "distortion", [](const Camera& c) { return std::visit(Distortion{}, c.model()); },
          "Further numbers of the lens model, in the constructor's order.")
      .def_property_readonly("horizontal_fov_deg", &Camera::horizontal_fov_deg, "Along the middle row, degrees.");
}

}  // namespace

void bind_camera(py::module_& module) {
  using py::arg;
  py::class_<Camera> camera(module, "Camera",
                            "A lens model and its image size. Camera frame: x right, y down, z forward; pixel centres "
                            "at integers.");
  bind_constructors(camera);
  bind_parameters(camera);
  camera
      .def(
          "project",
          [](const Camera& c, const InputArray<double>& points) {
            return map_rows<3, 2>(points, "points", [&](const geometry::Vec3& p) { return c.project(p); });
          },
          arg("points"),
          "Pixels (N, 2) of points (N, 3) in the camera frame; NaN outside the model's valid cone. Pixels outside the "
          "image are returned, too.")
      .def(
          "unproject",
          [](const Camera& c, const InputArray<double>& pixels) {
            return map_rows<2, 3>(pixels, "pixels", [&](const geometry::Vec2& p) { return c.unproject(p); });
          },
          arg("pixels"), "Unit rays (N, 3) in the camera frame of pixels (N, 2); NaN outside the model's valid region.")
      .def(
          "scaled_to",
          [](const Camera& c, int width, int height) {
            require_size(width, height);
            return c.scaled_to(width, height);
          },
          arg("width"), arg("height"), "Returns this lens for an image of another size with the same aspect ratio.")
      .def(
          "write",
          [](const Camera& c, const std::filesystem::path& file) {
            Calibration calibration;
            calibration.camera = c;
            imaging::write_kalibr(file, calibration);
          },
          arg("file"), "Writes a Kalibr camchain YAML file.")
      .def("__repr__", &describe);
}

}  // namespace tileflight::python
