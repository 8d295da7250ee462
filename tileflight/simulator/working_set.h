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
#include "tileflight/simulator/resident_scene.h"
#include "tileflight/simulator/simulator.h"
#include "tileflight/tiles/load.h"
#include "tileflight/tiles/placement.h"
#include "tileflight/tiles/selection.h"
#include "tileflight/transport/tile_source.h"

namespace tileflight::simulator {

/// Position and angular resolution of a sensor that may look in any direction.
struct SensorViewpoint {
  geometry::Vec3 position = geometry::Vec3::Zero();  ///< local frame
  double pixels_per_rad = 100.0;
};

/// The tiles in memory, which follow what sensors can see.
///
/// The tile cut is computed for the cells, cubes of kCellSize_m, that contain the viewpoints: every tile has an error
/// of at most `error_px` pixels from anywhere in the cell, in all directions. So images have no holes and no coarser
/// levels, however a vehicle turns; an image depends only on where the sensors are, not on how they got there; and
/// nothing is loaded or rebuilt until a sensor enters another cell. Tiles that are also in the next cut are kept, with
/// all data derived from their textures.
///
/// If a cut does not fit into the memory limit, the allowed error is raised until it does, and stays raised.
class WorkingSet {
 public:
  static constexpr double kCellSize_m = 24.0;

  /// Opens the source and determines the local frame. Throws InputError.
  WorkingSet(const SimulatorOptions& options, SimulatorLog log, const Progress& progress);
  /// A place that consists of the given meshes.
  WorkingSet(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log);

  const std::optional<geometry::LocalFrame>& local_frame() const { return placement_.local_frame; }
  /// Centre of the region, local frame.
  geometry::Vec3 center() const { return placement_.region.center; }
  geometry::Box3 bounds() const { return placement_.region.box(); }
  bool follows_sensors() const { return follows_sensors_; }
  double error_px() const { return error_px_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  std::vector<std::string> attribution() const;
  std::uint64_t scenes_built() const { return scenes_built_; }
  std::uint64_t tiles_read() const { return tiles_read_; }

  /// Returns a scene with everything that the sensors need, loading it if necessary. Throws InputError if not even the
  /// coarsest tiles fit.
  std::shared_ptr<const ResidentScene> load_for(std::span<const SensorViewpoint> viewpoints);
  /// The scene of the latest load_for().
  std::shared_ptr<const ResidentScene> current() const;
  /// Also keeps this region in memory from now on, at this error; only the latest 32 regions are kept. Throws
  /// InputError.
  LoadedRegion add_region(const geometry::Box3& box_local, double error_m, std::span<const SensorViewpoint> viewpoints);
  /// Every triangle near the box at the error given (0: the finest available), independent of the tiles in memory.
  /// Throws InputError: unreadable tiles, too many triangles.
  geometry::TriangleMesh triangles_in(const geometry::Box3& box_local, double error_m) const;
  /// Height of the highest surface at a horizontal position of the local frame, not above `below_z`.
  std::optional<double> surface_z(double x, double y, double below_z) const;

 private:
  struct PinnedRegion {
    tiles::Region region;
    double error_m = 0.0;
  };
  using Cell = std::array<double, 4>;  ///< centre x, y, z and pixels per radian

  void open(const Progress& progress);
  void choose_residency(const Progress& progress);
  bool is_default_origin_elsewhere(const std::string& name) const;
  std::vector<Cell> cells_around(std::span<const SensorViewpoint> viewpoints) const;
  tiles::RefinementCriterion refinement_criterion(const std::vector<Cell>& cells) const;
  std::shared_ptr<const ResidentScene> load(const std::vector<Cell>& cells, const Progress& progress);
  std::optional<std::shared_ptr<const ResidentScene>> try_load(const std::vector<Cell>& cells,
                                                               const Progress& progress);
  bool read_missing(const tiles::TileCut& cut, const std::vector<std::size_t>& missing,
                    std::vector<ResidentTile>& tiles, LoadedRegion& loaded, const Progress& progress);
  enum class Broken { kRefused, kLeftOut };
  geometry::TriangleMesh read_triangles(const geometry::Box3& box_local, double error_m, Broken tiles) const;
  void set_current(std::shared_ptr<const ResidentScene> place);
  void log_line(const std::string& line) const;
  geometry::Vec3 anchor() const;
  bool may_retry();
  std::uintmax_t scene_limit_bytes() const { return options_.max_memory_bytes / 2; }

  SimulatorOptions options_;
  SimulatorLog log_;
  mutable std::mutex loading_mutex_;  ///< guards tree, cells_ and loading
  std::unique_ptr<transport::TileSource> source_;
  std::unique_ptr<tiles::TilesetTree> tree_;
  tiles::Placement placement_;
  bool follows_sensors_ = false;
  std::atomic<double> error_px_{1.0};
  std::vector<PinnedRegion> pinned_;
  std::vector<Cell> cells_;  ///< of the current scene
  std::string cut_hash_;     ///< of the current scene
  std::chrono::steady_clock::time_point last_failure_{};
  std::vector<std::string> warnings_;
  std::vector<std::string> attribution_;
  std::atomic<std::uint64_t> scenes_built_{0}, tiles_read_{0};
  mutable std::mutex current_mutex_;
  std::shared_ptr<const ResidentScene> current_;
};

}  // namespace tileflight::simulator
