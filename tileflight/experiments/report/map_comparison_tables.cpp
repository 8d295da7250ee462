#include "tileflight/experiments/report/map_comparison_tables.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/experiments/report/key_figures.h"

namespace tileflight::report {
using drawing::format_count;
using drawing::format_fixed;
using drawing::format_shortest;
using drawing::format_signed;
using drawing::kUnknown;
using drawing::number_at;
using drawing::text_at;

namespace {

using nlohmann::json;

/// Names and formatting of one of the numbers.
struct Wording {
  std::string label;   ///< in tables
  std::string phrase;  ///< in a sentence, before "is … times"
  bool is_share = false;
  int decimals = 4;  ///< of metres
};

/// Returns "0.1" for "within_0.1".
std::string threshold_of(const std::string& key) { return key.substr(std::min(key.size(), key.find('_') + 1)); }

Wording wording_of(const std::string& part, const std::string& key) {
  const std::string at = threshold_of(key) + "\u00A0m";
  if (key == "lacking")
    return {"Missing share of what the other map covers", "the missing share of what the other map covers", true};
  if (part == "completeness") return {"Completeness at " + at, "completeness at " + at, true};
  if (part == "path") return {"Path error (ATE), m", "the path error", false, 3};
  if (key == "median") return {"Median to the exact surface, m", "the median distance to the surface"};
  if (key == "rms") return {"RMS of the points in cut-off, m", "the RMS distance of the points in the cut-off"};
  if (key.starts_with("within")) return {"Points within " + at, "the share of points within " + at, true};
  if (key.starts_with("beyond")) return {"Points farther than " + at, "the share of points farther than " + at, true};
  return {part + " " + key, part + " " + key};
}

/// One number of the comparison.
struct MetricEntry {
  std::string name;  ///< "surface.median"
  Wording wording;
  json values;

  bool by_ratio() const { return text_at(values, "/margin_of").value_or("") == "ratio"; }
};

std::vector<MetricEntry> compared_in(const json& comparison) {
  std::vector<MetricEntry> list;
  // In reading order, not alphabetical.
  const auto rank = [](const std::string& key) {
    return key == "median" ? 0 : key == "rms" ? 1 : key.starts_with("within") ? 2 : 3;
  };
  for (const char* part : {"surface", "completeness", "path"}) {
    if (!comparison.is_object() || !comparison.contains(part) || !comparison[part].is_object()) continue;
    const auto first = static_cast<std::ptrdiff_t>(list.size());
    for (const auto& [key, values] : comparison[part].items()) {
      if (key != "blocks" && values.is_object())
        list.push_back({std::string(part) + "." + key, wording_of(part, key), values});
    }
    std::stable_sort(list.begin() + first, list.end(), [&](const MetricEntry& a, const MetricEntry& b) {
      return rank(a.name.substr(a.name.find('.') + 1)) < rank(b.name.substr(b.name.find('.') + 1));
    });
  }
  return list;
}

std::string value_text(const MetricEntry& c, const char* flight) {
  const auto value = number_at(c.values, std::string("/") + flight);
  return c.wording.is_share ? drawing::format_percent(value) : format_fixed(value, c.wording.decimals);
}

/// The judged quantity: "1.43", "+8.3 points".
std::string judged_text(const MetricEntry& c, const std::string& pointer) {
  const auto value = number_at(c.values, pointer);
  if (c.by_ratio()) return format_shortest(value ? std::optional(std::round(*value * 1000) / 1000) : std::nullopt);
  if (!c.wording.is_share) return format_signed(value, c.wording.decimals);
  return format_signed(value ? std::optional(100 * *value) : std::nullopt, 1);
}

std::string interval_text(const MetricEntry& c) {
  const std::string key = c.by_ratio() ? "/ratio_ci95" : "/ci95";
  if (!number_at(c.values, key + "/0") || !number_at(c.values, key + "/1")) return kUnknown;
  return judged_text(c, key + "/0") + " to " + judged_text(c, key + "/1");
}

/// "×1.25", "5 points", "×1.25 or 0.1 m".
std::string margin_text(const MetricEntry& c) {
  const auto margin = number_at(c.values, "/margin"), or_within = number_at(c.values, "/or_within");
  if (!c.by_ratio()) return format_shortest(margin ? std::optional(100 * *margin) : std::nullopt) + " points";
  return "\u00D7" + format_shortest(margin) + (or_within ? " or " + format_shortest(or_within) + "\u00A0m" : "");
}

std::string judged_and_unit(const MetricEntry& c) {
  const std::string text = judged_text(c, c.by_ratio() ? "/ratio" : "/difference");
  return c.by_ratio() ? "\u00D7" + text : text + " points";
}

std::string verdict_cell(const MetricEntry& c) {
  const std::string word = text_at(c.values, "/verdict").value_or(kUnknown);
  const bool decides = !c.values.contains("decides") || c.values["decides"] != false;
  return decides ? word : word + " (not used for the verdict)";
}

/// "completeness at 0.2 m is 3.37 times the surrogate's (95 % interval 2.9 to 4.1; up to 1.02 counts as the same)".
std::string phrase_of(const MetricEntry& c, const std::string& second) {
  const auto value = number_at(c.values, c.by_ratio() ? "/ratio" : "/difference");
  std::string words = c.wording.phrase + " is ";
  if (!value) return words + "not known for both";
  if (c.by_ratio()) {
    words += judged_text(c, "/ratio") + " times the " + second + "'s";
  } else {
    words += format_fixed(100 * std::abs(*value), 1) + " percentage points " + (*value < 0 ? "below" : "above") +
             " the " + second + "'s";
  }
  const std::string interval = interval_text(c);
  const std::string same = c.by_ratio() ? margin_text(c).substr(std::string("\u00D7").size()) : margin_text(c);
  return words + " (" + (interval == kUnknown ? "no interval" : "95\u00A0% interval " + interval) +
         "; equivalence margin " + same + ")";
}

/// Phrases of the numbers that a verdict gives as its reasons.
std::vector<std::string> phrases_of(const json& comparison, const std::string& list, const std::string& second) {
  std::vector<std::string> phrases;
  for (const MetricEntry& c : compared_in(comparison)) {
    const json names = comparison.value(list, json::array());
    if (std::find(names.begin(), names.end(), c.name) != names.end()) phrases.push_back(phrase_of(c, second));
  }
  return phrases;
}

std::string joined(const std::vector<std::string>& parts) {
  constexpr std::size_t kMost = 3;
  std::string text;
  for (std::size_t i = 0; i < std::min(kMost, parts.size()); ++i) text += (i > 0 ? "; " : "") + parts[i];
  if (parts.size() > kMost) text += "; and " + std::to_string(parts.size() - kMost) + " more";
  return text;
}

std::string padded(const std::string& text, std::size_t width, bool left) {
  const auto characters =
      static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
  const std::string space(width - std::min(width, characters), ' ');
  return left ? space + text : text + space;
}

}  // namespace

bool has_map_comparison(const json& comparison) { return !compared_in(comparison).empty(); }

Table map_comparison_table(const json& results) {
  const json comparison = results.is_object() ? results.value("comparison", json()) : json();
  const std::string second =
      results.is_object() && results.contains("real") ? flight_label("real", results["real"]) : "Second flight";
  Table table{"Basis of the verdict: two values are equivalent, different or undecided",
              {"", "Simulated", second, "Simulated against second", "95 % interval", "Margin", "Verdict"},
              {}};
  for (const MetricEntry& c : compared_in(comparison)) {
    table.rows.push_back({c.wording.label, value_text(c, "simulated"), value_text(c, "real"), judged_and_unit(c),
                          interval_text(c), margin_text(c), verdict_cell(c)});
  }
  return table;
}

Table missing_parts_table(const json& results) {
  const json comparison = results.is_object() ? results.value("comparison", json()) : json();
  const json::json_pointer place("/missing_parts/parts");
  if (!comparison.is_object() || !comparison.contains(place) || !comparison.at(place).is_array()) return {};
  const std::string second =
      results.contains("real") ? flight_label("real", results["real"]) : std::string("Second flight");
  Table table{
      "Spheres on the surface seen by both cameras where one map has many points and the other hardly any (most "
      "significant first; by chance, one in twenty pairs of maps has any)",
      {"East, north, up, m", "Diameter, m", "Simulated points", second + " points", "Missing in"},
      {}};
  for (const json& part : comparison.at(place)) {
    const auto at = [&](const char* axis) { return format_fixed(number_at(part, std::string("/center/") + axis), 0); };
    table.rows.push_back({at("0") + ", " + at("1") + ", " + at("2"), format_shortest(number_at(part, "/edge")),
                          format_count(number_at(part, "/points/simulated")),
                          format_count(number_at(part, "/points/real")),
                          text_at(part, "/lacks").value_or("") == "simulated" ? "simulated" : base::to_lower(second)});
  }
  return table;
}

std::string map_comparison_text(const json& results) {
  Table table = map_comparison_table(results);
  if (table.rows.empty()) return "";
  table.header[3] = "sim. vs second";
  std::vector<std::vector<std::string>> lines{table.header};
  lines.insert(lines.end(), table.rows.begin(), table.rows.end());
  std::vector<std::size_t> widths(table.header.size(), 0);
  for (const auto& line : lines) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      widths[i] = std::max(widths[i], static_cast<std::size_t>(std::count_if(
                                          line[i].begin(), line[i].end(), [](char c) { return (c & 0xC0) != 0x80; })));
    }
  }
  std::string text = verdict(results) + "\n";
  for (const auto& line : lines) {
    std::string row;
    for (std::size_t i = 0; i < line.size(); ++i)
      row += (i > 0 ? "  " : "") + padded(line[i], widths[i], i > 0 && i + 1 < line.size());
    row.erase(row.find_last_not_of(' ') + 1);
    text += row + "\n";
  }
  return text;
}

std::string map_comparison_claim(const json& comparison, const std::string& second) {
  const std::string word = text_at(comparison, "/verdict").value_or("");
  const std::string what = "the " + second + " flight's map: ";
  if (word == "equivalent")
    return "Simulation predicted " + what + joined(phrases_of(comparison, "verdict_on", second));
  const std::string reasons = joined(phrases_of(comparison, "verdict_because", second));
  if (word == "different") return "Simulation did not predict " + what + reasons;
  return "Inconclusive: the data do not decide whether simulation predicts " + what + reasons;
}

}  // namespace tileflight::report
