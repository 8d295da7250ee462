#include "tileflight/slam/initialization/initializer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tileflight::initialization {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

bool same_solution(const InitializationBundle& a, const InitializationBundle& b) {
  constexpr double kDirection_rad = 0.1, kRotation_rad = 0.02;
  const SE3& x = a.T_camera_first.back();
  const SE3& y = b.T_camera_first.back();
  const double direction = std::acos(std::clamp(x.translation.normalized().dot(y.translation.normalized()), -1.0, 1.0));
  return direction < kDirection_rad && geometry::so3_log(x.rotation.conjugate() * y.rotation).norm() < kRotation_rad;
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
  previous_ = std::move(pyramid);
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
  const auto tracked = track_corners(*previous_, pyramid, from);
  int count = 0;
  for (std::size_t i = 0; i < alive.size(); ++i) {
    alive[i]->pixels.push_back(tracked[i]);
    count += tracked[i].has_value();
  }
  return count;
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

std::vector<std::size_t> Initializer::bundle_frames() const {
  const std::size_t last = parallax_.size() - 1;
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
    restart(std::move(pyramid));
    return std::nullopt;
  }
  previous_ = std::move(pyramid);
  const RotationFit fit = fit_rotation(ray_pairs_to(parallax_.size()));
  parallax_.push_back(fit.median_rad);
  max_rotation_rad_ = std::max(max_rotation_rad_, fit.R_b_a.angularDistance(Eigen::Quaterniond::Identity()));
  max_parallax_ = std::max(max_parallax_, parallax_.back());
  constexpr std::size_t kMinPictures = 3;
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

std::optional<InitializationResult> Initializer::try_initialize() {
  constexpr int kIterations = 30;
  // Largest share of tracks behind the camera. Chosen by hand.
  constexpr double kMaxBehindShare = 0.1;
  const keyframes::Lens& lens = lens_.lenses[0];
  const std::size_t last = parallax_.size() - 1;
  const std::vector<SE3> candidates = motion_candidates(last);
  const std::vector<std::size_t> pictures = bundle_frames();
  std::vector<std::size_t> corner_of_track;
  const std::vector<CornerTrack> tracks = corner_tracks(pictures, corner_of_track);
  std::vector<InitializationBundle> all(candidates.size());
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t i) {
    all[i] = bundle_adjust(lens, tracks, pictures.size(), candidates[i], kIterations);
  });
  std::stable_sort(all.begin(), all.end(),
                   [](const InitializationBundle& a, const InitializationBundle& b) { return a.cost < b.cost; });
  std::erase_if(all, [&](const InitializationBundle& b) { return b.behind_share > kMaxBehindShare; });
  if (all.empty()) return std::nullopt;
  const InitializationBundle& best = all.front();
  last_fit_px_ = best.median_residual_px;
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

InitializationResult Initializer::build_result(const InitializationBundle& bundle,
                                               const std::vector<std::size_t>& pictures,
                                               const std::vector<std::size_t>& corner_of_track) const {
  InitializationResult start;
  start.first_frame = first_frame_;
  start.parallax_rad = parallax_;
  start.median_residual_px = bundle.median_residual_px;
  start.T_camera_first.assign(parallax_.size(), SE3());
  std::vector<std::size_t> every;
  for (std::size_t k = 1; k < parallax_.size(); ++k) every.push_back(k);
  std::vector<std::size_t> same;
  const std::vector<CornerTrack> tracks = corner_tracks(every, same);
  for (std::size_t k = 1; k < parallax_.size(); ++k) {
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
  const double degrees = max_parallax_ * 180.0 / std::numbers::pi;
  const std::string seen = std::to_string(degrees).substr(0, 4) + " degrees";
  if (max_parallax_ < options_.min_parallax_rad) {
    constexpr double kTurns_rad = 0.05, kMuchMore = 4.0;  // rotation, and its ratio to the parallax. Chosen by hand
    const std::string moved = "rays moved by at most " + seen + " after removing the best rotation";
    if (frame_count_ < 3) return "no parallax: there are only " + std::to_string(frame_count_) + " images";
    if (most_corners_ < options_.min_tracks)
      return "no parallax: no image has more than " + std::to_string(most_corners_) + " corners to follow, of " +
             std::to_string(options_.min_tracks) + " that are needed (a mask, fog, blur or bare ground)";
    if (max_rotation_rad_ > std::max(kTurns_rad, kMuchMore * max_parallax_))
      return "no parallax: the camera turns, by " +
             std::to_string(max_rotation_rad_ * 180.0 / std::numbers::pi).substr(0, 4) +
             " degrees, but seems not to move from its place (" + moved + "); use a part in which it flies (--from)";
    if (corners_were_lost_)
      return "no parallax: from image to image the view changed so much that corners were lost before (" + moved +
             "); images may be missing, blurred, too far apart or out of order";
    return "no parallax: the camera hardly moves (" + moved + "); use a part in which it flies (--from)";
  }
  return "initialization failed: the parallax is " + seen + ", but no rigid motion fits the tracks (last residual " +
         std::to_string(last_fit_px_).substr(0, 4) + " px)";
}

}  // namespace tileflight::initialization
