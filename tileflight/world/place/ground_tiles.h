#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/fetch/tile_source.h"
#include "tileflight/tiles/tileset/cut_reader.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/region_reader.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::place {

/// Heights of a place's surface, whose tiles are read where they are asked for: cell by cell of a horizontal grid, of
/// which those asked for last stay in memory. What is found depends neither on memory nor on the order of questions.
/// Not thread safe.
class GroundTiles {
 public:
  static constexpr double kCell_m = 128.0;  ///< edge of a cell

  /// Selects the tiles of the request (load.textures is ignored) and reads none. Cells in memory take at most about
  /// half of load.max_memory_bytes; a few tiles that are being read come to them. Throws InputError as
  /// tileset::load_region().
  GroundTiles(const std::string& source, const tileset::LoadOptions& load, Progress progress = {});

  /// Height of the uppermost surface at a position of the local frame, not above `below_z`; nullopt: there is none.
  /// Throws InputError for an unreadable tile (unless load.allow_incomplete), tileset::MemoryLimitExceeded if one
  /// cell's surface does not fit.
  std::optional<double> height(double x, double y, double below_z);

  /// Returns how often tiles were read.
  std::int64_t read_count() const { return read_count_; }

 private:
  using CellIndex = std::pair<std::int64_t, std::int64_t>;
  struct Cell {
    std::unique_ptr<const scene::Scene> surface;  ///< null: there is none
    std::uintmax_t bytes = 0;
    std::uint64_t used = 0;  ///< number of the last question
  };

  const Cell& cell_at(const CellIndex& index);
  Cell read(const CellIndex& index);
  std::vector<tileset::LoadedContent> read_some(const std::vector<std::size_t>& contents, std::size_t& next);
  void make_room();

  std::string name_;
  std::uintmax_t max_bytes_;  ///< of the cells in memory
  Progress progress_;
  std::unique_ptr<fetch::TileSource> source_;
  std::optional<tileset::RegionReader> reader_;
  std::map<CellIndex, Cell> cells_;
  std::uint64_t asked_ = 0;
  std::int64_t read_count_ = 0;
};

}  // namespace tileflight::place
