#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "command.h"
#include "input_options.h"
#include "number_text.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/experiments/experiment/stage_options.h"
#include "warnings_text.h"

namespace tileflight::app {
namespace {

using nlohmann::literals::operator""_json_pointer;

struct AlignOptions {
  MapOptions map;
  std::string target;
  std::string out;
  std::string preset = "default";
  std::string start = "auto";
  std::optional<std::string> method;
  std::optional<double> radius_m;
  std::vector<double> up;
  bool fixed_scale = false;
  bool find_regions = false;
  std::string settings;  ///< file; empty: the other options
};

alignment::IcpMethod method_named(const std::string& name) {
  using alignment::IcpMethod;
  if (name == "point-to-plane") return IcpMethod::kPointToPlane;
  if (name == "point-to-mesh") return IcpMethod::kPointToMesh;
  return name == "generalized" ? IcpMethod::kGeneralized : IcpMethod::kPointToPoint;
}

alignment::AlignMapOptions align_options(const AlignOptions& options) {
  using alignment::AlignmentStart;
  if (!options.settings.empty()) return experiment::read_alignment_file(options.settings);
  alignment::AlignMapOptions align;
  if (options.preset == "paper") align = alignment::paper_options();
  if (options.method) {
    align.use_all_evidence = *options.method == "all-evidence";
    if (!align.use_all_evidence) align.icp.method = method_named(*options.method);
  }
  if (options.radius_m) align.icp.radius_m = *options.radius_m;
  align.find_regions = options.find_regions;
  if (options.fixed_scale) align.icp.scale = alignment::ScaleMode::kFixed;
  if (!options.up.empty()) {
    const geometry::Vec3 up(options.up[0], options.up[1], options.up[2]);
    if (!up.allFinite() || !(up.norm() > 0.0)) throw InputError("--up", "must be a direction, not all zeros");
    align.map_up = up.normalized();
  }
  if (options.start == "as-it-is") {
    align.start = AlignmentStart::kAsItIs;
  } else if (options.start == "geometry") {
    align.start = AlignmentStart::kGeometry;
  } else if (options.start == "true-poses") {
    align.start = AlignmentStart::kTruePoses;
  } else if (options.start != "auto") {
    align.start = AlignmentStart::kGiven;
    align.given_start = alignment::read_transform(options.start).T_target_source;
  }
  return align;
}

std::string notes_of(const nlohmann::json& transform) {
  const std::string note = transform.value("note", "");
  const std::string to_surface = transform.value("/to_surface/note"_json_pointer, "");
  return (note.empty() ? "" : "note: " + note + "\n") +
         (to_surface.empty() || to_surface == note ? "" : "note: to the surface: " + to_surface + "\n");
}

}  // namespace

void add_align(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<AlignOptions>();
  CLI::App* command = app.add_subcommand("align", "registration of a map to ground truth");
  command->footer(
      "Example:\n  tileflight align out/odometry --to out/truth --dataset out/dataset --out transform.json");
  add_map_options(*command, options->map);
  command->add_option("--to", options->target, "folder that `extract` wrote, or a cloud")->required();
  command->add_option("--out", options->out, "transform.json to write")->required();
  command
      ->add_option("--preset", options->preset,
                   "'default', or 'paper': exactly the paper's ICP settings, from the map's own coordinates")
      ->check(CLI::IsMember({"default", "paper"}));
  command->add_option(
      "--start", options->start,
      "initial alignment: 'auto' (telemetry; without it the map's own coordinates, then a search by shapes and "
      "images), 'as-it-is' (the map's own coordinates), 'geometry' (search without telemetry), 'true-poses' (the "
      "dataset's ground truth, for simulations only), or a transform.json");
  command
      ->add_option("--method", options->method,
                   "'all-evidence' (default: telemetry, shapes and images together, against the exact surface), or ICP "
                   "from one start: point-to-point, point-to-plane, point-to-mesh, generalized")
      ->check(CLI::IsMember({"all-evidence", "point-to-point", "point-to-plane", "point-to-mesh", "generalized"}));
  command
      ->add_option("--radius", options->radius_m,
                   "maximum correspondence distance in ICP's last stage, metres (default 1)")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--up", options->up, "X,Y,Z: direction opposite to gravity in the map's frame, for --start geometry")
      ->delimiter(',')
      ->expected(3);
  command->add_flag("--fixed-scale", options->fixed_scale, "keep the start's scale (1 with --start geometry)");
  command->add_flag("--find-regions", options->find_regions,
                    "align on some corners of planes only and hold the others out; `evaluate` scores both");
  CLI::Option* settings =
      command->add_option("--settings", options->settings,
                          "experiment or study file whose section `alignment:` is used instead of options");
  settings->check(CLI::ExistingFile);
  for (const char* other : {"--preset", "--start", "--method", "--radius", "--up", "--fixed-scale", "--find-regions"})
    settings->excludes(command->get_option(other));
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions&, const Progress& progress) -> Output {
      std::vector<std::filesystem::path> inputs = files_named(options->map);
      inputs.insert(inputs.end(), {options->target, options->start});
      base::prepare_output_file(options->out, inputs);
      const nlohmann::json t = to_json(
          scoring::align(map_inputs(options->map), options->target, align_options(*options), options->out, progress));
      std::ostringstream text;
      text << options->out << ": " << t["method"].get<std::string>() << ", scale " << rounded(t["scale"], 6)
           << ", RMSE " << rounded(t["rmse"]) << " m over " << percent_text(t["fitness"]) << " of the points, "
           << t["iterations"] << " iterations" << (t["converged"].get<bool>() ? "" : ", NOT CONVERGED") << "\n";
      text << notes_of(t) << warnings_text(t);
      return {t, text.str()};
    };
  });
}

}  // namespace tileflight::app
