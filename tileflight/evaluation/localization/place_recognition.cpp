#include "tileflight/evaluation/localization/place_recognition.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/evaluation/localization/feature_matching.h"
#include "tileflight/evaluation/localization/ground_agreement.h"
#include "tileflight/evaluation/localization/plane_similarity.h"
#include "tileflight/evaluation/localization/sift_features.h"

namespace tileflight::localization {

using geometry::Mat3;
using geometry::Sim3;
using geometry::Vec2;
using geometry::Vec3;

namespace {

/// Feature position, size and angle in the plane of a ground image.
OrientedPoint to_oriented_point(const LocalFeature& feature, const GroundImage& image) {
  return {image.position(feature.x, feature.y), image.pixel_size * feature.sigma, -feature.angle_rad};
}

Mat3 rotation_to_up(const Vec3& up) { return geometry::rotation_between(up, Vec3::UnitZ()).toRotationMatrix(); }

/// The `most` features of highest contrast.
LocalFeatures keep_strongest(const LocalFeatures& all, std::size_t most) {
  std::vector<std::size_t> order(all.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    return std::abs(all.features[a].contrast) > std::abs(all.features[b].contrast);
  });
  order.resize(std::min(order.size(), most));
  std::ranges::sort(order);
  LocalFeatures kept;
  for (const std::size_t k : order) {
    kept.features.push_back(all.features[k]);
    kept.descriptors.push_back(all.descriptors[k]);
  }
  return kept;
}

/// Lifts a similarity in the plane to 3D, with the height at which most of the mosaic coincides with the place.
Sim3 lift_to_3d(const PlaneSimilarity& T, const std::vector<Vec3>& surface, const GroundImage& ground) {
  std::vector<double> offsets_m;
  for (const Vec3& p : surface) {
    if (const auto height = ground.height_at(T * p.head<2>())) offsets_m.push_back(*height - T.scale * p.z());
  }
  double z = 0.0;
  if (!offsets_m.empty()) {
    const auto middle = offsets_m.begin() + static_cast<std::ptrdiff_t>(offsets_m.size() / 2);
    std::nth_element(offsets_m.begin(), middle, offsets_m.end());
    z = *middle;
  }
  return {T.scale, Eigen::Quaterniond(Eigen::AngleAxisd(T.angle_rad, Vec3::UnitZ())),
          Vec3(T.translation.x(), T.translation.y(), z)};
}

/// Candidates that place the points clearly differently; of two similar ones the first is kept.
std::vector<PlaceCandidate> keep_distinct(const std::vector<PlaceCandidate>& all, const std::vector<Vec3>& points,
                                          std::size_t most) {
  const alignment::PointSpread spread = alignment::compute_spread(points);
  const double size = std::sqrt((spread.second_moment - spread.mean * spread.mean.transpose()).trace());
  constexpr double kSame = 0.03;  // as a share of the map's size
  std::vector<PlaceCandidate> kept;
  for (const PlaceCandidate& candidate : all) {
    const Sim3& T = candidate.T_local_map;
    const auto is_same = [&](const PlaceCandidate& other) {
      return alignment::rms_motion_m(T, other.T_local_map, spread) < kSame * size * other.T_local_map.scale;
    };
    if (kept.size() < most && std::ranges::none_of(kept, is_same)) kept.push_back(candidate);
  }
  return kept;
}

}  // namespace

struct PlaceRecognizer::Impl {
  PlaceRecognitionOptions options;
  GroundImage ground;
  GroundPyramid pyramid;
  LocalFeatures features;
  DescriptorIndex index;

  Impl(const scene::Scene& scene, const geometry::Box3& box, const PlaceRecognitionOptions& o,
       std::shared_ptr<const render::Appearance> appearance)
      : options(o),
        ground(build_orthophoto(scene, std::move(appearance), box, o.orthophoto)),
        pyramid(ground),
        features(find_sift_features(ground.grey, ground.seen)),
        index(features.descriptors) {}

  /// Matches of the mosaic's features with similar features of the place.
  std::vector<PointPair> pairs_with(const GroundImage& mosaic) const {
    const LocalFeatures seen =
        keep_strongest(find_sift_features(mosaic.grey, mosaic.seen), options.max_mosaic_features);
    constexpr float kMostRatio = 0.97F;  // above it a match is not distinctive
    constexpr double kLeastWeight = 0.02;
    std::vector<PointPair> pairs;
    for (const FeatureMatch& m : index.match(seen.descriptors)) {
      if (m.ratio > kMostRatio) continue;
      pairs.push_back({to_oriented_point(seen.features[m.source], mosaic),
                       to_oriented_point(features.features[m.target], ground),
                       std::max(kLeastWeight, 1.0 - std::pow(m.ratio, 2)), m.source, m.target});
    }
    return pairs;
  }

  /// Refines a similarity in the plane to one in 3D; the heights of both sides also determine the tilt.
  Sim3 refine(const FoundSimilarity& found, const std::vector<PointPair>& pairs, const GroundImage& mosaic,
              const std::vector<Vec3>& surface) const {
    std::vector<GroundPair> both;
    for (const std::size_t k : found.pairs) {
      const Vec2 &p = pairs[k].source.position, &q = pairs[k].target.position;
      const auto a = mosaic.height_at(p), b = ground.height_at(q);
      if (a && b) both.push_back({Vec3(p.x(), p.y(), *a), Vec3(q.x(), q.y(), *b), pairs[k].weight});
    }
    return fit_to_ground(lift_to_3d(found.T_target_source, surface, ground), both, surface, ground);
  }

  /// Evaluates a similarity over the whole mosaic.
  PlaceCandidate evaluate(const Sim3& T_local_mosaic, std::size_t inliers, const GroundPyramid& mosaic,
                          const Sim3& T_mosaic_map) const {
    const GroundAgreement agreement = compute_ground_agreement(mosaic, pyramid, T_local_mosaic);
    constexpr double kCorrelation = 0.2, kShare = 0.3;  // from these values on the refined alignment is accepted
    const bool is_better = agreement.correlation > kCorrelation && agreement.overlap > kShare;
    return {(is_better ? agreement.T_local_mosaic : T_local_mosaic) * T_mosaic_map, inliers, agreement.correlation,
            agreement.height_agreement, agreement.overlap};
  }

  std::vector<PlaceCandidate> find(const FlightEvidence& flight, const Vec3& up) const {
    const Mat3 R_ground_map = rotation_to_up(up);
    const GroundImage mosaic = build_flight_mosaic(flight.pictures, flight.points, R_ground_map, options.mosaic);
    if (mosaic.grey.empty()) return {};
    const std::vector<PointPair> pairs = pairs_with(mosaic);
    const auto found = find_plane_similarities(pairs, {.max_similarities = options.max_similarities});
    constexpr std::size_t kSurfacePlaces = 2000;
    const std::vector<Vec3> surface = sample_heights(mosaic, kSurfacePlaces);
    const GroundPyramid mosaic_pyramid(mosaic);
    const Sim3 T_mosaic_map(1.0, Eigen::Quaterniond(R_ground_map), Vec3::Zero());
    std::vector<PlaceCandidate> candidates(found.size());
    tbb::parallel_for(std::size_t{0}, found.size(), [&](std::size_t k) {
      candidates[k] =
          evaluate(refine(found[k], pairs, mosaic, surface), found[k].pairs.size(), mosaic_pyramid, T_mosaic_map);
    });
    return candidates;
  }
};

PlaceRecognizer::PlaceRecognizer(const scene::Scene& scene, const geometry::Box3& box,
                                 const PlaceRecognitionOptions& options,
                                 std::shared_ptr<const render::Appearance> appearance)
    : impl_(std::make_unique<Impl>(
          scene, box, options,
          appearance ? std::move(appearance) : std::make_shared<const render::Appearance>(scene))) {}

PlaceRecognizer::~PlaceRecognizer() = default;

std::vector<PlaceCandidate> PlaceRecognizer::find(const FlightEvidence& flight) const {
  if (impl_->features.size() == 0 || flight.points.empty() || flight.pictures.T_map_camera.empty()) return {};
  std::vector<PlaceCandidate> all;
  for (const Vec3& up : flight.up_candidates) {
    const std::vector<PlaceCandidate> some = impl_->find(flight, up);
    all.insert(all.end(), some.begin(), some.end());
  }
  std::erase_if(all, [](const PlaceCandidate& c) { return !(c.score() > 0.0) || !c.T_local_map.matrix().allFinite(); });
  std::ranges::stable_sort(all, [](const auto& a, const auto& b) { return a.score() > b.score(); });
  return keep_distinct(all, flight.points, impl_->options.max_candidates);
}

}  // namespace tileflight::localization
