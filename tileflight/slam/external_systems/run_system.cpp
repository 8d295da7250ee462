#include "tileflight/slam/external_systems/run_system.h"

#include <algorithm>
#include <map>
#include <new>
#include <nlohmann/json.hpp>
#include <thread>
#include <variant>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/data/exports/layout_writers.h"
#include "tileflight/slam/external_systems/handed_dataset.h"
#include "tileflight/slam/external_systems/lens_support.h"
#include "tileflight/slam/external_systems/system_output.h"

namespace tileflight::external_systems {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// Distortion in the order of core/imaging/camera.h, with commas; empty for a plain pinhole and a panorama.
template <class Lens>
std::string distortion_text(const Lens& lens) {
  std::vector<double> numbers;
  if constexpr (requires { lens.d; }) numbers.assign(lens.d.begin(), lens.d.end());
  if constexpr (requires { lens.k; }) numbers.assign(lens.k.begin(), lens.k.end());
  if constexpr (requires { lens.xi; }) numbers.insert(numbers.begin(), lens.xi);
  if constexpr (requires { lens.w; }) numbers.push_back(lens.w);
  if constexpr (requires { lens.alpha; }) numbers.push_back(lens.alpha);
  if constexpr (requires { lens.beta; }) numbers.push_back(lens.beta);
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : ",") + base::fixed_text(number);
  return text;
}

/// What an adapter's script is told (docs/systems.md).
std::map<std::string, std::string> make_environment(const Adapter& adapter, const dataset::Dataset& dataset,
                                                    const HandedDataset& handed, const fs::path& output,
                                                    const SystemRunOptions& options, int threads) {
  std::map<std::string, std::string> environment{
      {"ADAPTER", adapter.folder},
      {"DATASET", fs::absolute(handed.folder).lexically_normal()},
      {"OUT", output},
      {"SEED", std::to_string(options.seed)},
      {"THREADS", std::to_string(threads)},
      {"OMP_NUM_THREADS", std::to_string(threads)},
      {"FRAMES", std::to_string(dataset.frames.size())},
      {"FPS", base::fixed_text(exports::frame_rate_hz(dataset))},
      {"WIDTH", std::to_string(handed.calibration.camera.width())},
      {"HEIGHT", std::to_string(handed.calibration.camera.height())},
      {"LENS", lens_name(handed.calibration.camera)},
      {"TILEFLIGHT", options.program.empty() ? base::program_path() : options.program}};
  std::visit(
      [&](const auto& lens) {
        environment["DISTORTION"] = distortion_text(lens);
        environment["FX"] = base::fixed_text(lens.fx);
        environment["FY"] = base::fixed_text(lens.fy);
        environment["CX"] = base::fixed_text(lens.cx);
        environment["CY"] = base::fixed_text(lens.cy);
      },
      handed.calibration.camera.model());
  return environment;
}

/// Path and map that a system left, checked and written in this program's formats.
void take_over_results(const Adapter& adapter, const dataset::Dataset& dataset, const HandedDataset& handed,
                       const fs::path& output, const fs::path& folder, json& about) {
  const geometry::Trajectory path = read_estimated_path(adapter, output, dataset, handed);
  about["frames_tracked"] = count_tracked_frames(path, dataset);
  if (path.empty()) throw InputError(adapter.title, "tracked no frame");
  geometry::write_tum(folder / "trajectory.txt", path);
  about["lost"] = false;
  about["lost_reason"] = "";
  if (adapter.map.empty()) return;
  require_result_file(adapter, output, adapter.map);
  const geometry::PointCloud map = geometry::read_cloud(output / adapter.map);
  about["points"] = map.size();
  geometry::write_cloud(folder / "map.ply", map);
}

/// Prepares, runs and reads one system; fills `about`, the content of odometry.json.
class SystemRun {
 public:
  SystemRun(const Adapter& adapter, const dataset::Dataset& dataset, const SystemRunOptions& options)
      : adapter_(adapter), dataset_(dataset), options_(options) {}

  json run(const fs::path& folder, const Progress& progress) {
    about_ = {{"frames", dataset_.frames.size()},
              {"frames_tracked", 0},
              {"lost", true},
              {"lost_reason", ""},
              {"keyframes", nullptr},
              {"points", 0},
              {"seconds", nullptr},
              {"frames_per_second", nullptr}};
    json& system = about_["system"];
    const int threads =
        options_.threads > 0 ? options_.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    system = {{"name", adapter_.name},
              {"title", adapter_.title},
              {"version", installed_version(adapter_)},
              {"applicable", false},
              {"completed", false},
              {"seed", options_.seed},
              {"threads", threads},
              {"limits", {{"seconds", options_.limits.seconds}, {"memory_mb", options_.limits.memory_mb}}},
              {"lens", lens_name(dataset_.calibration.camera)},
              {"layout", adapter_.layout},
              {"scale", adapter_.metric_scale ? "metric" : "unknown"}};
    std::string reason = why_not_applicable(adapter_, dataset_);
    system["applicable"] = reason.empty();
    if (reason.empty()) reason = why_not_installed(adapter_);
    if (reason.empty()) {
      try {
        reason = execute(folder, threads, progress);
      } catch (const InputError& fault) {
        system["applicable"] = false;
        reason = std::string("its input cannot be prepared: ") + fault.what();
        fs::remove_all(folder / "scratch");
      }
    }
    system["completed"] = reason.empty();
    system["reason"] = reason;
    if (!reason.empty()) about_["lost_reason"] = reason;
    return about_;
  }

 private:
  /// Returns why it failed; empty if it did not.
  std::string execute(const fs::path& folder, int threads, const Progress& progress) {
    const fs::path scratch = folder / "scratch";
    const fs::path output = fs::absolute(scratch / "out");
    fs::create_directories(output);
    const HandedDataset handed = hand_over(adapter_, dataset_, scratch, progress);
    imaging::write_kalibr(folder / "camera.yaml", handed.calibration);
    report_progress(progress, 0, 0, adapter_.title + " is running");
    const jobs::ProcessReport report =
        jobs::run_measured({.words = jobs::shell(adapter_.command),
                            .folder = adapter_.folder,
                            .log = folder / "system.log",
                            .environment = make_environment(adapter_, dataset_, handed, output, options_, threads)},
                           options_.limits);
    describe(handed, report);
    std::string reason = report.succeeded() ? "" : report.outcome();
    if (report.exit_status != 0 && !report.was_stopped()) reason += ": " + jobs::last_line(folder / "system.log");
    if (report.succeeded()) {
      try {
        take_over_results(adapter_, dataset_, handed, output, folder, about_);
      } catch (const InputError& fault) {
        reason = fault.what();
      } catch (const std::bad_alloc&) {
        reason = "its map does not fit into this machine's memory";
      }
    }
    fs::remove_all(scratch);
    return reason;
  }

  void describe(const HandedDataset& handed, const jobs::ProcessReport& report) {
    json& system = about_["system"];
    system["handed_lens"] = lens_name(handed.calibration.camera);
    system["visible_share"] = handed.visible_share;
    system["notes"] = handed.notes;
    system["exit_status"] = report.exit_status;
    system["seconds"] = report.seconds;
    system["cpu_seconds"] = report.cpu_seconds;
    system["peak_memory_mb"] = report.peak_memory_mb;
    about_["seconds"] = report.seconds;
    if (report.seconds > 0.0)
      about_["frames_per_second"] = static_cast<double>(dataset_.frames.size()) / report.seconds;
  }

  const Adapter& adapter_;
  const dataset::Dataset& dataset_;
  const SystemRunOptions& options_;
  json about_;
};

}  // namespace

json run_system(const Adapter& adapter, const fs::path& dataset_folder, const fs::path& out,
                const SystemRunOptions& options, const Progress& progress) {
  const dataset::Dataset dataset = dataset::read_dataset(dataset_folder);
  const base::OutputFolder output{
      .folder = out, .command = "odometry", .replace = options.replace, .inputs = {dataset_folder, adapter.folder}};
  json about;
  base::write_folder(output, [&](const fs::path& temporary) {
    about = SystemRun(adapter, dataset, options).run(temporary, progress);
    base::write_file(temporary / "odometry.json", about.dump(2) + "\n");
  });
  return about;
}

}  // namespace tileflight::external_systems
