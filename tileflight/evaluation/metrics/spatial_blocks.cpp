#include "tileflight/evaluation/metrics/spatial_blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "tileflight/core/base/random_numbers.h"

namespace tileflight::metrics {

using geometry::Vec3;

namespace {

/// A grid square by its indices along east and north.
struct Square {
  std::int64_t east = 0, north = 0;
  friend auto operator<=>(const Square&, const Square&) = default;
};

struct SquareHash {
  std::size_t operator()(const Square& s) const {
    return static_cast<std::size_t>(base::SplitMix64(static_cast<std::uint64_t>(s.east) * 0x9e3779b97f4a7c15ull +
                                                     static_cast<std::uint64_t>(s.north))
                                        .next());
  }
};

template <class Value>
using BySquare = std::unordered_map<Square, Value, SquareHash>;

Square square_of(const Vec3& p, double east_m, double north_m, double edge_m) {
  return {static_cast<std::int64_t>(std::floor((p.x() - east_m) / edge_m)),
          static_cast<std::int64_t>(std::floor((p.y() - north_m) / edge_m))};
}

/// Extent of most of the points, without outliers.
struct Extent {
  double low = 0, high = 0;
  double length() const { return high - low; }
};

Extent extent_along(int axis, const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  constexpr std::size_t kMost = 20000;
  std::vector<double> values;
  for (const auto* points : {&a, &b}) {
    const std::size_t step = std::max<std::size_t>(1, points->size() / kMost);
    for (std::size_t i = 0; i < points->size(); i += step) values.push_back((*points)[i][axis]);
  }
  std::sort(values.begin(), values.end());
  const std::size_t outside = values.size() / 100;
  return {values[outside], values[values.size() - 1 - outside]};
}

/// Number of points of each set in small squares, which are merged to larger ones.
using SquareCounts = BySquare<std::array<double, 2>>;

SquareCounts counted(const std::vector<Vec3>& a, const std::vector<Vec3>& b, const BlockGrid& fine) {
  SquareCounts counts;
  std::size_t set = 0;
  for (const auto* points : {&a, &b}) {
    for (const Vec3& p : *points) counts[square_of(p, fine.east_m, fine.north_m, fine.edge_m)][set] += 1.0;
    ++set;
  }
  return counts;
}

/// Effective number of blocks, of the set that has fewer.
double effective_blocks(const SquareCounts& fine, double fine_edge_m, double edge_m) {
  BySquare<std::array<double, 2>> blocks;
  for (const auto& [square, count] : fine) {
    const auto along = [&](std::int64_t number) {
      return static_cast<std::int64_t>(std::floor((static_cast<double>(number) + 0.5) * fine_edge_m / edge_m));
    };
    std::array<double, 2>& block = blocks[{along(square.east), along(square.north)}];
    for (std::size_t set = 0; set < 2; ++set) block[set] += count[set];
  }
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t set = 0; set < 2; ++set) {
    double sum = 0.0, squares = 0.0;
    for (const auto& [square, block] : blocks) {
      sum += block[set];
      squares += block[set] * block[set];
    }
    least = std::min(least, sum * sum / squares);
  }
  return least;
}

/// Bootstrap sums: each draw takes as many rows as there are, with replacement.
Eigen::MatrixXd resampled(const Eigen::MatrixXd& rows, int resamples, std::uint64_t seed) {
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(resamples, rows.rows());
  base::SplitMix64 random(seed);
  const auto count = static_cast<std::size_t>(rows.rows());
  for (Eigen::Index draw = 0; draw < resamples; ++draw) {
    for (std::size_t k = 0; k < count; ++k) weights(draw, static_cast<Eigen::Index>(random.below(count))) += 1.0;
  }
  return weights * rows;
}

/// Variance over the draws; NaN if more than a few of them have no value.
double variance_of(const Eigen::MatrixXd& draws, const BlockStatistic& statistic) {
  std::vector<double> values;
  for (Eigen::Index draw = 0; draw < draws.rows(); ++draw) {
    const double value = statistic(draws.row(draw));
    if (std::isfinite(value)) values.push_back(value);
  }
  if (static_cast<double>(values.size()) < 0.95 * static_cast<double>(draws.rows()) || values.size() < 2)
    return std::numeric_limits<double>::quiet_NaN();
  double mean = 0.0, squares = 0.0;
  for (const double v : values) mean += v;
  mean /= static_cast<double>(values.size());
  for (const double v : values) squares += (v - mean) * (v - mean);
  return squares / static_cast<double>(values.size() - 1);
}

}  // namespace

std::optional<BlockGrid> choose_block_grid(const std::vector<Vec3>& a, const std::vector<Vec3>& b, double wanted) {
  constexpr double kFineAnEdge = 512.0, kFinestBlock = 4.0;  // fine squares along the longer extent; smallest block in
                                                             // fine squares
  const double kSmaller = std::pow(2.0, -0.25);
  if (a.empty() || b.empty()) return std::nullopt;
  const Extent east = extent_along(0, a, b), north = extent_along(1, a, b);
  const double longest_m = std::max(east.length(), north.length());
  if (!(longest_m > 0.0)) return std::nullopt;
  BlockGrid blocks{.east_m = east.low, .north_m = north.low, .edge_m = longest_m / kFineAnEdge};
  const double fine_m = blocks.edge_m;
  const SquareCounts fine = counted(a, b, blocks);
  for (double edge_m = longest_m; edge_m >= kFinestBlock * fine_m; edge_m *= kSmaller) {
    blocks.edge_m = edge_m;
    blocks.effective = effective_blocks(fine, fine_m, edge_m);
    if (blocks.effective >= wanted) break;
  }
  return blocks;
}

BlockAssignment assign_blocks(const BlockGrid& blocks, const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  const double half_m = 0.5 * blocks.edge_m;
  BySquare<std::array<std::uint32_t, 2>> found;  // index in order of appearance, and the sets that reach it
  BlockAssignment numbers;
  std::size_t set = 0;
  for (const auto* points : {&a, &b}) {
    numbers.quarter_of[set].reserve(points->size());
    for (const Vec3& p : *points) {
      const auto met = static_cast<std::uint32_t>(found.size());
      auto& quarter =
          found.try_emplace(square_of(p, blocks.east_m, blocks.north_m, half_m), std::array{met, 0U}).first->second;
      quarter[1] |= 1U << set;
      numbers.quarter_of[set].push_back(quarter[0]);
    }
    ++set;
  }
  std::vector<std::pair<Square, std::array<std::uint32_t, 2>>> quarters(found.begin(), found.end());
  const auto block_of = [](const Square& s) { return Square{s.east >> 1, s.north >> 1}; };
  std::sort(quarters.begin(), quarters.end(), [&](const auto& x, const auto& y) {
    return std::pair(block_of(x.first), x.first) < std::pair(block_of(y.first), y.first);
  });
  std::vector<std::uint32_t> place_of_met(quarters.size()), reached;
  for (std::size_t q = 0; q < quarters.size(); ++q) {
    place_of_met[quarters[q].second[0]] = static_cast<std::uint32_t>(q);
    if (q == 0 || block_of(quarters[q].first) != block_of(quarters[q - 1].first)) reached.push_back(0);
    reached.back() |= quarters[q].second[1];
    numbers.block_of.push_back(static_cast<std::uint32_t>(reached.size() - 1));
  }
  for (auto& list : numbers.quarter_of)
    for (std::uint32_t& quarter : list) quarter = place_of_met[quarter];
  numbers.blocks = reached.size();
  for (std::size_t s = 0; s < 2; ++s)
    numbers.exclusive[s] = static_cast<std::size_t>(std::count(reached.begin(), reached.end(), 1U << s));
  return numbers;
}

BlockBootstrap::BlockBootstrap(const BlockGrid& blocks, const BlockAssignment& numbers, const Eigen::MatrixXd& quarters,
                               int resamples, std::uint64_t seed)
    : total_(quarters.colwise().sum()), seed_(seed), effective_(blocks.effective) {
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(numbers.blocks), quarters.cols());
  for (Eigen::Index q = 0; q < quarters.rows(); ++q)
    whole.row(numbers.block_of[static_cast<std::size_t>(q)]) += quarters.row(q);
  of_blocks_ = resampled(whole, resamples, seed);
  of_quarters_ = resampled(quarters, resamples, seed + 1);
  blocks_ = std::move(whole);
}

double BlockBootstrap::exchange_p(
    const std::function<Eigen::VectorXd(const Eigen::MatrixXd& blocks)>& differences) const {
  const Eigen::VectorXd difference =
      differences(blocks_).unaryExpr([](double d) { return std::copysign(std::sqrt(std::abs(d)), d); });
  const double found = std::abs(difference.sum()) * (1.0 - 1e-12);
  base::SplitMix64 random(seed_ + 2);
  double as_far = 0.0;
  for (Eigen::Index draw = 0; draw < of_blocks_.rows(); ++draw) {
    double sum = 0.0;
    for (const double d : difference) sum += random.below(2) == 0 ? d : -d;
    as_far += std::abs(sum) >= found;
  }
  return (1.0 + as_far) / (1.0 + static_cast<double>(of_blocks_.rows()));
}

double BlockBootstrap::standard_error(const BlockStatistic& statistic) const {
  const double of_blocks = variance_of(of_blocks_, statistic), of_quarters = variance_of(of_quarters_, statistic);
  const double variance = std::max({of_blocks, of_quarters, 2.0 * of_blocks - of_quarters});
  if (!std::isfinite(of_blocks) || !std::isfinite(of_quarters) || !(effective_ > 1.0))
    return std::numeric_limits<double>::quiet_NaN();
  // The variance of draws is smaller than that of the blocks by (n - 1) / n.
  return std::sqrt(variance * effective_ / (effective_ - 1.0));
}

}  // namespace tileflight::metrics
