#include "tileflight/core/alignment/consistent_pairs.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <tuple>

namespace tileflight::alignment {

using geometry::Vec3;

namespace {

struct NearestRow {
  Eigen::Index row = -1;
  float distance = 0.0f;
};

/// For each row of `from`, the nearest row of `to` that is not zero (Euclidean).
std::vector<NearestRow> nearest_rows(const Eigen::MatrixXf& from, const Eigen::MatrixXf& to) {
  const Eigen::VectorXf squares = to.rowwise().squaredNorm();
  constexpr Eigen::Index kBlock = 64;
  std::vector<NearestRow> result(static_cast<std::size_t>(from.rows()));
  tbb::parallel_for(Eigen::Index{0}, (from.rows() + kBlock - 1) / kBlock, [&](Eigen::Index block) {
    const Eigen::Index first = block * kBlock, count = std::min(kBlock, from.rows() - first);
    Eigen::MatrixXf cost = -2.0f * to * from.middleRows(first, count).transpose();
    cost.colwise() += squares;
    for (Eigen::Index c = 0; c < count; ++c) {
      const float own = from.row(first + c).squaredNorm();
      if (!(own > 0.0f)) continue;
      NearestRow& best = result[static_cast<std::size_t>(first + c)];
      for (Eigen::Index r = 0; r < to.rows(); ++r) {
        if (squares[r] > 0.0f && (best.row < 0 || cost(r, c) + own < best.distance)) best = {r, cost(r, c) + own};
      }
    }
  });
  for (NearestRow& best : result) best.distance = std::sqrt(std::max(0.0f, best.distance));
  return result;
}

/// Bit matrix, stored by rows.
class BitMatrix {
 public:
  explicit BitMatrix(std::size_t n) : words_((n + 63) / 64), bits_(n * words_) {}

  void set(std::size_t row, std::size_t column) { bits_[row * words_ + column / 64] |= 1ull << (column % 64); }
  const std::uint64_t* row(std::size_t r) const { return &bits_[r * words_]; }
  std::size_t words() const { return words_; }

 private:
  std::size_t words_;
  std::vector<std::uint64_t> bits_;
};

bool are_consistent(const PutativeMatches& pairs, std::size_t a, std::size_t b, const ConsistencyOptions& options) {
  const Vec3 source = pairs.source[a] - pairs.source[b], target = pairs.target[a] - pairs.target[b];
  const double source_m = source.norm(), target_m = target.norm();
  const double slack_m = options.tolerance_m + options.tolerance_share * std::max(source_m, target_m);
  // Points closer than the tolerance would be consistent with anything.
  if (std::min(source_m, target_m) < 2.0 * options.tolerance_m || std::abs(source_m - target_m) > slack_m) return false;
  if (options.source_up.isZero()) return true;
  const double rise_m = source.dot(options.source_up) - target.dot(options.target_up);
  return std::abs(rise_m) <= options.tolerance_m + std::sin(options.up_tolerance_rad) * source_m;
}

BitMatrix consistency_graph(const PutativeMatches& pairs, const ConsistencyOptions& options) {
  const std::size_t n = pairs.source.size();
  BitMatrix graph(n);
  tbb::parallel_for(std::size_t{0}, n, [&](std::size_t a) {
    for (std::size_t b = 0; b < n; ++b) {
      if (a != b && are_consistent(pairs, a, b, options)) graph.set(a, b);
    }
  });
  return graph;
}

std::size_t count_ones(const std::vector<std::uint64_t>& bits) {
  std::size_t count = 0;
  for (const std::uint64_t word : bits) count += static_cast<std::size_t>(std::popcount(word));
  return count;
}

std::vector<std::uint64_t> intersect(const std::vector<std::uint64_t>& bits, const std::uint64_t* row) {
  std::vector<std::uint64_t> result(bits.size());
  for (std::size_t w = 0; w < bits.size(); ++w) result[w] = bits[w] & row[w];
  return result;
}

std::vector<std::size_t> set_bits(const std::vector<std::uint64_t>& bits) {
  std::vector<std::size_t> list;
  for (std::size_t w = 0; w < bits.size(); ++w) {
    for (std::uint64_t word = bits[w]; word != 0; word &= word - 1)
      list.push_back(64 * w + static_cast<std::size_t>(std::countr_zero(word)));
  }
  return list;
}

/// Grows a clique greedily: repeatedly adds the pair that leaves most candidates; ties go to the lowest index.
std::vector<std::size_t> grow_clique(const BitMatrix& graph, std::size_t first) {
  std::vector<std::size_t> clique = {first};
  std::vector<std::uint64_t> open(graph.row(first), graph.row(first) + graph.words());
  while (count_ones(open) > 0) {
    std::size_t best = 0, most = 0;
    bool any = false;
    for (const std::size_t k : set_bits(open)) {
      const std::size_t left = count_ones(intersect(open, graph.row(k)));
      if (any && left <= most) continue;
      any = true;
      best = k;
      most = left;
    }
    clique.push_back(best);
    open = intersect(open, graph.row(best));
  }
  return clique;
}

}  // namespace

PutativeMatches match_descriptors(const std::vector<Vec3>& source, const Eigen::MatrixXf& source_descriptors,
                                  const std::vector<Vec3>& target, const Eigen::MatrixXf& target_descriptors,
                                  std::size_t most) {
  struct Pair {
    std::size_t source, target;
    float descriptor_distance;
    auto key() const { return std::tie(descriptor_distance, source, target); }
  };
  std::vector<Pair> found;
  const std::vector<NearestRow> forth = nearest_rows(source_descriptors, target_descriptors);
  for (std::size_t i = 0; i < forth.size(); ++i) {
    if (forth[i].row >= 0) found.push_back({i, static_cast<std::size_t>(forth[i].row), forth[i].distance});
  }
  const std::vector<NearestRow> back = nearest_rows(target_descriptors, source_descriptors);
  for (std::size_t j = 0; j < back.size(); ++j) {
    const auto i = static_cast<std::size_t>(std::max<Eigen::Index>(back[j].row, 0));
    const bool known = back[j].row >= 0 && forth[i].row == static_cast<Eigen::Index>(j);
    if (back[j].row >= 0 && !known) found.push_back({i, j, back[j].distance});
  }
  std::ranges::sort(found, {}, &Pair::key);
  if (found.size() > most) found.resize(most);
  PutativeMatches pairs;
  for (const Pair& pair : found) {
    pairs.source.push_back(source[pair.source]);
    pairs.target.push_back(target[pair.target]);
    pairs.descriptor_distance.push_back(pair.descriptor_distance);
  }
  return pairs;
}

std::vector<std::vector<std::size_t>> find_consistent_groups(const PutativeMatches& pairs,
                                                             const ConsistencyOptions& options) {
  const std::size_t n = pairs.source.size();
  const BitMatrix graph = consistency_graph(pairs, options);
  std::vector<std::size_t> degree(n), order(n);
  for (std::size_t k = 0; k < n; ++k) degree[k] = count_ones({graph.row(k), graph.row(k) + graph.words()});
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return degree[a] > degree[b]; });

  constexpr std::size_t kSeeds = 64;
  std::vector<std::vector<std::size_t>> groups(std::min(n, kSeeds));
  tbb::parallel_for(std::size_t{0}, groups.size(), [&](std::size_t k) { groups[k] = grow_clique(graph, order[k]); });
  std::ranges::stable_sort(groups, [](const auto& a, const auto& b) { return a.size() > b.size(); });
  if (groups.size() > options.max_groups) groups.resize(options.max_groups);
  return groups;
}

}  // namespace tileflight::alignment
