// The extension module tileflight._core; the package's Python files stand in python/tileflight.
#include <oneapi/tbb/global_control.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "bindings.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/program.h"

namespace tileflight::python {

// One function per group of the module's classes and functions, each in the file of its name.
using Bind = void(pybind11::module_& module);
Bind bind_camera, bind_commands, bind_localizer, bind_odometry, bind_render, bind_scene, bind_scoring, bind_sensors,
    bind_simulator;

namespace {

namespace py = pybind11;

void set_threads(int count) {
  static std::unique_ptr<tbb::global_control> limit;
  if (count < 0) throw py::value_error("the number of threads must not be negative");
  limit.reset();
  if (count > 0)
    limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                  static_cast<std::size_t>(count));
}

}  // namespace

py::object to_python(const nlohmann::json& json) {
  return py::module_::import("json").attr("loads")(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

nlohmann::json to_json(const py::handle& object, const char* name) {
  // numpy's numbers and arrays become Python's.
  const py::cpp_function plain([name](const py::object& value) -> py::object {
    if (py::hasattr(value, "tolist")) return value.attr("tolist")();
    throw py::type_error(std::string(name) + " has a value that is no number, text, list or dictionary: " +
                         py::repr(value).cast<std::string>());
  });
  try {
    const py::object text = py::module_::import("json").attr("dumps")(object, py::arg("default") = plain);
    return nlohmann::json::parse(text.cast<std::string>());
  } catch (const nlohmann::json::exception&) {
    throw py::value_error(std::string(name) + " has numbers that are not finite");
  }
}

}  // namespace tileflight::python

PYBIND11_MODULE(_core, module) {
  namespace tp = tileflight::python;
  module.doc() = "tileflight's library; use it through the package tileflight";
  pybind11::register_exception<tileflight::InputError>(module, "InputError", PyExc_ValueError);
  module.attr("InputError").attr("__module__") = "tileflight";
  module.attr("InputError").attr("__doc__") =
      "Input that cannot be used (file, option, answer of a server). One line: where, what, what to do.";
  module.attr("__version__") = tileflight::base::version();
  module.attr("commit") = tileflight::base::commit();
  module.def("set_threads", &tp::set_threads, pybind11::arg("count"),
             "Number of threads that all computations share; 0: one for each core. Results do not depend on it.");
  module.def(
      "_set_program", [](const std::string& program) { tileflight::base::set_program_path(program); },
      pybind11::arg("program"));
  tp::bind_camera(module);
  tp::bind_scene(module);
  tp::bind_render(module);
  tp::bind_sensors(module);
  tp::bind_odometry(module);
  tp::bind_localizer(module);
  tp::bind_scoring(module);
#ifdef TILEFLIGHT_LIVE
  tp::bind_simulator(module);
#endif
  tp::bind_commands(module);
}
