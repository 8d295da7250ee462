#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/tiles/demo_place/chart.h"

namespace tileflight::demo_place {

/// A square place made of charts. The site frame is in metres: its origin is the middle, z points up.
struct SyntheticPlace {
  double half_m = 100.0;      ///< half of each side
  std::vector<Chart> charts;  ///< first the ground, a chart for each leaf of kLeaf_m, row by row; then the objects
  geometry::Geodetic origin;  ///< of the site frame
  double heading_rad = 0.0;   ///< of the site's y axis, clockwise from north
  std::string_view attribution = "tileflight built-in place, CC0";

  static constexpr double kLeaf_m = 50.0;
};

/// Options of a built-in place.
struct PlaceOptions {
  std::uint64_t seed = 1;
  double texture_scale = 1.0;  ///< 1: full texture resolution; tests use lower values
  bool twin = true;            ///< false: only `world` is written
};

/// Writes OUT/twin/tileset.json and OUT/world/tileset.json (3D Tiles 1.1, glb, JPEG, several levels of detail, ECEF).
/// `world` is the detailed model; `twin` simulates its photogrammetric reconstruction: simplified, slightly noisy,
/// blurred textures, without thin objects. The same place and options give the same bytes.
void write_synthetic_place(const std::filesystem::path& folder, const SyntheticPlace& place,
                           const PlaceOptions& options, const Progress& progress = {});

/// The kinds of built-in places. All but the stadium lie in the middle of the Atlantic, where nothing real is, and
/// differ with the seed in layout, not only in texture.
enum class PlaceKind {
  kStadium,  ///< the stadium at the paper's coordinates, 400 m
  kTown,     ///< an old town: rows of gabled houses along narrow streets, a square with a church; 200 m
  kSuburb,   ///< detached houses with gardens, hedges and cars; 200 m
  kRavine,   ///< a gorge of rock strata between meadows, with boulders and scrub; 200 m
  kWorks,    ///< halls, tanks, chimneys, stacked containers, pipes; 200 m
  kWoods,    ///< the edge of a conifer forest, fields, a farm track; 200 m
  kFort,     ///< a star fort with ditch, ramparts, towers and barracks; 200 m
};

struct PlaceName {
  PlaceKind kind;
  std::string_view name;   ///< "town"
  std::string_view about;  ///< what it is, in a line
};

/// Returns all kinds with their names.
std::span<const PlaceName> place_names();

/// Returns the kind of a name; nullopt: there is none.
std::optional<PlaceKind> place_kind(std::string_view name);

/// A built-in place as experiments name it: KIND:MODEL or KIND-SEED:MODEL, such as town-7:twin.
struct BuiltInSource {
  PlaceKind kind = PlaceKind::kStadium;
  std::optional<std::uint64_t> seed;  ///< nullopt: the experiment's
  std::string model;                  ///< "twin" or "world"
};

/// Reads the name of a built-in place; nullopt: it does not begin with a kind. Throws InputError for another model and
/// for a seed that is no whole number.
std::optional<BuiltInSource> built_in_source(const std::string& source);

/// Makes a built-in place of a seed.
SyntheticPlace make_place(PlaceKind kind, std::uint64_t seed);

/// Writes a built-in place, as write_synthetic_place() does.
void write_place(const std::filesystem::path& folder, PlaceKind kind, const PlaceOptions& options,
                 const Progress& progress = {});

}  // namespace tileflight::demo_place
