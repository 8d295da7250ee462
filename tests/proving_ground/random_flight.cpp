#include "random_flight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/base/random_numbers.h"

namespace tileflight::proving_ground {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

constexpr double kRadians = std::numbers::pi / 180.0;
constexpr double kTurnRate_deg_s = 30.0;  ///< mean of a turn in place

class Random {
 public:
  explicit Random(std::uint64_t seed) : bits_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(bits_.next() >> 11) * 0x1p-53;
  }
  double log_uniform(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }
  bool chance(double share) { return uniform(0.0, 1.0) < share; }
  template <class T, std::size_t N>
  T pick(const std::array<T, N>& values) {
    return values[bits_.below(N)];
  }

 private:
  base::SplitMix64 bits_;
};

/// Where the path is after a part of it (0 to 1), and which way it leads.
struct PathPoint {
  Vec2 position = Vec2::Zero();  ///< metres from the start, east and north
  double heading_rad = 0.0;      ///< clockwise from north
  double climbed = 0.0;          ///< in heights
  double turn = 0.0;             ///< curvature times height: positive to the right
  double extra_yaw_rad = 0.0;    ///< of the camera, beside the path's heading
};

Vec2 along(double heading_rad) { return {std::sin(heading_rad), std::cos(heading_rad)}; }

/// `length_m` on a circle of `radius_m` to the right.
PathPoint on_circle(double heading_rad, double radius_m, double length_m) {
  const double turned = length_m / radius_m;
  const Vec2 right = along(heading_rad + std::numbers::pi / 2);
  return {radius_m * (std::sin(turned) * along(heading_rad) + (1.0 - std::cos(turned)) * right), heading_rad + turned};
}

/// Legs to and fro, joined by half circles.
PathPoint on_lawnmower(double heading_rad, double leg_m, double spacing_m, double length_m) {
  const double turn_m = std::numbers::pi * spacing_m / 2;
  Vec2 start = Vec2::Zero();
  double side = 1.0;
  while (true) {
    if (length_m <= leg_m) return {start + length_m * along(heading_rad), heading_rad};
    length_m -= leg_m;
    start += leg_m * along(heading_rad);
    if (length_m <= turn_m) {
      const PathPoint p = on_circle(0.0, spacing_m / 2, length_m);
      const Vec2 right = along(heading_rad + std::numbers::pi / 2);
      return {start + p.position.y() * along(heading_rad) + side * p.position.x() * right,
              heading_rad + side * p.heading_rad, 0.0, side};
    }
    length_m -= turn_m;
    start += side * spacing_m * along(heading_rad + std::numbers::pi / 2);
    heading_rad += side * std::numbers::pi;
    side = -side;
  }
}

/// A shape with its own random numbers: share of the flight done (0 to 1) to the path's point.
std::function<PathPoint(double)> shape_of(const FlightDraw& draw, Random& random) {
  const double heading = draw.heading_deg * kRadians;
  const double length_m = draw.speed_m_s * (draw.frames - 1) / draw.fps;
  switch (draw.kind) {
    case FlightKind::kStraight:
      return [=](double share) { return PathPoint{share * length_m * along(heading), heading}; };
    case FlightKind::kArc:
    case FlightKind::kOrbit: {
      const double radius_m = length_m / (draw.turn_deg * kRadians);
      return [=](double share) {
        PathPoint p = on_circle(heading, radius_m, share * length_m);
        if (draw.kind == FlightKind::kOrbit) p.extra_yaw_rad = std::numbers::pi / 2;  // to the middle
        p.turn = std::min(1.0, draw.height_m / radius_m);
        return p;
      };
    }
    case FlightKind::kLawnmower: {
      const double spacing_m = std::min(0.5 * draw.height_m, 0.15 * length_m) * random.uniform(0.7, 1.3);
      const double leg_m = 0.28 * length_m;
      const bool keeps_yaw = random.chance(0.5);
      return [=](double share) {
        PathPoint p = on_lawnmower(heading, leg_m, spacing_m, share * length_m);
        if (keeps_yaw) p.extra_yaw_rad = heading - p.heading_rad;
        return p;
      };
    }
    case FlightKind::kHoverAndTurn: {
      // On, stop, turn in place, on in the new direction.
      const double turned = draw.turn_deg * kRadians;
      const double turning = std::abs(draw.turn_deg) / kTurnRate_deg_s * draw.fps / (draw.frames - 1);
      const double stop = 0.5 * (1.0 - turning), go = stop + turning;
      return [=](double share) {
        const Vec2 middle = stop * length_m * along(heading);
        if (share <= stop) return PathPoint{share * length_m * along(heading), heading};
        const double part = std::min(1.0, (share - stop) / turning);
        PathPoint p{middle + std::max(0.0, share - go) * length_m * along(heading + turned), heading};
        p.extra_yaw_rad = part * part * (3.0 - 2.0 * part) * turned;
        return p;
      };
    }
    case FlightKind::kClimb: {
      const double climbed = random.uniform(0.8, 2.0);
      return [=](double share) {
        PathPoint p{0.15 * share * length_m * along(heading), heading};
        p.climbed = share * climbed;
        return p;
      };
    }
  }
  return {};
}

std::optional<double> highest_surface(const Ground& ground, const Vec2& at) {
  const double top = ground.region.max().z() + 10.0;
  const auto hit = ground.scene.intersect({Vec3(at.x(), at.y(), top), -Vec3::UnitZ()});
  if (!hit) return std::nullopt;
  return top - hit->distance_m;
}

/// Highest surface within `radius_m`; nullopt where there is none below.
std::optional<double> ground_near(const Ground& ground, const Vec2& at, double radius_m) {
  std::optional<double> highest = highest_surface(ground, at);
  if (!highest) return std::nullopt;
  constexpr int kAround = 8;
  for (int k = 0; k < kAround; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / kAround;
    const auto z = highest_surface(ground, at + radius_m * Vec2(std::cos(angle), std::sin(angle)));
    if (z) highest = std::max(*highest, *z);
  }
  return highest;
}

std::vector<double> smoothed(const std::vector<double>& values, int reach) {
  std::vector<double> result;
  const int n = static_cast<int>(values.size());
  for (int i = 0; i < n; ++i) {
    double sum = 0.0;
    int count = 0;
    for (int k = std::max(0, i - reach); k <= std::min(n - 1, i + reach); ++k, ++count) sum += values[k];
    result.push_back(sum / count);
  }
  return result;
}

/// Slow unrest, two sines an axis.
struct Sway {
  std::array<double, 6> phase{};
  double amplitude = 0.0;

  explicit Sway(Random& random, double a) : amplitude(a) {
    for (double& p : phase) p = random.uniform(0.0, 2.0 * std::numbers::pi);
  }
  double operator()(int axis, double time_s) const {
    const auto k = static_cast<std::size_t>(2 * axis);
    return amplitude * (0.6 * std::sin(1.3 * time_s + phase[k]) + 0.4 * std::sin(3.1 * time_s + phase[k + 1]));
  }
};

bool keeps_clear(const Ground& ground, const geometry::Trajectory& poses, double clear_m) {
  return std::ranges::all_of(poses.poses, [&](const geometry::StampedPose& pose) {
    return !ground.surface.nearest(pose.T_local_camera.translation, clear_m);
  });
}

/// Share of a picture's rays that meet the place.
double share_seen(const Ground& ground, const SE3& T_local_camera, const imaging::Camera& camera) {
  constexpr int kAcross = 8;
  int rays = 0, hits = 0;
  for (int y = 0; y < kAcross; ++y) {
    for (int x = 0; x < kAcross; ++x) {
      const Vec2 pixel((x + 0.5) * camera.width() / kAcross, (y + 0.5) * camera.height() / kAcross);
      const auto ray = camera.unproject(pixel);
      if (!ray) continue;
      ++rays;
      if (ground.scene.intersect({T_local_camera.translation, T_local_camera.rotation * ray->normalized()}, 500.0))
        ++hits;
    }
  }
  return rays > 0 ? static_cast<double>(hits) / rays : 0.0;
}

std::optional<geometry::Trajectory> try_spot(const FlightDraw& draw, const Ground& ground, Random& random) {
  const auto shape = shape_of(draw, random);
  const Vec3 size = ground.region.sizes(), low = ground.region.min();
  const Vec2 start(low.x() + random.uniform(0.05, 0.95) * size.x(), low.y() + random.uniform(0.05, 0.95) * size.y());
  const Sway sway(random, draw.sway_deg);

  std::vector<double> heights;
  std::vector<PathPoint> points;
  for (int k = 0; k < draw.frames; ++k) {
    PathPoint p = shape(k / (draw.frames - 1.0));
    p.position += start;
    const Vec2 share = (p.position - low.head<2>()).cwiseQuotient(size.head<2>());
    if ((share.array() < 0.05).any() || (share.array() > 0.95).any()) return std::nullopt;
    const auto z = ground_near(ground, p.position, std::max(1.0, 0.3 * draw.height_m));
    if (!z) return std::nullopt;
    heights.push_back(*z);
    points.push_back(p);
  }
  heights = smoothed(heights, draw.frames / 6);

  geometry::Trajectory poses;
  for (int k = 0; k < draw.frames; ++k) {
    const PathPoint& p = points[static_cast<std::size_t>(k)];
    const double time_s = k / draw.fps;
    const double drift_m = 0.02 * draw.height_m / std::max(1.0, draw.sway_deg);
    const Vec3 position(
        p.position.x() + drift_m * sway(1, 0.7 * time_s), p.position.y() + drift_m * sway(2, 0.6 * time_s),
        heights[static_cast<std::size_t>(k)] + draw.height_m * (1.0 + p.climbed) + drift_m * sway(0, 0.5 * time_s));
    const double yaw = p.heading_rad / kRadians + p.extra_yaw_rad / kRadians +
                       (draw.kind == FlightKind::kOrbit ? 0.0 : draw.view_yaw_deg) + sway(0, time_s);
    poses.poses.push_back(
        {time_s, SE3(flight_path::camera_orientation(yaw, std::clamp(draw.pitch_deg + sway(1, time_s), -90.0, 90.0),
                                                     draw.bank_deg * p.turn + sway(2, time_s)),
                     position)});
  }
  if (!keeps_clear(ground, poses, std::max(1.0, 0.35 * draw.height_m))) return std::nullopt;
  const imaging::Calibration calibration = camera_of(draw);
  const double enough = draw.view == View::kShallow ? 0.3 : 0.6;
  for (const std::size_t k : {std::size_t{0}, poses.size() / 2, poses.size() - 1}) {
    if (share_seen(ground, poses.poses[k].T_local_camera, calibration.camera) < enough) return std::nullopt;
  }
  return poses;
}

}  // namespace

std::string name_of(FlightKind kind) {
  constexpr std::array<const char*, 6> kNames = {"straight", "arc", "orbit", "lawnmower", "hover-and-turn", "climb"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string name_of(View view) {
  constexpr std::array<const char*, 3> kNames = {"nadir", "oblique", "shallow"};
  return kNames[static_cast<std::size_t>(view)];
}

std::string name_of(Aids aids) {
  constexpr std::array<const char*, 3> kNames = {"positions", "attitude", "nothing"};
  return kNames[static_cast<std::size_t>(aids)];
}

namespace {

double pitch_of(View view, Random& random) {
  if (view == View::kNadir) return random.uniform(-90.0, -80.0);
  return view == View::kOblique ? random.uniform(-70.0, -25.0) : random.uniform(-25.0, -3.0);
}

/// From the camera to the ground along its axis, at most so many heights.
double distance_m(const FlightDraw& draw) {
  constexpr double kMost = 3.0;
  return draw.height_m * std::min(kMost, 1.0 / std::max(1e-3, -std::sin(draw.pitch_deg * kRadians)));
}

/// Returns the angle by which a flight of this kind turns; for an orbit, the angle around its target.
double turn_of(const FlightDraw& draw, Random& random) {
  const double length_m = draw.speed_m_s * (draw.frames - 1) / draw.fps;
  switch (draw.kind) {
    case FlightKind::kArc:
      return random.uniform(40.0, 150.0);
    case FlightKind::kOrbit:
      return std::min(330.0, length_m / (distance_m(draw) * std::cos(draw.pitch_deg * kRadians)) / kRadians);
    case FlightKind::kHoverAndTurn:
      return random.uniform(60.0, 180.0) * (random.chance(0.5) ? 1.0 : -1.0);
    default:
      return 0.0;
  }
}

}  // namespace

FlightDraw draw_flight(std::uint64_t seed) {
  Random random(seed);
  FlightDraw draw;
  draw.seed = seed;
  draw.kind = static_cast<FlightKind>(random.pick(std::array{0, 1, 2, 3, 4, 5}));
  draw.view = static_cast<View>(random.pick(std::array{0, 1, 1, 2}));
  if (draw.kind == FlightKind::kOrbit && draw.view == View::kNadir) draw.view = View::kOblique;
  draw.aids = static_cast<Aids>(random.pick(std::array{0, 1, 2}));
  draw.lens_deg = random.pick(std::array{60, 90, 155});
  draw.height_m = random.log_uniform(5.0, draw.view == View::kShallow ? 60.0 : 120.0);
  draw.heading_deg = random.uniform(0.0, 360.0);
  draw.view_yaw_deg = random.chance(0.6) ? 0.0 : random.uniform(0.0, 360.0);
  draw.pitch_deg = pitch_of(draw.view, random);
  draw.speed_m_s = std::clamp(distance_m(draw) * random.uniform(0.08, 0.2), 0.5, 10.0);
  draw.fps = random.pick(std::array{8.0, 10.0});
  draw.frames = static_cast<int>(random.uniform(55.0, 100.0));
  draw.turn_deg = turn_of(draw, random);
  if (draw.kind == FlightKind::kHoverAndTurn)
    draw.frames += static_cast<int>(std::abs(draw.turn_deg) / kTurnRate_deg_s * draw.fps);
  draw.sway_deg = random.chance(0.3) ? 0.0 : random.uniform(0.2, 1.5);
  draw.bank_deg = random.chance(0.2) ? random.uniform(5.0, 15.0) : 0.0;
  draw.degraded = random.chance(0.25);
  return draw;
}

imaging::Calibration camera_of(const FlightDraw& draw) {
  imaging::Calibration calibration;
  if (draw.lens_deg < 120) {
    calibration.camera = imaging::make_pinhole(640, 480, draw.lens_deg);
    return calibration;
  }
  constexpr int kWidth = 800, kHeight = 450;
  const double focal_px = 0.5 * kWidth / (0.5 * draw.lens_deg * kRadians);
  calibration.camera = imaging::Camera(
      imaging::KannalaBrandt{.fx = focal_px, .fy = focal_px, .cx = 0.5 * (kWidth - 1), .cy = 0.5 * (kHeight - 1)},
      kWidth, kHeight);
  return calibration;
}

std::optional<geometry::Trajectory> place_flight(const FlightDraw& draw, const Ground& ground) {
  constexpr int kSpots = 100;
  for (int spot = 0; spot < kSpots; ++spot) {
    Random random(draw.seed * 1000003 + static_cast<std::uint64_t>(spot));
    if (auto poses = try_spot(draw, ground, random)) return poses;
  }
  return std::nullopt;
}

}  // namespace tileflight::proving_ground
