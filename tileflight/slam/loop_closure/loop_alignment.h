#pragma once

// The motion between two keyframes that see the same place, by direct alignment of each one's map points to the other's
// picture (DSO, section 3.1, step 1), from the similarity that matched corners gave. Corners are known to a pixel, this
// to a few hundredths of one, as is the path that it is compared with.
//
// Each of the two alignments is in the units of the keyframe whose points it uses: at a loop the map may have another
// scale than where the place was first seen. The ratio comes from the distances of points that both keyframes see.

#include <Eigen/Core>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/slam/loop_closure/keyframe_image.h"
#include "tileflight/slam/mapping/map.h"

namespace tileflight::loop_closure {

/// A point's inverse distance at the pixel that it projects to.
struct KnownPixel {
  Eigen::Vector2f pixel;
  float rho = 0.0F;
};

/// Points projected into a keyframe, in a grid of square cells.
class PixelGrid {
 public:
  static constexpr float kCell_px = 16.0F;

  void add(const KnownPixel& known) { cells_[key(known.pixel)].push_back(known); }
  /// Returns the inverse distances of the points within `radius_px`, which is at most one cell.
  std::vector<float> rho_within(const Eigen::Vector2f& pixel, float radius_px) const;

 private:
  static std::pair<int, int> key(const Eigen::Vector2f& pixel);

  std::map<std::pair<int, int>, std::vector<KnownPixel>> cells_;
};

/// The image and the points of a keyframe that are aligned; it hosts the points.
struct AlignedKeyframe {
  const KeyframeImage* image = nullptr;
  std::vector<const mapping::MapPoint*> points;
};

/// T_a_b in units of a, from a's points in b's image.
struct AlignedPose {
  geometry::SE3 T_a_b;
  geometry::Mat6 covariance = geometry::Mat6::Zero();  ///< of the right twist of T_a_b, translation first
};

/// Keyframes a and b of a loop.
struct LoopAlignment {
  AlignedPose a_b;         ///< by a's points, in units of a
  AlignedPose b_a;         ///< by b's points, in units of b
  double log_scale = 0.0;  ///< of a length in a over the same length in b
  double log_scale_variance = 0.0;
};

/// Returns the squared difference of both alignments over its variance, mean of its six coordinates: about 1 if the
/// covariances are right, many if one alignment is wrong.
double disagreement(const LoopAlignment& alignment);

/// Aligns both keyframes of a loop. `lens`: of the full image, which `a.image` and `b.image` are a level of. `T_a_b`:
/// where to begin; its scale is a length in a over the same length in b. nullopt if too few points are known, one of
/// the alignments fails, or the two contradict each other.
std::optional<LoopAlignment> align_loop(const keyframes::LensPyramid& lens, const AlignedKeyframe& a,
                                        const AlignedKeyframe& b, const geometry::Sim3& T_a_b);

}  // namespace tileflight::loop_closure
