#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "tileflight/geometry/transform.h"

// Bootstrap over places, for two maps of one place. Errors of neighbours are alike, over tens of metres where a camera
// flew higher or saw less; so what is drawn is not points but blocks: columns over squares of the ground, each with
// what both maps have there, so that what is hard to map is hard for both. A block that one map alone reaches adds to
// that one alone. Kuensch, Annals of Statistics 17, 1989; Efron and Tibshirani, An Introduction to the Bootstrap, 1993.

namespace tileflight::evaluation {

/// A cut of the ground into squares.
struct PlaceBlocks {
  double east_m = 0, north_m = 0;  ///< a corner of the squares
  double edge_m = 0;
  /// Of the map that has fewer: how many blocks of equal weight tell as much, (sum w)^2 / sum w^2 (Kish 1965).
  double effective = 0;
};

/// The largest squares that leave each of two sets of points at least `wanted` effective blocks; the smallest that were
/// tried where none do. Nullopt where a set is empty or all points are in one place.
std::optional<PlaceBlocks> place_blocks(const std::vector<geometry::Vec3>& a, const std::vector<geometry::Vec3>& b,
                                        double wanted);

/// Which blocks the points of two sets lie in, blocks and quarters of them (squares of half the edge) in order of their
/// place.
struct BlockNumbers {
  std::array<std::vector<std::uint32_t>, 2> quarter_of;  ///< of each point: set, point
  std::vector<std::uint32_t> block_of;                   ///< of each quarter
  std::size_t blocks = 0;
  std::array<std::size_t, 2> alone{};  ///< blocks that only the one, only the other set reaches
};
BlockNumbers block_numbers(const PlaceBlocks& blocks, const std::vector<geometry::Vec3>& a,
                           const std::vector<geometry::Vec3>& b);

/// A number from sums over blocks, such as a ratio of two of them; NaN where it is none.
using BlockStatistic = std::function<double(const Eigen::RowVectorXd& sums)>;

/// What a number of two maps would have been, had the place consisted of other blocks like these.
class PlaceBootstrap {
 public:
  /// `quarters`: sums over the quarters of the blocks, a row each, columns as the statistics read them. The same seed
  /// gives the same draws on any number of threads.
  PlaceBootstrap(const PlaceBlocks& blocks, const BlockNumbers& numbers, const Eigen::MatrixXd& quarters, int resamples,
                 std::uint64_t seed);

  /// Of the place as it is.
  double value(const BlockStatistic& statistic) const { return statistic(total_); }

  /// Standard error of the value. Blocks still hang together along their edges, which makes their spread too small by
  /// about c / edge; a spread from quarters lacks twice as much, so that 2 V(blocks) - V(quarters) lacks neither
  /// (Richardson's extrapolation). Never below either. NaN where too few draws have the number.
  double standard_error(const BlockStatistic& statistic) const;

  /// How often two maps of one kind would differ at least as much, either way: each block's difference is the one's or
  /// the other's by an even chance, drawn as often as the bootstrap (Fisher, The Design of Experiments, 1935, 21).
  /// Summed are square roots, so that one block with much does not hide that the others agree. It says nothing of other
  /// places: it takes the surface as it is, and asks only whose the difference is.
  double exchange_p(const std::function<Eigen::VectorXd(const Eigen::MatrixXd& blocks)>& differences) const;

  /// For Student's t.
  double degrees_of_freedom() const { return effective_ - 1.0; }

 private:
  Eigen::RowVectorXd total_;
  Eigen::MatrixXd blocks_;  ///< [block][column]
  std::uint64_t seed_ = 0;
  Eigen::MatrixXd of_blocks_, of_quarters_;  ///< [draw][column], sums over the drawn
  double effective_ = 0;
};

}  // namespace tileflight::evaluation
