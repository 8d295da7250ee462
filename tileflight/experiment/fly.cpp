#include "tileflight/experiment/fly.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <iterator>

#include "tileflight/dataset/dataset.h"
#include "tileflight/experiment/dataset_film.h"
#include "tileflight/experiment/frame_share.h"
#include "tileflight/experiment/mission.h"
#include "tileflight/experiment/stage_cache.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/output_folder.h"
#include "tileflight/tiles/open_source.h"
#include "tileflight/tiles/placement.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// From the plan: a vehicle that keeps to its path at all is within a metre in severe turbulence (docs/vehicles.md).
constexpr double kFarOff_m = 5.0;

/// What frames are made from beside the program: whoever has the same makes the same.
json inputs_of(const Mission& mission, const RenderSettings& settings) {
  std::string numbers;
  const auto add = [&numbers](const auto& values) {
    for (const double value : values) numbers.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  const auto add_pose = [&](const geometry::SE3& T) {
    add(T.translation);
    add(T.rotation.coeffs());
  };
  constexpr int kBetween = 4;  // moments from a frame to the next at which the path is looked at
  const auto& poses = mission.frames.poses;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    add(std::array{poses[i].time_s});
    add_pose(poses[i].T_local_camera);
    for (int k = 1; k < kBetween && i + 1 < poses.size(); ++k) {
      add_pose(mission.pose_at(poses[i].time_s + (poses[i + 1].time_s - poses[i].time_s) * k / kBetween));
    }
  }
  const imaging::Camera& camera = mission.calibration.camera;
  constexpr int kAcross = 16;  // rays that tell lenses apart
  for (int i = 0; i <= kAcross * kAcross; ++i) {
    const geometry::Vec2 pixel((camera.width() - 1.0) * (i % kAcross) / kAcross,
                               (camera.height() - 1.0) * (i / kAcross) / kAcross);
    add(pixel);
    if (const auto ray = camera.unproject(pixel)) add(*ray);
  }
  return {{"program", program_fingerprint()},
          {"settings", geometry::sha256_hex(settings.asked.dump())},  // may name what is not everyone's to read
          {"source", tiles::shown_source(settings.source)},
          {"seed", settings.seed},
          {"path and camera", geometry::sha256_hex(numbers)}};
}

/// Says what is kept where this process is made to end, for as long as this lives.
class LastWords {
 public:
  LastWords(Ranks& ranks, const KeptFrames& kept, std::size_t frames) : ranks_(ranks) {
    ranks.set_last_words([&kept, frames] { return kept.state(frames); });
  }
  ~LastWords() { ranks_.set_last_words({}); }
  LastWords(const LastWords&) = delete;
  LastWords& operator=(const LastWords&) = delete;

 private:
  Ranks& ranks_;
};

struct Rendered {
  Filmed filmed;
  std::vector<KeptFrame> frames;
  std::size_t taken_up = 0;
};

/// `kept`: null where one process renders everything.
Rendered render_share(const Mission& mission, const RenderSettings& settings, const fs::path& out, bool replace,
                      const KeptFrames* kept, Ranks& ranks, const Progress& progress) {
  FrameShare share(ranks, kept, mission.frames.size());
  std::optional<DatasetFilm> film;
  const auto start = std::chrono::steady_clock::now();
  double loading_s = 0.0;
  together(ranks, [&] {
    film.emplace(mission, settings, out, replace, share, progress);
    film->shoot();
    const std::chrono::duration<double> shot = std::chrono::steady_clock::now() - start;
    loading_s = shot.count() - film->filmed().seconds;
  });
  const std::chrono::duration<double> all_shot = std::chrono::steady_clock::now() - start;
  Rendered rendered;
  together(ranks, [&] {
    if (ranks.rank() == 0) rendered.frames = film->finish();
  });
  rendered.filmed = film->filmed();
  rendered.filmed.seconds = all_shot.count() - loading_s;  // with what the other ranks took longer
  rendered.taken_up = share.frames_taken_up();
  return rendered;
}

/// As DatasetWriter has it.
geometry::OutputFolder output_of(const RenderSettings& settings, const fs::path& out, bool replace) {
  return {.folder = out,
          .command = "render",
          .replace = replace,
          .inputs = files_read(settings),
          .unmarked = dataset::unmarked_dataset()};
}

/// Among several ranks, or as one that keeps its frames.
Rendered render_kept(const Mission& mission, const RenderSettings& settings, const fs::path& out, bool replace,
                     Ranks& ranks, const Progress& progress, std::vector<std::string>& notes) {
  together(ranks, [&] {
    if (ranks.rank() != 0) return;
    geometry::require_writable(output_of(settings, out, replace));
    notes.push_back(KeptFrames::prepare(out, inputs_of(mission, settings)));
  });
  std::optional<KeptFrames> kept;
  together(ranks, [&] { kept.emplace(out, ranks.rank(), ranks.count()); });
  const LastWords last_words(ranks, *kept, mission.frames.size());
  Rendered rendered = render_share(mission, settings, out, replace, &*kept, ranks, progress);
  if (ranks.rank() == 0) kept->remove();
  if (rendered.taken_up > 0) {
    notes.push_back(std::to_string(rendered.taken_up) + " of " + std::to_string(mission.frames.size()) +
                    " frames were there from an earlier render");
  }
  return rendered;
}

/// `vehicle`: what vehicle.json says.
void add_vehicle_warnings(const json& vehicle, std::vector<std::string>& warnings) {
  if (vehicle["outcome"] != "finished") {
    warnings.push_back("the vehicle did not finish: " + vehicle["outcome"].get<std::string>() + " (vehicle.json)");
  }
  const double most_m = vehicle.contains("tracking") ? vehicle["tracking"]["max_m"].get<double>() : 0.0;
  if (most_m > kFarOff_m && vehicle["collisions"] == 0) {
    warnings.push_back("the vehicle was up to " + std::to_string(std::lround(most_m)) +
                       " m off its plan: too much wind or too fast a plan for it (tracking in vehicle.json)");
  }
}

std::vector<std::string> warnings_of(const Mission& mission, const Rendered& rendered) {
  std::vector<std::string> warnings =
      sensors::flight_warnings(checks_of(rendered.frames), 0, mission.options.clearance_m);
  const bool sees_nothing = std::all_of(rendered.frames.begin(), rendered.frames.end(),
                                        [](const KeptFrame& frame) { return frame.check.view.surface_share <= 0.0; });
  if (sees_nothing) {
    geometry::Box3 flown;
    for (const geometry::StampedPose& pose : mission.frames.poses) flown.extend(pose.T_local_camera.translation);
    const tiles::LoadedTiles& tiles = rendered.filmed.tiles;
    warnings.push_back("no picture shows anything of the tileset: " +
                       tiles::apart_text(flown, tiles.region.box(), tiles.local_frame));
  }
  warnings.insert(warnings.end(), rendered.filmed.tiles.warnings.begin(), rendered.filmed.tiles.warnings.end());
  if (!mission.vehicle.is_null()) add_vehicle_warnings(mission.vehicle, warnings);
  return warnings;
}

}  // namespace

std::vector<fs::path> files_read(const RenderSettings& settings) {
  std::vector<fs::path> files = settings.inputs;
  for (const fs::path& file : flight::files_of_flight(settings.flight.flight)) files.push_back(file);
  files.push_back(settings.flight.camera);
  files.push_back(tiles::files_of_source(settings.source));
  return files;
}

json render_dataset(const RenderSettings& settings, const fs::path& out, bool replace, const Progress& progress,
                    Ranks* given_ranks) {
  OneRank alone;
  Ranks& ranks = given_ranks == nullptr ? alone : *given_ranks;
  const Progress shown = ranks.rank() == 0 ? progress : Progress();
  Mission mission;
  together(ranks, [&] { mission = plan_mission(settings, shown); });
  std::vector<std::string> notes;
  const bool keeps = settings.resume || ranks.count() > 1 || KeptFrames::are_there(out);
  const Rendered rendered = keeps ? render_kept(mission, settings, out, replace, ranks, shown, notes)
                                  : render_share(mission, settings, out, replace, nullptr, ranks, shown);
  if (ranks.rank() != 0) return nullptr;
  std::vector<std::string> warnings = warnings_of(mission, rendered);
  std::copy_if(notes.begin(), notes.end(), std::back_inserter(warnings), [](const auto& n) { return !n.empty(); });
  const Filmed& filmed = rendered.filmed;
  const auto frames = static_cast<std::int64_t>(rendered.frames.size());
  return {{"frames", frames},
          {"frames_taken_up", rendered.taken_up},
          {"ranks", ranks.count()},
          {"seconds", filmed.seconds},
          {"frames_per_second", filmed.seconds > 0.0 ? static_cast<double>(frames) / filmed.seconds : 0.0},
          {"tiles", filmed.tiles.cut_size - filmed.tiles.tiles_failed},
          {"parts", filmed.parts},
          {"complete", filmed.tiles.complete},
          {"triangles", filmed.tiles.triangles},
          {"path_length", geometry::path_length_m(mission.frames)},
          {"warnings", warnings}};
}

}  // namespace tileflight::experiment
