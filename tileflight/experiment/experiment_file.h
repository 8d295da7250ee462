#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/alignment/align_map.h"
#include "tileflight/dataset/video.h"
#include "tileflight/experiment/render_outputs.h"
#include "tileflight/experiment/track_extras.h"
#include "tileflight/flight/smoothing.h"
#include "tileflight/geometry/geodesy.h"
#include "tileflight/geometry/yaml_section.h"
#include "tileflight/odometry/options.h"
#include "tileflight/sensors/image_formation.h"
#include "tileflight/tiles/open_source.h"

namespace tileflight::experiment {

/// `place:` what is flown over. Keys: source, center | center_local, size, error, origin, view_margin, texture_scale,
/// terms_accepted.
struct Place {
  std::string source;                          ///< tileset (SOURCE of the contract), or `stadium:twin`, `stadium:world`
  std::optional<geometry::Geodetic> center;    ///< center: [lat, lon] or [lat, lon, height]
  std::optional<geometry::Vec3> center_local;  ///< center_local: [x, y, z], metres
  std::optional<geometry::Vec3> size;          ///< size: [east, north, up], metres
  double error_m = 0.0;                        ///< error: geometric error wanted; 0: the finest there is
  std::optional<geometry::Geodetic>
      origin;  ///< origin: [lat, lon, height] of the local frame, or of a tileset without georeference
  double view_margin_m = 250.0;  ///< view_margin: how much of the place around the region the cameras can see
  double texture_scale = 1.0;    ///< texture_scale: of the built-in place (smaller: quicker, blurrier)
  bool terms_accepted = false;   ///< terms_accepted: the user's agreement allows what the provider's terms forbid
};

/// `truth:` what is taken from the place to score against. Keys: voxel, samples_per_m2.
struct Truth {
  double voxel_m = 1.0;
  double samples_per_m2 = 16.0;
};

/// `render:` a flight through the place's tiles. Keys: flight | follow, smooth, camera, source, resolution,
/// samples_per_pixel, max_frames, outputs, degrade.
struct RenderFlight {
  std::filesystem::path flight;  ///< FLIGHT file; empty where another flight is followed
  bool follows_real = false;     ///< follow: real: where the second flight was found to be, with its lens
  /// smooth: of the path that is followed ("auto", "none", seconds between knots); none: through every pose.
  std::optional<flight::SmoothingOptions> smoothing = flight::SmoothingOptions{};
  std::filesystem::path camera;      ///< a calibration instead of the flight's; empty: the flight's
  std::string source;                ///< another model of the same place; empty: the place's
  std::optional<int> width, height;  ///< the flight's camera over another image size; both or none
  int samples_per_pixel = 1;
  std::optional<int> max_frames;
  RenderOutputs outputs;                           ///< outputs: a list of words, "depth, flow"
  std::optional<sensors::ImageFormation> degrade;  ///< what makes the second flight's camera less than perfect
  std::optional<dataset::VideoRate> video;  ///< video_crf, video_bitrate: through H.264 and back; none: no compression
};

/// `ingest:` a flight that was filmed. Keys: video, camera, camera_id, telemetry, telemetry_height, takeoff_height,
/// telemetry_offset, groundtruth, from, to, every, fps.
struct IngestFlight {
  std::filesystem::path video;  ///< video file or folder of images
  std::filesystem::path camera;
  std::string
      camera_id;  ///< which of several cameras in the file: COLMAP's CAMERA_ID, Kalibr's cam0; empty: the only one
  std::filesystem::path telemetry;           ///< flight::read_telemetry; empty: none
  std::string telemetry_height;              ///< ellipsoid | sea-level | takeoff; what the log's heights are above
  std::optional<double> takeoff_height_m;    ///< of the take-off place above the ellipsoid, where heights are above it
  std::optional<double> telemetry_offset_s;  ///< added to the log's times; none: estimated while aligning
  bool finds_telemetry_offset = false;       ///< telemetry_offset: auto; by the motion that both have seen
  std::filesystem::path groundtruth;         ///< TUM poses for scoring; empty: none
  double from_s = 0.0;
  std::optional<double> to_s;
  int every = 1;
  std::optional<double> fps;  ///< of a folder of images without times
};

/// One flight of the experiment: rendered or ingested.
struct Flight {
  std::string kind;  ///< "simulated", "video" or "surrogate"
  std::optional<RenderFlight> render;
  std::optional<IngestFlight> ingest;
};

/// `variants:` the simulated flight once more, with something changed. Keys: name, flight, camera, resolution,
/// samples_per_pixel, degrade (in place of the flight's own), texture_scale.
struct Variant {
  std::string name;     ///< letters, digits, '-' and '_': also its folder's name
  RenderFlight render;  ///< the simulated flight's with the changes
  std::optional<double> texture_scale;
  std::string text;  ///< what it says, to tell whether it changed
};

/// `odometry:` our own with its settings, or an outside program.
struct Odometry {
  odometry::OdometryOptions options;
  TrackExtras extras;           ///< mask, rectify_fov, colmap
  bool debug_pictures = false;  ///< debug_pictures: a picture of each keyframe in DIR/<flight>/keyframe_pictures
  /// A shell command with {dataset} and {out} filled in, which runs in the experiment file's folder; it must leave
  /// trajectory.txt and map.ply in {out}.
  std::string command;
  int runs = 1;            ///< runs: how often each flight is tracked, each time with the next seed
  int later = 0;           ///< later: frames that each run begins after the one before
  bool backwards = false;  ///< backwards: each of the runs is done once more with the frames played backwards
};

/// `evaluation:` Keys: cutoff, thresholds, equivalence_margin, ratio_margin, share_margin, completeness_margin,
/// lacking_margin, path_margin, completeness_samples_per_m2, entropy_radius, agreement_cell.
struct EvaluationSettings {
  double cutoff_m = 1.0;
  std::vector<double> thresholds_m{0.1, 0.2, 0.5, 1.0};
  double equivalence_margin_m = 0.05;  ///< of the published measure
  // What counts as the same in the comparison of two maps; why so much: evaluation::MapComparisonOptions.
  double ratio_margin = 1.25;        ///< of median and RMS distance to the surface
  double share_margin = 0.05;        ///< of the shares of map points
  double completeness_margin = 1.1;  ///< ratio
  double lacking_margin = 0.01;      ///< of the share that one map lacks of what the other covers
  double path_margin_m = 0.1;
  double completeness_samples_per_m2 = 4.0;
  double entropy_radius_m = 2.0;  ///< of the neighbourhoods that the map's own sharpness is judged in
  double agreement_cell_m = 2.0;  ///< edge of the cells in which both flights' maps are compared
};

/// EXPERIMENT.yaml, paths resolved (relative to the file), `${VAR}` filled in.
struct Experiment {
  std::filesystem::path file;
  std::string name;
  std::uint64_t seed = 1;
  Place place;
  Truth truth;
  std::optional<Flight> simulated;
  std::optional<Flight> real;
  std::vector<Variant> variants;  ///< of the simulated flight
  Odometry odometry;
  alignment::AlignMapOptions alignment;
  EvaluationSettings evaluation;
  tiles::SourceOptions source_options;          ///< of sources from the network; set by who has them (command line)
  std::map<std::string, std::string> sections;  ///< what each top-level section says, to tell whether it changed
};

/// The keys of `degrade:`, of an experiment's section or of a file of their own, into the flight. Throws InputError.
void read_degrade(geometry::YamlSection& section, RenderFlight& flight);

/// The files that the words of `odometry.command` name (command_files.h).
std::vector<std::filesystem::path> files_of_command(const Experiment& experiment);

/// Throws InputError (file, line, key): unknown keys name the nearest known one; wrong types; missing files; unset
/// variables.
Experiment read_experiment(const std::filesystem::path& file);

}  // namespace tileflight::experiment
