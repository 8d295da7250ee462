#include <cmath>

#include "command.h"
#include "tileflight/experiment/track.h"

namespace tileflight::app {
namespace {

struct Options {
  std::string dataset;
  std::string out;
  experiment::FrameRange range;
  std::size_t to = 0;
  bool deterministic = false;
};

std::string summary(const nlohmann::json& result, const std::string& out) {
  std::ostringstream text;
  text << out << ": " << result["frames_tracked"] << " of " << result["frames"] << " frames tracked, "
       << result["keyframes"] << " keyframes, " << result["points"] << " points, "
       << std::round(result["frames_per_second"].get<double>() * 10) / 10 << " frames a second\n";
  if (result["lost"].get<bool>()) text << "lost: " << result["lost_reason"].get<std::string>() << "\n";
  return text.str();
}

}  // namespace

void add_odometry(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("odometry", "Direct Sparse Odometry: images in, trajectory and map out");
  command->footer("Example:\n  tileflight odometry out/stadium/simulated/dataset --out /tmp/odometry");
  command->add_option("DATASET", options->dataset, "dataset folder")->required();
  command->add_option("--out", options->out, "folder to write")->required();
  command->add_option("--from", options->range.from, "first frame, by index");
  CLI::Option* to = command->add_option("--to", options->to, "frame to stop before, by index");
  command->add_option("--every", options->range.every, "each n-th frame")->check(CLI::PositiveNumber);
  command->add_flag("--reverse", options->range.reverse, "play the frames backwards");
  command->add_flag("--deterministic", options->deterministic, "the same result for any number of threads (it always is)");
  add_common_options(*command, common);
  command->callback([options, to, &selection] {
    if (to->count() > 0) options->range.to = options->to;
    selection.run = [options](const CommonOptions& shared, const Progress& progress) -> Output {
      const nlohmann::json result =
          experiment::track(options->dataset, options->out, shared.force, {}, options->range, progress);
      if (result["frames_tracked"].get<std::int64_t>() == 0) {
        throw std::runtime_error(options->dataset + ": " + result["lost_reason"].get<std::string>());
      }
      return {result, summary(result, options->out)};
    };
  });
}

}  // namespace tileflight::app
