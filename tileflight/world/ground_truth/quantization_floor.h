#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::ground_truth {

/// Statistics of distances, metres.
struct FloorStatistics {
  std::uint64_t count = 0;
  double mean_m = 0.0;
  std::optional<double> std_m;  ///< divisor n - 1; nullopt for a single distance
  double median_m = 0.0;
  double rmse_m = 0.0;
  double max_m = 0.0;

  bool operator==(const FloorStatistics&) const = default;
};

/// Statistics of the distances from surface samples to the nearest voxel centre: the errors of a perfect map. They are
/// counted in steps of 2^-20 of a voxel, so that neither memory nor result depends on the number of samples, their
/// order or the parts in which they come.
class QuantizationFloor {
 public:
  explicit QuantizationFloor(double voxel_m);

  /// Adds distances, metres.
  void add(const std::vector<double>& distances_m);

  /// Returns the counts in a compact form, to be kept in a file.
  std::string to_bytes() const;
  /// Adds the counts of to_bytes() of another, with voxels of the same size. Throws InputError, naming `name`, if they
  /// are broken.
  void add_bytes(std::string_view bytes, const std::string& name);

  /// Returns nullopt without distances.
  std::optional<FloorStatistics> statistics() const;

 private:
  double step_m_;
  double largest_m_ = 0.0;
  std::vector<std::uint64_t> counts_;  ///< by distance, for those below two voxels
  std::vector<double> far_;            ///< the others: no voxel is occupied nearby
};

}  // namespace tileflight::ground_truth
