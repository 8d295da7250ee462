#include "tileflight/alignment/global_registration.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "tileflight/alignment/consistent_pairs.h"
#include "tileflight/alignment/ordered_sum.h"
#include "tileflight/alignment/similarity_chart.h"
#include "tileflight/alignment/surface_descriptor.h"
#include "tileflight/alignment/umeyama.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/nearest.h"

namespace tileflight::alignment {

using geometry::Sim3;
using geometry::Vec3;

namespace {

void check(const char* where, const std::vector<Vec3>& points) {
  if (points.size() < 3) throw InputError(where, "has fewer than three points; there is nothing to register");
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) throw InputError(where, "point " + std::to_string(i) + " is not finite");
  }
}

void check(const GlobalOptions& options) {
  const bool open = options.least_scale == 0.0 && options.most_scale == 0.0;
  const bool range =
      options.least_scale > 0.0 && options.most_scale >= options.least_scale && std::isfinite(options.most_scale);
  if (!open && !range) throw InputError("scale range", "must be two positive numbers, the first not above the second");
}

/// Middle and size of a cloud: medians, so that wild points do not count.
struct Size {
  Vec3 middle = Vec3::Zero();
  double radius_m = 0.0;  ///< median distance from the middle
};

double median(std::vector<double> values) {
  const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), half, values.end());
  return *half;
}

Size size_of(const std::vector<Vec3>& points) {
  Size size;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3& p : points) values.push_back(p[axis]);
    size.middle[axis] = median(std::move(values));
  }
  std::vector<double> distances_m;
  for (const Vec3& p : points) distances_m.push_back((p - size.middle).norm());
  size.radius_m = median(std::move(distances_m));
  return size;
}

/// Grid at which about `count` cells are occupied.
double spacing_for(const std::vector<Vec3>& points, std::size_t count, double first_m) {
  double spacing_m = first_m;
  constexpr int kRounds = 6;
  for (int round = 0; round < kRounds; ++round) {
    const double ratio = static_cast<double>(thinned_to_grid(points, spacing_m).size()) / static_cast<double>(count);
    if (ratio > 0.8 && ratio < 1.25) break;
    spacing_m *= std::sqrt(ratio);  // surfaces: cells grow with the square
  }
  return spacing_m;
}

/// The scales at which the source is described, a quarter apart: neighbourhoods of points a tenth too large or small
/// still look alike.
std::vector<double> scales_of(double least, double most) {
  constexpr double kStep = 1.25;
  const int steps = std::max(0, static_cast<int>(std::ceil(std::log(most / least) / std::log(kStep) - 1e-9)));
  std::vector<double> scales;
  for (int k = 0; k <= steps; ++k) {
    scales.push_back(steps == 0 ? std::sqrt(least * most) : least * std::pow(most / least, k / double(steps)));
  }
  return scales;
}

class Search {
 public:
  Search(const std::vector<Vec3>& source, const std::vector<Vec3>& target, const GlobalOptions& options)
      : source_(source), options_(options), source_size_(size_of(source)), target_size_(size_of(target)) {
    if (!(source_size_.radius_m > 0.0) || !(target_size_.radius_m > 0.0))
      throw InputError("cloud", "most of its points lie at one place; there is nothing to register");
    const double first_m = 2.0 * target_size_.radius_m / std::sqrt(static_cast<double>(options.keypoints));
    spacing_m_ = spacing_for(target, options.keypoints, first_m);
    target_ = thinned_to_grid(target, spacing_m_);
    described_ = surface_descriptors(target_, descriptor(options.target_up));
    nearest_ = std::make_unique<geometry::NearestIndex>(target);
    find_target_gap(target);
  }

  GlobalRegistration run() {
    const double ratio = target_size_.radius_m / source_size_.radius_m;
    const bool open = options_.least_scale == 0.0;
    constexpr double kSmallest = 0.1, kLargest = 1.5;
    const std::vector<double> scales =
        open ? scales_of(kSmallest * ratio, kLargest * ratio) : scales_of(options_.least_scale, options_.most_scale);
    std::vector<GlobalCandidate> all;
    for (const double scale : scales) look_at_scale(scale, all);
    return {distinct(std::move(all))};
  }

 private:
  DescriptorOptions descriptor(const std::optional<Vec3>& up) const {
    constexpr double kNeighborhood = 7.0;  // in grid cells
    DescriptorOptions options;
    options.radius_m = kNeighborhood * spacing_m_;
    if (options_.source_up && options_.target_up) options.up = up->normalized();
    return options;
  }

  /// Half of the distance to the next target point, of most: how close a point on the surface comes to a point of it.
  void find_target_gap(const std::vector<Vec3>& target) {
    std::vector<double> gaps_m;
    const std::size_t stride = std::max<std::size_t>(1, target.size() / 2000);
    for (std::size_t i = 0; i < target.size(); i += stride)
      gaps_m.push_back(nearest_->nearest_k(target[i], 2).back().distance_m);
    gap_m_ = median(std::move(gaps_m));
  }

  void look_at_scale(double scale, std::vector<GlobalCandidate>& all) const {
    std::vector<Vec3> scaled;
    scaled.reserve(source_.size());
    for (const Vec3& p : source_) scaled.push_back(scale * (p - source_size_.middle));
    const std::vector<Vec3> points = thinned_to_grid(scaled, spacing_m_);
    constexpr std::size_t kFewest = 30;
    if (points.size() < kFewest) return;
    const Eigen::MatrixXf described = surface_descriptors(points, descriptor(options_.source_up));
    ConsistencyOptions consistency;
    consistency.tolerance_m = 2.0 * spacing_m_;
    if (options_.source_up && options_.target_up) {
      consistency.source_up = options_.source_up->normalized();
      consistency.target_up = options_.target_up->normalized();
      consistency.up_tolerance_rad = options_.up_tolerance_rad;
    }
    const PlacePairs pairs = similar_places(points, described, target_, described_);
    for (const std::vector<std::size_t>& group : consistent_groups(pairs, consistency)) {
      if (const auto candidate = candidate_of(pairs, group, scale)) all.push_back(*candidate);
    }
  }

  std::optional<GlobalCandidate> candidate_of(const PlacePairs& pairs, const std::vector<std::size_t>& group,
                                              double scale) const {
    std::vector<Vec3> from, to;
    for (const std::size_t k : group) {
      from.push_back(pairs.source[k]);
      to.push_back(pairs.target[k]);
    }
    constexpr std::size_t kFewest = 4;
    if (from.size() < kFewest) return std::nullopt;
    const bool known = options_.least_scale > 0.0 && options_.least_scale == options_.most_scale;
    const RobustOptions robust{.inlier_m = 2.0 * spacing_m_, .samples = 100, .seed = options_.seed};
    const UmeyamaResult fit = robust_umeyama(from, to, known ? ScaleMode::kFixed : ScaleMode::kEstimated, robust);
    constexpr double kFarthest = 1.3;  // beyond it another scale of the list is nearer
    if (!fit.well_conditioned || fit.T_target_source.scale > kFarthest || fit.T_target_source.scale < 1.0 / kFarthest)
      return std::nullopt;
    const Sim3 scaled_source(scale, Eigen::Quaterniond::Identity(), -scale * source_size_.middle);
    GlobalCandidate candidate{fit.T_target_source * scaled_source, 0.0, fit.inliers};
    candidate.share = share_on_target(candidate.T_target_source);
    return candidate;
  }

  /// Mean over the source's points of 1 - (distance / tolerance)^2, not below zero.
  double share_on_target(const Sim3& T) const {
    constexpr double kTolerance = 0.03;  // of the source's size
    const double tolerance_m = kTolerance * T.scale * source_size_.radius_m + gap_m_;
    const std::size_t stride = std::max<std::size_t>(1, source_.size() / 3000);
    const std::size_t n = (source_.size() + stride - 1) / stride;
    const double sum = ordered_sum<double>(n, [&](std::size_t begin, std::size_t end) {
      double part = 0.0;
      for (std::size_t k = begin; k < end; ++k) {
        const auto hit = nearest_->nearest(T * source_[k * stride], tolerance_m);
        if (hit) part += 1.0 - std::pow(hit->distance_m / tolerance_m, 2);
      }
      return part;
    });
    return sum / static_cast<double>(n);
  }

  /// Best first; of those that put the source at nearly the same place, the best.
  std::vector<GlobalCandidate> distinct(std::vector<GlobalCandidate> all) const {
    std::ranges::stable_sort(all, [](const auto& a, const auto& b) { return a.share > b.share; });
    PointSpread spread;
    spread.mean = source_size_.middle;
    spread.second_moment = source_size_.middle * source_size_.middle.transpose() +
                           std::pow(source_size_.radius_m, 2) * geometry::Mat3::Identity() / 3.0;
    std::vector<GlobalCandidate> kept;
    for (const GlobalCandidate& c : all) {
      const double apart_m = 0.2 * c.T_target_source.scale * source_size_.radius_m;
      const bool is_new = std::ranges::none_of(kept, [&](const GlobalCandidate& k) {
        return rms_motion_m(c.T_target_source, k.T_target_source, spread) < apart_m;
      });
      if (is_new && kept.size() < options_.candidates) kept.push_back(c);
    }
    return kept;
  }

  const std::vector<Vec3>& source_;
  const GlobalOptions& options_;
  Size source_size_, target_size_;
  double spacing_m_ = 1.0;
  double gap_m_ = 0.0;
  std::vector<Vec3> target_;  ///< thinned
  Eigen::MatrixXf described_;
  std::unique_ptr<geometry::NearestIndex> nearest_;
};

}  // namespace

GlobalRegistration register_globally(const std::vector<Vec3>& source, const std::vector<Vec3>& target,
                                     const GlobalOptions& options) {
  check("source cloud", source);
  check("target cloud", target);
  check(options);
  return Search(source, target, options).run();
}

}  // namespace tileflight::alignment
