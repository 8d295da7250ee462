#include "tileflight/experiments/experiment/ablation.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <sstream>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/experiments/experiment/run_folder.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// Columns and their JSON pointers in results.json.
const std::vector<std::pair<const char*, json::json_pointer>>& columns() {
  static const std::vector<std::pair<const char*, json::json_pointer>> kColumns{
      {"frames", json::json_pointer("/simulated/frames")},
      {"frames_tracked", json::json_pointer("/simulated/odometry/frames_tracked")},
      {"keyframes", json::json_pointer("/simulated/odometry/keyframes")},
      {"points", json::json_pointer("/simulated/map/points")},
      {"correspondences", json::json_pointer("/simulated/map/correspondences")},
      {"mean_m", json::json_pointer("/simulated/map/mean")},
      {"std_m", json::json_pointer("/simulated/map/std")},
      {"median_to_surface_m", json::json_pointer("/simulated/surface/median")},
      {"ate_rmse_m", json::json_pointer("/simulated/trajectory/ate_rmse")}};
  return kColumns;
}

json variant_row(const std::string& name, const json& results) {
  json line{{"name", name}, {"failed", nullptr}};
  for (const auto& [key, where] : columns()) line[key] = results.contains(where) ? results.at(where) : json(nullptr);
  const json::json_pointer length("/simulated/trajectory/path_length");
  line["ate_share"] = nullptr;
  if (line["ate_rmse_m"].is_number() && results.contains(length) && results.at(length).get<double>() > 0)
    line["ate_share"] = line["ate_rmse_m"].get<double>() / results.at(length).get<double>();
  return line;
}

json failed_row(const std::string& name, const std::string& why) {
  json line = variant_row(name, json::object());
  line["failed"] = why;
  return line;
}

std::string to_csv(const json& lines) {
  std::ostringstream text;
  text << "name";
  for (const auto& column : columns()) text << ',' << column.first;
  text << ",ate_share,failed\n";
  const auto cell = [](const json& value) { return value.is_null() ? std::string() : value.dump(); };
  for (const json& line : lines) {
    text << line["name"].get<std::string>();
    for (const auto& column : columns()) text << ',' << cell(line[column.first]);
    text << ',' << cell(line["ate_share"]) << ',' << (line["failed"].is_null() ? "" : "yes") << "\n";
  }
  return text.str();
}

/// Removes the results of variants that are no longer requested.
void remove_stale_variants(const std::vector<Variant>& variants, const fs::path& folder) {
  if (!fs::is_directory(folder)) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (std::ranges::none_of(variants, [&](const Variant& v) { return v.name == name; })) remove_results(entry.path());
  }
}

}  // namespace

json run_variants(const std::vector<Variant>& variants, const json& results, const fs::path& run,
                  const VariantRunner& fly) {
  remove_stale_variants(variants, run / "variants");
  json lines = json::array();
  lines.push_back(variant_row("as it is", results));
  for (const Variant& variant : variants) {
    const fs::path folder = run / "variants" / variant.name;
    fs::create_directories(folder.parent_path());
    try {
      lines.push_back(variant_row(variant.name, fly(variant, folder)));
    } catch (const InputError& error) {
      // A camera too poor for any map is a valid result; a failure before odometry is an error.
      if (!fs::exists(folder / "stages/simulated-odometry.json")) throw;
      lines.push_back(failed_row(variant.name, error.what()));
    }
  }
  base::write_file(run / "ablation.csv", to_csv(lines));
  return lines;
}

}  // namespace tileflight::experiment
