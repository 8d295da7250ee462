// Odometry by another program: its command, and the folder that it must have filled.
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/jobs/process.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/slam/odometry/track.h"

namespace tileflight::odometry {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

std::string shell_path(const fs::path& path) { return base::shell_word(fs::absolute(path).string()); }

std::string replace_placeholder(std::string command, const std::string& name, const std::string& value) {
  for (std::size_t at = command.find(name); at != std::string::npos; at = command.find(name, at + value.size())) {
    command.replace(at, name.size(), value);
  }
  return command;
}

void run_command(const std::string& command, const fs::path& folder, const fs::path& log) {
  const int status = jobs::run_guarded({jobs::shell(command), folder, log});
  if (status != 0) throw InputError("odometry.command", jobs::describe_exit(status) + ": " + jobs::last_line(log));
}

json describe_command_result(const fs::path& out, std::size_t frames) {
  const geometry::Trajectory trajectory = geometry::read_tum(out / "trajectory.txt");
  const geometry::PointCloud map = geometry::read_cloud(out / "map.ply");
  return {
      {"frames", frames},           {"frames_tracked", trajectory.size()},
      {"lost", trajectory.empty()}, {"lost_reason", trajectory.empty() ? "the external program tracked no frame" : ""},
      {"keyframes", nullptr},       {"points", map.size()},
      {"seconds", nullptr},         {"frames_per_second", nullptr}};
}

}  // namespace

base::OutputFolder odometry_output_folder(const fs::path& out, bool replace, std::vector<fs::path> inputs) {
  return {.folder = out, .command = "odometry", .replace = replace, .inputs = std::move(inputs)};
}

nlohmann::json track_with_command(const fs::path& dataset_folder, const fs::path& out, bool replace,
                                  const std::string& command, const fs::path& folder) {
  const dataset::Dataset data = dataset::read_dataset(dataset_folder);
  json about;
  base::write_folder(odometry_output_folder(out, replace, {dataset_folder}), [&](const fs::path& temporary) {
    run_command(replace_placeholder(replace_placeholder(command, "{dataset}", shell_path(dataset_folder)), "{out}",
                                    shell_path(temporary)),
                folder, temporary / "command.log");
    for (const char* name : {"trajectory.txt", "map.ply"}) {
      if (!fs::exists(temporary / name))
        throw InputError("odometry.command", std::string("did not write ") + name + " to {out}");
    }
    about = describe_command_result(temporary, data.frames.size());
    if (!fs::exists(temporary / "odometry.json")) base::write_file(temporary / "odometry.json", about.dump(2) + "\n");
  });
  return about;
}

}  // namespace tileflight::odometry
