#include "tileflight/capture/preview/sample_pictures.h"

#include <algorithm>
#include <array>
#include <chrono>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/drawing/page_image.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/world/place/place_reader.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::preview {

namespace {

using geometry::Box3;
using geometry::Vec3;

/// Positions along the path, subsampled where that makes no difference.
std::vector<Vec3> subsample_path(const geometry::Trajectory& frames) {
  const double step_m = std::max(0.25, geometry::path_length_m(frames) / 2000);
  std::vector<Vec3> path;
  for (const geometry::StampedPose& pose : frames.poses) {
    const Vec3& p = pose.T_local_camera.translation;
    if (path.empty() || (p - path.back()).norm() >= step_m) path.push_back(p);
  }
  return path;
}

/// Tiles for the checks: resolution as a share of their distance, within a range of the path.
struct DetailLevel {
  double error_share, reach_m;
};

}  // namespace

void look_at_place(PreviewedFlight& flight) {
  const recording::FrameGroups groups = recording::group_flight_frames(flight.mission, flight.settings.render);
  const auto contents = [&] {
    std::vector<tileset::CutContent> all;
    for (const std::vector<std::size_t>& group : groups.frames) {
      const tileset::TileCut cut =
          flight.place.select_cut(criterion_of(flight, group, flight.settings.render.error_px, {}));
      all.insert(all.end(), cut.contents.begin(), cut.contents.end());
    }
    return all;
  };
  std::vector<tileset::CutContent> shown = contents();
  if (flight.place.widen_to_contents(shown)) shown = contents();
  flight.lacks_textures = flight.place.lacks_textures(shown);
}

SurroundingTiles read_surroundings(PreviewedFlight& flight, const Progress& progress) {
  constexpr std::array<DetailLevel, 5> kDetails{{{0.005, 20e3}, {0.01, 5e3}, {0.02, 2e3}, {0.05, 1e3}, {0.1, 300}}};
  const geometry::SE3& T_local_tileset = flight.place.placement().T_local_tileset;
  Box3 path_box;
  std::vector<tileset::ViewCone> cones;
  for (const Vec3& p : subsample_path(flight.frames())) {
    path_box.extend(p);
    cones.push_back({.position = p});
  }
  for (const DetailLevel& detail : kDetails) {
    for (tileset::ViewCone& cone : cones) cone.pixels_per_rad = 1 / detail.error_share;
    const Vec3 around(detail.reach_m, detail.reach_m, 20e3);
    const tileset::RefinementCriterion wanted =
        place::restrict_to_box(tileset::limit_refinement(tileset::flight_criterion(cones, T_local_tileset, 1.0),
                                                         flight.settings.render.load.error_m),
                               Box3(path_box.min() - around, path_box.max() + around), T_local_tileset);
    if (auto part = flight.place.read(flight.place.select_cut(wanted), false, flight.memory / 2, progress))
      return {std::move(*part), &detail != kDetails.data()};
  }
  throw tileset::MemoryLimitExceeded(flight.place.name(),
                                     "the tiles around the path need more memory than the limit; raise it (--memory)");
}

namespace {

/// Reads the tiles that the image's frame shows, as `render` selects them, or coarser ones if they do not fit into
/// memory. Sets the picture's `error_px`.
place::PlacePart read_tiles_of(PreviewedFlight& flight, const recording::FrameGroups& groups, SamplePicture& picture,
                               const Progress& progress) {
  constexpr double kCoarsest = 256.0;  // times the error asked for
  const std::vector<std::size_t>& group = groups.frames[groups.group_of_frame[picture.frame]];
  const std::optional<double>& wanted_px = flight.settings.render.error_px;
  for (double coarser = 1.0; coarser <= (wanted_px ? kCoarsest : 1.0); coarser *= 2.0) {
    if (wanted_px) picture.error_px = coarser * *wanted_px;
    const tileset::TileCut cut = flight.place.select_cut(criterion_of(flight, group, picture.error_px, picture.frame));
    if (auto part = flight.place.read(cut, true, flight.memory_left(), progress)) return std::move(*part);
  }
  throw tileset::MemoryLimitExceeded(flight.place.name(),
                                     "the part of the place that frame " + std::to_string(picture.frame) +
                                         " sees needs more memory than the limit: request coarser tiles (--error, "
                                         "--pixel-error) or raise the limit (--memory)");
}

/// Renders an image as `render` would, from the same tiles where they fit into memory.
SamplePicture render_picture(PreviewedFlight& flight, const std::string& name, std::size_t frame,
                             std::vector<place::MissingTile>& missing, const Progress& progress) {
  SamplePicture picture{.name = name, .frame = frame, .thumbnail = {}};
  auto start = std::chrono::steady_clock::now();
  const recording::FrameGroups groups = recording::group_flight_frames(flight.mission, flight.settings.render);
  place::PlacePart part = read_tiles_of(flight, groups, picture, progress);
  missing.insert(missing.end(), part.missing.begin(), part.missing.end());
  picture.tiles = part.tiles;
  picture.file_bytes = part.file_bytes;
  picture.memory_bytes = part.memory_bytes;
  const geometry::Vec3& anchor = groups.anchors[groups.group_of_frame[frame]];
  const scene::Scene scene(place::with_placeholder(std::move(part.meshes)), anchor);
  scene.build_beam_tree();
  render::FlightRenderOptions options = flight.mission.options;
  options.first_frame = frame;
  options.end_frame = frame + 1;
  options.outputs = {};
  render::light_by_relief(flight.lacks_textures, options.formation);
  if (const auto& local = flight.place.placement().local_frame) options.origin = local->origin();
  options.frame_filter = [&](std::size_t) {  // called when the renderer is ready to cast its first ray
    if (picture.load_s == 0.0) {
      picture.load_s = base::seconds_since(start);
      start = std::chrono::steady_clock::now();
    }
    return true;
  };
  const render::FrameSink sink = [&](const render::FlightFrame& sensed) {
    picture.render_s = base::seconds_since(start);
    const auto encoding = std::chrono::steady_clock::now();
    imaging::encode_jpeg(sensed.rgb, 95);
    picture.encode_s = base::seconds_since(encoding);
    picture.thumbnail = drawing::downscale(sensed.rgb, flight.settings.picture_width);
    picture.surface_share = sensed.check.view.surface_share();
  };
  render::render_flight(scene, flight.mission.calibration.camera, flight.frames(), flight.mission.pose_at, options,
                        sink);
  return picture;
}

}  // namespace

tileset::RefinementCriterion criterion_of(const PreviewedFlight& flight, const std::vector<std::size_t>& group,
                                          const std::optional<double>& error_px, std::optional<std::size_t> frame) {
  const recording::RenderSettings& render = flight.settings.render;
  const tileset::Placement& placement = flight.place.placement();
  if (!error_px) return tileset::region_criterion(placement.region, placement.T_local_tileset, render.load.error_m);
  const std::vector<tileset::ViewCone> all = recording::flight_view_cones(flight.mission);
  const std::size_t per_frame = all.size() / flight.frames().size();
  std::vector<tileset::ViewCone> cones;
  tileset::ViewConeRange part;
  for (const std::size_t i : group) {
    if (i == frame) part = {cones.size(), cones.size() + per_frame};
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(i * per_frame);
    cones.insert(cones.end(), first, first + static_cast<std::ptrdiff_t>(per_frame));
  }
  return tileset::limit_refinement(
      tileset::flight_criterion(std::move(cones), placement.T_local_tileset, *error_px, part), render.load.error_m);
}

std::vector<SamplePicture> render_pictures(PreviewedFlight& flight, std::vector<place::MissingTile>& missing,
                                           const Progress& progress) {
  const std::size_t last = flight.frames().size() - 1;
  std::vector<SamplePicture> pictures;
  for (const auto& [name, frame] :
       {std::pair<std::string, std::size_t>("first", 0), {"middle", last / 2}, {"last", last}}) {
    const auto same = std::ranges::find(pictures, frame, &SamplePicture::frame);
    if (same != pictures.end()) {
      SamplePicture again = *same;
      again.name = name;
      pictures.push_back(std::move(again));
    } else {
      pictures.push_back(render_picture(flight, name, frame, missing, progress));
    }
  }
  return pictures;
}

}  // namespace tileflight::preview
