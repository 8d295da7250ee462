#include "tileflight/experiment/ablation.h"

#include <algorithm>
#include <sstream>

#include "tileflight/experiment/run_folder.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// Columns and where results.json has them.
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

json line_of(const std::string& name, const json& results) {
  json line{{"name", name}, {"failed", nullptr}};
  for (const auto& [key, where] : columns()) line[key] = results.contains(where) ? results.at(where) : json(nullptr);
  const json::json_pointer length("/simulated/trajectory/path_length");
  line["ate_share"] = nullptr;
  if (line["ate_rmse_m"].is_number() && results.contains(length) && results.at(length).get<double>() > 0)
    line["ate_share"] = line["ate_rmse_m"].get<double>() / results.at(length).get<double>();
  return line;
}

json failed_line(const std::string& name, const std::string& why) {
  json line = line_of(name, json::object());
  line["failed"] = why;
  return line;
}

std::string csv_of(const json& lines) {
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

/// Removes the results of variants that are not asked for any more.
void forget_others(const std::vector<Variant>& variants, const fs::path& folder) {
  if (!fs::is_directory(folder)) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (std::ranges::none_of(variants, [&](const Variant& v) { return v.name == name; })) remove_results(entry.path());
  }
}

}  // namespace

json fly_variants(const std::vector<Variant>& variants, const json& results, const fs::path& run,
                  const VariantRun& fly) {
  forget_others(variants, run / "variants");
  json lines = json::array();
  lines.push_back(line_of("as it is", results));
  for (const Variant& variant : variants) {
    const fs::path folder = run / "variants" / variant.name;
    fs::create_directories(folder.parent_path());
    try {
      lines.push_back(line_of(variant.name, fly(variant, folder)));
    } catch (const InputError& error) {
      // A camera so bad that no map comes of it is an answer too; anything before odometry is a mistake.
      if (!fs::exists(folder / "stages/simulated-odometry.json")) throw;
      lines.push_back(failed_line(variant.name, error.what()));
    }
  }
  geometry::write_file(run / "ablation.csv", csv_of(lines));
  return lines;
}

}  // namespace tileflight::experiment
