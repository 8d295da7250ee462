#include "tileflight/capture/preview/ground_view.h"

#include <algorithm>
#include <cmath>

#include "tileflight/capture/render/daylight.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::preview {
namespace {

using geometry::Box3;
using geometry::Vec3;
using render::GroundGrid;

/// A part of this size is rendered from coarser tiles instead of being divided.
constexpr int kMinPart_px = 96;
/// Maximum number of times the error is doubled until tiles fit.
constexpr int kMaxDoublings = 24;

/// Criterion for the part of the placement's region inside a box, at an error; whatever heights the tiles state.
tileset::RefinementCriterion criterion_within(const place::PlaceReader& place, const Box3& box, double error_m) {
  const tileset::Placement& placement = place.placement();
  const Box3 column = tileset::column_of({box.center(), box.sizes()}).box();
  return place::restrict_to_box(
      tileset::region_criterion(tileset::column_of(placement.region), placement.T_local_tileset, error_m),
      {Vec3(box.min().x(), box.min().y(), column.min().z()), Vec3(box.max().x(), box.max().y(), column.max().z())},
      placement.T_local_tileset);
}

/// The grid's volume without its border, which has no rays: tiles that only touch the grid are not needed.
Box3 grid_volume(const place::PlaceReader& place, const GroundGrid& grid) {
  constexpr double kRim_px = 0.1;
  const Box3 region = place.placement().region.box();
  const Vec3 rim = kRim_px * grid.pixel_m * Vec3(1, 1, 0);
  return {Vec3(grid.west_m, grid.south_m(), region.min().z()) + rim,
          Vec3(grid.east_m(), grid.north_m, region.max().z()) - rim};
}

void paste(const render::Orthophoto& part, int x0, int y0, render::Orthophoto& whole) {
  for (int y = 0; y < part.rgb.height; ++y) {
    std::copy_n(part.rgb.row(y), part.rgb.width, whole.rgb.row(y0 + y) + x0);
    std::copy_n(part.height_m.row(y), part.height_m.width, whole.height_m.row(y0 + y) + x0);
  }
}

/// Renders a view part by part.
class Painter {
 public:
  Painter(place::PlaceReader& place, const GroundViewOptions& options, const Progress& progress, GroundView& view)
      : place_(place), options_(options), progress_(progress), view_(view) {
    if (place_.lacks_textures(whole_cut(options_.error_m).contents))
      options_.top_down.daylight = render::make_daylight(render::relief_light(), std::nullopt);
  }

  void paint(int x, int y, int width, int height) {
    const GroundGrid grid = view_.grid.crop(x, y, width, height);
    if (auto part = read(grid, options_.error_m)) return add(std::move(*part), grid, x, y);
    if (std::max(width, height) <= kMinPart_px) return paint_coarser(grid, x, y);
    const int left = (width + 1) / 2, top = (height + 1) / 2;
    paint(x, y, left, top);
    if (width > left) paint(x + left, y, width - left, top);
    if (height > top) paint(x, y + top, left, height - top);
    if (width > left && height > top) paint(x + left, y + top, width - left, height - top);
  }

 private:
  tileset::TileCut whole_cut(double error_m) {
    const tileset::Placement& placement = place_.placement();
    return place_.select_cut(
        tileset::region_criterion(tileset::column_of(placement.region), placement.T_local_tileset, error_m));
  }

  std::optional<place::PlacePart> read(const GroundGrid& grid, double error_m) {
    const bool is_whole = grid.width == view_.grid.width && grid.height == view_.grid.height;
    // The whole map shows what the region's tiles hold, also beside their volumes.
    const tileset::TileCut cut =
        is_whole ? whole_cut(error_m) : place_.select_cut(criterion_within(place_, grid_volume(place_, grid), error_m));
    return place_.read(cut, true, options_.max_memory_bytes, progress_);
  }

  void paint_coarser(const GroundGrid& grid, int x, int y) {
    double error_m = std::max(options_.error_m, grid.pixel_m);
    for (int i = 0; i < kMaxDoublings; ++i) {
      error_m *= 2;
      auto part = read(grid, error_m);
      if (!part) continue;
      view_.is_coarser = true;
      return add(std::move(*part), grid, x, y);
    }
    throw tileset::MemoryLimitExceeded(place_.name(),
                                       "a single tile takes more memory than is allowed; raise the limit (--memory)");
  }

  void add(place::PlacePart part, const GroundGrid& grid, int x, int y) {
    ++view_.parts;
    view_.tiles += part.tiles;
    view_.missing.insert(view_.missing.end(), part.missing.begin(), part.missing.end());
    render::Orthophoto image(grid.width, grid.height);
    for (const imaging::TexturedMesh& mesh : part.meshes)
      view_.triangles += static_cast<std::int64_t>(mesh.mesh.triangles.size());
    if (!part.meshes.empty()) {
      const scene::Scene scene(std::move(part.meshes));
      image = render::render_orthophoto(scene, grid, options_.top_down);
    }
    for (const geometry::PointCloud& cloud : part.clouds) render::splat_points(cloud, grid, options_.top_down, image);
    paste(image, x, y, view_.image);
    const auto all = static_cast<std::int64_t>(view_.image.rgb.pixels.size());
    done_ += static_cast<std::int64_t>(grid.width) * grid.height;
    report_progress(progress_, done_, all, "drawing the map");
  }

  place::PlaceReader& place_;
  GroundViewOptions options_;
  const Progress& progress_;
  GroundView& view_;
  std::int64_t done_ = 0;
};

/// A missing tile that spans several parts is listed once.
void remove_duplicates(std::vector<place::MissingTile>& missing) {
  const auto by_failure = [](const place::MissingTile& a, const place::MissingTile& b) {
    return a.failure < b.failure;
  };
  std::stable_sort(missing.begin(), missing.end(), by_failure);
  const auto same = [](const place::MissingTile& a, const place::MissingTile& b) { return a.failure == b.failure; };
  missing.erase(std::unique(missing.begin(), missing.end(), same), missing.end());
}

Box3 bounds_of(const place::PlacePart& part) {
  Box3 box;
  for (const imaging::TexturedMesh& mesh : part.meshes) {
    for (const geometry::Triangle& t : mesh.mesh.triangles) {
      for (const std::uint32_t corner : t) box.extend(mesh.mesh.vertices[corner]);
    }
  }
  for (const geometry::PointCloud& cloud : part.clouds) {
    for (const Vec3& p : cloud.positions) box.extend(p);
  }
  return box;
}

/// Bounds, computed by quarters of the box if it takes too much memory; a single tile that does is represented by its
/// bounding volume.
Box3 bounds_within(place::PlaceReader& place, const Box3& box, double error_m, std::uintmax_t max_memory_bytes,
                   int deepest, bool is_whole, const Progress& progress) {
  const tileset::TileCut cut = place.select_cut(criterion_within(place, box, error_m));
  if (cut.contents.empty()) return {};
  if (const auto part = place.read(cut, false, max_memory_bytes, progress)) {
    Box3 found = bounds_of(*part);
    // Surface that tiles of the whole region hold outside of their volumes belongs to the place, too.
    if (found.isEmpty() || is_whole) return found;
    found.min().head<2>() = found.min().head<2>().cwiseMax(box.min().head<2>());
    found.max().head<2>() = found.max().head<2>().cwiseMin(box.max().head<2>());
    return found;
  }
  if (deepest == 0) return box;
  Box3 all;
  const Vec3 middle = box.center();
  // Slightly apart, so that adjacent tiles do not count for both.
  const double apart_m = std::max(1e-5, 1e-6 * std::max(box.sizes().x(), box.sizes().y()));
  for (int quarter = 0; quarter < 4; ++quarter) {
    Box3 part = box;
    for (int axis = 0; axis < 2; ++axis) {
      const bool is_upper = (quarter >> axis & 1) != 0;
      (is_upper ? part.min() : part.max())[axis] = middle[axis] + (is_upper ? apart_m : -apart_m);
    }
    const Box3 found = bounds_within(place, part, error_m, max_memory_bytes, deepest - 1, false, progress);
    if (!found.isEmpty()) all.extend(found);
  }
  return all;
}

}  // namespace

GroundView render_ground_view(place::PlaceReader& place, const GroundGrid& grid, const GroundViewOptions& options,
                              const Progress& progress) {
  GroundView view;
  view.grid = grid;
  view.image = render::Orthophoto(grid.width, grid.height);
  view.error_m = options.error_m;
  Painter(place, options, progress, view).paint(0, 0, grid.width, grid.height);
  remove_duplicates(view.missing);
  return view;
}

Box3 surface_bounds(place::PlaceReader& place, double error_m, std::uintmax_t max_memory_bytes,
                    const Progress& progress) {
  constexpr int kDeepest = 5;
  return bounds_within(place, place.placement().region.box(), error_m, max_memory_bytes, kDeepest, true, progress);
}

GroundGrid fit_ground_grid(const Box3& box, int pixels) {
  constexpr double kMargin = 0.02, kNarrowest = 1.0 / 3.0, kLeast_m = 1e-3;
  const Vec3 middle = box.center();
  const double longer_m = std::max({box.sizes().x(), box.sizes().y(), kLeast_m}) * (1 + 2 * kMargin);
  GroundGrid grid;
  grid.pixel_m = longer_m / pixels;
  const auto count = [&](double side_m) {
    const double wanted_m = std::max(std::max(side_m, kLeast_m) + 2 * kMargin * longer_m, kNarrowest * longer_m);
    return std::clamp(static_cast<int>(std::ceil(wanted_m / grid.pixel_m - 1e-9)), 1, pixels);
  };
  grid.width = count(box.sizes().x());
  grid.height = count(box.sizes().y());
  grid.west_m = middle.x() - grid.pixel_m * grid.width / 2;
  grid.north_m = middle.y() + grid.pixel_m * grid.height / 2;
  return grid;
}

drawing::GroundImage to_ground_picture(const GroundView& view) {
  const GroundGrid& g = view.grid;
  return {{g.west_m, g.east_m(), g.south_m(), g.north_m}, view.image.rgb, view.image.height_m};
}

std::vector<drawing::MapOutline> missing_outlines(const GroundView& view) {
  std::vector<drawing::MapOutline> outlines;
  for (const place::MissingTile& tile : view.missing) {
    if (!tile.bounds) continue;
    const Vec3 low = tile.bounds->min(), high = tile.bounds->max();
    outlines.push_back({drawing::MapOutline::Kind::kMissingTile,
                        {{low.x(), low.y()}, {high.x(), low.y()}, {high.x(), high.y()}, {low.x(), high.y()}}});
  }
  return outlines;
}

std::vector<std::string> ground_view_warnings(const GroundView& view) {
  std::vector<std::string> lines;
  constexpr std::size_t kTold = 3;
  for (std::size_t i = 0; i < std::min(kTold, view.missing.size()); ++i)
    lines.push_back("missing or broken, left out: " + view.missing[i].failure);
  if (view.missing.size() > kTold)
    lines.push_back("and " + std::to_string(view.missing.size() - kTold) + " more tiles are missing or broken");
  if (view.is_coarser)
    lines.emplace_back(
        "some parts show coarser tiles than the image resolution allows, because of the memory limit (--memory)");
  return lines;
}

}  // namespace tileflight::preview
