#include "tileflight/evaluation/scoring/map_tiles.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <string>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/point_order.h"

namespace tileflight::scoring {
namespace {

using geometry::Box3;
using geometry::Vec3;

constexpr double kCells = 2097152.0;  // along the longest side, as geometry::morton_order()
constexpr int kBitsOfCode = 63;

InputError cannot_write(const std::filesystem::path& folder) {
  return {folder.string(),
          std::string("the map's points cannot be stored there while it is scored: ") + std::strerror(errno)};
}

std::FILE* open_without_name(const std::filesystem::path& folder) {
  std::string name = (folder / ".map-tiles-XXXXXX").string();
  const int descriptor = mkstemp(name.data());
  std::FILE* file = descriptor < 0 ? nullptr : fdopen(descriptor, "w+b");
  if (file == nullptr) throw cannot_write(folder);
  unlink(name.c_str());
  return file;
}

template <typename Visit>
void for_each_chosen(const MapPoints& map, const geometry::Sim3& T_local_map, const std::vector<bool>* chosen,
                     const Visit& visit) {
  map.visit([&](std::size_t first, const geometry::PointCloud& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (!chosen || (*chosen)[first + i]) visit(first + i, T_local_map * block.positions[i]);
    }
  });
}

/// Appends the points inside the box.
void take_within(const Box3& box, const MapTiles::Points& points, MapTiles::Points& taken) {
  for (std::size_t i = 0; i < points.positions.size(); ++i) {
    if (!box.contains(points.positions[i])) continue;
    taken.positions.push_back(points.positions[i]);
    taken.numbers.push_back(points.numbers[i]);
  }
}

MapTiles::Points in_order(const MapTiles::Points& points) {
  std::vector<std::uint32_t> order(points.numbers.size());
  std::iota(order.begin(), order.end(), 0U);
  tbb::parallel_sort(order.begin(), order.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return points.numbers[a] < points.numbers[b]; });
  MapTiles::Points sorted;
  sorted.positions.reserve(order.size());
  sorted.numbers.reserve(order.size());
  for (const std::uint32_t i : order) {
    sorted.positions.push_back(points.positions[i]);
    sorted.numbers.push_back(points.numbers[i]);
  }
  return sorted;
}

}  // namespace

/// A point as the file stores it.
struct MapTiles::Record {
  double position[3];
  std::uint64_t number;
};

/// Collects the records of each tile, and writes them where the tile lies in the file.
class MapTiles::Writer {
 public:
  Writer(std::FILE* file, std::vector<std::size_t> next, std::filesystem::path folder)
      : file_(file), next_(std::move(next)), waiting_(next_.size()), folder_(std::move(folder)) {}

  void add(std::size_t tile, const Record& record) {
    constexpr std::size_t kTogether = 2048;
    waiting_[tile].push_back(record);
    if (waiting_[tile].size() == kTogether) write(tile);
  }
  void finish() {
    for (std::size_t tile = 0; tile < waiting_.size(); ++tile) write(tile);
    if (std::fflush(file_) != 0) throw cannot_write(folder_);
  }

 private:
  void write(std::size_t tile) {
    std::vector<Record>& records = waiting_[tile];
    const bool at_place = fseeko(file_, static_cast<off_t>(next_[tile] * sizeof(Record)), SEEK_SET) == 0;
    if (!at_place || std::fwrite(records.data(), sizeof(Record), records.size(), file_) < records.size())
      throw cannot_write(folder_);
    next_[tile] += records.size();
    records.clear();
  }

  std::FILE* file_;
  std::vector<std::size_t> next_;  ///< record to be written next, of each tile
  std::vector<std::vector<Record>> waiting_;
  std::filesystem::path folder_;
};

MapTiles::MapTiles(const MapPoints& map, const geometry::Sim3& T_local_map, const std::filesystem::path& folder,
                   const Options& options) {
  Box3 box;
  for_each_chosen(map, T_local_map, options.chosen, [&](std::size_t number, const Vec3& p) {
    if (!p.allFinite()) throw InputError("map", "point " + std::to_string(number) + " is not finite");
    box.extend(p);
    ++points_;
  });
  if (points_ == 0) throw InputError("map", "has no points; there is nothing to score");
  const double longest = box.sizes().maxCoeff();
  low_ = box.min();
  cells_a_metre_ = longest > 0.0 ? kCells / longest : 0.0;
  std::vector<std::uint64_t> codes;
  if (points_ > options.most_points) {
    codes.reserve(points_);
    for_each_chosen(map, T_local_map, options.chosen, [&](std::size_t, const Vec3& p) { codes.push_back(code_of(p)); });
    tbb::parallel_sort(codes.begin(), codes.end());
    split(codes, 0, codes.size(), kBitsOfCode, options.most_points);
  } else {
    first_codes_ = {0};
    firsts_ = {0};
  }
  firsts_.push_back(points_);
  bounds_.resize(first_codes_.size());
  codes = {};
  if (bounds_.size() > 1) {
    file_.reset(open_without_name(folder.empty() ? "." : folder));
    store(map, T_local_map, options, folder);
    return;
  }
  for_each_chosen(map, T_local_map, options.chosen, [&](std::size_t number, const Vec3& p) {
    held_.positions.push_back(p);
    held_.numbers.push_back(static_cast<std::uint32_t>(number));
  });
  bounds_[0] = box;
}

std::uint64_t MapTiles::code_of(const Vec3& p) const { return geometry::morton_code(p, low_, cells_a_metre_); }

/// Makes the points [from, to) along the curve, which lie in one cell, a tile, or each of the eight cells in it.
void MapTiles::split(const std::vector<std::uint64_t>& codes, std::size_t from, std::size_t to, int shift,
                     std::size_t most) {
  if (from == to) return;
  if (to - from <= most || shift == 0) {
    first_codes_.push_back(codes[from]);
    firsts_.push_back(from);
    return;
  }
  shift -= 3;
  while (from < to) {
    const std::uint64_t cell = codes[from] >> shift;
    const auto end = std::partition_point(codes.begin() + static_cast<std::ptrdiff_t>(from),
                                          codes.begin() + static_cast<std::ptrdiff_t>(to),
                                          [&](std::uint64_t code) { return code >> shift == cell; });
    const auto next = static_cast<std::size_t>(end - codes.begin());
    split(codes, from, next, shift, most);
    from = next;
  }
}

void MapTiles::store(const MapPoints& map, const geometry::Sim3& T_local_map, const Options& options,
                     const std::filesystem::path& folder) {
  Writer writer(file_.get(), {firsts_.begin(), firsts_.end() - 1}, folder);
  for_each_chosen(map, T_local_map, options.chosen, [&](std::size_t number, const Vec3& p) {
    const auto after = std::upper_bound(first_codes_.begin(), first_codes_.end(), code_of(p));
    const std::size_t tile = static_cast<std::size_t>(after - first_codes_.begin()) - 1;
    bounds_[tile].extend(p);
    writer.add(tile, {{p[0], p[1], p[2]}, number});
  });
  writer.finish();
}

MapTiles::Points MapTiles::read(std::size_t tile) const {
  if (!file_) return held_;
  std::vector<Record> records(firsts_[tile + 1] - firsts_[tile]);
  const bool at_place = fseeko(file_.get(), static_cast<off_t>(firsts_[tile] * sizeof(Record)), SEEK_SET) == 0;
  if (!at_place || std::fread(records.data(), sizeof(Record), records.size(), file_.get()) < records.size())
    throw InputError("map", "its points, stored while it is scored, cannot be read again");
  Points points;
  points.positions.reserve(records.size());
  points.numbers.reserve(records.size());
  for (const Record& r : records) {
    points.positions.emplace_back(r.position[0], r.position[1], r.position[2]);
    points.numbers.push_back(static_cast<std::uint32_t>(r.number));
  }
  return points;
}

MapTiles::Points MapTiles::read_within(const Box3& box) const {
  Points taken;
  std::size_t tiles = 0;
  for (std::size_t tile = 0; tile < size(); ++tile) {
    if (!box.intersects(bounds_[tile])) continue;
    ++tiles;
    if (!file_) {
      take_within(box, held_, taken);
    } else {
      take_within(box, read(tile), taken);
    }
  }
  return tiles > 1 ? in_order(taken) : taken;
}

MapTiles::Points MapTiles::at(const std::vector<Place>& places) const {
  std::vector<std::vector<std::size_t>> in_tile(size());
  for (std::size_t k = 0; k < places.size(); ++k) in_tile[places[k].tile].push_back(k);
  Points found{std::vector<Vec3>(places.size()), std::vector<std::uint32_t>(places.size())};
  for (std::size_t tile = 0; tile < size(); ++tile) {
    if (in_tile[tile].empty()) continue;
    const Points points = read(tile);
    for (const std::size_t k : in_tile[tile]) {
      found.positions[k] = points.positions[places[k].place];
      found.numbers[k] = points.numbers[places[k].place];
    }
  }
  return found;
}

std::vector<MapTiles::Place> MapTiles::all_places() const {
  std::vector<std::pair<std::uint32_t, Place>> numbered;
  for (std::size_t tile = 0; tile < size(); ++tile) {
    const std::vector<std::uint32_t> numbers = read(tile).numbers;
    for (std::size_t i = 0; i < numbers.size(); ++i)
      numbered.push_back({numbers[i], {static_cast<std::uint32_t>(tile), static_cast<std::uint32_t>(i)}});
  }
  std::ranges::sort(numbered, {}, [](const auto& entry) { return entry.first; });
  std::vector<Place> places;
  for (const auto& entry : numbered) places.push_back(entry.second);
  return places;
}

std::vector<MapTiles::Place> MapTiles::sample_evenly(std::size_t count) const {
  if (count >= points_) return all_places();
  const double step = static_cast<double>(points_) / static_cast<double>(count);
  const auto rank = [&](std::size_t k) { return static_cast<std::size_t>((static_cast<double>(k) + 0.5) * step); };
  std::vector<Place> places;
  for (std::size_t tile = 0; tile < size(); ++tile) {
    const std::vector<Vec3> positions = read(tile).positions;
    std::vector<std::pair<std::uint64_t, std::uint32_t>> curve(positions.size());
    tbb::parallel_for(std::size_t{0}, curve.size(), [&](std::size_t i) {
      curve[i] = {code_of(positions[i]), static_cast<std::uint32_t>(i)};
    });
    tbb::parallel_sort(curve.begin(), curve.end());
    while (places.size() < count && rank(places.size()) < firsts_[tile + 1])
      places.push_back({static_cast<std::uint32_t>(tile), curve[rank(places.size()) - firsts_[tile]].second});
  }
  return places;
}

}  // namespace tileflight::scoring
