#pragma once

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::python {

namespace py = pybind11;

/// An array argument. pybind11 converts what is passed to this type and to rows without gaps, unless it is so already.
template <class T>
using InputArray = py::array_t<T, py::array::c_style | py::array::forcecast>;

/// Hands a vector over to a new array without copying its elements. The product of `shape` is the number of T in it.
template <class T, class Element>
py::array_t<T> move_to_array(std::vector<Element> elements, std::vector<py::ssize_t> shape) {
  auto* owned = new std::vector<Element>(std::move(elements));
  const py::capsule owner(owned, [](void* memory) { delete static_cast<std::vector<Element>*>(memory); });
  return py::array_t<T>(std::move(shape), reinterpret_cast<const T*>(owned->data()), owner);
}

/// Makes a read-only array that shows memory of `owner` and keeps the owner alive.
template <class T>
py::array_t<T> view_of(const void* memory, std::vector<py::ssize_t> shape, const py::handle& owner) {
  py::array_t<T> view(std::move(shape), static_cast<const T*>(memory), owner);
  view.attr("setflags")(py::arg("write") = false);
  return view;
}

inline py::array_t<double> points_to_array(std::vector<geometry::Vec3> points) {
  const auto count = static_cast<py::ssize_t>(points.size());
  return move_to_array<double>(std::move(points), {count, 3});
}

inline py::array_t<std::uint8_t> image_to_array(imaging::RgbImage image) {
  return move_to_array<std::uint8_t>(std::move(image.pixels), {image.height, image.width, 3});
}

inline py::array_t<float> image_to_array(imaging::FloatImage image) {
  return move_to_array<float>(std::move(image.pixels), {image.height, image.width});
}

/// Throws ValueError unless the array has shape (any, columns). `name` is the argument's name for messages.
void require_columns(const py::array& array, py::ssize_t columns, const char* name);

/// Copies the rows of an (N, 3) array. Throws ValueError for another shape.
std::vector<geometry::Vec3> points_from_array(const InputArray<double>& array, const char* name);

/// Copies an image of shape (height, width, 3), or (height, width) in grey, 8 bits a channel. Throws ValueError for
/// another shape.
imaging::RgbImage image_from_array(const InputArray<std::uint8_t>& array);

/// Converts a 4x4 matrix to a rigid motion. Throws ValueError for another shape, or if its upper left is no rotation to
/// 1e-6.
geometry::SE3 rigid_motion_from(const InputArray<double>& matrix, const char* name);
/// Converts a 4x4 matrix to a similarity. Throws ValueError for another shape, InputError if it is no similarity.
geometry::Sim3 similarity_from(const InputArray<double>& matrix, const char* name);

/// Converts times (N), seconds, and poses T_local_camera (N, 4, 4) to a trajectory. Throws ValueError for other shapes,
/// and times that do not increase.
geometry::Trajectory trajectory_from(const InputArray<double>& times, const InputArray<double>& poses);
/// The inverse of trajectory_from(): times (N), seconds, and poses (N, 4, 4).
py::array_t<double> times_of(const geometry::Trajectory& trajectory);
py::array_t<double> poses_of(const geometry::Trajectory& trajectory);

}  // namespace tileflight::python
