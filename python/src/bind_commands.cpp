#include <oneapi/tbb/global_control.h>

#include "arrays.h"
#include "bindings.h"
#include "command.h"
#include "interruptible.h"
#include "usage_fault.h"

namespace tileflight::python {
namespace {

/// The program's commands. A parser keeps the options of its last call, so each call has a new one.
struct Commands {
  Commands() {
    app.name("tileflight");
    app.require_subcommand(1);
    app::add_commands(app, common, selection);
  }
  CLI::App app;
  app::CommonOptions common;
  app::Selection selection;
};

py::dict describe(const CLI::Option& option) {
  py::dict out;
  const auto names = option.get_lnames();
  out["name"] = option.get_positional() ? option.get_name(true) : names.empty() ? std::string() : names.front();
  out["positional"] = option.get_positional();
  out["required"] = option.get_required();
  out["is_flag"] = option.get_items_expected_max() == 0;
  out["least"] = option.get_items_expected_min();
  out["most"] = option.get_items_expected_max();
  out["repeated"] = option.get_items_expected_max() > 1 && option.get_delimiter() == '\0';
  out["delimiter"] = option.get_delimiter() == '\0' ? std::string() : std::string(1, option.get_delimiter());
  out["type"] = option.get_type_name();
  out["description"] = option.get_description();
  return out;
}

py::dict describe(const CLI::App& command, const std::string& name) {
  py::list options;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_lnames() != std::vector<std::string>{"help"}) options.append(describe(*option));
  }
  py::dict out;
  out["name"] = name;
  out["description"] = command.get_description();
  out["options"] = options;
  return out;
}

/// Lists name, help and options of all commands; of a command with parts, those of each part ("scene stadium").
py::list list_commands() {
  Commands commands;
  py::list list;
  for (const CLI::App* command : commands.app.get_subcommands({})) {
    const auto parts = command->get_subcommands({});
    if (parts.empty()) list.append(describe(*command, command->get_name()));
    for (const CLI::App* part : parts) list.append(describe(*part, command->get_name() + " " + part->get_name()));
  }
  return list;
}

py::object run_command(const std::vector<std::string>& arguments, const py::object& progress) {
  Commands commands;
  commands.common.arguments = arguments;
  try {
    commands.app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError& fault) {
    throw py::value_error(app::usage_fault(commands.app, arguments, fault.what()));
  }
  const nlohmann::json result = call_interruptibly(progress, [&](const Progress& report) {
    std::optional<tbb::global_control> limit;
    if (commands.common.threads > 0)
      limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(commands.common.threads));
    return commands.selection.run(commands.common, report).json;
  });
  return to_python(result);
}

}  // namespace

void bind_commands(py::module_& module) {
  module.def("_commands", &list_commands);
  module.def("_run_command", &run_command, py::arg("arguments"), py::arg("progress") = py::none());
}

}  // namespace tileflight::python
