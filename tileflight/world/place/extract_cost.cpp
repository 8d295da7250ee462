#include "tileflight/world/place/extract_cost.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::place {
namespace {

using tileset::ContentMeasures;

// Memory and time of the whole command, fitted to measurements (docs/scale.md and world/place/extract_cost_test.cpp
// hold what follows from them).
constexpr double kProgramBytes = 40e6;
constexpr double kBytesPerTriangle = 12.0, kBytesPerVertex = 24.0, kBytesPerTexel = 3.0;
/// Copies of the geometry at the peak: as loaded, cropped, joined, and in the file's buffers.
constexpr double kGeometryCopies = 3.0;
constexpr double kBytesPerSample = 100.0;
constexpr double kSecondsPerTriangle = 0.6e-6, kSecondsPerSample = 0.35e-6, kSecondsPerTexel = 30e-9;
/// Shares of an estimate that is certainly exceeded: the models above may be off by as much.
constexpr double kCertainShare = 0.8;

constexpr double kGlbLimit_bytes = 4294967296.0;
constexpr double kSampleBytesOnDisk = 36.0;  ///< position (double) and normal (float)
constexpr double kJpegBytesPerTexel = 0.25;

double glb_bytes(const ContentMeasures& m) {
  return m.triangles * kBytesPerTriangle + m.vertices * 12.0 + m.attribute_bytes;
}

double memory_bytes(const ContentMeasures& m, double samples_per_m2) {
  const double geometry = m.triangles * kBytesPerTriangle + m.vertices * kBytesPerVertex + m.attribute_bytes;
  return kGeometryCopies * geometry + kBytesPerTexel * m.texels +
         kBytesPerSample * (m.area_m2 * samples_per_m2 + m.points);
}

double disk_bytes(const ContentMeasures& m, double samples_per_m2) {
  return glb_bytes(m) + kJpegBytesPerTexel * m.texels + kSampleBytesOnDisk * (m.area_m2 * samples_per_m2 + m.points);
}

double cpu_s(const ContentMeasures& m, double samples_per_m2) {
  return kSecondsPerTriangle * m.triangles + kSecondsPerTexel * m.texels +
         kSecondsPerSample * (m.area_m2 * samples_per_m2 + m.points);
}

/// The least that an estimate may turn out to be.
double certain(double estimate, double spread) { return kCertainShare * std::max(0.0, 1.0 - spread) * estimate; }

double rounded_to_digits(double value) {
  if (!(value > 0.0)) return 0.0;
  const double unit = std::pow(10.0, std::floor(std::log10(value)) - 2.0);
  return unit >= 1.0 ? std::round(value / unit) * unit : std::round(value * 1000.0) / 1000.0;
}

std::string gigabytes(double bytes) {
  return base::formatted(bytes < 1e8 ? "%.3f GB" : bytes < 1e10 ? "%.1f GB" : "%.0f GB", 1e-9 * bytes);
}

}  // namespace

ExtractCost ExtractCost::scaled(double factor) const {
  ExtractCost out = *this;
  for (double* value : {&out.tiles, &out.bytes_read, &out.triangles, &out.disk_bytes, &out.glb_bytes, &out.cpu_s})
    *value *= factor;
  out.memory_bytes = kProgramBytes + factor * (memory_bytes - kProgramBytes);
  return out;
}

ExtractCost estimate_extract_cost(const std::vector<ContentMeasures>& probes, double tiles, double bytes_read,
                                  double samples_per_m2) {
  ExtractCost cost;
  cost.tiles = tiles;
  cost.tiles_probed = probes.size();
  cost.memory_bytes = kProgramBytes;
  if (probes.empty()) return cost;
  ContentMeasures sum;
  std::vector<double> memory;
  for (const ContentMeasures& probe : probes) {
    sum = sum + probe;
    memory.push_back(memory_bytes(probe, samples_per_m2));
  }
  const ContentMeasures whole = tiles / static_cast<double>(probes.size()) * sum;
  const tileset::SampleMean mean = tileset::sample_mean(memory, tiles);
  cost.spread = mean.mean > 0.0 ? 2.0 * mean.standard_error / mean.mean : 0.0;
  cost.bytes_read = bytes_read < 0.0 ? whole.file_bytes : bytes_read;
  cost.triangles = whole.triangles;
  cost.memory_bytes += tiles * mean.mean;
  cost.disk_bytes = disk_bytes(whole, samples_per_m2);
  cost.glb_bytes = glb_bytes(whole);
  cost.cpu_s = cpu_s(whole, samples_per_m2);
  return cost;
}

double extraction_memory_bytes(const ContentMeasures& measures, double samples_per_m2) {
  return kProgramBytes + memory_bytes(measures, samples_per_m2);
}

nlohmann::json to_json(const ExtractCost& cost) {
  return {{"tiles", std::round(cost.tiles)},
          {"bytes", rounded_to_digits(cost.bytes_read)},
          {"triangles", rounded_to_digits(cost.triangles)},
          {"memory_bytes", rounded_to_digits(cost.memory_bytes)},
          {"disk_bytes", rounded_to_digits(cost.disk_bytes)},
          {"seconds", rounded_to_digits(cost.cpu_s)}};
}

std::string cost_text(const ExtractCost& cost) {
  std::string text = base::formatted("%.0f tiles", cost.tiles) +
                     base::formatted(cost.bytes_read < 1e9 ? " (%.0f MB), " : " (%.4g MB), ", 1e-6 * cost.bytes_read) +
                     base::formatted("%.3g million triangles: ", 1e-6 * cost.triangles) + gigabytes(cost.memory_bytes) +
                     " of memory, " + gigabytes(cost.disk_bytes) + " on disk, " +
                     base::formatted("%.3g s of processor time", cost.cpu_s);
  if (!std::isfinite(cost.spread)) return text + " (of one tile: a guess)";
  return text + base::formatted(" (± %.0f %%)", 100.0 * cost.spread);
}

void require_disk_space(const ExtractCost& cost, const std::filesystem::path& folder) {
  std::filesystem::path existing = std::filesystem::absolute(folder);
  std::error_code error;
  while (!std::filesystem::exists(existing, error) && existing.has_relative_path()) existing = existing.parent_path();
  const std::filesystem::space_info space = std::filesystem::space(existing, error);
  if (error || certain(cost.disk_bytes, cost.spread) <= static_cast<double>(space.available)) return;
  throw InputError(folder.string(), "the extraction would write about " + gigabytes(cost.disk_bytes) + ", and only " +
                                        gigabytes(static_cast<double>(space.available)) +
                                        " are free: choose another disk, a smaller region (--size) or coarser tiles "
                                        "(--error)");
}

void require_program_memory(std::uintmax_t memory_limit_bytes, const std::filesystem::path& folder) {
  if (static_cast<double>(memory_limit_bytes) >= kProgramBytes) return;
  throw InputError(folder.string(),
                   base::formatted("an extraction takes at least %.3g GB of memory, and %.3g GB are allowed: "
                                   "raise the limit (--memory)",
                                   1e-9 * kProgramBytes, 1e-9 * static_cast<double>(memory_limit_bytes)));
}

void require_affordable(const ExtractCost& cost, std::uintmax_t memory_limit_bytes,
                        const std::filesystem::path& folder) {
  constexpr const char* kRemedy =
      ": extract in blocks (--block auto), a smaller region (--size) or coarser tiles (--error)";
  if (certain(cost.memory_bytes, cost.spread) > static_cast<double>(memory_limit_bytes)) {
    throw InputError(folder.string(), "the extraction would take about " + gigabytes(cost.memory_bytes) +
                                          " of memory, and " + gigabytes(static_cast<double>(memory_limit_bytes)) +
                                          " are available" + kRemedy);
  }
  if (std::max(0.0, 1.0 - cost.spread) * cost.glb_bytes > kGlbLimit_bytes) {
    throw InputError(folder.string(), "its mesh.glb would be about " + gigabytes(cost.glb_bytes) +
                                          ", more than the 4 GiB that a GLB file can have" + kRemedy);
  }
  require_disk_space(cost, folder);
}

}  // namespace tileflight::place
