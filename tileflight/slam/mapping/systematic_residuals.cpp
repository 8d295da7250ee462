#include "tileflight/slam/mapping/systematic_residuals.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/slam/mapping/normal_equations.h"

namespace tileflight::mapping {
namespace {

/// Displacement that a residual asks for, perpendicular to the curve along which a change of distance moves the pixel.
struct Displacement {
  Eigen::Vector2f motion;    ///< unit tangent of that curve, from far to near
  float information = 0.0F;  ///< of the displacement along `motion` rotated left by 90 degrees, with the one along
                             ///< `motion` left free
  float pull = 0.0F;         ///< information times displacement
};

std::optional<Displacement> estimate_displacement(const keyframes::Linearization& at) {
  constexpr float kLeastMotion_px = 1e-3F;    // for a change of the inverse distance by 1; below it the direction is
                                              // undefined
  constexpr float kLeastInformation = 1e-3F;  // squared grey values; below it (an edge along the displacement) the
                                              // displacement is not determined
  const float length = at.d_pixel_d_rho.norm();
  if (!(length > kLeastMotion_px)) return std::nullopt;
  const Eigen::Vector2f along = at.d_pixel_d_rho / length, across(-along.y(), along.x());
  const float H_along = along.dot(at.sums.gg * along), H_mixed = along.dot(at.sums.gg * across);
  const float H_across = across.dot(at.sums.gg * across);
  if (!(H_along > kLeastInformation)) return std::nullopt;
  const float information = H_across - H_mixed * H_mixed / H_along;
  if (!(information > kLeastInformation * H_across)) return std::nullopt;
  const float pull = -(across.dot(at.sums.gr) - H_mixed / H_along * along.dot(at.sums.gr));
  return Displacement{along, information, pull};
}

}  // namespace

std::size_t SystematicResiduals::cell_index(const keyframes::PyramidLevel& picture, const Eigen::Vector2f& pixel,
                                            const Eigen::Vector2f& motion) {
  const auto part = [](float value, int size, int parts) {
    return std::clamp(static_cast<int>(value * static_cast<float>(parts) / static_cast<float>(size)), 0, parts - 1);
  };
  const double turn = std::atan2(motion.y(), motion.x()) / (2.0 * std::numbers::pi);  // -1/2 to 1/2
  const int direction = static_cast<int>(std::floor((turn + 1.0) * kDirections + 0.5)) % kDirections;
  const int row = part(pixel.y(), picture.height, kRows), column = part(pixel.x(), picture.width, kColumns);
  return static_cast<std::size_t>((row * kColumns + column) * kDirections + direction);
}

void SystematicResiduals::add(const keyframes::Window& window, int slot, const keyframes::Lens& lens) {
  const std::vector<HostTargetPair> pairs = make_host_target_pairs(window);
  const keyframes::PyramidLevel& picture = window.keyframes[slot].pyramid->levels[0];
  for (int host = 0; host < window.size(); ++host) {
    if (host == slot) continue;
    // A point's own error (patch, distance) is the same in all keyframes, so the halves must not share points.
    auto& half = halves_[static_cast<std::size_t>(window.keyframes[host].id % 2)];
    const keyframes::PairTransform& T = pairs[host * window.size() + slot].frame.current;
    for (const keyframes::ActivePoint& point : window.keyframes[host].points) {
      for (const keyframes::Observation& observation : point.observations) {
        if (observation.target != slot || observation.state != keyframes::ResidualState::kGood) continue;
        const auto displacement = estimate_displacement(observation.linearization);
        Eigen::Vector2f pixel;
        if (!displacement || !lens.project<float>(T.R * point.patch.ray + point.rho * T.t, pixel)) continue;
        Cell& cell = half[cell_index(picture, pixel, displacement->motion)];
        cell.information += displacement->information;
        cell.pull += displacement->pull;
        ++cell.residuals;
      }
    }
  }
}

std::optional<SystematicDisplacement> SystematicResiduals::estimate() const {
  // Chosen by hand.
  constexpr int kLeastResiduals = 20, kLeastCells = 12;
  double weights = 0.0, product = 0.0, variance = 0.0;
  int cells = 0;
  for (std::size_t i = 0; i < halves_[0].size(); ++i) {
    const Cell &a = halves_[0][i], &b = halves_[1][i];
    if (std::min(a.residuals, b.residuals) < kLeastResiduals) continue;
    const double weight = a.information * b.information / (a.information + b.information);
    const double both = weight * (a.pull / a.information) * (b.pull / b.information);
    weights += weight;
    product += both;
    variance += both * both;  // without a pattern the halves are independent, and each product has mean zero
    ++cells;
  }
  if (cells < kLeastCells) return std::nullopt;
  return SystematicDisplacement{.rms_px = std::sqrt(std::max(0.0, product / weights)),
                                .sigmas = variance > 0.0 ? product / std::sqrt(variance) : 0.0};
}

}  // namespace tileflight::mapping
