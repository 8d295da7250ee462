#include "tileflight/tiles/inspect.h"

#include <nlohmann/json.hpp>

#include <iomanip>
#include <sstream>

#include "command.h"
#include "inspect_place.h"
#include "source_options.h"

namespace tileflight::app {
namespace {

using nlohmann::json;

json levels_json(const tiles::TilesetSummary& s) {
  json levels = json::array();
  for (const tiles::LevelSummary& level : s.levels) {
    levels.push_back({{"tiles", level.tiles},
                      {"geometric_error_min", level.geometric_error_min_m},
                      {"geometric_error_max", level.geometric_error_max_m}});
  }
  return levels;
}

json center_json(const tiles::TilesetSummary& s) {
  if (!s.center) return nullptr;
  return {{"lat", s.center->latitude_deg}, {"lon", s.center->longitude_deg}, {"height", s.center->height.m}};
}

json to_json(const tiles::TilesetSummary& s) {
  const auto corner = [](const geometry::Vec3& v) { return json{v.x(), v.y(), v.z()}; };
  const auto known = [&](std::int64_t number) { return s.content_sizes_known ? json(number) : json(nullptr); };
  return {{"version", s.version},
          {"generator", s.generator},
          {"tiles", s.tiles},
          {"tiles_with_content", s.tiles_with_content},
          {"leaves", s.leaves},
          {"depth", s.depth()},
          {"refine", {{"REPLACE", s.tiles_replace}, {"ADD", s.tiles_add}}},
          {"tiles_unsupported", s.tiles_unsupported},
          {"contents", s.contents},
          {"content_files", s.content_files},
          {"content_files_missing", known(s.content_files_missing)},
          {"content_bytes", known(s.content_bytes)},
          {"external_tilesets", s.external_tilesets},
          {"subtrees", s.subtrees},
          {"levels", levels_json(s)},
          {"geometric_error", s.geometric_error_m ? json(*s.geometric_error_m) : json(nullptr)},
          {"extensions_used", s.extensions_used},
          {"extensions_required", s.extensions_required},
          {"extensions_unsupported", s.extensions_unsupported},
          {"georeferenced", s.georeferenced},
          {"center", center_json(s)},
          {"bounds", {{"min", corner(s.bounds_local.min())}, {"max", corner(s.bounds_local.max())}}},
          {"attribution", s.attribution},
          {"attribution_of_contents", s.contents_read},
          {"failures", s.failures},
          {"warnings", s.warnings}};
}

std::string list(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? "none" : text;
}

std::string inspect_summary(const tiles::TilesetSummary& s) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(1);
  text << "3D Tiles " << s.version << (s.generator.empty() ? "" : ", made by " + s.generator) << "\n"
       << s.tiles << " tiles, " << s.leaves << " of them leaves, " << s.depth() << " levels; refine: REPLACE "
       << s.tiles_replace << ", ADD " << s.tiles_add << "\ncontents:";
  for (const auto& [kind, count] : s.contents) text << " " << count << " " << kind;
  text << " (" << s.content_files << " files";
  if (s.content_sizes_known) {
    text << ", " << static_cast<double>(s.content_bytes) / 1e6 << " MB, " << s.content_files_missing << " missing";
  }
  text << "), " << s.external_tilesets << " external tilesets, " << s.subtrees << " subtrees\n";
  const geometry::Vec3 size = s.bounds_local.sizes();
  text << "extent: " << size.x() << " x " << size.y() << " x " << size.z() << " m, ";
  if (s.center) {
    text << std::setprecision(6) << "around " << s.center->latitude_deg << ", " << s.center->longitude_deg
         << std::setprecision(1) << ", " << s.center->height.m << " m above the ellipsoid\n";
  } else {
    const geometry::Vec3 middle = s.bounds_local.center();
    text << "not georeferenced, around (" << middle.x() << ", " << middle.y() << ", " << middle.z()
         << ") in its own frame\n";
  }
  for (std::size_t i = 0; i < s.levels.size(); ++i) {
    text << "  level " << i << ": " << s.levels[i].tiles << " tiles, geometric error " << std::setprecision(3)
         << s.levels[i].geometric_error_min_m << " to " << s.levels[i].geometric_error_max_m << " m\n";
  }
  text << "extensions required: " << list(s.extensions_required)
       << "; not supported: " << list(s.extensions_unsupported) << "\nattribution: " << list(s.attribution) << " ("
       << s.contents_read << " of " << s.content_files << " tile files read)\n";
  for (const std::string& failure : s.failures) text << "broken: " << failure << "\n";
  for (const std::string& warning : s.warnings) text << "note: " << warning << "\n";
  return text.str();
}

}  // namespace

void add_inspect(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    std::string source;
    SourceArguments arguments;
    InspectPlaceOptions place;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "inspect",
      "contents of a tileset: depth, tiles, formats, extent, errors, attribution; map from above; ground heights");
  command->footer(
      "Examples:\n  tileflight inspect tiles/tileset.json\n"
      "The place from above with its grid and heights, and a proposed region and voxel size:\n"
      "  tileflight inspect tiles/ --map place.png\n"
      "Ground heights at two points:\n"
      "  tileflight inspect tiles/ --at 35.310344,-80.740007 --at 35.310544,-80.740207");
  command->add_option("SOURCE", options->source, kSourceHelp)->required();
  add_inspect_place_options(*command, options->place);
  add_source_options(*command, options->arguments);
  add_common_options(*command, common);
  command->callback([options, command, &selection] {
    selection.run = [options, command](const CommonOptions&, const Progress& progress) -> Output {
      const transport::SourceOptions source = source_options(options->arguments);
      check_inspect_place(*command, options->place);
      Output output{nlohmann::json::object(), ""};
      if (tells_whole_tileset(options->place, options->source)) {
        const tiles::TilesetSummary s = tiles::inspect_tileset(options->source, source, progress);
        output = {to_json(s), inspect_summary(s)};
      }
      inspect_place(options->source, source, *command, options->place, output, progress);
      return output;
    };
  });
}

}  // namespace tileflight::app
