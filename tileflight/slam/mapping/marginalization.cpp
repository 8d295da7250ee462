#include "tileflight/slam/mapping/marginalization.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cassert>
#include <utility>

#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::mapping {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Extrapolates residuals to the linearisation point: r(0) = r(delta) - J delta (b' = b - H x0 in DSO, eq. 15).
void move_to_linearization_point(keyframes::Linearization& lin, const keyframes::Vec8& relative_delta,
                                 const keyframes::IntrinsicsDelta& lens_delta) {
  const Eigen::Matrix<float, 8, 1> d = relative_delta.cast<float>();
  const Eigen::Vector2f pixel = lin.d_pixel_d_pose * d.head<6>() + lin.d_pixel_d_intrinsics * lens_delta.cast<float>();
  const Eigen::Vector2f light = d.tail<2>();
  lin.sums.gr -= lin.sums.gg * pixel + lin.sums.gA * light;
  lin.sums.Ar -= lin.sums.gA.transpose() * pixel + lin.sums.AA * light;
}

/// Moves a residual in a stereo picture to its linearisation point, whose brightness has moved by `light_delta`.
void move_stereo_to_linearization_point(keyframes::Linearization& lin, const Eigen::Vector2d& light_delta) {
  const Eigen::Vector2f light = light_delta.cast<float>();
  lin.sums.gr -= lin.sums.gA * light;
  lin.sums.Ar -= lin.sums.AA * light;
}

/// Numbers of the unknowns in blocks of eight, in the order given; then those from `rest` to `end`.
std::vector<int> unknowns_of_blocks(const std::vector<int>& blocks, int rest, int end) {
  std::vector<int> unknowns;
  for (const int block : blocks) {
    for (int i = 0; i < 8; ++i) unknowns.push_back(8 * block + i);
  }
  for (int i = rest; i < end; ++i) unknowns.push_back(i);
  return unknowns;
}

MatrixXd symmetric_pseudo_inverse(const Mat8& A) {
  // Directions without information are excluded from the elimination (pseudo-inverse). The floor is chosen by hand.
  const Eigen::SelfAdjointEigenSolver<Mat8> eigen(A);
  constexpr double kRelativeFloor = 1e-12;
  const double floor = kRelativeFloor * std::max(eigen.eigenvalues().maxCoeff(), 0.0);
  keyframes::Vec8 inverse;
  for (int i = 0; i < 8; ++i) inverse[i] = eigen.eigenvalues()[i] > floor ? 1.0 / eigen.eigenvalues()[i] : 0.0;
  return eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
}

/// DSO, eq. 16 to 18, scaled to a unit diagonal, since translation, rotation and brightness entries differ by many
/// orders of magnitude. `gain_of`: H_ab H_bb^-1 of these, for unknowns b that leave and a that stay.
template <class Gain>
QuadraticPrior eliminate(const QuadraticPrior& prior, const std::vector<int>& kept, const std::vector<int>& leaving,
                         const Gain& gain_of) {
  const VectorXd scale = (prior.H.diagonal().cwiseAbs().array() + 1e-12).sqrt();
  const MatrixXd H = scale.cwiseInverse().asDiagonal() * prior.H * scale.cwiseInverse().asDiagonal();
  const VectorXd b = scale.cwiseInverse().asDiagonal() * prior.b;
  const MatrixXd H_ab = H(kept, leaving);
  const MatrixXd K = gain_of(H_ab, H(leaving, leaving));
  const VectorXd kept_scale = scale(kept);
  MatrixXd H_new = kept_scale.asDiagonal() * (H(kept, kept) - K * H_ab.transpose()) * kept_scale.asDiagonal();
  const VectorXd b_new = kept_scale.asDiagonal() * (b(kept) - K * b(leaving));
  H_new = (0.5 * (H_new + H_new.transpose())).eval();
  return {H_new, b_new};
}

}  // namespace

void marginalize_points(keyframes::Window& window, const std::vector<HostTargetPair>& pairs,
                        const std::vector<PointRef>& points, double weight) {
  const int n = window.size();
  for (const PointRef& ref : points) {
    for (keyframes::Observation& observation : window.keyframes[ref.host].points[ref.index].observations) {
      const keyframes::Vec8 relative =
          window.keyframes[observation.target].delta +
          pairs[ref.host * n + observation.target].d_relative_d_host * window.keyframes[ref.host].delta;
      move_to_linearization_point(observation.linearization, relative, window.intrinsics.delta);
    }
    const keyframes::Keyframe& host = window.keyframes[ref.host];
    for (keyframes::Observation& observation : window.keyframes[ref.host].points[ref.index].stereo_observations)
      move_stereo_to_linearization_point(observation.linearization,
                                         host.stereo_delta.segment<2>(2 * observation.target));
  }
  const NormalEquations system = build_normal_equations(window, pairs, points, 0.0);
  window.H_prior += weight * system.H;
  window.b_prior += weight * system.b;
}

QuadraticPrior marginalize_keyframe(const QuadraticPrior& prior, int slot) {
  std::vector<int> order;
  for (int i = 0; i < static_cast<int>(prior.b.size()); ++i) {
    if (i / 8 != slot) order.push_back(i);
  }
  std::vector<int> out(8);
  for (int i = 0; i < 8; ++i) out[i] = 8 * slot + i;
  return eliminate(prior, order, out, [](const MatrixXd& H_ab, const MatrixXd& H_bb) -> MatrixXd {
    return H_ab * symmetric_pseudo_inverse(H_bb);
  });
}

QuadraticPrior marginalize_unknowns(const QuadraticPrior& prior, const std::vector<int>& leaving) {
  constexpr double kRelativeFloor = 1e-12;  // as in marginalize_keyframe()
  std::vector<int> kept;
  for (int i = 0; i < static_cast<int>(prior.b.size()); ++i) {
    if (!std::ranges::binary_search(leaving, i)) kept.push_back(i);
  }
  return eliminate(prior, kept, leaving, [](const MatrixXd& H_ab, const MatrixXd& H_bb) -> MatrixXd {
    const geometry::SymmetricEigen eigen = geometry::symmetric_eigen(H_bb);
    const double floor = kRelativeFloor * std::max(eigen.values.maxCoeff(), 0.0);
    const VectorXd inverse = (eigen.values.array() > floor).select(eigen.values.array().inverse(), 0.0);
    return H_ab * eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose();
  });
}

void remove_keyframe(keyframes::Window& window, int slot) {
  QuadraticPrior prior{window.H_prior, window.b_prior};
  if (window.has_stereo()) prior = marginalize_keyframe(prior, window.size() + slot);
  prior = marginalize_keyframe(prior, slot);
  window.H_prior = prior.H;
  window.b_prior = prior.b;
  window.keyframes.erase(window.keyframes.begin() + slot);
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    for (keyframes::ActivePoint& point : keyframe.points) {
      std::erase_if(point.observations, [slot](const keyframes::Observation& o) { return o.target == slot; });
      for (keyframes::Observation& observation : point.observations) {
        if (observation.target > slot) --observation.target;
      }
    }
  }
}

void add_intrinsics_unknowns(keyframes::Window& window, const IntrinsicsInformation& information) {
  assert(window.keyframes.empty());
  window.intrinsics.estimated = true;
  const keyframes::IntrinsicsDelta both = keyframes::IntrinsicsDelta(0.5, 0.5, 0.0, 0.0),
                                   between = keyframes::IntrinsicsDelta(1.0, -1.0, 0.0, 0.0);
  const double principal_point = information.principal_point;
  window.H_prior =
      information.focal_length * both * both.transpose() + information.aspect * between * between.transpose();
  window.H_prior.diagonal().tail<2>().setConstant(principal_point);
  window.b_prior = VectorXd::Zero(window.intrinsics.unknowns());
}

namespace {

/// Adds the unknowns of the newest keyframe's stereo pictures at the end of the prior.
void add_stereo_unknowns(keyframes::Window& window) {
  const keyframes::Keyframe& keyframe = window.keyframes.back();
  const int n = window.unknowns() - 8;
  window.H_prior.conservativeResizeLike(MatrixXd::Zero(n + 8, n + 8));
  window.b_prior.conservativeResizeLike(VectorXd::Zero(n + 8));
  for (std::size_t c = 0; c < keyframe.stereo.size(); ++c) {
    const keyframes::StereoPicture& picture = keyframe.stereo[c];
    const int at = n + 2 * static_cast<int>(c);
    window.H_prior.diagonal().segment<2>(at) = picture.brightness_information;
    window.b_prior[at] = picture.brightness_information[0] * (picture.brightness_linear.a - picture.brightness_prior.a);
    window.b_prior[at + 1] =
        picture.brightness_information[1] * (picture.brightness_linear.b - picture.brightness_prior.b);
  }
}

}  // namespace

void add_keyframe(keyframes::Window& window, keyframes::Keyframe keyframe) {
  const int n = 8 * window.size(), lens = window.unknowns() - n;  // the rest: of the lens or the stereo pictures
  MatrixXd H = MatrixXd::Zero(n + 8 + lens, n + 8 + lens);
  VectorXd b = VectorXd::Zero(n + 8 + lens);
  H.topLeftCorner(n, n) = window.H_prior.topLeftCorner(n, n);
  H.topRightCorner(n, lens) = window.H_prior.topRightCorner(n, lens);
  H.bottomLeftCorner(lens, n) = window.H_prior.bottomLeftCorner(lens, n);
  H.bottomRightCorner(lens, lens) = window.H_prior.bottomRightCorner(lens, lens);
  b.head(n) = window.b_prior.head(n);
  b.tail(lens) = window.b_prior.tail(lens);
  window.H_prior = std::move(H);
  window.b_prior = std::move(b);
  window.H_prior(n + 6, n + 6) = keyframe.brightness_information[0];
  window.H_prior(n + 7, n + 7) = keyframe.brightness_information[1];
  window.b_prior[n + 6] =
      keyframe.brightness_information[0] * (keyframe.brightness_linear.a - keyframe.brightness_prior.a);
  window.b_prior[n + 7] =
      keyframe.brightness_information[1] * (keyframe.brightness_linear.b - keyframe.brightness_prior.b);
  window.keyframes.push_back(std::move(keyframe));
  if (window.has_stereo()) add_stereo_unknowns(window);
}

void reverse_keyframes(keyframes::Window& window) {
  const int n = window.size();
  std::vector<int> blocks;
  for (int slot = n - 1; slot >= 0; --slot) blocks.push_back(slot);
  if (window.has_stereo()) {
    for (int slot = n - 1; slot >= 0; --slot) blocks.push_back(n + slot);
  }
  const std::vector<int> order = unknowns_of_blocks(blocks, 8 * static_cast<int>(blocks.size()), window.unknowns());
  window.H_prior = MatrixXd(window.H_prior(order, order));
  window.b_prior = VectorXd(window.b_prior(order));
  std::reverse(window.keyframes.begin(), window.keyframes.end());
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    for (keyframes::ActivePoint& point : keyframe.points) {
      point.recent_states.fill(keyframes::ResidualState::kGood);  // of the newest keyframes, which are others now
      for (keyframes::Observation& observation : point.observations) observation.target = n - 1 - observation.target;
    }
  }
}

}  // namespace tileflight::mapping
