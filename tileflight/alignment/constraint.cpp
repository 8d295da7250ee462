#include "tileflight/alignment/constraint.h"

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>

namespace tileflight::alignment {

using geometry::Vec7;

namespace {

/// The motion's largest part in words.
std::string in_words(const Vec7& motion) {
  static constexpr std::array<const char*, 7> kNames = {"translation along x",
                                                        "translation along y",
                                                        "translation along z",
                                                        "rotation about x",
                                                        "rotation about y",
                                                        "rotation about z",
                                                        "scale"};
  Eigen::Index largest = 0;
  motion.cwiseAbs().maxCoeff(&largest);
  return kNames[static_cast<std::size_t>(largest)];
}

}  // namespace

Constraint constraint_of(const PlaneSystem& system, std::size_t points, bool with_scale) {
  Constraint result;
  result.well_constrained = false;
  if (points == 0) return result;
  const Eigen::Index unknowns = with_scale ? 7 : 6;
  const Eigen::MatrixXd mean = system.hessian.topLeftCorner(unknowns, unknowns) / static_cast<double>(points);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(mean);
  result.strengths.assign(eigen.eigenvalues().begin(), eigen.eigenvalues().end());
  result.weakest.head(unknowns) = eigen.eigenvectors().col(0);
  result.weakest_motion = in_words(result.weakest);
  constexpr double kWeak = 0.003;
  result.well_constrained = result.strengths[0] >= kWeak;
  return result;
}

}  // namespace tileflight::alignment
