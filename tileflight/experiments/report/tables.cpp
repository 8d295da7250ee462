#include "tileflight/experiments/report/tables.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "tileflight/core/drawing/number_format.h"

namespace tileflight::report {
using drawing::element;
using drawing::format_fixed;
using drawing::format_shortest;
using drawing::format_signed;
using drawing::Html;
using drawing::kUnknown;
using drawing::number_at;
using drawing::text;
using drawing::text_at;

namespace {

using nlohmann::json;
using CellFormatter = std::function<std::string(const json&)>;

Html cell(const std::string& content) { return element("td", text(content)); }
Html row_head(const std::string& content) { return element("th", {{"scope", "row"}}, text(content)); }
Html column_head(const std::string& content) {
  return content.empty() ? element("td", Html()) : element("th", {{"scope", "col"}}, text(content));
}

/// Wide tables scroll in their own frame, which is reachable by keyboard.
Html framed(const std::string& name, const Html& table) {
  return element("section", {{"class", "table-frame"}, {"tabindex", "0"}, {"aria-label", name}}, table);
}

std::vector<std::string> head_of(const std::string& first, const std::vector<FlightRun>& flights) {
  std::vector<std::string> head{first};
  for (const FlightRun& flight : flights) head.push_back(flight.label);
  return head;
}

std::vector<std::string> row(const std::string& label, const std::vector<FlightRun>& flights,
                             const CellFormatter& value) {
  std::vector<std::string> result{label};
  for (const FlightRun& flight : flights) result.push_back(value(flight.values));
  return result;
}

CellFormatter metres_cell(const std::string& pointer, int decimals = 3) {
  return [=](const json& values) { return format_fixed(number_at(values, pointer), decimals); };
}
CellFormatter integer_cell(const std::string& pointer) {
  return [=](const json& values) { return drawing::format_count(number_at(values, pointer)); };
}
CellFormatter shortest_cell(const std::string& pointer) {
  return [=](const json& values) { return format_shortest(number_at(values, pointer)); };
}
CellFormatter yes_no_cell(const std::string& pointer) {
  return [=](const json& values) -> std::string {
    const json::json_pointer place(pointer);
    if (!values.contains(place) || !values.at(place).is_boolean()) return kUnknown;
    return values.at(place).get<bool>() ? "yes" : "no";
  };
}
CellFormatter text_cell(const std::string& pointer) {
  return [=](const json& values) {
    const std::string value = text_at(values, pointer).value_or("");
    return value.empty() ? kUnknown : value;
  };
}

/// Thresholds of all flights in increasing order, with their text.
std::map<double, std::string> thresholds_of(const std::vector<FlightRun>& flights) {
  std::map<double, std::string> result;
  for (const FlightRun& flight : flights) {
    const json surface = flight.values.value("surface", json::object());
    for (const char* key : {"accuracy", "completeness", "f_score"}) {
      if (!surface.is_object() || !surface.contains(key) || !surface[key].is_object()) continue;
      for (const auto& [name, value] : surface[key].items()) result[std::strtod(name.c_str(), nullptr)] = name;
    }
  }
  return result;
}

std::string escaped_token(const std::string& key) {
  std::string token;
  for (const char c : key) token += c == '~' ? std::string("~0") : c == '/' ? std::string("~1") : std::string(1, c);
  return token;
}

std::string text_of(const json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) return format_shortest(value.get<double>());
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

bool is_true(const json& values, const std::string& pointer) {
  const json::json_pointer place(pointer);
  return values.contains(place) && values.at(place).is_boolean() && values.at(place).get<bool>();
}

Html program_table(const json& provenance) {
  Table table{"Program", {"What", "Value"}, {}};
  for (const auto& [key, value] : provenance.items()) {
    if (key == "command" || key == "inputs" || key == "seconds" || key == "attribution" || value.is_null()) continue;
    std::string name = key;
    std::replace(name.begin(), name.end(), '_', ' ');
    table.rows.push_back({name, text_of(value)});
  }
  return table.rows.empty() ? Html() : to_html(table);
}

Html inputs_table(const json& inputs) {
  Table table{"Inputs", {"File", "SHA-256"}, {}};
  if (inputs.is_array()) {
    for (const json& input : inputs) {
      const std::string path = text_at(input, "/path").value_or(text_at(input, "/name").value_or(kUnknown));
      table.rows.push_back({path, text_at(input, "/sha256").value_or(kUnknown)});
    }
  } else if (inputs.is_object()) {
    for (const auto& [path, hash] : inputs.items()) table.rows.push_back({path, text_of(hash)});
  }
  return table.rows.empty() ? Html() : to_html(table);
}

Html seconds_table(const json& seconds) {
  if (!seconds.is_object() || seconds.empty()) return {};
  Table table{"Time taken", {"Stage", "Seconds"}, {}};
  for (const auto& [stage, value] : seconds.items()) {
    table.rows.push_back({stage, value.is_number() ? format_fixed(value.get<double>(), 2) : text_of(value)});
  }
  return to_html(table);
}

Html attribution_list(const json& attribution) {
  Html list;
  if (attribution.is_array()) {
    for (const json& line : attribution) list += element("li", text(text_of(line)));
  } else if (attribution.is_string()) {
    list += element("li", text(attribution.get<std::string>()));
  }
  return list.empty() ? Html() : element("h3", text("Attribution of the tiles")) + element("ul", list);
}

/// The provider's terms under which the tiles were read, if any.
Html terms_line(const json& results) {
  const std::string provider = text_at(results, "/truth/terms/provider").value_or(""),
                    url = text_at(results, "/truth/terms/url").value_or("");
  if (url.empty()) return {};
  const bool accepted = is_true(results, "/truth/terms_accepted");
  return element("p", text("Terms of use: " + provider + ", " + url + (accepted ? ", accepted." : ", not accepted.")));
}

Html command_block(const json& provenance) {
  const auto command = text_at(provenance, "/command");
  if (!command) return {};
  return element("h3", text("Command to reproduce this run")) + element("pre", element("code", text(*command)));
}

json member(const json& object, const char* key) {
  return object.is_object() && object.contains(key) ? object[key] : json(nullptr);
}

Html figure_rows(const std::vector<KeyFigureRow>& rows, const std::vector<FlightColumn>& columns) {
  Html result;
  for (const KeyFigureRow& figure : rows) {
    Html cells = row_head(figure.label);
    for (std::size_t i = 0; i < figure.cells.size(); ++i) {
      cells += element("td", {{"class", columns[i].published ? "published" : columns[i].key}}, text(figure.cells[i]));
    }
    result += element("tr", cells);
  }
  return result;
}

}  // namespace

Html to_html(const Table& table) {
  if (table.rows.empty()) return {};
  Html head, groups, body;
  for (const std::string& name : table.header) head += column_head(name);
  for (const std::string& name : table.groups) {
    const std::string columns = std::to_string((table.header.size() - 1) / table.groups.size());
    groups += element("th", {{"scope", "colgroup"}, {"colspan", columns}}, text(name));
  }
  for (const std::vector<std::string>& cells : table.rows) {
    Html content = row_head(cells.front());
    for (std::size_t i = 1; i < cells.size(); ++i) content += cell(cells[i]);
    body += element("tr", content);
  }
  if (!groups.empty()) groups = element("tr", element("td", Html()) + groups);
  return framed(table.caption,
                element("table", element("caption", text(table.caption)) +
                                     element("thead", groups + element("tr", head)) + element("tbody", body)));
}

Html key_figures_table(const KeyFigures& figures) {
  Html groups = element("td", Html()), labels = element("td", Html());
  const auto published =
      std::count_if(figures.columns.begin(), figures.columns.end(), [](const FlightColumn& c) { return c.published; });
  const auto own = static_cast<std::ptrdiff_t>(figures.columns.size()) - published;
  if (published > 0)
    groups += element("th", {{"scope", "colgroup"}, {"colspan", std::to_string(published)}}, text("Paper"));
  if (own > 0) groups += element("th", {{"scope", "colgroup"}, {"colspan", std::to_string(own)}}, text("This run"));
  for (const FlightColumn& column : figures.columns) labels += column_head(column.label);
  const std::string caption =
      published > 0 ? "Map error against voxel centres, as published and in this run" : "The flight and its path";
  const Html table = element("caption", text(caption)) +
                     element("thead", element("tr", groups) + element("tr", labels)) +
                     element("tbody", figure_rows(figures.as_published, figures.columns)) +
                     element("tbody", {{"class", "beyond"}}, figure_rows(figures.additional, figures.columns));
  return framed(caption, element("table", {{"class", "key-figures"}}, table));
}

Table percentiles_table(const std::vector<FlightRun>& flights) {
  Table table{
      "Percentiles of the map points' distances, m: to the nearest voxel centre (of those in the cut-off) and to the "
      "exact surface (of all)",
      {"Share of points"},
      {}};
  for (const FlightRun& flight : flights) {
    table.groups.push_back(flight.label);
    for (const char* name : {"to voxel", "to surface"}) table.header.push_back(name);
  }
  for (const char* percent : {"25", "50", "75", "90", "95", "99"}) {
    std::vector<std::string> cells{std::string(percent) + "\u00A0%"};
    bool any = false;
    for (const FlightRun& flight : flights) {
      for (const char* part : {"/map", "/surface"}) {
        const auto distance_m = number_at(flight.values, std::string(part) + "/percentiles/" + percent);
        any = any || distance_m;
        cells.push_back(format_fixed(distance_m, 4));
      }
    }
    if (any) table.rows.push_back(cells);
  }
  return table;
}

Table surface_table(const std::vector<FlightRun>& flights) {
  Table table{
      "Against the exact surface: share of map points (accuracy) and of the surface seen (completeness) within a "
      "distance",
      {"Within"},
      {}};
  for (const FlightRun& flight : flights) {
    table.groups.push_back(flight.label);
    for (const char* name : {"accuracy", "compl.", "F-score"}) table.header.push_back(name);
  }
  for (const auto& [threshold_m, name] : thresholds_of(flights)) {
    std::vector<std::string> cells{format_shortest(threshold_m) + " m"};
    for (const FlightRun& flight : flights) {
      for (const char* key : {"accuracy", "completeness", "f_score"}) {
        cells.push_back(drawing::format_percent(
            number_at(flight.values, "/surface/" + std::string(key) + "/" + escaped_token(name))));
      }
    }
    table.rows.push_back(cells);
  }
  return table;
}

Table tracking_table(const std::vector<FlightRun>& flights) {
  return {"Tracking and alignment of each map",
          head_of("", flights),
          {row("Frames", flights, integer_cell("/odometry/frames")),
           row("Frames tracked", flights, integer_cell("/odometry/frames_tracked")),
           row("Lost before the end", flights, yes_no_cell("/odometry/lost")),
           row("Why", flights, text_cell("/odometry/lost_reason")),
           row("Keyframes", flights, integer_cell("/odometry/keyframes")),
           row("Odometry, frames/s", flights, shortest_cell("/odometry/frames_per_second")),
           row("Alignment start", flights, text_cell("/alignment/start")),
           row("Alignment method", flights, text_cell("/alignment/method")),
           row("Alignment converged", flights, yes_no_cell("/alignment/converged")),
           row("Iterations", flights, integer_cell("/alignment/iterations")),
           row("Scale", flights, shortest_cell("/alignment/scale")),
           row("RMS of the aligned points, m", flights, metres_cell("/alignment/rmse", 4)),
           row("Remark", flights, text_cell("/alignment/note"))}};
}

const json::json_pointer kReceiver("/trajectory/receiver");

Table trajectory_table(const std::vector<FlightRun>& flights) {
  const bool any = std::any_of(flights.begin(), flights.end(), [](const FlightRun& f) {
    return number_at(f.values, "/trajectory/ate_rmse").has_value();
  });
  if (!any) return {};
  Table table{"Error of the estimated path after alignment to the true positions",
              head_of("", flights),
              {row("Path length, m", flights, metres_cell("/trajectory/path_length", 1)),
               row("ATE (RMS), m", flights, metres_cell("/trajectory/ate_rmse")),
               row("ATE (mean), m", flights, metres_cell("/trajectory/ate_mean")),
               row("ATE (largest), m", flights, metres_cell("/trajectory/ate_max"))}};
  if (std::ranges::any_of(flights, [](const FlightRun& f) { return f.values.contains(kReceiver); })) {
    table.rows.push_back(row("ATE of a perfect path, by the reference's sigmas, m", flights,
                             metres_cell("/trajectory/receiver/expected_rmse_m")));
    table.rows.push_back(row("ATE that the reference does not explain, m", flights,
                             metres_cell("/trajectory/receiver/beyond_receiver_m")));
  }
  for (std::size_t i = 0; i < 8; ++i) {
    const std::string rpe = "/trajectory/rpe/" + std::to_string(i);
    const auto delta = std::find_if(flights.begin(), flights.end(), [&](const FlightRun& f) {
      return number_at(f.values, rpe + "/delta_m").has_value();
    });
    if (delta == flights.end()) break;
    const std::string label = "RPE over " + format_shortest(number_at(delta->values, rpe + "/delta_m")) + " m (RMS), m";
    table.rows.push_back(row(label, flights, metres_cell(rpe + "/translation_rmse_m")));
  }
  return table;
}

Table comparison_table(const nlohmann::json& results) {
  const json c = member(results, "comparison");
  if (!c.is_object() || c.empty()) return {};
  const auto low = number_at(c, "/mean_difference_ci95/0"), high = number_at(c, "/mean_difference_ci95/1");
  const std::string by = text_at(c, "/unit").value_or("") == "runs" ? "between runs, Welch's t" : "block bootstrap";
  const std::string interval = low && high ? format_signed(low, 4) + " to " + format_signed(high, 4) : kUnknown;
  return {"Published measure (distance to voxel centres): simulated minus second",
          {"", "Value"},
          {{"Difference of mean errors, m", format_signed(number_at(c, "/mean_difference"), 4)},
           {"95 % interval (" + by + "), m", interval},
           {"Difference of standard deviations, m", format_signed(number_at(c, "/std_difference"), 4)},
           {"Map points, simulated over second", format_fixed(number_at(c, "/points_ratio"), 3)},
           {"Kolmogorov\u2013Smirnov statistic", format_fixed(number_at(c, "/ks_statistic"), 4)},
           {"1-Wasserstein distance, m", format_fixed(number_at(c, "/wasserstein_m"), 4)},
           {"Equivalent within, m", format_fixed(number_at(c, "/equivalent_within_m"), 4)},
           {"Verdict on this measure alone",
            text_at(c, "/mean_difference_verdict").value_or(text_at(c, "/verdict").value_or(kUnknown))}}};
}

Table reproduction_table(const nlohmann::json& results) {
  const json r = member(results, "reproduction");
  if (!r.is_object() || r.empty()) return {};
  const auto spread = [&](const std::string& label, const std::string& key, int digits) {
    std::vector<std::string> cells{label};
    for (const char* share : {"p10", "median", "p90"})
      cells.push_back(format_fixed(number_at(r, "/" + key + "/" + share), digits));
    return cells;
  };
  const std::string poses = text_at(r, "/poses").value_or("") == "true"
                                ? "true poses"
                                : "estimated poses, which the simulated flight followed";
  Table table{"The simulated flight follows the other one: " + format_fixed(number_at(r, "/pairs"), 0) +
                  " pairs of images, " + poses,
              {"", "10 %", "Median", "90 %"},
              {spread("Overlap of views", "overlap", 3), spread("Correlation of images", "ncc", 3),
               spread("Structural similarity", "ssim", 3), spread("Distance between the cameras, m", "position_m", 3),
               spread("Angle between their axes, \u00b0", "rotation_deg", 3)}};
  table.rows.push_back({"Best time offset, s", "", format_signed(number_at(r, "/time_offset_s"), 3), ""});
  return table;
}

Html provenance_tables(const nlohmann::json& results) {
  const json provenance = member(results, "provenance");
  if (!provenance.is_object()) return element("p", text("results.json has no provenance."));
  return command_block(provenance) + program_table(provenance) + inputs_table(member(provenance, "inputs")) +
         seconds_table(member(provenance, "seconds")) + attribution_list(member(provenance, "attribution")) +
         terms_line(results);
}

}  // namespace tileflight::report
