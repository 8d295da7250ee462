#include "tileflight/core/alignment/plane_system.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::alignment {
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec6;
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

/// Solves with slight damping, so that unconstrained directions do not move.
template <int N>
Eigen::Matrix<double, N, 1> damped_solve(const Eigen::Matrix<double, N, N>& a, const Eigen::Matrix<double, N, 1>& b) {
  const double damping = 1e-9 * a.trace() / N;
  const Eigen::Matrix<double, N, N> damped = a + damping * Eigen::Matrix<double, N, N>::Identity();
  return geometry::solve_symmetric(damped, b);
}

/// Rigid motion for a given stretch (in metres, as the unknowns are).
Vec7 solve_with_stretch(const PointToPlaneSystem& system, double stretch_m) {
  const Eigen::Matrix<double, 6, 6> rigid = system.hessian.topLeftCorner<6, 6>();
  const Vec6 right = -system.gradient.head<6>() - system.hessian.topRightCorner<6, 1>() * stretch_m;
  Vec7 x;
  x << damped_solve<6>(rigid, right), stretch_m;
  return x;
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

Vec7 plane_jacobian(const Vec3& y, const Vec3& normal, double length_m) {
  Vec7 jacobian;
  jacobian << normal, y.cross(normal) / length_m, y.dot(normal) / length_m;
  return jacobian;
}

void PointToPlaneSystem::add(const Vec3& y, const Vec3& q, const Vec3& normal, double length_m, double weight) {
  const Vec7 jacobian = plane_jacobian(y, normal, length_m);
  hessian.noalias() += (weight * jacobian) * jacobian.transpose();
  gradient += jacobian * (weight * normal.dot(y - q));
}

void PointToPlaneSystem::add(const Vec3& y, const Vec3& q, const geometry::Mat3& information, double length_m,
                             double weight) {
  Eigen::Matrix<double, 7, 3> jacobian;
  for (int axis = 0; axis < 3; ++axis) jacobian.col(axis) = plane_jacobian(y, Vec3::Unit(axis), length_m);
  const Eigen::Matrix<double, 7, 3> weighted = weight * jacobian * information;
  hessian.noalias() += weighted * jacobian.transpose();
  gradient += weighted * (y - q);
}

PointToPlaneSystem& PointToPlaneSystem::operator+=(const PointToPlaneSystem& other) {
  hessian += other.hessian;
  gradient += other.gradient;
  return *this;
}

Sim3 solve(const PointToPlaneSystem& system, const ScaleRange& range, double length_m) {
  if (!(system.hessian.trace() > 0.0)) return {};
  Vec7 x = damped_solve<7>(system.hessian, -system.gradient);
  const double least = std::log(range.min) * length_m;
  const double most = std::log(range.max) * length_m;
  if (x[6] < least || x[6] > most) x = solve_with_stretch(system, std::clamp(x[6], least, most));
  return {std::exp(x[6] / length_m), geometry::so3_exp(x.segment<3>(3) / length_m), x.head<3>()};
}

}  // namespace tileflight::alignment
