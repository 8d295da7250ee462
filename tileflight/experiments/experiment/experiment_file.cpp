#include "tileflight/experiments/experiment/experiment_file.h"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <sstream>
#include <string_view>

#include "tileflight/capture/render/image_formation.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/experiments/experiment/stage_options.h"

namespace tileflight::experiment {

namespace fs = std::filesystem;
namespace {

constexpr std::string_view kWordSeparators = " \t\n;|&<>()";

/// Splits a command into words like a shell and removes quotes (POSIX shell, "Quoting", "Token Recognition").
std::vector<std::string> shell_words(const std::string& command) {
  std::vector<std::string> words(1);
  char quote = '\0';
  for (std::size_t i = 0; i < command.size(); ++i) {
    const char c = command[i];
    if (c == '\\' && quote != '\'' && i + 1 < command.size()) {
      words.back() += command[++i];
    } else if (quote != '\0') {
      if (c == quote) {
        quote = '\0';
      } else {
        words.back() += c;
      }
    } else if (c == '\'' || c == '"') {
      quote = c;
    } else if (kWordSeparators.find(c) != std::string_view::npos) {
      if (!words.back().empty()) words.emplace_back();
    } else {
      words.back() += c;
    }
  }
  return words;
}

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

/// Empty if there is none.
fs::path find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  if (path == nullptr || name.find('/') != std::string::npos) return {};
  std::istringstream folders(path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path program = fs::path(folder.empty() ? "." : folder) / name;
    if (is_file(program) && ::access(program.c_str(), X_OK) == 0) return program;
  }
  return {};
}

fs::path file_of(const std::string& word, const fs::path& folder) {
  if (word.empty()) return {};
  const char* home = std::getenv("HOME");
  const fs::path named = word.starts_with("~/") && home != nullptr ? fs::path(home) / word.substr(2) : folder / word;
  return is_file(named) ? named.lexically_normal() : find_program(word);
}

}  // namespace

std::vector<fs::path> find_command_files(const std::string& command, const fs::path& folder) {
  std::vector<fs::path> files;
  const auto add = [&](const std::string& word) {
    const fs::path file = file_of(word, folder);
    if (!file.empty() && std::ranges::find(files, file) == files.end()) files.push_back(file);
  };
  for (const std::string& word : shell_words(command)) {
    add(word);
    if (const std::size_t mark = word.find('='); mark != std::string::npos) add(word.substr(mark + 1));
  }
  return files;
}

namespace fs = std::filesystem;
namespace {

/// `origin: [lat, lon, height]`, `center: [lat, lon]` or `[lat, lon, height]`.
geometry::Geodetic geodetic(const StrictSection& section, const std::string& key, const std::vector<double>& numbers) {
  if (std::abs(numbers[0]) > 90.0 || std::abs(numbers[1]) > 360.0) {
    throw section.error(key, "must be latitude, longitude in degrees (and height in metres)");
  }
  // A missing height defaults to the centre of the tileset (tiles/tileset/load.h).
  const double height_m = numbers.size() > 2 ? numbers[2] : std::numeric_limits<double>::quiet_NaN();
  return {numbers[0], numbers[1], geometry::EllipsoidalHeight{height_m}};
}

geometry::Vec3 vec3(const std::vector<double>& numbers) { return {numbers[0], numbers[1], numbers[2]}; }

/// A tileset named as SOURCE on the command line; a path is relative to the file.
std::string read_source(StrictSection& section, const std::string& key) {
  const std::optional<std::string> text = section.text(key);
  if (!text) return "";
  const bool is_path = text->find(':') == std::string::npos && *text != "google";
  return is_path ? (section.file().parent_path() / *text).lexically_normal().string() : *text;
}

void read_site_keys(StrictSection& section, SiteConfig& place) {
  if (section.has("center") || section.has("center_local")) {
    place.center.reset();  // a site of its own
    place.center_local.reset();
    place.size.reset();
  }
  if (const auto v = section.numbers("center", 2, 3)) place.center = geodetic(section, "center", *v);
  if (const auto v = section.numbers("center_local", 3, 3)) place.center_local = vec3(*v);
  if (const auto v = section.numbers("size", 3, 3)) place.size = vec3(*v);
  if (const auto v = section.numbers("origin", 3, 3)) place.origin = geodetic(section, "origin", *v);
  place.error_m = section.number("error").value_or(place.error_m);
  place.terms_accepted = section.boolean("terms_accepted").value_or(place.terms_accepted);
  place.view_margin_m = section.number("view_margin");
  if (place.view_margin_m && *place.view_margin_m < 0) throw section.error("view_margin", "must not be negative");
  place.texture_scale = section.positive_number("texture_scale").value_or(place.texture_scale);
  if (place.error_m < 0) throw section.error("error", "must not be negative");
  if (place.center && place.center_local) throw section.error("center_local", "does not go together with 'center'");
  if ((place.center || place.center_local) != place.size.has_value()) {
    throw section.error("size", "goes together with 'center' or 'center_local'");
  }
  section.require_all_keys_used();
}

SiteConfig read_place(StrictSection section) {
  SiteConfig place;
  place.source = read_source(section, "source");
  if (place.source.empty()) throw section.error("source", "is missing: the tileset, e.g. `source: tiles/tileset.json`");
  read_site_keys(section, place);
  return place;
}

/// `block: auto | METRES`; 0: auto.
std::optional<double> read_block(StrictSection& section) {
  const std::optional<std::string> text = section.text("block");
  if (!text) return std::nullopt;
  if (*text == "auto") return 0.0;
  const auto edge_m = base::parse_number<double>(*text);
  if (!edge_m || !(*edge_m > 0.0) || !std::isfinite(*edge_m))
    throw section.error("block", "must be a length above zero, in metres, or auto, got " + *text);
  return edge_m;
}

TruthConfig read_truth(StrictSection section) {
  TruthConfig truth;
  truth.voxel_m = section.positive_number("voxel").value_or(truth.voxel_m);
  truth.samples_per_m2 = section.positive_number("samples_per_m2").value_or(truth.samples_per_m2);
  truth.block_m = read_block(section);
  section.require_all_keys_used();
  return truth;
}

fs::path optional_path(StrictSection& section, const std::string& key) {
  const fs::path path = section.path(key).value_or(fs::path());
  if (!path.empty() && !fs::exists(path)) throw section.error(key, "names " + path.string() + ", which does not exist");
  return path;
}

fs::path required_path(StrictSection& section, const std::string& key) {
  const fs::path path = optional_path(section, key);
  if (path.empty()) throw section.error(key, "is missing");
  return path;
}

/// The regular grids of rays that a pixel may have.
int read_samples_per_pixel(StrictSection& section, int fallback) {
  const int samples = section.integer("samples_per_pixel").value_or(fallback);
  if (samples != 1 && samples != 4 && samples != 9 && samples != 16)
    throw section.error("samples_per_pixel", "must be 1, 4, 9 or 16");
  return samples;
}

void read_resolution(StrictSection& section, recording::RenderedFlightConfig& render) {
  const auto v = section.numbers("resolution", 2, 2);
  if (!v) return;
  render.width = static_cast<int>((*v)[0]);
  render.height = static_cast<int>((*v)[1]);
  if (*render.width < 16 || *render.height < 16) throw section.error("resolution", "must be at least 16 x 16");
}

recording::RenderedFlightConfig read_render(StrictSection section) {
  recording::RenderedFlightConfig render;
  render.follows_real = section.choice("follow", {"real"}).has_value();
  if (!render.follows_real) render.flight = required_path(section, "flight");
  if (render.follows_real && section.has("flight")) throw section.error("flight", "does not go together with 'follow'");
  if (!render.follows_real && section.has("smooth"))
    throw section.error("smooth", "applies only to a flight that follows another");
  render.smoothing = flight_path::read_smoothing(section, render.smoothing);
  render.camera = optional_path(section, "camera");
  render.source = read_source(section, "source");
  read_resolution(section, render);
  render.samples_per_pixel = read_samples_per_pixel(section, render.samples_per_pixel);
  render.max_frames = section.integer("max_frames");
  if (render.max_frames && *render.max_frames < 2) throw section.error("max_frames", "must be at least 2");
  render.error_px = section.positive_number("pixel_error");
  render.memory_gb = section.positive_number("memory");
  if (const auto words = section.text("outputs")) {
    render.outputs =
        recording::parse_outputs(*words, [&](const std::string& what) { return section.error("outputs", what); });
  }
  if (auto degrade = section.section("degrade")) read_degrade(*degrade, render);
  section.require_all_keys_used();
  return render;
}

/// The content of a section without some of its keys.
std::string meaning_without(const StrictSection& section, const std::vector<std::string>& left_out) {
  std::vector<std::string> keys = section.keys();
  std::ranges::sort(keys);
  std::string text;
  for (const std::string& key : keys) {
    if (std::ranges::find(left_out, key) == left_out.end()) text += key + ": " + section.canonical_value(key) + "\n";
  }
  return text;
}

/// Returns the text of the keys of a flight's section that affect its dataset: not the memory that rendering may take.
std::string flight_text(StrictSection& root, const std::string& name) {
  std::optional<StrictSection> flight = root.section(name);
  const bool has_render = flight && flight->is_map("render");
  const std::optional<StrictSection> render = has_render ? flight->section("render") : std::nullopt;
  if (!render || !render->has("memory")) return root.canonical_value(name);
  return meaning_without(*flight, {"render"}) + "render:\n" + meaning_without(*render, {"memory"});
}

/// `video: PATH`, of the parts of one recording `video: [PATH, ...]`, or of a rig `video: {NAME: PATH, ...}`.
void read_videos(StrictSection& section, ingest::IngestedFlightConfig& ingest) {
  constexpr double kLongest_s = 10.0, kShortest_s = 1e-9;
  ingest.sync_tolerance_s = section.number("sync_tolerance", ingest.sync_tolerance_s, kShortest_s, kLongest_s);
  if (section.is_list("video")) {
    for (const std::string& part : section.required_texts("video")) {
      ingest.videos.push_back({"", (section.file().parent_path() / part).lexically_normal()});
      if (!fs::exists(ingest.videos.back().video))
        throw section.error("video", "names " + ingest.videos.back().video.string() + ", which does not exist");
    }
    if (ingest.videos.empty()) throw section.error("video", "names no part of the recording");
    return;
  }
  if (!section.is_map("video")) {
    ingest.video = required_path(section, "video");
    return;
  }
  StrictSection videos = *section.section("video");
  for (const std::string& camera : videos.keys()) ingest.videos.push_back({camera, required_path(videos, camera)});
  if (ingest.videos.empty()) throw section.error("video", "names no camera; give each its video or folder");
}

ingest::IngestedFlightConfig read_ingest(StrictSection section) {
  ingest::IngestedFlightConfig ingest;
  read_videos(section, ingest);
  ingest.camera = optional_path(section, "camera");
  if (ingest.camera.empty() && !(ingest.videos.empty() && fs::is_directory(ingest.video)))
    throw section.error("camera", "is missing; only photos may state their lens (docs/formats.md, Photos)");
  ingest.camera_id = section.text("camera_id").value_or("");
  ingest.telemetry = optional_path(section, "telemetry");
  ingest.imu = optional_path(section, "imu");
  ingest.imu_noise = optional_path(section, "imu_noise");
  ingest.imu_time_offset_s = section.number("imu_time_offset").value_or(0.0);
  ingest.groundtruth = optional_path(section, "groundtruth");
  ingest.telemetry_height = section.choice("telemetry_height", {"ellipsoid", "sea-level", "takeoff"}).value_or("");
  ingest.takeoff_height_m = section.number("takeoff_height");
  ingest.estimates_telemetry_offset = section.text("telemetry_offset") == "auto";
  if (!ingest.estimates_telemetry_offset) ingest.telemetry_offset_s = section.number("telemetry_offset");
  ingest.from_s = section.number("from").value_or(0.0);
  ingest.to_s = section.number("to");
  ingest.every = section.integer("every").value_or(1);
  ingest.fps = section.positive_number("fps");
  if (ingest.estimates_telemetry_offset && ingest.telemetry.empty())
    throw section.error("telemetry_offset", "applies to a flight log; give one with 'telemetry'");
  if (ingest.every < 1) throw section.error("every", "must be at least 1");
  if (ingest.to_s && *ingest.to_s <= ingest.from_s) throw section.error("to", "must be later than 'from'");
  section.require_all_keys_used();
  return ingest;
}

FlightConfig read_flight(StrictSection section, const std::string& default_kind) {
  FlightConfig flight;
  flight.kind = section.choice("kind", {"simulated", "video", "surrogate"}).value_or(default_kind);
  if (auto render = section.section("render")) flight.render = read_render(*render);
  if (auto ingest = section.section("ingest")) flight.ingest = read_ingest(*ingest);
  flight.reference_tiles = section.choice("reference", {"tiles"}).has_value();
  section.require_all_keys_used();
  if (flight.render.has_value() == flight.ingest.has_value()) {
    throw section.error("", "needs either 'render' or 'ingest'");
  }
  // Images rendered from tiles are never called real: the flight must be called a surrogate.
  if (flight.render && flight.kind == "video") throw section.error("kind", "cannot be 'video' for a rendered flight");
  return flight;
}

void read_repetition(StrictSection& section, OdometryConfig& odometry) {
  constexpr int kMostRuns = 100;
  odometry.runs = section.integer("runs").value_or(odometry.runs);
  if (odometry.runs < 1 || odometry.runs > kMostRuns) throw section.error("runs", "must be 1 to 100");
  odometry.start_offset_frames = section.integer("later").value_or(odometry.start_offset_frames);
  if (odometry.start_offset_frames < 0) throw section.error("later", "must not be negative");
  odometry.backwards = section.boolean("backwards").value_or(odometry.backwards);
}

void read_mode(StrictSection& section, OdometryConfig& odometry) {
  odometry::TrackOptions& options = odometry.track_options;
  const auto mode = section.choice("mode", {"mono", "inertial", "stereo", "stereo-inertial"});
  if (mode) options.mode = odometry::parse_odometry_mode("odometry.mode", *mode);
  bool& inertial_in_window = odometry.options.inertial_in_window;
  inertial_in_window = section.boolean("tight").value_or(inertial_in_window);
  if (inertial_in_window && !odometry::uses_inertial_unit(options.mode))
    throw section.error(
        "tight", "puts an inertial unit's readings into the window, which needs 'mode: inertial' or 'stereo-inertial'");
  options.gravity_m_s2 = section.number("gravity").value_or(options.gravity_m_s2);
  if (!(options.gravity_m_s2 >= 9.7 && options.gravity_m_s2 <= 9.9))
    throw section.error("gravity", "must lie between 9.7 and 9.9 m/s^2");
}

/// `system: NAME`, or the folder of an adapter, relative to the file.
std::optional<external_systems::Adapter> read_system(StrictSection& section) {
  const std::optional<std::string> system = section.text("system");
  if (!system) return std::nullopt;
  if (section.has("command")) throw section.error("system", "does not go together with 'command'");
  try {
    return external_systems::find_adapter(*system, fs::absolute(section.file()).parent_path());
  } catch (const InputError& fault) {
    throw section.error("system", std::string("cannot be used: ") + fault.what());
  }
}

/// Throws InputError for a key that another program does not take. Unknown keys were refused before.
void refuse_built_in_keys(const StrictSection& section, const OdometryConfig& odometry) {
  if (odometry.is_built_in()) return;
  const std::string program = odometry.system ? odometry.system->title : "an external command";
  for (const std::string& key : section.keys()) {
    if (key != "command" && key != "system" && key != "runs" && key != "seed")
      throw section.error(key, "applies to the built-in odometry only; " + program + " has settings of its own");
  }
}

OdometryConfig read_odometry(StrictSection section) {
  OdometryConfig odometry;
  odometry.command = section.text("command").value_or("");
  odometry.system = read_system(section);
  odometry.options = read_odometry_options(section);
  read_mode(section, odometry);
  odometry.track_options.mask = optional_path(section, "mask");
  odometry.track_options.rectify_fov_deg = section.number("rectify_fov");
  if (const auto& fov_deg = odometry.track_options.rectify_fov_deg; fov_deg && !(*fov_deg > 0.0 && *fov_deg < 180.0))
    throw section.error("rectify_fov", "must be above 0 and below 180 degrees, the field of view of a pinhole");
  odometry.track_options.colmap = section.boolean("colmap").value_or(false);
  odometry.debug_pictures = section.boolean("debug_pictures").value_or(false);
  read_repetition(section, odometry);
  section.require_all_keys_used();
  refuse_built_in_keys(section, odometry);
  return odometry;
}

/// The number of runs does not affect the individual runs.
std::string odometry_text(const StrictSection& section) {
  return meaning_without(section, {"runs", "later", "backwards"});
}

/// Keys of a variant that are read as a section of the experiment.
const std::vector<std::string> kVariantSections{"name", "place", "voxel", "odometry", "seed"};

/// A place of its own, or the experiment's with changes; the built-in place keeps its seed.
SiteConfig read_variant_place(StrictSection section, const SiteConfig& place) {
  SiteConfig changed = place;
  if (section.has("source")) {
    changed = read_place(section);
    changed.seed = place.seed;
    return changed;
  }
  section.ignore({"source"});
  read_site_keys(section, changed);
  return changed;
}

/// Changes to the rendered flight.
void read_flight_changes(StrictSection& section, Variant& variant) {
  if (const fs::path flight = optional_path(section, "flight"); !flight.empty()) {
    variant.render.flight = flight;
    variant.render.follows_real = false;
  }
  if (const fs::path camera = optional_path(section, "camera"); !camera.empty()) variant.render.camera = camera;
  read_resolution(section, variant.render);
  variant.render.samples_per_pixel = read_samples_per_pixel(section, variant.render.samples_per_pixel);
  variant.texture_scale = section.positive_number("texture_scale");
  if (auto degrade = section.section("degrade")) {
    variant.render.video.reset();
    read_degrade(*degrade, variant.render);
  }
}

/// Changes to the other sections of the experiment.
void read_section_changes(StrictSection& section, const Experiment& experiment, Variant& variant) {
  if (auto place = section.section("place")) {
    if (place->has("source")) variant.render.source.clear();  // tiles of the flight's own were of the other place
    variant.sections["place"] = (place->has("source") ? "" : experiment.sections.at("place") + "\nchanges:\n") +
                                section.canonical_value("place");
    variant.place = read_variant_place(*place, experiment.place);
  }
  if (auto odometry = section.section("odometry")) {
    variant.sections["odometry"] = odometry_text(*odometry);
    variant.odometry = read_odometry(*odometry);
  }
  variant.voxel_m = section.positive_number("voxel");
  if (const auto seed = section.integer("seed")) variant.seed = static_cast<std::uint64_t>(*seed);
}

Variant read_variant(StrictSection section, const Experiment& experiment) {
  Variant variant{.name = section.text("name").value_or(""),
                  .render = *experiment.simulated->render,
                  .texture_scale = {},
                  .yaml_text = {}};
  const auto is_plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; };
  if (variant.name.empty() || !std::ranges::all_of(variant.name, is_plain))
    throw section.error("name", "is required and may hold letters, digits, '-' and '_' only: it names a folder");
  read_flight_changes(section, variant);
  read_section_changes(section, experiment, variant);
  section.require_all_keys_used();
  variant.yaml_text = meaning_without(section, kVariantSections);
  return variant;
}

std::vector<Variant> read_variants(StrictSection& root, const Experiment& experiment) {
  std::vector<Variant> variants;
  for (StrictSection& section : root.sections("variants")) {
    if (!experiment.simulated || !experiment.simulated->render)
      throw root.error("variants", "need a rendered 'simulated' flight");
    variants.push_back(read_variant(section, experiment));
    for (std::size_t i = 0; i + 1 < variants.size(); ++i)
      if (variants[i].name == variants.back().name)
        throw root.error("variants", "two variants are called '" + variants[i].name + "'");
  }
  return variants;
}

}  // namespace

void read_degrade(StrictSection& section, recording::RenderedFlightConfig& flight) {
  const std::optional<int> crf = section.integer("video_crf");
  const std::optional<double> megabits = section.number("video_bitrate");
  if (crf && megabits) throw section.error("video_bitrate", "does not go together with 'video_crf'");
  if (megabits && *megabits <= 0.0) throw section.error("video_bitrate", "must be positive (Mbit/s)");
  if (crf) flight.video = video::VideoCompression{.crf = *crf};
  if (megabits) flight.video = video::VideoCompression{.megabits_per_s = *megabits};
  flight.degrade = render::read_image_formation(section);
}

std::vector<fs::path> odometry_program_files(const Experiment& experiment) {
  const std::optional<external_systems::Adapter>& system = experiment.odometry.system;
  if (!system) return find_command_files(experiment.odometry.command, fs::absolute(experiment.file).parent_path());
  std::vector<fs::path> files;
  const auto is_made_by_runs = [](const fs::path& part) {
    return part.string().starts_with('.') || part == "__pycache__";
  };
  for (const fs::path file : base::list_files_recursive(system->folder))
    if (std::ranges::none_of(file, is_made_by_runs) && is_file(system->folder / file))
      files.push_back(system->folder / file);
  for (const std::string& name : system->programs)
    if (const fs::path program = find_program(name); !program.empty()) files.push_back(program);
  return files;
}

Experiment read_experiment(const fs::path& file) {
  StrictSection root = StrictSection::load(file);
  Experiment experiment;
  experiment.file = file;
  experiment.name = root.text("name").value_or(file.stem().string());
  experiment.seed = static_cast<std::uint64_t>(root.integer("seed").value_or(1));

  if (auto place = root.section("place")) experiment.place = read_place(*place);
  experiment.place.seed = experiment.seed;
  if (auto truth = root.section("truth")) experiment.truth = read_truth(*truth);
  if (auto flight = root.section("simulated")) experiment.simulated = read_flight(*flight, "simulated");
  if (auto flight = root.section("real")) experiment.real = read_flight(*flight, "video");
  if (auto odometry = root.section("odometry")) experiment.odometry = read_odometry(*odometry);
  if (auto alignment = root.section("alignment")) experiment.alignment = read_alignment_options(*alignment);
  if (auto evaluation = root.section("evaluation")) experiment.evaluation = read_evaluation_settings(*evaluation);
  for (const std::string& key : root.keys()) experiment.sections[key] = root.canonical_value(key);
  for (const char* flight : {"simulated", "real"}) {
    if (root.has(flight)) experiment.sections[flight] = flight_text(root, flight);
  }
  if (const auto odometry = root.section("odometry")) experiment.sections["odometry"] = odometry_text(*odometry);
  experiment.variants = read_variants(root, experiment);
  root.require_all_keys_used();
  for (const auto& [name, flight] : {std::pair{"simulated", &experiment.simulated}, {"real", &experiment.real}}) {
    if (*flight && (*flight)->reference_tiles && !experiment.has_place())
      throw root.error(name, "has 'reference: tiles', but the experiment has no place");
  }
  if (experiment.real && experiment.real->render && experiment.real->render->follows_real)
    throw root.error("real", "cannot follow itself; 'follow: real' is for 'simulated'");
  const bool follows =
      experiment.simulated && experiment.simulated->render && experiment.simulated->render->follows_real;
  if (follows && !experiment.real) throw root.error("simulated", "follows the flight 'real', which is missing");
  if (!experiment.simulated && !experiment.real)
    throw root.error("simulated", "or 'real' is required: give at least one flight");
  if (!experiment.has_place() && (experiment.simulated || experiment.real->render))
    throw root.error("place", "is missing: the place to fly over, e.g. `place: {source: tiles/tileset.json}`");
  return experiment;
}

}  // namespace tileflight::experiment
