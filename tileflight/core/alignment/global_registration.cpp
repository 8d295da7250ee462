#include "tileflight/core/alignment/global_registration.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "tileflight/core/alignment/consistent_pairs.h"
#include "tileflight/core/alignment/ordered_sum.h"
#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/core/alignment/surface_descriptor.h"
#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/geometry/nearest.h"

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

void check(const GlobalRegistrationOptions& options) {
  const bool open = options.min_scale == 0.0 && options.max_scale == 0.0;
  const bool range =
      options.min_scale > 0.0 && options.max_scale >= options.min_scale && std::isfinite(options.max_scale);
  if (!open && !range) throw InputError("scale range", "must be two positive numbers, the first not above the second");
}

/// Centre and size of a cloud, by medians, robust to outliers.
struct Size {
  Vec3 center = Vec3::Zero();
  double radius_m = 0.0;  ///< median distance from the centre
};

Size measure_size(const std::vector<Vec3>& points) {
  Size size;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3& p : points) values.push_back(p[axis]);
    size.center[axis] = base::upper_median(std::move(values));
  }
  std::vector<double> distances_m;
  for (const Vec3& p : points) distances_m.push_back((p - size.center).norm());
  size.radius_m = base::upper_median(std::move(distances_m));
  return size;
}

/// Grid spacing at which about `count` cells are occupied.
double find_spacing(const std::vector<Vec3>& points, std::size_t count, double first_m) {
  double spacing_m = first_m;
  constexpr int kRounds = 6;
  for (int round = 0; round < kRounds; ++round) {
    const double ratio = static_cast<double>(voxel_downsample(points, spacing_m).size()) / static_cast<double>(count);
    if (ratio > 0.8 && ratio < 1.25) break;
    spacing_m *= std::sqrt(ratio);  // on surfaces the number of cells is inversely proportional to the squared spacing
  }
  return spacing_m;
}

/// Scales at which the source is described, by factors of 1.25: descriptors tolerate neighbourhoods a tenth too large
/// or too small.
std::vector<double> scale_steps(double least, double most) {
  constexpr double kStep = 1.25;
  const int steps = std::max(0, static_cast<int>(std::ceil(std::log(most / least) / std::log(kStep) - 1e-9)));
  std::vector<double> scales;
  for (int k = 0; k <= steps; ++k) {
    scales.push_back(steps == 0 ? std::sqrt(least * most) : least * std::pow(most / least, k / double(steps)));
  }
  return scales;
}

class GlobalSearch {
 public:
  GlobalSearch(const std::vector<Vec3>& source, const std::vector<Vec3>& target,
               const GlobalRegistrationOptions& options)
      : source_(source), options_(options), source_size_(measure_size(source)), target_size_(measure_size(target)) {
    if (!(source_size_.radius_m > 0.0) || !(target_size_.radius_m > 0.0))
      throw InputError("cloud", "most of its points lie at one place; there is nothing to register");
    const double first_m = 2.0 * target_size_.radius_m / std::sqrt(static_cast<double>(options.keypoints));
    spacing_m_ = find_spacing(target, options.keypoints, first_m);
    target_ = voxel_downsample(target, spacing_m_);
    target_descriptors_ = compute_surface_descriptors(target_, descriptor_options(options.target_up));
    nearest_ = std::make_unique<geometry::NearestIndex>(target);
    find_target_gap(target);
  }

  GlobalRegistration run() {
    const double ratio = target_size_.radius_m / source_size_.radius_m;
    const bool open = options_.min_scale == 0.0;
    constexpr double kSmallest = 0.1, kLargest = 1.5;
    const std::vector<double> scales =
        open ? scale_steps(kSmallest * ratio, kLargest * ratio) : scale_steps(options_.min_scale, options_.max_scale);
    std::vector<GlobalCandidate> all;
    for (const double scale : scales) search_scale(scale, all);
    return {keep_distinct(std::move(all))};
  }

 private:
  DescriptorOptions descriptor_options(const std::optional<Vec3>& up) const {
    constexpr double kNeighborhood = 7.0;  // in grid cells
    DescriptorOptions options;
    options.radius_m = kNeighborhood * spacing_m_;
    if (options_.source_up && options_.target_up) options.up = up->normalized();
    return options;
  }

  /// Half of a typical distance between neighbouring target points: distance of a surface point to the nearest sample.
  void find_target_gap(const std::vector<Vec3>& target) {
    std::vector<double> gaps_m;
    const std::size_t stride = std::max<std::size_t>(1, target.size() / 2000);
    for (std::size_t i = 0; i < target.size(); i += stride)
      gaps_m.push_back(nearest_->nearest_k(target[i], 2).back().distance_m);
    gap_m_ = base::upper_median(std::move(gaps_m));
  }

  void search_scale(double scale, std::vector<GlobalCandidate>& all) const {
    std::vector<Vec3> scaled;
    scaled.reserve(source_.size());
    for (const Vec3& p : source_) scaled.push_back(scale * (p - source_size_.center));
    const std::vector<Vec3> points = voxel_downsample(scaled, spacing_m_);
    constexpr std::size_t kFewest = 30;
    if (points.size() < kFewest) return;
    const Eigen::MatrixXf described = compute_surface_descriptors(points, descriptor_options(options_.source_up));
    ConsistencyOptions consistency;
    consistency.tolerance_m = 2.0 * spacing_m_;
    if (options_.source_up && options_.target_up) {
      consistency.source_up = options_.source_up->normalized();
      consistency.target_up = options_.target_up->normalized();
      consistency.up_tolerance_rad = options_.up_tolerance_rad;
    }
    const PutativeMatches pairs = match_descriptors(points, described, target_, target_descriptors_);
    for (const std::vector<std::size_t>& group : find_consistent_groups(pairs, consistency)) {
      if (const auto candidate = make_candidate(pairs, group, scale)) all.push_back(*candidate);
    }
  }

  std::optional<GlobalCandidate> make_candidate(const PutativeMatches& pairs, const std::vector<std::size_t>& group,
                                                double scale) const {
    std::vector<Vec3> from, to;
    for (const std::size_t k : group) {
      from.push_back(pairs.source[k]);
      to.push_back(pairs.target[k]);
    }
    constexpr std::size_t kFewest = 4;
    if (from.size() < kFewest) return std::nullopt;
    const bool known = options_.min_scale > 0.0 && options_.min_scale == options_.max_scale;
    const RobustUmeyamaOptions robust{.inlier_m = 2.0 * spacing_m_, .samples = 100, .seed = options_.seed};
    const UmeyamaResult fit = robust_umeyama(from, to, known ? ScaleMode::kFixed : ScaleMode::kEstimated, robust);
    constexpr double kFarthest = 1.3;  // beyond it another scale of the list is closer
    if (!fit.well_conditioned || fit.T_target_source.scale > kFarthest || fit.T_target_source.scale < 1.0 / kFarthest)
      return std::nullopt;
    const Sim3 scaled_source(scale, Eigen::Quaterniond::Identity(), -scale * source_size_.center);
    GlobalCandidate candidate{fit.T_target_source * scaled_source, 0.0, fit.inliers};
    candidate.overlap = overlap_on_target(candidate.T_target_source);
    return candidate;
  }

  /// Mean over the source's points of max(0, 1 - (distance / tolerance)^2).
  double overlap_on_target(const Sim3& T) const {
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

  /// Best first; of candidates at nearly the same place only the best is kept.
  std::vector<GlobalCandidate> keep_distinct(std::vector<GlobalCandidate> all) const {
    std::ranges::stable_sort(all, [](const auto& a, const auto& b) { return a.overlap > b.overlap; });
    PointSpread spread;
    spread.mean = source_size_.center;
    spread.second_moment = source_size_.center * source_size_.center.transpose() +
                           std::pow(source_size_.radius_m, 2) * geometry::Mat3::Identity() / 3.0;
    std::vector<GlobalCandidate> best;
    for (const GlobalCandidate& c : all) {
      const double apart_m = 0.2 * c.T_target_source.scale * source_size_.radius_m;
      const bool is_new = std::ranges::none_of(best, [&](const GlobalCandidate& k) {
        return rms_motion_m(c.T_target_source, k.T_target_source, spread) < apart_m;
      });
      if (is_new && best.size() < options_.max_candidates) best.push_back(c);
    }
    return best;
  }

  const std::vector<Vec3>& source_;
  const GlobalRegistrationOptions& options_;
  Size source_size_, target_size_;
  double spacing_m_ = 1.0;
  double gap_m_ = 0.0;
  std::vector<Vec3> target_;  ///< downsampled
  Eigen::MatrixXf target_descriptors_;
  std::unique_ptr<geometry::NearestIndex> nearest_;
};

}  // namespace

GlobalRegistration register_globally(const std::vector<Vec3>& source, const std::vector<Vec3>& target,
                                     const GlobalRegistrationOptions& options) {
  check("source cloud", source);
  check("target cloud", target);
  check(options);
  return GlobalSearch(source, target, options).run();
}

}  // namespace tileflight::alignment
