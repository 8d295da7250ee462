#pragma once

// Initialization: corners are tracked from a first image until there is parallax. Relative poses from an essential
// matrix and from a homography are refined over all images of the window, and the one with the smallest joint residual
// is chosen. While a second hypothesis fits nearly as well (the mirror solution of a plane), the window grows. When it
// cannot grow any more, what the lost corners and the ground tell decides between them.
//
// Where the corners are not found again beside their last place (photos of a survey), features are matched between both
// images, and the corners are followed from where the matches around them went.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/slam/initialization/bundle_adjustment.h"
#include "tileflight/slam/initialization/klt.h"
#include "tileflight/slam/keyframes/features.h"
#include "tileflight/slam/keyframes/options.h"

namespace tileflight::initialization {

/// The images of an initialization with their poses. Images are numbered from the first one given to the Initializer;
/// those after the last pose are not part of it.
struct InitializationResult {
  std::size_t first_frame = 0;                ///< number of the reference image
  std::vector<geometry::SE3> T_camera_first;  ///< of first, first + 1, ...; scale: median inverse distance 1
  std::vector<double> parallax_rad;           ///< of each image, to the first
  std::vector<Eigen::Vector2f> pixels;        ///< corners in the first image
  std::vector<float> rho;                     ///< their inverse distances
  double median_residual_px = 0.0;
  double cost_ratio = 0.0;  ///< cost of the best hypothesis over the second; 0: only one hypothesis
  bool far_apart = false;   ///< corners were found again by matched features only
};

class Initializer {
 public:
  Initializer(const keyframes::LensPyramid& lens, const keyframes::InitializationOptions& options)
      : lens_(lens), options_(options) {}

  /// Adds the next image; returns the initialization once it succeeds. If the poses of the first and the last image of
  /// the window are known, no other motion is tried.
  std::optional<InitializationResult> add(std::shared_ptr<const keyframes::Pyramid> pyramid,
                                          const std::optional<geometry::SE3>& T_world_camera = {});

  /// Images before this one are no longer needed.
  std::size_t first_frame() const { return first_frame_; }
  double parallax_rad() const { return parallax_.empty() ? 0.0 : parallax_.back(); }
  /// Why there is no initialization yet, by what was measured: too few corners, a camera that stands or turns, images
  /// too far apart, or no rigid motion.
  std::string failure_reason() const;

 private:
  std::string far_apart_reason() const;
  struct Corner {
    Eigen::Vector2f first_pixel;
    geometry::Vec3 ray;
    std::vector<std::optional<Eigen::Vector2f>> pixels;  ///< in first + 1, first + 2, ...
  };

  void restart(std::shared_ptr<const keyframes::Pyramid> pyramid);
  std::vector<geometry::SE3> motion_candidates(std::size_t picture) const;
  int advance_tracks(const keyframes::Pyramid& pyramid);
  std::vector<std::optional<Eigen::Vector2f>> find_again(const keyframes::Pyramid& pyramid,
                                                         const std::vector<Eigen::Vector2f>& from);
  std::vector<Eigen::Vector2f> guesses_by_features(const keyframes::Pyramid& pyramid,
                                                   const std::vector<Eigen::Vector2f>& from);
  std::vector<RayPair> ray_pairs_to(std::size_t picture) const;
  std::vector<std::size_t> bundle_frames(std::size_t last) const;
  std::vector<CornerTrack> corner_tracks(const std::vector<std::size_t>& pictures,
                                         std::vector<std::size_t>& corner_of_track) const;
  std::optional<InitializationResult> try_initialize();
  std::optional<InitializationResult> try_last_chance(std::size_t last);
  std::vector<InitializationBundle> fit_candidates(const std::vector<std::size_t>& pictures,
                                                   const std::vector<CornerTrack>& tracks);
  double behind_share(const InitializationBundle& bundle, const std::vector<std::size_t>& pictures) const;
  InitializationResult build_result(const InitializationBundle& bundle, const std::vector<std::size_t>& pictures,
                                    const std::vector<std::size_t>& corner_of_track) const;

  const keyframes::LensPyramid& lens_;
  keyframes::InitializationOptions options_;
  std::shared_ptr<const keyframes::Pyramid> previous_;
  std::vector<Corner> corners_;
  std::vector<double> parallax_;  ///< of first, first + 1, ...
  std::optional<geometry::SE3> T_world_first_, T_world_last_;
  std::vector<int> followed_;     ///< corners found in first, first + 1, ...
  bool far_apart_ = false;        ///< corners are found again by matched features
  double largest_step_px_ = 0.0;  ///< median motion of matched features from one image to the next
  int fewest_matches_ = -1;       ///< of features between two images that have many; -1: none was matched
  std::vector<keyframes::Feature> previous_features_, next_features_;  ///< empty: not searched for
  std::size_t frame_count_ = 0;                                        ///< images added so far
  std::size_t first_frame_ = 0;
  int followed_at_first_ = 0;       ///< corners found again in the image after the first
  int most_corners_ = 0;            ///< that an image had
  bool corners_were_lost_ = false;  ///< too few were left to wait for parallax any longer
  double last_try_parallax_ = 0.0;
  double max_parallax_ = 0.0;
  double max_rotation_rad_ = 0.0;  ///< of the best rotations from the first image
  double last_fit_px_ = 0.0;
};

}  // namespace tileflight::initialization
