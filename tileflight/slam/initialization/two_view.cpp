#include "tileflight/slam/initialization/two_view.h"

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::initialization {
namespace {

using Eigen::MatrixXd;
using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

// ---- polynomials of degree three in x, y, z: coefficients by monomial ----

constexpr std::array<std::array<int, 3>, 20> kMonomials{
    {{3, 0, 0}, {2, 1, 0}, {1, 2, 0}, {0, 3, 0}, {2, 0, 1}, {1, 1, 1}, {0, 2, 1}, {1, 0, 2}, {0, 1, 2}, {0, 0, 3},
     {2, 0, 0}, {1, 1, 0}, {0, 2, 0}, {1, 0, 1}, {0, 1, 1}, {0, 0, 2}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}};
using Polynomial = Eigen::Matrix<double, 20, 1>;

int monomial_index(int x, int y, int z) {
  for (int i = 0; i < 20; ++i) {
    if (kMonomials[i] == std::array<int, 3>{x, y, z}) return i;
  }
  return -1;
}

std::array<std::array<int, 20>, 20> make_product_table() {
  std::array<std::array<int, 20>, 20> table{};
  for (int i = 0; i < 20; ++i) {
    for (int j = 0; j < 20; ++j) {
      table[i][j] = monomial_index(kMonomials[i][0] + kMonomials[j][0], kMonomials[i][1] + kMonomials[j][1],
                                   kMonomials[i][2] + kMonomials[j][2]);
    }
  }
  return table;
}

Polynomial multiply(const Polynomial& a, const Polynomial& b) {
  static const auto kTable = make_product_table();
  Polynomial out = Polynomial::Zero();
  for (int i = 0; i < 20; ++i) {
    if (a[i] == 0.0) continue;
    for (int j = 0; j < 20; ++j) {
      if (b[j] != 0.0) out[kTable[i][j]] += a[i] * b[j];
    }
  }
  return out;
}

using PolynomialMatrix = std::array<std::array<Polynomial, 3>, 3>;

/// E = x X + y Y + z Z + W over the null space of the five epipolar equations.
PolynomialMatrix null_space_matrix(const MatrixXd& basis) {
  PolynomialMatrix E;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      E[r][c].setZero();
      for (int k = 0; k < 4; ++k) E[r][c][16 + k] = basis(3 * r + c, k);
    }
  }
  return E;
}

/// det E = 0 and 2 E E^T E - trace(E E^T) E = 0.
MatrixXd essential_constraints(const PolynomialMatrix& E) {
  MatrixXd A(10, 20);
  const auto minor = [&](int c0, int c1) {
    return Polynomial(multiply(E[1][c0], E[2][c1]) - multiply(E[1][c1], E[2][c0]));
  };
  A.row(0) =
      (multiply(minor(1, 2), E[0][0]) - multiply(minor(0, 2), E[0][1]) + multiply(minor(0, 1), E[0][2])).transpose();
  PolynomialMatrix EEt;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      EEt[r][c] = multiply(E[r][0], E[c][0]) + multiply(E[r][1], E[c][1]) + multiply(E[r][2], E[c][2]);
    }
  }
  const Polynomial trace = EEt[0][0] + EEt[1][1] + EEt[2][2];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      Polynomial sum = -multiply(trace, E[r][c]);
      for (int k = 0; k < 3; ++k) sum += 2.0 * multiply(EEt[r][k], E[k][c]);
      A.row(1 + 3 * r + c) = sum.transpose();
    }
  }
  return A;
}

bool is_in_front(const SE3& T, const RayPair& pair) {
  const Vec3 ra = T.rotation * pair.a;
  // Signs of lambda_a, lambda_b of lambda_b x_b - lambda_a R x_a = t in least squares.
  const double c = ra.dot(pair.b), det = 1.0 - c * c;
  if (det < 1e-12) return true;
  const double ta = -ra.dot(T.translation), tb = pair.b.dot(T.translation);
  return (ta + c * tb) > 0 && (tb + c * ta) > 0;
}

int count_in_front(const SE3& T, const std::vector<RayPair>& pairs) {
  return static_cast<int>(
      std::count_if(pairs.begin(), pairs.end(), [&](const RayPair& p) { return is_in_front(T, p); }));
}

double homography_distance_rad(const Mat3& H, const RayPair& pair) {
  const Vec3 mapped = H * pair.a;
  return std::atan2(mapped.cross(pair.b).norm(), mapped.dot(pair.b));
}

/// Truncated sum of squares (MSAC, Torr and Zisserman 2000): lower is better.
template <class Distance>
double truncated_cost(const std::vector<RayPair>& pairs, double threshold, const Distance& distance) {
  double cost = 0;
  for (const RayPair& pair : pairs) {
    const double d = distance(pair) / threshold;
    cost += std::min(1.0, d * d);
  }
  return cost;
}

std::vector<RayPair> draw_sample(const std::vector<RayPair>& pairs, int count, std::mt19937& random) {
  std::vector<std::size_t> chosen;
  while (static_cast<int>(chosen.size()) < count) {
    const std::size_t i = random() % pairs.size();
    if (std::find(chosen.begin(), chosen.end(), i) == chosen.end()) chosen.push_back(i);
  }
  std::vector<RayPair> out;
  for (const std::size_t i : chosen) out.push_back(pairs[i]);
  return out;
}

bool are_similar(const SE3& a, const SE3& b) {
  constexpr double kAngle_rad = 0.03;
  const double rotation = geometry::so3_log(a.rotation.conjugate() * b.rotation).norm();
  return rotation < kAngle_rad && a.translation.dot(b.translation) > std::cos(4 * kAngle_rad);
}

void add_if_new(const SE3& pose, std::vector<SE3>& poses) {
  const bool known = std::any_of(poses.begin(), poses.end(), [&](const SE3& p) { return are_similar(p, pose); });
  if (!known) poses.push_back(pose);
}

std::vector<SE3> essential_candidates(const std::vector<RayPair>& pairs, double threshold, std::mt19937& random) {
  constexpr int kSamples = 250;
  constexpr std::size_t kKept = 3;
  struct Scored {
    double cost;
    Mat3 E;
  };
  std::vector<Scored> scored;
  for (int i = 0; i < kSamples; ++i) {
    for (const Mat3& E : solve_five_point(draw_sample(pairs, 5, random))) {
      scored.push_back(
          {truncated_cost(pairs, threshold, [&](const RayPair& p) { return epipolar_distance_rad(E, p); }), E});
    }
  }
  std::stable_sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) { return a.cost < b.cost; });
  std::vector<SE3> poses;
  constexpr std::size_t kTried = 40;
  for (std::size_t i = 0; i < std::min(kTried, scored.size()) && poses.size() < kKept; ++i) {
    add_if_new(pose_from_essential(scored[i].E, pairs), poses);
  }
  return poses;
}

std::vector<SE3> homography_candidates(const std::vector<RayPair>& pairs, double threshold, std::mt19937& random) {
  constexpr int kSamples = 200;
  constexpr std::size_t kMinInliers = 8;
  const auto inliers_of = [&](const Mat3& H) {
    std::vector<RayPair> inliers;
    for (const RayPair& p : pairs) {
      if (homography_distance_rad(H, p) < threshold) inliers.push_back(p);
    }
    return inliers;
  };
  double best_cost = std::numeric_limits<double>::infinity();
  Mat3 best = Mat3::Identity();
  for (int i = 0; i < kSamples; ++i) {
    const Mat3 H = fit_homography(draw_sample(pairs, 4, random));
    const double cost =
        truncated_cost(pairs, threshold, [&](const RayPair& p) { return homography_distance_rad(H, p); });
    if (cost < best_cost) best_cost = cost, best = H;
  }
  std::vector<RayPair> inliers = inliers_of(best);
  for (int i = 0; i < 3 && inliers.size() >= kMinInliers; ++i) {
    best = fit_homography(inliers);
    inliers = inliers_of(best);
  }
  if (inliers.size() < kMinInliers) return {};
  return poses_from_homography(best, inliers);
}

}  // namespace

std::vector<Mat3> solve_five_point(const std::vector<RayPair>& pairs) {
  // Dynamic-size matrices avoid the code size of unrolled fixed-size ones.
  MatrixXd At(9, 5);
  for (int i = 0; i < 5; ++i) {
    for (int r = 0; r < 3; ++r) At.block<3, 1>(3 * r, i) = pairs[i].b[r] * pairs[i].a;
  }
  const MatrixXd Q = MatrixXd(Eigen::HouseholderQR<MatrixXd>(At).householderQ());
  const MatrixXd basis = Q.rightCols(4);
  const MatrixXd C = essential_constraints(null_space_matrix(basis));
  const MatrixXd B = C.leftCols(10).partialPivLu().solve(C.rightCols(10));
  // Multiplication by x in the basis x^2 xy y^2 xz yz z^2 x y z 1 of the quotient ring.
  MatrixXd M = MatrixXd::Zero(10, 10);
  const std::array<int, 6> reduced{0, 1, 2, 4, 5, 7};
  for (int i = 0; i < 6; ++i) M.row(i) = -B.row(reduced[i]);
  M(6, 0) = M(7, 1) = M(8, 3) = M(9, 6) = 1.0;
  if (!M.allFinite()) return {};
  const Eigen::EigenSolver<MatrixXd> eigen(M);
  const Eigen::MatrixXcd vectors = eigen.eigenvectors();
  std::vector<Mat3> solutions;
  for (int i = 0; i < 10; ++i) {
    if (std::abs(eigen.eigenvalues()[i].imag()) > 1e-8) continue;
    const Eigen::VectorXd v = vectors.col(i).real();
    if (std::abs(v[9]) < 1e-12) continue;
    const Eigen::VectorXd e = basis * Eigen::Vector4d(v[6] / v[9], v[7] / v[9], v[8] / v[9], 1.0);
    Mat3 E;
    for (int r = 0; r < 3; ++r) E.row(r) = e.segment<3>(3 * r).transpose();
    solutions.push_back(E / E.norm());
  }
  return solutions;
}

Mat3 fit_homography(const std::vector<RayPair>& pairs) {
  MatrixXd AtA = MatrixXd::Zero(9, 9);
  for (const RayPair& pair : pairs) {
    const Mat3 cross = geometry::skew(pair.b);
    Eigen::Matrix<double, 3, 9> rows;
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) rows.block<1, 3>(r, 3 * k) = cross(r, k) * pair.a.transpose();
    }
    AtA += rows.transpose() * rows;
  }
  const Eigen::VectorXd h = geometry::symmetric_eigen(AtA).vectors.col(0);
  Mat3 H;
  for (int r = 0; r < 3; ++r) H.row(r) = h.segment<3>(3 * r).transpose();
  H /= std::max(Eigen::JacobiSVD<Mat3>(H).singularValues()[1], 1e-12);
  double sign = 0;
  for (const RayPair& pair : pairs) sign += pair.b.dot(H * pair.a) > 0 ? 1 : -1;
  return sign < 0 ? Mat3(-H) : H;
}

std::vector<SE3> poses_from_homography(const Mat3& H, const std::vector<RayPair>& pairs) {
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(H.transpose() * H);
  Mat3 V;
  for (int i = 0; i < 3; ++i) V.col(i) = eigen.eigenvectors().col(2 - i);
  if (V.determinant() < 0) V = -V;
  const double s1 = eigen.eigenvalues()[2], s3 = eigen.eigenvalues()[0];
  if (s1 - s3 < 1e-9) return {};  // pure rotation
  const double p = std::sqrt(std::max(0.0, 1.0 - s3)), q = std::sqrt(std::max(0.0, s1 - 1.0)), n = std::sqrt(s1 - s3);
  std::vector<SE3> poses;
  for (const double sign : {1.0, -1.0}) {
    const Vec3 v2 = V.col(1), u = (p * V.col(0) + sign * q * V.col(2)) / n;
    Mat3 U, W;
    U << v2, u, v2.cross(u);
    W << H * v2, H * u, (H * v2).cross(H * u);
    const Mat3 R = W * U.transpose();
    Vec3 normal = v2.cross(u);
    double in_front = 0;
    for (const RayPair& pair : pairs) in_front += normal.dot(pair.a) > 0 ? 1 : -1;
    if (in_front < 0) normal = -normal;
    const Vec3 t = (H - R) * normal;
    if (t.norm() < 1e-9) continue;
    const Eigen::JacobiSVD<Mat3> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Mat3 nearest = svd.matrixU() * svd.matrixV().transpose();
    poses.emplace_back(nearest, t.normalized());
  }
  return poses;
}

SE3 pose_from_essential(const Mat3& E, const std::vector<RayPair>& pairs) {
  const Eigen::JacobiSVD<Mat3> svd(E, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 U = svd.matrixU(), V = svd.matrixV();
  if (U.determinant() < 0) U = -U;
  if (V.determinant() < 0) V = -V;
  Mat3 W;
  W << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  SE3 best;
  int most = -1;
  for (const Mat3& R : {Mat3(U * W * V.transpose()), Mat3(U * W.transpose() * V.transpose())}) {
    for (const double sign : {1.0, -1.0}) {
      const SE3 pose(R, sign * U.col(2));
      const int count = count_in_front(pose, pairs);
      if (count > most) most = count, best = pose;
    }
  }
  return best;
}

double epipolar_distance_rad(const Mat3& E, const RayPair& pair) {
  const Vec3 line_b = E * pair.a, line_a = E.transpose() * pair.b;
  const double error = pair.b.dot(line_b);
  const double g2 = (line_b - pair.b * error).squaredNorm() + (line_a - pair.a * error).squaredNorm();
  return std::abs(error) / std::sqrt(std::max(g2, 1e-20));
}

double triangulate_inverse_distance(const SE3& T, const RayPair& pair) {
  const Vec3 across_t = pair.b.cross(T.translation);
  const double length2 = across_t.squaredNorm();
  return length2 < 1e-16 ? 0.0 : -across_t.dot(pair.b.cross(T.rotation * pair.a)) / length2;
}

std::vector<SE3> relative_pose_candidates(const std::vector<RayPair>& pairs, double threshold_rad, std::uint32_t seed) {
  constexpr std::size_t kMinPairs = 8;
  if (pairs.size() < kMinPairs) return {};
  std::mt19937 random(seed);
  std::vector<SE3> poses;
  for (const SE3& pose : essential_candidates(pairs, threshold_rad, random)) add_if_new(pose, poses);
  // The threshold is wider because the plane is only the larger part of the scene.
  for (const SE3& pose : homography_candidates(pairs, 3.0 * threshold_rad, random)) add_if_new(pose, poses);
  return poses;
}

RotationFit fit_rotation(const std::vector<RayPair>& pairs) {
  constexpr int kRounds = 5;
  // Chosen by hand; keeps the weights finite.
  constexpr double kFloor_rad = 1e-4;
  RotationFit fit;
  if (pairs.empty()) return fit;
  std::vector<double> weights(pairs.size(), 1.0);
  for (int round = 0; round < kRounds; ++round) {
    Mat3 sum = Mat3::Zero();
    for (std::size_t i = 0; i < pairs.size(); ++i) sum += weights[i] * pairs[i].b * pairs[i].a.transpose();
    const Eigen::JacobiSVD<Mat3> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Mat3& U = svd.matrixU();
    const Mat3& V = svd.matrixV();
    const Mat3 R = U * Vec3(1, 1, (U * V.transpose()).determinant()).asDiagonal() * V.transpose();
    fit.R_b_a = Eigen::Quaterniond(R).normalized();
    std::vector<double> angles;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const Vec3 turned = R * pairs[i].a;
      angles.push_back(std::atan2(turned.cross(pairs[i].b).norm(), turned.dot(pairs[i].b)));
      weights[i] = 1.0 / std::max(angles.back(), kFloor_rad);  // least absolute angles
    }
    std::nth_element(angles.begin(), angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 2), angles.end());
    fit.median_rad = angles[angles.size() / 2];
  }
  return fit;
}

}  // namespace tileflight::initialization
