#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/live/simulator/prepared_scenes.h"
#include "tileflight/live/simulator/resident_scene.h"
#include "tileflight/live/simulator/sensor_cells.h"
#include "tileflight/live/simulator/simulator_options.h"
#include "tileflight/tiles/fetch/tile_source.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/tiles/tileset/selection.h"

namespace tileflight::simulator {

/// The tiles in memory; they follow what the sensors can see.
///
/// The tile cut is computed for the cells, cubes of SensorCell::kSize_m, that contain the viewpoints: every tile has an
/// error of at most `error_px` pixels from anywhere in the cell, in all directions. So images have no holes and no
/// coarser levels, however a vehicle turns; an image depends only on where the sensors are, not on how they got there;
/// and nothing is loaded or rebuilt until a sensor enters another cell. Tiles that are also in the next cut are kept,
/// with their trees and all data derived from their textures.
///
/// A background thread builds the scenes of the cells that lie ahead, so that entering one only exchanges a pointer. It
/// affects only when a scene is built, not the scene: a cell that is not ready is waited for. The last few scenes are
/// kept, too. All scenes together stay within the memory limit. (After a jump, the previous scene is kept until the
/// next one is ready: meanwhile both may exceed the limit by a third, if they have no tile in common.)
///
/// If a cut takes more than two thirds of the limit, the allowed error is raised until it does (far tiles first, see
/// DetailLimit), and stays raised.
class WorkingSet {
 public:
  /// Opens the source and determines the local frame. Throws InputError.
  WorkingSet(const SimulatorOptions& options, SimulatorLog log, const Progress& progress);
  /// A place that consists of the given meshes.
  WorkingSet(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log);

  const std::optional<geometry::LocalFrame>& local_frame() const { return placement_.local_frame; }
  /// Centre of the region, local frame.
  geometry::Vec3 center() const { return placement_.region.center; }
  geometry::Box3 bounds() const { return placement_.region.box(); }
  bool follows_sensors() const { return follows_sensors_; }
  /// The largest error of the tiles in memory, pixels, as seen from the sensors' cells, or the allowed error if that is
  /// larger. (The finest tiles there are count as without error.)
  double error_px() const { return error_px_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  std::vector<std::string> attribution() const;
  std::uint64_t scenes_built() const { return scenes_built_; }
  std::uint64_t tiles_read() const { return tiles_read_; }
  /// Number of calls of load_for() that had to wait for a scene.
  std::uint64_t waits() const { return waits_; }
  /// Returns the memory of all tiles: those of the current scene, and of others that are kept or made ahead.
  std::uintmax_t memory_bytes() const { return scenes_.memory_bytes(); }

  /// Returns a scene with everything that the sensors need, loading it if necessary. Throws InputError if not even the
  /// coarsest tiles fit.
  std::shared_ptr<const ResidentScene> load_for(std::span<const SensorViewpoint> viewpoints);
  /// Returns the scene of the latest load_for().
  std::shared_ptr<const ResidentScene> current() const { return scenes_.current(); }
  /// Also keeps this region in memory from now on, at this error; only the latest 32 regions are kept. Throws
  /// InputError.
  LoadedRegion add_region(const geometry::Box3& box_local, double error_m, std::span<const SensorViewpoint> viewpoints);
  /// Returns every triangle near the box at the error given (0: the finest available), independent of the tiles in
  /// memory. Throws InputError for unreadable tiles or too many triangles.
  geometry::TriangleMesh triangles_in(const geometry::Box3& box_local, double error_m) const;
  /// Returns the height of the highest surface at a horizontal position of the local frame, not above `below_z`.
  std::optional<double> surface_z(double x, double y, double below_z) const;
  /// Waits until no scene is being made ahead, or about to be. For tests.
  void wait_until_prefetched() { scenes_.wait_until_prepared(); }

 private:
  struct PinnedRegion {
    tileset::Region region;
    double error_m = 0.0;
  };
  /// Size and, while it is in memory, data of a tile's content.
  struct KnownTile {
    std::uintmax_t bytes = 0;  ///< in memory
    std::weak_ptr<const ResidentPart> part;
  };
  /// kNoRoom: memory is needed for more urgent scenes; kInterrupted: a caller waits, or the cells no longer lie ahead.
  enum class Outcome { kMade, kTooLarge, kNoRoom, kInterrupted };
  /// Counts a waiting caller while it exists.
  class Waiting {
   public:
    explicit Waiting(std::atomic<int>& count) : count_(count) { ++count_; }
    ~Waiting() { --count_; }
    Waiting(const Waiting&) = delete;
    Waiting& operator=(const Waiting&) = delete;

   private:
    std::atomic<int>& count_;
  };
  struct Attempt;  ///< working_set_attempt.cpp
  enum class When { kNow, kAhead };
  using Lock = std::unique_lock<std::mutex>;

  void open(const Progress& progress);
  void choose_residency(const Progress& progress);
  bool load_whole_region(const Progress& progress);
  bool is_default_origin_elsewhere(const std::string& name) const;
  SensorCriterion sensor_criterion(const DetailLimit& detail) const;
  tileset::RefinementCriterion refinement_criterion(const SensorCells& cells, const DetailLimit& detail) const;
  double largest_error_px(const tileset::TileCut& cut, const SensorCells& cells) const;

  // Building scenes. `lock` holds loading_mutex_; it is released between batches of a scene that is built ahead.
  PreparedScene load(const SensorCells& cells, Lock& lock, const Progress& progress);
  Outcome make(Attempt& attempt, Lock& lock, const Progress& progress);
  bool take_known_tiles(Attempt& attempt);
  Outcome read_missing(Attempt& attempt, Lock& lock, const Progress& progress);
  bool read_batch(Attempt& attempt, std::span<const std::size_t> batch, const Progress& progress);
  void prepare_batch(Attempt& attempt, std::span<const std::size_t> batch, Lock& lock);
  void finish(Attempt& attempt);
  std::uintmax_t estimate_bytes(const tileset::TileCut& cut, const Progress& progress);
  DetailLimit first_detail(const SensorCells& cells, const Progress& progress);

  std::shared_ptr<const ResidentScene> enter_prepared(const SensorCells& cells);
  void enter(PreparedScene next);
  void tell_detail(const PreparedScenes::Entered& entered);
  bool make_room(const Attempt* ahead);

  // Prefetching.
  void prefetch(const std::stop_token& stop);
  Outcome prepare_ahead(const SensorCells& cells);
  bool is_interrupted(const SensorCells& cells) const;
  bool is_ahead(const SensorCells& cells) const;

  enum class Broken { kRefused, kLeftOut };
  geometry::TriangleMesh read_triangles(const geometry::Box3& box_local, double error_m, Broken tiles) const;
  void log_line(const std::string& line) const;
  geometry::Vec3 anchor() const;
  /// Returns the memory limit of one scene. A scene that follows the sensors shares most of its tiles with the next
  /// one, which must fit beside it.
  std::uintmax_t scene_limit_bytes() const { return options_.max_memory_bytes / 6 * (follows_sensors_ ? 4 : 3); }

  SimulatorOptions options_;
  SimulatorLog log_;
  std::unique_ptr<fetch::TileSource> source_;
  std::unique_ptr<tileset::TilesetTree> tree_;
  bool volumes_are_checked_ = false;
  tileset::Placement placement_;
  std::optional<scene::SceneFrame> frame_;
  bool follows_sensors_ = false;
  std::vector<std::string> warnings_;
  std::atomic<double> error_px_{1.0};
  std::atomic<std::uint64_t> scenes_built_{0}, tiles_read_{0}, waits_{0};

  PreparedScenes scenes_;

  /// Guards what follows, and reading.
  mutable std::mutex loading_mutex_;
  std::vector<PinnedRegion> pinned_;
  std::map<TileKey, KnownTile> known_tiles_;
  std::vector<std::shared_ptr<const ResidentPart>> preparing_;  ///< of the scene that is being made
  std::uint64_t attempts_ = 0;                                  ///< to make a scene
  std::vector<std::string> attribution_;

  mutable std::atomic<int> waiting_{0};  ///< callers that wait for a scene
  std::jthread prefetcher_;              ///< last member: ends first
};

}  // namespace tileflight::simulator
