#pragma once

#include <cmath>

namespace tileflight::alignment {

enum class KernelType {
  kNone,          ///< least squares
  kHuber,         ///< quadratic up to the scale, linear beyond (Huber, Annals of Mathematical Statistics 35(1), 1964)
  kTukey,         ///< zero weight beyond the scale (Beaton and Tukey's biweight, Technometrics 16(2), 1974)
  kGemanMcClure,  ///< saturates towards the scale's square (Geman and McClure, Bull. Int. Stat. Inst. 52(4), 1987)
};

/// rho(r) of a robust M-estimator and its weight rho'(r) / (2 r) in iteratively reweighted least squares; rho is close
/// to r^2 for small r, so costs are in square metres.
struct RobustKernel {
  KernelType kind = KernelType::kNone;
  double scale_m = 0.3;  ///< scale parameter of the kernel

  double weight(double squared_m2) const {
    const double ratio = squared_m2 / (scale_m * scale_m);
    switch (kind) {
      case KernelType::kNone:
        return 1.0;
      case KernelType::kHuber:
        return ratio <= 1.0 ? 1.0 : 1.0 / std::sqrt(ratio);
      case KernelType::kTukey:
        return ratio >= 1.0 ? 0.0 : (1.0 - ratio) * (1.0 - ratio);
      case KernelType::kGemanMcClure:
        return 1.0 / ((1.0 + ratio) * (1.0 + ratio));
    }
    return 1.0;
  }

  double cost_m2(double squared_m2) const {
    const double unit_m2 = scale_m * scale_m;
    const double ratio = squared_m2 / unit_m2;
    switch (kind) {
      case KernelType::kNone:
        return squared_m2;
      case KernelType::kHuber:
        return ratio <= 1.0 ? squared_m2 : unit_m2 * (2.0 * std::sqrt(ratio) - 1.0);
      case KernelType::kTukey:
        return unit_m2 / 3.0 * (ratio >= 1.0 ? 1.0 : 1.0 - std::pow(1.0 - ratio, 3));
      case KernelType::kGemanMcClure:
        return squared_m2 / (1.0 + ratio);
    }
    return squared_m2;
  }
};

}  // namespace tileflight::alignment
