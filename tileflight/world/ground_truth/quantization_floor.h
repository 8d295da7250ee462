#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::ground_truth {

/// Statistics of the distances from surface samples to the nearest voxel centre: the errors of a perfect map. They are
/// counted in steps of 2^-20 of a voxel, so that neither memory nor result depends on the number of samples, their
/// order or the parts in which they come.
class QuantizationFloor {
 public:
  explicit QuantizationFloor(double voxel_m);

  /// Adds distances, metres.
  void add(const std::vector<double>& distances_m);

  /// The counts in a compact form, to be kept in a file.
  std::string to_bytes() const;
  /// Adds the counts of to_bytes() of another, with voxels of the same size. Throws InputError, naming `name`, if they
  /// are broken.
  void add_bytes(std::string_view bytes, const std::string& name);

  /// {count, mean, std (divisor n - 1), median, rmse, max}, metres; null without distances.
  nlohmann::json to_json() const;

 private:
  double step_m_;
  double largest_m_ = 0.0;
  std::vector<std::uint64_t> counts_;  ///< by distance, for those below two voxels
  std::vector<double> far_;            ///< the others: no voxel is occupied nearby
};

}  // namespace tileflight::ground_truth
