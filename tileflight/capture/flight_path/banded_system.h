#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <vector>

namespace tileflight::flight_path {

/// Symmetric positive definite linear system A x = b of B by B blocks with R right-hand sides. Blocks more than three
/// off the diagonal are zero, as for cubic B-splines. Only blocks on and above the diagonal are stored.
template <int B, int R>
class BandedSystem {
 public:
  using Block = Eigen::Matrix<double, B, B>;
  using Right = Eigen::Matrix<double, B, R>;

  explicit BandedSystem(std::size_t blocks) : rows_(blocks, filled_row()), right_(blocks, Right::Zero()) {}

  std::size_t size() const { return rows_.size(); }
  /// Adds to the block in row i, column i + k, with k from 0 to 3.
  void add(std::size_t i, std::size_t k, const Block& block) { rows_[i][k] += block; }
  const Block& diagonal(std::size_t i) const { return rows_[i][0]; }
  void add_right(std::size_t i, const Right& right) { right_[i] += right; }

  /// Gaussian elimination by blocks (Golub and Van Loan, Matrix Computations, 4.3.5 and 4.5.1).
  std::vector<Right> solve() && {
    const std::size_t n = size();
    std::vector<Block> inverse(n);
    for (std::size_t i = 0; i < n; ++i) {
      inverse[i] = rows_[i][0].inverse();
      for (std::size_t k = 1; k < 4 && i + k < n; ++k) {
        const Block factor = rows_[i][k].transpose() * inverse[i];
        for (std::size_t l = k; l < 4 && i + l < n; ++l) rows_[i + k][l - k] -= factor * rows_[i][l];
        right_[i + k] -= factor * right_[i];
      }
    }
    for (std::size_t i = n; i-- > 0;) {
      for (std::size_t k = 1; k < 4 && i + k < n; ++k) right_[i] -= rows_[i][k] * right_[i + k];
      right_[i] = (inverse[i] * right_[i]).eval();
    }
    return std::move(right_);
  }

 private:
  using Row = std::array<Block, 4>;

  static Row filled_row() {
    Row row;
    row.fill(Block::Zero());
    return row;
  }

  std::vector<Row> rows_;
  std::vector<Right> right_;
};

}  // namespace tileflight::flight_path
