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

/// A scene, and what it was made for.
struct PreparedScene {
  SensorCells cells;
  DetailLimit wanted;      ///< limit at which the search for one that fits began
  DetailLimit detail;      ///< that of the scene
  std::uint64_t pins = 0;  ///< number of changes of the pinned regions before
  double worst_px = 0.0;   ///< largest error of a tile
  std::shared_ptr<const ResidentScene> scene;
};

/// The scenes at hand: the present one, those that the sensors left, and those made for cells that lie ahead; and which
/// cells these are. Thread safe; no call but wait_…() takes longer than a moment.
class PreparedScenes {
 public:
  /// `detail`: the limit at which searches begin at first.
  explicit PreparedScenes(const DetailLimit& detail) : detail_(detail) {}

  /// The scene that was entered last; null: none yet.
  std::shared_ptr<const ResidentScene> current() const;
  /// The limit of the present scene, at which the search for the next one begins.
  DetailLimit detail() const;
  /// Memory of all tiles of all scenes.
  std::uintmax_t memory_bytes() const;

  /// Scenes made for other pinned regions are of no use any more.
  void count_pin_change();
  std::uint64_t pins() const;

  /// A scene that was entered, and the limits before and since.
  struct Entered {
    std::shared_ptr<const ResidentScene> scene;
    DetailLimit before, now;
    double worst_px = 0.0;
  };
  /// Makes the scene for these cells the present one, if it is at hand; not one that lacks tiles if these are to be
  /// read again (`retry_after` a failure).
  std::optional<Entered> enter(const SensorCells& cells, std::chrono::milliseconds retry_after);
  /// Makes it the present one.
  Entered enter(PreparedScene next);
  /// Keeps a scene that was made ahead.
  void add(PreparedScene ahead);
  /// Takes note that tiles could not be read.
  void note_failure();

  /// Whether the scene for these cells is at hand.
  bool holds(const SensorCells& cells) const;
  /// A complete scene of the same tiles; null: there is none.
  std::shared_ptr<const ResidentScene> find_same(const tileset::TileCut& cut) const;
  /// Forgets scenes until all fit into memory, with the tiles of the scene in the making: first those that were not
  /// used for longest, then those that lie ahead farthest. `ahead`: its cells, if it is made ahead: it has to fit
  /// beside those that are needed before it; false if it does not.
  bool make_room(const SensorCells* ahead, std::span<const std::shared_ptr<const ResidentPart>> in_the_making,
                 std::uintmax_t max_memory_bytes);

  /// Takes note of the sensors' ways: which cells lie ahead.
  void plan(std::span<const SensorViewpoint> viewpoints);
  bool is_ahead(const SensorCells& cells) const;
  /// For the thread that makes scenes ahead: waits for a new plan; nullopt once it is to end.
  std::optional<std::vector<SensorCells>> wait_for_plan(const std::stop_token& stop);
  /// Waits until that thread waits.
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

/// A content of a cut, as tiles are known by.
std::optional<TileKey> key_of(const tileset::CutContent& content);

}  // namespace tileflight::simulator
