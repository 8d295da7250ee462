#include "tileflight/experiments/report/warnings_panel.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tileflight/core/drawing/number_format.h"

namespace tileflight::report {
using drawing::element;
using drawing::Html;
using drawing::text;
using drawing::text_at;

namespace {

using nlohmann::json;

int rank(const WarningLine& warning) { return warning.severity == "error" ? 0 : warning.severity == "warning" ? 1 : 2; }

/// "Odometry of the real flight" for "real/odometry".
std::string place_of(const std::string& where) {
  const std::size_t slash = where.find('/');
  std::string stage = slash == std::string::npos ? where : where.substr(slash + 1);
  if (!stage.empty() && stage[0] >= 'a' && stage[0] <= 'z') stage[0] = static_cast<char>(stage[0] - 'a' + 'A');
  return slash == std::string::npos ? stage : stage + ", " + where.substr(0, slash) + " flight";
}

}  // namespace

std::vector<WarningLine> warning_lines(const json& results) {
  std::vector<WarningLine> lines;
  if (!results.is_object() || !results.contains("warnings") || !results["warnings"].is_array()) return lines;
  for (const json& warning : results["warnings"]) {
    const auto message = text_at(warning, "/message");
    if (!message) continue;
    lines.push_back({*message, text_at(warning, "/where").value_or(""),
                     text_at(warning, "/severity").value_or("warning"), text_at(warning, "/remedy").value_or("")});
  }
  std::ranges::stable_sort(lines, {}, rank);
  return lines;
}

std::string withheld_verdict_text(const json& results, const std::string& second) {
  constexpr std::size_t kNamed = 2;
  std::vector<WarningLine> forbidding = warning_lines(results);
  std::erase_if(forbidding, [](const WarningLine& warning) { return !warning.forbids_verdict(); });
  if (forbidding.empty()) return "";
  std::string sentence = "No verdict on whether simulation predicts the " + second + " flight's map: ";
  for (std::size_t i = 0; i < std::min(kNamed, forbidding.size()); ++i)
    sentence += (i > 0 ? "; " : "") + forbidding[i].message + " (" + forbidding[i].where + ")";
  if (forbidding.size() > kNamed) sentence += "; and " + std::to_string(forbidding.size() - kNamed) + " more";
  return sentence;
}

Html warnings_panel(const json& results) {
  const std::vector<WarningLine> lines = warning_lines(results);
  if (lines.empty()) return {};
  Html items;
  for (const WarningLine& warning : lines) {
    const std::string to_do = warning.remedy.empty() ? "" : " To do: " + warning.remedy + ".";
    items += element(
        "li", {{"class", warning.severity}},
        element("strong", text(warning.severity)) +
            drawing::text_with_code(" \u00B7 " + place_of(warning.where) + ": " + warning.message + "." + to_do));
  }
  return element(
      "section", {{"class", "warnings"}, {"aria-labelledby", "warnings-title"}},
      element("h2", {{"id", "warnings-title"}}, text("Possible problems with these numbers")) + element("ul", items));
}

}  // namespace tileflight::report
