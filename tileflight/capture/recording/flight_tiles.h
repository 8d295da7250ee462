#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/capture/recording/frame_groups.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/tiles/fetch/tile_source.h"
#include "tileflight/tiles/tileset/bounding_volume.h"
#include "tileflight/tiles/tileset/content_records.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/tiles/tileset/selection.h"
#include "tileflight/tiles/tileset/tileset_tree.h"

namespace tileflight::recording {

/// Surfaces farther away than this do not count when it is determined whether a camera is inside a solid. The result
/// must depend neither on memory nor on the process that renders the frame.
inline constexpr double kInsideReach_m = 64.0;

/// The tiles of a flight: for each group of its frames (frame_groups.h) the cut that is fine enough for the nearest
/// camera of the group; without a pixel error, the cut of a region for all frames. Contents are numbered over all cuts,
/// in the order in which the cuts name them first. Not thread safe.
class FlightTiles {
 public:
  /// Opens the source and selects the cuts; reads no content. Flight and settings must outlive it. Throws InputError.
  FlightTiles(const PlannedFlight& mission, const RenderSettings& settings, const Progress& progress);

  const std::string& name() const { return name_; }  ///< of the source, for messages
  const tileset::Placement& placement() const { return placement_; }
  const FrameGroups& groups() const { return groups_; }
  const ImageOrder& images() const { return images_; }
  /// Returns the SHA-256 that names all cuts: that of a single group's cut (TileCut::hash), or over those of all
  /// groups.
  const std::string& cut_hash() const { return cut_.hash; }
  std::size_t content_count() const { return cut_.contents.size(); }
  const tileset::CutContent& content(std::size_t content) const { return cut_.contents[content]; }
  /// Returns how many contents were read, those read again included.
  std::int64_t read_count() const { return read_count_; }
  /// Returns the size of a content's file, if the source knows it.
  std::optional<std::uintmax_t> file_bytes(const tileset::CutContent& content) const;

  /// Tells whether surfaces have neither textures nor vertex colours (tileset::lacks_textures).
  bool lacks_textures() const { return lacks_textures_; }

  /// Returns the contents of a group's cut, in its order.
  const std::vector<std::size_t>& contents_of_group(std::size_t group) const { return contents_of_group_[group]; }
  /// Returns the contents that a frame needs, as ascending indices into contents_of_group(): those that it may show,
  /// those within kInsideReach_m of the camera or below it, and those near its way to the next frame.
  std::vector<std::size_t> places_for_frame(std::size_t image) const;

  /// Tells whether the tiles of a region are loaded, also those that no frame shows if all fit into memory.
  bool is_region() const { return !error_px_; }
  /// Returns the pixel error for which tiles are selected; nullopt: the tiles are those of a region.
  const std::optional<double>& error_px() const { return error_px_; }

  /// Returns the contents that a frame would need if its group's cut were selected with another pixel error.
  std::vector<tileset::CutContent> contents_for_frame(std::size_t image, double error_px);

  /// Reads contents, in this order; an unreadable one is empty and states its failure. Throws InputError for the first
  /// of these unless LoadOptions::allow_incomplete.
  std::vector<tileset::LoadedContent> read(const std::vector<std::size_t>& contents);

  /// Reads, and releases, the contents that neither this process nor an earlier one has read, so that the summary does
  /// not depend on how a region was rendered.
  void read_rest();

  /// Returns the records of the contents read since the last call, for add_records() of another process; null: none.
  nlohmann::json take_new_records();
  /// Adds records of contents that another process has read. Unreadable records are ignored.
  void add_records(const nlohmann::json& records);
  /// Returns the summary of all cuts, as far as their contents have been read, in the form of load_region()'s result
  /// but without meshes and clouds.
  tileset::LoadedTiles summary() const;

 private:
  void select_groups(const Progress& progress);
  std::vector<tileset::CutContent> contents_to_try();
  tileset::TileCut select_group(std::size_t group, double error_px);
  void add_group(std::size_t group);
  std::size_t number_of(const tileset::CutContent& content);
  std::function<bool(const tileset::BoundingSphere& sphere)> needs_of(std::size_t image) const;
  std::function<bool(const tileset::BoundingSphere& sphere)> needs_of_path(std::size_t image) const;
  const PlannedCamera& camera_of(std::size_t image) const { return mission_.camera(images_[image].camera); }
  tileset::BoundingSphere sphere_of(const tileset::CutContent& content) const;

  const PlannedFlight& mission_;
  ImageOrder images_;
  std::vector<std::vector<tileset::ViewCone>> cones_;  ///< of each image
  tileset::LoadOptions load_;
  std::optional<double> error_px_;
  std::string name_;
  std::unique_ptr<fetch::TileSource> source_;
  tileset::TilesetTree tree_;
  tileset::Placement placement_;
  FrameGroups groups_;
  tileset::TileCut cut_;                          ///< all contents by number
  std::vector<tileset::BoundingSphere> spheres_;  ///< of each content, local frame
  std::vector<std::vector<std::size_t>> contents_of_group_;
  std::map<std::pair<tileset::NodeId, std::size_t>, std::size_t> numbers_;
  bool lacks_textures_ = false;
  std::vector<std::string> first_warnings_;  ///< of the source before any content was read
  std::vector<std::optional<tileset::ContentRecord>> records_;
  std::vector<std::size_t> new_records_;
  std::int64_t read_count_ = 0;
};

}  // namespace tileflight::recording
