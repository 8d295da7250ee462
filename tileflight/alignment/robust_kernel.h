#pragma once

#include <cmath>

namespace tileflight::alignment {

enum class Kernel {
  kNone,          ///< least squares
  kHuber,         ///< quadratic up to the scale, linear beyond (Huber, Annals of Mathematical Statistics 35(1), 1964)
  kTukey,         ///< nothing beyond the scale counts (Beaton and Tukey's biweight, Technometrics 16(2), 1974)
  kGemanMcClure,  ///< saturates towards the scale's square (Geman and McClure, Bull. Int. Stat. Inst. 52(4), 1987)
};

/// rho(r) of a robust M-estimator and its weight rho'(r) / (2 r) in iteratively reweighted least squares; rho is near
/// r^2 for small r, so that costs stay in square metres.
struct RobustKernel {
  Kernel kind = Kernel::kNone;
  double scale_m = 0.3;  ///< residual at which the kernel bends

  double weight(double squared_m2) const {
    const double ratio = squared_m2 / (scale_m * scale_m);
    switch (kind) {
      case Kernel::kNone:
        return 1.0;
      case Kernel::kHuber:
        return ratio <= 1.0 ? 1.0 : 1.0 / std::sqrt(ratio);
      case Kernel::kTukey:
        return ratio >= 1.0 ? 0.0 : (1.0 - ratio) * (1.0 - ratio);
      case Kernel::kGemanMcClure:
        return 1.0 / ((1.0 + ratio) * (1.0 + ratio));
    }
    return 1.0;
  }

  double cost_m2(double squared_m2) const {
    const double unit_m2 = scale_m * scale_m;
    const double ratio = squared_m2 / unit_m2;
    switch (kind) {
      case Kernel::kNone:
        return squared_m2;
      case Kernel::kHuber:
        return ratio <= 1.0 ? squared_m2 : unit_m2 * (2.0 * std::sqrt(ratio) - 1.0);
      case Kernel::kTukey:
        return unit_m2 / 3.0 * (ratio >= 1.0 ? 1.0 : 1.0 - std::pow(1.0 - ratio, 3));
      case Kernel::kGemanMcClure:
        return squared_m2 / (1.0 + ratio);
    }
    return squared_m2;
  }
};

}  // namespace tileflight::alignment
