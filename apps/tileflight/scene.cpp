#include "command.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/tiles/demo_place/synthetic_place.h"

namespace tileflight::app {
namespace {

struct SceneOptions {
  std::string out;
  std::uint64_t seed = 1;
};

void add_place(CLI::App& scene, const demo_place::PlaceName& place, CommonOptions& common, Selection& selection) {
  const std::string name(place.name);
  auto options = std::make_shared<SceneOptions>();
  CLI::App* command = scene.add_subcommand(name, std::string(place.about) + ": OUT/twin and OUT/world");
  command->footer("Example:\n  tileflight scene " + name + " out/" + name + "-tiles");
  command->add_option("OUT", options->out, "folder to write")->required();
  command->add_option("--seed", options->seed, "random seed (default 1)");
  add_common_options(*command, common);
  command->callback([options, name, kind = place.kind, &selection] {
    selection.run = [options, name, kind](const CommonOptions& shared, const Progress& progress) -> Output {
      const base::OutputFolder output{
          .folder = options->out, .command = "scene", .replace = shared.force, .inputs = {}};
      base::write_folder(output, [&](const std::filesystem::path& temporary) {
        demo_place::write_place(temporary, kind, {.seed = options->seed}, progress);
      });
      const std::filesystem::path out = options->out;
      return {{{"twin", (out / "twin/tileset.json").string()}, {"world", (out / "world/tileset.json").string()}},
              name + ": " + (out / "twin/tileset.json").string() + ", " + (out / "world/tileset.json").string() + "\n"};
    };
  });
}

}  // namespace

void add_scene(CLI::App& app, CommonOptions& common, Selection& selection) {
  CLI::App* scene = app.add_subcommand("scene", "write a built-in place as 3D Tiles");
  scene->require_subcommand(1);
  for (const demo_place::PlaceName& place : demo_place::place_names()) add_place(*scene, place, common, selection);
}

}  // namespace tileflight::app
