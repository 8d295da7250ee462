#include "tileflight/tiles/tile_writer/cell_tree.h"

#include <tbb/parallel_invoke.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cassert>
#include <limits>
#include <numeric>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::tile_writer {

using geometry::Vec3;

struct CellTree::Items {
  const std::vector<Vec3>& places;
  const std::vector<float>& weights;
  std::vector<std::uint32_t>& order;
  std::size_t first_node;                            ///< first node of the cells to split into
  std::vector<std::vector<std::uint32_t>>& members;  ///< items of these cells
};

CellTree::CellTree(const std::vector<Vec3>& places, const std::vector<float>& weights, int depth) : CellTree(depth) {
  leaves_ = split(0, 0, depth, places, weights);
}

CellTree::CellTree(int depth) {
  assert(depth >= 0 && depth <= 12);
  splits_.resize(std::size_t{1} << (2 * depth));
}

std::vector<std::vector<std::uint32_t>> CellTree::split(std::uint32_t cell, int level, int to_level,
                                                        const std::vector<Vec3>& places,
                                                        const std::vector<float>& weights) {
  assert(places.size() == weights.size() && level <= to_level);
  std::vector<std::vector<std::uint32_t>> members(std::size_t{1} << (2 * (to_level - level)));
  std::vector<std::uint32_t> order(places.size());
  std::iota(order.begin(), order.end(), 0U);
  const std::size_t node = (std::size_t{1} << (2 * level)) + cell;
  split({places, weights, order, node << (2 * (to_level - level)), members}, 0, order.size(), node);
  return members;
}

void CellTree::split(const Items& items, std::size_t begin, std::size_t end, std::size_t node) {
  const auto first = items.order.begin() + static_cast<std::ptrdiff_t>(begin);
  const auto last = items.order.begin() + static_cast<std::ptrdiff_t>(end);
  if (node >= items.first_node) {
    std::vector<std::uint32_t>& leaf = items.members[node - items.first_node];
    leaf.assign(first, last);
    std::sort(leaf.begin(), leaf.end());
    return;
  }
  geometry::Box3 box;
  double weight = 0;
  for (auto it = first; it != last; ++it) box.extend(items.places[*it]);
  Eigen::Index axis = 0;
  if (begin < end) box.sizes().maxCoeff(&axis);
  const auto place = [&](std::uint32_t item) { return items.places[item][axis]; };
  tbb::parallel_sort(first, last, [&](std::uint32_t a, std::uint32_t b) {
    return place(a) != place(b) ? place(a) < place(b) : a < b;
  });
  for (auto it = first; it != last; ++it) weight += static_cast<double>(items.weights[*it]);
  std::size_t middle = begin;
  for (double sum = 0; middle < end && sum < weight / 2; ++middle)
    sum += static_cast<double>(items.weights[items.order[middle]]);
  splits_[node] = {static_cast<int>(axis),
                   middle < end ? place(items.order[middle]) : std::numeric_limits<double>::infinity()};
  tbb::parallel_invoke([&] { split(items, begin, middle, 2 * node); },
                       [&] { split(items, middle, end, 2 * node + 1); });
}

std::uint32_t CellTree::cell_of(const Vec3& place, int level, std::uint32_t from, int from_level) const {
  std::size_t node = (std::size_t{1} << (2 * from_level)) + from;
  for (int i = 2 * from_level; i < 2 * level; ++i)
    node = 2 * node + (place[splits_[node].axis] < splits_[node].value ? 0 : 1);
  return static_cast<std::uint32_t>(node - (std::size_t{1} << (2 * level)));
}

}  // namespace tileflight::tile_writer
