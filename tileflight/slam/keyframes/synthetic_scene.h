#pragma once

// For tests: a synthetic relief rendered through any lens from known poses.

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/slam/keyframes/synthetic_relief.h"

namespace tileflight::keyframes::test_support {

using Four = base::Double4;
using FourMask = base::Mask4;

TILEFLIGHT_LANE_INLINE bool any(const FourMask& mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }
/// Where the mask is set, the value changes to another.
TILEFLIGHT_LANE_INLINE void change(const FourMask& mask, const Four& to, Four& value) {
  value = reinterpret_cast<Four>((reinterpret_cast<FourMask>(to) & mask) | (reinterpret_cast<FourMask>(value) & ~mask));
}

/// Four rays, for which hit_distance() goes in step over hills of sines: what one waits for, another computes. The bits
/// are those of each ray alone; one that has arrived stays as it is.
struct FourRays {
  std::array<Vec3, 4> origins, rays;
  std::array<double, 4> distances{};  ///< guesses, then where they meet the ground

  TILEFLIGHT_LANE_INLINE void above(const SineHills& hills, const Four& d, Four& out) const {
    Four height_m;
    hills.heights(x + d * along_x, y + d * along_y, height_m);
    out = z + d * along_z - height_m;
  }
  TILEFLIGHT_LANE_INLINE void store(const FourMask& mask, const Four& d) {
    for (int i = 0; i < 4; ++i) distances[i] = mask[i] != 0 ? d[i] : distances[i];
  }

  /// meeting_from_guess()
  TILEFLIGHT_LANE_INLINE void go_from_guess(const SineHills& hills) {
    Four d = guess, slope = -along_z, value, value_there;
    above(hills, d, value);
    Four least{}, most = Four{} + std::numeric_limits<double>::infinity();
    FourMask goes = by_guess;
    for (int i = 0; i < 60; ++i) {
      goes &= (value > 1e-7) | (value < -1e-7);
      if (!any(goes)) break;
      const Four by_slowest = d + value / slowest, by_fastest = d + value / fastest;
      Four low = by_slowest, high = by_slowest;
      change(by_fastest < by_slowest, by_fastest, low);
      change(by_slowest < by_fastest, by_fastest, high);
      change(least < low, low, least);
      change(high < most, high, most);
      Four next = d + value / slope;
      change(~((next > least) & (next < most)), 0.5 * (least + most), next);
      above(hills, next, value_there);
      Four secant = (value - value_there) / (next - d);
      change(fastest < secant, fastest, secant);
      change(secant < slowest, slowest, secant);
      change(goes, secant, slope);
      change(goes, next, d);
      change(goes, value_there, value);
    }
    store(by_guess, d + value / slope);
  }

  /// first_meeting()
  TILEFLIGHT_LANE_INLINE void go_by_steps(const SineHills& hills, double highest_m) {
    constexpr double kFar_m = 300.0;
    Four near{}, near_above, far, far_above, value;
    for (int i = 0; i < 4; ++i)
      if (along_z[i] < 0) near[i] = std::max(0.0, (z[i] - highest_m) / -along_z[i]);
    far = near;
    above(hills, near, near_above);
    far_above = near_above;
    FourMask never{};
    for (FourMask goes = by_steps & (far_above > 0.0); any(goes); goes &= ~never & (far_above > 0.0)) {
      change(goes, far, near);
      change(goes, far_above, near_above);
      Four step = 0.5 * far_above;
      change(step < 0.25, Four{} + 0.25, step);
      change(goes, far + step, far);
      never |= goes & (far > kFar_m);
      above(hills, far, value);
      change(goes, value, far_above);
    }
    Four result{}, kept{};
    FourMask goes = by_steps & ~never, found{};
    for (int i = 0; i < 20; ++i) {
      goes &= (far - near > 1e-9) & (near_above - far_above > 1e-7);
      if (!any(goes)) break;
      const Four share = near_above / (near_above - far_above), between = near + share * (far - near);
      above(hills, between, value);
      const FourMask there = goes & (value < 1e-9) & (value > -1e-9);
      change(there, between, result);
      found |= there;
      goes &= ~there;
      const FourMask is_near = goes & (value > 0.0), is_far = goes & ~(value > 0.0);
      change(is_near, between, near);
      change(is_near, value, near_above);
      change(is_far, between, far);
      change(is_far, value, far_above);
      change(is_near & (kept == 1.0), 0.5 * far_above, far_above);
      change(is_far & (kept == -1.0), 0.5 * near_above, near_above);
      change(is_near, Four{} + 1.0, kept);
      change(is_far, Four{} - 1.0, kept);
    }
    Four fall = near_above - far_above;
    change(fall < 1e-12, Four{} + 1e-12, fall);
    change(by_steps & ~never & ~found, near + (far - near) * near_above / fall, result);
    store(by_steps, result);
  }

  FourMask by_guess{}, by_steps{};
  Four slowest{}, fastest{}, guess{};
  Four x{}, y{}, z{}, along_x{}, along_y{}, along_z{};
};

TILEFLIGHT_WIDE_VECTORS
static void go(FourRays& four, const SineHills& hills, double highest_m) {
  if (any(four.by_guess)) four.go_from_guess(hills);
  if (any(four.by_steps)) four.go_by_steps(hills, highest_m);
}

/// hit_distance() of four rays; `four.distances` begins with their guesses.
inline void hit_distances(const Relief& relief, const SineHills& hills, FourRays& four) {
  four.by_guess = four.by_steps = FourMask{};
  for (int i = 0; i < 4; ++i) {
    const Vec3 &origin = four.origins[i], &ray = four.rays[i];
    double& distance = four.distances[i];
    four.x[i] = origin.x(), four.y[i] = origin.y(), four.z[i] = origin.z();
    four.along_x[i] = ray.x(), four.along_y[i] = ray.y(), four.along_z[i] = ray.z();
    four.slowest[i] = four.fastest[i] = four.guess[i] = 1.0;
    if (ray.z() >= 0 && origin.z() > relief.highest_m) {
      distance = 0.0;
      continue;
    }
    const Descent descent{relief, origin, ray};
    four.slowest[i] = descent.slowest, four.fastest[i] = descent.fastest;
    (falls_faster_than_the_ground(descent) ? four.by_guess : four.by_steps)[i] = -1;
    four.guess[i] = distance > 0 ? distance : origin.z() / -ray.z();
  }
  go(four, hills, relief.highest_m);
}

/// Renders a relief through one camera, one ray per pixel.
class ReliefCamera {
 public:
  ReliefCamera(const imaging::Camera& camera, Relief relief) : camera_(camera), relief_(std::move(relief)) {
    for (int i = 0; i < camera.width() * camera.height(); ++i) {
      rays_.push_back(camera.unproject({i % camera.width(), i / camera.width()}).value_or(Vec3::Zero()));
    }
    const int middle = camera.height() / 2 * camera.width() + camera.width() / 2;
    pixel_rad_ = (rays_[middle] - rays_[middle + 1]).norm();
  }

  const imaging::Camera& camera() const { return camera_; }
  const Relief& relief() const { return relief_; }

  imaging::RgbImage render(const SE3& T_local_camera) const {
    return render_by_rows([&](int) { return T_local_camera; });
  }

  /// Renders each row with its own pose T_local_camera (rolling shutter).
  imaging::RgbImage render_by_rows(const std::function<SE3(int)>& pose_of_row) const {
    imaging::RgbImage image(camera_.width(), camera_.height());
    const auto* hills = relief_.height_m.target<SineHills>();
    tbb::parallel_for(0, (image.height + 3) / 4, [&](int block) {
      std::array<SE3, 4> poses;
      for (int row = 0; row < 4; ++row) poses[row] = pose_of_row(std::min(4 * block + row, image.height - 1));
      render_four_rows(4 * block, poses, hills, image);
    });
    return image;
  }

 private:
  /// From `first` on, as many as there are.
  void render_four_rows(int first, const std::array<SE3, 4>& poses, const SineHills* hills,
                        imaging::RgbImage& image) const {
    std::array<geometry::Mat3, 4> R;
    std::array<double, 4> before{}, last{};  // distances of the two pixels before
    FourRays four;
    for (std::size_t row = 0; row < 4; ++row) {
      R[row] = poses[row].rotation.toRotationMatrix();
      four.origins[row] = poses[row].translation;
    }
    for (int x = 0; x < image.width; ++x) {
      for (int row = 0; row < 4; ++row) {
        const int y = std::min(first + row, image.height - 1);
        four.rays[row] = R[row] * rays_[static_cast<std::size_t>(y) * image.width + x];
        four.distances[row] = 2.0 * last[row] - before[row];  // as it goes on from pixel to pixel
      }
      if (hills != nullptr) {
        hit_distances(relief_, *hills, four);
      } else {
        for (std::size_t row = 0; row < 4; ++row)
          four.distances[row] = hit_distance(relief_, four.origins[row], four.rays[row], four.distances[row]);
      }
      before = last;
      last = four.distances;
      for (int row = 0; row < 4 && first + row < image.height; ++row)
        image(x, first + row) = seen(four.origins[row], four.rays[row], four.distances[row]);
    }
  }

  imaging::Rgb8 seen(const Vec3& origin, const Vec3& ray, double distance) const {
    const Vec3 p = origin + distance * ray;
    const double footprint = distance * pixel_rad_ / std::max(0.2, -ray.z());
    const double value = distance > 0 ? relief_.grey(p.x(), p.y(), footprint) : relief_.sky(ray);
    const auto grey = static_cast<std::uint8_t>(std::lround(value));
    return {grey, grey, grey};
  }

  imaging::Camera camera_;
  Relief relief_;
  std::vector<Vec3> rays_;
  double pixel_rad_ = 0.0;
};

/// Camera pose looking along `forward`, with the world's z axis up in the image.
inline SE3 look_along(const Vec3& position, const Vec3& forward) {
  const Vec3 z = forward.normalized(), x = z.cross(Vec3::UnitZ()).normalized();
  geometry::Mat3 R;
  R << x, z.cross(x), z;
  return SE3(R, position);
}

}  // namespace tileflight::keyframes::test_support
