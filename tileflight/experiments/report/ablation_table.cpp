#include "tileflight/experiments/report/ablation_table.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/core/drawing/number_format.h"

namespace tileflight::report {
using drawing::display_width;
using drawing::format_count;
using drawing::format_fixed;
using drawing::kUnknown;
using drawing::number_at;
using drawing::text_at;

namespace {

using nlohmann::json;

std::vector<std::string> row_of(const json& line) {
  const std::string name = text_at(line, "/name").value_or(kUnknown);
  const auto why = text_at(line, "/failed");
  if (why) return {name, "no map", kUnknown, kUnknown, kUnknown, kUnknown, kUnknown};
  const auto share = number_at(line, "/ate_share");
  return {name,
          format_count(number_at(line, "/frames_tracked")),
          format_count(number_at(line, "/points")),
          format_fixed(number_at(line, "/mean_m"), 4),
          format_fixed(number_at(line, "/median_to_surface_m"), 4),
          format_fixed(number_at(line, "/ate_rmse_m"), 4),
          share ? format_fixed(100.0 * *share, 3) : kUnknown};
}

const std::vector<std::string>& head() {
  static const std::vector<std::string> kHead{"Variant",           "Frames tracked",       "Map points",
                                              "Mean to voxels, m", "Median to surface, m", "Path error, m",
                                              "% of path"};
  return kHead;
}

std::vector<std::vector<std::string>> rows_of(const json& results) {
  std::vector<std::vector<std::string>> rows;
  const auto found = results.find("ablation");
  if (found == results.end() || !found->is_array()) return rows;
  for (const json& line : *found) rows.push_back(row_of(line));
  return rows;
}

}  // namespace

Table ablation_table(const json& results) {
  return {"Effect of each part of the camera model on the simulated flight's map and path", head(), rows_of(results)};
}

std::string ablation_text(const json& results) {
  auto rows = rows_of(results);
  if (rows.empty()) return "";
  rows.insert(rows.begin(), head());
  std::vector<std::size_t> widths(head().size(), 0);
  for (const auto& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], display_width(row[i]));
  std::string text;
  for (const auto& row : rows) {
    text += row[0] + std::string(widths[0] - display_width(row[0]), ' ');
    for (std::size_t i = 1; i < row.size(); ++i)
      text += "  " + std::string(widths[i] - display_width(row[i]), ' ') + row[i];
    text += "\n";
  }
  return text;
}

}  // namespace tileflight::report
