#include "tileflight/experiments/report/doubts_panel.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tileflight/core/drawing/number_format.h"

namespace tileflight::report {
namespace {

using nlohmann::json;

int rank(const DoubtLine& doubt) { return doubt.how_sure == "certain" ? 0 : doubt.how_sure == "likely" ? 1 : 2; }

/// "Odometry of the real flight" for "real/odometry".
std::string place_of(const std::string& where) {
  const std::size_t slash = where.find('/');
  std::string stage = slash == std::string::npos ? where : where.substr(slash + 1);
  if (!stage.empty() && stage[0] >= 'a' && stage[0] <= 'z') stage[0] = static_cast<char>(stage[0] - 'a' + 'A');
  return slash == std::string::npos ? stage : stage + ", " + where.substr(0, slash) + " flight";
}

}  // namespace

std::vector<DoubtLine> doubt_lines(const json& results) {
  std::vector<DoubtLine> lines;
  if (!results.is_object() || !results.contains("doubts") || !results["doubts"].is_array()) return lines;
  for (const json& doubt : results["doubts"]) {
    const auto what = drawing::text_at(doubt, "/what");
    if (!what) continue;
    lines.push_back({*what, drawing::text_at(doubt, "/where").value_or(""), drawing::text_at(doubt, "/how_sure").value_or("likely"),
                     drawing::text_at(doubt, "/what_to_do").value_or("")});
  }
  std::ranges::stable_sort(lines, {}, rank);
  return lines;
}

std::string withheld_verdict_text(const json& results, const std::string& second) {
  constexpr std::size_t kNamed = 2;
  std::vector<DoubtLine> forbidding = doubt_lines(results);
  std::erase_if(forbidding, [](const DoubtLine& doubt) { return !doubt.forbids_verdict(); });
  if (forbidding.empty()) return "";
  std::string sentence = "No verdict on whether simulation predicts the " + second + " flight's map: ";
  for (std::size_t i = 0; i < std::min(kNamed, forbidding.size()); ++i)
    sentence += (i > 0 ? "; " : "") + forbidding[i].what + " (" + forbidding[i].where + ")";
  if (forbidding.size() > kNamed) sentence += "; and " + std::to_string(forbidding.size() - kNamed) + " more";
  return sentence;
}

drawing::Html doubts_panel(const json& results) {
  const std::vector<DoubtLine> lines = doubt_lines(results);
  if (lines.empty()) return {};
  drawing::Html items;
  for (const DoubtLine& doubt : lines) {
    const std::string to_do = doubt.what_to_do.empty() ? "" : " To do: " + doubt.what_to_do + ".";
    items += drawing::element("li", {{"class", doubt.how_sure}},
                     drawing::element("strong", drawing::text(doubt.how_sure)) +
                         drawing::text_with_code(" \u00B7 " + place_of(doubt.where) + ": " + doubt.what + "." + to_do));
  }
  return drawing::element(
      "section", {{"class", "doubts"}, {"aria-labelledby", "doubts-title"}},
      drawing::element("h2", {{"id", "doubts-title"}}, drawing::text("Possible problems with these numbers")) + drawing::element("ul", items));
}

}  // namespace tileflight::report
