// Statistical power of the verdict on two maps, by simulation: N random places with two maps each (synthetic_maps.h),
// scored by the exact surface and compared as by `compare`. Counts how often the maps are called different, for which
// reason, and how often each interval contains the true value.
//
//   verdict_power_benchmark [N (100)] [side of the places, m (100)] [part of a scenario's name]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/synthetic_maps.h"
#include "tileflight/evaluation/metrics/map_comparison.h"

namespace {

using namespace tileflight;
using tests::MapKind;

struct Scenario {
  std::string name;
  MapKind first, second;
  double true_ratio = 1.0;      ///< of median and RMS, as far as it follows from the noise
  bool known_otherwise = true;  ///< whether the true differences of the other numbers are zero
  std::string reason{};         ///< expected reason for "different"; empty: the maps are of one kind
  double side_m = 0.0;          ///< of the places; 0: as in the arguments
};

std::vector<Scenario> scenarios() {
  std::vector<Scenario> list;
  for (const std::size_t points : {6000u, 20000u, 60000u}) {
    const std::string with = std::to_string(points) + " points: ";
    const auto kind = [&](MapKind k) {
      k.points = points;
      return k;
    };
    list.push_back({with + "one kind", kind({}), kind({})});
    list.push_back({with + "noise x 2", kind({.noise_m = 0.1}), kind({}), 2.0, false, "surface.median"});
    list.push_back({with + "noise x 1.5", kind({.noise_m = 0.075}), kind({}), 1.5, false, "surface.median"});
    for (const double patch_m : {3.0, 5.0, 10.0}) {
      list.push_back({with + "5 % missing, patches of " + std::to_string(static_cast<int>(patch_m)) + " m",
                      kind({.missing_share = 0.05, .patch_m = patch_m}), kind({}), 1.0, false, "completeness.lacking"});
    }
  }
  for (const std::size_t points : {15000u, 60000u}) {
    const std::string with = "place of 40 m, " + std::to_string(points) + " points, no gaps: ";
    const MapKind whole{.points = points, .gaps = 0.0}, lacking{.points = points, .gaps = 0.0, .wall_share = 0.05};
    list.push_back({with + "one kind", whole, whole, 1.0, true, "", 40.0});
    list.push_back({with + "5 % of one wall missing", lacking, whole, 1.0, false, "completeness.lacking", 40.0});
  }
  for (const double gaps : {0.0003, 0.001, 0.003, 0.05}) {
    const MapKind kind{.points = 20000, .gaps = gaps};
    char name[64];
    std::snprintf(name, sizeof name, "gaps in %g %% of the surface", 100.0 * gaps);
    list.push_back({name, kind, kind});
  }
  for (const double correlation_m : {1.0, 3.0, 12.0, 25.0}) {
    const MapKind kind{.points = 20000, .correlation_m = correlation_m};
    list.push_back({"neighbours alike over " + std::to_string(static_cast<int>(correlation_m)) + " m", kind, kind});
  }
  for (const double shared : {0.0, 0.9}) {
    const MapKind kind{.points = 20000, .shared = shared};
    list.push_back({"share of errors that maps have in common " + std::to_string(shared).substr(0, 3), kind, kind});
  }
  return list;
}

bool holds(const metrics::ComparedMetric& m, const Scenario& s) {
  if (m.scale == metrics::MarginScale::kDifference) return m.difference_ci95[0] <= 0.0 && 0.0 <= m.difference_ci95[1];
  const double ratio = m.name.starts_with("surface") ? s.true_ratio : 1.0;
  return m.ratio_ci95[0] <= ratio && ratio <= m.ratio_ci95[1];
}

/// Whether the true value of an interval is known: all values for maps of one kind, otherwise only the median, for a
/// known ratio of noise. The RMS is over the points within the cut-off, some of which are outliers whatever the noise.
bool is_known(const metrics::ComparedMetric& m, const Scenario& s) {
  return s.known_otherwise || (s.true_ratio != 1.0 && m.name == "surface.median");
}

void run(const Scenario& s, int places, double wanted_side_m) {
  const double side_m = s.side_m > 0.0 ? s.side_m : wanted_side_m;
  int different = 0, equivalent = 0, right = 0, wrong = 0, with_parts = 0, in_one_alone = 0;
  std::map<std::string, int> held;
  double points = 0.0, square_metres = 0.0;
  std::map<std::string, double> half_width;  ///< of the judged interval; for ratios of its logarithm
  for (int k = 0; k < places; ++k) {
    const tests::SyntheticPlace place(static_cast<std::uint64_t>(5000 + k), side_m);
    const geometry::TriangleIndex surface(place.mesh());
    const auto map = [&](const MapKind& kind, int number) {
      return tests::scored(place, surface, tests::synthetic_map(place, kind, static_cast<std::uint64_t>(number)));
    };
    const metrics::ScoredMap first = map(s.first, 2 * k), second = map(s.second, 2 * k + 1);
    points += static_cast<double>(second.surface.distances.size());
    square_metres += geometry::surface_area_m2(place.mesh());
    const auto c = metrics::compare_maps({first}, {second}, {.seed = static_cast<std::uint64_t>(k)});
    const auto lacks = [&](std::size_t flight) {
      return std::ranges::count(c.missing->parts, flight, &metrics::MissingPart::lacking_map) > 0;
    };
    with_parts += lacks(0) || lacks(1);
    in_one_alone += lacks(0) != lacks(1);
    equivalent += c.verdict.word == "equivalent";
    for (const metrics::ComparedMetric& m : c.metrics) {
      held[m.name] += is_known(m, s) && holds(m, s);
      half_width[m.name] +=
          (m.scale == metrics::MarginScale::kRatio ? 0.5 * std::log(m.ratio_ci95[1] / m.ratio_ci95[0])
                                                   : 0.5 * (m.difference_ci95[1] - m.difference_ci95[0])) /
          places;
    }
    if (c.verdict.word != "different") continue;
    ++different;
    bool has_right = false, has_wrong = false;
    for (const std::string& name : c.verdict.reasons) {
      has_right = has_right || name == s.reason;
      // Noise changes all of the surface part and, as points leave it, also completeness. Missing parts leave fewer
      // places with a point.
      has_wrong = has_wrong || (s.reason != "surface.median" && !name.starts_with(s.reason.substr(0, 12)));
    }
    right += has_right;
    wrong += has_wrong;
  }
  const auto share = [&](int count) { return 100.0 * count / places; };
  std::printf("%-58s %5.1f %5.1f %5.1f %5.1f | %5.1f %5.1f |", s.name.c_str(), share(different), share(right),
              share(wrong), share(equivalent), share(with_parts), share(in_one_alone));
  for (const char* name : {"surface.median", "surface.rms", "surface.within_0.1", "surface.beyond_1",
                           "completeness.within_0.2", "completeness.lacking"}) {
    const metrics::ComparedMetric m{.name = name};
    if (is_known(m, s)) {
      std::printf(" %6.1f", share(held[name]));
    } else {
      std::printf("      -");
    }
  }
  std::printf(" | %5.3f %5.3f %6.4f | %.2f\n", half_width["surface.median"], half_width["completeness.within_0.2"],
              half_width["completeness.lacking"], points / square_metres);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) try {
  const int places = argc > 1 ? std::atoi(argv[1]) : 100;
  const double side_m = argc > 2 ? std::atof(argv[2]) : 100.0;
  const std::string part = argc > 3 ? argv[3] : "";
  if (places < 1 || !(side_m >= 50.0))
    throw std::runtime_error("needs a number of places, and a side of at least 50 m");
  std::printf(
      "of %d places of %g m, in %%: called different, for the right reason, for a wrong one, called equivalent | with "
      "missing parts listed, in one map alone | intervals that hold the truth: median, RMS, within 0.1 m, beyond 1 m, "
      "completeness at 0.2 m, lacking | their "
      "half width: median and completeness, as a logarithm, lacking | map points a square metre\n",
      places, side_m);
  for (const Scenario& scenario : scenarios()) {
    if (scenario.name.find(part) != std::string::npos) run(scenario, places, side_m);
  }
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "verdict_power_benchmark: %s\n", error.what());
  return 1;
}
