#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/flight_path/smooth_path.h"
#include "tileflight/capture/ingest/ingest_stage.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/data/video/video.h"
#include "tileflight/evaluation/scoring/evaluation_settings.h"
#include "tileflight/slam/external_systems/adapter.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/track.h"
#include "tileflight/tiles/fetch/open_source.h"

namespace tileflight::experiment {

/// Returns the files that the words of a shell command name, each once, in order: by their path, relative to `folder`
/// (the command's working directory), or as programs in PATH. A name may follow a '=', as in `--config=slam.yaml`.
/// Files named inside those files are not searched for.
std::vector<std::filesystem::path> find_command_files(const std::string& command, const std::filesystem::path& folder);

/// Section `place:`: the site of the flights. Keys: source, center | center_local, size, error, origin, view_margin,
/// texture_scale, terms_accepted.
struct SiteConfig {
  std::string source;                          ///< tileset (SOURCE of the contract), or `stadium:twin`, `stadium:world`
  std::optional<geometry::Geodetic> center;    ///< center: [lat, lon] or [lat, lon, height]
  std::optional<geometry::Vec3> center_local;  ///< center_local: [x, y, z], metres
  std::optional<geometry::Vec3> size;          ///< size: [east, north, up], metres
  double error_m = 0.0;                        ///< error: geometric error; 0: the finest available
  std::optional<geometry::Geodetic>
      origin;  ///< origin: [lat, lon, height] of the local frame, or of a tileset without georeference
  /// view_margin: cameras see the finest tiles of the region and of so much around it; nullopt: the tiles in their
  /// view.
  std::optional<double> view_margin_m;
  double texture_scale = 1.0;   ///< texture_scale: of the built-in place (smaller: faster, blurrier)
  std::uint64_t seed = 1;       ///< of the built-in place: the experiment's, also in a variant with another
  bool terms_accepted = false;  ///< terms_accepted: an agreement permits what the provider's terms forbid
};

/// Section `truth:`: resolution of the extracted ground truth. Keys: voxel, samples_per_m2, block (auto, or metres).
struct TruthConfig {
  double voxel_m = 1.0;
  double samples_per_m2 = 16.0;
  std::optional<double> block_m;  ///< edge of its blocks; 0: by memory; nullopt: one piece
};

/// One flight of the experiment: rendered or ingested.
struct FlightConfig {
  std::string kind;  ///< "simulated", "video" or "surrogate"
  std::optional<recording::RenderedFlightConfig> render;
  std::optional<ingest::IngestedFlightConfig> ingest;
  bool reference_tiles = false;  ///< reference: tiles; the path is compared with where its images are in the place
};

/// Section `odometry:`: settings of the built-in odometry, or an external program, which takes `runs` and `seed` alone.
struct OdometryConfig {
  odometry::OdometryOptions options;
  odometry::TrackOptions track_options;  ///< mask, rectify_fov, colmap
  bool debug_pictures = false;           ///< debug_pictures: keyframe images in DIR/<flight>/keyframe_pictures
  /// A shell command with {dataset} and {out} substituted, executed in the experiment file's folder; it must write
  /// trajectory.txt and map.ply into {out}.
  std::string command;
  /// system: another SLAM system by its adapter (docs/systems.md); not together with `command`.
  std::optional<external_systems::Adapter> system;
  int runs = 1;                 ///< runs: number of times each flight is tracked, each with the next seed
  int start_offset_frames = 0;  ///< number of frames by which each run starts later than the one before
  bool backwards = false;       ///< backwards: each run is repeated with the frames in reverse order

  bool is_built_in() const { return command.empty() && !system; }
};

/// Section `variants:`: the simulated flight with changes. Keys: name, flight, camera, resolution, samples_per_pixel,
/// degrade (replaces the flight's), texture_scale; place (a whole one if it has a source, else keys that replace those
/// of the experiment's), voxel, odometry (replaces the experiment's), seed.
struct Variant {
  std::string name;                        ///< letters, digits, '-' and '_'; also the folder's name
  recording::RenderedFlightConfig render;  ///< the simulated flight's settings with the changes
  std::optional<double> texture_scale;
  std::optional<SiteConfig> place{};  ///< with what it does not change
  std::optional<double> voxel_m{};
  std::optional<OdometryConfig> odometry{};
  std::optional<std::uint64_t> seed{};
  std::string yaml_text;                          ///< YAML text of the changes to the flight, to detect changes
  std::map<std::string, std::string> sections{};  ///< texts of `place` and `odometry`, to detect changes
};

/// Contents of EXPERIMENT.yaml, with paths resolved (relative to the file) and `${VAR}` substituted.
struct Experiment {
  std::filesystem::path file;
  std::string name;
  std::uint64_t seed = 1;
  SiteConfig place;  ///< without a source: none, which suffices for a filmed flight alone
  TruthConfig truth;
  std::optional<FlightConfig> simulated;
  std::optional<FlightConfig> real;
  std::vector<Variant> variants;  ///< of the simulated flight
  OdometryConfig odometry;
  alignment::AlignMapOptions alignment;
  scoring::EvaluationSettings evaluation;
  fetch::SourceOptions source_options;          ///< for network sources; set by the command line
  std::map<std::string, std::string> sections;  ///< text of each top-level section, to detect changes

  bool has_place() const { return !place.source.empty(); }
};

/// Reads the keys of `degrade:`, from an experiment's section or a separate file, into the flight. Throws InputError.
void read_degrade(base::StrictSection& section, recording::RenderedFlightConfig& flight);

/// Returns the files of an outside odometry: those that `odometry.command` names (find_command_files()), or those in
/// the folder of the adapter of `odometry.system`, except hidden ones and Python's caches, and the programs that it
/// needs.
std::vector<std::filesystem::path> odometry_program_files(const Experiment& experiment);

/// Reads an experiment file. Throws InputError (file, line, key): unknown keys (naming the nearest known one), wrong
/// types, missing files, unset variables.
Experiment read_experiment(const std::filesystem::path& file);

}  // namespace tileflight::experiment
