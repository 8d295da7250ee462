#include "arrays.h"

#include <algorithm>
#include <cmath>

namespace tileflight::python {
namespace {

std::string shape_text(const py::array& array) { return py::str(array.attr("shape")); }

geometry::Mat4 matrix_from(const double* numbers) {
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers);
}

geometry::SE3 rigid_motion(const geometry::Mat4& matrix, const char* name) {
  const geometry::Mat3 rotation = matrix.topLeftCorner<3, 3>();
  const bool is_rotation =
      (rotation.transpose() * rotation - geometry::Mat3::Identity()).cwiseAbs().maxCoeff() < 1e-6 &&
      rotation.determinant() > 0.0;
  const bool is_affine = (matrix.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() < 1e-12;
  if (!matrix.allFinite() || !is_rotation || !is_affine)
    throw py::value_error(std::string(name) + " must be a rigid motion: a rotation, a translation, last row 0 0 0 1");
  return {rotation, matrix.topRightCorner<3, 1>()};
}

geometry::Mat4 matrix4_from(const InputArray<double>& matrix, const char* name) {
  if (matrix.ndim() != 2 || matrix.shape(0) != 4 || matrix.shape(1) != 4)
    throw py::value_error(std::string(name) + " must have shape (4, 4), not " + shape_text(matrix));
  return matrix_from(matrix.data());
}

}  // namespace

void require_columns(const py::array& array, py::ssize_t columns, const char* name) {
  if (array.ndim() != 2 || array.shape(1) != columns)
    throw py::value_error(std::string(name) + " must have shape (N, " + std::to_string(columns) + "), not " +
                          shape_text(array));
}

std::vector<geometry::Vec3> points_from_array(const InputArray<double>& array, const char* name) {
  require_columns(array, 3, name);
  static_assert(sizeof(geometry::Vec3) == 3 * sizeof(double));
  const auto* begin = reinterpret_cast<const geometry::Vec3*>(array.data());
  return {begin, begin + array.shape(0)};
}

imaging::RgbImage image_from_array(const InputArray<std::uint8_t>& array) {
  const bool is_grey = array.ndim() == 2;
  if (!is_grey && !(array.ndim() == 3 && array.shape(2) == 3))
    throw py::value_error("an image must have shape (height, width, 3) or (height, width), not " + shape_text(array));
  imaging::RgbImage image(static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)));
  const std::uint8_t* values = array.data();
  if (is_grey) {
    std::transform(values, values + array.size(), image.pixels.begin(), [](std::uint8_t v) {
      return imaging::Rgb8{v, v, v};
    });
  } else {
    std::copy_n(values, array.size(), image.pixels.data()->data());
  }
  return image;
}

geometry::SE3 rigid_motion_from(const InputArray<double>& matrix, const char* name) {
  return rigid_motion(matrix4_from(matrix, name), name);
}

geometry::Sim3 similarity_from(const InputArray<double>& matrix, const char* name) {
  return geometry::Sim3::from_matrix(matrix4_from(matrix, name));
}

geometry::Trajectory trajectory_from(const InputArray<double>& times, const InputArray<double>& poses) {
  if (times.ndim() != 1) throw py::value_error("times must have shape (N,), not " + shape_text(times));
  if (poses.ndim() != 3 || poses.shape(0) != times.shape(0) || poses.shape(1) != 4 || poses.shape(2) != 4)
    throw py::value_error("poses must have shape (N, 4, 4) with as many poses as times, not " + shape_text(poses));
  geometry::Trajectory trajectory;
  for (py::ssize_t i = 0; i < times.shape(0); ++i) {
    const double time_s = times.at(i);
    if (!std::isfinite(time_s) || (i > 0 && !(time_s > trajectory.poses.back().time_s)))
      throw py::value_error("times must be finite and increase");
    trajectory.poses.push_back({time_s, rigid_motion(matrix_from(poses.data(i)), "each of poses")});
  }
  return trajectory;
}

py::array_t<double> times_of(const geometry::Trajectory& trajectory) {
  std::vector<double> times;
  for (const geometry::StampedPose& pose : trajectory.poses) times.push_back(pose.time_s);
  return move_to_array<double>(std::move(times), {static_cast<py::ssize_t>(trajectory.size())});
}

py::array_t<double> poses_of(const geometry::Trajectory& trajectory) {
  std::vector<double> numbers(16 * trajectory.size());
  for (std::size_t i = 0; i < trajectory.size(); ++i)
    Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data() + 16 * i) =
        trajectory.poses[i].T_local_camera.matrix();
  return move_to_array<double>(std::move(numbers), {static_cast<py::ssize_t>(trajectory.size()), 4, 4});
}

}  // namespace tileflight::python
