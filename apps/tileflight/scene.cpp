#include "command.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/tiles/demo_place/stadium.h"

namespace tileflight::app {

void add_scene(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    std::string out;
    std::uint64_t seed = 1;
  };
  auto options = std::make_shared<Options>();
  CLI::App* scene = app.add_subcommand("scene", "write a built-in place as 3D Tiles");
  scene->require_subcommand(1);
  CLI::App* stadium =
      scene->add_subcommand("stadium", "the stadium at the paper's coordinates: OUT/twin and OUT/world");
  stadium->footer("Example:\n  tileflight scene stadium out/stadium-tiles");
  stadium->add_option("OUT", options->out, "folder to write")->required();
  stadium->add_option("--seed", options->seed, "random seed (default 1)");
  add_common_options(*stadium, common);
  stadium->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) -> Output {
      const base::OutputFolder output{
          .folder = options->out, .command = "scene", .replace = shared.force, .inputs = {}};
      base::write_folder(output, [&](const std::filesystem::path& temporary) {
        demo_place::write_stadium(temporary, {.seed = options->seed}, progress);
      });
      const std::filesystem::path out = options->out;
      return {{{"twin", (out / "twin/tileset.json").string()}, {"world", (out / "world/tileset.json").string()}},
              "stadium: " + (out / "twin/tileset.json").string() + ", " + (out / "world/tileset.json").string() + "\n"};
    };
  });
}

}  // namespace tileflight::app
