#include "tileflight/core/alignment/constraint.h"

#include <array>
#include <cmath>

#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::alignment {

using geometry::Vec7;

namespace {

constexpr double kMinEigenvalue = 0.003;
constexpr std::array<const char*, 7> kNames = {"translation along x",
                                               "translation along y",
                                               "translation along z",
                                               "rotation about x",
                                               "rotation about y",
                                               "rotation about z",
                                               "scale"};

/// Name of the motion's largest component.
std::string motion_name(const Vec7& motion) {
  Eigen::Index largest = 0;
  motion.cwiseAbs().maxCoeff(&largest);
  return kNames[static_cast<std::size_t>(largest)];
}

/// Names of the basic motions that lie mostly in the span of the unconstrained directions. The eigenvectors themselves
/// are not used, since for equal eigenvalues they are an arbitrary mixture.
std::string open_motion_names(const geometry::SymmetricEigen& eigen) {
  const Eigen::Index open = (eigen.values.array() < kMinEigenvalue).count();
  const Eigen::VectorXd share = eigen.vectors.leftCols(open).rowwise().squaredNorm();
  std::string words;
  for (Eigen::Index i = 0; i < share.size(); ++i) {
    if (share[i] < 0.5) continue;
    words += (words.empty() ? "" : ", ") + std::string(kNames[static_cast<std::size_t>(i)]);
  }
  return words;
}

}  // namespace

Constraint analyze_constraint(const PointToPlaneSystem& system, std::size_t points, bool with_scale) {
  Constraint result;
  result.well_constrained = false;
  if (points == 0) return result;
  const Eigen::Index unknowns = with_scale ? 7 : 6;
  const Eigen::MatrixXd mean = system.hessian.topLeftCorner(unknowns, unknowns) / static_cast<double>(points);
  const geometry::SymmetricEigen eigen = geometry::symmetric_eigen(mean);
  result.eigenvalues.assign(eigen.values.begin(), eigen.values.end());
  result.weakest_direction.head(unknowns) = eigen.vectors.col(0);
  result.well_constrained = result.eigenvalues[0] >= kMinEigenvalue;
  result.weakest_motion = open_motion_names(eigen);
  if (result.weakest_motion.empty()) result.weakest_motion = motion_name(result.weakest_direction);
  return result;
}

}  // namespace tileflight::alignment
