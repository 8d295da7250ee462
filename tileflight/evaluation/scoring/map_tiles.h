#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/evaluation/scoring/map_points.h"

namespace tileflight::scoring {

/// The points of a map, placed in the local frame, in tiles: cells of an octree in the order of a Morton curve. One
/// tile is in memory at a time; the rest lies in a file without a name, 32 bytes a point, which ends with the object. A
/// map of one tile is held in memory.
class MapTiles {
 public:
  struct Options {
    /// Which points of the map are wanted; null: all.
    const std::vector<bool>* chosen = nullptr;
    std::size_t most_points = MapPoints::kBlock;  ///< of a tile
  };

  /// `folder`: where the file is made. Throws InputError if it cannot be written, and for a point that is not finite.
  MapTiles(const MapPoints& map, const geometry::Sim3& T_local_map, const std::filesystem::path& folder,
           const Options& options);

  /// Points in the order of the map.
  struct Points {
    std::vector<geometry::Vec3> positions;  ///< local frame
    std::vector<std::uint32_t> numbers;     ///< in the map
  };

  std::size_t points() const { return points_; }
  std::size_t size() const { return bounds_.size(); }
  /// Returns the box around the points of each tile.
  const std::vector<geometry::Box3>& bounds() const { return bounds_; }
  Points read(std::size_t tile) const;
  /// Returns the points of all tiles inside a box.
  Points read_within(const geometry::Box3& box) const;

  /// A point by its tile and its place in read(tile).
  struct Place {
    std::uint32_t tile = 0, place = 0;
  };
  /// Returns evenly chosen points as geometry::sample_evenly() of all points would.
  std::vector<Place> sample_evenly(std::size_t count) const;
  /// Returns the points at these places, in their order.
  Points at(const std::vector<Place>& places) const;

 private:
  struct Record;
  class Writer;
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  void split(const std::vector<std::uint64_t>& codes, std::size_t from, std::size_t to, int shift, std::size_t most);
  void store(const MapPoints& map, const geometry::Sim3& T_local_map, const Options& options,
             const std::filesystem::path& folder);
  std::vector<Place> all_places() const;
  std::uint64_t code_of(const geometry::Vec3& p) const;

  std::size_t points_ = 0;
  geometry::Vec3 low_ = geometry::Vec3::Zero();
  double cells_a_metre_ = 0;
  std::vector<std::uint64_t> first_codes_;  ///< of each tile, on the Morton curve
  std::vector<std::size_t> firsts_;         ///< rank of each tile's first point along the curve; and the end
  std::vector<geometry::Box3> bounds_;
  Points held_;                             ///< of a single tile
  std::unique_ptr<std::FILE, Close> file_;  ///< of several
};

}  // namespace tileflight::scoring
