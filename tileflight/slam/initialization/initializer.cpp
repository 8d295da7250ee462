#include "tileflight/slam/initialization/initializer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/slam/initialization/two_view.h"

namespace tileflight::initialization {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

/// Largest share of tracks behind the camera. Chosen by hand.
constexpr double kMaxBehindShare = 0.1;
/// Motion that no rotation explains, above the error of a followed corner. Chosen by hand.
constexpr double kLeastMotion_px = 2.0;
/// Images that an initialization needs.
constexpr std::size_t kMinPictures = 3;

bool same_solution(const InitializationBundle& a, const InitializationBundle& b) {
  constexpr double kDirection_rad = 0.1, kRotation_rad = 0.02;
  const SE3& x = a.T_camera_first.back();
  const SE3& y = b.T_camera_first.back();
  const double direction = std::acos(std::clamp(x.translation.normalized().dot(y.translation.normalized()), -1.0, 1.0));
  return direction < kDirection_rad && geometry::so3_log(x.rotation.conjugate() * y.rotation).norm() < kRotation_rad;
}

/// Median angle by which the motion to the last image moved the points, without the rotation.
double true_parallax_rad(const InitializationBundle& bundle, const std::vector<CornerTrack>& tracks) {
  const SE3& T = bundle.T_camera_first.back();
  std::vector<double> angles;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const Vec3 turned = T.rotation * tracks[i].ray, moved = turned + bundle.rho[i] * T.translation;
    angles.push_back(std::atan2(turned.cross(moved).norm(), turned.dot(moved)));
  }
  return base::upper_median(std::move(angles));
}

/// Tells whether what is lower in the first image is nearer, as the ground is below an upright camera. The mirror
/// solution of a plane takes it for a wall that leans over.
bool is_nearer_below(const InitializationBundle& bundle, const std::vector<CornerTrack>& tracks) {
  double rho = 0.0, y = 0.0, product = 0.0;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    rho += bundle.rho[i];
    y += tracks[i].ray.y();
    product += bundle.rho[i] * tracks[i].ray.y();
  }
  return product * static_cast<double>(tracks.size()) > rho * y;
}

/// A point's displacement by the matches around it, the median of each coordinate.
Eigen::Vector2f displacement_around(const Eigen::Vector2f& point, const std::vector<keyframes::Feature>& a,
                                    const std::vector<keyframes::Feature>& b,
                                    const std::vector<keyframes::FeatureMatch>& matches) {
  constexpr std::ptrdiff_t kNearest = 5;
  std::vector<std::pair<float, std::size_t>> around;
  for (std::size_t i = 0; i < matches.size(); ++i)
    around.emplace_back((a[matches[i].a].pixel - point).squaredNorm(), i);
  std::partial_sort(around.begin(), around.begin() + kNearest, around.end());
  std::array<float, kNearest> x, y;
  for (std::ptrdiff_t i = 0; i < kNearest; ++i) {
    const keyframes::FeatureMatch& match = matches[around[i].second];
    x[i] = b[match.b].pixel.x() - a[match.a].pixel.x();
    y[i] = b[match.b].pixel.y() - a[match.a].pixel.y();
  }
  std::nth_element(x.begin(), x.begin() + kNearest / 2, x.end());
  std::nth_element(y.begin(), y.begin() + kNearest / 2, y.end());
  return {x[kNearest / 2], y[kNearest / 2]};
}

int count_found(const std::vector<std::optional<Eigen::Vector2f>>& pixels) {
  return static_cast<int>(std::ranges::count_if(pixels, [](const auto& pixel) { return pixel.has_value(); }));
}

}  // namespace

void Initializer::restart(std::shared_ptr<const keyframes::Pyramid> pyramid) {
  corners_.clear();
  parallax_.assign(1, 0.0);
  T_world_first_ = T_world_last_;
  last_try_parallax_ = 0.0;
  first_frame_ = frame_count_ - 1;
  for (const Eigen::Vector2f& p : find_corners(*pyramid, lens_.rays[0], options_.corners)) {
    const auto ray = lens_.lenses[0].unproject(p.cast<double>());
    if (ray) corners_.push_back({p, *ray, {}});
  }
  most_corners_ = std::max(most_corners_, static_cast<int>(corners_.size()));
  followed_.assign(1, static_cast<int>(corners_.size()));
  previous_ = std::move(pyramid);
  previous_features_ = std::move(next_features_);
  next_features_.clear();
}

int Initializer::advance_tracks(const keyframes::Pyramid& pyramid) {
  std::vector<Eigen::Vector2f> from;
  std::vector<Corner*> alive;
  for (Corner& corner : corners_) {
    const bool seen = corner.pixels.empty() || corner.pixels.back();
    if (seen) {
      from.push_back(corner.pixels.empty() ? corner.first_pixel : *corner.pixels.back());
      alive.push_back(&corner);
    } else {
      corner.pixels.emplace_back();
    }
  }
  const auto tracked = find_again(pyramid, from);
  for (std::size_t i = 0; i < alive.size(); ++i) alive[i]->pixels.push_back(tracked[i]);
  return count_found(tracked);
}

/// Finds the points of the previous image in the next one: near where they were, or, if most are not found there, near
/// where matched features went.
std::vector<std::optional<Eigen::Vector2f>> Initializer::find_again(const keyframes::Pyramid& pyramid,
                                                                    const std::vector<Eigen::Vector2f>& from) {
  constexpr double kMany = 0.5, kMore = 1.3;  // share of the points, and ratio to those found near. Chosen by hand
  auto near = track_corners(*previous_, pyramid, from);
  const int count = count_found(near);
  if (!far_apart_ && count >= kMany * static_cast<double>(from.size())) return near;
  const std::vector<Eigen::Vector2f> guesses = guesses_by_features(pyramid, from);
  if (guesses.empty()) return near;
  auto far = track_corners_from(*previous_, pyramid, from, guesses);
  const int count_far = count_found(far);
  if (count_far <= (far_apart_ ? 1.0 : kMore) * count || count_far < options_.min_tracks) return near;
  far_apart_ = true;
  return far;
}

/// Returns where points of the previous image are in the next one, by the features matched around them; empty if hardly
/// any match.
std::vector<Eigen::Vector2f> Initializer::guesses_by_features(const keyframes::Pyramid& pyramid,
                                                              const std::vector<Eigen::Vector2f>& from) {
  constexpr std::size_t kMany = 200, kFewestMatches = 30;
  if (previous_features_.empty())
    previous_features_ = keyframes::find_features(*previous_, lens_, keyframes::kManyFeatures);
  next_features_ = keyframes::find_features(pyramid, lens_, keyframes::kManyFeatures);
  const auto matches = keyframes::consistent_matches(previous_features_, next_features_,
                                                     keyframes::match_features(previous_features_, next_features_));
  const auto count = static_cast<int>(matches.size());
  if (std::min(previous_features_.size(), next_features_.size()) >= kMany)
    fewest_matches_ = fewest_matches_ < 0 ? count : std::min(fewest_matches_, count);
  if (matches.size() < kFewestMatches) return {};
  std::vector<double> steps_px;
  for (const keyframes::FeatureMatch& match : matches)
    steps_px.push_back((next_features_[match.b].pixel - previous_features_[match.a].pixel).norm());
  largest_step_px_ = std::max(largest_step_px_, base::upper_median(std::move(steps_px)));
  std::vector<Eigen::Vector2f> guesses;
  for (const Eigen::Vector2f& point : from)
    guesses.push_back(point + displacement_around(point, previous_features_, next_features_, matches));
  return guesses;
}

std::vector<RayPair> Initializer::ray_pairs_to(std::size_t picture) const {
  std::vector<RayPair> pairs;
  for (const Corner& corner : corners_) {
    const auto& pixel = corner.pixels[picture - 1];
    const auto ray = pixel ? lens_.lenses[0].unproject(pixel->cast<double>()) : std::nullopt;
    if (ray) pairs.push_back({corner.ray, *ray});
  }
  return pairs;
}

std::vector<std::size_t> Initializer::bundle_frames(std::size_t last) const {
  const std::size_t wanted = std::min<std::size_t>(last, options_.bundle_frames);
  std::vector<std::size_t> pictures;
  for (std::size_t i = 1; i <= wanted; ++i) pictures.push_back(i * last / wanted);
  return pictures;
}

std::vector<CornerTrack> Initializer::corner_tracks(const std::vector<std::size_t>& pictures,
                                                    std::vector<std::size_t>& corner_of_track) const {
  std::vector<CornerTrack> tracks;
  for (std::size_t c = 0; c < corners_.size(); ++c) {
    if (!corners_[c].pixels[pictures.back() - 1]) continue;
    CornerTrack track{corners_[c].ray, {}};
    for (const std::size_t k : pictures) {
      const auto& pixel = corners_[c].pixels[k - 1];
      track.pixels.push_back(pixel ? std::optional<Vec2>(pixel->cast<double>()) : std::nullopt);
    }
    tracks.push_back(std::move(track));
    corner_of_track.push_back(c);
  }
  return tracks;
}

std::optional<InitializationResult> Initializer::add(std::shared_ptr<const keyframes::Pyramid> pyramid,
                                                     const std::optional<SE3>& T_world_camera) {
  constexpr double kGrowth = 1.15;        // factor by which parallax must grow before the next attempt
  constexpr double kMinShareLeft = 0.25;  // of the corners that were followed into the second picture: fast motion
                                          // loses most at once, and those that are left are enough
  ++frame_count_;
  T_world_last_ = T_world_camera;
  if (!previous_ || frame_count_ <= options_.first_image + 1) {
    restart(std::move(pyramid));
    return std::nullopt;
  }
  const int followed = advance_tracks(*pyramid);
  if (parallax_.size() == 1) followed_at_first_ = followed;
  const bool too_few = followed < options_.min_tracks || followed < kMinShareLeft * followed_at_first_;
  const bool too_long = parallax_.size() >= static_cast<std::size_t>(options_.max_frames);
  if (too_few || too_long) {
    corners_were_lost_ = corners_were_lost_ || too_few;
    auto result = try_last_chance(parallax_.size() - 1);
    if (!result) restart(std::move(pyramid));
    return result;
  }
  followed_.push_back(followed);
  previous_ = std::move(pyramid);
  previous_features_ = std::move(next_features_);
  next_features_.clear();
  const RotationFit fit = fit_rotation(ray_pairs_to(parallax_.size()));
  parallax_.push_back(fit.median_rad);
  max_rotation_rad_ = std::max(max_rotation_rad_, fit.R_b_a.angularDistance(Eigen::Quaterniond::Identity()));
  max_parallax_ = std::max(max_parallax_, parallax_.back());
  if (far_apart_) return try_last_chance(parallax_.size() - 1);  // the next image has little in common with the first
  // Lower the threshold before the tracks are lost: over level ground seen from above, rotation absorbs most of the
  // parallax.
  const bool running_out = followed < 2 * options_.min_tracks ||
                           followed < 2.0 * kMinShareLeft * static_cast<double>(corners_.size()) ||
                           2 * parallax_.size() > static_cast<std::size_t>(options_.max_frames);
  const double least = running_out ? options_.fallback_parallax_rad : options_.min_parallax_rad;
  if (parallax_.size() < kMinPictures || parallax_.back() < std::max(least, kGrowth * last_try_parallax_))
    return std::nullopt;
  last_try_parallax_ = parallax_.back();
  auto result = try_initialize();
  // A minority of the corners gets one attempt: what is left of them may be those that were followed wrongly.
  if (!result && followed < kMinShareLeft * static_cast<double>(corners_.size())) restart(previous_);
  return result;
}

std::vector<SE3> Initializer::motion_candidates(std::size_t picture) const {
  // Inlier threshold of the relative pose. Chosen by hand.
  constexpr double kThreshold_px = 1.5;
  if (T_world_first_ && T_world_last_) {
    const SE3 T_last_first = T_world_last_->inverse() * *T_world_first_;
    const double baseline = T_last_first.translation.norm();
    if (baseline > 0) return {SE3(T_last_first.rotation, T_last_first.translation / baseline)};
  }
  return relative_pose_candidates(ray_pairs_to(picture), kThreshold_px / lens_.lenses[0].focal_px(), options_.seed);
}

/// The candidates refined over the images, without those that have points behind the camera, the best one first.
std::vector<InitializationBundle> Initializer::fit_candidates(const std::vector<std::size_t>& pictures,
                                                              const std::vector<CornerTrack>& tracks) {
  constexpr int kIterations = 30;
  const std::vector<SE3> candidates = motion_candidates(pictures.back());
  std::vector<InitializationBundle> all(candidates.size());
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t i) {
    all[i] = bundle_adjust(lens_.lenses[0], tracks, pictures.size(), candidates[i], kIterations);
  });
  std::stable_sort(all.begin(), all.end(),
                   [](const InitializationBundle& a, const InitializationBundle& b) { return a.cost < b.cost; });
  std::erase_if(all, [&](const InitializationBundle& b) { return b.behind_share > kMaxBehindShare; });
  if (!all.empty()) last_fit_px_ = all.front().median_residual_px;
  return all;
}

std::optional<InitializationResult> Initializer::try_initialize() {
  const std::vector<std::size_t> pictures = bundle_frames(parallax_.size() - 1);
  std::vector<std::size_t> corner_of_track;
  const std::vector<CornerTrack> tracks = corner_tracks(pictures, corner_of_track);
  const std::vector<InitializationBundle> all = fit_candidates(pictures, tracks);
  if (all.empty()) return std::nullopt;
  const InitializationBundle& best = all.front();
  if (best.median_residual_px > options_.max_median_residual_px) return std::nullopt;
  double ratio = 0.0;
  for (std::size_t i = 1; i < all.size() && ratio == 0.0; ++i) {
    if (!same_solution(best, all[i])) ratio = best.cost / all[i].cost;
  }
  if (ratio > options_.max_cost_ratio && parallax_.back() < options_.sufficient_parallax_rad) return std::nullopt;
  InitializationResult start = build_result(best, pictures, corner_of_track);
  start.cost_ratio = ratio;
  return start;
}

/// Tries the images up to `last` at most, where there will be no more of them. A rotation may absorb most of the
/// parallax (a narrow lens over level ground), so that the points' own parallax counts. Of hypotheses that fit alike,
/// those are left out that have corners behind the camera which were lost on the way; then the ground decides.
std::optional<InitializationResult> Initializer::try_last_chance(std::size_t last) {
  constexpr double kManyLeft = 0.5;  // of the corners; chosen by hand
  while (last + 1 > kMinPictures && followed_[last] < kManyLeft * followed_[0]) --last;
  if (last + 1 < kMinPictures || parallax_[last] * lens_.lenses[0].focal_px() < kLeastMotion_px) return std::nullopt;
  const std::vector<std::size_t> pictures = bundle_frames(last);
  std::vector<std::size_t> corner_of_track;
  const std::vector<CornerTrack> tracks = corner_tracks(pictures, corner_of_track);
  std::vector<InitializationBundle> all = fit_candidates(pictures, tracks);
  std::erase_if(all, [&](const InitializationBundle& bundle) {
    return bundle.median_residual_px > options_.max_median_residual_px ||
           behind_share(bundle, pictures) > kMaxBehindShare ||
           true_parallax_rad(bundle, tracks) < options_.min_parallax_rad;
  });
  if (all.empty()) return std::nullopt;
  const auto fits_alike = [&](const InitializationBundle& bundle) {
    return all.front().cost > options_.max_cost_ratio * bundle.cost;
  };
  auto chosen = std::ranges::find_if(
      all, [&](const InitializationBundle& bundle) { return fits_alike(bundle) && is_nearer_below(bundle, tracks); });
  if (chosen == all.end()) chosen = all.begin();
  return build_result(*chosen, pictures, corner_of_track);
}

/// Share of all corners, each in the last of `pictures` that it was found in, that are behind the camera.
double Initializer::behind_share(const InitializationBundle& bundle, const std::vector<std::size_t>& pictures) const {
  constexpr double kLongPart = 0.3;  // of the motion; shorter ones tell nothing. Chosen by hand
  const double motion = bundle.T_camera_first.back().translation.norm();
  int count = 0, behind = 0;
  for (const Corner& corner : corners_) {
    for (std::size_t k = pictures.size(); k-- > 0;) {
      const auto& pixel = corner.pixels[pictures[k] - 1];
      const SE3& T = bundle.T_camera_first[k];
      if (!pixel) continue;
      const auto ray = lens_.lenses[0].unproject(pixel->cast<double>());
      if (!ray || T.translation.norm() < kLongPart * motion) break;
      ++count;
      behind += triangulate_inverse_distance(T, {corner.ray, *ray}) < 0.0;
      break;
    }
  }
  return static_cast<double>(behind) / std::max(1, count);
}

InitializationResult Initializer::build_result(const InitializationBundle& bundle,
                                               const std::vector<std::size_t>& pictures,
                                               const std::vector<std::size_t>& corner_of_track) const {
  const std::size_t count = pictures.back() + 1;
  InitializationResult start;
  start.first_frame = first_frame_;
  start.parallax_rad.assign(parallax_.begin(), parallax_.begin() + static_cast<std::ptrdiff_t>(count));
  start.far_apart = far_apart_;
  start.median_residual_px = bundle.median_residual_px;
  start.T_camera_first.assign(count, SE3());
  std::vector<std::size_t> every;
  for (std::size_t k = 1; k < count; ++k) every.push_back(k);
  std::vector<std::size_t> same;
  const std::vector<CornerTrack> tracks = corner_tracks(every, same);
  for (std::size_t k = 1; k < count; ++k) {
    const auto exact = std::find(pictures.begin(), pictures.end(), k);
    start.T_camera_first[k] = exact != pictures.end()
                                  ? bundle.T_camera_first[exact - pictures.begin()]
                                  : resect(lens_.lenses[0], tracks, bundle.rho, k - 1, start.T_camera_first[k - 1]);
  }
  for (std::size_t i = 0; i < corner_of_track.size(); ++i) {
    if (bundle.rho[i] <= 0) continue;
    start.pixels.push_back(corners_[corner_of_track[i]].first_pixel);
    start.rho.push_back(static_cast<float>(bundle.rho[i]));
  }
  return start;
}

std::string Initializer::failure_reason() const {
  const std::string seen = std::to_string(max_parallax_ * 180.0 / std::numbers::pi).substr(0, 4) + " degrees";
  const std::string moved = "rays moved by at most " + seen + " after removing the best rotation";
  if (frame_count_ < 3) return "no parallax: there are only " + std::to_string(frame_count_) + " images";
  constexpr double kTurns_rad = 0.05, kMuchMore = 4.0;  // rotation, and its ratio to the parallax. Chosen by hand
  const bool turns = max_rotation_rad_ > std::max(kTurns_rad, kMuchMore * max_parallax_);
  const bool only_turns = turns && max_parallax_ * lens_.lenses[0].focal_px() < kLeastMotion_px;
  if (corners_were_lost_ && fewest_matches_ >= 0 && !only_turns) return far_apart_reason();
  if (max_parallax_ >= options_.min_parallax_rad)
    return "initialization failed: the parallax is " + seen + ", but no rigid motion fits the tracks (last residual " +
           std::to_string(last_fit_px_).substr(0, 4) + " px)";
  if (most_corners_ < options_.min_tracks)
    return "no parallax: no image has more than " + std::to_string(most_corners_) + " corners to follow, of " +
           std::to_string(options_.min_tracks) + " that are needed (a mask, fog, blur or bare ground)";
  if (turns)
    return "no parallax: the camera turns, by " +
           std::to_string(max_rotation_rad_ * 180.0 / std::numbers::pi).substr(0, 4) +
           " degrees, but seems not to move from its place (" + moved + ")" +
           (corners_were_lost_ ? "; from image to image the view changed so much that corners were lost" : "") +
           "; use a part in which it flies (--from)";
  if (corners_were_lost_)
    return "no parallax: from image to image the view changed so much that corners were lost before (" + moved +
           "); images may be missing, blurred, too far apart or out of order";
  return "no parallax: the camera hardly moves (" + moved + "); use a part in which it flies (--from)";
}

/// The images have features, and those of one are hardly found in the next.
std::string Initializer::far_apart_reason() const {
  const int width = lens_.rays[0].width;
  std::string reason = "the images are too far apart to be tracked: ";
  reason += largest_step_px_ > 0.0
                ? "what is found again moves by up to " + base::formatted("%.0f", largest_step_px_) +
                      " pixels from one image to the next, in images " + std::to_string(width) + " wide"
                : "nothing of an image is found in the next one, so that it moves by more than half of the image, " +
                      std::to_string(width / 2) + " pixels";
  return reason + " (" + std::to_string(fewest_matches_) + " matched features at worst), and fewer than " +
         std::to_string(options_.min_tracks) +
         " corners are seen by three images in a row; use images that overlap by 70 %, the frames in between "
         "(--every; every in an experiment), or --system colmap (odometry: {system: colmap} in an experiment), if "
         "`tileflight systems` says that it is installed";
}

}  // namespace tileflight::initialization
