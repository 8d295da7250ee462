#include "tileflight/capture/preview/preview.h"

#include <iterator>
#include <nlohmann/json.hpp>

#include "tileflight/capture/preview/preview_figures.h"
#include "tileflight/capture/preview/preview_json.h"
#include "tileflight/capture/preview/sample_pictures.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/world/place/require_surface.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::preview {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

tileset::LoadOptions preview_load_options(const recording::RenderSettings& settings) {
  tileset::LoadOptions load = settings.load;
  load.allow_large_area = settings.error_px.has_value();  // tiles are then selected by what the flight sees
  return load;
}

}  // namespace

json preview_flight(const PreviewSettings& settings, const fs::path& out, bool replace, const Progress& progress) {
  if (fs::exists(out) && !replace) throw InputError(out.string(), "exists already; --force replaces it");
  PreviewedFlight flight{
      settings, recording::plan_flight(settings.render, progress),
      place::PlaceReader(settings.render.source, preview_load_options(settings.render), fetch::Use::kAnalyse),
      settings.render.max_memory_bytes.value_or(base::default_memory_bytes()), 0};
  if (flight.frames().empty()) throw InputError(settings.render.flight.flight.string(), "has no frames");
  std::vector<place::MissingTile> missing;
  SurroundingTiles around = read_surroundings(flight, progress);
  flight.checks_bytes = around.part.memory_bytes;
  std::move(around.part.missing.begin(), around.part.missing.end(), std::back_inserter(missing));
  const scene::Scene scene(place::with_placeholder(std::move(around.part.meshes)), flight.pose(0).translation);
  const FlightCheck check = check_flight(scene, flight.mission, settings.check, progress);
  const std::vector<SamplePicture> pictures = render_pictures(flight, missing, progress);
  const PreviewFigures figures = draw_figures(flight, scene, check, pictures, missing, progress);

  const std::vector<render::FlightFault> faults = find_faults(check, settings.check);
  const std::vector<std::string> warnings =
      collect_warnings(flight, check, faults, pictures, around.is_coarser, missing);
  const json found = preview_json(flight, check, pictures, faults, warnings);
  base::write_folder(out, replace, [&](const fs::path& temporary) {
    imaging::write_rgb(temporary / "map.png", figures.map);
    imaging::write_rgb(temporary / "profile.png", figures.profile);
    base::write_file(temporary / "profile.csv", figures.profile_csv);
    for (const SamplePicture& p : pictures) imaging::write_rgb(temporary / (p.name + ".jpg"), p.thumbnail, 88);
    base::write_file(temporary / "preview.json", found.dump(2) + "\n");
  });
  return found;
}

}  // namespace tileflight::preview
