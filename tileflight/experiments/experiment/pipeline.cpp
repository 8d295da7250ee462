#include "tileflight/experiments/experiment/pipeline.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tileflight/capture/ingest/embedded_telemetry.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// The built-in place of an experiment's region and flights; nullopt: none of them is of one.
std::optional<demo_place::BuiltInSource> find_built_in(const Experiment& experiment) {
  std::vector<std::string> sources{experiment.place.source};
  for (const auto* flight : {&experiment.simulated, &experiment.real})
    if (*flight && (*flight)->render) sources.push_back((*flight)->render->source);
  std::optional<demo_place::BuiltInSource> found;
  std::string name;
  for (const std::string& source : sources) {
    const auto one = demo_place::built_in_source(source);
    if (!one) continue;
    if (found && (one->kind != found->kind || one->seed != found->seed))
      throw InputError(experiment.file.string(), "has two built-in places, '" + name + "' and '" + source +
                                                     "': an experiment has one; write the other by `tileflight scene`");
    found = one;
    name = source;
  }
  return found;
}

/// Content of a flight file and of the files that it names: lens, sensors, poses.
json flight_inputs(const fs::path& flight_file) {
  const vehicle::FlightPlan plan = vehicle::read_flight_plan(flight_file);
  if (missions::is_mission_file(flight_file)) return {{"mission", base::sha256_hex_of_file(flight_file)}};
  json inputs{{"plan", FileHashCache::hash_yaml_content(flight_file)}};
  if (plan.mission_file) inputs["mission"] = base::sha256_hex_of_file(plan.mission_file->file);
  if (!plan.camera.empty()) inputs["camera"] = FileHashCache::hash_yaml_content(plan.camera);
  for (const fs::path& camera : plan.cameras) inputs["cameras"].push_back(FileHashCache::hash_yaml_content(camera));
  if (!plan.sensors_file.empty()) inputs["sensors"] = FileHashCache::hash_yaml_content(plan.sensors_file);
  if (!plan.poses) return inputs;
  std::string numbers;
  for (const geometry::StampedPose& pose : plan.poses->poses) {
    numbers.append(reinterpret_cast<const char*>(&pose.time_s), sizeof pose.time_s);
    numbers.append(reinterpret_cast<const char*>(pose.T_local_camera.translation.data()), 3 * sizeof(double));
    numbers.append(reinterpret_cast<const char*>(pose.T_local_camera.rotation.coeffs().data()), 4 * sizeof(double));
  }
  inputs["poses"] = base::sha256_hex(numbers);
  return inputs;
}

/// Start time of the filmed flight, if its log knows the date.
std::optional<double> start_utc_s(const std::optional<FlightConfig>& real) {
  if (!real || !real->ingest) return std::nullopt;
  const ingest::IngestedFlightConfig& ingest = *real->ingest;
  flight_logs::Telemetry log;
  if (!ingest.telemetry.empty()) {
    log = ingest::read_flight_log(ingest.telemetry);
  } else if (!ingest.video.empty() && fs::exists(ingest.video)) {
    try {
      if (auto own = ingest::read_embedded_telemetry({ingest.video})) log = std::move(own->telemetry);
    } catch (const InputError&) {  // `ingest` warns of it
    }
  }
  if (!log.zero_utc_s || log.fixes.empty()) return std::nullopt;
  return *log.zero_utc_s + log.fixes.front().time_s;
}

}  // namespace

Pipeline::Pipeline(const Experiment& experiment, fs::path folder, const StageCache& cache)
    : experiment_(experiment), folder_(std::move(folder)), cache_(cache) {
  const auto add_simulated = [&] {
    if (experiment_.simulated) flights_.push_back({"simulated", *experiment_.simulated, folder_ / "simulated"});
  };
  if (!simulated_follows_real()) add_simulated();
  if (experiment_.real) flights_.push_back({"real", *experiment_.real, folder_ / "real"});
  if (simulated_follows_real()) add_simulated();
  built_in_ = find_built_in(experiment_);
}

bool Pipeline::simulated_follows_real() const {
  return experiment_.simulated && experiment_.simulated->render && experiment_.simulated->render->follows_real;
}

Experiment Pipeline::make_variant(const Variant& variant) const {
  Experiment changed = experiment_;
  changed.name = experiment_.name + "/" + variant.name;
  changed.simulated->render = variant.render;
  changed.real.reset();
  changed.variants.clear();
  // Sections without a change keep their text, so that their stages have the keys of this run's and are taken over.
  if (!variant.yaml_text.empty()) changed.sections["simulated"] += "\n" + variant.yaml_text;
  if (changed.simulated->render->follows_real) {
    changed.simulated->render->follows_real = false;
    changed.simulated->render->flight = folder_ / "simulated/flight/flight.yaml";
  }
  if (variant.place) changed.place = *variant.place;
  if (variant.texture_scale) changed.place.texture_scale = *variant.texture_scale;
  if (variant.voxel_m && *variant.voxel_m != changed.truth.voxel_m) {
    changed.truth.voxel_m = *variant.voxel_m;
    changed.sections["truth"] += "\nvoxel: " + std::to_string(*variant.voxel_m);
  }
  if (variant.odometry) changed.odometry = *variant.odometry;
  if (variant.seed) changed.seed = *variant.seed;
  for (const auto& [name, text] : variant.sections) changed.sections[name] = text;
  return changed;
}

std::vector<OdometryRun> Pipeline::runs(const FlightStages& flight) const {
  const OdometryConfig& settings = experiment_.odometry;
  std::vector<OdometryRun> runs;
  for (const bool backwards : {false, true}) {
    if (backwards && !settings.backwards) continue;
    for (int k = 0; k < settings.runs; ++k) {
      OdometryRun run{.name = flight.name, .folder = flight.folder, .options = settings.options, .frames = {}};
      run.options.initialization.seed += static_cast<std::uint32_t>(k);
      run.frames.from = static_cast<std::size_t>(k) * static_cast<std::size_t>(settings.start_offset_frames);
      run.frames.reverse = backwards;
      run.is_repeat = !runs.empty();
      if (run.is_repeat) {
        const std::string own = "runs/" + std::to_string(k + 1) + (backwards ? "-backwards" : "");
        run.name += "/" + own;
        run.folder /= own;
      }
      runs.push_back(std::move(run));
    }
  }
  return runs;
}

std::vector<OdometryRun> Pipeline::find_runs(const std::string& flight) const {
  const auto found = std::ranges::find(flights_, flight, &FlightStages::name);
  return found == flights_.end() ? std::vector<OdometryRun>{} : runs(*found);
}

std::vector<std::string> Pipeline::evaluation_products(const OdometryRun& run) const {
  return {run.name + "/metrics.json", run.name + "/errors.ply"};
}

std::vector<std::string> Pipeline::odometry_products(const OdometryRun& run) const {
  std::vector<std::string> products{run.name + "/odometry"};
  if (experiment_.odometry.debug_pictures) products.push_back(run.name + "/keyframe_pictures");
  return products;
}

void Pipeline::build_place(const fs::path& folder, const Progress& progress) const {
  const base::OutputFolder output{.folder = folder, .command = "scene", .replace = true, .inputs = {}};
  base::write_folder(output, [&](const fs::path& temporary) {
    demo_place::write_place(
        temporary, built_in_->kind,
        {.seed = built_in_->seed.value_or(experiment_.place.seed), .texture_scale = experiment_.place.texture_scale},
        progress);
  });
}

std::string Pipeline::resolve_source(const std::string& source) const {
  const auto built_in = demo_place::built_in_source(source);
  return built_in ? (folder_ / "place" / built_in->model / "tileset.json").string() : source;
}

std::string Pipeline::source_fingerprint(const std::string& source) const {
  if (demo_place::built_in_source(source)) return cache_.key("place");
  // For a network source only the name is hashed; comparing its content would require downloading everything again.
  if (fetch::is_network_source(source)) return fetch::redact_source(source);
  const fs::path files = fetch::local_path_of_source(source);
  if (files.empty()) throw InputError(source, "no such file or folder");
  return cache_.content_hash(files);
}

fetch::SourceOptions Pipeline::source_options() const {
  fetch::SourceOptions options = experiment_.source_options;
  options.terms_accepted = options.terms_accepted || experiment_.place.terms_accepted;
  return options;
}

std::string Pipeline::section_hash(const std::string& name) const {
  const auto found = experiment_.sections.find(name);
  if (found == experiment_.sections.end() || found->second.empty()) return "";
  // Hashed, since it is stored beside the results and substituted variables may be secret. Another key opens the same
  // tiles.
  return base::sha256_hex(fetch::mask_secrets(found->second, fetch::find_secrets(experiment_.place.source)));
}

place::ExtractSettings Pipeline::extract_settings() const {
  const SiteConfig& place = experiment_.place;
  return {.source = resolve_source(place.source),
          .load = {.center = place.center,
                   .center_local = place.center_local,
                   .size = place.size,
                   .error_m = place.error_m,
                   .origin = place.origin,
                   .source = source_options()},
          .voxel_m = experiment_.truth.voxel_m,
          .samples_per_m2 = experiment_.truth.samples_per_m2,
          .block_m = experiment_.truth.block_m};
}

/// The cameras see more of the place than is scored: the tiles in their view, at the resolution of their images, as
/// `render` selects them; or, with a margin, the finest tiles of the region, grown on every side in the truth's frame.
recording::RenderSettings Pipeline::render_settings(const FlightStages& flight) const {
  recording::RenderedFlightConfig render = *flight.flight.render;
  if (render.follows_real) {
    render.flight = flight.folder / "flight/flight.yaml";
    const double line_delay_s = imaging::read_calibration(flight.folder / "flight/camera.yaml").line_delay_s;
    if (!render.degrade && line_delay_s != 0.0) render.degrade = render::ImageFormation{.line_delay_s = line_delay_s};
  }
  if (render.follows_real && render.degrade && render.degrade->light && !render.degrade->light->utc_s)
    render.degrade->light->utc_s = start_utc_s(experiment_.real);
  const place::ExtractResult truth = place::read_extract_json(folder_ / "truth");
  const geometry::Box3 scored = truth.scored_region().box;
  const geometry::Vec3 middle = truth.region->center, size = truth.region->size;
  constexpr double kErrorInView_px = 1.0;
  const double margin = 2 * experiment_.place.view_margin_m.value_or(0.0);
  if (!render.error_px && !experiment_.place.view_margin_m) render.error_px = kErrorInView_px;
  std::optional<std::uintmax_t> memory_bytes;
  if (render.memory_gb) memory_bytes = static_cast<std::uintmax_t>(*render.memory_gb * 1e9);
  return {.source = resolve_source(render.source.empty() ? experiment_.place.source : render.source),
          .load = {.center_local = middle,
                   .size = geometry::Vec3(size[0] + margin, size[1] + margin, size[2] + margin),
                   .error_m = experiment_.place.error_m,
                   .origin = truth.origin,
                   .source = source_options()},
          .flight = render,
          .seed = experiment_.seed,
          .error_px = render.error_px,
          .max_memory_bytes = memory_bytes,
          .scored = scored,
          .resume = true,
          .asked = dataset_inputs(flight)};
}

json Pipeline::place_inputs() const {
  if (!built_in_) return {};
  return {{"kind", demo_place::place_names()[static_cast<std::size_t>(built_in_->kind)].name},
          {"seed", built_in_->seed.value_or(experiment_.place.seed)},
          {"texture_scale", experiment_.place.texture_scale}};
}

std::string Pipeline::place_key() const {
  return base::sha256_hex(json{{"program", base::program_fingerprint()}, {"built-in place", place_inputs()}}.dump());
}

json Pipeline::truth_inputs() const {
  return {{"place", section_hash("place")},
          {"truth", section_hash("truth")},
          {"tiles", source_fingerprint(experiment_.place.source)}};
}

std::string Pipeline::truth_key() const {
  const place::ExtractSettings settings = extract_settings();
  const auto geodetic = [](const std::optional<geometry::Geodetic>& g) {
    return g ? json{g->latitude_deg, g->longitude_deg, g->height.m} : json();
  };
  const auto vector = [](const std::optional<geometry::Vec3>& v) { return v ? json{v->x(), v->y(), v->z()} : json(); };
  const json content{{"program", base::program_fingerprint()},
                     {"tiles", source_fingerprint(experiment_.place.source)},
                     {"center", geodetic(settings.load.center)},
                     {"center_local", vector(settings.load.center_local)},
                     {"size", vector(settings.load.size)},
                     {"error", settings.load.error_m},
                     {"origin", geodetic(settings.load.origin)},
                     {"terms_accepted", settings.load.source.terms_accepted},
                     {"voxel", settings.voxel_m},
                     {"samples_per_m2", settings.samples_per_m2},
                     {"block", settings.block_m ? json(*settings.block_m) : json()}};
  return base::sha256_hex(content.dump());
}

json Pipeline::dataset_inputs(const FlightStages& f) const {
  json inputs{{"settings", section_hash(f.name)}, {"seed", experiment_.seed}};
  if (experiment_.has_place()) inputs["truth"] = cache_.key("truth");
  if (f.flight.render) {
    const std::string& own = f.flight.render->source;
    inputs["tiles"] = source_fingerprint(own.empty() ? experiment_.place.source : own);
    if (!f.flight.render->camera.empty()) inputs["camera"] = FileHashCache::hash_yaml_content(f.flight.render->camera);
    inputs["flight"] =
        f.flight.render->follows_real ? json(cache_.key(f.name + "/flight")) : flight_inputs(f.flight.render->flight);
  }
  if (f.flight.ingest) {
    const ingest::IngestedFlightConfig& ingest = *f.flight.ingest;
    for (const fs::path& file : {ingest.video, ingest.telemetry, ingest.groundtruth}) {
      inputs["files"].push_back(file.empty() ? json() : json(cache_.content_hash(file)));
    }
    for (const fs::path& file : {ingest.imu, ingest.imu_noise}) {
      if (!file.empty()) inputs["imu"].push_back(cache_.content_hash(file));
    }
    for (const ingest::CameraVideo& one : ingest.videos) inputs["files"].push_back(cache_.content_hash(one.video));
    if (!ingest.camera.empty()) inputs["camera"] = FileHashCache::hash_yaml_content(ingest.camera);
    if (ingest.videos.empty()) return inputs;
    for (const fs::path& file : vehicle::referenced_files(ingest.camera))
      inputs["rig"].push_back(FileHashCache::hash_yaml_content(file));
  }
  return inputs;
}

json Pipeline::followed_inputs() const {
  json inputs{{"dataset", cache_.key("real/dataset")},
              {"alignment", cache_.key("real/alignment")},
              {"smooth", flight_path::smoothing_text(experiment_.simulated->render->smoothing)}};
  if (experiment_.real->reference_tiles) inputs["localization"] = cache_.key("real/localization");
  return inputs;
}

json Pipeline::reproduction_inputs() const {
  return {{"simulated", cache_.key("simulated/dataset")},
          {"real", cache_.key("real/alignment")},
          {"truth", cache_.key("truth")}};
}

json Pipeline::odometry_inputs(const FlightStages& f, const OdometryRun& run) const {
  json inputs{{"dataset", cache_.key(f.name + "/dataset")}, {"odometry", section_hash("odometry")}};
  if (run.is_repeat) {
    inputs["run"] = {
        {"seed", run.options.initialization.seed}, {"from", run.frames.from}, {"backwards", run.frames.reverse}};
  }
  if (const fs::path& mask = experiment_.odometry.track_options.mask; !mask.empty())
    inputs["mask"] = cache_.content_hash(mask);
  for (const fs::path& file : odometry_program_files(experiment_))
    inputs["program"].push_back(cache_.content_hash(file));
  return inputs;
}

json Pipeline::alignment_inputs(const FlightStages& flight, const OdometryRun& run) const {
  json inputs{{"odometry", cache_.key(run.name + "/odometry")},
              {"truth", cache_.key("truth")},
              {"alignment", section_hash("alignment")}};
  if (experiment_.alignment.start == alignment::AlignmentStart::kGiven) {
    const geometry::Mat4 start = experiment_.alignment.given_start.matrix();
    inputs["start"] = std::vector<double>(start.data(), start.data() + start.size());
  }
  if (!experiment_.alignment.find_regions) return inputs;
  for (const FlightStages& other : flights_) {
    if (other.name != flight.name && cache_.is_done(other.name + "/odometry"))
      inputs["others"].push_back(cache_.key(other.name + "/odometry"));
  }
  return inputs;
}

std::vector<scoring::MapInputs> Pipeline::other_flights_maps(const FlightStages& flight) const {
  std::vector<scoring::MapInputs> others;
  for (const FlightStages& other : flights_) {
    if (other.name != flight.name && cache_.is_done(other.name + "/odometry"))
      others.push_back(scoring::find_map_inputs(other.folder / "odometry", other.folder / "dataset"));
  }
  return others;
}

json Pipeline::localization_inputs(const OdometryRun& run) const {
  return {{"alignment", cache_.key(run.name + "/alignment")}};
}

json Pipeline::evaluation_inputs(const FlightStages& flight, const OdometryRun& run) const {
  if (!experiment_.has_place()) return {{"odometry", cache_.key(run.name + "/odometry")}};
  json inputs{{"alignment", cache_.key(run.name + "/alignment")}, {"evaluation", section_hash("evaluation")}};
  if (flight.flight.reference_tiles) inputs["localization"] = cache_.key(run.name + "/localization");
  return inputs;
}

json Pipeline::comparison_inputs() const {
  json inputs{{"evaluation", section_hash("evaluation")}, {"seed", experiment_.seed}};
  for (const FlightStages& f : flights_) {
    for (const OdometryRun& run : runs(f)) {
      if (cache_.is_done(run.name + "/evaluation")) inputs[f.name].push_back(cache_.key(run.name + "/evaluation"));
    }
  }
  return inputs;
}

json Pipeline::failure_inputs() const {
  return {{"simulated", cache_.key("simulated/evaluation")},
          {"real", cache_.key("real/evaluation")},
          {"evaluation", section_hash("evaluation")},
          {"seed", experiment_.seed}};
}

}  // namespace tileflight::experiment
