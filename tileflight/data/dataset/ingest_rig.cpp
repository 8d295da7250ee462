#include "tileflight/data/dataset/ingest_rig.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/dataset/dataset_metadata.h"
#include "tileflight/data/dataset/rig.h"

namespace tileflight::dataset {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> names_of(const RigIngestOptions& options) {
  std::vector<std::string> names;
  for (const IngestedCamera& camera : options.cameras) names.push_back(camera.name);
  return names;
}

/// Where a camera's files are in the dataset.
fs::path folder_of(const RigIngestOptions& options, std::size_t camera) {
  return camera == 0 ? fs::path(".") : fs::path("cameras") / options.cameras[camera].name;
}

/// `times_s`: increasing, not empty.
double distance_to_nearest(const std::vector<double>& times_s, double time_s) {
  const auto after = std::ranges::lower_bound(times_s, time_s);
  const double later_s = after == times_s.end() ? INFINITY : *after - time_s;
  return after == times_s.begin() ? later_s : std::min(later_s, time_s - *(after - 1));
}

std::vector<double> on_body_clock(std::vector<double> times_s, double timeshift_s) {
  for (double& time_s : times_s) time_s += timeshift_s;
  return times_s;
}

/// What `ingest` is asked for one camera.
IngestOptions options_of(const RigIngestOptions& rig, std::size_t number, const fs::path& built) {
  const IngestedCamera& first = rig.cameras.front();
  const IngestedCamera& camera = rig.cameras[number];
  IngestOptions options = rig.common;
  options.video_or_images = camera.video_or_images;
  options.image_times = camera.image_times;
  options.camera_id = camera.name;
  options.lens = camera.calibration;
  options.timeshift_s = camera.timeshift_s;
  options.part_folder = (built / folder_of(rig, number)).lexically_normal();
  options.description["camera"] = camera.name;
  options.description["cameras"] = base::joined(names_of(rig));
  if (number == 0) return options;
  options.T_truth_camera = first.T_body_camera.inverse() * camera.T_body_camera;
  options.groundtruth_offset_s = first.timeshift_s - camera.timeshift_s;
  options.gps.clear();
  options.attitudes.clear();
  options.ranges.clear();
  options.imu.clear();
  options.excerpt.every = 1;
  return options;
}

std::vector<IngestResult> ingest_cameras(const RigIngestOptions& rig, const fs::path& built, const Progress& progress) {
  std::vector<IngestResult> results;
  std::vector<double> wanted_s;  // on the body's clock
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    IngestOptions options = options_of(rig, i, built);
    if (i > 0 && rig.common.excerpt.every > 1)
      options.is_wanted = [&wanted_s, shift_s = options.timeshift_s](double time_s, double period_s) {
        return distance_to_nearest(wanted_s, time_s + shift_s) < 0.5 * period_s;
      };
    results.push_back(ingest(options, built, progress));
    if (i == 0) wanted_s = on_body_clock(results.front().times_s, options.timeshift_s);
  }
  return results;
}

Synchronisation synchronisation_of(const RigIngestOptions& rig, const std::vector<IngestResult>& results) {
  std::vector<CameraTimes> times;
  for (std::size_t i = 0; i < results.size(); ++i)
    times.push_back({rig.cameras[i].name, on_body_clock(results[i].times_s, rig.cameras[i].timeshift_s)});
  return check_synchronisation(times, rig.sync_tolerance_s);
}

void write_chain(const RigIngestOptions& rig, const std::vector<IngestResult>& results, const fs::path& folder) {
  std::vector<imaging::ChainCamera> chain;
  for (std::size_t i = 0; i < results.size(); ++i) {
    const IngestedCamera& camera = rig.cameras[i];
    chain.push_back({camera.name, folder_of(rig, i), results[i].calibration, camera.T_body_camera, camera.timeshift_s});
  }
  imaging::write_camchain(folder / "camchain.yaml", chain);
}

/// Adds to the dataset.yaml of the rig what is known of its cameras' times.
void describe(const Synchronisation& found, const fs::path& folder) {
  std::map<std::string, std::string> about = read_metadata(folder / "dataset.yaml");
  about["synchronisation.tolerance_s"] = base::fixed_text(found.tolerance_s);
  for (const CameraSynchronisation& camera : found.cameras) {
    const std::string key = "synchronisation." + camera.name + ".";
    about[key + "matched"] = std::to_string(camera.matched) + " of " + std::to_string(camera.pairs);
    about[key + "largest_skew_s"] = base::rounded_text(camera.largest_skew_s, 9);
    about[key + "missing"] = std::to_string(camera.missing);
  }
  if (!found.faults.empty()) about["synchronisation.faults"] = base::joined(found.faults, "; ");
  base::write_file(folder / "dataset.yaml", format_metadata(about));
}

base::OutputFolder output_of(const RigIngestOptions& rig, const fs::path& folder) {
  base::OutputFolder output{
      .folder = folder, .command = "ingest", .replace = rig.common.replace, .inputs = rig.common.inputs};
  for (const IngestedCamera& camera : rig.cameras) output.inputs.push_back(camera.video_or_images);
  for (const fs::path& input : {rig.common.calibration, rig.common.imu, rig.common.imu_noise, rig.common.groundtruth})
    output.inputs.push_back(input);
  return output;
}

}  // namespace

RigIngestResult ingest_rig(const RigIngestOptions& options, const fs::path& dataset_folder, const Progress& progress) {
  if (const auto fault = fault_of_camera_names(names_of(options)))
    throw InputError(options.common.calibration.string(), *fault);
  RigIngestResult result;
  base::write_folder(output_of(options, dataset_folder), [&](const fs::path& built) {
    result.cameras = ingest_cameras(options, built, progress);
    result.synchronisation = synchronisation_of(options, result.cameras);
    write_chain(options, result.cameras, built);
    describe(result.synchronisation, built);
  });
  return result;
}

}  // namespace tileflight::dataset
