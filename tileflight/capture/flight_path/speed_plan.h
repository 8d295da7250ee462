#pragma once

#include <cstddef>
#include <vector>

namespace tileflight::flight_path {

/// A stop of a motion at a point of its curve.
struct Rest {
  std::size_t node = 0;  ///< index in CurveBounds::u
  double seconds = 0.0;
};

/// Bounds of a curve r(u) with an orientation R(u) on a grid over u: the largest |r'|, |r''| and |R'| (radians per unit
/// of u) in each cell from u[k] to u[k+1].
struct CurveBounds {
  std::vector<double> u;             ///< strictly increasing, at least two
  std::vector<double> first_m;       ///< |dr/du|; one entry fewer than u, as the next two
  std::vector<double> second_m;      ///< |d2r/du2|
  std::vector<double> rotation_rad;  ///< |dR/du|
  std::vector<double> speed_m_s{};   ///< limit of the speed in each cell; empty: MotionLimits::speed_m_s everywhere
  std::vector<Rest> rests{};         ///< in the order of their nodes
};

/// Limits of a motion along a curve.
struct MotionLimits {
  double speed_m_s = 8.0;
  double acceleration_m_s2 = 4.0;
  double rotation_rad_s = 1.0;
};

/// Curve parameter and its derivatives at a time.
struct Progression {
  double u = 0.0;
  double rate = 0.0;          ///< du/dt
  double acceleration = 0.0;  ///< d2u/dt2
};

/// A motion u(t) along a curve from rest to rest, with rests between, as fast as the limits allow up to a margin:
/// velocity r' u_t, acceleration r'' u_t^2 + r' u_tt and angular rate |R'| u_t stay within the limits at all times.
/// u(t) is twice continuously differentiable.
///
/// The rate is planned in the phase plane (Bobrow, Dubowsky and Gibson, Int. J. Robotics Research 4(3), 1985): limits
/// on u_t everywhere, then a forward pass that limits acceleration and a backward pass that limits braking. This leaves
/// steps in the acceleration, which averaging u(t) over a window of `smoothing_s` removes. To keep the average within
/// the limits too, each cell gets the worst bounds of all cells that the window can reach.
class SpeedPlan {
 public:
  SpeedPlan(const CurveBounds& bounds, const MotionLimits& limits, double smoothing_s = 0.5);

  double duration_s() const;
  /// Times outside [0, duration] are clamped.
  Progression at(double time_s) const;

 private:
  struct Node {
    double time_s, u, rate;
    double integral;  ///< integral of u over time since the first node
  };

  struct Segment {
    const Node& begin;
    double acceleration;
  };

  Segment segment_at(double time_s) const;
  Progression at_unsmoothed(double time_s) const;
  double integral(double time_s) const;

  double smoothing_s_;
  std::vector<Node> nodes_;  ///< plan before averaging; the second derivative is constant between nodes
};

}  // namespace tileflight::flight_path
