#include "tileflight/slam/odometry/line_delay_record.h"

#include <cmath>

namespace tileflight::odometry {

LineDelayPasses track_with_line_delay(double given_s, const std::function<OdometryResult(double line_delay_s)>& track) {
  constexpr double kSignificant = 3.0;  // standard deviations
  constexpr double kSettled = 0.2;      // the same: a smaller change is not worth another pass. Chosen by hand
  constexpr int kMostPasses = 4;
  LineDelayPasses found{.result = track(given_s), .line_delay_s = given_s, .estimate = {}, .passes = 1};
  for (;;) {
    found.estimate = found.result.line_delay;
    if (!found.estimate) return found;
    const double change_s = found.estimate->line_delay_s, sigma_s = found.estimate->sigma_s;
    found.estimate->line_delay_s += found.line_delay_s;
    const bool is_significant = std::abs(found.estimate->line_delay_s - given_s) > kSignificant * sigma_s;
    if (!is_significant && found.line_delay_s == given_s) return found;
    if (is_significant && (std::abs(change_s) < kSettled * sigma_s || found.passes == kMostPasses)) return found;
    found.line_delay_s = is_significant ? found.estimate->line_delay_s : given_s;
    found.result = track(found.line_delay_s);
    ++found.passes;
    if (!is_significant) return found;
  }
}

namespace {

/// Factor on the standard deviation. Errors that are not modelled (lens, brightness, velocities between images) do not
/// only scatter from block to block: over eight excerpts of a hand-held recording of 7-Scenes, there and back,
/// estimates differ by so many of the sigmas.
constexpr double kSigmaInflation = 3.0;

}  // namespace

LineDelayRecord::Motion LineDelayRecord::motion(const geometry::SE3& T_to_from, double interval_s) {
  if (interval_s == 0.0) return {};
  return {T_to_from.log() / interval_s, interval_s};
}

/// The velocity at an image, of a motion whose acceleration is constant from the image before it to the one after it.
std::optional<geometry::Vec6> LineDelayRecord::velocity_between(const Motion& before, const Motion& after) {
  if (before.interval_s == 0.0) return after.interval_s == 0.0 ? std::nullopt : std::optional(after.velocity);
  if (after.interval_s == 0.0) return std::nullopt;
  return (after.interval_s * before.velocity + before.interval_s * after.velocity) /
         (before.interval_s + after.interval_s);
}

void LineDelayRecord::begin(const std::vector<TrackedFrame>& tracked, const mapping::Mapper& mapper) {
  const auto T_camera_map = [&](const TrackedFrame& frame) {
    return frame.T_camera_keyframe * mapper.window().keyframes[static_cast<std::size_t>(frame.keyframe)].T_camera_map();
  };
  const auto between = [&](std::size_t from, std::size_t to) {
    return motion(T_camera_map(tracked[to]) * T_camera_map(tracked[from]).inverse(),
                  tracked[to].time_s - tracked[from].time_s);
  };
  for (std::size_t i = 0; i < tracked.size(); ++i) {
    const keyframes::Keyframe& host = mapper.window().keyframes[static_cast<std::size_t>(tracked[i].keyframe)];
    if (host.frame_index != tracked[i].index) continue;
    const Motion before = i > 0 ? between(i - 1, i) : Motion{};
    if (i + 1 == tracked.size()) {
      last_ = before;
      add_keyframe(host.id);
    } else if (const auto velocity = velocity_between(before, between(i, i + 1))) {
      velocities_[host.id] = *velocity;
    }
  }
}

void LineDelayRecord::follow(const LastFrame& image) {
  last_ = motion(image.T_last_before_last, image.interval_s);
  if (!newest_) return;
  if (const auto velocity = velocity_between(before_newest_, last_)) velocities_[*newest_] = *velocity;
  newest_.reset();
}

void LineDelayRecord::add_window(const mapping::Mapper& mapper, const keyframes::Lens& lens) {
  std::vector<geometry::Vec6> velocities;
  for (const keyframes::Keyframe& keyframe : mapper.window().keyframes) {
    const auto found = velocities_.find(keyframe.id);
    if (found == velocities_.end()) return;
    velocities.push_back(found->second);
  }
  windows_.push_back(mapping::line_delay_system(mapper.window(), lens, velocities));
}

void LineDelayRecord::add_keyframe(int id) {
  newest_ = id;
  before_newest_ = last_;
}

std::optional<mapping::LineDelayEstimate> LineDelayRecord::estimate(const mapping::Mapper& mapper) const {
  auto found = mapping::estimate_line_delay(windows_, mapper.given_intrinsics_information());
  if (found) found->sigma_s *= kSigmaInflation;
  return found;
}

}  // namespace tileflight::odometry
