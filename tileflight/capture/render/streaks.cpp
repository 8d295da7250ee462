#include "tileflight/capture/render/streaks.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "tileflight/capture/render/daylight.h"

namespace tileflight::render {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

constexpr double kLeastOpacity = 1.0 / 255.0;
constexpr double kNearestParticle_m = 0.1, kFarthestParticle_m = 30.0;
constexpr double kAperture_m = 0.002;  // of a small drone's camera: defocus of a lens that is focused far away
constexpr double kLeastBudget = 20000.0, kPixelsPerParticle = 8.0;
constexpr float kDropTransmittance = 0.94F;
constexpr float kLightFromBelow = 0.2F;
constexpr int kBandRows = 16;

/// Poses of each row (or of all) when it opens, in its middle and when it closes.
class RowShutter {
 public:
  RowShutter(const StreakShutter& shutter, int height) : shutter_(shutter), height_(height) {
    const int rows = shutter.line_delay_s != 0.0 ? height : 1;
    for (int row = 0; row < rows; ++row) {
      for (const double share : {-0.5, 0.0, 0.5}) {
        times_s_.push_back(middle_s(row, rows) + share * shutter.open_s);
        T_camera_local_.push_back(shutter.pose_at(times_s_.back()).inverse());
      }
    }
  }

  bool is_rolling() const { return times_s_.size() > 3; }
  int row_of(double y_px) const {
    return is_rolling() ? std::clamp(static_cast<int>(std::lround(y_px)), 0, height_ - 1) : 0;
  }
  int middle_row() const { return is_rolling() ? height_ / 2 : 0; }
  double time_s(int row, int moment) const { return times_s_[index(row, moment)]; }
  const SE3& T_camera_local(int row, int moment) const { return T_camera_local_[index(row, moment)]; }

  /// How far from its place at the frame's time anything of this speed relative to the ground is at other moments of
  /// the frame, seen by the camera.
  double reach_m(double speed_m_s) const {
    const SE3 first = T_camera_local_.front().inverse(), last = T_camera_local_.back().inverse();
    return (first.translation - last.translation).norm() + speed_m_s * (times_s_.back() - times_s_.front());
  }
  double turn_rad() const { return T_camera_local_.front().rotation.angularDistance(T_camera_local_.back().rotation); }

 private:
  static std::size_t index(int row, int moment) { return static_cast<std::size_t>(3 * row + moment); }
  double middle_s(int row, int rows) const {
    return rows == 1 ? shutter_.time_s : shutter_.time_s + (row - 0.5 * (height_ - 1)) * shutter_.line_delay_s;
  }

  const StreakShutter& shutter_;
  int height_;
  std::vector<double> times_s_;
  std::vector<SE3> T_camera_local_;
};

/// Pixels that a small thing of a metre at a distance of a metre covers.
double pixels_per_radian(const imaging::Camera& camera, const Vec3& point_camera) {
  Eigen::Matrix<double, 2, 3> J;
  if (!camera.project(point_camera, J)) return 0.0;
  const Eigen::Matrix2d area = J * J.transpose();
  return std::sqrt(std::sqrt(std::max(0.0, area.determinant()))) * point_camera.norm();
}

/// Distance at which the opacity of a streak of a pixel's width has fallen to the least:
/// (pi / 4) (f D / z)^2 = a (f v T / z + 1).
double visible_reach_m(double focal_px, double diameter_m, double speed_m_s, double open_s) {
  const double smear = kLeastOpacity * focal_px * speed_m_s * open_s;
  const double size = focal_px * diameter_m;
  const double reach_m =
      (std::sqrt(smear * smear + std::numbers::pi * kLeastOpacity * size * size) - smear) / (2.0 * kLeastOpacity);
  return std::min(kFarthestParticle_m, reach_m);
}

/// Bounds of the part of a ball that is within an angle of an axis from its centre.
geometry::Box3 bounds_of_sector(const Vec3& centre, const Vec3& axis, double half_angle_rad, double radius_m) {
  geometry::Box3 box(centre);
  for (int i = 0; i < 3; ++i) {
    const double angle = std::acos(std::clamp(axis[i], -1.0, 1.0));
    Vec3 low = centre, high = centre;
    high[i] += radius_m * std::max(0.0, std::cos(std::max(0.0, angle - half_angle_rad)));
    low[i] += radius_m * std::min(0.0, std::cos(std::min(std::numbers::pi, angle + half_angle_rad)));
    box.extend(low);
    box.extend(high);
  }
  return box;
}

/// The part of space in which a camera sees particles of a class: its reach, and the view cone, widened by motion.
struct View {
  Vec3 centre, axis;
  double half_angle_rad = 0.0;
  double reach_m = 0.0;
  double margin_m = 0.0;  ///< by motion within the frame

  /// Whether a ball touches it.
  bool touches(const Vec3& point, double radius_m) const {
    const Vec3 to = point - centre;
    const double squared = to.squaredNorm(), reach = reach_m + margin_m + radius_m;
    if (squared > reach * reach) return false;
    const double near = margin_m + radius_m;
    if (squared < near * near || half_angle_rad > 0.49 * std::numbers::pi) return true;
    const double along = to.dot(axis), across = std::sqrt(std::max(0.0, squared - along * along));
    return across * std::cos(half_angle_rad) - along * std::sin(half_angle_rad) <= near;
  }
};

/// The particles of a class at the frame's time that the camera may see.
std::vector<Particle> seen_particles(const ParticleClass& one, const View& view, double time_s) {
  geometry::Box3 box = bounds_of_sector(view.centre, view.axis, view.half_angle_rad, view.reach_m);
  box.min().array() -= view.margin_m;
  box.max().array() += view.margin_m;
  const auto [first, last] = one.cells_of(box, time_s);
  const auto count = static_cast<std::size_t>(last[0] - first[0] + 1);
  const double radius_m = 0.5 * std::sqrt(3.0) * one.cell_m();
  std::vector<std::vector<Particle>> slabs(count);
  tbb::parallel_for(std::size_t{0}, count, [&, first_cell = first, last_cell = last](std::size_t slab) {
    ParticleClass::Cell cell{first_cell[0] + static_cast<std::int64_t>(slab), 0, 0};
    for (cell[1] = first_cell[1]; cell[1] <= last_cell[1]; ++cell[1]) {
      for (cell[2] = first_cell[2]; cell[2] <= last_cell[2]; ++cell[2]) {
        if (view.touches(one.middle_of(cell, time_s), radius_m)) one.add_particles(cell, time_s, slabs[slab]);
      }
    }
  });
  std::vector<Particle> particles;
  for (const std::vector<Particle>& slab : slabs) particles.insert(particles.end(), slab.begin(), slab.end());
  std::erase_if(particles, [&](const Particle& particle) { return !view.touches(particle.position, 0.0); });
  return particles;
}

/// The streak of a particle, but for its light; nullopt: it is not in the image.
std::optional<Streak> streak_of(const imaging::Camera& camera, const RowShutter& rows, const Particle& particle,
                                const Vec3& velocity_m_s, double time_s) {
  const auto in_camera = [&](int row, int moment) -> Vec3 {
    return rows.T_camera_local(row, moment) * (particle.position + (rows.time_s(row, moment) - time_s) * velocity_m_s);
  };
  int row = rows.middle_row();
  Vec3 middle = in_camera(row, 1);
  if (rows.is_rolling()) {
    // The row that sees it, by iteration: a particle moves far less than a row while the next is read.
    for (int step = 0; step < 3; ++step) {
      const auto pixel = camera.project(middle);
      if (!pixel) return std::nullopt;
      row = rows.row_of(pixel->y());
      middle = in_camera(row, 1);
    }
  }
  const double distance_m = middle.norm();
  if (distance_m < kNearestParticle_m) return std::nullopt;
  const auto from = camera.project(in_camera(row, 0)), to = camera.project(in_camera(row, 2));
  if (!from || !to) return std::nullopt;
  // Far outside of the image, beyond what size and defocus may reach.
  const double widest_px = camera.width() + camera.height();
  const Vec2 low = from->cwiseMin(*to), high = from->cwiseMax(*to);
  const double size_rad = (particle.diameter_m + kAperture_m) / distance_m;
  const double spread_px = 4.0 + 4.0 * widest_px * size_rad;
  if (high.x() < -spread_px || high.y() < -spread_px || low.x() > camera.width() + spread_px ||
      low.y() > camera.height() + spread_px)
    return std::nullopt;
  const double focal_px = pixels_per_radian(camera, middle);
  if (focal_px == 0.0) return std::nullopt;
  const double size_px = focal_px * particle.diameter_m / distance_m;
  const double defocus_px = focal_px * kAperture_m / distance_m;
  Streak streak{*from, *to, std::max(1.0, size_px + defocus_px), 0.0, middle.z(), distance_m, {}};
  streak.opacity = 0.25 * std::numbers::pi * size_px * size_px / (streak.width_px * streak_length_px(streak));
  if (streak.opacity < kLeastOpacity) return std::nullopt;
  const double reach_px = 0.5 * (streak.width_px + streak_length_px(streak)) + 1.0;
  const Vec2 centre = 0.5 * (*from + *to);
  const bool is_seen = centre.x() > -reach_px && centre.y() > -reach_px && centre.x() < camera.width() + reach_px &&
                       centre.y() < camera.height() + reach_px;
  return is_seen ? std::optional(streak) : std::nullopt;
}

/// Interval of x in which |a x + b| <= half.
std::pair<double, double> interval(double a, double b, double half) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (std::abs(a) < 1e-9) return std::abs(b) <= half ? std::pair(-kInfinity, kInfinity) : std::pair(0.0, -1.0);
  const double x0 = (-half - b) / a, x1 = (half - b) / a;
  return {std::min(x0, x1), std::max(x0, x1)};
}

/// Whether the surface of a pixel, by its depth, is behind the particle.
bool is_before(const Streak& streak, float depth_m) {
  if (std::isinf(depth_m)) return true;
  return depth_m >= 0.0F ? streak.depth_m < depth_m : streak.depth_m > depth_m;  // false for NaN: outside the lens
}

/// Draws the rows of a streak that are in the region. A pixel's coverage by the rectangle is the product of those along
/// and across it.
void draw_streak(const Streak& streak, const imaging::PixelRegion& region, const imaging::FloatImage& depth_m,
                 LinearImage& light) {
  const Vec2 centre = 0.5 * (streak.from_px + streak.to_px), way = streak.to_px - streak.from_px;
  const Vec2 along = way.norm() > 1e-6 ? Vec2(way.normalized()) : Vec2(Vec2::UnitY());
  const double half_length = 0.5 * streak_length_px(streak), half_width = 0.5 * streak.width_px;
  const double most_y = (half_length + 0.5) * std::abs(along.y()) + (half_width + 0.5) * std::abs(along.x());
  const int first = std::max(region.y0, static_cast<int>(std::ceil(std::max(-1.0, centre.y() - most_y))));
  const int last = std::min(region.y1 - 1, static_cast<int>(std::floor(std::min(1e6, centre.y() + most_y))));
  for (int y = first; y <= last; ++y) {
    const double dy = y - centre.y();
    const auto lengthwise = interval(along.x(), along.y() * dy, half_length + 0.5);
    const auto across = interval(along.y(), -along.x() * dy, half_width + 0.5);
    const double x0 = centre.x() + std::max(lengthwise.first, across.first);
    const double x1 = centre.x() + std::min(lengthwise.second, across.second);
    if (!(x0 <= x1)) continue;
    const int right = std::min(region.x1 - 1, static_cast<int>(std::floor(std::min(1e6, x1))));
    for (int x = std::max(region.x0, static_cast<int>(std::ceil(std::max(-1.0, x0)))); x <= right; ++x) {
      if (!is_before(streak, depth_m(x, y))) continue;
      const double dx = x - centre.x();
      const double s = std::abs(along.x() * dx + along.y() * dy), d = std::abs(along.y() * dx - along.x() * dy);
      const double covered = std::min(1.0, half_length + 0.5 - s) * std::min(1.0, half_width + 0.5 - d);
      const auto share = static_cast<float>(streak.opacity * covered);
      LinearRgb& pixel = light(x, y);
      for (std::size_t c = 0; c < 3; ++c) pixel[c] += share * (streak.light[c] - pixel[c]);
    }
  }
}

}  // namespace

double streak_length_px(const Streak& streak) {
  return std::max(1.0, (streak.to_px - streak.from_px).norm() + 0.25 * std::numbers::pi * streak.width_px);
}

StreakRenderer::StreakRenderer(const RenderOptions& options, double anchor_z_m)
    : daylight_(options.daylight),
      anchor_z_m_(anchor_z_m),
      air_(*options.weather, options.daylight, options.background, anchor_z_m) {
  for (const PrecipitationKind kind : {PrecipitationKind::kRain, PrecipitationKind::kSnow}) {
    std::vector<ParticleClass> classes = particle_classes(kind, *options.weather);
    if (!classes.empty()) kinds_.push_back({kind, std::move(classes)});
  }
}

/// Mean radiance of the half space in front of this normal, weighted by its cosine: of a sky that is covered (rain and
/// snow fall from clouds) above a ground of albedo 0.2.
LinearRgb StreakRenderer::ambient(const Vec3& normal) const {
  const auto up = static_cast<float>(0.5 * (1.0 + normal.z()));
  if (!daylight_) {
    LinearRgb light = air_.white_airlight();
    for (float& channel : light) channel *= up + kLightFromBelow * (1.0F - up);
    return light;
  }
  LinearRgb light = daylight_->diffuse(
      {static_cast<float>(normal.x()), static_cast<float>(normal.y()), static_cast<float>(normal.z())});
  const float sun = std::max(0.0F, daylight_->toward_sun()[2]) * up;
  for (std::size_t c = 0; c < 3; ++c) light[c] += sun * daylight_->sunlight()[c];
  return light;
}

LinearRgb StreakRenderer::light_of(PrecipitationKind kind, const Vec3& ray, double height_m, double distance_m) const {
  LinearRgb light;
  if (kind == PrecipitationKind::kRain) {
    light = ambient(ray);
    for (float& channel : light) channel *= kDropTransmittance;
  } else {
    const LinearRgb above = ambient(Vec3::UnitZ()), below = ambient(-Vec3::UnitZ());
    for (std::size_t c = 0; c < 3; ++c) light[c] = 0.5F * (above[c] + below[c]);
  }
  const std::array<float, 3> direction{static_cast<float>(ray.x()), static_cast<float>(ray.y()),
                                       static_cast<float>(ray.z())};
  return air_.seen_through(light, direction, static_cast<float>(height_m), static_cast<float>(distance_m));
}

std::vector<Streak> StreakRenderer::streaks(const imaging::Camera& camera, const StreakShutter& shutter) const {
  const RowShutter rows(shutter, camera.height());
  const SE3 T_local_camera = rows.T_camera_local(rows.middle_row(), 1).inverse();
  View view{T_local_camera.translation, T_local_camera.rotation * Vec3::UnitZ(),
            std::min(std::numbers::pi, camera.max_image_angle_rad() + rows.turn_rad()), 0.0, 0.0};
  const double focal_px = pixels_per_radian(camera, Vec3::UnitZ());
  const Vec3 drift_m =
      rows.T_camera_local(0, 2).inverse().translation - rows.T_camera_local(0, 0).inverse().translation;
  const auto reach_of = [&](const ParticleClass& one) {
    const double speed_m_s = (one.velocity_m_s() - drift_m / shutter.open_s).norm();
    return visible_reach_m(focal_px, one.mean_diameter_m(), speed_m_s, shutter.open_s);
  };
  double expected = 0.0;
  for (const Kind& kind : kinds_)
    for (const ParticleClass& one : kind.classes)
      expected += one.count_per_m3() * 2.0 / 3.0 * std::numbers::pi * (1.0 - std::cos(view.half_angle_rad)) *
                  std::pow(reach_of(one), 3);
  const double budget =
      std::max(kLeastBudget, camera.width() * static_cast<double>(camera.height()) / kPixelsPerParticle);
  const double nearer = std::min(1.0, std::cbrt(budget / std::max(1.0, expected)));
  std::vector<Streak> streaks;
  for (const Kind& kind : kinds_) {
    for (const ParticleClass& one : kind.classes) {
      view.reach_m = nearer * reach_of(one);
      view.margin_m = rows.reach_m(one.velocity_m_s().norm());
      const std::vector<Particle> particles = seen_particles(one, view, shutter.time_s + shutter.weather_offset_s);
      std::vector<std::optional<Streak>> found(particles.size());
      tbb::parallel_for(std::size_t{0}, particles.size(), [&](std::size_t i) {
        found[i] = streak_of(camera, rows, particles[i], one.velocity_m_s(), shutter.time_s);
        if (!found[i]) return;
        const Vec3 ray = (particles[i].position - view.centre).normalized();
        found[i]->light = light_of(kind.kind, ray, view.centre.z() - anchor_z_m_, found[i]->distance_m);
      });
      for (const std::optional<Streak>& streak : found)
        if (streak) streaks.push_back(*streak);
    }
  }
  return streaks;
}

void StreakRenderer::draw(const imaging::Camera& camera, const StreakShutter& shutter,
                          const imaging::FloatImage& depth_m, LinearImage& light) const {
  const std::vector<Streak> all = streaks(camera, shutter);
  const int bands = (light.height + kBandRows - 1) / kBandRows;
  std::vector<std::vector<std::uint32_t>> of_band(static_cast<std::size_t>(bands));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const double middle = 0.5 * (all[i].from_px.y() + all[i].to_px.y());
    const double reach = 0.5 * (streak_length_px(all[i]) + all[i].width_px) + 1.0;
    const double first = std::floor((middle - reach) / kBandRows), last = std::floor((middle + reach) / kBandRows);
    for (int band = static_cast<int>(std::max(0.0, first)); band <= static_cast<int>(std::min(bands - 1.0, last));
         ++band)
      of_band[static_cast<std::size_t>(band)].push_back(static_cast<std::uint32_t>(i));
  }
  tbb::parallel_for(0, bands, [&](int band) {
    const imaging::PixelRegion part{0, band * kBandRows, light.width, std::min(light.height, (band + 1) * kBandRows)};
    for (const std::uint32_t i : of_band[static_cast<std::size_t>(band)]) draw_streak(all[i], part, depth_m, light);
  });
}

}  // namespace tileflight::render
