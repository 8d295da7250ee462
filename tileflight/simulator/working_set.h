#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/simulator/place.h"
#include "tileflight/simulator/simulator.h"
#include "tileflight/tiles/load.h"
#include "tileflight/tiles/placement.h"
#include "tileflight/tiles/selection.h"
#include "tileflight/tiles/tile_source.h"

namespace tileflight::simulator {

/// Where a sensor looks from, all around, and how sharply.
struct Look {
  geometry::Vec3 position = geometry::Vec3::Zero();  ///< local frame
  double pixels_per_rad = 100.0;
};

/// The tiles that are in memory, which follow what sensors can see.
///
/// A cut of the tree is made for the looks' cells: cubes of kCell_m. In each, every tile errs by at most `error_px`
/// pixels from anywhere in the cell, in all directions. So there is never a hole or a coarser level in a picture,
/// whichever way a vehicle turns; what a picture shows depends on where the sensors are and not on how they came there;
/// and nothing is read or built anew before a sensor enters another cell. Tiles that the next cut has too are kept,
/// with all that has been worked out of their textures.
///
/// Where a cut does not fit into the memory allowed, the error allowed is raised until it does, and stays so.
class WorkingSet {
 public:
  static constexpr double kCell_m = 24.0;

  /// Opens the source and decides where the local frame is. Throws InputError.
  WorkingSet(const SimulatorOptions& options, SimulatorLog log, const Progress& progress);
  /// A place that is all there is.
  WorkingSet(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log);

  const std::optional<geometry::LocalFrame>& local_frame() const { return placement_.local_frame; }
  /// The middle of the region, local frame.
  geometry::Vec3 center() const { return placement_.region.center; }
  geometry::Box3 bounds() const { return placement_.region.box(); }
  bool follows() const { return follows_; }
  double error_px() const { return error_px_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  std::vector<std::string> attribution() const;
  std::uint64_t places_built() const { return places_built_; }
  std::uint64_t tiles_read() const { return tiles_read_; }

  /// What the sensors need, read now if it is not there. Throws InputError where not even the coarsest tiles fit.
  std::shared_ptr<const Place> for_looks(std::span<const Look> looks);
  /// What is there; of for_looks() the latest.
  std::shared_ptr<const Place> current() const;
  /// From now on this is in memory too, as fine as that; of such regions the latest 32. Throws InputError.
  LoadedRegion add_region(const geometry::Box3& box_local, double error_m, std::span<const Look> looks);
  /// Every triangle near the box, the finest there are (`error_m` 0), whatever is in memory. Throws InputError: tiles
  /// that cannot be read, too many.
  geometry::TriangleMesh triangles_in(const geometry::Box3& box_local, double error_m) const;
  /// The highest surface above or below a point of the local frame's plane that is not above `below_z`.
  std::optional<double> surface_z(double x, double y, double below_z) const;

 private:
  struct Pinned {
    tiles::Region region;
    double error_m = 0.0;
  };
  using Cell = std::array<double, 4>;  ///< middle x, y, z and pixels per radian

  void open(const Progress& progress);
  void choose_mode(const Progress& progress);
  bool origin_is_elsewhere(const std::string& name) const;
  std::vector<Cell> cells_of(std::span<const Look> looks) const;
  tiles::Wanted wanted(const std::vector<Cell>& cells) const;
  std::shared_ptr<const Place> load(const std::vector<Cell>& cells, const Progress& progress);
  std::optional<std::shared_ptr<const Place>> try_load(const std::vector<Cell>& cells, const Progress& progress);
  bool read_missing(const tiles::TileCut& cut, const std::vector<std::size_t>& missing, std::vector<PlacedTile>& tiles,
                    LoadedRegion& loaded, const Progress& progress);
  enum class Broken { kRefused, kLeftOut };
  geometry::TriangleMesh read_triangles(const geometry::Box3& box_local, double error_m, Broken tiles) const;
  void keep(std::shared_ptr<const Place> place);
  void say(const std::string& line) const;
  geometry::Vec3 anchor() const;
  bool may_retry();
  std::uintmax_t place_limit_bytes() const { return options_.max_memory_bytes / 2; }

  SimulatorOptions options_;
  SimulatorLog log_;
  mutable std::mutex loading_;  ///< guards tree, cells_ and what is read
  std::unique_ptr<tiles::TileSource> source_;
  std::unique_ptr<tiles::TilesetTree> tree_;
  tiles::Placement placement_;
  bool follows_ = false;
  std::atomic<double> error_px_{1.0};
  std::vector<Pinned> pinned_;
  std::vector<Cell> cells_;  ///< of the current place
  std::string cut_hash_;     ///< likewise
  std::chrono::steady_clock::time_point last_failure_{};
  std::vector<std::string> warnings_;
  std::vector<std::string> attribution_;
  std::atomic<std::uint64_t> places_built_{0}, tiles_read_{0};
  mutable std::mutex current_mutex_;
  std::shared_ptr<const Place> current_;
};

}  // namespace tileflight::simulator
