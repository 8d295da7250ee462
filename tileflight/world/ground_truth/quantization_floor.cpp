#include "tileflight/world/ground_truth/quantization_floor.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"

namespace tileflight::ground_truth {
namespace {

constexpr double kStepsPerVoxel = 1048576.0;
constexpr std::size_t kSteps = 2 * 1048576;

/// Seven bits a byte, low ones first; the highest bit says that more follow (LEB128).
void append_number(std::string& bytes, std::uint64_t value) {
  for (; value >= 0x80U; value >>= 7U) bytes += static_cast<char>(value | 0x80U);
  bytes += static_cast<char>(value);
}

/// Reads what append_number() and base::append_raw() wrote.
class CountReader {
 public:
  CountReader(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  bool at_end() const { return bytes_.empty(); }
  std::uint64_t number() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      const auto byte = static_cast<unsigned char>(take(1)[0]);
      value |= std::uint64_t{byte & 0x7FU} << shift;
      if (byte < 0x80U) return value;
    }
    throw broken();
  }
  double length() {
    double value = 0.0;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  InputError broken() const { return {name_, "holds no counts of distances; remove it, and it is made again"}; }

 private:
  std::string_view take(std::size_t count) {
    if (bytes_.size() < count) throw broken();
    const std::string_view taken = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return taken;
  }

  std::string_view bytes_;
  const std::string& name_;
};

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

std::string QuantizationFloor::to_bytes() const {
  std::string bytes;
  base::append_raw(bytes, largest_m_);
  append_number(bytes, far_.size());
  for (const double d : far_) base::append_raw(bytes, d);
  std::size_t next = 0;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    if (counts_[i] == 0) continue;
    append_number(bytes, i - next);
    append_number(bytes, counts_[i]);
    next = i + 1;
  }
  return bytes;
}

void QuantizationFloor::add_bytes(std::string_view bytes, const std::string& name) {
  CountReader reader(bytes, name);
  largest_m_ = std::max(largest_m_, reader.length());
  const std::uint64_t far = reader.number();
  for (std::uint64_t i = 0; i < far; ++i) far_.push_back(reader.length());
  for (std::uint64_t next = 0; !reader.at_end(); ++next) {
    const std::uint64_t gap = reader.number();
    if (gap >= counts_.size() - next) throw reader.broken();
    next += gap;
    counts_[next] += reader.number();
  }
}

std::optional<FloorStatistics> QuantizationFloor::statistics() const {
  std::vector<double> far = far_;
  std::sort(far.begin(), far.end());
  std::uint64_t count = far.size();
  for (const std::uint64_t n : counts_) count += n;
  if (count == 0) return std::nullopt;
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
  return FloorStatistics{.count = count,
                         .mean_m = mean,
                         .std_m = count > 1 ? std::optional(std::sqrt(deviations / (n - 1.0))) : std::nullopt,
                         .median_m = 0.5 * (lower + upper),
                         .rmse_m = std::sqrt(squares / n),
                         .max_m = largest_m_};
}

}  // namespace tileflight::ground_truth
