#include "tileflight/slam/keyframes/features.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <utility>

namespace tileflight::keyframes {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr int kDescriptorReach_px = 18;  ///< reach of a descriptor, pixels of its level

struct Corner {
  int x = 0;
  int y = 0;
  float strength = 0;
};

/// Minimum eigenvalue of the mean of grad grad^T over 5x5 pixels, for each pixel of a level.
std::vector<float> corner_strengths(const PyramidLevel& level) {
  constexpr int kHalf = 2;
  const int w = level.width, h = level.height;
  std::vector<float> strengths(static_cast<std::size_t>(w) * h);
  tbb::parallel_for(
      tbb::blocked_range<int>(kDescriptorReach_px, std::max(kDescriptorReach_px, h - kDescriptorReach_px), 32),
      [&](const auto& range) {
        std::vector<float> xx(w), xy(w), yy(w);
        for (int y = range.begin(); y < range.end(); ++y) {
          std::fill(xx.begin(), xx.end(), 0.0F), std::fill(xy.begin(), xy.end(), 0.0F),
              std::fill(yy.begin(), yy.end(), 0.0F);
          for (int dy = -kHalf; dy <= kHalf; ++dy) {
            const float *p = level.row(y + dy), *up = p - w, *down = p + w;
            for (int x = 1; x < w - 1; ++x) {
              const float gx = 0.5F * (p[x + 1] - p[x - 1]), gy = 0.5F * (down[x] - up[x]);
              xx[x] += gx * gx, xy[x] += gx * gy, yy[x] += gy * gy;
            }
          }
          for (int x = kDescriptorReach_px; x < w - kDescriptorReach_px; ++x) {
            float a = 0, b = 0, c = 0;
            for (int dx = -kHalf; dx <= kHalf; ++dx) a += xx[x + dx], b += xy[x + dx], c += yy[x + dx];
            strengths[static_cast<std::size_t>(y) * w + x] =
                (0.5F * (a + c) - std::sqrt(0.25F * (a - c) * (a - c) + b * b)) / 25.0F;
          }
        }
      });
  return strengths;
}

bool is_local_maximum(const std::vector<float>& strengths, int width, int x, int y) {
  constexpr int kRadius = 3;
  const std::size_t i = static_cast<std::size_t>(y) * width + x;
  for (int dy = -kRadius; dy <= kRadius; ++dy) {
    for (int dx = -kRadius; dx <= kRadius; ++dx) {
      const std::size_t j = i + static_cast<std::ptrdiff_t>(dy) * width + dx;
      if (strengths[j] > strengths[i] || (strengths[j] == strengths[i] && j < i)) return false;
    }
  }
  return true;
}

/// Strongest peaks of each block, so that they cover the image.
std::vector<Corner> select_corners(const PyramidLevel& level, const RayTable& rays, int max_corners) {
  constexpr int kBlocks = 10;
  // Chosen by hand.
  constexpr float kMinStrength = 4.0F;
  const std::vector<float> strengths = corner_strengths(level);
  std::array<std::vector<Corner>, kBlocks * kBlocks> blocks;
  for (int y = kDescriptorReach_px; y < level.height - kDescriptorReach_px; ++y) {
    for (int x = kDescriptorReach_px; x < level.width - kDescriptorReach_px; ++x) {
      const float strength = strengths[static_cast<std::size_t>(y) * level.width + x];
      if (strength < kMinStrength || rays.at(x, y).isZero(0) || !is_local_maximum(strengths, level.width, x, y))
        continue;
      blocks[y * kBlocks / level.height * kBlocks + x * kBlocks / level.width].push_back({x, y, strength});
    }
  }
  // Each round takes the next strongest peak of every block.
  for (auto& block : blocks)
    std::stable_sort(block.begin(), block.end(),
                     [](const Corner& a, const Corner& b) { return a.strength > b.strength; });
  std::vector<Corner> out;
  for (std::size_t round = 0; static_cast<int>(out.size()) < max_corners; ++round) {
    const std::size_t before = out.size();
    for (const auto& block : blocks) {
      if (round < block.size() && static_cast<int>(out.size()) < max_corners) out.push_back(block[round]);
    }
    if (out.size() == before) break;
  }
  return out;
}

/// 256 pairs of sample positions, Gaussian around the centre (BRIEF's G II), in pixels of a level.
struct SamplingPattern {
  std::array<std::array<Vector2f, 2>, 256> pairs;

  SamplingPattern() {
    constexpr float kMost = 13.0F;
    std::mt19937 random(12345);  // its output is standardised; that of the std distributions is not
    const auto next = [&] {
      float sum = 0;
      for (int i = 0; i < 12; ++i) sum += static_cast<float>(random() >> 8) / 16777216.0F;
      return std::clamp(6.2F * (sum - 6.0F), -kMost, kMost);
    };
    for (auto& pair : pairs) {
      for (Vector2f& place : pair) {
        place.x() = next();
        place.y() = next();
      }
    }
  }
};

/// Affine map from the tangent plane at a ray to a level: pixel = centre + J p, with p in mean pixels of the level.
struct TangentPlane {
  Vector2f centre;
  Eigen::Matrix2f J;

  Vector2f at(const Vector2f& p) const { return centre + J * p; }
};

std::optional<TangentPlane> tangent_plane(const Lens& lens, const Vector2f& pixel, const Vector3f& ray) {
  Vector2f projected;
  Eigen::Matrix<float, 2, 3> by_ray;
  if (!lens.project<float>(ray, projected, by_ray)) return std::nullopt;
  const Vector3f other = std::abs(ray.x()) < 0.9F ? Vector3f::UnitX() : Vector3f::UnitY();
  const Vector3f e2 = ray.cross(other).normalized(), e1 = e2.cross(ray);
  TangentPlane plane;
  plane.centre = pixel;
  plane.J.col(0) = by_ray * e1;
  plane.J.col(1) = by_ray * e2;
  plane.J /= static_cast<float>(lens.focal_px());
  return plane;
}

bool pattern_fits(const PyramidLevel& level, const TangentPlane& plane) {
  constexpr float kReach = 18.5F;  // 13 sqrt(2)
  const Vector2f reach = kReach * plane.J.rowwise().norm();
  return level.inside(plane.centre.x() - reach.x(), plane.centre.y() - reach.y(), 0.0F) &&
         level.inside(plane.centre.x() + reach.x(), plane.centre.y() + reach.y(), 0.0F);
}

/// Angle of the intensity centroid around the centre (ORB, section 3.2).
float orientation_rad(const PyramidLevel& level, const TangentPlane& plane) {
  constexpr int kRadius = 9;
  Vector2f moment = Vector2f::Zero();
  for (int y = -kRadius; y <= kRadius; ++y) {
    for (int x = -kRadius; x <= kRadius; ++x) {
      if (x * x + y * y > kRadius * kRadius) continue;
      const Vector2f p(x, y), at = plane.at(p);
      moment += level.sample_intensity(at.x(), at.y()) * p;
    }
  }
  return std::atan2(moment.y(), moment.x());
}

/// Compares means of 2x2 pixels, because single pixels are too noisy (BRIEF, section 3.1).
BinaryDescriptor compute_descriptor(const PyramidLevel& level, const PyramidLevel& smoother, const TangentPlane& plane,
                                    const SamplingPattern& pattern) {
  const Eigen::Matrix2f turned = plane.J * Eigen::Rotation2Df(orientation_rad(level, plane)).toRotationMatrix();
  const auto grey = [&](const Vector2f& place) {
    const Vector2f at = (plane.centre + turned * place + Vector2f::Constant(0.5F)) * 0.5F - Vector2f::Constant(0.5F);
    return smoother.sample_intensity(std::clamp(at.x(), 0.0F, static_cast<float>(smoother.width) - 1.01F),
                                     std::clamp(at.y(), 0.0F, static_cast<float>(smoother.height) - 1.01F));
  };
  BinaryDescriptor bits{};
  for (std::size_t i = 0; i < pattern.pairs.size(); ++i) {
    if (grey(pattern.pairs[i][0]) < grey(pattern.pairs[i][1])) bits[i / 64] |= std::uint64_t{1} << (i % 64);
  }
  return bits;
}

struct Nearest {
  int index = -1;
  int distance = 257;
  int second_distance = 257;
};

Nearest find_nearest(const Feature& feature, const std::vector<Feature>& others) {
  Nearest out;
  for (std::size_t i = 0; i < others.size(); ++i) {
    const int distance = hamming(feature.descriptor, others[i].descriptor);
    if (distance < out.distance) {
      // A match to the same corner on another level is no competitor.
      const bool same = out.index >= 0 && (others[out.index].pixel - others[i].pixel).norm() < 6.0F * others[i].size_px;
      out.second_distance = same ? out.second_distance : out.distance;
      out.distance = distance;
      out.index = static_cast<int>(i);
    } else if (distance < out.second_distance &&
               (others[out.index].pixel - others[i].pixel).norm() >= 6.0F * others[out.index].size_px) {
      out.second_distance = distance;
    }
  }
  return out;
}

std::vector<Nearest> find_all_nearest(const std::vector<Feature>& features, const std::vector<Feature>& others) {
  std::vector<Nearest> out(features.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, features.size(), 32), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) out[i] = find_nearest(features[i], others);
  });
  return out;
}

}  // namespace

std::vector<Feature> find_features(const Pyramid& pyramid, const LensPyramid& lens, const FeatureOptions& options) {
  static const SamplingPattern kPattern;
  std::vector<Feature> features;
  const int last = static_cast<int>(pyramid.levels.size()) - 2;  // descriptors read the next level
  int first = 0;
  while (first < last && pyramid.levels[first].width * pyramid.levels[first].height > options.max_area_px) ++first;
  const int end = std::min(last, first + options.levels - 1);
  int max_corners = options.features / 2;  // half on the finest level, a quarter on the next, and so on
  for (int l = first; l <= end; ++l) {
    const PyramidLevel& level = pyramid.levels[l];
    const float size = static_cast<float>(1 << l);
    for (const Corner& corner : select_corners(level, lens.rays[l], max_corners)) {
      Feature feature;
      const Vector2f pixel(corner.x, corner.y);
      feature.pixel = (pixel + Vector2f::Constant(0.5F)) * size - Vector2f::Constant(0.5F);
      feature.ray = lens.ray(l, corner.x, corner.y);
      feature.size_px = size;
      const auto plane = tangent_plane(lens.lenses[l], pixel, feature.ray);
      if (!plane || !pattern_fits(level, *plane)) continue;
      feature.descriptor = compute_descriptor(level, pyramid.levels[l + 1], *plane, kPattern);
      features.push_back(feature);
    }
    max_corners = std::max(1, l + 1 == end ? max_corners : max_corners / 2);
  }
  return features;
}

std::vector<FeatureMatch> match_features(const std::vector<Feature>& a, const std::vector<Feature>& b) {
  // Largest Hamming distance of a match, and ratio to the second nearest. Chosen by hand.
  constexpr int kMostBits = 64;
  constexpr double kRatio = 0.85;
  const std::vector<Nearest> to_b = find_all_nearest(a, b), to_a = find_all_nearest(b, a);
  std::vector<FeatureMatch> matches;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Nearest& there = to_b[i];
    if (there.index < 0 || there.distance > kMostBits || there.distance >= kRatio * there.second_distance) continue;
    const Nearest& back = to_a[there.index];
    if (back.index == static_cast<int>(i) && back.distance < kRatio * back.second_distance)
      matches.push_back({static_cast<int>(i), there.index});
  }
  return matches;
}

std::vector<FeatureMatch> consistent_matches(const std::vector<Feature>& a, const std::vector<Feature>& b,
                                             const std::vector<FeatureMatch>& matches) {
  constexpr std::size_t kNeighbours = 8, kFewest = 4;       // matches around, and those of them that must agree
  constexpr float kMostStretch = 0.25F, kSlack_px = 12.0F;  // of the distance; all four chosen by hand
  std::vector<FeatureMatch> kept;
  std::vector<std::pair<float, std::size_t>> around;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    around.clear();
    for (std::size_t j = 0; j < matches.size(); ++j)
      if (j != i) around.emplace_back((a[matches[i].a].pixel - a[matches[j].a].pixel).norm(), j);
    const auto count = std::min(kNeighbours, around.size());
    std::partial_sort(around.begin(), around.begin() + static_cast<std::ptrdiff_t>(count), around.end());
    const auto agrees =
        std::count_if(around.begin(), around.begin() + static_cast<std::ptrdiff_t>(count), [&](const auto& other) {
          const float there = (b[matches[i].b].pixel - b[matches[other.second].b].pixel).norm();
          return std::abs(there - other.first) < kMostStretch * other.first + kSlack_px;
        });
    if (static_cast<std::size_t>(agrees) >= kFewest) kept.push_back(matches[i]);
  }
  return kept;
}

}  // namespace tileflight::keyframes
