#include "tileflight/alignment/constraint.h"

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>

namespace tileflight::alignment {

using geometry::Vec7;

namespace {

constexpr double kWeak = 0.003;
constexpr std::array<const char*, 7> kNames = {"translation along x",
                                               "translation along y",
                                               "translation along z",
                                               "rotation about x",
                                               "rotation about y",
                                               "rotation about z",
                                               "scale"};

/// The motion's largest part in words.
std::string in_words(const Vec7& motion) {
  Eigen::Index largest = 0;
  motion.cwiseAbs().maxCoeff(&largest);
  return kNames[static_cast<std::size_t>(largest)];
}

/// The motions that lie for the most part in the span of the open directions. Each direction for itself says little: of
/// equally weak ones, the eigenvectors are any mixture.
std::string open_in_words(const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>& eigen) {
  const Eigen::Index open = (eigen.eigenvalues().array() < kWeak).count();
  const Eigen::VectorXd share = eigen.eigenvectors().leftCols(open).rowwise().squaredNorm();
  std::string words;
  for (Eigen::Index i = 0; i < share.size(); ++i) {
    if (share[i] < 0.5) continue;
    words += (words.empty() ? "" : ", ") + std::string(kNames[static_cast<std::size_t>(i)]);
  }
  return words;
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
  result.well_constrained = result.strengths[0] >= kWeak;
  result.weakest_motion = open_in_words(eigen);
  if (result.weakest_motion.empty()) result.weakest_motion = in_words(result.weakest);
  return result;
}

}  // namespace tileflight::alignment
