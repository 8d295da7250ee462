#include "outcome.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::proving_ground {
namespace {

using geometry::Sim3;
using geometry::Vec3;
using nlohmann::json;

struct PosePairs {
  std::vector<geometry::SE3> estimate, truth;
  std::vector<Vec3> estimate_positions, true_positions;
};

PosePairs pairs_of(const geometry::Trajectory& estimate, const geometry::Trajectory& truth) {
  PosePairs pairs;
  for (const auto& [e, t] : geometry::associate(estimate, truth)) {
    pairs.estimate.push_back(estimate.poses[e].T_local_camera);
    pairs.truth.push_back(truth.poses[t].T_local_camera);
    pairs.estimate_positions.push_back(pairs.estimate.back().translation);
    pairs.true_positions.push_back(pairs.truth.back().translation);
  }
  if (pairs.estimate.size() < 3) throw InputError("trajectory", "fewer than three poses share a time with the truth");
  return pairs;
}

/// The nine tenths of the points that lie nearest to the path.
std::vector<Vec3> nearer_points(const geometry::PointCloud& map, const geometry::Trajectory& path) {
  const auto distance = [&](const Vec3& p) {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& pose : path.poses) least = std::min(least, (p - pose.T_local_camera.translation).squaredNorm());
    return least;
  };
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < map.size(); ++i) order.emplace_back(distance(map.positions[i]), i);
  std::sort(order.begin(), order.end());
  std::vector<Vec3> points;
  for (std::size_t k = 0; k < order.size() * 9 / 10; ++k) points.push_back(map.positions[order[k].second]);
  return points;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, std::abs(value) < 10.0 ? "%.3f" : "%.1f", value);
  return text;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// One line of the table: how the outcomes of a group ended.
std::string line(const std::string& group, const std::vector<const Outcome*>& outcomes) {
  std::map<std::string, int> count;
  std::vector<double> offsets;
  for (const Outcome* o : outcomes) {
    ++count[o->verdict()];
    if (o->error.empty()) offsets.push_back(o->errors.offset_m);
  }
  return "| " + group + " | " + std::to_string(outcomes.size()) + " | " + std::to_string(count["right"]) + " | " +
         std::to_string(count["false warning"]) + " | " + std::to_string(count["warned"]) + " | " +
         std::to_string(count["SILENT"]) + " | " + number(median(offsets)) + " |\n";
}

std::string lines_by(const std::vector<Outcome>& outcomes, const std::function<std::string(const Outcome&)>& group_of) {
  std::map<std::string, std::vector<const Outcome*>> groups;
  for (const Outcome& o : outcomes) groups[group_of(o)].push_back(&o);
  std::string text;
  for (const auto& [group, members] : groups) text += line(group, members);
  return text;
}

std::string height_class(const Outcome& o) {
  if (o.draw.height_m < 12.0) return "5 to 12 m up";
  if (o.draw.height_m < 30.0) return "12 to 30 m up";
  return o.draw.height_m < 60.0 ? "30 to 60 m up" : "60 to 120 m up";
}

/// Offset over sigma, RMS over the results that were right: 1 where the sigmas are honest.
double calibration(const std::vector<Outcome>& outcomes) {
  double sum = 0.0, n = 0.0;
  for (const Outcome& o : outcomes) {
    if (!o.is_right() || !(o.sigma_m > 0.0)) continue;
    sum += std::pow(o.errors.offset_m / o.sigma_m, 2);
    n += 1.0;
  }
  return n > 0.0 ? std::sqrt(sum / n) : std::numeric_limits<double>::quiet_NaN();
}

/// Describes how many flights' sigmas have the right size, and how far the others are off.
std::string path_sigma_line(const std::vector<Outcome>& outcomes, const std::string& what, double PathSigmas::*member) {
  std::vector<double> ratios;
  for (const Outcome& o : outcomes)
    if (o.path_sigmas && o.errors.ate_m <= 0.01 * o.errors.path_m) ratios.push_back((*o.path_sigmas).*member);
  if (ratios.empty()) return "";
  std::sort(ratios.begin(), ratios.end());
  const auto fine = std::ranges::count_if(ratios, [](double r) { return r >= 0.5 && r <= 2.0; });
  const auto quantile = [&](double q) { return number(ratios[static_cast<std::size_t>(q * (ratios.size() - 1))]); };
  return "Sigmas of the path, " + what + ": squared error over squared sigma within 0.5 to 2 in " +
         std::to_string(fine) + " of " + std::to_string(ratios.size()) + " flights whose path is right; 5 % below " +
         quantile(0.05) + ", median " + quantile(0.5) + ", 5 % above " + quantile(0.95) + "\n";
}

/// Counts with notes included.
std::string literal_counts(const std::vector<Outcome>& outcomes) {
  const auto count = [&](auto&& which) { return std::to_string(std::ranges::count_if(outcomes, which)); };
  return "Right with any warning, notes included: " +
         count([](const Outcome& o) { return o.is_right() && !o.is_without_a_word(); }) +
         "; wrong without any warning at all: " +
         count([](const Outcome& o) { return !o.is_right() && o.is_without_a_word(); }) + "\n";
}

std::string joined(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) all += (all.empty() ? "" : "; ") + text;
  return all;
}

}  // namespace

TrueErrors true_errors(const geometry::PointCloud& map, const geometry::Trajectory& estimate,
                       const geometry::Trajectory& truth, const Sim3& T_local_map) {
  const PosePairs pairs = pairs_of(estimate, truth);
  TrueErrors errors;
  errors.path_m = geometry::path_length_m(truth);
  const Sim3 by_positions =
      alignment::umeyama(pairs.estimate_positions, pairs.true_positions, alignment::ScaleMode::kEstimated)
          .T_target_source;
  double squares = 0.0;
  for (std::size_t i = 0; i < pairs.estimate.size(); ++i)
    squares += (by_positions * pairs.estimate_positions[i] - pairs.true_positions[i]).squaredNorm();
  errors.ate_m = std::sqrt(squares / static_cast<double>(pairs.estimate.size()));

  const Sim3 T_true = alignment::fit_poses(pairs.estimate, pairs.truth);
  const std::vector<Vec3> points = nearer_points(map, estimate);
  squares = 0.0;
  for (const Vec3& p : points) squares += (T_local_map * p - T_true * p).squaredNorm();
  errors.offset_m = points.empty() ? std::numeric_limits<double>::infinity()
                                   : std::sqrt(squares / static_cast<double>(points.size()));
  errors.scale_error = T_local_map.scale / T_true.scale - 1.0;
  return errors;
}

bool Outcome::is_right() const {
  return error.empty() && errors.offset_m <= std::max(0.1, 3.0 * errors.ate_m) && errors.ate_m <= 0.01 * errors.path_m;
}

std::string Outcome::verdict() const {
  if (is_right()) return has_warning() ? "false warning" : "right";
  return has_warning() ? "warned" : "SILENT";
}

json to_json(const Outcome& o) {
  json object = {{"name", o.name},
                 {"place", o.place},
                 {"change", o.change},
                 {"seed", o.draw.seed},
                 {"kind", name_of(o.draw.kind)},
                 {"view", name_of(o.draw.view)},
                 {"aids", name_of(o.draw.aids)},
                 {"lens_deg", o.draw.lens_deg},
                 {"height_m", o.draw.height_m},
                 {"pitch_deg", o.draw.pitch_deg},
                 {"degraded", o.draw.degraded},
                 {"stage", o.stage},
                 {"error", o.error},
                 {"frames", o.frames},
                 {"tracked", o.tracked},
                 {"ate_m", o.errors.ate_m},
                 {"path_m", o.errors.path_m},
                 {"offset_m", o.errors.offset_m},
                 {"scale_error", o.errors.scale_error},
                 {"sigma_m", o.sigma_m},
                 {"warnings", o.warnings},
                 {"withheld", o.withheld},
                 {"verdict", o.verdict()},
                 {"seconds", o.seconds}};
  if (o.path_sigmas)
    object["path_sigmas"] = {{"position", o.path_sigmas->position}, {"rotation", o.path_sigmas->rotation}};
  return object;
}

Outcome outcome_from_json(const json& object) {
  const auto number_at = [&](const char* key) {  // what is not finite is null in JSON
    return object.at(key).is_null() ? std::numeric_limits<double>::infinity() : object.at(key).get<double>();
  };
  Outcome o;
  o.name = object.at("name");
  o.place = object.at("place");
  o.change = object.value("change", "nothing");
  o.draw = draw_flight(object.at("seed"));
  o.stage = object.at("stage");
  o.error = object.at("error");
  o.frames = object.at("frames");
  o.tracked = object.at("tracked");
  o.errors = {number_at("ate_m"), number_at("path_m"), number_at("offset_m"), number_at("scale_error")};
  o.sigma_m = number_at("sigma_m");
  o.warnings = object.at("warnings");
  o.withheld = object.value("withheld", !o.warnings.empty());
  o.seconds = number_at("seconds");
  if (object.contains("path_sigmas"))
    o.path_sigmas = {object["path_sigmas"].at("position"), object["path_sigmas"].at("rotation")};
  return o;
}

std::string summary(const std::vector<Outcome>& outcomes) {
  const std::string head =
      "| | flights | right | false warning | wrong, warned | wrong, SILENT | median offset, m |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n";
  std::string text = head;
  std::vector<const Outcome*> all;
  for (const Outcome& o : outcomes) all.push_back(&o);
  text += line("**all**", all);
  text += lines_by(outcomes, [](const Outcome& o) { return name_of(o.draw.kind); });
  text += lines_by(outcomes, [](const Outcome& o) { return "over " + o.place; });
  text += lines_by(outcomes, [](const Outcome& o) { return "changed: " + o.change; });
  text += lines_by(outcomes, [](const Outcome& o) { return std::to_string(o.draw.lens_deg) + "° lens"; });
  text += lines_by(outcomes, [](const Outcome& o) { return "view: " + name_of(o.draw.view); });
  text += lines_by(outcomes, [](const Outcome& o) { return "known: " + name_of(o.draw.aids); });
  text += lines_by(outcomes, height_class);
  text += lines_by(outcomes,
                   [](const Outcome& o) { return std::string(o.draw.degraded ? "degraded" : "clean") + " camera"; });
  text += "\nOffset over the stated sigma, RMS over what was right: " + number(calibration(outcomes)) + "\n";
  text += path_sigma_line(outcomes, "positions", &PathSigmas::position);
  text += path_sigma_line(outcomes, "rotations", &PathSigmas::rotation);
  text += literal_counts(outcomes) + "\n";
  for (const Outcome& o : outcomes) {
    if (o.verdict() == "right") continue;
    text += "- " + o.verdict() + ": " + o.name + ", offset " + number(o.errors.offset_m) + " m, ATE " +
            number(o.errors.ate_m) + " of " + number(o.errors.path_m) + " m, " + std::to_string(o.tracked) + " of " +
            std::to_string(o.frames) + " frames" + (o.warnings.empty() ? "" : ": " + joined(o.warnings)) +
            (o.error.empty() ? "" : ": " + o.error) + "\n";
  }
  return text;
}

}  // namespace tileflight::proving_ground
