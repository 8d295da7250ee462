#include <nlohmann/json.hpp>
#include <sstream>

#include "command.h"
#include "input_options.h"
#include "project_options.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/experiments/project/project.h"

namespace tileflight::app {

void add_project_options(CLI::App& command, ProjectArguments& arguments) {
  command.add_option("--place", arguments.place,
                     std::string("the place: ") + kSourceHelp + "; without it only the path is found");
  command
      .add_option("--origin", arguments.origin,
                  "latitude, longitude and height of the origin of a tileset that is not georeferenced")
      ->delimiter(',')
      ->expected(3);
  command.add_option("--camera", arguments.camera, "calibration or lens profile; default: what can be found");
  command.add_option("--profiles", arguments.profiles, "folder of Gyroflow's lens profiles to search");
  command.add_option("--fov", arguments.fov_deg, "horizontal field of view, degrees, where nothing states the lens")
      ->check(CLI::Range(5.0, 240.0));
  command.add_option("--telemetry", arguments.telemetry,
                     "flight log; default: what the recording holds, or a log beside it");
  command.add_option("--imu", arguments.imu, "readings of an inertial unit; default: likewise");
  command
      .add_option("--from", arguments.from_s,
                  "start of the part to use, seconds of the recording; default: after the take-off")
      ->check(CLI::NonNegativeNumber);
  command.add_option("--to", arguments.to_s, "end of the part to use, seconds; default: before the landing")
      ->check(CLI::PositiveNumber);
  command.add_option("--system", arguments.system,
                     "another SLAM system instead of the built-in odometry: a name of `tileflight systems`, or the "
                     "folder of an adapter");
}

project::ProjectOptions project_options(const ProjectArguments& arguments, std::vector<std::filesystem::path> videos,
                                        const SourceArguments& source) {
  project::ProjectOptions options{
      .files = {std::move(videos), arguments.telemetry, arguments.imu, arguments.from_s, arguments.to_s},
      .place = arguments.place,
      .origin = std::nullopt,
      .lens = {arguments.camera, arguments.profiles, arguments.fov_deg},
      .system = arguments.system,
      .source_options = source_options(source)};
  if (arguments.origin.size() == 3)
    options.origin = geometry::Geodetic{arguments.origin[0], arguments.origin[1], {arguments.origin[2]}};
  return options;
}

std::string project_text(const project::Project& made) {
  std::ostringstream text;
  text << made.experiment.string() << ": " << made.choices.size() << " choices\n";
  for (const project::Choice& choice : made.choices)
    text << "  " << choice.key << (choice.value.empty() ? "" : " " + choice.value) << "\n    " << choice.reason << " ("
         << to_string(choice.certainty) << ")\n";
  for (const std::string& warning : made.warnings) text << "note: " << warning << "\n";
  return text.str();
}

void add_new(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    std::string folder;
    std::vector<std::filesystem::path> videos;
    ProjectArguments project;
    SourceArguments source;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("new", "a project for a filmed flight, made from what the recording says");
  command->footer(
      "Example:\n  tileflight new flight --video DJI_0042.MP4 --place tiles\n"
      "  tileflight run flight/experiment.yaml --out results");
  command->add_option("PROJECT", options->folder, "project folder to write")->required();
  command->add_option("--video", options->videos, "the recording: a video, its parts, or a folder of photos")
      ->required();
  add_project_options(*command, options->project);
  add_source_options(*command, options->source);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) -> Output {
      const project::Project made = project::make_project(
          project_options(options->project, options->videos, options->source), options->folder, shared.force, progress);
      return {to_json(made), project_text(made) + "\nnext: tileflight run " + made.experiment.string() + " --out " +
                                 (std::filesystem::path(options->folder) / "results").string() + "\n"};
    };
  });
}

}  // namespace tileflight::app
