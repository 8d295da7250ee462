#include "tileflight/capture/recording/followed_flight.h"

#include "tileflight/capture/flight_path/smooth_path.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::recording {
namespace fs = std::filesystem;

void write_followed_flight(const fs::path& real, const std::optional<flight_path::SmoothingOptions>& smoothing,
                           const fs::path& out) {
  const geometry::Trajectory estimate = geometry::read_tum(real / "odometry/trajectory.txt");
  if (estimate.size() < 2)
    throw InputError((real / "odometry/trajectory.txt").string(),
                     "has fewer than two poses; there is no path to follow");
  const geometry::Trajectory local =
      geometry::transformed(alignment::read_transform(real / "transform.json").T_target_source, estimate);
  const bool is_smoothed = local.size() >= flight_path::kMinPosesToSmooth;
  const base::OutputFolder output{
      .folder = out, .command = "run", .replace = true, .inputs = {real / "odometry", real / "dataset"}};
  base::write_folder(output, [&](const fs::path& folder) {
    geometry::write_tum(folder / "poses.txt", local);
    fs::copy_file(real / "dataset/camera.yaml", folder / "camera.yaml");
    base::write_file(folder / "flight.yaml",
                     "# The other flight's path as estimated by odometry, at the times of its images.\n"
                     "camera: camera.yaml\ntrajectory: poses.txt\nsmooth: " +
                         flight_path::smoothing_text(is_smoothed ? smoothing : std::nullopt) + "\n");
  });
}

}  // namespace tileflight::recording
