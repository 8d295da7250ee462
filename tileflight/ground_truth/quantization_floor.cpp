#include "tileflight/ground_truth/quantization_floor.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace tileflight::ground_truth {
namespace {

constexpr double kStepsPerVoxel = 1048576.0;
constexpr std::size_t kSteps = 2 * 1048576;

}  // namespace

QuantizationFloor::QuantizationFloor(double voxel_m) : step_m_(voxel_m / kStepsPerVoxel), counts_(kSteps) {}

void QuantizationFloor::add(const std::vector<double>& distances_m) {
  for (const double d : distances_m) {
    largest_m_ = std::max(largest_m_, d);
    const double step = d / step_m_;
    if (step < static_cast<double>(kSteps)) {
      ++counts_[static_cast<std::size_t>(step)];
    } else {
      far_.push_back(d);
    }
  }
}

nlohmann::json QuantizationFloor::to_json() const {
  std::vector<double> far = far_;
  std::sort(far.begin(), far.end());
  std::uint64_t count = far.size();
  for (const std::uint64_t n : counts_) count += n;
  if (count == 0) return nullptr;
  // Calls visit(distance, number of samples) in ascending order.
  const auto for_each = [&](const auto& visit) {
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      if (counts_[i] > 0) visit((static_cast<double>(i) + 0.5) * step_m_, counts_[i]);
    }
    for (const double d : far) visit(d, std::uint64_t{1});
  };
  double sum = 0.0, squares = 0.0, deviations = 0.0, lower = 0.0, upper = 0.0;
  std::uint64_t seen = 0;
  for_each([&](double d, std::uint64_t n) {
    sum += d * static_cast<double>(n);
    squares += d * d * static_cast<double>(n);
    if (seen <= (count - 1) / 2) lower = d;
    if (seen <= count / 2) upper = d;
    seen += n;
  });
  const auto n = static_cast<double>(count);
  const double mean = sum / n;
  for_each([&](double d, std::uint64_t k) { deviations += (d - mean) * (d - mean) * static_cast<double>(k); });
  return {{"count", count},
          {"mean", mean},
          {"std", count > 1 ? nlohmann::json(std::sqrt(deviations / (n - 1.0))) : nlohmann::json(nullptr)},
          {"median", 0.5 * (lower + upper)},
          {"rmse", std::sqrt(squares / n)},
          {"max", largest_m_}};
}

}  // namespace tileflight::ground_truth
