#include <optional>
#include <sstream>

#include "command.h"
#include "input_options.h"
#include "tileflight/capture/events/dsec_file.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/data/exports/export_dataset.h"
#include "tileflight/data/exports/mcap.h"

namespace tileflight::app {
namespace {

const char* const kMcap = "mcap";  ///< one file; the other layouts are folders
const char* const kDsec = "dsec";  ///< layout of event cameras

std::vector<std::string> layouts() {
  std::vector<std::string> names = exports::export_layouts();
  names.emplace_back(kDsec);
  names.emplace_back(kMcap);
  return names;
}

Output exported_folder(const dataset::Rig& source, const dataset::CameraChoice& camera, const std::string& layout,
                       const std::string& out, bool replace, const Progress& progress) {
  const exports::ExportResult result =
      layout == kDsec ? events::export_dsec(source, out, replace, progress, {camera.calibration})
                      : exports::export_rig(source, layout, out, replace, progress, {camera.calibration});
  std::ostringstream text;
  text << out << ": " << result.frames << " frames\n";
  for (const std::string& note : result.notes) text << "note: " << note << "\n";
  return {{{"frames", result.frames}, {"layout", layout}, {"notes", result.notes}}, text.str()};
}

Output exported_mcap(const dataset::Rig& source, const std::string& out, bool replace, const Progress& progress,
                     std::optional<double> epoch_s) {
  const exports::McapResult result = exports::export_mcap(source, out, replace, progress, epoch_s);
  std::ostringstream text;
  text << out << ": " << result.messages << " messages, " << result.topics.size() << " topics\n";
  for (const std::string& note : result.notes) text << "note: " << note << "\n";
  return {{{"frames", source.cameras.front().dataset.frames.size()},
           {"layout", kMcap},
           {"messages", result.messages},
           {"notes", result.notes},
           {"topics", result.topics}},
          text.str()};
}

}  // namespace

void add_export(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    std::string dataset, layout, out;
    dataset::CameraChoice camera;
    std::optional<double> epoch_s;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("export", "a dataset in another program's layout");
  command->footer("Example:\n  tileflight export dataset --layout euroc --out dataset-euroc");
  command->add_option("DATASET", options->dataset, "dataset folder")->required();
  command->add_option("--layout", options->layout, "layout to write")->required()->check(CLI::IsMember(layouts()));
  command->add_option("--out", options->out, "folder to write (mcap: file)")->required();
  command->add_option("--camera", options->camera.calibration,
                      "one of a rig's cameras, by its name (default: all); or a calibration instead of the "
                      "dataset's: Kalibr, OpenCV, COLMAP, DSO or VSLAM-LAB");
  command->add_option("--camera-id", options->camera.camera_id, "camera to use if the calibration holds several");
  command->add_option("--epoch", options->epoch_s, std::string("mcap: ") + kEpochHelp);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) -> Output {
      const dataset::Rig source = dataset::read_rig(options->dataset, options->camera);
      if (options->epoch_s && options->layout != kMcap) throw InputError("--epoch", "is for the layout mcap only");
      if (options->layout != kMcap)
        return exported_folder(source, options->camera, options->layout, options->out, shared.force, progress);
      base::prepare_output_file(options->out, {options->dataset, options->camera.calibration});
      return exported_mcap(source, options->out, shared.force, progress, options->epoch_s);
    };
  });
}

}  // namespace tileflight::app
