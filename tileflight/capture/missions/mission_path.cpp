// A mission's path is a chain of straight legs. Its corners are rounded by a parabola, or the vehicle stops there. The
// cubic spline through waypoints (flight_path) stays on a straight leg if its points lie densely where the path bends
// and ever farther apart towards the middle of the leg.
#include "tileflight/capture/missions/mission_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::missions {
namespace {

using flight_path::Waypoint;
using geometry::Vec3;

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;
constexpr double kSamePlace_m = 1e-3;
/// Distance of the points beside a stop.
constexpr double kStopSpacing_m = 0.5;
/// A rounded corner has so many parts, and the points beside it are as near: the spline then leaves the straight legs
/// by less than two thousandths of the rounding.
constexpr int kCornerParts = 4;
/// Each point of a leg is so many times as far from its corner as the one before.
constexpr double kGrowth = 2.0;
constexpr std::size_t kMostPoints = 100000;

double wrapped_deg(double angle_deg) { return std::remainder(angle_deg, 360.0); }

/// A waypoint of the mission in the local frame.
struct Corner {
  const MissionWaypoint* waypoint = nullptr;
  Vec3 position;
  std::optional<Vec3> target;
};

/// Direction of the camera, degrees.
struct View {
  double yaw_deg = 0.0, pitch_deg = 0.0;
};

/// Blends two directions, the shorter way round.
View blend(const View& a, const View& b, double share) {
  return {a.yaw_deg + share * wrapped_deg(b.yaw_deg - a.yaw_deg), a.pitch_deg + share * (b.pitch_deg - a.pitch_deg)};
}

std::optional<double> bearing_deg(const Vec3& direction) {
  if (direction.head<2>().norm() < kSamePlace_m) return std::nullopt;
  return std::atan2(direction.x(), direction.y()) * kDegreesPerRadian;
}

/// A leg between two corners, and where the camera looks on it.
class Leg {
 public:
  Leg(const Corner& from, const Corner& to, double pitch_if_open_deg, double last_yaw_deg)
      : from_(from), to_(to), open_deg_(pitch_if_open_deg) {
    along_deg_ = bearing_deg(to.position - from.position).value_or(last_yaw_deg);
  }

  double length_m() const { return (to_.position - from_.position).norm(); }
  Vec3 direction() const { return (to_.position - from_.position) / length_m(); }
  Vec3 at(double distance_m) const { return from_.position + distance_m * direction(); }
  double along_deg() const { return along_deg_; }

  /// The direction at a point of the leg, `share` of its way.
  View view(const Vec3& position, double share) const {
    const Heading& heading = from_.waypoint->heading;
    const Pitch& pitch = from_.waypoint->pitch;
    View view{along_deg_ + heading.deg, pitch_at(position, share)};
    if (heading.kind == Heading::Kind::kFixed) view.yaw_deg = heading.deg;
    if (heading.kind == Heading::Kind::kBlend)
      view.yaw_deg = heading.deg + share * wrapped_deg(own_heading_deg(to_) - heading.deg);
    if (heading.kind == Heading::Kind::kTarget)
      view.yaw_deg = bearing_deg(*from_.target - position).value_or(along_deg_);
    if (pitch.kind == Pitch::Kind::kTarget && !from_.target) view.pitch_deg = open_deg_;
    return view;
  }

  /// The longest distance between two points near which the direction changes little.
  double longest_step_m(double distance_m) const {
    constexpr double kStep_deg = 15.0, kShareOfTarget = 0.25, kShortest_m = 0.25;
    double longest_m = HUGE_VAL;
    if (from_.target) longest_m = kShareOfTarget * (*from_.target - at(distance_m)).norm();
    const View first = view(from_.position, 0.0), last = view(to_.position, 1.0);
    const double turn_deg =
        std::max(std::abs(wrapped_deg(last.yaw_deg - first.yaw_deg)), std::abs(last.pitch_deg - first.pitch_deg));
    if (!from_.target && turn_deg > kStep_deg) longest_m = length_m() * kStep_deg / turn_deg;
    return std::max(longest_m, kShortest_m);
  }

 private:
  double own_heading_deg(const Corner& corner) const {
    const Heading& heading = corner.waypoint->heading;
    if (heading.kind == Heading::Kind::kAlong) return along_deg_ + heading.deg;
    return heading.kind == Heading::Kind::kTarget && corner.target
               ? bearing_deg(*corner.target - corner.position).value_or(along_deg_)
               : heading.deg;
  }

  double own_pitch_deg(const Corner& corner) const {
    const Pitch& pitch = corner.waypoint->pitch;
    const bool is_stated = pitch.kind == Pitch::Kind::kFixed || pitch.kind == Pitch::Kind::kBlend;
    if (pitch.kind == Pitch::Kind::kTarget && corner.target) return elevation_deg(*corner.target - corner.position);
    return is_stated ? pitch.deg : open_deg_;
  }

  static double elevation_deg(const Vec3& direction) {
    return std::atan2(direction.z(), direction.head<2>().norm()) * kDegreesPerRadian;
  }

  double pitch_at(const Vec3& position, double share) const {
    const Pitch& pitch = from_.waypoint->pitch;
    switch (pitch.kind) {
      case Pitch::Kind::kOpen:
        return open_deg_;
      case Pitch::Kind::kNadir:
        return -90.0;
      case Pitch::Kind::kFixed:
        return pitch.deg;
      case Pitch::Kind::kBlend:
        return pitch.deg + share * (own_pitch_deg(to_) - pitch.deg);
      case Pitch::Kind::kTarget:
        break;
    }
    return from_.target ? elevation_deg(*from_.target - position) : open_deg_;
  }

  const Corner& from_;
  const Corner& to_;
  double open_deg_ = 0.0, along_deg_ = 0.0;
};

/// The path as dense waypoints.
class PathBuilder {
 public:
  PathBuilder(const std::vector<Corner>& corners, double open_deg, double speed_m_s, const std::string& where)
      : corners_(corners), speed_m_s_(speed_m_s), where_(where) {
    double yaw_deg = first_bearing_deg();
    for (std::size_t i = 0; i + 1 < corners.size(); ++i) {
      legs_.emplace_back(corners[i], corners[i + 1], open_deg, yaw_deg);
      yaw_deg = legs_.back().along_deg();
    }
  }

  std::vector<Waypoint> build() && {
    add(corners_.front().position, legs_.front().view(corners_.front().position, 0.0), 0);
    hold(corners_.front().waypoint->passing);
    for (std::size_t i = 0; i < legs_.size(); ++i) {
      add_leg(i);
      add_corner(i + 1);
    }
    return std::move(waypoints_);
  }

 private:
  /// Heading of the first leg that is not vertical; before it the vehicle already points there.
  double first_bearing_deg() const {
    for (std::size_t i = 0; i + 1 < corners_.size(); ++i)
      if (const auto bearing = bearing_deg(corners_[i + 1].position - corners_[i].position)) return *bearing;
    return 0.0;
  }

  bool is_inner(std::size_t corner) const { return corner > 0 && corner + 1 < corners_.size(); }
  Passing::Kind kind_of(std::size_t corner) const {
    return is_inner(corner) ? corners_[corner].waypoint->passing.kind : Passing::Kind::kStop;
  }

  /// From where before a corner to where behind it the path is rounded: at most half of either leg.
  double rounding_m(std::size_t corner) const {
    if (!is_inner(corner) || kind_of(corner) != Passing::Kind::kRounded) return 0.0;
    constexpr double kLeast_m = 0.02;  // a smaller corner is passed exactly
    const double wanted_m = corners_[corner].waypoint->passing.distance_m;
    const double most_m = 0.49 * std::min(legs_[corner - 1].length_m(), legs_[corner].length_m());
    return std::min(wanted_m, most_m) < kLeast_m ? 0.0 : std::min(wanted_m, most_m);
  }

  /// Distance of the points next to the end of a corner; infinite where the path is free to bend.
  double spacing_m(std::size_t corner) const {
    if (kind_of(corner) == Passing::Kind::kCurve) return HUGE_VAL;
    return rounding_m(corner) == 0.0 ? kStopSpacing_m : rounding_m(corner) / kCornerParts;
  }

  void add(const Vec3& position, const View& view, std::size_t leg) {
    if (waypoints_.size() >= kMostPoints) throw InputError(where_, "is too long to be simulated; divide it");
    Waypoint waypoint;
    waypoint.position = position;
    waypoint.yaw_deg = view.yaw_deg;
    waypoint.pitch_deg = std::clamp(view.pitch_deg, -90.0, 90.0);
    const std::size_t of = std::min(leg, legs_.size() - 1);
    waypoint.speed_m_s = corners_[of].waypoint->speed_m_s.value_or(speed_m_s_);
    waypoints_.push_back(waypoint);
  }

  void hold(const Passing& passing) {
    if (passing.kind == Passing::Kind::kStop && passing.hold_s > 0.0) waypoints_.back().hold_s = passing.hold_s;
  }

  /// The points of a leg between its corners' roundings.
  void add_leg(std::size_t index) {
    const Leg& leg = legs_[index];
    const double begin_m = rounding_m(index), end_m = leg.length_m() - rounding_m(index + 1);
    std::vector<double> distances;
    const double middle_m = (begin_m + end_m) / 2.0;
    for (double step_m = spacing_m(index), at_m = begin_m + step_m; at_m < middle_m; at_m += (step_m *= kGrowth))
      distances.push_back(at_m);
    for (double step_m = spacing_m(index + 1), at_m = end_m - step_m; at_m > middle_m; at_m -= (step_m *= kGrowth))
      distances.push_back(at_m);
    distances.push_back(end_m);
    std::ranges::sort(distances);
    double last_m = begin_m;
    for (const double next_m : distances) {
      const double gap_m = next_m - last_m;
      const double step_m = std::min(leg.longest_step_m(last_m), leg.longest_step_m(next_m));
      const int parts = static_cast<int>(std::clamp(std::ceil(gap_m / step_m), 1.0, 1000.0));
      for (int part = 1; part <= parts; ++part) {
        const double at_m = last_m + gap_m * part / parts;
        // The leg's last point is its corner, unless the corner is rounded.
        if (part == parts && next_m == end_m && rounding_m(index + 1) == 0.0) break;
        if ((leg.at(at_m) - waypoints_.back().position).norm() < 2.0 * kSamePlace_m) continue;
        add(leg.at(at_m), leg.view(leg.at(at_m), at_m / leg.length_m()), index);
      }
      last_m = next_m;
    }
  }

  void add_corner(std::size_t corner) {
    const Vec3& position = corners_[corner].position;
    const View arriving = legs_[corner - 1].view(position, 1.0);
    if (!is_inner(corner)) {
      // The last waypoint has a view of its own where it states one.
      add(position, arriving, corner);
      return hold(corners_[corner].waypoint->passing);
    }
    const Leg& next = legs_[corner];
    const View leaving = next.view(position, 0.0);
    const double rounding_distance_m = rounding_m(corner);
    if (rounding_distance_m == 0.0) {
      add(position, blend(arriving, leaving, 0.5), corner);
      if (kind_of(corner) == Passing::Kind::kStop) waypoints_.back().hold_s = corners_[corner].waypoint->passing.hold_s;
      return;
    }
    const Vec3 entry = legs_[corner - 1].at(legs_[corner - 1].length_m() - rounding_distance_m);
    const Vec3 exit = next.at(rounding_distance_m);
    for (int k = 1; k < kCornerParts; ++k) {
      const double u = static_cast<double>(k) / kCornerParts;  // of a quadratic Bezier curve
      const Vec3 at = (1.0 - u) * (1.0 - u) * entry + 2.0 * u * (1.0 - u) * position + u * u * exit;
      add(at, blend(arriving, leaving, u), 2 * k < kCornerParts ? corner - 1 : corner);
    }
    add(exit, next.view(exit, rounding_distance_m / next.length_m()), corner);
  }

  const std::vector<Corner>& corners_;
  double speed_m_s_;
  const std::string& where_;
  std::vector<Leg> legs_;
  std::vector<Waypoint> waypoints_;
};

/// Counts a mission's heights from the ellipsoid.
class HeightResolver {
 public:
  HeightResolver(const Mission& mission, const MissionOptions& options, const MissionPlace& place,
                 const std::string& where, std::vector<std::string>& notes)
      : mission_(mission), options_(options), where_(where), notes_(notes) {
    for (const MissionWaypoint& waypoint : mission.waypoints) {
      ask_for(with_height(waypoint.position));
      if (waypoint.target) ask_for(*waypoint.target);
    }
    if (needs_takeoff_) choose_takeoff();
    if (!questions_.empty()) answers_ = place.ground_heights(questions_);
    if (needs_takeoff_) settle_takeoff();
    if (uses_ground_)
      notes_.emplace_back(
          "heights above ground are counted from the uppermost surface of the place, roofs and trees included, at the "
          "waypoints; between them legs are straight");
  }

  /// The waypoint's position with the height that is flown where the file states none.
  MissionPosition with_height(MissionPosition position) const {
    if (position.height_m) return position;
    if (!options_.height_above_ground_m)
      throw InputError(where_,
                       "states no height for its waypoints: write a flight file with mission_file: {file: …, "
                       "height_above_ground_m: …}");
    return {position.latitude_deg, position.longitude_deg, *options_.height_above_ground_m, HeightAbove::kGround};
  }

  geometry::EllipsoidalHeight height(const MissionPosition& position) {
    const double stated_m = position.height_m.value_or(0.0);
    switch (position.above) {
      case HeightAbove::kEllipsoid:
        return {stated_m};
      case HeightAbove::kSeaLevel:
        return geometry::ellipsoidal_from_orthometric(position.latitude_deg, position.longitude_deg, {stated_m});
      case HeightAbove::kTakeoff:
        return {takeoff_height_m_ + stated_m};
      case HeightAbove::kGround:
        break;
    }
    const std::optional<double> ground_m = answers_.at(next_answer_++);
    if (!ground_m)
      throw InputError(where_, base::formatted("flies at a height above the ground at latitude %.6f, longitude %.6f, "
                                               "where the place has no surface",
                                               position.latitude_deg, position.longitude_deg));
    return {*ground_m + stated_m};
  }

 private:
  void ask_for(const MissionPosition& position) {
    needs_takeoff_ = needs_takeoff_ || position.above == HeightAbove::kTakeoff;
    if (position.above != HeightAbove::kGround) return;
    uses_ground_ = true;
    questions_.push_back({position.latitude_deg, position.longitude_deg});
  }

  /// The take-off place: the user's, the file's, or the first waypoint.
  void choose_takeoff() {
    if (options_.takeoff_height_m) return;
    const MissionPosition& first = mission_.waypoints.front().position;
    if (options_.takeoff) {
      takeoff_ = *options_.takeoff;
    } else if (mission_.takeoff) {
      takeoff_ = *mission_.takeoff;
    } else {
      takeoff_ = Takeoff{first.latitude_deg, first.longitude_deg, std::nullopt};
      notes_.emplace_back(
          "the mission does not state where the vehicle takes off: heights are counted from the ground below its first "
          "waypoint (mission_file: takeoff, takeoff_height)");
    }
    takeoff_answer_ = questions_.size();
    questions_.push_back({takeoff_.latitude_deg, takeoff_.longitude_deg});
  }

  void settle_takeoff() {
    constexpr double kApart_m = 2.0;
    if (options_.takeoff_height_m) {
      takeoff_height_m_ = *options_.takeoff_height_m;
      return;
    }
    const std::optional<double> ground_m = answers_.at(takeoff_answer_);
    std::optional<double> stated_m;
    if (takeoff_.height_above_sea_m) stated_m = ellipsoidal(*takeoff_.height_above_sea_m);
    if (!ground_m && !stated_m)
      throw InputError(where_,
                       base::formatted("counts heights from the take-off place at latitude %.6f, longitude %.6f, where "
                                       "the place has no surface: write a flight file with mission_file: {file: …, "
                                       "takeoff_height: metres above the ellipsoid}",
                                       takeoff_.latitude_deg, takeoff_.longitude_deg));
    takeoff_height_m_ = ground_m ? *ground_m : *stated_m;
    if (!ground_m)
      notes_.push_back(
          base::formatted("the place has no surface where the vehicle takes off: heights are counted from "
                          "the file's take-off height, %.1f m above sea level",
                          *takeoff_.height_above_sea_m));
    if (ground_m && stated_m && std::abs(*ground_m - *stated_m) > kApart_m)
      notes_.push_back(base::formatted(
          "heights above take-off are counted from the place's surface there, %.1f m above the ellipsoid; the file's "
          "take-off height is %.1f m (%.1f m above sea level): set mission_file: takeoff_height if that is right",
          *ground_m, *stated_m, *takeoff_.height_above_sea_m));
  }

  /// nullopt where the geoid's grid is not installed: then only the surface counts.
  std::optional<double> ellipsoidal(double above_sea_m) const {
    try {
      return geometry::ellipsoidal_from_orthometric(takeoff_.latitude_deg, takeoff_.longitude_deg, {above_sea_m}).m;
    } catch (const InputError&) {
      return std::nullopt;
    }
  }

  const Mission& mission_;
  const MissionOptions& options_;
  const std::string& where_;
  std::vector<std::string>& notes_;
  bool needs_takeoff_ = false, uses_ground_ = false;
  Takeoff takeoff_;
  double takeoff_height_m_ = 0.0;
  std::vector<GroundPoint> questions_;  ///< those of the waypoints and targets in their order, then of the take-off
  std::vector<std::optional<double>> answers_;
  std::size_t next_answer_ = 0, takeoff_answer_ = 0;
};

/// Merges waypoints at one place, as a turn on the spot: the later one says how it goes on.
void append_corner(const Corner& corner, std::vector<Corner>& corners, std::vector<MissionWaypoint>& merged) {
  if (!corners.empty() && (corners.back().position - corner.position).norm() < 2.0 * kSamePlace_m) {
    const Passing before = merged.back().passing;
    merged.back() = *corner.waypoint;
    if (before.kind == Passing::Kind::kStop) {
      merged.back().passing.kind = Passing::Kind::kStop;
      merged.back().passing.hold_s += before.hold_s;
    }
    corners.back().target = corner.target;
    return;
  }
  corners.push_back(corner);
  merged.push_back(*corner.waypoint);
}

bool leaves_pitch_open(const Mission& mission) {
  return std::ranges::any_of(mission.waypoints, [](const MissionWaypoint& waypoint) {
    return waypoint.pitch.kind == Pitch::Kind::kOpen ||
           (waypoint.pitch.kind == Pitch::Kind::kTarget && !waypoint.target);
  });
}

void add_notes(const Mission& mission, const MissionOptions& options, double speed_m_s,
               std::vector<std::string>& notes) {
  const auto any = [&](const auto& holds) { return std::ranges::any_of(mission.waypoints, holds); };
  if (leaves_pitch_open(mission) && !options.pitch_deg)
    notes.emplace_back("the mission does not state the camera's pitch: it looks level there (mission_file: pitch_deg)");
  if (any([](const MissionWaypoint& waypoint) { return waypoint.pitch.kind == Pitch::Kind::kNadir; }) &&
      !options.pitch_deg)
    notes.emplace_back(
        "the survey does not state the camera's pitch: it looks straight down (mission_file: pitch_deg)");
  if (any([](const MissionWaypoint& waypoint) { return !waypoint.speed_m_s; }))
    notes.push_back(
        base::formatted("the mission does not state all speeds: %g m/s is flown there (speed_m_s)", speed_m_s));
}

}  // namespace

MissionOptions read_mission_options(base::StrictSection& section) {
  MissionOptions options;
  options.takeoff_height_m = section.number("takeoff_height");
  if (const auto takeoff = section.numbers("takeoff", 2, 2)) {
    require_on_earth(takeoff->at(0), takeoff->at(1), section.place() + ", takeoff");
    options.takeoff = Takeoff{takeoff->at(0), takeoff->at(1), std::nullopt};
  }
  options.pitch_deg = section.number("pitch_deg");
  if (options.pitch_deg && std::abs(*options.pitch_deg) > 90.0)
    throw section.error("pitch_deg", "must be from -90 (straight down) to 90");
  options.height_above_ground_m = section.positive_number("height_above_ground_m");
  return options;
}

PlacedMission place_mission(const Mission& mission, const MissionOptions& options, const MissionPlace& place,
                            double speed_m_s, const std::string& where) {
  PlacedMission placed;
  placed.notes = mission.notes;
  HeightResolver heights(mission, options, place, where, placed.notes);
  std::vector<Corner> corners;
  std::vector<MissionWaypoint> merged;
  const auto to_local = [&](const MissionPosition& position) {
    constexpr double kLowest_m = -2000.0, kHighest_m = 100000.0;
    const geometry::EllipsoidalHeight height = heights.height(position);
    if (!(height.m > kLowest_m && height.m < kHighest_m))
      throw InputError(where,
                       base::formatted("flies at %g m above the ellipsoid, which is no height of a flight", height.m));
    return place.frame.local_from_geodetic({position.latitude_deg, position.longitude_deg, height});
  };
  for (const MissionWaypoint& waypoint : mission.waypoints) {
    Corner corner{&waypoint, to_local(heights.with_height(waypoint.position)), std::nullopt};
    if (waypoint.target) corner.target = to_local(*waypoint.target);
    append_corner(corner, corners, merged);
  }
  if (corners.size() < 2) throw InputError(where, "stays in one place: a flight needs two positions");
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (options.pitch_deg && merged[i].pitch.kind == Pitch::Kind::kNadir) merged[i].pitch.kind = Pitch::Kind::kOpen;
    corners[i].waypoint = &merged[i];
  }
  add_notes(mission, options, speed_m_s, placed.notes);
  placed.waypoints = PathBuilder(corners, options.pitch_deg.value_or(0.0), speed_m_s, where).build();
  return placed;
}

}  // namespace tileflight::missions
