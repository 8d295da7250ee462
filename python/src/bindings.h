#pragma once

#include <pybind11/pybind11.h>

#include <nlohmann/json_fwd.hpp>

namespace tileflight::python {

/// JSON as dictionaries, lists, numbers and None, and back. `name`: of the argument, for ValueErrors.
pybind11::object to_python(const nlohmann::json& json);
nlohmann::json to_json(const pybind11::handle& object, const char* name);

// One function per group of the module's classes and functions, each in the file of its name.
void bind_camera(pybind11::module_& module);
void bind_commands(pybind11::module_& module);
void bind_odometry(pybind11::module_& module);
void bind_render(pybind11::module_& module);
void bind_scene(pybind11::module_& module);
void bind_scoring(pybind11::module_& module);
void bind_sensors(pybind11::module_& module);
void bind_simulator(pybind11::module_& module);

}  // namespace tileflight::python
