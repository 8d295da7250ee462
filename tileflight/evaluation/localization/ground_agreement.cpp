#include "tileflight/evaluation/localization/ground_agreement.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/evaluation/registration/similarity_estimate.h"

namespace tileflight::localization {

using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;
using Mat7 = Eigen::Matrix<double, 7, 7>;
using Rows = Eigen::Matrix<double, 3, 7>;

namespace {

/// Derivative of a transformed point by a motion about the centre (registration::apply_motion()).
Rows position_jacobian(const Vec3& arm) {
  Rows J;
  J << geometry::Mat3::Identity(), -geometry::skew(arm), arm;
  return J;
}

struct SimilarityNormalEquations {
  Mat7 H = Mat7::Zero();
  Vec7 b = Vec7::Zero();

  void add(const Eigen::Matrix<double, 1, 7>& row, double residual, double weight) {
    H += weight * row.transpose() * row;
    b -= weight * row.transpose() * residual;
  }
};

double geman_mcclure(double squared, double scale) {
  const double w = 1.0 / (1.0 + squared / (scale * scale));
  return w * w;
}

}  // namespace

Sim3 fit_to_ground(const Sim3& start, const std::vector<GroundPair>& pairs, const std::vector<Vec3>& surface,
                   const GroundImage& ground) {
  Sim3 T = start;
  if (surface.empty() || pairs.empty()) return T;
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : surface) middle += p / static_cast<double>(surface.size());
  double spread = 0.0;
  for (const Vec3& p : surface) spread += (p - middle).squaredNorm() / static_cast<double>(surface.size());
  double weights = 0.0;
  for (const GroundPair& pair : pairs) weights += pair.weight;
  const double of_a_place = weights / static_cast<double>(surface.size());
  constexpr int kRounds = 12;
  constexpr double kFirst = 0.2,
                   kLast = 0.02;  // kernel scale in the first and in the last round, as a share of the mosaic's size
  for (int round = 0; round < kRounds; ++round) {
    const double part = std::min(1.0, round / (0.7 * kRounds));
    const double scale = T.scale * std::sqrt(spread) * kFirst * std::pow(kLast / kFirst, part);
    const Vec3 center = T * middle;
    SimilarityNormalEquations normal;
    for (const GroundPair& pair : pairs) {
      const Vec3 here = T * pair.source, residual = here - pair.target;
      const double weight = pair.weight * geman_mcclure(residual.squaredNorm(), scale);
      const Rows J = position_jacobian(here - center);
      for (int k = 0; k < 3; ++k) normal.add(J.row(k), residual[k], weight);
    }
    for (const Vec3& p : surface) {
      const Vec3 here = T * p;
      const auto height = ground.height_at(here.head<2>());
      if (!height) continue;
      const double residual = here.z() - *height;
      normal.add(position_jacobian(here - center).row(2), residual,
                 of_a_place * geman_mcclure(residual * residual, scale));
    }
    normal.H.diagonal() *= 1.0 + 1e-6;
    const Vec7 motion = geometry::solve_symmetric(normal.H, normal.b);
    if (!motion.allFinite()) return start;
    T = registration::apply_motion(T, motion, center);
  }
  return T;
}

std::vector<Vec3> sample_heights(const GroundImage& mosaic, std::size_t most) {
  std::vector<Vec3> all;
  for (int j = 0; j < mosaic.height.height; ++j) {
    for (int i = 0; i < mosaic.height.width; ++i) {
      const float z = mosaic.height(i, j);
      if (!std::isfinite(z)) continue;
      const geometry::Vec2 at = mosaic.position(i * GroundImage::kHeightStep, j * GroundImage::kHeightStep);
      all.emplace_back(at.x(), at.y(), z);
    }
  }
  const std::size_t stride = std::max<std::size_t>(1, all.size() / std::max<std::size_t>(1, most));
  std::vector<Vec3> some;
  for (std::size_t k = 0; k < all.size(); k += stride) some.push_back(all[k]);
  return some;
}

using geometry::Sim3;
using geometry::Vec2;
using geometry::Vec3;
using imaging::FloatImage;
using imaging::GrayImage;

namespace {

GrayImage downsample(const GrayImage& fine) {
  GrayImage coarse(std::max(1, fine.width / 2), std::max(1, fine.height / 2));
  for (int y = 0; y < coarse.height; ++y) {
    for (int x = 0; x < coarse.width; ++x) {
      const int x1 = std::min(2 * x + 1, fine.width - 1), y1 = std::min(2 * y + 1, fine.height - 1);
      coarse(x, y) =
          static_cast<std::uint8_t>((fine(2 * x, 2 * y) + fine(x1, 2 * y) + fine(2 * x, y1) + fine(x1, y1) + 2) / 4);
    }
  }
  return coarse;
}

/// Grey values on a grid over the mosaic; NaN where unknown.
struct ComparisonGrid {
  FloatImage mosaic, place;
  double step = 0.0;         ///< mosaic's frame
  std::vector<Vec3> points;  ///< in the mosaic's frame, x right first
};

/// Makes a grid over the mosaic, with locally normalised grey values.
ComparisonGrid make_grid(const GroundPyramid& mosaic, double step) {
  const GroundImage& image = mosaic.image();
  ComparisonGrid grid;
  grid.step = step;
  const int width = std::max(1, static_cast<int>(image.grey.width * image.pixel_size / step));
  const int height = std::max(1, static_cast<int>(image.grey.height * image.pixel_size / step));
  grid.mosaic = FloatImage(width, height, std::nanf(""));
  grid.points.assign(static_cast<std::size_t>(width) * height, Vec3::Zero());
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Vec2 at = image.origin + step * Vec2(x + 0.5, -(y + 0.5));
      const auto z = image.height_at(at);
      if (!z) continue;
      grid.mosaic(x, y) = mosaic.at(at, step);
      grid.points[static_cast<std::size_t>(y) * width + x] = Vec3(at.x(), at.y(), *z);
    }
  }
  return grid;
}

/// Normalises by local mean and standard deviation of the values known in both images.
void normalize_contrast(FloatImage& image, const FloatImage& other, int reach) {
  const int width = image.width + 1, height = image.height + 1;
  struct Sums {
    double n = 0, a = 0, aa = 0;
  };
  std::vector<Sums> table(static_cast<std::size_t>(width) * height);
  for (int y = 1; y < height; ++y) {
    Sums row;
    for (int x = 1; x < width; ++x) {
      const float v = image(x - 1, y - 1), w = other(x - 1, y - 1);
      if (std::isfinite(v) && std::isfinite(w)) row.n += 1, row.a += v, row.aa += static_cast<double>(v) * v;
      const Sums& above = table[static_cast<std::size_t>(y - 1) * width + x];
      table[static_cast<std::size_t>(y) * width + x] = {above.n + row.n, above.a + row.a, above.aa + row.aa};
    }
  }
  FloatImage result(image.width, image.height, std::nanf(""));
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (!std::isfinite(image(x, y)) || !std::isfinite(other(x, y))) continue;
      const int x0 = std::max(0, x - reach), x1 = std::min(image.width, x + reach + 1);
      const int y0 = std::max(0, y - reach), y1 = std::min(image.height, y + reach + 1);
      const auto at = [&](int i, int j) { return table[static_cast<std::size_t>(j) * width + i]; };
      const Sums a = at(x1, y1), b = at(x0, y1), c = at(x1, y0), d = at(x0, y0);
      const double n = a.n - b.n - c.n + d.n, mean = (a.a - b.a - c.a + d.a) / n;
      const double variance = std::max(0.0, (a.aa - b.aa - c.aa + d.aa) / n - mean * mean);
      constexpr double kLeast = 3.0;
      result(x, y) = static_cast<float>((image(x, y) - mean) / (std::sqrt(variance) + kLeast));
    }
  }
  image = std::move(result);
}

void sample_place(ComparisonGrid& grid, const GroundPyramid& place, const Sim3& T) {
  grid.place = FloatImage(grid.mosaic.width, grid.mosaic.height, std::nanf(""));
  for (std::size_t k = 0; k < grid.points.size(); ++k) {
    if (!std::isfinite(grid.mosaic.pixels[k])) continue;
    const Vec3 p = T * grid.points[k];
    grid.place.pixels[k] = place.at(p.head<2>(), grid.step * T.scale);
  }
}

double correlation(const FloatImage& a, const FloatImage& b) {
  double n = 0, sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
  for (std::size_t k = 0; k < a.pixels.size(); ++k) {
    const double p = a.pixels[k], q = b.pixels[k];
    if (!std::isfinite(p) || !std::isfinite(q)) continue;
    n += 1, sa += p, sb += q, aa += p * p, bb += q * q, ab += p * q;
  }
  const double spread = (n * aa - sa * sa) * (n * bb - sb * sb);
  return n > 20.0 && spread > 0.0 ? (n * ab - sa * sb) / std::sqrt(spread) : 0.0;
}

/// Gauss-Newton step in the local frame's horizontal plane (x, y, rotation, logarithm of the scale) that reduces the
/// difference of the grey values; returns its size in grid steps.
double gauss_newton_step(const ComparisonGrid& grid, const FloatImage& mosaic, const FloatImage& place, Sim3& T,
                         const Vec3& middle) {
  Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
  Eigen::Vector4d b = Eigen::Vector4d::Zero();
  const Vec3 center = T * middle;
  const geometry::Mat3 R = T.rotation.toRotationMatrix();
  const double step_m = grid.step * T.scale;
  // Grid steps to the right and down, expressed in the local plane.
  Eigen::Matrix2d right_down;
  right_down << R(0, 0), -R(0, 1), R(1, 0), -R(1, 1);
  const Eigen::Matrix2d to_grid = right_down.inverse() / step_m;
  double spread = 0.0, n = 0.0;
  for (int y = 1; y + 1 < place.height; ++y) {
    for (int x = 1; x + 1 < place.width; ++x) {
      const float here = place(x, y), seen = mosaic(x, y);
      const Eigen::RowVector2d g(0.5 * (place(x + 1, y) - place(x - 1, y)), 0.5 * (place(x, y + 1) - place(x, y - 1)));
      if (!std::isfinite(here) || !std::isfinite(seen) || !g.allFinite()) continue;
      const Eigen::RowVector2d gradient = g * to_grid;  // per metre in the local frame
      const Vec3 arm = T * grid.points[static_cast<std::size_t>(y) * place.width + x] - center;
      Eigen::RowVector4d row;
      row << gradient.x(), gradient.y(), gradient.y() * arm.x() - gradient.x() * arm.y(),
          gradient.x() * arm.x() + gradient.y() * arm.y();
      const double residual = here - seen;
      constexpr double kHuber = 0.7;
      const double weight = std::abs(residual) > kHuber ? kHuber / std::abs(residual) : 1.0;
      H += weight * row.transpose() * row;
      b -= weight * row.transpose() * residual;
      spread += arm.head<2>().squaredNorm(), n += 1.0;
    }
  }
  if (n < 50.0) return 0.0;
  H.diagonal() *= 1.0 + 1e-6;
  const Eigen::Vector4d x = H.ldlt().solve(b);
  if (!x.allFinite()) return 0.0;
  const double radius = std::sqrt(spread / n);
  const double moved = std::sqrt(x.head<2>().squaredNorm() + radius * radius * x.tail<2>().squaredNorm()) / step_m;
  constexpr double kFarthest = 2.0;  // largest motion of one iteration, in grid steps
  const double part = std::min(1.0, kFarthest / moved);
  geometry::Vec7 motion = geometry::Vec7::Zero();
  motion << part * x[0], part * x[1], 0.0, 0.0, 0.0, part * x[2], part * x[3];
  T = registration::apply_motion(T, motion, center);
  return moved;
}

}  // namespace

GroundPyramid::GroundPyramid(const GroundImage& image) : image_(image) {
  constexpr int kSmallest = 8;
  const GrayImage *grey = &image.grey, *seen = &image.seen;
  while (std::min(grey->width, grey->height) >= 2 * kSmallest) {
    grey_.push_back(downsample(*grey));
    seen_.push_back(downsample(*seen));
    grey = &grey_.back(), seen = &seen_.back();
  }
}

float GroundPyramid::at(const Vec2& position, double step) const {
  const int level =
      std::clamp(static_cast<int>(std::lround(std::log2(step / image_.pixel_size))), 0, static_cast<int>(grey_.size()));
  const GrayImage& grey = level == 0 ? image_.grey : grey_[static_cast<std::size_t>(level - 1)];
  const GrayImage& seen = level == 0 ? image_.seen : seen_[static_cast<std::size_t>(level - 1)];
  const double factor = std::exp2(level);
  const Vec2 p = (image_.to_pixel(position) + Vec2(0.5, 0.5)) / factor - Vec2(0.5, 0.5);
  if (!(p.x() >= 0.0 && p.y() >= 0.0 && p.x() < grey.width - 1 && p.y() < grey.height - 1)) return std::nanf("");
  const int i = static_cast<int>(p.x()), j = static_cast<int>(p.y());
  constexpr int kSeen = 128;
  if (seen(i, j) < kSeen || seen(i + 1, j) < kSeen || seen(i, j + 1) < kSeen || seen(i + 1, j + 1) < kSeen)
    return std::nanf("");
  const auto a = static_cast<float>(p.x() - i), b = static_cast<float>(p.y() - j);
  const float upper = (1.0F - a) * grey(i, j) + a * grey(i + 1, j);
  const float lower = (1.0F - a) * grey(i, j + 1) + a * grey(i + 1, j + 1);
  return (1.0F - b) * upper + b * lower;
}

namespace {

/// Refinement at one pyramid level: the best of several rounds, with its correlation and overlap. Returns `before` if
/// the grid contains too few values.
GroundAgreement refine_at_level(const GroundAgreement& before, const GroundPyramid& place, ComparisonGrid& grid) {
  constexpr double kFewest = 20.0, kStill = 0.02;  // values; steps
  constexpr int kRounds = 6, kReach = 6;
  Vec3 middle = Vec3::Zero();
  double n = 0.0;
  for (std::size_t k = 0; k < grid.points.size(); ++k)
    if (std::isfinite(grid.mosaic.pixels[k])) middle += grid.points[k], n += 1.0;
  if (n < kFewest) return before;
  middle /= n;
  GroundAgreement best{.T_local_mosaic = before.T_local_mosaic};
  Sim3 T = before.T_local_mosaic;
  for (int round = 0; round <= kRounds; ++round) {
    sample_place(grid, place, T);
    FloatImage seen = grid.mosaic, known = grid.place;
    normalize_contrast(seen, grid.place, kReach);
    normalize_contrast(known, grid.mosaic, kReach);
    const auto on = static_cast<double>(std::ranges::count_if(known.pixels, [](float v) { return std::isfinite(v); }));
    const double c = correlation(seen, known);
    if (c * on / n > best.correlation * best.overlap) best = {T, c, 0.0, on / n};
    if (round == kRounds || gauss_newton_step(grid, seen, known, T, middle) < kStill) break;
  }
  return best;
}

/// Share of the mosaic's heights that agree with the place's, each weighted by closeness.
double height_agreement(const GroundImage& mosaic, const GroundImage& place, const Sim3& T, double tolerance_m) {
  double agree = 0.0, known = 0.0;
  for (int j = 0; j < mosaic.height.height; j += 2) {
    for (int i = 0; i < mosaic.height.width; i += 2) {
      const float z = mosaic.height(i, j);
      if (!std::isfinite(z)) continue;
      const Vec2 at = mosaic.position(i * GroundImage::kHeightStep, j * GroundImage::kHeightStep);
      const Vec3 p = T * Vec3(at.x(), at.y(), z);
      known += 1.0;
      const auto height = place.height_at(p.head<2>());
      if (!height) continue;
      const double apart = (*height - p.z()) / tolerance_m;
      agree += std::max(0.0, 1.0 - apart * apart);
    }
  }
  return known > 0.0 ? agree / known : 0.0;
}

}  // namespace

GroundAgreement compute_ground_agreement(const GroundPyramid& mosaic, const GroundPyramid& place, const Sim3& start) {
  constexpr double kTolerance = 0.03;  // tolerance of heights, as a share of the mosaic's side
  const GroundImage& image = mosaic.image();
  const double side = std::sqrt(static_cast<double>(image.grey.width) * image.grey.height) * image.pixel_size;
  GroundAgreement agreement{.T_local_mosaic = start};
  for (const int across : {32, 64, 128}) {
    ComparisonGrid grid = make_grid(mosaic, std::max(side / across, image.pixel_size));
    agreement = refine_at_level(agreement, place, grid);
  }
  const Sim3& T = agreement.T_local_mosaic;
  agreement.height_agreement = height_agreement(image, place.image(), T, kTolerance * side * T.scale);
  return agreement;
}

}  // namespace tileflight::localization
