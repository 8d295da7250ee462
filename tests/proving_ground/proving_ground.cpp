// Random flights over random places, each through render, odometry, alignment and evaluation, judged by the truth: how
// often the answer is right, and whether a wrong one is ever silent. docs/trust.md has its figures.
//   build/release/bin/proving_ground --flights 200 --out out/proving-ground
// A flight whose files are there is not rendered and tracked again; it is aligned and scored each time, unless
// --keep all. Everything is drawn from --seed. Several calls' flights in one table: --summarise FOLDER FOLDER

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "outcome.h"
#include "random_flight.h"
#include "tests/source_folder.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/evaluation/scoring/align_stage.h"
#include "tileflight/evaluation/scoring/evaluate.h"
#include "tileflight/slam/odometry/track.h"
#include "tileflight/tiles/demo_place/stadium.h"
#include "tileflight/world/ground_truth/truth_folder.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::proving_ground {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// One of places.yaml.
struct Place {
  std::string name, source;
  std::string
      filmed;  ///< tileset that the camera sees, such as the same place with other textures; the truth is `source`
  std::string change;  ///< of `filmed` against `source`, for the table's groups
  std::optional<geometry::Geodetic> origin;
  std::optional<geometry::Vec3> center_local, size;
};

struct Options {
  fs::path places, out;
  std::vector<fs::path> summarise;  ///< folders of earlier calls: nothing is flown
  std::vector<std::string> only;    ///< names of places; empty: all
  int flights = 200;
  std::uint64_t seed = 1;
  std::string keep = "odometry";
  std::optional<int> one;
  int least_right = 0;
};

std::vector<Place> read_places(const fs::path& file, const fs::path& out) {
  auto root = base::StrictSection::load(file);
  std::vector<Place> places;
  for (base::StrictSection& section : root.sections("places")) {
    Place place;
    place.name = section.text("name").value_or("");
    place.source = section.text("source").value_or("");
    place.filmed = section.text("filmed").value_or("");
    place.change = section.text("change").value_or(place.filmed.empty() ? "nothing" : "filmed place");
    if (const auto v = section.numbers("origin", 3, 3))
      place.origin = geometry::Geodetic{(*v)[0], (*v)[1], geometry::EllipsoidalHeight{(*v)[2]}};
    if (const auto v = section.numbers("center_local", 3, 3))
      place.center_local = geometry::Vec3((*v)[0], (*v)[1], (*v)[2]);
    if (const auto v = section.numbers("size", 3, 3)) place.size = geometry::Vec3((*v)[0], (*v)[1], (*v)[2]);
    section.require_all_keys_used();
    if (place.source == "stadium:twin") {
      const fs::path built_in = out / "places/built-in";
      if (!fs::exists(built_in)) {
        base::write_folder({.folder = built_in, .command = "proving_ground"},
                           [](const fs::path& folder) { demo_place::write_stadium(folder, {}); });
      }
      place.source = (built_in / "twin/tileset.json").string();
    }
    if (place.filmed.empty()) place.filmed = place.source;
    if (!fs::exists(place.source) || !fs::exists(place.filmed)) {
      std::cerr << place.name << ": skipped, " << (fs::exists(place.source) ? place.filmed : place.source)
                << " is not there\n";
      continue;
    }
    places.push_back(place);
  }
  root.require_all_keys_used();
  return places;
}

/// The place's truth, extracted once.
fs::path truth_of(const Place& place, const fs::path& out) {
  const fs::path folder = out / "places" / place.name;
  if (!fs::exists(folder)) {
    place::extract({.source = place.source,
                    .load = {.center_local = place.center_local, .size = place.size, .origin = place.origin}},
                   folder, false);
  }
  return folder;
}

/// A place that is ready to be flown over.
struct Field {
  Place place;
  fs::path truth;
  std::unique_ptr<scene::Scene> scene;
  std::unique_ptr<geometry::TriangleIndex> surface;

  Field(const Place& p, const fs::path& out) : place(p), truth(truth_of(p, out)) {
    const geometry::TriangleMesh mesh = ground_truth::read_ground_truth(truth).mesh;
    surface = std::make_unique<geometry::TriangleIndex>(mesh);
    scene = std::make_unique<scene::Scene>(std::vector{imaging::TexturedMesh{.mesh = mesh}});
  }
  Ground ground() const { return {*scene, *surface, scene->bounds()}; }
};

/// Adds the degradations of a moderately bad camera.
recording::RenderedFlightConfig degraded(recording::RenderedFlightConfig flight) {
  render::ImageFormation formation;
  formation.exposure_time_s = 0.004;
  formation.exposure_samples = 3;
  formation.line_delay_s = 15e-6;
  formation.vignetting = 0.3;
  formation.exposure_drift = 0.12;
  formation.exposure_steps = {{2.0, 1.15}, {5.0, 0.95}};
  formation.white_electrons = 8000;
  formation.read_noise_electrons = 8;
  flight.degrade = formation;
  flight.video = video::VideoCompression{.crf = 20};
  return flight;
}

void write_flight(const FlightDraw& draw, const geometry::Trajectory& poses, const fs::path& folder) {
  fs::create_directories(folder);
  imaging::write_kalibr(folder / "camera.yaml", camera_of(draw));
  geometry::write_tum(folder / "poses.txt", poses);
  base::write_file(folder / "flight.yaml", "camera: camera.yaml\ntrajectory: poses.txt\n");
}

void render(const Field& field, const FlightDraw& draw, const fs::path& folder) {
  recording::RenderSettings settings{.source = field.place.filmed, .load = {}, .flight = {}};
  settings.load.origin = field.place.origin;
  settings.flight.flight = folder / "flight.yaml";
  if (draw.degraded) settings.flight = degraded(settings.flight);
  settings.seed = draw.seed;
  settings.error_px = 1.0;
  recording::render_dataset(settings, folder / "dataset", true);
}

/// Returns the inputs that the draw gives to the program under test, which excludes the true poses.
scoring::MapInputs known_inputs(const FlightDraw& draw, const fs::path& folder) {
  scoring::MapInputs map = scoring::find_map_inputs(folder / "odometry", folder / "dataset");
  map.truth_trajectory.clear();
  if (draw.aids != Aids::kAttitude) map.attitude.clear();
  if (draw.aids == Aids::kNothing) map.gps.clear();
  return map;
}

/// Each stage's list holds those of the stages before, as it knows them by now. The place's own are left out: here its
/// tiles are the truth, whatever they say of themselves.
void take_warnings(const json& object, Outcome& outcome) {
  outcome.warnings.clear();
  outcome.withheld = false;
  for (const json& warning : object.value("warnings", json::array())) {
    if (warning.at("where") == "truth") continue;
    const std::string what = warning.at("message");
    if (std::ranges::find(outcome.warnings, what) == outcome.warnings.end()) outcome.warnings.push_back(what);
    if (warning.at("severity") != "note") outcome.withheld = true;
  }
}

double sigma_of(const json& transform) {
  const json::json_pointer pointer("/uncertainty/rms_motion_sigma");
  return transform.contains(pointer) && transform.at(pointer).is_number() ? transform.at(pointer).get<double>() : 0.0;
}

geometry::Sim3 matrix_of(const json& transform) {
  geometry::Mat4 m;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) m(row, column) = transform.at("matrix").at(row).at(column);
  return geometry::Sim3::from_matrix(m);
}

/// One flight all the way. What a stage refuses ends it, and is kept.
Outcome fly(const Field& field, const FlightDraw& draw, const std::string& name, const fs::path& folder) {
  Outcome outcome{.name = name, .place = field.place.name, .change = field.place.change, .draw = draw};
  const auto begin = std::chrono::steady_clock::now();
  try {
    if (!fs::exists(folder / "dataset")) render(field, draw, folder);
    if (!fs::exists(folder / "odometry")) odometry::track(folder / "dataset", folder / "odometry", false);
    const json tracked = json::parse(base::read_text(folder / "odometry/odometry.json"));
    outcome.frames = tracked.at("frames");
    outcome.tracked = tracked.at("frames_tracked");
    outcome.stage = "odometry";
    take_warnings(tracked, outcome);
    const scoring::MapInputs map = known_inputs(draw, folder);
    const json transform = to_json(scoring::align(map, field.truth, {}, folder / "transform.json"));
    outcome.stage = "align";
    outcome.sigma_m = sigma_of(transform);
    take_warnings(transform, outcome);
    const geometry::Trajectory truth = geometry::read_tum(folder / "dataset/groundtruth.txt");
    outcome.errors =
        true_errors(scoring::read_map(map.map), geometry::read_tum(map.trajectory), truth, matrix_of(transform));
    outcome.path_sigmas = path_sigmas(folder / "odometry", truth);
    take_warnings(to_json(scoring::evaluate(map, field.truth, folder / "transform.json", {}, folder / "metrics.json")),
                  outcome);
    outcome.stage = "evaluate";
  } catch (const InputError& error) {
    outcome.error = error.what();
  }
  outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return outcome;
}

std::string flight_name(int number, const Place& place, const FlightDraw& draw) {
  char text[16];
  std::snprintf(text, sizeof text, "%04d-", number);
  return text + place.name + "-" + name_of(draw.kind) + "-" + std::to_string(draw.lens_deg) + "-" + name_of(draw.view) +
         "-" + std::to_string(static_cast<int>(draw.height_m)) + "m-" + name_of(draw.aids) +
         (draw.degraded ? "-degraded" : "");
}

/// Reads the outcomes that earlier calls wrote, of all folders together.
std::vector<Outcome> read_outcomes(const std::vector<fs::path>& folders) {
  std::vector<fs::path> files;
  for (const fs::path& folder : folders)
    for (const auto& entry : fs::directory_iterator(folder / "flights"))
      if (fs::exists(entry.path() / "outcome.json")) files.push_back(entry.path() / "outcome.json");
  std::sort(files.begin(), files.end());
  std::vector<Outcome> outcomes;
  for (const fs::path& file : files) {
    outcomes.push_back(outcome_from_json(json::parse(base::read_text(file))));
    const fs::path truth = file.parent_path() / "dataset/groundtruth.txt";
    const fs::path odometry = file.parent_path() / "odometry";
    if (fs::exists(truth) && fs::exists(odometry / "quality.csv"))
      outcomes.back().path_sigmas = path_sigmas(odometry, geometry::read_tum(truth));
  }
  return outcomes;
}

class ProvingGround {
 public:
  explicit ProvingGround(const Options& options)
      : options_(options), places_(read_places(options.places, options.out)) {
    if (!options.only.empty()) {
      std::erase_if(places_,
                    [&](const Place& p) { return std::ranges::find(options.only, p.name) == options.only.end(); });
    }
    if (places_.empty()) throw InputError(options.places.string(), "names no place that is there");
  }

  std::vector<Outcome> run() {
    std::vector<Outcome> outcomes;
    for (int number = 0; number < options_.flights; ++number) {
      if (options_.one && *options_.one != number) continue;
      outcomes.push_back(outcome_of(number));
      std::cout << outcomes.back().verdict() << ": " << outcomes.back().name << ", offset "
                << outcomes.back().errors.offset_m << " m, sigma " << outcomes.back().sigma_m << " m, ATE "
                << outcomes.back().errors.ate_m << " of " << outcomes.back().errors.path_m << " m, "
                << outcomes.back().tracked << "/" << outcomes.back().frames;
      for (const std::string& warning : outcomes.back().warnings) std::cout << "; " << warning;
      std::cout << (outcomes.back().error.empty() ? "" : "; " + outcomes.back().error) << ", "
                << outcomes.back().seconds << " s" << std::endl;
    }
    return outcomes;
  }

 private:
  Field& field(const Place& place) {
    auto& slot = fields_[place.name];
    if (!slot) slot = std::make_unique<Field>(place, options_.out);
    return *slot;
  }

  /// The first draw after `number`'s own seed that has room over its place.
  Outcome outcome_of(int number) {
    const Place& place = places_[static_cast<std::size_t>(number) % places_.size()];
    const std::uint64_t first = options_.seed * 1000000 + static_cast<std::uint64_t>(number) * 100;
    for (std::uint64_t seed = first;; ++seed) {
      const FlightDraw draw = draw_flight(seed);
      const std::string name = flight_name(number, place, draw);
      const fs::path folder = options_.out / "flights" / name;
      if (options_.keep == "all" && fs::exists(folder / "outcome.json"))
        return outcome_from_json(json::parse(base::read_text(folder / "outcome.json")));
      if (!fs::exists(folder / "flight.yaml")) {
        const auto poses = place_flight(draw, field(place).ground());
        if (!poses && seed < first + 99) continue;
        if (!poses) throw InputError(place.name, "has no room for flights");
        write_flight(draw, *poses, folder);
      }
      const Outcome outcome = fly(field(place), draw, name, folder);
      base::write_file(folder / "outcome.json", to_json(outcome).dump(2) + "\n");
      return outcome;
    }
  }

  Options options_;
  std::vector<Place> places_;
  std::map<std::string, std::unique_ptr<Field>> fields_;
};

int main_of(int argc, char** argv) {
  CLI::App app{"Random flights, each through render, odometry, align and evaluate, judged by the truth."};
  Options options;
  options.places = tests::source_folder() / "tests/proving_ground/places.yaml";
  app.add_option("--places", options.places, "places to fly over (YAML)")
      ->check(CLI::ExistingFile)
      ->capture_default_str();
  app.add_option("--only", options.only, "names of places; default: all")->delimiter(',');
  auto* out = app.add_option("--out", options.out, "folder for everything; what is there is gone on with");
  auto* summarise =
      app.add_option("--summarise", options.summarise, "fly nothing: the table of these folders of earlier calls")
          ->check(CLI::ExistingDirectory);
  out->excludes(summarise);
  app.add_option("--flights", options.flights, "how many")->capture_default_str();
  app.add_option("--flight", options.one, "this one only, by number");
  app.add_option("--seed", options.seed, "of everything that is drawn")->capture_default_str();
  app.add_option("--keep", options.keep, "'odometry': align and score again; 'all': only flights that are not done yet")
      ->check(CLI::IsMember({"odometry", "all"}));
  app.add_option("--least-right", options.least_right, "fewer right ones are a failure, too")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    if (!options.summarise.empty()) {
      std::cout << summary(read_outcomes(options.summarise));
      return 0;
    }
    if (options.out.empty()) throw InputError("--out", "is needed: a folder for everything");
    fs::create_directories(options.out);
    const std::vector<Outcome> outcomes = ProvingGround(options).run();
    json all = json::array();
    for (const Outcome& outcome : outcomes) all.push_back(to_json(outcome));
    base::write_file(options.out / "outcomes.json", all.dump(2) + "\n");
    base::write_file(options.out / "summary.md", summary(outcomes));
    std::cout << summary(outcomes);
    const bool silent = std::ranges::any_of(outcomes, [](const Outcome& o) { return o.verdict() == "SILENT"; });
    const auto right = std::ranges::count_if(outcomes, [](const Outcome& o) { return o.verdict() == "right"; });
    if (right < options.least_right)
      std::cerr << "proving_ground: " << right << " right ones, wanted " << options.least_right << "\n";
    return silent || right < options.least_right ? 1 : 0;
  } catch (const std::exception& fault) {
    std::cerr << "proving_ground: " << fault.what() << "\n";
    return 1;
  }
}

}  // namespace
}  // namespace tileflight::proving_ground

int main(int argc, char** argv) { return tileflight::proving_ground::main_of(argc, argv); }
