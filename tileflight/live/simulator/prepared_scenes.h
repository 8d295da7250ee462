#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <stop_token>
#include <vector>

#include "tileflight/live/simulator/resident_scene.h"
#include "tileflight/live/simulator/sensor_cells.h"

namespace tileflight::simulator {

/// A scene, with the cells and the limit for which it was made.
struct PreparedScene {
  SensorCells cells;
  DetailLimit wanted;      ///< limit at which the search for one that fits began
  DetailLimit detail;      ///< that of the scene
  std::uint64_t pins = 0;  ///< number of changes of the pinned regions before
  double worst_px = 0.0;   ///< largest error of a tile
  std::shared_ptr<const ResidentScene> scene;
};

/// The scenes in memory: the present one, recent ones, and those made for cells that lie ahead of the sensors. It also
/// keeps the list of these cells. Thread-safe; only the functions wait_…() block.
class PreparedScenes {
 public:
  /// `detail`: the limit at which searches begin at first.
  explicit PreparedScenes(const DetailLimit& detail) : detail_(detail) {}

  /// Returns the scene that was entered last; null: none yet.
  std::shared_ptr<const ResidentScene> current() const;
  /// Returns the limit of the present scene, at which the search for the next one begins.
  DetailLimit detail() const;
  /// Returns the memory of all tiles of all scenes.
  std::uintmax_t memory_bytes() const;

  /// Counts a change of the pinned regions: scenes made before are not used any more.
  void count_pin_change();
  std::uint64_t pins() const;

  /// A scene that was entered, and the limits before and after.
  struct Entered {
    std::shared_ptr<const ResidentScene> scene;
    DetailLimit before, now;
    double worst_px = 0.0;
  };
  /// Makes the scene for these cells the present one, if there is one. A scene that lacks tiles is skipped once the
  /// last failure is older than `retry_after`, so that its tiles are read again.
  std::optional<Entered> enter(const SensorCells& cells, std::chrono::milliseconds retry_after);
  /// Makes a new scene the present one.
  Entered enter(PreparedScene next);
  /// Keeps a scene that was made ahead.
  void add(PreparedScene ahead);
  /// Notes the time at which tiles could not be read.
  void note_failure();

  /// Returns whether there is a scene for these cells.
  bool holds(const SensorCells& cells) const;
  /// Returns a complete scene of the same tiles; null: there is none.
  std::shared_ptr<const ResidentScene> find_same(const tileset::TileCut& cut) const;
  /// Drops scenes until the rest fits into memory together with the tiles of the scene in the making: first the least
  /// recently used ones, then those that lie farthest ahead. `ahead`: the cells of the scene in the making, if it is
  /// made ahead. Returns false if such a scene does not fit beside the scenes that are needed before it.
  bool make_room(const SensorCells* ahead, std::span<const std::shared_ptr<const ResidentPart>> in_the_making,
                 std::uintmax_t max_memory_bytes);

  /// Predicts from the sensors' motion which cells lie ahead.
  void plan(std::span<const SensorViewpoint> viewpoints);
  bool is_ahead(const SensorCells& cells) const;
  /// Waits for a new plan, for the thread that makes scenes ahead; nullopt once the thread is to end.
  std::optional<std::vector<SensorCells>> wait_for_plan(const std::stop_token& stop);
  /// Waits until that thread has nothing to do.
  void wait_until_prepared();

 private:
  bool serves(const PreparedScene& one, const SensorCells& cells) const;

  mutable std::mutex mutex_;
  std::optional<PreparedScene> present_;
  std::list<PreparedScene> others_;  ///< entered before or made ahead, the latest first
  DetailLimit detail_;
  std::uint64_t pins_ = 0;
  std::chrono::steady_clock::time_point last_failure_{};
  SensorMotion motion_;
  std::vector<SensorCells> ahead_;  ///< cells to prepare
  bool is_planned_ = false;         ///< `ahead_` is not yet being worked on
  bool is_preparing_ = false;
  std::condition_variable_any wake_;
};

/// Returns the key of a cut's content.
std::optional<TileKey> key_of(const tileset::CutContent& content);

}  // namespace tileflight::simulator
