#include "tileflight/tiles/tileset/region.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tileflight::tileset {
namespace {

using Eigen::Vector2d;
using geometry::Box3;
using geometry::Prism;
using geometry::Ring;
using geometry::SE3;
using geometry::Vec3;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Convex hull by monotone chains along x (Andrew, 1979), counter-clockwise.
Ring hull_of(Ring points) {
  std::sort(points.begin(), points.end(),
            [](const Vector2d& a, const Vector2d& b) { return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y()); });
  const auto chain = [](const auto& ordered) {
    Ring out;
    for (const Vector2d& point : ordered) {
      while (out.size() > 1 && cross(out.back() - out[out.size() - 2], point - out.back()) <= 0) out.pop_back();
      out.push_back(point);
    }
    out.pop_back();  // it begins the other chain
    return out;
  };
  Ring hull = chain(points);
  std::reverse(points.begin(), points.end());
  const Ring upper = chain(points);
  hull.insert(hull.end(), upper.begin(), upper.end());
  return hull;
}

Ring ground_projection(const OrientedBox& box, const SE3& T_local_tileset) {
  Ring corners;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 signs((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1, (corner & 4) != 0 ? 1 : -1);
    corners.push_back((T_local_tileset * Vec3(box.center + box.half_axes * signs)).head<2>());
  }
  return hull_of(std::move(corners));
}

Ring ground_projection(const Box3& box) {
  const Vec3 low = box.min();
  const Vec3 high = box.max();
  return {{low.x(), low.y()}, {high.x(), low.y()}, {high.x(), high.y()}, {low.x(), high.y()}};
}

bool projection_intersects(const BoundingVolume& volume, const SE3& T_local_tileset,
                           const geometry::PolygonArea& area) {
  if (const auto* sphere = std::get_if<BoundingSphere>(&volume)) {
    constexpr double kSlack_m = 1e-6;
    return area.distance_m((T_local_tileset * sphere->center).head<2>()) <= sphere->radius_m + kSlack_m;
  }
  const auto* box = std::get_if<OrientedBox>(&volume);
  return area.intersects(box != nullptr ? ground_projection(*box, T_local_tileset)
                                        : ground_projection(local_bounding_box(volume, T_local_tileset)));
}

/// A line that is straight in longitude and latitude is curved in the frame: by a fifth of a millimetre over 100 m at
/// 60 degrees of latitude.
Ring local_ring(const Ring& lon_lat, const geometry::LocalFrame& frame) {
  constexpr double kStep_m = 100.0;
  constexpr double kMostSteps = 1000.0;
  const auto local = [&](const Vector2d& place) {
    return Vector2d(frame.local_from_geodetic({place.y(), place.x(), frame.origin().height}).head<2>());
  };
  Ring out;
  for (std::size_t i = 0; i < lon_lat.size(); ++i) {
    const Vector2d& from = lon_lat[i];
    const Vector2d& to = lon_lat[(i + 1) % lon_lat.size()];
    const auto steps =
        static_cast<int>(std::clamp(std::ceil((local(to) - local(from)).norm() / kStep_m), 1.0, kMostSteps));
    for (int k = 0; k < steps; ++k) out.push_back(local(from + (to - from) * k / steps));
  }
  return out;
}

}  // namespace

Region column_of(Region region) {
  constexpr double kFar_m = 20e3, kMargin_m = 0.5;
  region.size += 2 * Vec3(kMargin_m, kMargin_m, kFar_m);
  for (Prism& part : region.parts) {
    part.bottom_m -= kFar_m;
    part.top_m += kFar_m;
  }
  return region;
}

bool intersects(const BoundingVolume& volume, const SE3& T_local_tileset, const Region& region) {
  if (region.parts.empty()) return intersects(volume, T_local_tileset, region.box());
  return std::any_of(region.parts.begin(), region.parts.end(), [&](const Prism& part) {
    return intersects(volume, T_local_tileset, geometry::bounds(part)) &&
           projection_intersects(volume, T_local_tileset, part.base);
  });
}

Prism to_local_prism(const GeographicArea& area, const geometry::LocalFrame& frame, const Box3& box) {
  std::vector<Ring> rings;
  Eigen::AlignedBox2d lon_lat;
  for (const Ring& ring : area.rings) {
    for (const Vector2d& place : ring) lon_lat.extend(place);
    rings.push_back(local_ring(ring, frame));
  }
  const auto up = [&](std::optional<double> height_m, double fallback) {
    if (!height_m) return fallback;
    const Vector2d middle = lon_lat.center();
    return frame.local_from_geodetic({middle.y(), middle.x(), geometry::EllipsoidalHeight{*height_m}}).z();
  };
  return {geometry::PolygonArea(std::move(rings)), up(area.min_height_m, box.min().z()),
          up(area.max_height_m, box.max().z())};
}

}  // namespace tileflight::tileset
