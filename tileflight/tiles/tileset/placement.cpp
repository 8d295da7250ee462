#include "tileflight/tiles/tileset/placement.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::tileset {
namespace {

using geometry::Box3;
using geometry::Geodetic;
using geometry::LocalFrame;
using geometry::SE3;
using geometry::Vec3;

/// Largest area of a tileset that is loaded whole without confirmation.
constexpr double kLargestWhole_m2 = 4e6;
/// A higher root volume covers a continent or the globe, and tells nothing about ground height.
constexpr double kTallestKnown_m = 2e4;
constexpr double kEarthRadius_m = 6.2e6;  ///< less than the polar radius

/// Builds a LocalFrame in place, because Placement holds an optional one.
LocalFrame frame_at(const Geodetic& origin, const std::string& source) {
  const bool valid =
      std::abs(origin.latitude_deg) <= 90 && std::abs(origin.longitude_deg) <= 360 && std::isfinite(origin.height.m);
  if (!valid)
    throw InputError(source, "the origin or centre is not a valid position: latitude must be from -90 to 90 degrees");
  return LocalFrame(origin);
}

Box3 root_bounds(const TilesetTree& tree, const SE3& T_local_tileset) {
  return local_bounding_box(tree.volume(tree.root()), T_local_tileset);
}

Box3 bounds_in_frame(const TilesetTree& tree, const LocalFrame& frame) {
  return root_bounds(tree, frame.T_local_ecef());
}

bool wants_height(const LoadOptions& options) { return options.size && options.size->z() > 0; }

void check_options(const LoadOptions& options, const std::string& source) {
  if (options.center && options.center_local)
    throw InputError(source, "give either --center or --center-local, not both");
  if ((options.center || options.center_local) && !options.size) {
    throw InputError(source, "a centre without a size: give --size EAST,NORTH,UP in metres");
  }
  if (options.size && !(options.size->x() > 0 && options.size->y() > 0)) {
    throw InputError(source, "--size must be above 0 metres east and north");
  }
  if (!(options.error_m >= 0)) throw InputError(source, "--error must be 0 metres or more");
  if (options.center_local && !options.center_local->head<2>().allFinite()) {
    throw InputError(source, "--center-local is not finite");
  }
}

/// The region around `center` (z NaN: not given). Heights that the user did not give come from the tileset's extent.
Region region_about(const Vec3& center, const LoadOptions& options, const Box3& tileset, const std::string& source) {
  const bool has_height = std::isfinite(center.z()) && wants_height(options);
  if (!has_height && tileset.sizes().z() > kTallestKnown_m) {
    throw InputError(source,
                     "the tileset does not state the height of the ground there: give the height in --center and the "
                     "third number of --size");
  }
  Region region;
  region.size = *options.size;
  region.center = center;
  if (!std::isfinite(center.z())) region.center.z() = tileset.center().z();
  if (wants_height(options)) return region;
  // Keeps the given centre height: the box extends to the tileset's farther limit.
  const double up = std::max(tileset.max().z() - region.center.z(), region.center.z() - tileset.min().z());
  region.size.z() = 2 * std::max(up, 0.5);
  return region;
}

Region whole_tileset(const Box3& tileset, const LoadOptions& options, const TilesetTree& tree,
                     const std::string& source) {
  if (options.size) return region_about(tileset.center(), options, tileset, source);
  const double area_m2 = tileset.sizes().x() * tileset.sizes().y();
  if (area_m2 > kLargestWhole_m2 && !options.allow_large_area) {
    throw InputError(source, "the whole tileset covers " + base::formatted("%.1f km²", area_m2 / 1e6) +
                                 ", more than 4 km²; give --center and --size. It spans " + describe_extent(tree));
  }
  return {tileset.center(), tileset.sizes()};
}

/// Origin of the local frame of a georeferenced tileset.
Geodetic origin_on_earth(const TilesetTree& tree, const LoadOptions& options, const std::string& source) {
  if (options.origin) return *options.origin;
  if (!options.center) return geometry::geodetic_from_ecef(center_of(tree.volume(tree.root())));
  Geodetic origin = *options.center;
  if (std::isfinite(origin.height.m)) return origin;
  origin.height.m = 0;
  origin.height.m = bounds_in_frame(tree, frame_at(origin, source)).center().z();
  return origin;
}

/// Determines the frame, without the region.
Placement frame_of(const TilesetTree& tree, const LoadOptions& options, const std::string& source) {
  const bool georeferenced = is_georeferenced(tree);
  if (georeferenced && options.center_local && !options.origin) {
    throw InputError(source,
                     "the tileset is georeferenced: give --center LAT,LON[,H] instead of --center-local. It spans " +
                         describe_extent(tree));
  }
  if (!georeferenced && options.center && !options.origin) {
    throw InputError(source,
                     "the tileset is not georeferenced: give --center-local X,Y,Z in its own frame instead of "
                     "--center. It spans " +
                         describe_extent(tree));
  }
  Placement placement;
  if (georeferenced) {
    placement.local_frame = frame_at(origin_on_earth(tree, options, source), source);
    placement.T_local_tileset = placement.local_frame->T_local_ecef();
  } else {
    if (options.origin) placement.local_frame = frame_at(*options.origin, source);
    placement.T_local_tileset = T_own_tileset(tree);
    if (!placement.T_local_tileset.matrix().isIdentity()) {
      placement.warnings.push_back(
          "the transform by which Cesium ion places this movable model is undone: local coordinates are the model's "
          "own");
    }
  }
  return placement;
}

/// The user's centre in the local frame; z is NaN if no height was given.
Vec3 center_in_frame(const LoadOptions& options, const Placement& placement, const std::string& source) {
  if (options.center_local) return *options.center_local;
  Geodetic center = *options.center;
  const bool has_height = std::isfinite(center.height.m);
  if (!has_height) center.height = placement.local_frame->origin().height;
  frame_at(center, source);  // throws if it is not a valid position
  Vec3 center_local = placement.local_frame->local_from_geodetic(center);
  if (!has_height) center_local.z() = NAN;
  return center_local;
}

/// The region of the polygons, and their bounding box.
Region region_of_areas(const LoadOptions& options, const Placement& placement, const std::string& source) {
  if (!placement.local_frame) {
    throw InputError(source, "polygons need a georeferenced tileset, and this one is not: give its --origin");
  }
  Region region = placement.region;
  Box3 around;
  for (const GeographicArea& area : options.areas) {
    region.parts.push_back(to_local_prism(area, *placement.local_frame, region.box()));
    around.extend(geometry::bounds(region.parts.back()));
  }
  if (!(around.sizes().minCoeff() > 0)) throw InputError(source, "a polygon has no area or no height range");
  region.center = around.center();
  region.size = around.sizes();
  return region;
}

}  // namespace

bool is_georeferenced(const TilesetTree& tree) {
  const BoundingVolume volume = tree.volume(tree.root());
  if (std::holds_alternative<GeographicRegion>(volume) || std::holds_alternative<S2Volume>(volume)) return true;
  if (!tree.tileset(tree.root()).georeferenced.value_or(true)) return false;
  const Vec3 center = center_of(volume);
  const double radius_m = local_bounding_box(volume, SE3()).sizes().norm() / 2;
  if (center.norm() < radius_m && radius_m > kEarthRadius_m) return true;
  if (center.norm() < kEarthRadius_m) return false;
  return std::abs(geometry::geodetic_from_ecef(center).height.m) < 1e5 + radius_m;
}

SE3 T_own_tileset(const TilesetTree& tree) {
  const Tileset& tileset = tree.tileset(tree.root());
  const std::shared_ptr<const Tile> root = tree.tile(tree.root());
  if (tileset.georeferenced.value_or(true) || !tileset.movable) return {};
  if (!root->contents.empty() || root->children.size() != 1) return {};
  const geometry::Mat4 T_tileset_model =
      tree.T_tileset_tile(tree.root()) * tileset.tiles[root->children[0]].T_parent_tile;
  const geometry::Mat3 linear = T_tileset_model.topLeftCorner<3, 3>();
  if (!(linear * linear.transpose()).isIdentity(1e-9) || linear.determinant() < 0) return {};
  return SE3(linear, T_tileset_model.topRightCorner<3, 1>()).inverse();
}

std::string describe_extent(const Box3& box) {
  return "x " + base::formatted("%.1f … %.1f", box.min().x(), box.max().x()) + ", y " +
         base::formatted("%.1f … %.1f", box.min().y(), box.max().y()) + ", z " +
         base::formatted("%.1f … %.1f m", box.min().z(), box.max().z());
}

std::string describe_extent(const TilesetTree& tree) {
  const BoundingVolume volume = tree.volume(tree.root());
  if (!is_georeferenced(tree)) return describe_extent(local_bounding_box(volume, T_own_tileset(tree)));
  const Geodetic center = geometry::geodetic_from_ecef(center_of(volume));
  const Vec3 size = local_bounding_box(volume, LocalFrame(center).T_local_ecef()).sizes();
  return base::formatted("%.0f m × %.0f m", size.x(), size.y()) +
         base::formatted(" around latitude %.6f, longitude %.6f", center.latitude_deg, center.longitude_deg) +
         base::formatted(", heights %.1f … %.1f m", center.height.m - size.z() / 2, center.height.m + size.z() / 2);
}

std::string describe_separation(const Box3& flown, const Box3& tileset, const std::optional<LocalFrame>& frame) {
  std::string text = "it flies at " + describe_extent(flown) + ", and the tileset spans " + describe_extent(tileset) +
                     " in the same local frame";
  if (frame) {
    const Geodetic& origin = frame->origin();
    text +=
        base::formatted(" (its origin is latitude %.6f, longitude %.6f", origin.latitude_deg, origin.longitude_deg) +
        base::formatted(", height %.1f m)", origin.height.m);
  }
  const double apart_m = std::sqrt(flown.squaredExteriorDistance(tileset));
  if (apart_m > 0.0) text += base::formatted(", %.0f m away", apart_m);
  if (apart_m > tileset.sizes().norm()) {
    return text +
           "; positions are metres east, north and up from the frame's origin: convert them, or give the origin they "
           "refer to (--origin LAT,LON,HEIGHT)";
  }
  return text +
         "; check the camera's direction (pitch_deg -90 is straight down, yaw_deg is clockwise from north) and the "
         "flight's height";
}

namespace {

/// A flat volume, as of a level floor, holds its surface, but a region needs an extent on each axis.
Box3 with_thickness(Box3 box) {
  constexpr double kThin_m = 1e-3;
  for (int axis = 0; axis < 3; ++axis) {
    if (box.sizes()[axis] > 0.0) continue;
    box.min()[axis] -= kThin_m;
    box.max()[axis] += kThin_m;
  }
  return box;
}

}  // namespace

Placement resolve_placement(const TilesetTree& tree, const LoadOptions& options, const std::string& source) {
  check_options(options, source);
  Placement placement = frame_of(tree, options, source);
  const Box3 tileset = with_thickness(root_bounds(tree, placement.T_local_tileset));
  const bool has_center = options.center || options.center_local;
  if (options.flight && !has_center) {
    placement.region = {tileset.center(), tileset.sizes()};
    return placement;
  }
  placement.region = has_center ? region_about(center_in_frame(options, placement, source), options, tileset, source)
                                : whole_tileset(tileset, options, tree, source);
  if (!options.areas.empty()) placement.region = region_of_areas(options, placement, source);
  return placement;
}

}  // namespace tileflight::tileset
