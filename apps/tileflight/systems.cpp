#include <nlohmann/json.hpp>
#include <sstream>

#include "command.h"
#include "tileflight/slam/external_systems/adapter.h"
#include "tileflight/slam/external_systems/handed_dataset.h"

namespace tileflight::app {
namespace {

using external_systems::Adapter;
using nlohmann::json;

json describe_adapter(const Adapter& adapter, const std::optional<dataset::Dataset>& dataset) {
  json inputs = json::array();
  for (const external_systems::Input input : adapter.inputs) inputs.push_back(external_systems::to_text(input));
  const std::string missing = external_systems::why_not_installed(adapter);
  json about{{"name", adapter.name},
             {"title", adapter.title},
             {"homepage", adapter.homepage},
             {"licence", adapter.licence},
             {"tried", adapter.tried},
             {"folder", adapter.folder.string()},
             {"inputs", inputs},
             {"lenses", adapter.lenses},
             {"layout", adapter.layout},
             {"map", !adapter.map.empty()},
             {"scale", adapter.metric_scale ? "metric" : "unknown"},
             {"gpu", adapter.needs_gpu},
             {"installed", missing.empty()},
             {"missing", missing},
             {"version", external_systems::installed_version(adapter)}};
  if (dataset) {
    const std::string reason = external_systems::why_not_applicable(adapter, *dataset);
    about["applicable"] = reason.empty();
    about["reason"] = reason;
  }
  return about;
}

std::string adapter_text(const json& about) {
  std::ostringstream text;
  const auto word = [&](const char* key) { return about[key].get<std::string>(); };
  text << word("name") << ": " << word("title");
  if (!word("version").empty()) text << ", " << word("version");
  text << "\n  takes " << base::joined(about["inputs"]) << "; lenses " << base::joined(about["lenses"]) << "; leaves "
       << (about["map"] == true ? "path and map" : "a path, no map") << ", "
       << (word("scale") == "metric" ? "in metres" : "of unknown scale") << "\n  ";
  text << (about["installed"] == true ? "installed" : "not installed: " + word("missing"));
  text << (word("tried").empty() ? "; never run here" : "; tried with " + word("tried")) << "\n";
  if (about.contains("applicable"))
    text << "  "
         << (about["applicable"] == true ? "can run on this dataset"
                                         : "cannot run on this dataset: it " + word("reason"))
         << "\n";
  if (!word("homepage").empty()) text << "  " << word("homepage") << " (" << word("licence") << ")\n";
  return text.str();
}

}  // namespace

void add_systems(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto folder = std::make_shared<std::string>();
  CLI::App* command =
      app.add_subcommand("systems", "SLAM systems that `odometry --system`, experiments and `study` can run");
  command->footer(
      "Example:\n  tileflight systems --dataset out/stadium/simulated/dataset\n"
      "Adapters are read from the folders in TILEFLIGHT_ADAPTERS, ./adapters, and the program's own "
      "(docs/systems.md).");
  command->add_option("--dataset", *folder, "say which of them can run on this dataset, and why not");
  add_common_options(*command, common);
  command->callback([folder, &selection] {
    selection.run = [folder](const CommonOptions&, const Progress&) -> Output {
      std::optional<dataset::Dataset> dataset;
      if (!folder->empty()) dataset = dataset::read_dataset(*folder);
      json list = json::array();
      std::string text;
      for (const Adapter& adapter : external_systems::list_adapters()) {
        list.push_back(describe_adapter(adapter, dataset));
        text += adapter_text(list.back());
      }
      return {{{"systems", list}}, text};
    };
  });
}

}  // namespace tileflight::app
