#include "tileflight/slam/tracking/motion_hypotheses.h"

namespace tileflight::tracking {

std::vector<geometry::SE3> motion_hypotheses(const geometry::SE3& T_last_reference,
                                             const geometry::SE3& T_last_before_last, int turns) {
  using geometry::SE3;
  // Chosen by hand.
  constexpr double kSmallestTurn_rad = 0.02;
  const SE3 constant = T_last_before_last * T_last_reference;
  const SE3 half = SE3::exp(0.5 * T_last_before_last.log());
  std::vector<SE3> poses{constant, T_last_before_last * constant, half * T_last_reference, T_last_reference, SE3()};
  for (int turn = 0; turn < turns; ++turn) {
    const double angle = kSmallestTurn_rad * (1 << turn);
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          if (x == 0 && y == 0 && z == 0) continue;
          poses.push_back(SE3(geometry::so3_exp(angle * geometry::Vec3(x, y, z)), geometry::Vec3::Zero()) * constant);
        }
      }
    }
  }
  return poses;
}

}  // namespace tileflight::tracking
