#include "tileflight/evaluation/localization/plane_similarity.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <unordered_set>
#include <utility>

namespace tileflight::localization {

using geometry::Vec2;

namespace {

using Complex = std::complex<double>;

Complex complex(const Vec2& p) { return {p.x(), p.y()}; }

double wrap_angle(double angle_rad) { return std::remainder(angle_rad, 2.0 * std::numbers::pi); }

/// Compact data of a pair for the search.
struct Pair {
  double source_x, source_y, target_x, target_y;
  double log_scale, angle_rad;  ///< of the pair's own similarity
  double target_size, weight;
  std::size_t source_id, target_id;
};

Pair pack(const PointPair& p) {
  return {p.source.position.x(),
          p.source.position.y(),
          p.target.position.x(),
          p.target.position.y(),
          std::log(p.target.size / p.source.size),
          wrap_angle(p.target.angle_rad - p.source.angle_rad),
          p.target.size,
          p.weight,
          p.source_id,
          p.target_id};
}

class SimilaritySearch {
 public:
  SimilaritySearch(const std::vector<PointPair>& pairs, const PlaneSearchOptions& options)
      : input_pairs_(pairs), options_(options) {
    for (const PointPair& pair : pairs) pairs_.push_back(pack(pair));
  }

  std::vector<FoundSimilarity> run() const {
    std::vector<double> scores(pairs_.size());
    tbb::parallel_for(std::size_t{0}, pairs_.size(), [&](std::size_t i) {
      double score = 0.0;
      const PlaneSimilarity T = similarity_from_pair(input_pairs_[i]);
      const Vec2 rotated = T.scale * Vec2(std::cos(T.angle_rad), std::sin(T.angle_rad));
      for (const Pair& p : pairs_)
        if (is_inlier(p, rotated, T, input_pairs_[i].target.position, options_.distortion)) score += p.weight;
      scores[i] = score;
    });
    std::vector<std::size_t> order(pairs_.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return scores[a] > scores[b]; });
    constexpr std::size_t kSeeds = 10;  // seeds per requested similarity
    order.resize(std::min(order.size(), kSeeds * options_.max_similarities));
    std::vector<FoundSimilarity> fits(order.size());
    tbb::parallel_for(std::size_t{0}, order.size(), [&](std::size_t k) { fits[k] = fit_from_seed(order[k]); });
    return keep_distinct(std::move(fits));
  }

 private:
  /// `rotated`: T's scale and rotation as a complex number; the tolerance grows with the distance from `middle`
  /// (target).
  bool is_inlier(const Pair& p, const Vec2& rotated, const PlaneSimilarity& T, const Vec2& middle,
                 double distortion) const {
    if (std::abs(p.log_scale - std::log(T.scale)) > std::log(options_.size_tolerance)) return false;
    if (std::abs(wrap_angle(p.angle_rad - T.angle_rad)) > options_.angle_tolerance_rad) return false;
    const double x = rotated.x() * p.source_x - rotated.y() * p.source_y + T.translation.x() - p.target_x;
    const double y = rotated.y() * p.source_x + rotated.x() * p.source_y + T.translation.y() - p.target_y;
    const double away_x = p.target_x - middle.x(), away_y = p.target_y - middle.y();
    const double tolerance = options_.blur * p.target_size + distortion * std::sqrt(away_x * away_x + away_y * away_y);
    return x * x + y * y <= tolerance * tolerance;
  }

  /// Consistent pairs; of pairs with a common source or target only the one with the largest weight.
  std::vector<std::size_t> find_inliers(const PlaneSimilarity& T, const Vec2& middle, double distortion) const {
    const Vec2 rotated = T.scale * Vec2(std::cos(T.angle_rad), std::sin(T.angle_rad));
    std::vector<std::size_t> all, once;
    for (std::size_t k = 0; k < pairs_.size(); ++k)
      if (is_inlier(pairs_[k], rotated, T, middle, distortion)) all.push_back(k);
    std::ranges::stable_sort(all, [&](std::size_t a, std::size_t b) { return pairs_[a].weight > pairs_[b].weight; });
    std::unordered_set<std::size_t> sources, targets;
    for (const std::size_t k : all) {
      if (sources.contains(pairs_[k].source_id) || targets.contains(pairs_[k].target_id)) continue;
      sources.insert(pairs_[k].source_id);
      targets.insert(pairs_[k].target_id);
      once.push_back(k);
    }
    return once;
  }

  Vec2 target_centroid(const std::vector<std::size_t>& chosen) const {
    Vec2 sum = Vec2::Zero();
    for (const std::size_t k : chosen) sum += input_pairs_[k].target.position;
    return sum / static_cast<double>(std::max<std::size_t>(1, chosen.size()));
  }

  FoundSimilarity fit_from_seed(std::size_t seed) const {
    FoundSimilarity found{similarity_from_pair(input_pairs_[seed])};
    found.pairs = find_inliers(found.T_target_source, input_pairs_[seed].target.position, options_.distortion);
    constexpr int kRounds = 4;
    for (int round = 0; round < kRounds && found.pairs.size() >= 2; ++round) {
      found.T_target_source = fit_plane_similarity(input_pairs_, found.pairs);
      const double part = (round + 1.0) / kRounds;
      const double distortion = options_.distortion + part * (options_.fitted_distortion - options_.distortion);
      found.pairs = find_inliers(found.T_target_source, target_centroid(found.pairs), distortion);
    }
    for (const std::size_t k : found.pairs) found.score += pairs_[k].weight;
    return found;
  }

  /// Best first; of similarities that place their pairs nearly identically only the best is kept.
  std::vector<FoundSimilarity> keep_distinct(std::vector<FoundSimilarity> fits) const {
    std::ranges::stable_sort(fits, [](const auto& a, const auto& b) { return a.score > b.score; });
    std::vector<FoundSimilarity> kept;
    for (FoundSimilarity& fit : fits) {
      if (kept.size() >= options_.max_similarities) break;
      if (fit.pairs.empty() || !std::isfinite(fit.T_target_source.scale)) continue;
      if (std::ranges::none_of(kept, [&](const FoundSimilarity& k) { return is_same(fit, k); }))
        kept.push_back(std::move(fit));
    }
    return kept;
  }

  bool is_same(const FoundSimilarity& a, const FoundSimilarity& b) const {
    constexpr double kScale = 1.1, kAngle_rad = 0.1;
    const PlaneSimilarity &A = a.T_target_source, &B = b.T_target_source;
    if (std::abs(std::log(A.scale / B.scale)) > std::log(kScale)) return false;
    if (std::abs(wrap_angle(A.angle_rad - B.angle_rad)) > kAngle_rad) return false;
    const Pair& p = pairs_[a.pairs.front()];
    const Vec2 at(p.source_x, p.source_y);
    return (A * at - B * at).norm() <= 2.0 * options_.blur * p.target_size;
  }

  const std::vector<PointPair>& input_pairs_;
  const PlaneSearchOptions& options_;
  std::vector<Pair> pairs_;
};

}  // namespace

Vec2 PlaneSimilarity::operator*(const Vec2& p) const {
  const double c = scale * std::cos(angle_rad), s = scale * std::sin(angle_rad);
  return Vec2(c * p.x() - s * p.y(), s * p.x() + c * p.y()) + translation;
}

PlaneSimilarity similarity_from_pair(const PointPair& pair) {
  PlaneSimilarity T;
  T.scale = pair.target.size / pair.source.size;
  T.angle_rad = wrap_angle(pair.target.angle_rad - pair.source.angle_rad);
  T.translation = pair.target.position - T * pair.source.position;
  return T;
}

PlaneSimilarity fit_plane_similarity(const std::vector<PointPair>& pairs, const std::vector<std::size_t>& chosen) {
  Complex source_mean = 0.0, target_mean = 0.0;
  double weights = 0.0;
  for (const std::size_t k : chosen) {
    source_mean += pairs[k].weight * complex(pairs[k].source.position);
    target_mean += pairs[k].weight * complex(pairs[k].target.position);
    weights += pairs[k].weight;
  }
  source_mean /= weights, target_mean /= weights;
  // Complex number z that minimises sum |target - z source|^2.
  Complex products = 0.0;
  double squares = 0.0;
  for (const std::size_t k : chosen) {
    const Complex a = complex(pairs[k].source.position) - source_mean;
    products += pairs[k].weight * std::conj(a) * (complex(pairs[k].target.position) - target_mean);
    squares += pairs[k].weight * std::norm(a);
  }
  const Complex z = products / squares, t = target_mean - z * source_mean;
  return {std::abs(z), std::arg(z), Vec2(t.real(), t.imag())};
}

std::vector<FoundSimilarity> find_plane_similarities(const std::vector<PointPair>& pairs,
                                                     const PlaneSearchOptions& options) {
  return SimilaritySearch(pairs, options).run();
}

}  // namespace tileflight::localization
