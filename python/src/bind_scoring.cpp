#include <nlohmann/json.hpp>

#include "arrays.h"
#include "bindings.h"
#include "tileflight/core/alignment/icp.h"
#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::python {
namespace {

alignment::ScaleMode scale_mode(bool with_scale) {
  return with_scale ? alignment::ScaleMode::kEstimated : alignment::ScaleMode::kFixed;
}

py::dict umeyama(const InputArray<double>& source, const InputArray<double>& target, bool with_scale) {
  const auto result = alignment::umeyama(points_from_array(source, "source"), points_from_array(target, "target"),
                                         scale_mode(with_scale));
  py::dict out;
  out["T_target_source"] = result.T_target_source.matrix();
  out["scale"] = result.T_target_source.scale;
  out["rmse"] = result.rmse_m;
  out["well_conditioned"] = result.well_conditioned;
  return out;
}

alignment::IcpMethod method_named(const std::string& name) {
  using alignment::IcpMethod;
  if (name == "point-to-point") return IcpMethod::kPointToPoint;
  if (name == "point-to-plane") return IcpMethod::kPointToPlane;
  if (name == "point-to-mesh") return IcpMethod::kPointToMesh;
  if (name == "generalized") return IcpMethod::kGeneralized;
  throw py::value_error("unknown method '" + name +
                        "'; known: point-to-point, point-to-plane, point-to-mesh, generalized");
}

geometry::PointCloud cloud_from(const InputArray<double>& points, const char* name) {
  geometry::PointCloud cloud;
  cloud.positions = points_from_array(points, name);
  return cloud;
}

/// Registers points to points (N, 3), or to the surface of a Scene.
py::dict icp(const InputArray<double>& source, const py::object& target, const std::optional<InputArray<double>>& start,
             const std::string& method, double radius, bool with_scale) {
  alignment::IcpOptions options = alignment::converging_icp_options();
  options.method = method_named(method);
  options.radius_m = radius;
  options.scale = scale_mode(with_scale);
  const geometry::PointCloud cloud = cloud_from(source, "source");
  const geometry::Sim3 initial = start ? similarity_from(*start, "start") : geometry::Sim3();
  const bool is_scene = py::isinstance<LoadedScene>(target);
  const bool wants_scene = options.method == alignment::IcpMethod::kPointToMesh;
  if (is_scene != wants_scene)
    throw py::value_error(wants_scene ? "point-to-mesh needs a Scene as target" : "the target must be points (N, 3)");
  alignment::IcpResult result;
  if (is_scene) {
    const auto& scene = target.cast<const LoadedScene&>();
    const py::gil_scoped_release unlocked;
    const geometry::TriangleMesh mesh = scene::merge_meshes(scene.scene.meshes());
    result = alignment::icp(cloud, geometry::TriangleIndex(mesh), mesh, initial, options);
  } else {
    const geometry::PointCloud points = cloud_from(InputArray<double>::ensure(target), "target");
    const py::gil_scoped_release unlocked;
    result = alignment::icp(cloud, points, initial, options);
  }
  py::dict out;
  out["T_target_source"] = result.T_target_source.matrix();
  out["scale"] = result.T_target_source.scale;
  out["rmse"] = result.rmse_m;
  out["fitness"] = result.fitness;
  out["iterations"] = result.iterations;
  out["converged"] = result.converged;
  out["well_constrained"] = result.constraint.well_constrained;
  out["note"] = result.note;
  return out;
}

metrics::TrajectoryAlignment alignment_named(const std::string& name) {
  for (const auto alignment :
       {metrics::TrajectoryAlignment::kSim3, metrics::TrajectoryAlignment::kSE3, metrics::TrajectoryAlignment::kNone}) {
    if (name == metrics::name_of(alignment)) return alignment;
  }
  throw py::value_error("alignment must be 'sim3', 'se3' or 'none', not '" + name + "'");
}

py::object evaluate_trajectory(const InputArray<double>& times, const InputArray<double>& poses,
                               const InputArray<double>& true_times, const InputArray<double>& true_poses,
                               const std::string& alignment) {
  metrics::TrajectoryOptions options;
  options.alignment = alignment_named(alignment);
  return to_python(metrics::to_json(
      metrics::evaluate_trajectory(trajectory_from(times, poses), trajectory_from(true_times, true_poses), options)));
}

}  // namespace

void bind_scoring(py::module_& module) {
  using py::arg;
  module.def("umeyama", &umeyama, arg("source"), arg("target"), arg("with_scale") = true,
             "The similarity that carries points (N, 3) onto others by least squares (Umeyama, TPAMI 1991). A "
             "dictionary: T_target_source (4, 4), scale, rmse, well_conditioned.");
  module.def("icp", &icp, arg("source"), arg("target"), py::kw_only(), arg("start") = py::none(),
             arg("method") = "point-to-point", arg("radius") = 1.0, arg("with_scale") = true,
             "Iterative closest point from a start (4, 4). target: points (N, 3), or a Scene for 'point-to-mesh'. "
             "radius: of correspondences, metres. A dictionary: T_target_source (4, 4), scale, rmse, fitness, "
             "iterations, converged, well_constrained, note. `tileflight.align` registers a map by all evidence of its "
             "flight.");
  module.def("evaluate_trajectory", &evaluate_trajectory, arg("times"), arg("poses"), arg("true_times"),
             arg("true_poses"), py::kw_only(), arg("alignment") = "sim3",
             "ATE, RPE and drift of camera poses (N, 4, 4) against true ones, after alignment by 'sim3', 'se3' or "
             "'none': the keys of `trajectory` in metrics.json.");
}

}  // namespace tileflight::python
