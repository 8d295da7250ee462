#include "tileflight/localization/place_recognition.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "tileflight/alignment/similarity_chart.h"
#include "tileflight/localization/feature_matching.h"
#include "tileflight/localization/ground_agreement.h"
#include "tileflight/localization/ground_fit.h"
#include "tileflight/localization/local_features.h"
#include "tileflight/localization/plane_similarity.h"
#include "tileflight/sensors/appearance.h"

namespace tileflight::localization {

using geometry::Mat3;
using geometry::Sim3;
using geometry::Vec2;
using geometry::Vec3;

namespace {

/// In the plane of a ground image.
OrientedPoint on_plane(const LocalFeature& feature, const GroundImage& image) {
  return {image.position(feature.x, feature.y), image.pixel * feature.sigma, -feature.angle_rad};
}

Mat3 turned_up(const Vec3& up) { return Eigen::Quaterniond::FromTwoVectors(up, Vec3::UnitZ()).toRotationMatrix(); }

/// Those of highest contrast.
LocalFeatures strongest(const LocalFeatures& all, std::size_t most) {
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

/// The plane's similarity with the height that puts most of the mosaic onto the place.
Sim3 lifted(const PlaneSimilarity& T, const std::vector<Vec3>& surface, const GroundImage& ground) {
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

alignment::PointSpread spread_of(const std::vector<Vec3>& points) {
  alignment::PointSpread spread;
  const auto n = static_cast<double>(points.size());
  for (const Vec3& p : points) {
    spread.mean += p / n;
    spread.second_moment += p * p.transpose() / n;
  }
  return spread;
}

/// Those that put the points at clearly different places: of two that are nearly one, the first.
std::vector<PlaceCandidate> distinct(const std::vector<PlaceCandidate>& all, const std::vector<Vec3>& points,
                                     std::size_t most) {
  const alignment::PointSpread spread = spread_of(points);
  const double size = std::sqrt((spread.second_moment - spread.mean * spread.mean.transpose()).trace());
  constexpr double kSame = 0.03;  // of the map's size
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
       std::shared_ptr<const sensors::Appearance> appearance)
      : options(o),
        ground(orthophoto(scene, std::move(appearance), box, o.orthophoto)),
        pyramid(ground),
        features(find_features(ground.grey, ground.seen)),
        index(features.descriptors) {}

  /// Features of the mosaic with those of the place that look alike.
  std::vector<PointPair> pairs_with(const GroundImage& mosaic) const {
    const LocalFeatures seen = strongest(find_features(mosaic.grey, mosaic.seen), options.mosaic_features);
    constexpr float kMostRatio = 0.97F;  // beyond it, a match says nothing
    constexpr double kLeastWeight = 0.02;
    std::vector<PointPair> pairs;
    for (const FeatureMatch& m : index.match(seen.descriptors)) {
      if (m.ratio > kMostRatio) continue;
      pairs.push_back({on_plane(seen.features[m.source], mosaic), on_plane(features.features[m.target], ground),
                       std::max(kLeastWeight, 1.0 - std::pow(m.ratio, 2)), m.source, m.target});
    }
    return pairs;
  }

  /// From the plane into space: with the heights on both sides, the mosaic's up may lean.
  Sim3 fitted(const FoundSimilarity& found, const std::vector<PointPair>& pairs, const GroundImage& mosaic,
              const std::vector<Vec3>& surface) const {
    std::vector<GroundPair> both;
    for (const std::size_t k : found.pairs) {
      const Vec2 &p = pairs[k].source.position, &q = pairs[k].target.position;
      const auto a = mosaic.height_at(p), b = ground.height_at(q);
      if (a && b) both.push_back({Vec3(p.x(), p.y(), *a), Vec3(q.x(), q.y(), *b), pairs[k].weight});
    }
    return fit_to_ground(lifted(found.T_target_source, surface, ground), both, surface, ground);
  }

  /// The candidate of a similarity, by the whole mosaic.
  PlaceCandidate compared(const Sim3& T_local_mosaic, std::size_t inliers, const GroundPyramid& mosaic,
                          const Sim3& T_mosaic_map) const {
    const GroundAgreement agreement = ground_agreement(mosaic, pyramid, T_local_mosaic);
    constexpr double kCorrelation = 0.2, kShare = 0.3;  // from here on, what was found in the picture is trusted
    const bool is_better = agreement.correlation > kCorrelation && agreement.share > kShare;
    return {(is_better ? agreement.T_local_mosaic : T_local_mosaic) * T_mosaic_map, inliers, agreement.correlation,
            agreement.heights, agreement.share};
  }

  std::vector<PlaceCandidate> find(const FlightEvidence& flight, const Vec3& up) const {
    const Mat3 R_ground_map = turned_up(up);
    const GroundImage mosaic = flight_mosaic(flight.pictures, flight.points, R_ground_map, options.mosaic);
    if (mosaic.grey.empty()) return {};
    const std::vector<PointPair> pairs = pairs_with(mosaic);
    const auto found = find_plane_similarities(pairs, {.most = options.similarities});
    constexpr std::size_t kSurfacePlaces = 2000;
    const std::vector<Vec3> surface = surface_of(mosaic, kSurfacePlaces);
    const GroundPyramid mosaic_pyramid(mosaic);
    const Sim3 T_mosaic_map(1.0, Eigen::Quaterniond(R_ground_map), Vec3::Zero());
    std::vector<PlaceCandidate> candidates(found.size());
    tbb::parallel_for(std::size_t{0}, found.size(), [&](std::size_t k) {
      candidates[k] =
          compared(fitted(found[k], pairs, mosaic, surface), found[k].pairs.size(), mosaic_pyramid, T_mosaic_map);
    });
    return candidates;
  }
};

PlaceRecognizer::PlaceRecognizer(const scene::Scene& scene, const geometry::Box3& box,
                                 const PlaceRecognitionOptions& options,
                                 std::shared_ptr<const sensors::Appearance> appearance)
    : impl_(std::make_unique<Impl>(
          scene, box, options,
          appearance ? std::move(appearance) : std::make_shared<const sensors::Appearance>(scene))) {}

PlaceRecognizer::~PlaceRecognizer() = default;

std::vector<PlaceCandidate> PlaceRecognizer::find(const FlightEvidence& flight) const {
  if (impl_->features.size() == 0 || flight.points.empty() || flight.pictures.T_map_camera.empty()) return {};
  std::vector<PlaceCandidate> all;
  for (const Vec3& up : flight.ups) {
    const std::vector<PlaceCandidate> some = impl_->find(flight, up);
    all.insert(all.end(), some.begin(), some.end());
  }
  std::erase_if(all, [](const PlaceCandidate& c) { return !(c.value() > 0.0) || !c.T_local_map.matrix().allFinite(); });
  std::ranges::stable_sort(all, [](const auto& a, const auto& b) { return a.value() > b.value(); });
  return distinct(all, flight.points, impl_->options.candidates);
}

}  // namespace tileflight::localization
