#include "tileflight/core/alignment/anderson.h"

#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::alignment {

using geometry::Vec7;

Vec7 AndersonAcceleration::next(const Vec7& x, const Vec7& g) {
  history_.push_back({g, g - x});
  if (history_.size() > kWindow + 1) history_.pop_front();
  const auto columns = static_cast<Eigen::Index>(history_.size()) - 1;
  if (columns == 0) return g;

  Eigen::Matrix<double, 7, Eigen::Dynamic> residual_steps(7, columns), g_steps(7, columns);
  for (Eigen::Index k = 0; k < columns; ++k) {
    const Entry& older = history_[static_cast<std::size_t>(k)];
    const Entry& newer = history_[static_cast<std::size_t>(k) + 1];
    residual_steps.col(k) = newer.residual - older.residual;
    g_steps.col(k) = newer.g - older.g;
  }
  const Eigen::VectorXd gamma = geometry::solve_with_least_norm(residual_steps, history_.back().residual);
  if (!gamma.allFinite()) return g;
  return g - g_steps * gamma;
}

void AndersonAcceleration::reset() { history_.clear(); }

}  // namespace tileflight::alignment
