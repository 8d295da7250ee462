#include "tileflight/capture/recording/render_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <memory>

#include "tileflight/capture/recording/dataset_renderer.h"
#include "tileflight/capture/recording/flight_faults.h"
#include "tileflight/capture/recording/frame_store.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/program.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/tileset/placement.h"

namespace tileflight::recording {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// Deviation from the plan that causes a warning: in severe turbulence a vehicle normally keeps within a metre
/// (docs/vehicles.md).
constexpr double kFarOff_m = 5.0;

/// Path and lens of a camera, as bytes.
void append_camera(const PlannedCamera& planned, std::string& numbers) {
  const auto add = [&numbers](const auto& values) {
    for (const double value : values) numbers.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  const auto add_pose = [&](const geometry::SE3& T) {
    add(T.translation);
    add(T.rotation.coeffs());
  };
  constexpr int kBetween = 4;  // number of times between two frames at which the path is sampled
  const auto& poses = planned.frames.poses;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    add(std::array{poses[i].time_s});
    add_pose(poses[i].T_local_camera);
    for (int k = 1; k < kBetween && i + 1 < poses.size(); ++k) {
      add_pose(planned.pose_at(poses[i].time_s + (poses[i + 1].time_s - poses[i].time_s) * k / kBetween));
    }
  }
  const imaging::Camera& camera = planned.calibration.camera;
  constexpr int kAcross = 16;  // number of rays used to compare lenses
  for (int i = 0; i <= kAcross * kAcross; ++i) {
    const geometry::Vec2 pixel((camera.width() - 1.0) * (i % kAcross) / kAcross,
                               (camera.height() - 1.0) * (i / kAcross) / kAcross);
    add(pixel);
    if (const auto ray = camera.unproject(pixel)) add(*ray);
  }
}

/// Everything besides the program that determines the frames: equal inputs give equal frames.
json frame_inputs(const PlannedFlight& mission, const RenderSettings& settings) {
  std::string numbers;
  for (std::size_t c = 0; c < mission.camera_count(); ++c) append_camera(mission.camera(c), numbers);
  return {{"program", base::program_fingerprint()},
          {"settings", base::sha256_hex(settings.asked.dump())},  // hashed: may hold private paths
          {"source", fetch::redact_source(settings.source)},
          {"seed", settings.seed},
          {"path and camera", base::sha256_hex(numbers)}};
}

struct RenderedFrames {
  RenderSummary summary;
  std::vector<FrameRecord> frames;
  std::size_t reused = 0;
};

/// `kept`: null if no frames are stored beside the dataset.
RenderedFrames render_frames(const PlannedFlight& mission, const RenderSettings& settings, const fs::path& out,
                             bool replace, const FrameStore* kept, const Progress& progress) {
  FrameAssignment share(kept, mission.image_count());
  DatasetRenderer renderer(mission, settings, out, replace, share, progress);
  renderer.render();
  RenderedFrames rendered;
  rendered.frames = renderer.finish();
  rendered.summary = renderer.summary();
  rendered.reused = share.frames_resumed();
  return rendered;
}

/// Renders with a frame store, to be able to resume. Appends what the user is told about reused frames to `notes`.
RenderedFrames render_with_store(const PlannedFlight& mission, const RenderSettings& settings, const fs::path& out,
                                 bool replace, const Progress& progress, std::vector<std::string>& notes) {
  base::require_writable(render_output(settings, out, replace));
  if (const std::string note = FrameStore::prepare(out, frame_inputs(mission, settings)); !note.empty())
    notes.push_back(note);
  const FrameStore kept(out);
  RenderedFrames rendered = render_frames(mission, settings, out, replace, &kept, progress);
  kept.remove();
  if (rendered.reused > 0) {
    notes.push_back(std::to_string(rendered.reused) + " of " + std::to_string(mission.image_count()) +
                    " frames were reused from an earlier render");
  }
  return rendered;
}

/// `vehicle`: content of vehicle.json.
void add_vehicle_warnings(const json& vehicle, std::vector<std::string>& warnings) {
  if (vehicle["outcome"] != "finished") {
    warnings.push_back("the vehicle did not finish: " + vehicle["outcome"].get<std::string>() + " (vehicle.json)");
  }
  if (vehicle.contains("autopilot"))
    for (const json& line : vehicle["autopilot"]["log"]) warnings.push_back(line);
  const double max_m = vehicle.contains("tracking") ? vehicle["tracking"]["max_m"].get<double>() : 0.0;
  if (max_m > kFarOff_m && vehicle["collisions"] == 0) {
    warnings.push_back(
        "the vehicle was up to " + std::to_string(std::lround(max_m)) +
        " m off its planned path: the wind is too strong or the plan too fast (see tracking in vehicle.json)");
  }
}

/// Throws InputError for a flight with an autopilot, which each task would have fly again.
void require_undivided_autopilot(const RenderSettings& settings) {
  if (vehicle::read_flight_plan(settings.flight.flight).autopilot)
    throw InputError(settings.flight.flight.string(),
                     "an autopilot flies once: render its flight in one process, or name that dataset's "
                     "groundtruth.txt as 'trajectory'");
}

/// Collects the warnings about the path of each camera.
std::vector<std::string> path_warnings(const PlannedFlight& mission, const std::vector<FrameRecord>& images) {
  const ImageOrder order(mission);
  std::vector<std::string> warnings;
  for (std::size_t c = 0; c < mission.camera_count(); ++c) {
    const PlannedCamera& camera = mission.camera(c);
    std::vector<FrameRecord> frames;
    for (std::size_t i = 0; i < camera.frames.size(); ++i) frames.push_back(images[order.number_of(c, i)]);
    const std::string whose = camera.name.empty() ? "" : "camera " + camera.name + ", ";
    for (const std::string& warning : render::flight_warnings(frame_checks(frames), 0, camera.options.clearance_m))
      warnings.push_back(whose + warning);
    for (const std::string& warning : render::fault_warnings(find_actor_faults(mission, c)))
      warnings.push_back(whose + warning);
  }
  return warnings;
}

std::vector<std::string> collect_warnings(const PlannedFlight& mission, const RenderedFrames& rendered) {
  std::vector<std::string> warnings = mission.notes;
  const std::vector<std::string> of_path = path_warnings(mission, rendered.frames);
  warnings.insert(warnings.end(), of_path.begin(), of_path.end());
  const bool sees_nothing = std::all_of(rendered.frames.begin(), rendered.frames.end(),
                                        [](const FrameRecord& frame) { return frame.check.view.surfaces == 0; });
  if (sees_nothing) {
    geometry::Box3 flown;
    for (const geometry::StampedPose& pose : mission.frames.poses) flown.extend(pose.T_local_camera.translation);
    const tileset::LoadedTiles& tiles = rendered.summary.tiles;
    warnings.push_back("no image shows any part of the tileset: " +
                       tileset::describe_separation(flown, tiles.region.box(), tiles.local_frame));
  }
  warnings.insert(warnings.end(), rendered.summary.tiles.warnings.begin(), rendered.summary.tiles.warnings.end());
  if (!mission.vehicle.is_null()) add_vehicle_warnings(mission.vehicle, warnings);
  return warnings;
}

}  // namespace

std::vector<fs::path> render_input_files(const RenderSettings& settings) {
  std::vector<fs::path> files = settings.inputs;
  for (const fs::path& file : vehicle::referenced_files(settings.flight.flight)) files.push_back(file);
  files.push_back(settings.flight.camera);
  files.push_back(fetch::local_path_of_source(settings.source));
  return files;
}

base::OutputFolder render_output(const RenderSettings& settings, const fs::path& out, bool replace) {
  return {.folder = out, .command = "render", .replace = replace, .inputs = render_input_files(settings)};
}

FramePlan plan_frame_parts(const RenderSettings& settings, int parts, const Progress& progress) {
  require_undivided_autopilot(settings);
  constexpr std::size_t kFewFrames = 8;  // less is not worth reading the tiles again
  const PlannedFlight mission = plan_flight(settings, progress);
  const std::size_t frames = mission.image_count();
  const std::size_t count = std::clamp(static_cast<std::size_t>(std::max(1, parts)), std::size_t{1},
                                       std::max<std::size_t>(1, frames / kFewFrames));
  return {.parts = jobs::balanced_ranges(std::vector<double>(frames, 1.0), count),
          .inputs_sha256 = base::sha256_hex(frame_inputs(mission, settings).dump())};
}

fs::path frame_build_folder(const fs::path& dataset) { return FrameStore::folder_for(dataset); }

RenderResult render_dataset(const RenderSettings& settings, const fs::path& out, bool replace,
                            const Progress& progress) {
  const PlannedFlight mission = plan_flight(settings, progress);
  std::vector<std::string> notes;
  const RenderedFrames rendered = settings.resume || FrameStore::exists(out)
                                      ? render_with_store(mission, settings, out, replace, progress, notes)
                                      : render_frames(mission, settings, out, replace, nullptr, progress);
  const RenderSummary& summary = rendered.summary;
  RenderResult result{.frames = rendered.frames.size(),
                      .frames_reused = rendered.reused,
                      .cameras = mission.camera_count(),
                      .events = summary.events,
                      .seconds = summary.seconds,
                      .tiles = summary.tiles.cut_size - summary.tiles.tiles_failed,
                      .tiles_read = summary.tiles_read,
                      .parts = summary.parts,
                      .triangles = summary.tiles.triangles,
                      .is_complete = summary.tiles.complete,
                      .path_length_m = geometry::path_length_m(mission.body),
                      .warnings = collect_warnings(mission, rendered)};
  result.warnings.insert(result.warnings.end(), notes.begin(), notes.end());
  return result;
}

RenderedPart render_part(const RenderSettings& settings, const jobs::IndexRange& range, const fs::path& out,
                         const Progress& progress) {
  require_undivided_autopilot(settings);
  const PlannedFlight mission = plan_flight(settings, progress);
  const std::size_t frames = mission.image_count();
  const jobs::IndexRange part{range.begin, std::min(range.end, frames)};
  if (part.begin >= part.end) throw InputError("--frames", "the flight has frames 0 to " + std::to_string(frames - 1));
  FrameStore::prepare(out, frame_inputs(mission, settings), jobs::Share::kPart);
  const FrameStore kept(out, std::to_string(part.begin) + "-" + std::to_string(part.end));
  FrameAssignment share(&kept, frames, part);
  DatasetRenderer(mission, settings, out, true, share, progress).render();
  return {.frames = part.size(), .frames_rendered = share.count(), .build_folder = FrameStore::folder_for(out)};
}

json to_json(const RenderResult& result) {
  return {{"frames", result.frames},         {"events", result.events},
          {"cameras", result.cameras},       {"frames_taken_up", result.frames_reused},
          {"seconds", result.seconds},       {"frames_per_second", result.frames_per_second()},
          {"tiles", result.tiles},           {"parts", result.parts},
          {"tiles_read", result.tiles_read}, {"complete", result.is_complete},
          {"triangles", result.triangles},   {"path_length", result.path_length_m},
          {"warnings", result.warnings}};
}

json to_json(const RenderedPart& part) {
  return {
      {"frames", part.frames}, {"frames_rendered", part.frames_rendered}, {"build_folder", part.build_folder.string()}};
}

}  // namespace tileflight::recording
